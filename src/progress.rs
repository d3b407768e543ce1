//! How long work tells its caller how far it is, hears from it that it is to stop, keeps what is done, and shares work with other ranks: the library itself never prints.

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::checkpoint::Checkpoint;
use crate::ranks::{Alone, Ranks};

/// Receives the progress of one stage after another; called from many threads.
pub trait Progress: Sync {
    /// A stage of `total` steps begins, 0 where their number is not known; it ends when the next one begins or all work is done.
    fn begin(&self, stage: &str, total: u64);
    /// `steps` more steps of the current stage are done.
    fn advance(&self, steps: u64);

    /// Hears what the current stage is expected to take, once that is known.
    fn forecast(&self, _forecast: &Forecast) {}

    /// Returns when work is to be over. What is not done by then gets bounds in place of values, and says so in its errors.
    fn deadline(&self) -> Option<Instant> {
        None
    }

    /// Returns whether the deadline has passed.
    fn is_late(&self) -> bool {
        self.deadline().is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Returns whether work is to end at the next safe point. Once true it stays so.
    ///
    /// Work that can fail then fails as interrupted; what other work returns is not complete.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// Hears where finished work is kept from now on.
    fn opened(&self, _checkpoint: &Path) {}

    /// Returns where finished pieces of form factors and of gathered light are kept, so that a later run need not compute them again.
    fn checkpoint(&self) -> Option<&Checkpoint> {
        None
    }

    /// Returns the ranks that share work.
    fn ranks(&self) -> &dyn Ranks {
        &Alone
    }
}

/// The wall time that form factors are expected to take.
///
/// It is the mean of the time that some rows took, times their number over the threads: dear pairs that are rare may be missing from it, and other work on the machine is in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// The tolerance asked for, and the time in s.
    pub asked: (f64, f64),
    /// Greater tolerances with their times in s; none where nobody is going to look at them.
    pub looser: Vec<(f64, f64)>,
    /// The rays for each patch, and the time in s, of [`RandomShooting`](crate::form_factor::RandomShooting) in place of the method; with the others only.
    pub shooting: Option<(u64, f64)>,
}

impl Forecast {
    /// Work that takes longer than this, in s, deserves a choice.
    pub const LONG: f64 = 600.0;

    /// Returns the standard error that an entry has at most with so many rays for each patch, 1 / (2 sqrt(N)).
    #[must_use]
    pub fn error_of_rays(rays: u64) -> f64 {
        0.5 / (rays as f64).sqrt()
    }
}

/// Steps of a stage that are told in portions, as parts of the work behind them are done.
pub(crate) struct Portions<'a> {
    progress: &'a dyn Progress,
    steps: u64,
    n_parts: u64,
    n_done: AtomicU64,
}

impl<'a> Portions<'a> {
    /// Begins work of `n_parts` parts that stand for `steps` together; without a part all steps are done.
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

    /// One more part is done.
    pub(crate) fn part_done(&self) {
        let n_before = self.n_done.fetch_add(1, Ordering::Relaxed);
        let until = |n: u64| u128::from(self.steps) * u128::from(n) / u128::from(self.n_parts);
        let steps = until(n_before + 1) - until(n_before);
        self.progress.advance(u64::try_from(steps).unwrap_or(self.steps));
    }
}

/// Ignores all progress.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
}
