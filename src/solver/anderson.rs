//! `anderson`: Jacobi iteration with Anderson acceleration.

use std::collections::VecDeque;
use std::num::NonZeroUsize;

use super::entry::{SolverEntry, Symmetry};
use super::history::Monitor;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual};
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use super::vectors::{add_scaled, inner, keep_channels};
use crate::matrix::operator::Block;
use crate::setting::{Kind, Setting, Value};

/// Jacobi iteration B ← E + diag(ρ) F B, accelerated with the last m steps, all channels together.
///
/// With the residual r_k = E − (I − diag(ρ) F) B_k, which is the step that Jacobi would take, and the differences ΔB_j = B_{j+1} − B_j,
/// Δr_j = r_{j+1} − r_j of the last m passes,
///
/// B_{k+1} = B_k + r_k − Σ_j γ_j (ΔB_j + Δr_j), γ = argmin ‖r_k − Σ_j γ_j Δr_j‖, ‖x‖² = Σ A x².
///
/// With m as large as the number of passes that is GMRES; with a smaller m it drops old steps one by one. It needs neither
/// reciprocity nor rows. Every pass ends with the true residual, so that there is no estimate and no check.
///
/// Memory: 4 m + 6 blocks \[n, c\]: the differences, and while a step is found as many again. Work: one application of F a pass, and about 2 (m + 1)² n c operations.
///
/// Source: Anderson, "Iterative procedures for nonlinear integral equations", J. ACM 12 (1965), section 4; Walker and Ni, "Anderson acceleration for
/// fixed-point iterations", SIAM J. Numer. Anal. 49 (2011), equations (2.1) to (2.3).
/// Departures: the norm is weighted with the areas; differences that depend on newer ones to 1e-10 are left out of γ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Anderson {
    /// m, the number of steps kept.
    pub depth: NonZeroUsize,
}

impl Default for Anderson {
    /// m = 8.
    fn default() -> Self {
        Self {
            depth: const { NonZeroUsize::new(8).expect("positive") },
        }
    }
}

/// The number of steps kept.
pub static DEPTH: Setting = Setting {
    name: "depth",
    help: "Steps that are remembered",
    letter: "M",
    kind: Kind::Count(u64::MAX),
};

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "anderson",
    summary: "Jacobi iteration with Anderson acceleration",
    settings: &[DEPTH.or(Value::Count(8))],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: false,
    goes_by_rows: false,
    make: |s| {
        let depth = s.values.get(&DEPTH)?.size()?;
        Some(Box::new(Anderson { depth }))
    },
};

impl Solver for Anderson {
    fn name(&self) -> &'static str {
        "anderson"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let scaled = Scaled::new(system);
        let mut state = State {
            scaled: &scaled,
            depth: self.depth.get(),
            radiosity: options.start.radiosity(&scaled),
            residual: scaled.zeros(),
            steps: VecDeque::new(),
        };
        iteration::run(&scaled, options, monitor, &mut state)
    }
}

/// The share of a difference, beyond the newer ones, below which it adds only rounding.
const DEPENDENT: f64 = 1e-10;

struct State<'a> {
    scaled: &'a Scaled<'a>,
    depth: usize,
    radiosity: Block,
    residual: Block,
    /// (ΔB, Δr), the newest first.
    steps: VecDeque<(Block, Block)>,
}

impl State<'_> {
    /// Returns r − Σ γ Δr and Σ γ (ΔB + Δr) as one step: r − Σ γ (ΔB + Δr).
    ///
    /// An orthonormal basis of the Δr is made by modified Gram-Schmidt, newest first; each of its vectors carries its combination of steps.
    fn step(&self) -> Block {
        let weights = &self.scaled.areas;
        let mut step = self.residual.clone();
        let mut left = self.residual.clone();
        // (orthonormal vector, the same combination of ΔB + Δr).
        let mut basis: Vec<(Block, Block)> = Vec::with_capacity(self.steps.len());
        for (d_b, d_r) in &self.steps {
            let mut vector = d_r.clone();
            let mut moves = d_b.clone();
            add_scaled(&mut moves, &vec![1.0; d_b.n_channels()], d_r);
            let before = inner(weights, &vector, &vector);
            for (q, moved) in &basis {
                let minus: Vec<f64> = inner(weights, q, &vector).iter().map(|p| -p).collect();
                add_scaled(&mut vector, &minus, q);
                add_scaled(&mut moves, &minus, moved);
            }
            let after = inner(weights, &vector, &vector);
            let factors = before.iter().zip(&after).map(|(b, a)| {
                let depends = *a <= DEPENDENT * DEPENDENT * b || *a <= 0.0;
                if depends { 0.0 } else { a.sqrt().recip() }
            });
            let factors: Vec<f64> = factors.collect();
            let scaled = |block: Block| {
                let mut unit = self.scaled.zeros();
                add_scaled(&mut unit, &factors, &block);
                unit
            };
            let (vector, moves) = (scaled(vector), scaled(moves));
            let minus: Vec<f64> = inner(weights, &vector, &left).iter().map(|p| -p).collect();
            add_scaled(&mut left, &minus, &vector);
            add_scaled(&mut step, &minus, &moves);
            basis.push((vector, moves));
        }
        step
    }
}

impl Iteration for State<'_> {
    fn pass(&mut self, excess: &[f64]) -> Estimate {
        let mut step = self.step();
        keep_channels(&mut step, |c| excess[c] > 1.0 || excess[c].is_nan());
        let ones = vec![1.0; excess.len()];
        add_scaled(&mut self.radiosity, &ones, &step);
        let truth = self.scaled.true_residual(&self.radiosity);
        let mut change = truth.residual.clone();
        add_scaled(&mut change, &vec![-1.0; excess.len()], &self.residual);
        self.residual.clone_from(&truth.residual);
        self.steps.push_front((step, change));
        self.steps.truncate(self.depth);
        Estimate::True(truth)
    }

    fn radiosity(&self) -> Block {
        self.radiosity.clone()
    }

    fn restart(&mut self, truth: &TrueResidual, _excess: &[f64]) {
        self.residual.clone_from(&truth.residual);
        self.steps.clear();
    }
}
