//! The stated error of a solution, as one number.

use serde::{Deserialize, Serialize};

use super::{Context, Model, Warning};
use crate::matrix::operator::Block;
use crate::solver::{Solution, StopReason, relative_errors};

/// The error of a solution by solver and form factors together, without that of the mesh.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum TotalError {
    /// The relative error sqrt(Σ A e² / Σ A B²), the worst channel.
    Relative(f64),
    /// The errors of the form factors are unknown, or there are none to report.
    Untold,
    /// The errors of the form factors are too great to be propagated.
    TooGreat,
}

impl TotalError {
    /// Returns the number, if there is one.
    #[must_use]
    pub fn relative(self) -> Option<f64> {
        match self {
            Self::Relative(error) => Some(error),
            Self::Untold | Self::TooGreat => None,
        }
    }

    /// Returns the error of two solutions together.
    #[must_use]
    pub fn or_worse(self, other: Self) -> Self {
        match (self, other) {
            (Self::TooGreat, _) | (_, Self::TooGreat) => Self::TooGreat,
            (Self::Untold, _) | (_, Self::Untold) => Self::Untold,
            (Self::Relative(a), Self::Relative(b)) => Self::Relative(a.max(b)),
        }
    }

    /// Returns the relative error of estimated errors of radiosities, and warns if they are too great for one.
    #[must_use]
    pub fn of(model: &Model, error: Option<&Block>, solution: &Solution, cx: &Context) -> Self {
        let Some(error) = error else {
            if solution.error_bound.is_none() && solution.stop_reason == StopReason::Converged {
                cx.warn_once(Warning::NoBound);
            }
            return Self::Untold;
        };
        let of_channels = relative_errors(&model.mesh.areas(), error, &solution.radiosity);
        if of_channels.iter().all(|share| share.is_finite()) {
            return Self::Relative(of_channels.into_iter().fold(0.0, f64::max));
        }
        // A solver that did not converge has a more specific warning.
        if solution.stop_reason == StopReason::Converged {
            cx.warn_once(Warning::TooInexact);
        }
        Self::TooGreat
    }
}
