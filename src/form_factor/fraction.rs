//! A fraction of light, with its error.

/// A fraction of the light of a patch, or of a surface, with its error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fraction {
    /// The fraction.
    pub value: f64,
    /// The part of the error that it shares with its neighbours, in the same direction: that of form factors.
    pub common: f64,
    /// The variance of its independent error: that of rays.
    pub variance: f64,
}

impl Fraction {
    /// Returns a share of the fraction.
    pub(super) fn share(self, share: f64) -> Self {
        Self {
            value: share * self.value,
            common: share * self.common,
            variance: share * share * self.variance,
        }
    }

    /// Returns an estimate of the absolute error.
    #[must_use]
    pub fn error(self) -> f64 {
        self.common + self.variance.sqrt()
    }
}
