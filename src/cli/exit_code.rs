//! Exit codes.

/// The exit codes of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ExitCode {
    /// Done.
    Done = 0,
    /// An error in the input or at run time.
    Error = 1,
    /// A usage error.
    Usage = 2,
    /// Not converged, a budget spent above the tolerance, form factors too inaccurate to state an error, or too much light leaks.
    NotConverged = 3,
    /// A check outside its tolerance.
    CheckFailed = 4,
    /// Ended by SIGINT.
    Interrupted = 130,
    /// Ended by SIGTERM.
    Terminated = 143,
}

impl ExitCode {
    /// Returns the exit code of a number, as received from other ranks.
    pub(super) fn of(code: u8) -> Self {
        let all = [
            Self::Done,
            Self::Error,
            Self::Usage,
            Self::NotConverged,
            Self::CheckFailed,
            Self::Interrupted,
            Self::Terminated,
        ];
        all.into_iter().find(|own| *own as u8 == code).unwrap_or(Self::Error)
    }
}

impl From<ExitCode> for std::process::ExitCode {
    fn from(code: ExitCode) -> Self {
        Self::from(code as u8)
    }
}
