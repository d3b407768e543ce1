//! Handles signals that ask the program to end.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use super::exit_code::ExitCode;
use super::failure::Failure;
use super::ranks;
use crate::whole_file;

/// A handler of SIGINT and SIGTERM: the first signal ends the program at a safe point, or after [`GRACE`], and the next one at once.
///
/// Ranks other than the first wait five times as long.
#[derive(Clone, Debug, Default)]
pub(super) struct Interrupt {
    /// The received signal, or 0.
    signal: Arc<AtomicUsize>,
    /// The checkpoint, if there is one.
    checkpoint: Arc<OnceLock<PathBuf>>,
}

/// The time for work to reach a safe point after the first signal.
///
/// A longer step, such as a factorisation or one pair of patches, is aborted; a checkpoint has the work that was finished before.
const GRACE: std::time::Duration = std::time::Duration::from_millis(600);

/// Returns the name and exit code of a signal.
fn named(signal: usize) -> Option<(&'static str, ExitCode)> {
    match signal {
        2 => Some(("SIGINT", ExitCode::Interrupted)),
        15 => Some(("SIGTERM", ExitCode::Terminated)),
        _ => None,
    }
}

/// Makes a write beyond the limit of a file's size fail like any other, where the system would end the program by SIGXFSZ.
///
/// The error is then reported, and temporary files are removed.
pub(super) fn outlive_size_limits() {
    #[cfg(unix)]
    {
        // Without a handler the system's default applies. The flag is not read, as the write reports the error.
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    }
}

impl Interrupt {
    /// Begins to listen; if the work does not check for signals (`is_asked` false), the first signal ends the program.
    ///
    /// Where the system does not allow handlers, signals end the program as usual; files are replaced atomically in any case.
    pub(super) fn listen(is_asked: bool) -> Self {
        let interrupt = Self::default();
        #[cfg(unix)]
        {
            use signal_hook::consts::{SIGINT, SIGTERM};
            use signal_hook::iterator::Signals;
            let signal = Arc::clone(&interrupt.signal);
            let checkpoint = Arc::clone(&interrupt.checkpoint);
            if let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) {
                std::thread::spawn(move || {
                    for number in signals.forever() {
                        let number = usize::try_from(number).unwrap_or(0);
                        let is_first = signal.swap(number, Ordering::Relaxed) == 0;
                        let Some((name, code)) = named(number) else { continue };
                        let checkpoint = Arc::clone(&checkpoint);
                        let end = move |when: &str| {
                            let kept = checkpoint.get().map_or_else(String::new, |path| {
                                format!("; the same command goes on from {}", path.display())
                            });
                            super::complain(&format!("ended {when} by {name}; no file is half-written{kept}"));
                            whole_file::abandon();
                            std::process::exit(code as i32);
                        };
                        if is_first && is_asked {
                            std::thread::spawn(move || {
                                // The other ranks wait longer, as the first rank reports the end for all.
                                let others = if ranks::is_first() { 0 } else { 4 };
                                std::thread::sleep(GRACE * (1 + others));
                                end("before a safe point");
                            });
                        } else {
                            end("at once");
                        }
                    }
                });
            }
        }
        interrupt
    }

    /// Records the file that stores finished work.
    pub(super) fn note_checkpoint(&self, path: &Path) {
        // A run has one checkpoint, so the first one counts.
        let _ = self.checkpoint.set(path.to_owned());
    }

    /// Returns whether a signal came.
    pub(super) fn came(&self) -> bool {
        self.signal.load(Ordering::Relaxed) != 0
    }

    /// Returns the failure that the signal causes; `kept` describes what a later run finds.
    pub(super) fn failure(&self, kept: &str) -> Failure {
        let signal = self.signal.load(Ordering::Relaxed);
        let (name, code) = named(signal).unwrap_or(("a signal", ExitCode::Interrupted));
        Failure {
            code,
            ..Failure::new("interrupted", format!("interrupted by {name}; {kept}"))
        }
    }
}
