//! How long work tells its caller how far it is, hears from it that it is to stop, and keeps what is done: the library itself never prints.

use crate::checkpoint::Checkpoint;

/// Receives the progress of one stage after another; called from many threads.
pub trait Progress: Sync {
    /// A stage of `total` steps begins; it ends when the next one begins or all work is done.
    fn begin(&self, stage: &str, total: u64);
    /// `steps` more steps of the current stage are done.
    fn advance(&self, steps: u64);

    /// Tells whether work is to end at the next safe point. Once true it stays so.
    ///
    /// Work that can fail then fails as interrupted; what other work returns is not complete.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// Returns where finished pieces of form factors and of gathered light are kept, so that a later run need not compute them again.
    fn checkpoint(&self) -> Option<&Checkpoint> {
        None
    }
}

/// Ignores all progress.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
}
