//! What solutions have to obey.

use super::{At, Audit, Law, Worst};
use crate::matrix::operator::Block;
use crate::matrix::roundings;
use crate::solver::{RadiositySystem, Solution, SolverError};

/// What is known beside a system and its solution.
#[derive(Clone, Copy, Debug, Default)]
pub struct Given<'a> {
    /// The power that form factors without reciprocity make, m²; see [`FormFactorAudit::gain`](super::FormFactorAudit::gain). `None` where it is not known.
    pub gain: Option<&'a [f64]>,
    /// True if a pass over F costs so much, as when it computes F again, that none is spent on an audit.
    pub costly: bool,
}

/// Checks that a solution is finite, that its irradiances and residual are what it says, that power is conserved, and that no patch is darker or brighter than the
/// patches of the scene would be in furnaces of their own; one pass over F.
///
/// With R = max |r_i A_i| as the solver states it, min_i (E_i − R / A_i) / (1 − ρ_i s_i) ≤ B ≤ max_i (E_i + R / A_i) / (1 − ρ_i s_i), s_i = Σ_j F_ij: for the
/// constant m on the right, (I − diag(ρ) F)(m − B) ≥ 0, and the inverse is not negative; in the same way for the one on the left. Energy:
/// |emitted − absorbed − escaped + Σ_i B_i g_i| = |Σ A r| ≤ sqrt(Σ A) sqrt(Σ A r²), with g the gain of form factors without reciprocity.
/// Source: Berman and Plemmons, "Nonnegative Matrices in the Mathematical Sciences", chapter 6, theorem 2.3. Departures: none.
///
/// # Errors
/// [`SolverError::Disk`] if F cannot be read.
///
/// # Panics
/// If the solution has not the shape of the system.
#[track_caller]
pub fn solution(system: &RadiositySystem, solution: &Solution, given: Given<'_>) -> Result<Audit, SolverError> {
    let (b, h) = (&solution.radiosity, &solution.irradiance);
    let n = system.n_patches();
    assert!(
        b.n_rows() == n && b.n_channels() == system.n_channels(),
        "one radiosity per patch and channel"
    );
    let mut audit = Audit::default();
    audit.checks.push(finite(&[b, h]));
    if given.costly {
        let reason = "every pass computes the form factors again";
        audit.skip(Law::Irradiance, reason);
        audit.skip(Law::Residual, reason);
    } else {
        let mut f_b = Block::zeros(n, b.n_channels());
        system.operator().apply(b, &mut f_b);
        if let Some(error) = system.operator().failure() {
            return Err(error.clone().into());
        }
        audit.checks.push(irradiance(system, h, &f_b));
        audit.checks.push(residual(system, solution, &f_b));
    }
    match given.gain {
        Some(gain) if solution.energy.len() == b.n_channels() => audit.checks.push(energy(system, solution, gain)),
        Some(_) => audit.skip(Law::Energy, "the solution does not state it"),
        None => audit.skip(
            Law::Energy,
            "what form factors without reciprocity make or lose is not known",
        ),
    }
    let reflecting = Reflecting {
        reflectance: system.reflectance(),
        exitance: system.exitance(),
        row_sums: system.row_sums(),
    };
    let slack = |i: usize| solution.residual_max_power / system.areas()[i];
    furnaces(&mut audit, &reflecting, b, slack, true);
    Ok(audit)
}

/// Checks radiosities that were propagated from B = E: they are finite, none is below its exitance, and none above that of the brightest furnace.
///
/// Whatever the number of passes, E ≤ B ≤ max_i E_i / (1 − ρ_i s_i), because F is not negative.
/// `reflectance`, `exitance`, `radiosity`, `irradiance`: ρ, E, B, H, \[n, c\]; `row_sums`: s_i, \[n\].
///
/// # Panics
/// If shapes differ.
#[must_use]
#[track_caller]
pub fn propagation(
    reflectance: &Block,
    exitance: &Block,
    row_sums: &[f64],
    radiosity: &Block,
    irradiance: &Block,
) -> Audit {
    assert!(
        exitance.values().len() == radiosity.values().len()
            && reflectance.values().len() == radiosity.values().len()
            && row_sums.len() == radiosity.n_rows(),
        "blocks of one shape, and one sum per row"
    );
    let mut audit = Audit::default();
    audit.checks.push(finite(&[radiosity, irradiance]));
    let mut least = Worst::default();
    for (k, (b, e)) in radiosity.values().iter().zip(exitance.values()).enumerate() {
        let at = At::patch(k / radiosity.n_channels()).channel(k % radiosity.n_channels());
        least.see((e - b).max(0.0), 4.0 * f64::EPSILON * e, at);
    }
    audit.checks.push(least.check(Law::LeastRadiosity));
    let reflecting = Reflecting {
        reflectance,
        exitance,
        row_sums,
    };
    furnaces(&mut audit, &reflecting, radiosity, |_| 0.0, false);
    audit
}

/// What decides how bright a furnace is.
struct Reflecting<'a> {
    reflectance: &'a Block,
    exitance: &'a Block,
    row_sums: &'a [f64],
}

/// Returns what the sums of a pass can be off by, relative to their terms; see the operator of [`FormFactors`](crate::matrix::FormFactors).
fn rounding(n: usize) -> f64 {
    roundings(n) * f64::EPSILON
}

/// Returns the places of a block in its own order.
fn places(block: &Block) -> impl Iterator<Item = (At, usize, usize)> {
    let n_channels = block.n_channels();
    (0..block.values().len()).map(move |k| {
        let (i, c) = (k / n_channels, k % n_channels);
        (At::patch(i).channel(c), i, c)
    })
}

fn finite(blocks: &[&Block]) -> super::Check {
    let mut worst = Worst::default();
    for block in blocks {
        for (at, i, c) in places(block) {
            let deviation = if block.row(i)[c].is_finite() {
                0.0
            } else {
                f64::INFINITY
            };
            worst.see(deviation, 0.0, at);
        }
    }
    worst.check(Law::Finite)
}

fn irradiance(system: &RadiositySystem, stated: &Block, f_b: &Block) -> super::Check {
    let unit = rounding(system.n_patches());
    let mut worst = Worst::default();
    for (at, i, c) in places(f_b) {
        let expected = f_b.row(i)[c];
        let deviation = (stated.row(i)[c] - expected).abs();
        worst.see(deviation, unit * expected.abs(), at);
    }
    worst.check(Law::Irradiance)
}

fn residual(system: &RadiositySystem, solution: &Solution, f_b: &Block) -> super::Check {
    let unit = rounding(system.n_patches());
    let mut worst = Worst::default();
    for c in 0..f_b.n_channels() {
        let (mut of_r, mut of_rounding, mut of_e) = (0.0, 0.0, 0.0);
        for (i, area) in system.areas().iter().enumerate() {
            let (e, rho) = (system.exitance().row(i)[c], system.reflectance().row(i)[c]);
            let (b, reflected) = (solution.radiosity.row(i)[c], rho * f_b.row(i)[c]);
            of_r += area * (e - b + reflected).powi(2);
            of_rounding += area * (unit * (e.abs() + b.abs() + reflected.abs())).powi(2);
            of_e += area * e * e;
        }
        let relative = |sum: f64| if sum > 0.0 { (sum / of_e).sqrt() } else { sum };
        let allowed = solution.residual_l2 * (1.0 + unit) + 2.0 * relative(of_rounding);
        let at = At::default().channel(c);
        worst.see(relative(of_r), allowed, at);
    }
    worst.check(Law::Residual)
}

fn energy(system: &RadiositySystem, solution: &Solution, gain: &[f64]) -> super::Check {
    let unit = rounding(system.n_patches());
    let area: f64 = system.areas().iter().sum();
    let mut worst = Worst::default();
    for (c, energy) in solution.energy.iter().enumerate() {
        let (mut made, mut moved, mut of_e) = (0.0, 0.0, 0.0);
        for (i, (gain_i, area_i)) in gain.iter().zip(system.areas()).enumerate() {
            let (b, e) = (solution.radiosity.row(i)[c], system.exitance().row(i)[c]);
            made += b * gain_i;
            moved += area_i * (b.abs() + e.abs() + solution.irradiance.row(i)[c].abs());
            of_e += area_i * e * e;
        }
        let deviation = (energy.emitted - energy.absorbed - energy.escaped + made).abs();
        let allowed = solution.residual_l2 * (area * of_e).sqrt() + unit * moved;
        worst.see(deviation, allowed, At::default().channel(c));
    }
    worst.check(Law::Energy)
}

/// Adds the checks against the darkest (if `least`) and the brightest furnace; `slack` is what |r_i| can be.
fn furnaces(audit: &mut Audit, given: &Reflecting<'_>, b: &Block, slack: impl Fn(usize) -> f64, least: bool) {
    let (mut below, mut above) = (Worst::default(), Worst::default());
    let unit = rounding(b.n_rows());
    for c in 0..b.n_channels() {
        let (mut lowest, mut highest) = (f64::INFINITY, 0.0_f64);
        let mut absorbed_min = f64::INFINITY;
        for (i, sum) in given.row_sums.iter().enumerate() {
            let (rho, e, r) = (given.reflectance.row(i)[c], given.exitance.row(i)[c], slack(i));
            let absorbed = 1.0 - rho * sum;
            absorbed_min = absorbed_min.min(absorbed);
            lowest = lowest.min((e - r) / absorbed);
            highest = highest.max((e + r) / absorbed);
        }
        // Below this, 1 − ρ s is rounding, and there is no bound; the residual itself is still checked.
        if absorbed_min.is_nan() || absorbed_min <= unit {
            continue;
        }
        let allowed = 4.0 * unit * highest / absorbed_min;
        for i in 0..b.n_rows() {
            let at = At::patch(i).channel(c);
            below.see((lowest - b.row(i)[c]).max(0.0), allowed, at);
            above.see((b.row(i)[c] - highest).max(0.0), allowed, at);
        }
    }
    for (worst, law, wanted) in [
        (below, Law::LeastRadiosity, least),
        (above, Law::GreatestRadiosity, true),
    ] {
        if !wanted {
        } else if worst.n_checked > 0 {
            audit.checks.push(worst.check(law));
        } else {
            audit.skip(law, "a patch reflects all light that it gets");
        }
    }
}
