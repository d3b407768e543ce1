//! `direct`: dense factorisation.

use super::entry::{SolverEntry, Symmetry};
use super::error::SolverError;
use super::history::Monitor;
use super::iteration::{self, Estimate, Iteration};
use super::lu::{Dense, Lu};
use super::scaled::{Scaled, TrueResidual};
use super::settings::SolverSettings;
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use super::vectors::equal_channels;
use crate::matrix::operator::{Block, RowAccess};

/// LU factorisation of I − diag(ρ) F with partial pivoting in f64, and iterative refinement.
///
/// P G = L U, G = I − diag(ρ) F; a pass is B ← B + G⁻¹ r, r = E − G B from F itself. One pass reaches rounding, about 1e-16 n^½ / (1 − ρ) of B; a second follows
/// only for a tighter tolerance. Channels of equal reflectance share one factorisation, and all of them are solved together: this is the
/// solver for many lightings of one scene, and the oracle for the others. In a component without a unique solution
/// (see [`RadiositySystem::with_signed_exitance`]) the equation that the mean is zero is added to each of its rows.
///
/// Needs rows, not reciprocity. Memory: 8 n² bytes for each distinct reflectance, refused above [`memory_limit_byte`](Self::memory_limit_byte).
/// Work: n / 3 passes' worth of multiplications for each factorisation, about n / 8 in time since they run in the cache, or n / 4 of passes over half of a symmetric matrix; and 2 passes for
/// each solve.
/// Every sum has the same order at any number of threads.
///
/// Source: Golub and Van Loan, "Matrix Computations", 4th edition, algorithm 3.4.1, and sections 3.4.7 and 3.5.3. Departures: none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Direct {
    /// The most memory that factorisations may take, in bytes.
    pub memory_limit_byte: u64,
}

impl Default for Direct {
    /// 4 GiB: 23,170 patches in one channel.
    fn default() -> Self {
        Self {
            memory_limit_byte: 4 << 30,
        }
    }
}

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "direct",
    summary: "Dense factorisation; for many lightings, and as the oracle",
    settings: &[],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: false,
    goes_by_rows: true,
    make: |s| Some(Box::new(Direct::with(s))),
};

impl Direct {
    pub(super) fn with(settings: &SolverSettings) -> Self {
        let limit = settings.memory_limit_byte;
        limit.map_or_else(Self::default, |memory_limit_byte| Self { memory_limit_byte })
    }
}

impl Solver for Direct {
    fn name(&self) -> &'static str {
        "direct"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let rows = system.rows_for(self.name())?;
        let groups = equal_channels(system.reflectance());
        let needed_byte = memory_byte(system.n_patches(), groups.len());
        if needed_byte > self.memory_limit_byte {
            return Err(SolverError::Memory {
                solver: self.name(),
                needed_byte,
                limit_byte: self.memory_limit_byte,
            });
        }
        let scaled = Scaled::new(system);
        let mut state = State {
            scaled: &scaled,
            rows,
            groups,
            factors: Vec::new(),
            radiosity: options.start.radiosity(&scaled),
            residual: scaled.zeros(),
            work: 0.0,
        };
        iteration::run(&scaled, options, monitor, &mut state)
    }
}

/// Returns the memory of so many factorisations, without that of their residuals.
pub(super) fn memory_byte(n_patches: usize, n_factorisations: usize) -> u64 {
    8 * (n_patches as u64).pow(2) * n_factorisations as u64
}

struct State<'a> {
    scaled: &'a Scaled<'a>,
    rows: &'a dyn RowAccess,
    groups: Vec<Vec<usize>>,
    /// One for each group, made by the first pass.
    factors: Vec<Lu>,
    radiosity: Block,
    residual: Block,
    work: f64,
}

/// Returns G of one channel, factored; where the mean of a component is undetermined, with the equation added that it is zero.
fn factored(scaled: &Scaled, rows: &dyn RowAccess, channel: usize) -> Lu {
    let system = scaled.system;
    let n = system.n_patches();
    let mut matrix = Dense::zeros(n);
    for i in 0..n {
        let rho = system.reflectance().row(i)[channel];
        rows.visit_row(i, &mut |j, f| *matrix.at_mut(i, j) = -rho * f);
        *matrix.at_mut(i, i) += 1.0;
    }
    for component in system.singular_components(channel) {
        let labels = &system.components().labels;
        let members: Vec<usize> = (0..n).filter(|&i| labels[i] == component).collect();
        let area: f64 = members.iter().map(|&i| scaled.areas[i]).sum();
        for &i in &members {
            for &j in &members {
                *matrix.at_mut(i, j) += scaled.areas[j] / area;
            }
        }
    }
    Lu::new(matrix)
}

impl Iteration for State<'_> {
    fn pass(&mut self, excess: &[f64]) -> Estimate {
        let n = self.scaled.areas.len();
        self.work = 2.0;
        if self.factors.is_empty() {
            let (scaled, rows) = (self.scaled, self.rows);
            self.factors = self
                .groups
                .iter()
                .map(|group| factored(scaled, rows, group[0]))
                .collect();
            self.work += self.groups.len() as f64 * n as f64 / 3.0;
        }
        for (group, factors) in self.groups.iter().zip(&self.factors) {
            let channel = |&c: &usize| (0..n).map(move |i| (c, i));
            let places = group.iter().flat_map(channel);
            let mut x: Vec<f64> = places.map(|(c, i)| self.residual.row(i)[c]).collect();
            factors.solve(&mut x);
            for (&c, steps) in group
                .iter()
                .zip(x.chunks_exact(n.max(1)))
                .filter(|(c, _)| excess[**c] > 1.0)
            {
                for (i, step) in steps.iter().enumerate() {
                    self.radiosity.row_mut(i)[c] += step;
                }
            }
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

    fn work(&self) -> f64 {
        self.work
    }
}
