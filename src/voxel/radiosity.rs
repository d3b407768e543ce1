//! Propagation: the iterations of the discrete equation.

use serde::Serialize;

use super::operator::Gather;
use crate::matrix::operator::Block;
use crate::progress::Progress;

/// The input of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// All values of a pass from those of the pass before: equation (3).
    Jacobi,
    /// From the newest values there are: section 4.2.
    #[default]
    InPlace,
}

/// The most parts into which the surfels are cut for [`Form::InPlace`]; each is computed on all threads from the newest values of all parts before it.
const N_PARTS: usize = 256;

/// Radiosities after some propagations.
#[derive(Clone, Debug)]
pub struct Propagation {
    /// B, W·m⁻², \[n, c\].
    pub radiosity: Block,
    /// H, from which B = E + ρ H was computed, W·m⁻², \[n, c\].
    pub irradiance: Block,
    /// Per pass, sqrt(Σ A (B_i − B_{i−1})² / Σ A B_i²), the worst channel. In the Jacobi form this is the residual of B_{i−1}, relative to B_i.
    pub changes: Vec<f64>,
}

/// Propagates light `n_passes` times from B_0 = E.
///
/// B_i(x) = E(x) + ρ(x) Σ_v B(I(x, v)) cos θ(x, v) A(v), with B from pass i − 1 or, in place, the newest there is.
/// The error falls at least by the greatest ρ a pass. Equal arguments give equal bytes at any number of threads.
///
/// Fewer passes are done if the caller cancels them.
///
/// `reflectance`: ρ, \[n, c\]; `exitance`: E, W·m⁻², \[n, c\].
///
/// Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), equation (3) and section 4.2.
/// Departures: in place, the surfels are taken in parts of 256 or, in larger scenes, in at most 256 parts, each with the newest values of those before it, so that
/// all threads have work. Surfels of one part are neighbours, which give each other little.
///
/// # Panics
/// If the blocks differ in shape or have not one row per unknown.
#[must_use]
#[track_caller]
pub fn propagate(
    operator: &impl Gather,
    reflectance: &Block,
    exitance: &Block,
    form: Form,
    n_passes: usize,
    progress: &dyn Progress,
) -> Propagation {
    let (n, n_channels) = (operator.n_rows(), exitance.n_channels());
    assert!(
        reflectance.n_rows() == n && exitance.n_rows() == n,
        "one row per unknown"
    );
    assert_eq!(reflectance.n_channels(), n_channels, "as many channels of ρ as of E");
    let part = match form {
        Form::Jacobi => n,
        Form::InPlace => n.div_ceil(N_PARTS).next_multiple_of(operator.rows_at_once()),
    };
    let areas = operator.areas();
    let mut radiosity = exitance.clone();
    let mut irradiance = Block::zeros(n, n_channels);
    let mut changes = Vec::new();
    for pass in 1..=n_passes {
        if progress.is_cancelled() {
            break;
        }
        progress.begin(&format!("propagation {pass} of {n_passes}"), n.div_ceil(part) as u64);
        let before = radiosity.clone();
        for first in (0..n).step_by(part) {
            let rows = first..(first + part).min(n);
            let mut gathered = vec![0.0; rows.len() * n_channels];
            operator.gather(first, &radiosity, &mut gathered);
            for (surfel, h) in rows.zip(gathered.chunks(n_channels)) {
                irradiance.row_mut(surfel).copy_from_slice(h);
                let (rho, e) = (reflectance.row(surfel), exitance.row(surfel));
                for (c, b) in radiosity.row_mut(surfel).iter_mut().enumerate() {
                    *b = e[c] + rho[c] * h[c];
                }
            }
            progress.advance(1);
        }
        changes.push(change(&areas, &before, &radiosity));
    }
    Propagation {
        radiosity,
        irradiance,
        changes,
    }
}

fn change(areas: &[f64], before: &Block, after: &Block) -> f64 {
    let n_channels = after.n_channels();
    let (mut moved, mut all) = (vec![0.0; n_channels], vec![0.0; n_channels]);
    for (i, area) in areas.iter().enumerate() {
        for c in 0..n_channels {
            let (old, new) = (before.row(i)[c], after.row(i)[c]);
            moved[c] += area * (new - old).powi(2);
            all[c] += area * new.powi(2);
        }
    }
    let ratio = |(m, a): (&f64, &f64)| if *a > 0.0 { (m / a).sqrt() } else { 0.0 };
    moved.iter().zip(&all).map(ratio).fold(0.0, f64::max)
}
