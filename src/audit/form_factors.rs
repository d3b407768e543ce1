//! Conservation checks of form factors.

use super::{At, Audit, Law, Worst};
use crate::form_factor::Reciprocity;
use crate::matrix::{Closed, DiskError, FormFactors, Precision, RowBlock, RowTally};

/// Standard deviations that a count of rays may be off.
///
/// With the same number of rays on top, a Poisson variable of any mean goes further by
/// chance less than once in 10^13, and so in a matrix of 10^10 pairs less than once in a thousand runs.
const SIGMAS: f64 = 8.0;

/// The multiple of a stated error that is accepted: an estimate by a coarser rule may be below the error; twice the estimate seldom is.
const ESTIMATES: f64 = 2.0;

/// The most by which a pair or a row may exceed all light because of a rule's stated error.
///
/// If any stated error were accepted, a worse rule would pass more easily; noise beyond this has to be that of independent entries.
const BELIEVED: f64 = 1e-3;

/// The greatest error of the sum of a row whose errors are not known.
const UNKNOWN: f64 = 0.1;

/// The most rays of a patch that may slip out of a closed scene through the joint between two faces.
///
/// One in a million does, as on a ground of 150,000 triangles: more than two of one patch, of some hundred rays, by chance less than once in 10^8 rows.
const MAX_SLIPPED: u64 = 2;

/// The guarantees of form factors beside their errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claims<'a> {
    /// The rows that sum to 1.
    pub closed: Closed<'a>,
    /// The most by which rows that sum to 1 may fall short, as light may leave through gaps, \[n\].
    ///
    /// See [`Enclosed::may_escape`](crate::form_factor::Enclosed::may_escape). Empty if no light may leave.
    pub may_escape: &'a [f64],
    /// The reciprocity of the method that computed them.
    pub reciprocity: Reciprocity,
    /// True if the entries have errors and the rows their tallies; otherwise the checks that use these are skipped.
    pub errors_known: bool,
    /// The effect of a repair on the row sums.
    pub repair: Repair,
    /// True if errors are those of a quadrature rule, by which a pair or a row may exceed all light
    /// (see [`FormFactorMethod::errs_by_rule`](crate::form_factor::FormFactorMethod::errs_by_rule)).
    pub by_rule: bool,
}

/// The effect of a repair on the row sums.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Repair {
    /// There was none.
    #[default]
    Not,
    /// Rows that are known to sum to 1 do so within this.
    ///
    /// The losses of the other rows were counted by their own rays alone and have been changed: the sum of an open row differs
    /// from that count by the noise of both.
    Within(f64),
    /// It stopped before that, and rows are off by the noise of their sources.
    GaveUp,
}

/// The result of an audit of form factors.
#[derive(Clone, Debug)]
pub struct FormFactorAudit {
    /// The laws.
    pub audit: Audit,
    /// Σ_j (A_j F_ji − A_i F_ij), m², \[n\]: the power that form factors create from a radiosity of 1 of patch i; negative where they lose power.
    pub gain: Vec<f64>,
}

/// The checks of some rows.
#[derive(Clone, Default)]
struct Found {
    sign: Worst,
    exchange: Worst,
    reciprocity: Worst,
    closure: Worst,
    row_sum: Worst,
    gain: Vec<f64>,
}

impl Found {
    /// Returns the checks of both sets of rows; `later` has the later rows.
    fn and(mut self, later: &Self) -> Self {
        self.gain.extend(&later.gain);
        let [sign, exchange, reciprocity, closure, row_sum] = later.worst();
        Self {
            sign: self.sign.and(sign),
            exchange: self.exchange.and(exchange),
            reciprocity: self.reciprocity.and(reciprocity),
            closure: self.closure.and(closure),
            row_sum: self.row_sum.and(row_sum),
            gain: self.gain,
        }
    }

    fn worst(&self) -> [Worst; 5] {
        [self.sign, self.exchange, self.reciprocity, self.closure, self.row_sum]
    }

    fn of_numbers(numbers: &[[f64; Worst::N_NUMBERS]; 5]) -> Self {
        let [sign, exchange, reciprocity, closure, row_sum] = numbers.map(Worst::of_numbers);
        Self {
            sign,
            exchange,
            reciprocity,
            closure,
            row_sum,
            gain: Vec::new(),
        }
    }
}

/// Checks signs, bounds, reciprocity and row sums; one pass over F and its transpose.
///
/// Errors are those of the entries, where the method states any, and where rays were counted the deviations of counts. Rounding counts
/// as n + 8 units in the last place of the storage. Below the value of a law, twice the stated error is accepted, however large it is. Above all light, which is
/// impossible, at most 0.001 of it is accepted, or 8 standard deviations of a sum of independent entries if the errors are not those of a rule.
/// Source: Baranoski, Bramley and Shirley 1995, section 2, for closure and reciprocity. Departures: none.
///
/// # Errors
/// [`DiskError`] if the form factors cannot be read.
pub fn form_factors(factors: &FormFactors, claims: Claims<'_>) -> Result<FormFactorAudit, DiskError> {
    let blocks = factors.map_row_blocks(|block| rows_of(factors, claims, block));
    let own = blocks.iter().fold(Found::default(), Found::and);
    let of_ranks = factors.gathered(own.worst().map(Worst::numbers).as_flattened().to_vec());
    let of_ranks = of_ranks.as_chunks().0.as_chunks().0.iter().map(Found::of_numbers);
    let mut all = of_ranks.fold(Found::default(), |all, found| all.and(&found));
    all.gain = factors.gathered(own.gain);
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
    let [no_exchange, no_closure, no_row_sum] = if claims.errors_known {
        [
            "no entry is stored",
            "no row is known to sum to 1, and what escapes is not known",
            "closure says more",
        ]
    } else {
        ["the errors of the entries are not known"; 3]
    };
    for (worst, law, reason) in [
        (all.exchange, Law::Exchange, no_exchange),
        (all.closure, Law::Closure, no_closure),
        (all.row_sum, Law::RowSum, no_row_sum),
    ] {
        if worst.n_checked > 0 {
            audit.checks.push(worst.check(law));
        } else {
            audit.skip(law, reason);
        }
    }
    factors.if_readable(FormFactorAudit { audit, gain: all.gain })
}

fn rows_of(factors: &FormFactors, claims: Claims<'_>, block: &RowBlock<'_>) -> Found {
    let rows = block.rows.clone();
    let areas = factors.areas();
    let unit = unit(factors);
    let symmetric = factors.is_symmetric();
    // The area that one ray of each row stands for.
    let per_ray = |i: usize| factors.tallies()[i].effective_rays().map(|n| areas[i] / n);
    let mut found = Found::default();
    let mut sums = vec![Sums::default(); rows.len()];
    block.for_each_pair(0, |i, j, pair| {
        let (value, error) = pair.there;
        let smaller = areas[i].min(areas[j]);
        let (there, back) = (areas[i] * value, areas[j] * pair.back.0);
        let rounding = 8.0 * unit * there.abs().max(back.abs());
        let rays = per_ray(i).zip(per_ray(j));
        found.sign.see((-value).max(0.0), 0.0, At::pair(i, j));
        let by_error =
            |most: f64| areas[i] * believed(error, error * error, most / areas[i], claims.by_rule) + rounding;
        let (most, allowed) = match (claims.reciprocity, rays) {
            (Reciprocity::Exact, _) => (smaller, by_error(smaller)),
            (Reciprocity::ToNoise, Some((a, b))) => (smaller, noise(smaller, a, b) + rounding),
            (Reciprocity::ToNoise | Reciprocity::NotPromised, _) => (areas[i], by_error(areas[i])),
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
        let row = &mut sums[i - rows.start];
        row.add(value, error);
        row.gain += back - there;
    });
    for (i, row) in rows.zip(sums) {
        found.gain.push(row.gain);
        let allowed = |is_above: bool| row_error(factors, i, &row, claims, is_above);
        match excess(factors, claims, i, &row) {
            Some(excess) => found.closure.see(excess.abs(), allowed(excess > 0.0), At::patch(i)),
            None => found
                .row_sum
                .see((row.value - 1.0).max(0.0), allowed(true), At::patch(i)),
        }
    }
    found
}

/// Finds rows that are claimed to sum to 1 and are off by more than twice their stated error and their noise, \[n\].
///
/// Scaling removes the stated error of a rule, but these rows give no reason to be scaled to 1. Rows whose errors are not known may be off by 0.1.
///
/// # Errors
/// [`DiskError`] if the form factors cannot be read.
pub fn doubted_rows(factors: &FormFactors, claims: Claims<'_>) -> Result<Vec<bool>, DiskError> {
    let claims = Claims {
        repair: Repair::GaveUp,
        ..claims
    };
    let is_doubted = |i: usize| {
        let mut row = Sums::default();
        if !claims.closed.row(i) {
            return [0.0];
        }
        factors.for_each_in_row(i, |_, value, error| row.add(value, error));
        if !claims.errors_known {
            return [f64::from((row.value - 1.0).abs() > UNKNOWN)];
        }
        // Above 1, too, all of a stated error is accepted.
        let is_off = |excess: f64| excess.abs() > row_error(factors, i, &row, claims, false);
        [f64::from(excess(factors, claims, i, &row).is_some_and(is_off))]
    };
    let rows = factors.numbers_of_rows(is_doubted).into_iter();
    factors.if_readable(rows.map(|[doubted]| doubted > 0.0).collect())
}

/// Returns the sum of a row less its expected value, 1 less the known loss; `None` where the loss is unknown.
fn excess(factors: &FormFactors, claims: Claims<'_>, i: usize, row: &Sums) -> Option<f64> {
    let lost = factors.lost(i, claims.closed).filter(|_| claims.errors_known);
    lost.map(|lost| row.value - (1.0 - lost))
}

/// Sums over a row.
#[derive(Clone, Copy, Default)]
struct Sums {
    value: f64,
    error: f64,
    error_squared: f64,
    gain: f64,
}

impl Sums {
    fn add(&mut self, value: f64, error: f64) {
        self.value += value;
        self.error += error;
        self.error_squared += error * error;
    }
}

/// Returns one unit in the last place of the stored numbers.
fn unit(factors: &FormFactors) -> f64 {
    match factors.storage().precision {
        Precision::F32 => f64::from(f32::EPSILON),
        Precision::F64 => f64::EPSILON,
    }
}

/// Returns the greatest possible error of the sum of a row, above its expected value or below.
fn row_error(factors: &FormFactors, i: usize, row: &Sums, claims: Claims<'_>, is_above: bool) -> f64 {
    let rounding = (factors.n_rows() as f64 + 8.0) * unit(factors);
    let is_closed = claims.closed.row(i);
    let may_escape = claims.may_escape.get(i).filter(|_| is_closed && !is_above);
    let tally = &factors.tallies()[i];
    let has_slipped = is_closed && !is_above && tally.n_escaped <= MAX_SLIPPED;
    let slipped = tally.escaped().filter(|_| has_slipped).unwrap_or(0.0);
    rounding + slipped + may_escape.unwrap_or(&0.0) + beside_rounding(tally, row, claims, (is_closed, is_above))
}

fn beside_rounding(tally: &RowTally, row: &Sums, claims: Claims<'_>, (is_closed, is_above): (bool, bool)) -> f64 {
    if !claims.errors_known {
        return UNKNOWN;
    }
    // Rays that differ in weight are added up one by one.
    let adding = tally.weights.map_or(0.0, |_| tally.n_rays as f64) * f64::EPSILON;
    let stated = if is_above {
        believed(row.error, row.error_squared, 1.0, claims.by_rule)
    } else {
        ESTIMATES * row.error
    };
    let stated = match (tally.n_rays, claims.reciprocity) {
        (0, _) => stated,
        // The error of a sum of counts follows from the counts together, not from the noise of each.
        (_, Reciprocity::ToNoise) => 0.0,
        // Points that stand for a patch have the same error in the loss as in the rest.
        _ => 2.0 * stated,
    };
    let n_rays = tally.effective_rays().unwrap_or(tally.n_rays as f64);
    let by_count = |deviation: f64| if tally.n_rays > 0 { SIGMAS * deviation } else { 0.0 };
    match claims.repair {
        // Rays are counted once each, so that a row of them is complete whatever its noise.
        Repair::Not if tally.n_rays > 0 => adding,
        Repair::Not => stated,
        Repair::Within(tolerance) if is_closed => adding + tolerance + if tally.n_rays > 0 { 0.0 } else { stated },
        Repair::Within(tolerance) => {
            let lost = tally.escaped().unwrap_or(0.0) + tally.absorbed().unwrap_or(0.0);
            adding + tolerance + stated + by_count(tally.variance_of(lost).sqrt())
        }
        Repair::GaveUp => adding + stated + by_count(n_rays.sqrt().recip()),
    }
}

/// Returns the accepted part of the stated errors of a pair or a row that is above `most`.
fn believed(sum: f64, sum_squared: f64, most: f64, by_rule: bool) -> f64 {
    let of_noise = if by_rule { 0.0 } else { SIGMAS * sum_squared.sqrt() };
    (ESTIMATES * sum).min(of_noise.max(BELIEVED * most))
}

/// Returns the greatest likely difference of two counts with the mean area `exchange`, where a ray stands for the areas `a` and `b`.
fn noise(exchange: f64, a: f64, b: f64) -> f64 {
    SIGMAS * ((exchange * (a + b)).sqrt() + a + b)
}
