//! Figures of the quality of a solution.

use serde::{Deserialize, Serialize};

use super::TotalError;
use crate::solver::{Solution, StopReason};

/// How good a solution is.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Quality {
    /// Why the solver stopped.
    pub stop_reason: StopReason,
    /// max |r_i A_i|, W, with r = E − (I − diag(ρ) F) B.
    pub residual_max_power: Option<f64>,
    /// sqrt(Σ A r² / Σ A E²), the worst channel.
    pub residual_l2: Option<f64>,
    /// A bound on the relative error that the solver leaves in B, in the area-weighted L2 norm; null where none is proved.
    pub error_bound: Option<f64>,
    /// The relative error of B by solver and form factors together, in the same norm, the mesh's aside: an estimate; null where it is not known.
    pub estimated_relative_error: Option<f64>,
}

impl Quality {
    /// Returns the quality of a solution; `stated` is its error by solver and form factors.
    #[must_use]
    pub fn new(solution: &Solution, stated: TotalError) -> Self {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        Self {
            stop_reason: solution.stop_reason,
            residual_max_power: finite(solution.residual_max_power),
            residual_l2: finite(solution.residual_l2),
            error_bound: solution.error_bound.and_then(finite),
            estimated_relative_error: stated.relative().and_then(finite),
        }
    }

    /// Returns this quality with the worst figures of several solutions, each `None` if one of them is.
    #[must_use]
    pub fn with_worst_of(self, all: &[Self]) -> Self {
        let worst = |figure: fn(&Self) -> Option<f64>| {
            let of_all: Option<Vec<f64>> = all.iter().map(figure).collect();
            of_all.map(|values| values.into_iter().fold(0.0, f64::max))
        };
        Self {
            residual_max_power: worst(|quality| quality.residual_max_power),
            residual_l2: worst(|quality| quality.residual_l2),
            error_bound: worst(|quality| quality.error_bound),
            estimated_relative_error: worst(|quality| quality.estimated_relative_error),
            ..self
        }
    }
}
