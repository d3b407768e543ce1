//! How finely the coordinates of a file are written.

/// What the digits of a file's coordinates tell about their rounding.
///
/// Programs write either so many places after the point, or so many digits in all; both leave trailing zeros out at times, so that the longest number counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// The most places after the point; negative for whole tens.
    places: Option<i32>,
    /// The most digits in all.
    digits: i32,
    /// True if a number without an exponent ends in a zero after its point: its places were counted, not its digits.
    by_places: bool,
}

impl Written {
    /// Takes note of a decimal number that is valid.
    pub(super) fn see(&mut self, token: &str) {
        let (number, exponent) = token.split_once(['e', 'E']).unwrap_or((token, ""));
        let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
        let length = |text: &str| i32::try_from(text.len()).unwrap_or(i32::MAX);
        let places = length(fraction).saturating_sub(exponent.parse().unwrap_or(0));
        self.places = Some(self.places.map_or(places, |most| most.max(places)));
        let whole = whole.trim_start_matches(['+', '-', '0']);
        let leading = if whole.is_empty() {
            fraction.trim_start_matches('0')
        } else {
            fraction
        };
        self.digits = self.digits.max(length(whole).saturating_add(length(leading)));
        self.by_places |= exponent.is_empty() && fraction.ends_with('0');
    }

    /// Tells whether numbers look rounded: with places after the point, and at least so many digits.
    pub(super) fn is_rounded(&self, least_digits: i32) -> bool {
        self.digits >= least_digits && self.places > Some(0)
    }

    /// Returns one unit in the last place of coordinates of a magnitude: twice what one may be off by rounding. 0 if none was seen.
    #[must_use]
    pub fn unit(&self, magnitude: f64) -> f64 {
        let Some(places) = self.places else {
            return 0.0;
        };
        let by_places = 10_f64.powi(places.saturating_neg());
        if self.by_places || magnitude <= 0.0 {
            return by_places;
        }
        by_places.max(10_f64.powf(magnitude.log10().floor() + 1.0 - f64::from(self.digits)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_that_of_the_format() {
        for (name, tokens, magnitude, expected) in [
            ("%.3f", &["500000.250", "5400001.000", "0.500"] as &[_], 5.4e6, 1e-3),
            ("%.3f without zeros", &["500000.25", "5400001.125", "0.5"], 5.4e6, 1e-3),
            (
                "%g",
                &["1234.56", "0.00123456", "6.12323e-17", "2", "-3.5"],
                1234.56,
                1e-2,
            ),
            ("%g, near", &["1234.56", "0.00123456", "-3.5"], 3.5, 1e-5),
            ("%e", &["1.000000e+03", "5.400001e+06", "-1.000000e-17"], 5.4e6, 1.0),
            ("Python", &["0.1", "3000.0", "0.004"], 3000.0, 1e-3),
            ("whole", &["5", "-12", "0"], 12.0, 1.0),
            ("tens", &["1.2e4"], 12000.0, 1e3),
            ("nothing", &[], 1.0, 0.0),
        ] {
            let mut written = Written::default();
            for token in tokens {
                written.see(token);
            }
            let unit = written.unit(magnitude);
            assert!((unit - expected).abs() <= 1e-12 * expected, "{name}: {unit:e}");
        }
    }

    #[test]
    fn absurd_exponents_do_no_harm() {
        let mut written = Written::default();
        for token in ["0e99999999999", "1e-400", "0e2147483647", "0e-2147483648"] {
            written.see(token);
            assert!(written.unit(1.0).is_finite());
        }
    }
}
