//! The error that is stated of a solution, as one number.

use super::pipeline::{Prepared, Run};
use crate::matrix::operator::Block;
use crate::solver::{Solution, StopReason, relative_errors};

/// What solver and form factors together say of the error of a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stated {
    /// sqrt(Σ A e² / Σ A B²), the worst channel.
    Relative(f64),
    /// The errors of the form factors are not known, or there are none to tell of.
    Untold,
    /// The errors of the form factors are too great to say what becomes of them.
    TooGreat,
}

impl Stated {
    /// Returns the number, where there is one.
    pub(super) fn relative(self) -> Option<f64> {
        match self {
            Self::Relative(error) => Some(error),
            Self::Untold | Self::TooGreat => None,
        }
    }

    /// Returns what holds for two solutions together.
    pub(super) fn or_worse(self, other: Self) -> Self {
        match (self, other) {
            (Self::TooGreat, _) | (_, Self::TooGreat) => Self::TooGreat,
            (Self::Untold, _) | (_, Self::Untold) => Self::Untold,
            (Self::Relative(a), Self::Relative(b)) => Self::Relative(a.max(b)),
        }
    }
}

impl Run {
    /// Makes one number of the estimated errors of radiosities, and warns where they are too great for one.
    pub(super) fn stated(&self, prepared: &Prepared, error: Option<&Block>, solution: &Solution) -> Stated {
        let Some(error) = error else {
            if solution.error_bound.is_none() && solution.stop_reason == StopReason::Converged {
                self.warn_once(
                    "no bound on the error of the radiosities can be proved: reflectances and sums of form factors are too near 1, or above; `--solver direct` has the least residual",
                );
            }
            return Stated::Untold;
        };
        let of_channels = relative_errors(&prepared.mesh.areas(), error, &solution.radiosity);
        if of_channels.iter().all(|share| share.is_finite()) {
            return Stated::Relative(of_channels.into_iter().fold(0.0, f64::max));
        }
        // Where the solver gave up, its own warning says more.
        if solution.stop_reason == StopReason::Converged {
            self.warn_once(
                "the form factors are not exact enough for reflectances this near 1: the radiosities may be off by as much as they are or more; compute the form factors with a smaller tolerance or \
                 more rays, keep them in f64, or lower the reflectances",
            );
        }
        Stated::TooGreat
    }
}
