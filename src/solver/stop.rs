//! When a solver stops.

use std::fmt;

use serde::Serialize;

use super::SolverError;
use super::scaled::Norms;

/// The quantity that has to fall below a threshold, in every channel, with the residual r = E − (I − diag(ρ) F) B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// sqrt(Σ A r² / Σ A E²), relative: neither the unit of length nor that of light matters.
    ResidualL2(f64),
    /// max |r_i A_i|, in W: Baranoski, Bramley and Shirley 1995, equation (25). Departures: none.
    ResidualMaxPower(f64),
    /// max |r_i|, in W·m⁻².
    ResidualMax(f64),
}

impl Default for Tolerance {
    fn default() -> Self {
        Self::ResidualL2(1e-6)
    }
}

impl Tolerance {
    fn threshold(self) -> f64 {
        match self {
            Self::ResidualL2(value) | Self::ResidualMaxPower(value) | Self::ResidualMax(value) => value,
        }
    }

    pub(super) fn validated(self) -> Result<Self, SolverError> {
        let value = self.threshold();
        if value.is_finite() && value > 0.0 {
            Ok(self)
        } else {
            Err(SolverError::Tolerance { value })
        }
    }

    /// Returns by what factor each channel's residual exceeds the tolerance: at most 1 where it is met, infinity where it is not a number.
    pub(super) fn excess(self, norms: &Norms) -> Vec<f64> {
        let measured = match self {
            Self::ResidualL2(_) => &norms.l2,
            Self::ResidualMaxPower(_) => &norms.max_power,
            Self::ResidualMax(_) => &norms.max,
        };
        let ratios = measured.iter().map(|m| m / self.threshold());
        ratios.map(|x| if x.is_nan() { f64::INFINITY } else { x }).collect()
    }
}

/// Why a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StopReason {
    /// The true residual, calculated from the radiosities that are returned, meets the tolerance.
    Converged,
    /// The passes allowed are used up.
    MaxPasses,
    /// The residual has stopped falling above the tolerance.
    Stagnated,
    /// The residual grows, or the system is not positive definite as the solver needs it: no trustworthy solution.
    Diverged,
    /// The caller asked to stop.
    Interrupted,
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::MaxPasses => "out of passes",
            Self::Stagnated => "stagnated",
            Self::Diverged => "diverged",
            Self::Interrupted => "interrupted",
        })
    }
}

/// Growth of the residual, over its first value, that counts as divergence.
const DIVERGED_FROM: f64 = 1e8;

/// Watches the worst channel's excess over the tolerance from pass to pass.
pub(super) struct Watch {
    patience: usize,
    limit: Option<f64>,
    best: f64,
    last: f64,
    passes_since_best: usize,
    /// True while every pass since the best one has been worse than the one before it.
    rises: bool,
}

impl Watch {
    pub(super) fn new(patience: usize) -> Self {
        Self {
            patience,
            limit: None,
            best: f64::INFINITY,
            last: f64::INFINITY,
            passes_since_best: 0,
            rises: true,
        }
    }

    /// Takes in one pass, and tells why to give up, if so.
    pub(super) fn observe(&mut self, excess: f64) -> Option<StopReason> {
        let limit = *self.limit.get_or_insert(DIVERGED_FROM * excess.max(1.0));
        if !excess.is_finite() || excess > limit {
            return Some(StopReason::Diverged);
        }
        if excess < self.best {
            self.best = excess;
            self.passes_since_best = 0;
            self.rises = true;
        } else {
            self.passes_since_best += 1;
            self.rises &= excess > self.last;
        }
        self.last = excess;
        let reason = if self.rises {
            StopReason::Diverged
        } else {
            StopReason::Stagnated
        };
        (self.passes_since_best >= self.patience.max(1)).then_some(reason)
    }
}

/// Returns the greatest of some values that are not negative; not a number if any of them is not.
pub(super) fn worst(values: &[f64]) -> f64 {
    let greater = |a: f64, b: f64| if b.is_nan() { b } else { a.max(b) };
    values
        .iter()
        .copied()
        .fold(0.0, |a, b| if a.is_nan() { a } else { greater(a, b) })
}
