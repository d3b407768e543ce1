//! Conservation checks of results, made after every run.
//!
//! A law is checked against the guarantees of the result itself: the errors of its form factors, the residual of its solution. Computed values are not trusted:
//! every compared number is calculated again from the returned results. A law that a result does not guarantee is not checked, and the
//! audit states why.
//!
//! | law | of | holds within |
//! |---|---|---|
//! | [`Law::Sign`]: F_ij ≥ 0 | form factors | 0 |
//! | [`Law::Exchange`]: A_i F_ij ≤ min(A_i, A_j) | form factors | twice the entry's error, of a rule at most 0.001; or 8 standard deviations of counts of rays |
//! | [`Law::Reciprocity`]: A_i F_ij = A_j F_ji | form factors | rounding, or 8 standard deviations of counts of rays |
//! | [`Law::Closure`]: Σ_j F_ij = 1 less the light that escapes | form factors | twice the sum of the row's errors; rounding where rays were counted; repairs and gaps: below |
//! | [`Law::RowSum`]: Σ_j F_ij ≤ 1 | form factors | the same |
//! | both, where a row is above | form factors | of errors of a rule at most 0.001, of others 8 standard deviations of independent entries |
//! | [`Law::Finite`]: finite, and not negative where no exitance is | radiosities, irradiances | 0; the error that the stated residual allows |
//! | [`Law::Irradiance`]: H = F B | solutions | rounding |
//! | [`Law::Residual`]: r is at most the stated residual | solutions | rounding |
//! | [`Law::Energy`]: emitted = absorbed + escaped | solutions | the error that the stated residual allows |
//! | [`Law::LeastRadiosity`], [`Law::GreatestRadiosity`] | solutions | the error that the stated residual allows |
//! | [`Law::Sides`]: no light passes a closed surface | links of voxels | 0 |
//! | [`Law::Picture`]: pixels are finite and not negative | pictures | 0 |
//!
//! After a repair, closure holds within the tolerance of the repair in rows that are known to sum to 1, and within 8 standard deviations in the others.
//! In a closed scene with gaps, a row may also fall short of 1 by the light that may leave through these.

mod form_factors;
mod solution;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::render::{Image, Samples};
pub use form_factors::{Claims, FormFactorAudit, Repair, doubted_rows, form_factors};
pub use solution::{Given, propagation, sides, solution};

/// A law that a result has to obey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Law {
    /// F_ij ≥ 0; deviations in 1.
    Sign,
    /// A_i F_ij ≤ min(A_i, A_j): no more light arrives than can; deviations in m². Where a method does not promise it, F_ij A_i ≤ A_i stands in its place.
    Exchange,
    /// A_i F_ij = A_j F_ji; deviations in m².
    Reciprocity,
    /// Σ_j F_ij = 1 less the fractions that escaped and that backs took; deviations in 1.
    Closure,
    /// Σ_j F_ij ≤ 1, where what escapes is not known; deviations in 1.
    RowSum,
    /// Radiosities and irradiances are finite numbers, and not negative where no exitance is; deviations in W·m⁻².
    Finite,
    /// The irradiances that are handed out are H = F B; deviations in W·m⁻².
    Irradiance,
    /// sqrt(Σ A r² / Σ A E²) is at most what the solver says; deviations relative.
    Residual,
    /// Emitted power is what is absorbed and what escapes, less what form factors without reciprocity make or lose; deviations in W.
    Energy,
    /// B is at least min_i E_i / (1 − ρ_i Σ_j F_ij): the darkest furnace that a patch of the scene could be in; deviations in W·m⁻².
    LeastRadiosity,
    /// B is at most max_i E_i / (1 − ρ_i Σ_j F_ij): the brightest furnace; deviations in W·m⁻².
    GreatestRadiosity,
    /// No light passes between regions of air that surfaces close off from each other; deviations in W.
    Sides,
    /// Radiances, radiosities and irradiances of all pixels are finite and not negative.
    Picture,
}

impl Law {
    /// Returns the statement of the law, in words.
    #[must_use]
    pub fn statement(self) -> &'static str {
        match self {
            Self::Sign => "form factors are not negative",
            Self::Exchange => "no patch receives more than it can",
            Self::Reciprocity => "exchange areas are symmetric",
            Self::Closure => "row sums are 1 less what escapes",
            Self::RowSum => "row sums are at most 1",
            Self::Finite => "radiosities are finite and not negative",
            Self::Irradiance => "irradiances are those of the radiosities",
            Self::Residual => "the residual is as the solver reports",
            Self::Energy => "emitted power is absorbed or escapes",
            Self::LeastRadiosity => "no patch is darker than the darkest furnace",
            Self::GreatestRadiosity => "no patch is brighter than the brightest furnace",
            Self::Sides => "no light passes closed surfaces",
            Self::Picture => "pixels are finite and not negative",
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::Exchange | Self::Reciprocity => " m²",
            Self::Finite | Self::Irradiance | Self::LeastRadiosity | Self::GreatestRadiosity => " W/m²",
            Self::Energy | Self::Sides => " W",
            Self::Sign | Self::Closure | Self::RowSum | Self::Residual | Self::Picture => "",
        }
    }
}

/// One law, and how near it is to being broken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Check {
    /// The law.
    pub law: Law,
    /// True if no place breaks it.
    pub passed: bool,
    /// Places that were looked at: entries, rows, patches or pixels, in each channel.
    pub n_checked: u64,
    /// Places that break it.
    pub n_violations: u64,
    /// How far the worst place is from what the law says, in the law's unit; infinite for what is not a number.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub deviation: f64,
    /// How far it may be.
    #[cfg_attr(test, schemars(with = "Option<f64>"))]
    pub allowed: f64,
    /// The worst place: a patch, or a pixel, counted row by row.
    pub patch: Option<usize>,
    /// The other patch of the worst pair.
    pub other_patch: Option<usize>,
    /// The worst place's channel.
    pub channel: Option<usize>,
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = if self.law == Law::Picture { "pixel" } else { "patch" };
        write!(f, "{}: ", self.law.statement())?;
        if self.passed {
            write!(f, "yes, in {} places; the nearest", self.n_checked)?;
        } else {
            write!(
                f,
                "no, in {} of {} places; the worst",
                self.n_violations, self.n_checked
            )?;
        }
        if let Some(patch) = self.patch {
            write!(f, ", {what} {patch}")?;
        }
        if let Some(other) = self.other_patch {
            write!(f, " to {other}")?;
        }
        if let Some(channel) = self.channel {
            write!(f, " in channel {channel}")?;
        }
        let unit = self.law.unit();
        write!(
            f,
            " is off by {:.2e}{unit}, and {:.1e}{unit} is allowed",
            self.deviation, self.allowed
        )
    }
}

/// A law that a result does not promise, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct NotChecked {
    /// The law.
    pub law: Law,
    /// Why it is not checked.
    pub reason: String,
}

/// The result of an audit.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Audit {
    /// The laws that were checked.
    pub checks: Vec<Check>,
    /// The laws that were not.
    pub not_checked: Vec<NotChecked>,
}

impl Audit {
    /// Returns whether no law is broken.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.checks.iter().all(|check| check.passed)
    }

    /// Returns the laws that are broken.
    pub fn violations(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| !check.passed)
    }

    /// Returns the check of a law, if it was made.
    #[must_use]
    pub fn check(&self, law: Law) -> Option<&Check> {
        self.checks.iter().find(|check| check.law == law)
    }

    /// Adds the checks of another audit.
    pub fn extend(&mut self, other: Self) {
        self.checks.extend(other.checks);
        self.not_checked.extend(other.not_checked);
    }

    /// Joins the checks of each law into one: of the worst place, with the counts of all.
    pub(crate) fn keep_worst(&mut self) {
        let mut joined: Vec<Check> = Vec::new();
        for check in self.checks.drain(..) {
            let Some(own) = joined.iter_mut().find(|own| own.law == check.law) else {
                joined.push(check);
                continue;
            };
            let counts = [own.n_checked + check.n_checked, own.n_violations + check.n_violations];
            let share = |of: &Check| of.deviation / of.allowed.max(f64::MIN_POSITIVE);
            let is_worse = (!check.passed, share(&check)) > (!own.passed, share(own));
            if is_worse {
                *own = check;
            }
            [own.n_checked, own.n_violations] = counts;
        }
        self.checks = joined;
    }

    fn skip(&mut self, law: Law, reason: impl Into<String>) {
        let reason = reason.into();
        self.not_checked.push(NotChecked { law, reason });
    }
}

/// Checks a picture: the layers of light are finite and not negative.
///
/// These are the layers of [`Layer::is_light`](crate::render::Layer::is_light). Departures: none.
#[must_use]
pub fn picture(image: &Image) -> Audit {
    let mut worst = Worst::default();
    for layer in image.layers() {
        let Samples::F32(values) = &layer.samples else { continue };
        for (pixel, value) in values.iter().enumerate().filter(|_| layer.is_light()) {
            let deviation = if value.is_finite() {
                f64::from(-value.min(0.0))
            } else {
                f64::INFINITY
            };
            worst.see(deviation, 0.0, At::patch(pixel));
        }
    }
    Audit {
        checks: vec![worst.check(Law::Picture)],
        not_checked: Vec::new(),
    }
}

/// The place of a check.
#[derive(Clone, Copy, Debug, Default)]
struct At {
    patch: Option<usize>,
    other: Option<usize>,
    channel: Option<usize>,
}

impl At {
    fn patch(patch: usize) -> Self {
        Self {
            patch: Some(patch),
            ..Self::default()
        }
    }

    fn pair(patch: usize, other: usize) -> Self {
        Self {
            other: Some(other),
            ..Self::patch(patch)
        }
    }

    fn channel(self, channel: usize) -> Self {
        Self {
            channel: Some(channel),
            ..self
        }
    }
}

/// The worst of many places.
#[derive(Clone, Copy, Debug, Default)]
struct Worst {
    n_checked: u64,
    n_violations: u64,
    /// The deviation over the allowed one.
    ratio: f64,
    deviation: f64,
    allowed: f64,
    at: At,
}

/// The part of the worst deviation below which others are less in spite of rounding.
const NOT_WORST: f64 = 1.0 - 1e-14;

impl Worst {
    /// The number of [`numbers`](Self::numbers).
    const N_NUMBERS: usize = 8;

    /// Returns it as numbers, for other ranks.
    fn numbers(self) -> [f64; Self::N_NUMBERS] {
        let At { patch, other, channel } = self.at;
        let [patch, other, channel] = [patch, other, channel].map(|k| k.map_or(u64::MAX, |k| k as u64));
        let [ratio, deviation, allowed] = [self.ratio, self.deviation, self.allowed].map(f64::to_bits);
        let (checked, violations) = (self.n_checked, self.n_violations);
        [checked, violations, ratio, deviation, allowed, patch, other, channel].map(f64::from_bits)
    }

    fn of_numbers(numbers: [f64; Self::N_NUMBERS]) -> Self {
        let [n_checked, n_violations, worst @ .., patch, other, channel] = numbers.map(f64::to_bits);
        let [ratio, deviation, allowed] = worst.map(f64::from_bits);
        let known = |k: u64| usize::try_from(k).ok().filter(|k| *k != usize::MAX);
        let [patch, other, channel] = [patch, other, channel].map(known);
        Self {
            n_checked,
            n_violations,
            ratio,
            deviation,
            allowed,
            at: At { patch, other, channel },
        }
    }

    /// Adds one place; NaN breaks every law.
    #[inline]
    fn see(&mut self, deviation: f64, allowed: f64, at: At) {
        // Most places are far from the worst, and take no division.
        let is_nothing = deviation <= 0.0 && self.deviation >= 0.0;
        let is_less = is_nothing || deviation < NOT_WORST * self.ratio * allowed;
        if self.n_checked > 0 && is_less && deviation <= allowed {
            self.n_checked += 1;
        } else {
            self.see_in(1.0, deviation, allowed, at);
        }
    }

    /// Adds one place, judged in units of `unit` and reported in the law's own: numbers far from 1 there must neither overflow nor vanish.
    fn see_in(&mut self, unit: f64, deviation: f64, allowed: f64, at: At) {
        let broken = deviation.is_nan() || allowed.is_nan() || deviation > allowed;
        let ratio = match (broken, deviation > 0.0) {
            (true, _) if allowed > 0.0 && deviation.is_finite() => deviation / allowed,
            (true, _) => f64::INFINITY,
            (false, true) => deviation / allowed,
            (false, false) => 0.0,
        };
        let found = Self {
            n_checked: 1,
            n_violations: u64::from(broken),
            ratio,
            deviation: if deviation.is_nan() {
                f64::INFINITY
            } else {
                deviation * unit
            },
            allowed: allowed * unit,
            at,
        };
        *self = self.and(found);
    }

    /// Returns both together; of equal ones the first is kept, but with the greater deviation.
    fn and(self, later: Self) -> Self {
        let (n_checked, n_violations) = (self.n_checked + later.n_checked, self.n_violations + later.n_violations);
        let is_worse = (later.ratio, later.deviation) > (self.ratio, self.deviation);
        let worst = if self.n_checked == 0 || is_worse { later } else { self };
        Self {
            n_checked,
            n_violations,
            ..worst
        }
    }

    fn check(self, law: Law) -> Check {
        Check {
            law,
            passed: self.n_violations == 0,
            n_checked: self.n_checked,
            n_violations: self.n_violations,
            deviation: self.deviation,
            allowed: self.allowed,
            patch: self.at.patch,
            other_patch: self.at.other,
            channel: self.at.channel,
        }
    }
}
