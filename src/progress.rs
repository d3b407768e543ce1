//! The interface between long work and its caller: progress, interruption, checkpoints, and ranks that share the work.
//!
//! The library itself never prints.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::checkpoint::Checkpoint;
use crate::ranks::{Alone, Ranks};

/// Receives the progress of one stage after another; called from many threads.
pub trait Progress: Sync {
    /// Begins a stage of `total` steps, 0 if their number is unknown; it ends when the next one begins or all work is done.
    fn begin(&self, stage: &str, total: u64);
    /// Advances the current stage by `steps`.
    fn advance(&self, steps: u64);

    /// Receives the expected time of the current stage, once it is known.
    fn forecast(&self, _forecast: &Forecast) {}

    /// Returns the deadline of the work, if there is one.
    ///
    /// Values that are not computed by then are replaced by bounds, which their errors include.
    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// Returns whether the deadline has passed.
    fn is_late(&self) -> bool {
        self.deadline().is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Returns whether work is to end at the next safe point; once true, it stays true.
    ///
    /// Work that can fail then fails as interrupted; the results of other work are incomplete.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// Receives the file that stores finished work from now on.
    fn opened(&self, _checkpoint: &Path) {}

    /// Returns the checkpoint for finished form factors and gathered light, which a later run need not compute again.
    fn checkpoint(&self) -> Option<&Checkpoint> {
        None
    }

    /// Returns the ranks that share work.
    fn ranks(&self) -> &dyn Ranks {
        &Alone
    }
}

/// The expected wall time of form factors.
///
/// It is estimated from some rows, and from some of their pairs, of which those that seem expensive are drawn more often. It includes the effect of other work on the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// The requested tolerance, and the time in s.
    pub asked: (f64, f64),
    /// True if some pairs of the sample took longer than it may take: the times are then too low.
    pub at_least: bool,
    /// Greater tolerances with their times in s; empty if they are not needed.
    pub looser: Vec<(f64, f64)>,
    /// The rays for each patch, and the time in s, of [`RandomShooting`](crate::form_factor::RandomShooting) in place of the method; only together with the others.
    pub shooting: Option<(u64, f64)>,
}

impl Forecast {
    /// The time, in s, above which work causes a warning with alternatives.
    pub const LONG: f64 = 600.0;

    /// Returns the greatest standard error of an entry with `rays` rays for each patch, 1 / (2 sqrt(N)).
    #[must_use]
    pub fn error_of_rays(rays: u64) -> f64 {
        0.5 / (rays as f64).sqrt()
    }
}

/// The steps of a stage, reported in portions as parts of the underlying work are done.
pub(crate) struct Portions<'a> {
    progress: &'a dyn Progress,
    steps: u64,
    n_parts: u64,
    n_done: AtomicU64,
}

impl<'a> Portions<'a> {
    /// Begins work of `n_parts` parts that together make `steps`; without parts all steps are done.
    pub(crate) fn new(progress: &'a dyn Progress, steps: u64, n_parts: usize) -> Self {
        if n_parts == 0 {
            progress.advance(steps);
        }
        Self {
            progress,
            steps,
            n_parts: n_parts as u64,
            n_done: AtomicU64::new(0),
        }
    }

    /// Reports one more finished part.
    pub(crate) fn part_done(&self) {
        self.parts_done(1);
    }

    /// Reports more finished parts: those of a piece of work that counts as several.
    pub(crate) fn parts_done(&self, n: usize) {
        let n_now = n as u64;
        let n_before = self.n_done.fetch_add(n_now, Ordering::Relaxed);
        let until = |done: u64| u128::from(self.steps) * u128::from(done) / u128::from(self.n_parts);
        let steps = until(n_before + n_now) - until(n_before);
        self.progress.advance(u64::try_from(steps).unwrap_or(self.steps));
    }
}

/// An observer that ignores all progress.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
}
