//! What all iterations share: when to look at the true residual, when to stop, what to write down.

use std::ops::ControlFlow;

use super::history::{HistoryEntry, Recorder};
use super::scaled::{Norms, Scaled, TrueResidual};
use super::stop::{StopReason, Watch, worst};
use super::{Solution, SolveOptions, SolverError};
use crate::matrix::operator::Block;

/// A check of the true residual after which it has not fallen below this share of the one before has gained nothing.
const GAIN: f64 = 0.5;

/// What an iteration knows of its residual after a pass.
pub(super) enum Estimate {
    /// The norms that its own account gives; the true residual is calculated when they meet the tolerance.
    Running(Norms),
    /// The residual of the radiosities as they are now, from F itself.
    True(TrueResidual),
    /// The system is not what the method needs, such as positive definite: no use to go on.
    Breakdown,
}

/// A method that improves radiosities pass by pass. Blocks are in solver units (see [`Scaled`]).
pub(super) trait Iteration {
    /// Whether [`restart`](Self::restart) has to be called before the first pass.
    const NEEDS_RESIDUAL: bool;

    /// Spends one pass. `excess` tells by what factor each channel's residual exceeds the tolerance, infinity before it is known:
    /// channels at 1 or below may rest.
    fn pass(&mut self, excess: &[f64]) -> Estimate;

    /// Returns the radiosities.
    fn radiosity(&self) -> Block;

    /// Takes in the true residual of the radiosities as they are.
    fn restart(&mut self, truth: &TrueResidual);

    /// Returns the work of the last pass, in passes over F; what was spent before the first pass counts with it.
    fn work(&self) -> f64 {
        1.0
    }

    /// Returns B with an estimate of the light that is still under way, where the method has one.
    fn display(&self) -> Option<Block> {
        None
    }

    /// Returns how often each patch was selected, in methods that select.
    fn selections(&self) -> Vec<u64> {
        Vec::new()
    }
}

/// Runs an iteration until the true residual meets the tolerance, or there is no point in going on.
///
/// When the running estimate meets the tolerance, the true residual is calculated with one more pass over F, and the iteration
/// restarts from it where it does not meet the tolerance; two such checks in a row that differ by less than a factor of 2 end it as
/// [`StopReason::Stagnated`].
pub(super) fn run<I: Iteration>(
    scaled: &Scaled,
    options: &SolveOptions,
    monitor: &mut dyn FnMut(&HistoryEntry) -> ControlFlow<()>,
    mut iteration: I,
) -> Result<Solution, SolverError> {
    let tolerance = options.tolerance.validated()?;
    let mut recorder = Recorder::new(scaled, options.reference, monitor);
    let mut watch = Watch::new(options.patience);
    let n_channels = scaled.system.n_channels();
    let mut excess = vec![f64::INFINITY; n_channels];
    let mut truth = None;
    let (mut n_passes, mut n_checks) = (0, 0);
    let mut gave_up = StopReason::MaxPasses;
    let mut checked_before = f64::INFINITY;
    let mut done = (0..n_channels).all(|c| scaled.is_dark(c));
    if I::NEEDS_RESIDUAL && !done {
        let radiosity = iteration.radiosity();
        let first = scaled.true_residual(&radiosity);
        n_checks += 1;
        excess = tolerance.excess(&first.norms);
        checked_before = worst(&excess);
        done = checked_before <= 1.0;
        if !recorder.note(0, 0.0, &first.norms, false, || radiosity) {
            (gave_up, done) = (StopReason::Interrupted, true);
        }
        if !done && let Some(reason) = watch.observe(checked_before) {
            (gave_up, done) = (reason, true);
        }
        if !done {
            iteration.restart(&first);
        }
        truth = Some(first);
    }
    while !done && n_passes < options.max_passes {
        truth = None;
        let estimate = iteration.pass(&excess);
        n_passes += 1;
        let mut norms = match estimate {
            Estimate::Running(norms) => norms,
            Estimate::True(exact) => truth.insert(exact).norms.clone(),
            Estimate::Breakdown => {
                gave_up = StopReason::Diverged;
                break;
            }
        };
        let mut goes_on = recorder.note(n_passes, iteration.work(), &norms, truth.is_none(), || {
            iteration.radiosity()
        });
        let mut stagnated = false;
        let claims = worst(&tolerance.excess(&norms)) <= 1.0;
        if truth.is_none() && (claims || options.true_history) {
            let check = || scaled.true_residual(&iteration.radiosity());
            let exact = if options.true_history {
                recorder.off_the_clock(check)
            } else {
                check()
            };
            n_checks += 1;
            norms = exact.norms.clone();
            let checked = worst(&tolerance.excess(&norms));
            if claims {
                stagnated = checked > GAIN * checked_before;
                checked_before = checked;
            }
            goes_on = recorder.note(n_passes, 0.0, &norms, false, || iteration.radiosity()) && goes_on;
            if claims && checked > 1.0 && !stagnated {
                // The radiosities may change with it: what is true of them is calculated anew at the end.
                iteration.restart(&exact);
            } else {
                truth = Some(exact);
            }
        }
        excess = tolerance.excess(&norms);
        if worst(&excess) <= 1.0 {
            break;
        }
        let reason = watch.observe(worst(&excess));
        if let Some(reason) = reason.or(stagnated.then_some(StopReason::Stagnated)) {
            gave_up = reason;
            break;
        }
        if !goes_on {
            gave_up = StopReason::Interrupted;
            break;
        }
    }
    let radiosity = iteration.radiosity();
    let truth = truth.unwrap_or_else(|| {
        n_checks += 1;
        let last = scaled.true_residual(&radiosity);
        recorder.note(n_passes, 0.0, &last.norms, false, || radiosity.clone());
        last
    });
    let counts = (n_passes, n_checks);
    let display = iteration.display().map(|block| scaled.to_si(block));
    let solution = Solution::new(scaled, radiosity, truth, tolerance, gave_up, counts, recorder)?;
    Ok(Solution {
        display,
        selections: iteration.selections(),
        ..solution
    })
}
