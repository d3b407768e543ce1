//! The direct light of a pixel.

use super::shadow_rays::Fraction;

/// The irradiance at a point, and its change over the rays' offset.
pub(super) type Lit = ([f64; 3], [f64; 3]);

/// The direct irradiance by the image's own shadow rays, per channel.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Drawn {
    /// The least and the greatest value: rounding decides within this range.
    pub(super) range: [[f64; 3]; 2],
    /// The standard error that the image must state; `None` where rounding decides.
    pub(super) error: Option<[f64; 3]>,
    /// The bias, to leading order and without its sign.
    pub(super) bias: [f64; 3],
    /// The number x such that rays find this or worse with a probability of at most exp(−x).
    pub(super) odds: f64,
    /// The sum of V (1 − V) over all rays, V the true visible fraction: the effective number of rays of uncertain outcome.
    pub(super) n_mixed: f64,
}

/// The direct light of a pixel, during summation.
#[derive(Default)]
pub(super) struct Light {
    pub(super) exact: [f64; 3],
    /// The irradiance where the rays start.
    pub(super) moved: [f64; 3],
    /// Its greatest change by the rounding of corners.
    pub(super) rounding: [f64; 3],
    pub(super) shaded: bool,
    /// True if the image's method is not exact at a sample.
    pub(super) unknown: bool,
    n_drawn: u32,
    odds: f64,
    range: [[f64; 3]; 2],
    variance: [f64; 3],
    undecided: bool,
    bias: [f64; 3],
    n_mixed: f64,
}

impl Light {
    pub(super) fn irradiance(&self) -> Option<Lit> {
        let change = std::array::from_fn(|c| self.moved[c] - self.exact[c]);
        (!self.unknown).then_some((self.exact, change))
    }

    /// Adds the change of a form factor by the rounding of corners, times the sample's share.
    pub(super) fn add_rounding(&mut self, change: f64, exitance: &[f64; 3]) {
        for (sum, e) in self.rounding.iter_mut().zip(exitance) {
            *sum += change * e;
        }
    }

    /// Counts redrawn shadow rays, and their effective number of uncertain outcome.
    pub(super) fn count_drawn(&mut self, found: &Fraction, n_mixed: f64) {
        self.n_drawn += 1;
        self.n_mixed += n_mixed;
        self.odds = self.odds.max(found.odds);
        self.undecided |= found.variance.is_none();
    }

    /// Adds the part of an emitter that shadow rays find to one channel; all of it where none were drawn.
    pub(super) fn add_drawn(&mut self, c: usize, whole: f64, drawn: Option<&Fraction>) {
        let [low, high] = drawn.map_or([1.0; 2], |fraction| fraction.range);
        self.range[0][c] += whole * low;
        self.range[1][c] += whole * high;
        if let Some(fraction) = drawn {
            self.variance[c] += whole * whole * fraction.variance.unwrap_or_default();
            self.bias[c] += whole * fraction.bias;
        }
    }

    pub(super) fn drawn(&self) -> Option<Drawn> {
        (self.n_drawn > 0 && !self.unknown).then(|| Drawn {
            range: self.range,
            error: (!self.undecided).then(|| self.variance.map(f64::sqrt)),
            bias: self.bias,
            // The worst of all drawn fractions counts.
            odds: self.odds - f64::from(self.n_drawn).ln(),
            n_mixed: self.n_mixed,
        })
    }
}
