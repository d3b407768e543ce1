//! The decision to stop a solver.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::error::SolverError;

/// Norms of a residual in each channel.
#[derive(Clone, Debug)]
pub(super) struct Norms {
    /// sqrt(Σ A r² / Σ A E²); 0 where r and E are zero.
    pub(super) l2: Vec<f64>,
    /// The greatest of the same over all patches and over each component that emits.
    pub(super) room_l2: Vec<f64>,
    /// max |r_i A_i|, W.
    pub(super) max_power: Vec<f64>,
    /// max |r_i|, W·m⁻².
    pub(super) max: Vec<f64>,
    /// sqrt(Σ r²), W·m⁻².
    pub(super) euclidean: Vec<f64>,
}

impl Norms {
    /// Returns the norms that `combine` makes of these and others.
    pub(super) fn map_with(&self, other: &Self, combine: impl Fn(f64, f64) -> f64) -> Self {
        let both = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(&a, &b)| combine(a, b)).collect();
        Self {
            l2: both(&self.l2, &other.l2),
            room_l2: both(&self.room_l2, &other.room_l2),
            max_power: both(&self.max_power, &other.max_power),
            max: both(&self.max, &other.max),
            euclidean: both(&self.euclidean, &other.euclidean),
        }
    }
}

/// The quantity that has to fall below a threshold, in every channel, with the residual r = E − (I − diag(ρ) F) B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// sqrt(Σ A r² / Σ A E²), relative: independent of the units of length and light.
    ///
    /// It holds over all patches, and over each set of them that exchanges light with no others: the unsolved part of a bright room
    /// may be all the light of a dim one beside it.
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

    /// Returns the factor by which each channel's residual exceeds the tolerance: at most 1 where it is met, infinity for NaN.
    pub(super) fn excess(self, norms: &Norms) -> Vec<f64> {
        let measured = match self {
            Self::ResidualL2(_) => &norms.room_l2,
            Self::ResidualMaxPower(_) => &norms.max_power,
            Self::ResidualMax(_) => &norms.max,
        };
        let ratios = measured.iter().map(|m| m / self.threshold());
        ratios.map(|x| if x.is_nan() { f64::INFINITY } else { x }).collect()
    }
}

/// Why a solver stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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

/// Watches the excess over the tolerance, or the method's own quantity that falls, from pass to pass and channel by channel.
///
/// Channels are independent: one that stagnates does not end the work on others.
pub(super) struct Watch {
    patience: usize,
    channels: Vec<Course>,
}

/// The share of its mean rise a pass, in logarithms, below which the last rise of a run is one that slows down.
const SLOWS: f64 = 0.5;

/// The course of one channel.
#[derive(Clone)]
struct Course {
    limit: Option<f64>,
    best: f64,
    last: f64,
    /// Passes since the least value, or since the last one of a long run in one direction.
    n_idle: usize,
    run: Run,
}

/// Passes in a row that all rise, or all fall.
#[derive(Clone, Copy)]
struct Run {
    n_passes: usize,
    is_rise: bool,
    /// The value before the first of them.
    from: f64,
}

impl Course {
    const NEW: Self = Self {
        limit: None,
        best: f64::INFINITY,
        last: f64::INFINITY,
        n_idle: 0,
        run: Run {
            n_passes: 0,
            is_rise: false,
            from: f64::INFINITY,
        },
    };

    /// Records one pass, and returns the reason to give the channel up, if there is one.
    ///
    /// The residual of a method that converges may first rise, and fall for long before it is below its first value: sweeps near ρ = 1 do. Runs of falls, and of rises that slow down, are
    /// no stagnation; a diverging residual rises by the same factor again and again.
    fn observe(&mut self, excess: f64, under_way: Option<f64>, patience: usize) -> Option<StopReason> {
        let limit = *self.limit.get_or_insert(DIVERGED_FROM * excess.max(1.0));
        if !excess.is_finite() || excess > limit {
            return Some(StopReason::Diverged);
        }
        let measure = under_way.unwrap_or(excess);
        self.extend_run(measure);
        let is_long = 2 * self.run.n_passes >= patience;
        let gets_somewhere = is_long && (!self.run.is_rise || self.run.slows(self.last, measure));
        self.last = measure;
        if measure < self.best || gets_somewhere {
            self.n_idle = 0;
        } else {
            self.n_idle += 1;
        }
        self.best = self.best.min(measure);
        let reason = if is_long {
            StopReason::Diverged
        } else {
            StopReason::Stagnated
        };
        (self.n_idle >= patience).then_some(reason)
    }

    fn extend_run(&mut self, measure: f64) {
        let is_rise = measure > self.last;
        #[expect(clippy::float_cmp, reason = "what stands still to the last digit is no run")]
        if measure == self.last {
            self.run.n_passes = 0;
        } else if self.run.n_passes > 0 && self.run.is_rise == is_rise {
            self.run.n_passes += 1;
        } else {
            self.run = Run {
                n_passes: 1,
                is_rise,
                from: self.last,
            };
        }
    }
}

impl Run {
    /// Returns whether the rise from `last` to `now`, the newest of the run, is much less than its mean rise.
    fn slows(self, last: f64, now: f64) -> bool {
        (now / last).ln() * (self.n_passes as f64) < SLOWS * (now / self.from).ln()
    }
}

impl Watch {
    pub(super) fn new(patience: usize) -> Self {
        Self {
            patience: patience.max(1),
            channels: Vec::new(),
        }
    }

    /// Records one pass, and returns a reason to give up: a channel that overflows, or no progress for long in any channel above the tolerance.
    ///
    /// `under_way` is the quantity that has to fall, where it is not the excess.
    pub(super) fn observe(&mut self, excess: &[f64], under_way: Option<f64>) -> Option<StopReason> {
        self.channels.resize(excess.len(), Course::NEW);
        let mut all = Some(None);
        for (course, &own) in self.channels.iter_mut().zip(excess) {
            let reason = course.observe(own, under_way, self.patience);
            if !own.is_finite() || course.limit.is_some_and(|limit| own > limit) {
                return Some(StopReason::Diverged);
            }
            if own > 1.0 {
                all = match (all, reason) {
                    (Some(None), Some(reason)) => Some(Some(reason)),
                    (Some(Some(other)), Some(reason)) => {
                        let grows = [other, reason].contains(&StopReason::Diverged);
                        Some(Some(if grows { StopReason::Diverged } else { other }))
                    }
                    (_, None) | (None, _) => None,
                };
            }
        }
        all.flatten()
    }
}

/// Returns the greatest of some nonnegative values; NaN if any is NaN.
pub(super) fn worst(values: &[f64]) -> f64 {
    let greater = |a: f64, b: f64| if b.is_nan() { b } else { a.max(b) };
    values
        .iter()
        .copied()
        .fold(0.0, |a, b| if a.is_nan() { a } else { greater(a, b) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the verdict of the watch on a sequence, and its pass.
    fn verdict(patience: usize, excess: impl Fn(i32) -> f64) -> Option<(i32, StopReason)> {
        let mut watch = Watch::new(patience);
        (0..200).find_map(|k| watch.observe(&[2.0 * excess(k)], None).map(|reason| (k, reason)))
    }

    #[test]
    fn growth_is_told_from_standing_still() {
        assert_eq!(verdict(10, |k| 0.9_f64.powi(k)), None);
        assert_eq!(verdict(10, |k| 1.01_f64.powi(k)), Some((10, StopReason::Diverged)));
        // Up and down at first, then up.
        let unsteady = |k: i32| {
            if k < 4 {
                1.0 + 0.1 * f64::from(k % 2)
            } else {
                1.01_f64.powi(k)
            }
        };
        assert_eq!(verdict(10, unsteady), Some((10, StopReason::Diverged)));
        assert_eq!(
            verdict(10, |k| 1.0 + 0.1 * f64::from(k % 2)),
            Some((10, StopReason::Stagnated))
        );
        assert_eq!(verdict(10, |_| 1.0), Some((10, StopReason::Stagnated)));
        assert_eq!(verdict(10, |_| f64::NAN), Some((0, StopReason::Diverged)));
        assert_eq!(verdict(0, |_| 1.0), Some((1, StopReason::Stagnated)));
        // Up first, by less and less, then slowly down: below the first value after some 700 passes.
        let late = |k: i32| f64::from(1 + k) * 0.99_f64.powi(k);
        assert_eq!(verdict(10, late), None);
        assert_eq!(verdict(10, |k| 1.0 - 0.5 * 0.5_f64.powi(k) - 1e-4 * f64::from(k)), None);
        // Neither up nor down for long enough.
        let waves = |k: i32| 1.0 + f64::from(k % 8 - 4).abs();
        assert_eq!(verdict(12, waves), Some((16, StopReason::Stagnated)));
        // The residual's norm rises while the unshot light falls.
        let mut watch = Watch::new(3);
        assert!((0..100).all(|k| watch.observe(&[2.0 + f64::from(k)], Some(0.9_f64.powi(k))).is_none()));
    }

    #[test]
    fn a_channel_that_stands_still_does_not_end_the_others() {
        let mut watch = Watch::new(10);
        let falls = |k: i32| 1e6 * 0.9_f64.powi(k);
        let stopped = (0..300).find_map(|k| watch.observe(&[5.0, falls(k)], None).map(|reason| (k, reason)));
        // 1e6 0.9^k is below 1 from k = 132 on.
        assert_eq!(stopped, Some((132, StopReason::Stagnated)));
        let mut beyond = Watch::new(10);
        let ended = (0..300).find_map(|k| beyond.observe(&[f64::from(k).exp2(), falls(k)], None));
        assert_eq!(ended, Some(StopReason::Diverged));
    }
}
