//! `gauss-seidel`: every patch in turn gathers light from the newest radiosities.

use std::ops::ControlFlow;

use super::history::{HistoryEntry, Recorder};
use super::scaled::Scaled;
use super::stop::{StopReason, Watch, worst};
use super::{RadiositySystem, Solution, SolveOptions, Solver, SolverError, Start};
use crate::matrix::operator::{Block, RowAccess};

/// Gauss-Seidel iteration, all channels together.
///
/// B_i ← (E_i + ρ_i Σ_{j≠i} F_ij B_j) / (1 − ρ_i F_ii), i = 1 ... n in patch order with the newest B_j.
/// One pass is one sweep: serial, hence the same bytes at any number of threads. Converges where ρ_i Σ_j F_ij < 1
/// for all patches, and in any room that has a finite solution and row sums of at most 1; the error falls by about ρ² a pass, so a room with reflectances near
/// 1 takes many. Needs rows, not reciprocity.
///
/// A sweep meets the residual r_i of every patch just before it mends it; these are the estimate in the history. They lag
/// by one sweep and so overstate the residual left. When they meet the tolerance, the true residual is calculated
/// with one more pass over F, and sweeps go on until it meets the tolerance as well.
///
/// Source: Baranoski, Bramley and Shirley 1995, section 1.2; Lewis 1992, section 3, for F_ii ≠ 0.
/// Departures: line 5 of the former adds the reflected light (a minus sign is printed).
#[derive(Clone, Copy, Debug, Default)]
pub struct GaussSeidel;

impl Solver for GaussSeidel {
    fn name(&self) -> &'static str {
        "gauss-seidel"
    }

    fn solve(
        &self,
        system: &RadiositySystem,
        options: &SolveOptions,
        monitor: &mut dyn FnMut(&HistoryEntry) -> ControlFlow<()>,
    ) -> Result<Solution, SolverError> {
        let tolerance = options.tolerance.validated()?;
        let Some(rows) = system.operator().rows() else {
            return Err(SolverError::NeedsRows { solver: self.name() });
        };
        let scaled = Scaled::new(system);
        let mut recorder = Recorder::new(monitor);
        let mut watch = Watch::new(options.patience);
        let mut radiosity = start(&scaled, options.start);
        let mut before = scaled.zeros();
        let mut truth = None;
        let (mut n_passes, mut n_checks) = (0, 0);
        let mut gave_up = StopReason::MaxPasses;
        let dark = (0..system.n_channels()).all(|c| scaled.is_dark(c));
        while n_passes < options.max_passes && !dark {
            sweep(&scaled, rows, &mut radiosity, &mut before);
            n_passes += 1;
            let mut norms = scaled.norms(&before);
            truth = None;
            if worst(&tolerance.excess(&norms)) <= 1.0 {
                n_checks += 1;
                norms = truth.insert(scaled.true_residual(&radiosity)).norms.clone();
            }
            let goes_on = recorder.note(n_passes, &norms, truth.is_none());
            let excess = worst(&tolerance.excess(&norms));
            if excess <= 1.0 {
                break;
            }
            if let Some(reason) = watch.observe(excess) {
                gave_up = reason;
                break;
            }
            if !goes_on {
                gave_up = StopReason::Interrupted;
                break;
            }
        }
        let truth = truth.unwrap_or_else(|| {
            n_checks += 1;
            let last = scaled.true_residual(&radiosity);
            recorder.note(n_passes, &last.norms, false);
            last
        });
        let counts = (n_passes, n_checks);
        Solution::new(&scaled, radiosity, truth, tolerance, gave_up, counts, recorder)
    }
}

fn start(scaled: &Scaled, start: Start) -> Block {
    if start == Start::Zero {
        return scaled.zeros();
    }
    let mut radiosity = start.irradiance(scaled);
    let terms = scaled
        .exitance
        .values()
        .iter()
        .zip(scaled.system.reflectance().values());
    for (b, (e, rho)) in radiosity.values_mut().iter_mut().zip(terms) {
        *b = e + rho * *b;
    }
    radiosity
}

/// Updates all patches in order; `before` receives the residual that each had just before its update.
fn sweep(scaled: &Scaled, rows: &dyn RowAccess, radiosity: &mut Block, before: &mut Block) {
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
            // A patch that sends all of its light back to itself can only stay dark; with light the residual tells.
            if diagonal > 0.0 {
                *b = (e[c] + rho[c] * gathered[c]) / diagonal;
            }
        }
    }
}
