//! `pcg`: preconditioned conjugate gradients.

use super::deflation::DEFLATED;
use super::deflation::{Deflate, Deflation, first_pass};
use super::entry::{SolverEntry, Symmetry};
use super::error::SolverError;
use super::history::Monitor;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual};
use super::settings::SolverSettings;
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use super::vectors::{add_scaled, combine, inner, scale};
use crate::matrix::operator::Block;

/// Conjugate gradients on the symmetrised system, preconditioned with its diagonal, all channels together.
///
/// The symmetric matrix V − A F, V = A / ρ, has no finite V where ρ = 0. Preconditioning with V⁻¹ is the same iteration as plain
/// conjugate gradients on K x = g,
///
/// K = I − diag(ρ)^½ F diag(ρ)^½, g = diag(ρ)^½ F E, B = E + diag(ρ)^½ x,
///
/// in the inner product ⟨u, v⟩ = Σ A u v, in which K is symmetric; black patches drop out by themselves. The residual of
/// the radiosities is r = diag(ρ)^½ (g − K x). K is positive definite where ρ_i Σ_j F_ij < 1; a direction p
/// with ⟨p, K p⟩ ≤ 0 shows that it is not, and the solver stops as [`StopReason::Diverged`](super::StopReason::Diverged).
///
/// One pass applies F once to all channels; each channel has its own scalars and rests as soon as it meets the tolerance, so that
/// it ends as the same bytes as alone. The recurrence's residual is the estimate in the history. When it meets the
/// tolerance, the true residual is calculated, and the iteration starts again from it where it does not meet
/// the tolerance; if two such checks in a row differ by less than a factor of 2, it ends as [`StopReason::Stagnated`](super::StopReason::Stagnated).
/// [`Start::Zero`](super::Start::Zero) is the same as [`Start::Exitance`](super::Start::Exitance): its first reflection gives B = E.
///
/// Passes for a relative residual of 1e-6 grow like sqrt(1 / (1 − ρ)) at worst, and for closed rooms hardly at all,
/// because one eigenvalue of K lies near 1 − ρ and the others cluster near 1. That one belongs to the even light of a connected component. Where
/// a component that emits has a mean reflectance of more than [`DEFLATED_FROM`](super::DEFLATED_FROM), all components' even lights are deflated: the residual
/// is kept orthogonal, and the directions conjugate, to the vectors ρ^½ of the components. Their images come from the pass
/// that calculates the first residual, as one more channel for each distinct reflectance, and the number of passes does not grow with ρ then (the tests have the counts).
///
/// Source: Baranoski, Bramley and Shirley 1995, section 3.2. Departures: the printed algorithm has no preconditioner, tests the residual scaled by
/// V, and confuses V with its inverse in line 3; the inner product takes the areas from the form factors.
/// Deflation: Saad, Yeung, Erhel and Guyomarc'h, "A deflated version of the conjugate gradient algorithm", SIAM J. Sci. Comput. 21 (2000), algorithm 3.5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pcg {
    /// Whether the even light of each component is deflated.
    pub deflation: Deflate,
}

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "pcg",
    summary: "Conjugate gradients preconditioned with V⁻¹ = ρ/A, deflated where that pays",
    settings: &[DEFLATED],
    symmetry: |_| Symmetry::Needed,
    uses_hierarchy: false,
    goes_by_rows: false,
    make: |s| Some(Box::new(Pcg::with(s)?)),
};

impl Pcg {
    pub(super) fn with(settings: &SolverSettings) -> Option<Self> {
        Some(Self {
            deflation: Deflate::with(settings)?,
        })
    }
}

impl Solver for Pcg {
    fn name(&self) -> &'static str {
        "pcg"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let reciprocal = system.operator().reciprocal_areas();
        if reciprocal.is_none() && !options.allow_nonreciprocal {
            return Err(SolverError::NeedsReciprocity { solver: self.name() });
        }
        let scaled = Scaled::new(system);
        let weights: Vec<f64> = reciprocal.map_or_else(
            || scaled.areas.clone(),
            |areas| areas.iter().map(|a| a / system.area_unit()).collect(),
        );
        let mut state = State::new(&scaled, weights, options.start.irradiance(&scaled), self.deflation);
        iteration::run(&scaled, options, monitor, &mut state)
    }
}

/// The vectors of the iteration; all blocks are \[n, c\].
struct State<'a> {
    scaled: &'a Scaled<'a>,
    /// A, for which A_i F_ij is symmetric.
    weights: Vec<f64>,
    /// ρ^½.
    root: Block,
    /// x.
    x: Block,
    /// g − K x, by the recurrence.
    residual: Block,
    /// The direction of the last step; of the next one where [`restart`](Iteration::restart) has just set it.
    direction: Block,
    /// Whether a step has been made along the direction; the next direction is made when needed, which is not after the last pass.
    is_spent: bool,
    /// ⟨residual, residual⟩ of each channel, when the direction was made.
    squared: Vec<f64>,
    /// ρ^½ direction, then K direction.
    scratch: Block,
    product: Block,
    deflate: Deflate,
    deflation: Option<Deflation>,
}

impl<'a> State<'a> {
    fn new(scaled: &'a Scaled<'a>, weights: Vec<f64>, irradiance: Block, deflate: Deflate) -> Self {
        let mut root = scaled.system.reflectance().clone();
        root.values_mut().iter_mut().for_each(|rho| *rho = rho.sqrt());
        let mut x = irradiance;
        scale(&mut x, &root);
        Self {
            deflate,
            deflation: None,
            scaled,
            weights,
            root,
            x,
            residual: scaled.zeros(),
            direction: scaled.zeros(),
            is_spent: false,
            squared: vec![0.0; scaled.system.n_channels()],
            scratch: scaled.zeros(),
            product: scaled.zeros(),
        }
    }

    /// Returns r = ρ^½ (g − K x).
    fn residual(&self) -> Block {
        let mut residual = self.residual.clone();
        scale(&mut residual, &self.root);
        residual
    }

    /// Makes the direction of the next step from the last one and the residual.
    fn turn(&mut self, excess: &[f64]) {
        let squared = inner(&self.weights, &self.residual, &self.residual);
        let beta = self.ratio_where_it_moves(excess, &squared, &self.squared);
        combine(&mut self.direction, &beta, &vec![1.0; beta.len()], &self.residual);
        if let Some(deflation) = &self.deflation {
            deflation.project(&mut self.direction, &self.residual);
        }
        self.squared = squared;
        self.is_spent = false;
    }

    /// Returns whether a channel still changes. If only even light was missing, nothing remains to be done, and K p = 0 does not show that K is singular.
    fn moves(&self, excess: &[f64], channel: usize) -> bool {
        excess[channel] > 1.0 && (self.squared[channel] > 0.0 || self.squared[channel].is_nan())
    }

    /// Returns `above` / `below` in the channels that move, 0 in the others.
    fn ratio_where_it_moves(&self, excess: &[f64], above: &[f64], below: &[f64]) -> Vec<f64> {
        let ratios = above.iter().zip(below).enumerate();
        ratios
            .map(|(c, (a, b))| if self.moves(excess, c) { a / b } else { 0.0 })
            .collect()
    }

    /// Makes one step in the channels that exceed the tolerance; false if K turns out not to be positive definite.
    fn step(&mut self, excess: &[f64]) -> bool {
        if self.is_spent {
            self.turn(excess);
        }
        self.scratch.clone_from(&self.direction);
        scale(&mut self.scratch, &self.root);
        self.scaled.system.operator().apply(&self.scratch, &mut self.product);
        let terms = self.root.values().iter().zip(self.direction.values());
        for (product, (root, p)) in self.product.values_mut().iter_mut().zip(terms) {
            *product = p - root * *product;
        }
        let curvature = inner(&self.weights, &self.direction, &self.product);
        let is_flat = |c: usize| curvature[c] <= 0.0 || curvature[c].is_nan();
        if (0..curvature.len()).any(|c| self.moves(excess, c) && is_flat(c)) {
            return false;
        }
        let alpha = self.ratio_where_it_moves(excess, &self.squared, &curvature);
        add_scaled(&mut self.x, &alpha, &self.direction);
        let minus_alpha: Vec<f64> = alpha.iter().map(|a| -a).collect();
        add_scaled(&mut self.residual, &minus_alpha, &self.product);
        if let Some(deflation) = &self.deflation {
            // Only rounding, unless K is not quite symmetric.
            let moving: Vec<bool> = (0..alpha.len()).map(|c| self.moves(excess, c)).collect();
            deflation.solve(&mut self.x, &mut self.residual, |c| moving[c]);
        }
        self.is_spent = true;
        true
    }
}

impl Iteration for State<'_> {
    fn first_residual(&mut self, scaled: &Scaled) -> TrueResidual {
        let (truth, sent) = first_pass(scaled, &self.radiosity(), self.deflate);
        self.deflation = sent.map(|sent| Deflation::new(scaled.system, &self.weights, &self.root, sent));
        truth
    }

    fn pass(&mut self, excess: &[f64]) -> Estimate {
        if self.step(excess) {
            Estimate::Running(self.scaled.norms(&self.residual()))
        } else {
            Estimate::Breakdown
        }
    }

    /// Returns B = E + ρ^½ x.
    fn radiosity(&self) -> Block {
        let mut radiosity = self.scaled.exitance.clone();
        let terms = self.root.values().iter().zip(self.x.values());
        for (b, (root, x)) in radiosity.values_mut().iter_mut().zip(terms) {
            *b += root * x;
        }
        radiosity
    }

    /// Restarts from x, of which `truth.irradiance` = F B is known: g − K x = ρ^½ F B − x.
    fn restart(&mut self, truth: &TrueResidual, excess: &[f64]) {
        let terms = self.root.values().iter().zip(self.x.values());
        let residuals = self.residual.values_mut().iter_mut();
        for ((residual, h), (root, x)) in residuals.zip(truth.irradiance.values()).zip(terms) {
            *residual = root * h - x;
        }
        if let Some(deflation) = &self.deflation {
            deflation.solve(&mut self.x, &mut self.residual, |c| excess[c] > 1.0);
        }
        self.direction.clone_from(&self.residual);
        if let Some(deflation) = &self.deflation {
            deflation.project(&mut self.direction, &self.residual);
        }
        self.squared = inner(&self.weights, &self.residual, &self.residual);
        self.is_spent = false;
    }
}
