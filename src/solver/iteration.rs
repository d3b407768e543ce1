//! The parts that all iterations share: checks of the true residual, the decision to stop, and the record.

use super::best::Best;
use super::error::SolverError;
use super::history::{Monitor, Recorder, Setup};
use super::scaled::{Scaled, TrueResidual};
use super::solution::Solution;
use super::solve::SolveOptions;
use super::stop::{Norms, StopReason, Tolerance, Watch, worst};
use crate::matrix::operator::Block;

/// The share of the former residual above which a residual has gained nothing.
///
/// An estimate below this share of the true residual is wrong.
const GAIN: f64 = 0.5;

/// The outcome of checks of the true residual against the estimates that triggered them.
struct Checks {
    /// The last true residual, over the tolerance.
    before: f64,
    /// The factor by which estimates are taken to be too small.
    factor: f64,
}

impl Checks {
    /// Records a residual and the estimate of it that met the tolerance, and returns whether the estimates are useless.
    ///
    /// Both are over the tolerance. Estimates that do not drift lag behind: they must fall by as much more, which is no stagnation. Nor is it stagnation where estimates that drift are off by little.
    fn observe(&mut self, truth: f64, estimate: f64, drifts: bool) -> bool {
        let leads_nowhere = drifts && truth > GAIN * self.before && estimate < GAIN * truth;
        let most = if drifts { 1.0 / GAIN } else { f64::INFINITY };
        self.before = truth;
        // An estimate of 0 does not show the error of the next one.
        self.factor = if estimate > 0.0 {
            (truth / estimate).clamp(1.0, most)
        } else {
            1.0
        };
        leads_nowhere
    }
}

/// The residual of an iteration after a pass, as far as it is known.
pub(super) enum Estimate {
    /// The norms by the method's own estimate; the true residual is calculated when they meet the tolerance.
    Running(Norms),
    /// The residual of the current radiosities, from F itself.
    True(TrueResidual),
    /// The system lacks a property that the method needs, such as positive definiteness: more passes are of no use.
    Breakdown,
}

/// A method that improves radiosities pass by pass. Blocks are in solver units (see [`Scaled`]).
pub(super) trait Iteration {
    /// Returns whether [`restart`](Self::restart) has to be called before the first pass.
    fn needs_residual(&self) -> bool {
        true
    }

    /// Returns whether no channel's residual, by `Tolerance::ResidualL2`, ever rises from pass to pass: the last radiosities are then the best.
    fn never_rises(&self) -> bool {
        false
    }

    /// Returns false if estimates come from F in each pass anew, as those of sweeps do: patience alone then detects stagnation.
    fn drifts(&self) -> bool {
        true
    }

    /// Returns the residual of the radiosities before the first pass, with one pass over F.
    ///
    /// Further vectors may go through that pass: it counts as one, as one for any number of channels does.
    fn first_residual(&mut self, scaled: &Scaled) -> TrueResidual {
        scaled.true_residual(&self.radiosity())
    }

    /// Counts one pass. `excess` is the factor by which each channel's residual exceeds the tolerance, infinity before it is known:
    /// channels at 1 or below may rest.
    fn pass(&mut self, excess: &[f64]) -> Estimate;

    /// Returns the radiosities.
    fn radiosity(&self) -> Block;

    /// Restarts from the true residual of the current radiosities.
    ///
    /// Channels whose `excess` is 1 or below rest: they stay unchanged.
    fn restart(&mut self, _truth: &TrueResidual, _excess: &[f64]) {}

    /// Returns the work before the first pass.
    fn setup(&self) -> Setup {
        Setup::default()
    }

    /// Returns the work of the last pass, in passes over F.
    fn work(&self) -> f64 {
        1.0
    }

    /// Returns B with an estimate of the unshot light, where the method has one.
    fn display(&self) -> Option<Block> {
        None
    }

    /// Returns the quantity that falls with every pass towards the solution, where that is not the residual's norm: patience depends on it.
    fn under_way(&self) -> Option<f64> {
        None
    }

    /// Returns how often each patch was selected, in methods that select.
    fn selections(&self) -> Vec<u64> {
        Vec::new()
    }
}

/// Runs an iteration until the true residual meets the tolerance, or more passes are of no use.
///
/// When the running estimate meets the tolerance, the true residual is calculated with one more pass over F, and the iteration
/// restarts from it where it does not meet the tolerance. Two such checks in a row that differ by less than a factor of 2 end it as
/// [`StopReason::Stagnated`], if the estimate is wrong by that factor as well and the method does not go by the unshot power. Radiosities that meet the tolerance and are negative on some patches,
/// though all exitances are nonnegative, are set to E there. If they still meet the tolerance they are the solution; otherwise the iteration goes on, and ends as [`StopReason::Diverged`] if it
/// does not get far closer: B ≥ 0 with (I − diag(ρ) F) B = E ≥ 0 shows that the system is one of light (an M-matrix).
/// Where rounding decides whether the tolerance is met, the residual is calculated with twice the digits. Where the tolerance is not met, the best radiosities of each channel are returned, not the last.
#[expect(clippy::too_many_lines, reason = "one loop, whose branches all end or continue it")]
pub(super) fn run(
    scaled: &Scaled,
    options: &SolveOptions,
    monitor: Monitor<'_>,
    iteration: &mut dyn Iteration,
) -> Result<Solution, SolverError> {
    let tolerance = options.tolerance.validated()?;
    let mut recorder = Recorder::new(scaled, options.reference, iteration.setup(), monitor);
    let mut watch = Watch::new(options.patience);
    let n_channels = scaled.system.n_channels();
    let mut excess = vec![f64::INFINITY; n_channels];
    let mut truth = None;
    let (mut n_passes, mut n_checks) = (0, 0);
    let mut gave_up = StopReason::MaxPasses;
    let mut checks = Checks {
        before: f64::INFINITY,
        factor: 1.0,
    };
    let mut best = Best::new(n_channels);
    let mut rejected_before = f64::INFINITY;
    let mut mended = None;
    let mut done = (0..n_channels).all(|c| scaled.is_dark(c));
    if iteration.needs_residual() && !done {
        let first = iteration.first_residual(scaled);
        let first = scaled.sharpened(tolerance, &iteration.radiosity(), first);
        n_checks += 1;
        excess = tolerance.excess(&first.norms);
        checks.before = worst(&excess);
        done = checks.before <= 1.0;
        if !recorder.note(0, 0.0, &first.norms, false, &|| iteration.radiosity()) {
            (gave_up, done) = (StopReason::Interrupted, true);
        }
        if !done && let Some(reason) = watch.observe(&excess, None) {
            (gave_up, done) = (reason, true);
        }
        if !done && options.max_passes > 0 {
            iteration.restart(&first, &excess);
        }
        truth = Some(first);
    }
    while !done && n_passes < options.max_passes {
        truth = None;
        let estimate = iteration.pass(&excess);
        n_passes += 1;
        let mut factor = checks.factor;
        let mut plain = 0.0;
        let mut norms = match estimate {
            Estimate::Running(norms) => norms,
            Estimate::True(mut exact) => {
                factor = 1.0;
                plain = worst(&tolerance.excess(&exact.norms));
                if plain <= 1.0 {
                    exact = scaled.sharpened(tolerance, &iteration.radiosity(), exact);
                }
                truth.insert(exact).norms.clone()
            }
            Estimate::Breakdown => {
                gave_up = StopReason::Diverged;
                break;
            }
        };
        let mut goes_on = recorder.note(n_passes, iteration.work(), &norms, truth.is_none(), &|| {
            iteration.radiosity()
        });
        let mut stagnated = false;
        if let Some(exact) = truth.take_if(|exact| exact.is_sharp && worst(&tolerance.excess(&exact.norms)) > 1.0) {
            // The apparent solution was rounding.
            stagnated = checks.observe(worst(&tolerance.excess(&exact.norms)), plain, true);
            iteration.restart(&exact, &tolerance.excess(&exact.norms));
            n_checks += 1;
        }
        let estimated = worst(&tolerance.excess(&norms));
        let claims = factor * estimated <= 1.0;
        if truth.is_none() && (claims || options.true_history) {
            let check = || {
                let radiosity = iteration.radiosity();
                scaled.sharpened(tolerance, &radiosity, scaled.true_residual(&radiosity))
            };
            let exact = if options.true_history {
                recorder.off_the_clock(check)
            } else {
                check()
            };
            n_checks += 1;
            norms = exact.norms.clone();
            factor = 1.0;
            let checked = worst(&tolerance.excess(&norms));
            let has_fallen = checked < checks.before;
            if claims {
                // A method that goes by the unshot power checks radiosities one reflection beyond that power: the check may lag for long.
                stagnated = checks.observe(checked, estimated, iteration.drifts()) && iteration.under_way().is_none();
            }
            goes_on = recorder.note(n_passes, 0.0, &norms, false, &|| iteration.radiosity()) && goes_on;
            if claims && checked > 1.0 && !stagnated {
                // The radiosities may change with it: their true residual is calculated anew at the end.
                iteration.restart(&exact, &tolerance.excess(&norms));
                if !iteration.drifts() && has_fallen {
                    // Estimates are scaled from here on: the earlier ones are no measure of them.
                    watch = Watch::new(options.patience);
                }
            } else {
                truth = Some(exact);
            }
        }
        excess = tolerance.excess(&norms);
        for over in &mut excess {
            *over *= factor;
        }
        if !(iteration.never_rises() && scaled.is_one_room() && matches!(tolerance, Tolerance::ResidualL2(_))) {
            best.observe(&excess, || iteration.radiosity());
        }
        if worst(&excess) <= 1.0 {
            match mend(scaled, tolerance, iteration.radiosity(), &mut n_checks) {
                Mended::NotNeeded => break,
                Mended::Done(radiosity, exact) => {
                    recorder.note(n_passes, 0.0, &exact.norms, false, &|| radiosity.clone());
                    truth = Some(*exact);
                    mended = Some(radiosity);
                    break;
                }
                Mended::Impossible => {
                    let rejected = worst(&excess);
                    // Also where there is nothing more to gain.
                    if rejected >= GAIN * rejected_before || !goes_on {
                        gave_up = StopReason::Diverged;
                        break;
                    }
                    rejected_before = rejected;
                    // Channels that meet the tolerance would rest, and those that rested have no direction to continue in.
                    excess.fill(f64::INFINITY);
                    let exact = truth.take().unwrap_or_else(|| {
                        n_checks += 1;
                        scaled.true_residual(&iteration.radiosity())
                    });
                    iteration.restart(&exact, &excess);
                    continue;
                }
            }
        }
        let reason = watch.observe(&excess, iteration.under_way());
        if let Some(reason) = reason.or(stagnated.then_some(StopReason::Stagnated)) {
            gave_up = reason;
            break;
        }
        if !goes_on {
            gave_up = StopReason::Interrupted;
            break;
        }
    }
    let (radiosity, truth) = match (mended, truth) {
        (Some(radiosity), Some(truth)) => (radiosity, truth),
        (_, truth) => {
            if gave_up == StopReason::Interrupted {
                best = Best::new(n_channels); // Who stops an iteration wants to see where it stands.
            }
            finish(scaled, tolerance, best, iteration.radiosity(), truth, &mut n_checks)
        }
    };
    let truth = scaled.sharpened(tolerance, &radiosity, truth);
    if recorder.lacks(&truth.norms) {
        recorder.note(n_passes, 0.0, &truth.norms, false, &|| radiosity.clone());
    }
    let counts = (n_passes, n_checks);
    let display = iteration.display().map(|block| scaled.to_si(block));
    let solution = Solution::new(scaled, radiosity, truth, tolerance, gave_up, counts, recorder)?;
    Ok(Solution {
        display,
        selections: iteration.selections(),
        ..solution
    })
}

/// The result of clipping radiosities that meet the tolerance.
enum Mended {
    /// None is negative, or they may be.
    NotNeeded,
    /// Some were, and are E now; the tolerance is still met.
    Done(Block, Box<TrueResidual>),
    /// Some are, by more than the tolerance explains.
    Impossible,
}

fn mend(scaled: &Scaled, tolerance: Tolerance, mut radiosity: Block, n_checks: &mut usize) -> Mended {
    let values = radiosity.values_mut();
    if scaled.system.is_signed() || values.iter().all(|b| *b >= 0.0 || b.is_nan()) {
        return Mended::NotNeeded;
    }
    // A radiosity is at least the exitance.
    for (b, e) in values.iter_mut().zip(scaled.exitance.values()) {
        if *b < 0.0 {
            *b = *e;
        }
    }
    let truth = scaled.true_residual(&radiosity);
    let truth = scaled.sharpened(tolerance, &radiosity, truth);
    *n_checks += 1;
    if worst(&tolerance.excess(&truth.norms)) <= 1.0 {
        Mended::Done(radiosity, Box::new(truth))
    } else {
        Mended::Impossible
    }
}

/// Returns the final radiosities with their true residual; `truth` is that of `last`, where it is known.
fn finish(
    scaled: &Scaled,
    tolerance: Tolerance,
    best: Best,
    mut last: Block,
    truth: Option<TrueResidual>,
    n_checks: &mut usize,
) -> (Block, TrueResidual) {
    let mut check = |radiosity: &Block| {
        *n_checks += 1;
        scaled.true_residual(radiosity)
    };
    let truth = truth.filter(|_| !scaled.remove_free_means(&mut last));
    let last_truth = truth.unwrap_or_else(|| check(&last));
    if worst(&tolerance.excess(&last_truth.norms)) <= 1.0 {
        return (last, last_truth);
    }
    let (mut chosen, chosen_truth, spent) = best.or_last(scaled, tolerance, last, last_truth);
    let chosen_truth = if spent > 0 && scaled.remove_free_means(&mut chosen) {
        check(&chosen)
    } else {
        chosen_truth
    };
    *n_checks += spent;
    (chosen, chosen_truth)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_that_lag_are_told_from_those_that_are_wrong() {
        let mut checks = Checks {
            before: f64::INFINITY,
            factor: 1.0,
        };
        let mut says = |truth, estimate, drifts| (checks.observe(truth, estimate, drifts), checks.factor);
        assert_eq!(says(8.0, 0.5, false), (false, 16.0));
        assert_eq!(says(7.0, 0.5, false), (false, 14.0));
        assert_eq!(says(6.0, 0.5, true), (true, 2.0));
        assert_eq!(says(2.5, 0.5, true), (false, 2.0));
        assert_eq!(says(1.5, 1.0, true), (false, 1.5));
        // Less than the estimate, or nothing.
        assert_eq!(says(0.5, 1.0, false), (false, 1.0));
        assert_eq!(says(1.5, 0.0, false), (false, 1.0));
        assert_eq!(says(0.0, 0.0, true), (false, 1.0));
    }
}
