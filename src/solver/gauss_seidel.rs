//! `gauss-seidel`: every patch in turn gathers light from the newest radiosities.

use super::entry::{SolverEntry, Symmetry};
use super::history::Monitor;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::Scaled;
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use crate::matrix::operator::{Block, RowAccess};

/// Gauss-Seidel iteration, all channels together.
///
/// B_i ← (E_i + ρ_i Σ_{j≠i} F_ij B_j) / (1 − ρ_i F_ii), i = 1 ... n in patch order with the newest B_j.
/// One pass is one sweep: serial, hence the same bytes at any number of threads. It converges where ρ_i Σ_j F_ij < 1
/// for all patches, and in any enclosure that has a finite solution and row sums of at most 1. The error falls by about ρ² a pass, so that an enclosure with reflectances near
/// 1 takes many. It needs rows, not reciprocity.
///
/// A sweep finds the residual r_i of every patch just before it corrects it; these are the estimate in the history. They lag
/// by one sweep and so overstate the current residual. When they meet the tolerance, the true residual is calculated
/// with one more pass over F, and sweeps go on until it meets the tolerance as well.
///
/// Source: Baranoski, Bramley and Shirley 1995, section 1.2; Lewis 1992, section 3, for F_ii ≠ 0.
/// Departures: line 5 of the former adds the reflected light (a minus sign is printed).
#[derive(Clone, Copy, Debug, Default)]
pub struct GaussSeidel;

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "gauss-seidel",
    summary: "Every patch in turn gathers from the newest radiosities",
    settings: &[],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: false,
    goes_by_rows: true,
    make: |_| Some(Box::new(GaussSeidel)),
};

impl Solver for GaussSeidel {
    fn name(&self) -> &'static str {
        "gauss-seidel"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let rows = system.rows_for(self.name())?;
        let scaled = Scaled::new(system);
        run_sweeps(&scaled, rows, options, monitor, |_, _, _, gathered| gathered)
    }
}

/// Solves by sweeps in which patch i gets `relax(i, c, old, gathered)` in channel c in place of the gathered radiosity.
pub(super) fn run_sweeps(
    scaled: &Scaled,
    rows: &dyn RowAccess,
    options: &SolveOptions,
    monitor: Monitor<'_>,
    relax: impl Fn(usize, usize, f64, f64) -> f64,
) -> SolveResult {
    let mut sweeps = Sweeps {
        scaled,
        rows,
        relax,
        radiosity: options.start.radiosity(scaled),
        before: scaled.zeros(),
    };
    iteration::run(scaled, options, monitor, &mut sweeps)
}

struct Sweeps<'a, R> {
    scaled: &'a Scaled<'a>,
    rows: &'a dyn RowAccess,
    relax: R,
    radiosity: Block,
    /// The residual that each patch had just before its update.
    before: Block,
}

impl<R: Fn(usize, usize, f64, f64) -> f64> Iteration for Sweeps<'_, R> {
    fn needs_residual(&self) -> bool {
        false
    }

    fn drifts(&self) -> bool {
        false
    }

    fn pass(&mut self, _excess: &[f64]) -> Estimate {
        relaxed_sweep(
            self.scaled,
            self.rows,
            &mut self.radiosity,
            &mut self.before,
            &self.relax,
        );
        Estimate::Running(self.scaled.norms(&self.before))
    }

    fn radiosity(&self) -> Block {
        self.radiosity.clone()
    }
}

/// Updates all patches in order; `before` receives the residual that each had just before its update.
pub(super) fn sweep(scaled: &Scaled, rows: &dyn RowAccess, radiosity: &mut Block, before: &mut Block) {
    relaxed_sweep(scaled, rows, radiosity, before, |_, _, _, gathered| gathered);
}

/// As [`sweep`], with `relax` as in [`run_sweeps`].
fn relaxed_sweep(
    scaled: &Scaled,
    rows: &dyn RowAccess,
    radiosity: &mut Block,
    before: &mut Block,
    relax: impl Fn(usize, usize, f64, f64) -> f64,
) {
    let reflectance = scaled.system.reflectance();
    let mut gathered = vec![0.0; reflectance.n_channels()];
    for i in 0..scaled.areas.len() {
        gathered.fill(0.0);
        let f_ii = rows.dot_off_diagonal(i, radiosity, &mut gathered);
        let (e, rho) = (scaled.exitance.row(i), reflectance.row(i));
        for (c, b) in radiosity.row_mut(i).iter_mut().enumerate() {
            let diagonal = 1.0 - rho[c] * f_ii;
            let residual = e[c] + rho[c] * gathered[c] - diagonal * *b;
            before.row_mut(i)[c] = residual;
            // A patch that sends all of its light back to itself can only stay dark; if it emits, the residual shows it.
            if diagonal > 0.0 {
                *b = relax(i, c, *b, (e[c] + rho[c] * gathered[c]) / diagonal);
            }
        }
    }
}
