//! What form factors have to obey.

use std::ops::Range;

use rayon::prelude::*;

use super::{At, Audit, Law, Worst};
use crate::form_factor::Reciprocity;
use crate::matrix::{Closed, DiskError, FormFactors, Precision};

/// Standard deviations that a count of rays may be off. With the same number of rays on top, a Poisson variable of any mean goes further by
/// chance less than once in 10^13, and so in a matrix of 10^10 pairs less than once in a thousand runs.
const SIGMAS: f64 = 8.0;

/// An estimate of an error comes from a coarser rule, and may be below the error; twice the estimate seldom is.
const ESTIMATES: f64 = 2.0;

/// What form factors claim about themselves beside their errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claims<'a> {
    /// The rows that sum to 1.
    pub closed: Closed<'a>,
    /// How far the method that they come from keeps reciprocity.
    pub reciprocity: Reciprocity,
    /// True if the entries have errors and the rows their tallies; else what rests on them is not checked.
    pub errors_known: bool,
    /// What a repair was to restore row sums to; 0 without one.
    pub row_tolerance: f64,
}

/// What was found about form factors.
#[derive(Clone, Debug)]
pub struct FormFactorAudit {
    /// The laws.
    pub audit: Audit,
    /// Σ_j (A_j F_ji − A_i F_ij), m², \[n\]: the power that form factors make out of a radiosity of 1 of patch i, less than 0 where they lose it.
    pub gain: Vec<f64>,
}

/// The laws of some rows.
#[derive(Clone, Default)]
struct Found {
    sign: Worst,
    exchange: Worst,
    reciprocity: Worst,
    closure: Worst,
    row_sum: Worst,
    gain: Vec<f64>,
}

/// Checks signs, bounds, reciprocity and row sums; one pass over F and its transpose.
///
/// Errors are those of the entries, where the method states any, and where rays were counted the deviations of counts. Rounding is
/// counted with n + 8 units in the last place of what is stored.
/// Source: Baranoski, Bramley and Shirley 1995, section 2, for closure and reciprocity. Departures: none.
///
/// # Errors
/// [`DiskError`] if the form factors cannot be read.
pub fn form_factors(factors: &FormFactors, claims: Claims<'_>) -> Result<FormFactorAudit, DiskError> {
    let blocks = factors.row_blocks().into_par_iter();
    let blocks: Vec<Found> = blocks.map(|rows| rows_of(factors, claims, rows)).collect();
    let mut all = Found::default();
    for found in blocks {
        all.sign = all.sign.and(found.sign);
        all.exchange = all.exchange.and(found.exchange);
        all.reciprocity = all.reciprocity.and(found.reciprocity);
        all.closure = all.closure.and(found.closure);
        all.row_sum = all.row_sum.and(found.row_sum);
        all.gain.extend(found.gain);
    }
    let mut audit = Audit::default();
    audit.checks.push(all.sign.check(Law::Sign));
    if factors.is_symmetric() || claims.reciprocity == Reciprocity::Exact || all.reciprocity.n_checked > 0 {
        audit.checks.push(all.reciprocity.check(Law::Reciprocity));
    } else {
        let reason = match claims.reciprocity {
            Reciprocity::ToNoise => "how many rays each entry is from is not known",
            _ => "the method does not promise it",
        };
        audit.skip(Law::Reciprocity, reason);
    }
    for (worst, law, reason) in [
        (all.exchange, Law::Exchange, "no entry is stored"),
        (
            all.closure,
            Law::Closure,
            "no row is known to sum to 1, and what escapes is not known",
        ),
        (all.row_sum, Law::RowSum, "closure says more"),
    ] {
        if worst.n_checked > 0 {
            audit.checks.push(worst.check(law));
        } else if claims.errors_known {
            audit.skip(law, reason);
        } else {
            audit.skip(law, "the errors of the entries are not known");
        }
    }
    factors.if_readable(FormFactorAudit { audit, gain: all.gain })
}

fn rows_of(factors: &FormFactors, claims: Claims<'_>, rows: Range<usize>) -> Found {
    let areas = factors.areas();
    let unit = match factors.storage().precision {
        Precision::F32 => f64::from(f32::EPSILON),
        Precision::F64 => f64::EPSILON,
    };
    let symmetric = factors.is_symmetric();
    // The area that one ray of each row stands for.
    let per_ray = |i: usize| factors.tallies()[i].effective_rays().map(|n| areas[i] / n);
    let mut found = Found::default();
    let mut sums = vec![(0.0, 0.0, 0.0); rows.len()];
    factors.for_each_pair(rows.clone(), 0, |i, j, pair| {
        let (value, error) = pair.there;
        let smaller = areas[i].min(areas[j]);
        let (there, back) = (areas[i] * value, areas[j] * pair.back.0);
        let rounding = 8.0 * unit * there.abs().max(back.abs());
        let rays = per_ray(i).zip(per_ray(j));
        found.sign.see((-value).max(0.0), 0.0, At::pair(i, j));
        let by_error = ESTIMATES * areas[i] * error + rounding;
        let (most, allowed) = match (claims.reciprocity, rays) {
            (Reciprocity::Exact, _) => (smaller, by_error),
            (Reciprocity::ToNoise, Some((a, b))) => (smaller, noise(smaller, a, b) + rounding),
            (Reciprocity::ToNoise | Reciprocity::NotPromised, _) => (areas[i], by_error),
        };
        if claims.errors_known {
            found.exchange.see((there - most).max(0.0), allowed, At::pair(i, j));
        }
        let defect = (there - back).abs();
        if symmetric || claims.reciprocity == Reciprocity::Exact {
            found.reciprocity.see(defect, rounding, At::pair(i, j));
        } else if claims.reciprocity == Reciprocity::ToNoise
            && let Some((a, b)) = rays
        {
            let by_noise = noise(there.max(back), a, b) + rounding;
            found.reciprocity.see(defect, by_noise, At::pair(i, j));
        }
        let (sum, errors, gain) = &mut sums[i - rows.start];
        *sum += value;
        *errors += error;
        *gain += back - there;
    });
    for (i, (sum, errors, gain)) in rows.zip(sums) {
        found.gain.push(gain);
        if !claims.errors_known {
            continue;
        }
        let tally = &factors.tallies()[i];
        // Rays that differ in weight are added up one by one.
        let n_added = tally.weights.map_or(0.0, |_| tally.n_rays as f64);
        let rounding = (factors.n_rows() as f64 + 8.0) * unit + n_added * f64::EPSILON + claims.row_tolerance;
        // Rays are counted once each, so that a row of them is complete whatever its noise.
        let allowed = if tally.n_rays > 0 {
            rounding
        } else {
            rounding + ESTIMATES * errors
        };
        match factors.lost(i, claims.closed) {
            Some(lost) => found.closure.see((1.0 - sum - lost).abs(), allowed, At::patch(i)),
            None => found.row_sum.see((sum - 1.0).max(0.0), allowed, At::patch(i)),
        }
    }
    found
}

/// Returns how far the difference of two counts with the mean area `exchange` may be off, where a ray stands for the areas `a` and `b`.
fn noise(exchange: f64, a: f64, b: f64) -> f64 {
    SIGMAS * ((exchange * (a + b)).sqrt() + a + b)
}
