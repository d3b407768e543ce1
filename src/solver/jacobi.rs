//! `jacobi`: every patch gathers from the radiosities of the pass before.

use super::entry::{SolverEntry, Symmetry};
use super::history::Monitor;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual};
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use crate::matrix::operator::Block;

/// Jacobi iteration, all channels together.
///
/// B ← E + diag(ρ) F B, or B ← B + r: from the start B = E, pass k adds the light of k reflections (a Neumann series).
/// Needs neither rows nor reciprocity. Converges where the spectral radius of diag(ρ) F is below 1, the error falling by that factor
/// a pass: half as fast as Gauss-Seidel in most rooms. The residual of every pass is calculated from the radiosities that it leaves.
///
/// Memory: 3 vectors. Work: one application of F a pass, and one before the first.
/// Source: the splitting that Baranoski, Bramley and Shirley 1995, section 1.2, and Lewis 1992, figure 2, start from.
/// Departures: light that a patch sends to itself stays on the right-hand side (F_ii = 0 for flat patches).
#[derive(Clone, Copy, Debug, Default)]
pub struct Jacobi;

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "jacobi",
    summary: "Every patch gathers from the radiosities of the pass before",
    settings: &[],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: false,
    goes_by_rows: false,
    make: |_| Some(Box::new(Jacobi)),
};

impl Solver for Jacobi {
    fn name(&self) -> &'static str {
        "jacobi"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let scaled = Scaled::new(system);
        let mut state = State {
            scaled: &scaled,
            radiosity: options.start.radiosity(&scaled),
            residual: scaled.zeros(),
        };
        iteration::run(&scaled, options, monitor, &mut state)
    }
}

struct State<'a> {
    scaled: &'a Scaled<'a>,
    radiosity: Block,
    /// r of `radiosity`.
    residual: Block,
}

impl Iteration for State<'_> {
    fn pass(&mut self, _excess: &[f64]) -> Estimate {
        for (b, r) in self.radiosity.values_mut().iter_mut().zip(self.residual.values()) {
            *b += r;
        }
        let truth = self.scaled.true_residual(&self.radiosity);
        self.residual.clone_from(&truth.residual);
        Estimate::True(truth)
    }

    fn radiosity(&self) -> Block {
        self.radiosity.clone()
    }

    fn restart(&mut self, truth: &TrueResidual, _excess: &[f64]) {
        self.residual.clone_from(&truth.residual);
    }
}
