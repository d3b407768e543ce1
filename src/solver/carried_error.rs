//! The error of a solution, carried from the form factors' own.

use std::ops::Range;

use super::{RadiositySystem, Solution, SolveOptions, SolverError, SolverSettings, StopReason, Tolerance, registry};
use crate::matrix::operator::Block;
use crate::matrix::{FormFactors, Precision};
use crate::threads;

/// An error estimate is wanted to this, relative.
const TOLERANCE: f64 = 1e-3;

/// Passes after which there is no estimate.
const MOST_PASSES: usize = 1000;

/// The rounding of f64, relative.
const F64_ROUNDING: f64 = 0.5 * f64::EPSILON;

/// The rounding of f32, relative: 2⁻²⁴.
const F32_ROUNDING: f64 = 0.5 * f32::EPSILON as f64;

/// Up to where the first order says how great an error is. True errors are seldom above twice what is estimated, and up to a half twice that is still below 1, where the series of all orders
/// converges; from a half on, besides, the bound that it gives would be as great as the light itself.
const FIRST_ORDER_UP_TO: f64 = 0.5;

/// Estimates the error of every patch's radiosity that comes from the form factors and from the solver, in W·m⁻².
///
/// e = (I − ρF)⁻¹ (ρ (h + u H) + |r|), h_i² = Σ_j (s_ij B_j)², with s_ij the error of F_ij that its method states, u the rounding of stored form factors (2⁻²⁴ in f32), and r = E − B + ρ H the
/// residual: to first order (I − ρF) δB = ρ δF B + r. Entries of a row count as independent but for their rounding, which may be to one side in all of them (equal patches round alike), rows as if
/// they all erred to one side.
/// Where no ray of patch i hit patch j, but rays of j hit i, s is the noise of a count of what they tell, A_j F_ji / A_i: a small lamp that no ray finds is no certain darkness. Pairs where no ray of
/// either hit the other have no error at all; in the mean over many of them those that were hit by chance stand for the others.
/// For methods whose s is a standard error, e is
/// hardly below the standard error of B; for those that state a bound or an estimate of the error it is one as far as errors of a row are not all of one sign.
/// In `room-box` with 108 patches and 1000 random rays from each, the stated error is 2.2 times the root mean square of the true one over 24 runs for the patch where it is
/// least, and 3.8 times on average; with `exact` no true error was above the stated one (`tests/stated_error.rs`).
///
/// Of a solution that has converged e is divided by 1 − q, q² = Σ A e² / Σ A (ρ H)² in each channel of each set of patches that exchange light: e is in the reflected light, and what T = (I − ρF)⁻¹ ρ h makes of
/// errors of a share q of it is the next order, a share of about q of the one before, since T of all light is e. From q = 0.5 on it is infinite:
/// then nothing is known, as form factors are not exact enough for reflectances so near 1. Otherwise most of it is the residual's, which has no other order.
/// The error of the mesh (one radiosity for a whole patch) is no part of it. Infinite, too, where the system for e has not been solved.
/// Shapes: \[n, c\]. Work: one pass over the form factors and one solve.
/// Departures: none.
///
/// # Errors
/// [`SolverError`] if the system has no finite solution.
///
/// # Panics
/// If the shapes differ.
#[track_caller]
pub fn carried_error(
    factors: &FormFactors,
    reflectance: &Block,
    exitance: &Block,
    solution: &Solution,
) -> Result<Block, SolverError> {
    let (n, n_channels) = (reflectance.n_rows(), reflectance.n_channels());
    let radiosity = &solution.radiosity;
    let shapes = [exitance, radiosity, &solution.irradiance].map(|block| (block.n_rows(), block.n_channels()));
    assert!(shapes.iter().all(|&shape| shape == (n, n_channels)), "equal shapes");
    // So that no square leaves the range of numbers, whatever the unit of light.
    let mut greatest = vec![f64::MIN_POSITIVE; n_channels];
    for (k, b) in radiosity.values().iter().enumerate() {
        greatest[k % n_channels] = greatest[k % n_channels].max(b.abs());
    }
    let rounding = match factors.storage().precision {
        Precision::F32 => F32_ROUNDING,
        Precision::F64 => F64_ROUNDING,
    };
    let blocks = factors.row_blocks();
    let rows: Vec<Vec<f64>> = threads::map(threads::pay(n * n * n_channels), blocks.len(), |k| {
        let mut squares = Block::zeros(blocks[k].len(), n_channels);
        for_each_error(factors, blocks[k].clone(), |i, j, error| {
            let of_row = squares.row_mut(i - blocks[k].start);
            for ((square, b), unit) in of_row.iter_mut().zip(radiosity.row(j)).zip(&greatest) {
                *square += (error * (b / unit)).powi(2);
            }
        });
        let source = |(i, c): (usize, usize)| {
            let (rho, h) = (reflectance.row(i)[c], solution.irradiance.row(i)[c]);
            let residual = exitance.row(i)[c] - radiosity.row(i)[c] + rho * h;
            let noise = squares.row(i - blocks[k].start)[c].sqrt() * greatest[c];
            rho * (noise + rounding * h.abs()) + residual.abs()
        };
        let places = blocks[k].clone().flat_map(|i| (0..n_channels).map(move |c| (i, c)));
        places.map(source).collect()
    });
    let source = Block::from_values(rows.concat(), n_channels);
    let system = RadiositySystem::new(factors, factors.areas().to_vec(), reflectance.clone(), source)?;
    let options = SolveOptions {
        tolerance: Tolerance::ResidualL2(TOLERANCE),
        max_passes: MOST_PASSES,
        ..SolveOptions::default()
    };
    let solver = registry::solver("auto", &SolverSettings::default())?;
    let carried = solver.solve(&system, &options, &mut |_| std::ops::ControlFlow::Continue(()))?;
    let is_solved = carried.stop_reason == StopReason::Converged;
    // Rounding may leave a zero below it.
    let known = |e: &f64| if is_solved { e.max(0.0) } else { f64::INFINITY };
    let values = carried.radiosity.values().iter().map(known).collect();
    let mut error = Block::from_values(values, n_channels);
    if solution.stop_reason == StopReason::Converged {
        let mut reflected = reflectance.clone();
        for (rho, h) in reflected.values_mut().iter_mut().zip(solution.irradiance.values()) {
            *rho *= h;
        }
        let rooms = system.components();
        // In order of their patches, once for all rooms: there may be as many as patches.
        let mut members = vec![Vec::new(); rooms.n_components];
        for (i, &room) in rooms.labels.iter().enumerate() {
            members[room as usize].push(i);
        }
        for patches in members {
            let shares = relative_errors_of(&patches, factors.areas(), &error, &reflected);
            for i in patches {
                for (e, share) in error.row_mut(i).iter_mut().zip(&shares) {
                    *e = all_orders(*e, *share);
                }
            }
        }
    }
    Ok(error)
}

/// Calls `visit(i, j, s_ij)` for the errors of all entries in some rows.
fn for_each_error(factors: &FormFactors, rows: Range<usize>, mut visit: impl FnMut(usize, usize, f64)) {
    let has_rays = |i: usize| factors.tallies()[i].n_rays > 0;
    if factors.is_symmetric() || !rows.clone().any(has_rays) {
        for i in rows {
            factors.for_each_in_row(i, |j, _, error| visit(i, j, error));
        }
        return;
    }
    let areas = factors.areas();
    factors.for_each_pair(rows, 0, |i, j, pair| {
        let (value, error) = pair.there;
        let is_missed = value <= 0.0 && pair.back.0 > 0.0;
        let missed = || factors.tallies()[i].noise_of_missed(areas[j] / areas[i] * pair.back.0);
        visit(i, j, if is_missed { error.max(missed()) } else { error });
    });
}

/// Returns the sum of all orders of an error where that of the first is `e`, and `share` of all light.
fn all_orders(e: f64, share: f64) -> f64 {
    if share < FIRST_ORDER_UP_TO {
        e / (1.0 - share)
    } else {
        f64::INFINITY
    }
}

/// Returns sqrt(Σ A e² / Σ A B²) of each channel, 0 where that has no light; no number, or infinite, where nothing is known.
pub(crate) fn relative_errors(areas: &[f64], error: &Block, radiosity: &Block) -> Vec<f64> {
    let all: Vec<usize> = (0..radiosity.n_rows()).collect();
    relative_errors_of(&all, areas, error, radiosity)
}

/// Does what [`relative_errors`] does for some of the patches.
fn relative_errors_of(patches: &[usize], areas: &[f64], error: &Block, radiosity: &Block) -> Vec<f64> {
    let norm = |block: &Block, c: usize| {
        let values = || patches.iter().map(|&i| (areas[i], block.row(i)[c].abs()));
        // In units of the greatest, so that no square overflows or vanishes.
        let unit = values()
            .fold(0.0, |most: f64, (_, x)| most.max(x))
            .max(f64::MIN_POSITIVE);
        let sum: f64 = values().map(|(area, x)| area * (x / unit).powi(2)).sum();
        (sum.sqrt(), unit)
    };
    let of_channel = |c: usize| {
        let ((e, e_unit), (b, b_unit)) = (norm(error, c), norm(radiosity, c));
        if b > 0.0 || b.is_nan() {
            e / b * (e_unit / b_unit)
        } else {
            0.0
        }
    };
    (0..radiosity.n_channels()).map(of_channel).collect()
}
