//! How long work tells its caller how far it is: the library itself never prints.

/// Receives the progress of one stage after another; called from many threads.
pub trait Progress: Sync {
    /// A stage of `total` steps begins; it ends when the next one begins or all work is done.
    fn begin(&self, stage: &str, total: u64);
    /// `steps` more steps of the current stage are done.
    fn advance(&self, steps: u64);
}

/// Ignores all progress.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _total: u64) {}
    fn advance(&self, _steps: u64) {}
}
