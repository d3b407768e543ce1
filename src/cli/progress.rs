//! Progress bars on a terminal, nothing elsewhere.

use std::io::IsTerminal;
use std::sync::Mutex;

use indicatif::{ProgressBar, ProgressStyle};

use super::interrupt::Interrupt;
use crate::checkpoint::Checkpoint;
use crate::progress::Progress;

/// One bar on stderr for the current stage, with the time left.
pub(super) struct Bars {
    current: Mutex<ProgressBar>,
    shown: bool,
    interrupt: Interrupt,
    pub(super) checkpoint: Option<Checkpoint>,
}

impl Bars {
    /// Shows bars if stderr is a terminal and `quiet` is not asked for.
    #[must_use]
    pub(super) fn new(quiet: bool, interrupt: Interrupt) -> Self {
        Self {
            current: Mutex::new(ProgressBar::hidden()),
            shown: !quiet && std::io::stderr().is_terminal(),
            interrupt,
            checkpoint: None,
        }
    }

    /// Removes the bar.
    pub(super) fn finish(&self) {
        self.with(ProgressBar::finish_and_clear);
    }

    fn with(&self, action: impl FnOnce(&ProgressBar)) {
        // A poisoned lock only means that another thread panicked while drawing.
        action(&self.current.lock().unwrap_or_else(std::sync::PoisonError::into_inner));
    }
}

impl Progress for Bars {
    fn begin(&self, stage: &str, total: u64) {
        if !self.shown {
            return;
        }
        let style = ProgressStyle::with_template("{msg:<16} [{bar:32}] {percent:>3} % {eta:>6} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar())
            .progress_chars("=> ");
        let bar = ProgressBar::new(total).with_style(style).with_message(stage.to_owned());
        let mut current = self.current.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        current.finish_and_clear();
        *current = bar;
    }

    fn advance(&self, steps: u64) {
        if self.shown {
            self.with(|bar| bar.inc(steps));
        }
    }

    fn is_cancelled(&self) -> bool {
        self.interrupt.came()
    }

    fn checkpoint(&self) -> Option<&Checkpoint> {
        self.checkpoint.as_ref()
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.finish();
    }
}
