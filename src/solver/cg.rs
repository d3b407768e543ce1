//! `cg`: conjugate gradients as in the paper, without a preconditioner.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use super::entry::{SolverEntry, Symmetry};
use super::error::SolverError;
use super::history::Monitor;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual};
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use super::vectors::{add_scaled, combine};
use crate::matrix::operator::Block;

/// Conjugate gradients on the system made symmetric by its rows' factors V = A / ρ, all channels together.
///
/// V G B = V E with V G = diag(A / ρ) − A F, which is symmetric where A_i F_ij is, and positive definite where ρ_i Σ_j F_ij < 1; a direction with
/// ⟨D, V G D⟩ ≤ 0 shows that it is not, and the solver stops as [`StopReason::Diverged`](super::StopReason::Diverged). Patches that reflect less than 2⁻⁵² as much as
/// the brightest does have no usable V; they keep B = E, from which the light that they reflect makes no difference in f64.
///
/// One application of F a pass; each channel has its own scalars and rests as soon as it meets the tolerance. The recurrence's residual, with V undone, is the
/// estimate in the history; the true residual is computed when it meets the tolerance, as in [`Pcg`](super::Pcg). Without a
/// preconditioner the spread of A / ρ sets the pace: dark and small patches cost passes, and `pcg` is better where areas or reflectances span many orders of magnitude.
///
/// Memory: 5 vectors. Source: Baranoski, Bramley and Shirley 1995, section 3.2.
/// Departures: V = A / ρ as in section 2.2 (section 3.2 names its inverse); line 3 is V E − V G B; φ, W and temp start from zero; the stop test undoes V;
/// black patches are left out.
#[derive(Clone, Copy, Debug, Default)]
pub struct ConjugateGradients;

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "cg",
    summary: "Conjugate gradients on V G, V = A/ρ, as in the paper",
    settings: &[],
    symmetry: |_| Symmetry::Needed,
    uses_hierarchy: false,
    goes_by_rows: false,
    make: |_| Some(Box::new(ConjugateGradients)),
};

impl Solver for ConjugateGradients {
    fn name(&self) -> &'static str {
        "cg"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let reciprocal = system.operator().reciprocal_areas();
        if reciprocal.is_none() && !options.allow_nonreciprocal {
            return Err(SolverError::NeedsReciprocity { solver: self.name() });
        }
        let scaled = Scaled::new(system);
        let mut inverse = scaled.zeros();
        let areas = reciprocal.unwrap_or(system.areas());
        for c in 0..system.n_channels() {
            let rho = |i: usize| system.reflectance().row(i)[c];
            let rho_max = (0..system.n_patches()).map(rho).fold(0.0, f64::max);
            for (i, area) in areas.iter().enumerate() {
                if rho(i) > f64::EPSILON * rho_max {
                    inverse.row_mut(i)[c] = rho(i) / (area / system.area_unit());
                }
            }
        }
        let mut radiosity = options.start.radiosity(&scaled);
        let starts = radiosity.values_mut().iter_mut().zip(inverse.values());
        for ((b, inverse), e) in starts.zip(scaled.exitance.values()) {
            if *inverse <= 0.0 {
                *b = *e;
            }
        }
        let mut state = State {
            inverse,
            radiosity,
            residual: scaled.zeros(),
            direction: scaled.zeros(),
            product: scaled.zeros(),
            squared: vec![0.0; system.n_channels()],
            scaled: &scaled,
        };
        iteration::run(&scaled, options, monitor, &mut state)
    }
}

/// The vectors of the iteration; all blocks are \[n, c\].
struct State<'a> {
    scaled: &'a Scaled<'a>,
    /// V⁻¹ = ρ / A, 0 where the patch is left out.
    inverse: Block,
    radiosity: Block,
    /// V r, as the recurrence has it.
    residual: Block,
    direction: Block,
    /// V G direction.
    product: Block,
    /// ⟨V r, V r⟩ of each channel.
    squared: Vec<f64>,
}

impl State<'_> {
    /// Returns r.
    fn undone(&self) -> Block {
        let mut residual = self.residual.clone();
        for (r, inverse) in residual.values_mut().iter_mut().zip(self.inverse.values()) {
            *r *= inverse;
        }
        residual
    }

    /// Takes one step in the channels that exceed the tolerance; false if V G turns out not to be positive definite.
    fn step(&mut self, excess: &[f64]) -> bool {
        self.scaled.system.operator().apply(&self.direction, &mut self.product);
        let n_channels = excess.len();
        let reflectances = self.scaled.system.reflectance().values();
        let terms = self
            .direction
            .values()
            .iter()
            .zip(self.inverse.values())
            .zip(reflectances);
        for (product, ((d, inverse), rho)) in self.product.values_mut().iter_mut().zip(terms) {
            *product = if *inverse > 0.0 {
                (d - rho * *product) / inverse
            } else {
                0.0
            };
        }
        let curvature = dot(&self.direction, &self.product);
        let moves = |c: usize| excess[c] > 1.0;
        if (0..n_channels).any(|c| moves(c) && (curvature[c] <= 0.0 || curvature[c].is_nan())) {
            return false;
        }
        let ratio = |above: &[f64], below: &[f64]| -> Vec<f64> {
            let ratios = above.iter().zip(below).enumerate();
            ratios.map(|(c, (a, b))| if moves(c) { a / b } else { 0.0 }).collect()
        };
        let alpha = ratio(&self.squared, &curvature);
        add_scaled(&mut self.radiosity, &alpha, &self.direction);
        let minus_alpha: Vec<f64> = alpha.iter().map(|a| -a).collect();
        add_scaled(&mut self.residual, &minus_alpha, &self.product);
        let squared = dot(&self.residual, &self.residual);
        let beta = ratio(&squared, &self.squared);
        combine(&mut self.direction, &beta, &vec![1.0; beta.len()], &self.residual);
        self.squared = squared;
        true
    }
}

impl Iteration for State<'_> {
    fn pass(&mut self, excess: &[f64]) -> Estimate {
        if self.step(excess) {
            Estimate::Running(self.scaled.norms(&self.undone()))
        } else {
            Estimate::Breakdown
        }
    }

    fn radiosity(&self) -> Block {
        self.radiosity.clone()
    }

    fn restart(&mut self, truth: &TrueResidual, _excess: &[f64]) {
        let terms = truth.residual.values().iter().zip(self.inverse.values());
        for (scaled, (r, inverse)) in self.residual.values_mut().iter_mut().zip(terms) {
            *scaled = if *inverse > 0.0 { r / inverse } else { 0.0 };
        }
        self.direction.clone_from(&self.residual);
        self.squared = dot(&self.residual, &self.residual);
    }
}

/// Returns Σ u v of each channel, summed in patch order.
fn dot(u: &Block, v: &Block) -> Vec<f64> {
    let mut sums = vec![0.0; u.n_channels()];
    for (u, v) in u
        .values()
        .chunks_exact(sums.len())
        .zip(v.values().chunks_exact(sums.len()))
    {
        for (sum, (a, b)) in sums.iter_mut().zip(u.iter().zip(v)) {
            *sum += a * b;
        }
    }
    sums
}
