//! The error of a solution by the errors of the form factors.

use super::error::SolverError;
use super::registry;
use super::settings::SolverSettings;
use super::solution::Solution;
use super::solve::SolveOptions;
use super::stop::{StopReason, Tolerance};
use super::system::RadiositySystem;
use super::vectors::relative_errors_of;
use crate::matrix::operator::{Block, LinearOperator};
use crate::matrix::{FormFactors, Precision, RowBlock};

/// The relative residual to which the error estimate is solved.
const TOLERANCE: f64 = 1e-3;

/// The number of passes after which there is no estimate.
const MAX_PASSES: usize = 1000;

/// The rounding of f64, relative.
const F64_ROUNDING: f64 = 0.5 * f64::EPSILON;

/// The rounding of f32, relative: 2⁻²⁴.
const F32_ROUNDING: f64 = 0.5 * f32::EPSILON as f64;

/// The error, as a share of the light, up to which the first order is a good estimate.
///
/// True errors are seldom above twice the estimate, and up to a half twice that is still below 1, where the series of all orders
/// converges; from a half on, the bound by that series would also be as great as the light itself.
const FIRST_ORDER_UP_TO: f64 = 0.5;

/// Estimates the error of every patch's radiosity that comes from the form factors and from the solver, in W·m⁻².
///
/// e = (I − ρF)⁻¹ (ρ (h + u H) + |r|), h_i² = Σ_j (s_ij B_j)², with s_ij the error of F_ij that its method states, u the rounding of stored form factors (2⁻²⁴ in f32), and r = E − B + ρ H the
/// residual: to first order (I − ρF) δB = ρ δF B + r. Entries of a row count as independent but for their rounding, which may be to one side in all of them (equal patches round alike); rows count as if
/// they all erred to one side.
/// Where no ray of patch i hit patch j, but rays of j hit i, s is the noise of a count at their value, A_j F_ji / A_i: a small lamp that no ray finds is not certainly invisible. Pairs where no ray of
/// either hit the other count together as one more entry of the row, off by [`open_error`](FormFactors::open_error), of a patch of the mean brightness (root mean square by area).
/// For methods whose s is a standard error, e is
/// hardly below the standard error of B; for methods that state a bound or an estimate of the error, e is one as far as errors of a row are not all of one sign.
/// In `room-box` with 108 patches and 1000 random rays from each, the stated error is 2.2 times the root mean square of the true one over 24 runs for the patch where it is
/// least, and 3.8 times on average; with `exact` no true error was above the stated one (`tests/library/solver/stated_error.rs`).
///
/// e is then divided by 1 − q, the sum of all orders: but for the residual's part e is T B with T = (I − ρF)⁻¹ ρ (h + u F), the next order is T e, and q² = Σ A (T e)² / Σ A e² in each channel of each set of
/// patches that exchange light. Where e is below 1e-3 of the reflected light of a solution that has converged, that share is used for q. From q = 0.5 on e is infinite:
/// form factors are then not exact enough for reflectances so near 1. It is also infinite where the system for e has not been solved.
/// The error of the mesh (one radiosity for a whole patch) is not included.
/// Shapes: \[n, c\], that of an error of the exitance, W·m⁻², included. Work: one pass over the form factors and one solve, or two of each.
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
    (reflectance, exitance): (&Block, &Block),
    exitance_error: Option<&Block>,
    solution: &Solution,
) -> Result<Block, SolverError> {
    let (n, n_channels) = (reflectance.n_rows(), reflectance.n_channels());
    let radiosity = &solution.radiosity;
    let shapes = [exitance, radiosity, &solution.irradiance].map(|block| (block.n_rows(), block.n_channels()));
    assert!(shapes.iter().all(|&shape| shape == (n, n_channels)), "equal shapes");
    let mut source = sent_wrongly(factors, reflectance, radiosity, &solution.irradiance);
    let residual = solution.residual(reflectance, exitance);
    for (value, r) in source.values_mut().iter_mut().zip(residual.values()) {
        *value += r.abs();
    }
    for (value, own) in source
        .values_mut()
        .iter_mut()
        .zip(exitance_error.into_iter().flat_map(Block::values))
    {
        *value += own;
    }
    let system = RadiositySystem::new(factors, factors.areas().to_vec(), reflectance.clone(), source)?;
    let converged = solution.stop_reason == StopReason::Converged;
    let reflected = converged.then(|| solution.sent_on(reflectance));
    carried(&system, reflected.as_ref(), |error| {
        let mut irradiance = Block::zeros(n, n_channels);
        factors.apply(error, &mut irradiance);
        sent_wrongly(factors, reflectance, error, &irradiance)
    })
}

/// Returns all orders of the error that the sources of `system` cause.
///
/// `reflected` is ρ H of the converged light, or `None` for incomplete light, which does not show how orders fall; `next` returns the sources that an error causes.
pub(crate) fn carried(
    system: &RadiositySystem,
    reflected: Option<&Block>,
    next: impl Fn(&Block) -> Block,
) -> Result<Block, SolverError> {
    let mut error = solved(system)?;
    let shares = shares_of_next_order(system, &error, reflected, next)?;
    for (i, room) in system.components().labels.iter().enumerate() {
        let of_room = shares.row(*room as usize).iter();
        error
            .row_mut(i)
            .iter_mut()
            .zip(of_room)
            .for_each(|(e, share)| *e = all_orders(*e, *share));
    }
    Ok(error)
}

/// Returns ρ (h + u |H|) for the light B, whose irradiance is H.
fn sent_wrongly(factors: &FormFactors, reflectance: &Block, radiosity: &Block, irradiance: &Block) -> Block {
    let mut sent = irradiance_error(factors, radiosity, irradiance, None);
    for (value, rho) in sent.values_mut().iter_mut().zip(reflectance.values()) {
        *value *= rho;
    }
    sent
}

/// Returns h + u |H|, the error of the irradiance H = F B by the errors of form factors and their rounding.
///
/// `references`: c_i of rows whose errors cancel, Σ_j δF_ij = 0, as their sum is known: h_i² = Σ_j (s_ij (B_j − c_i))² for any c_i, \[n, c\]; `None` for 0 in all rows.
pub(crate) fn irradiance_error(
    factors: &FormFactors,
    radiosity: &Block,
    irradiance: &Block,
    references: Option<&Block>,
) -> Block {
    let n_channels = radiosity.n_channels();
    let zeros = vec![0.0; n_channels];
    let reference = |i: usize| references.map_or(&zeros[..], |references| references.row(i));
    // In such units every square is in range, whatever the unit of light.
    let mut greatest = vec![f64::MIN_POSITIVE; n_channels];
    for (k, b) in radiosity.values().iter().enumerate() {
        greatest[k % n_channels] = greatest[k % n_channels].max(b.abs());
    }
    // The light of a patch of the mean brightness.
    let all_area: f64 = factors.areas().iter().sum();
    let mean_square = |c: usize| -> f64 {
        let of_patch = |(i, area): (usize, &f64)| area / all_area * (radiosity.row(i)[c] / greatest[c]).powi(2);
        factors.areas().iter().enumerate().map(of_patch).sum()
    };
    let mean_squares: Vec<f64> = (0..n_channels).map(mean_square).collect();
    let rounding = match factors.storage().precision {
        Precision::F32 => F32_ROUNDING,
        Precision::F64 => F64_ROUNDING,
    };
    let of_blocks: Vec<Vec<f64>> = factors.map_row_blocks(|block| {
        let rows = &block.rows;
        let mut squares = Block::zeros(rows.len(), n_channels);
        for_each_error(factors, block, |i, j, error| {
            let of_row = squares.row_mut(i - rows.start);
            let light = radiosity.row(j).iter().zip(reference(i)).zip(&greatest);
            for (square, ((b, own), unit)) in of_row.iter_mut().zip(light) {
                *square += (error * ((b - own) / unit)).powi(2);
            }
        });
        let source = |(i, c): (usize, usize)| {
            let shift = (reference(i)[c] / greatest[c]).powi(2);
            let unhit = factors.open_error(i).powi(2) * (mean_squares[c] + shift);
            let noise = (squares.row(i - rows.start)[c] + unhit).sqrt() * greatest[c];
            noise + rounding * irradiance.row(i)[c].abs()
        };
        let places = rows.clone().flat_map(|i| (0..n_channels).map(move |c| (i, c)));
        places.map(source).collect()
    });
    Block::from_values(factors.gathered(of_blocks.concat()), n_channels)
}

/// Returns the solution of a system with nonnegative sources, clamped to at least 0; infinite where it cannot be solved.
fn solved(system: &RadiositySystem) -> Result<Block, SolverError> {
    let options = SolveOptions {
        tolerance: Tolerance::ResidualL2(TOLERANCE),
        max_passes: MAX_PASSES,
        ..SolveOptions::default()
    };
    let solver = registry::solver("auto", &SolverSettings::default())?;
    let solution = solver.solve(system, &options, &mut |_| std::ops::ControlFlow::Continue(()))?;
    let is_solved = solution.stop_reason == StopReason::Converged;
    // Rounding may leave a zero below 0.
    let known = |e: &f64| if is_solved { e.max(0.0) } else { f64::INFINITY };
    let values = solution.radiosity.values().iter().map(known).collect();
    Ok(Block::from_values(values, solution.radiosity.n_channels()))
}

/// Returns q, the ratio of the next order of an error to the error, for each set of patches that exchange light, \[sets, c\].
///
/// Where the error is at most [`NEGLIGIBLE`] of the reflected light throughout, that share is used for q: it is at least q, as T of all light is the error.
fn shares_of_next_order(
    system: &RadiositySystem,
    error: &Block,
    reflected: Option<&Block>,
    next: impl Fn(&Block) -> Block,
) -> Result<Block, SolverError> {
    let (rho, n_channels) = (system.reflectance(), error.n_channels());
    let rooms = system.components();
    let mut members = vec![Vec::new(); rooms.n_components];
    for (i, &room) in rooms.labels.iter().enumerate() {
        members[room as usize].push(i);
    }
    let shares = |of: &Block, all: &Block| {
        let of_rooms = members
            .iter()
            .flat_map(|patches| relative_errors_of(patches, system.areas(), of, all));
        Block::from_values(of_rooms.collect(), n_channels)
    };
    if !error.values().iter().all(|e| e.is_finite()) {
        return Ok(Block::zeros(rooms.n_components, n_channels));
    }
    let is_small = |share: &f64| *share <= NEGLIGIBLE;
    let of_reflected = reflected.map(|reflected| shares(error, reflected));
    if let Some(small) = of_reflected.filter(|of_reflected| of_reflected.values().iter().all(is_small)) {
        return Ok(small);
    }
    let of_error = RadiositySystem::new(system.operator(), system.areas().to_vec(), rho.clone(), next(error))?;
    Ok(shares(&solved(&of_error)?, error))
}

/// The share of an error in the reflected light up to which it is an estimate of the next order's share.
const NEGLIGIBLE: f64 = 1e-3;

/// Calls `visit(i, j, s_ij)` for the errors of all entries in some rows.
fn for_each_error(factors: &FormFactors, block: &RowBlock<'_>, mut visit: impl FnMut(usize, usize, f64)) {
    let has_rays = |i: usize| factors.tallies()[i].n_rays > 0;
    if factors.is_symmetric() || !block.rows.clone().any(has_rays) {
        for i in block.rows.clone() {
            factors.for_each_in_row(i, |j, _, error| visit(i, j, error));
        }
        return;
    }
    let areas = factors.areas();
    block.for_each_pair(0, |i, j, pair| {
        let (value, error) = pair.there;
        let is_missed = value <= 0.0 && pair.back.0 > 0.0;
        let missed = || factors.tallies()[i].noise_of_missed(areas[j] / areas[i] * pair.back.0);
        visit(i, j, if is_missed { error.max(missed()) } else { error });
    });
}

/// Returns the sum of all orders of an error whose first order is `e`, and `share` of all light.
fn all_orders(e: f64, share: f64) -> f64 {
    if share < FIRST_ORDER_UP_TO {
        e / (1.0 - share)
    } else {
        f64::INFINITY
    }
}
