//! The precision with which the coordinates of a file are written.

use std::cmp::Ordering;
use std::fmt;

/// The evidence of all numbers, in hundredths of a bit, from which on a file counts as written from f32.
const SINGLE_BITS: u32 = 400;

/// Places after the point of numbers that people and surveys write: multiples of 1/8 are no evidence for f32.
const SHORT_PLACES: i32 = 3;

/// The rounding of a file's coordinates, inferred from their digits.
///
/// Programs write a fixed number of places after the point (`%.3f`) or of digits in all (`%.6g`, `%e`), and some omit trailing zeros. Zeros after the point show which of them is fixed, else the
/// counts of the numbers that have the most places or digits. Exponents without such zeros mean a fixed number of digits. Numbers that are all near an f32, with more digits than it needs, come from
/// f32.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a sign of its own")]
pub struct Written {
    /// The most places after the point, negative for whole tens, and the number of numbers with as many.
    places: Option<(i32, u32)>,
    /// The most digits in all, and the number of numbers, with places or an exponent, with as many.
    digits: (i32, u32),
    /// The most digits of such a number without the zeros at its end.
    needed: i32,
    /// True if a number without an exponent ends in a zero after its point: its places were fixed, not its digits.
    by_places: bool,
    /// True if a number has an exponent.
    has_exponent: bool,
    /// The evidence for f32, in hundredths of a bit; `None` if a number is not an f32.
    single: Option<u32>,
    /// True if a binary f32 has more digits than a short number.
    is_binary_single: bool,
    /// The file's unit of length in m; `None` for metres.
    scale: Option<f64>,
    /// The least unit in the last place, in m.
    least: f64,
    /// The greatest distance of vertices that were joined, in m.
    joined: f64,
    /// True if faces or vertices miss each other by no more than rounding explains.
    pub(super) misses: bool,
}

impl Written {
    /// The number of digits from which a fractional number counts as rounded: 0.25 is a quarter, 0.333333 a third.
    const MIN_DIGITS: i32 = 6;

    /// Returns the state before any number.
    pub(super) fn new() -> Self {
        Self {
            single: Some(0),
            ..Self::default()
        }
    }

    /// Records a valid decimal number.
    pub(super) fn see(&mut self, token: &str) {
        self.see_value(token, token.parse().unwrap_or(f64::NAN));
    }

    /// Records a number of a binary file by its shortest decimal text.
    pub(super) fn see_binary(&mut self, value: f64) {
        self.see_value(&value.to_string(), value);
    }

    /// Records an f32 of a binary file: one of up to 12 bits is exact, others were rounded to 24.
    pub(super) fn see_single(&mut self, value: f32) {
        const LOW_BITS: u32 = 0xfff;
        self.is_binary_single |= value.to_bits() & LOW_BITS != 0;
    }

    /// Adds the evidence of f32s in another part of a file.
    pub(super) fn merge_single(&mut self, other: &Self) {
        self.is_binary_single |= other.is_binary_single;
    }

    /// Records that all lengths are multiplied by `scale`.
    pub(super) fn scale(&mut self, scale: f64) {
        #[expect(clippy::float_cmp, reason = "metres are exactly 1 m")]
        if scale != 1.0 {
            self.scale = Some(scale * self.scale.unwrap_or(1.0));
            self.least *= scale;
            self.joined *= scale;
        }
    }

    /// Records that coordinates may be off by half of a length, in m, whatever their digits.
    pub(super) fn at_least(&mut self, length: f64) {
        self.least = self.least.max(length);
    }

    /// Records that vertices were joined over a distance, in m, which counts as their rounding.
    pub(super) fn join_over(&mut self, distance: f64) {
        self.joined = self.joined.max(distance);
        self.at_least(2.0 * distance);
    }

    /// Returns the greatest distance of joined vertices, in m, where it exceeds the rounding by digits of a coordinate of a magnitude.
    pub(crate) fn joined_beyond_digits(&self, magnitude: f64) -> Option<f64> {
        let digits = Self { least: 0.0, ..*self };
        // Short decimals are exact, unless vertices were joined.
        let by_digits = if digits.shows_rounding() {
            digits.unit(magnitude)
        } else {
            0.0
        };
        (2.0 * self.joined > by_digits).then_some(self.joined)
    }

    /// Records a decimal number and its value.
    pub(super) fn see_value(&mut self, token: &str, value: f64) {
        let (number, exponent) = token.split_once(['e', 'E']).unwrap_or((token, ""));
        let (whole, fraction) = number.split_once('.').unwrap_or((number, ""));
        let length = |text: &str| i32::try_from(text.len()).unwrap_or(i32::MAX);
        let power = exponent.parse().unwrap_or(0);
        let places = length(fraction).saturating_sub(power);
        let of_places = self.places.get_or_insert((places, 0));
        count(of_places, places);
        let whole = whole.trim_start_matches(['+', '-', '0']);
        let is_below_one = whole.is_empty();
        let leading = if is_below_one {
            fraction.trim_start_matches('0')
        } else {
            fraction
        };
        let digits = length(whole).saturating_add(length(leading));
        self.has_exponent |= !exponent.is_empty();
        self.by_places |= exponent.is_empty() && fraction.ends_with('0');
        let short = leading.trim_end_matches('0');
        let needed = if short.is_empty() && !exponent.is_empty() {
            length(whole.trim_end_matches('0'))
        } else if short.is_empty() {
            0
        } else {
            length(whole).saturating_add(length(short))
        };
        self.needed = self.needed.max(needed);
        if fraction.is_empty() && exponent.is_empty() {
            self.digits.0 = self.digits.0.max(digits);
        } else {
            count(&mut self.digits, digits);
        }
        if let Some(bits) = self.single {
            let short_places = length(fraction.trim_end_matches('0')).saturating_sub(power);
            self.single = single_bits(value, places, short_places).map(|more| bits.saturating_add(more));
        }
    }

    /// Returns whether the coordinates were rounded: some need six digits, or parts of the mesh miss each other by no more than rounding explains.
    ///
    /// Whole numbers and short decimals are exact.
    #[must_use]
    pub fn shows_rounding(&self) -> bool {
        self.needed >= Self::MIN_DIGITS || self.is_binary_single || self.least > 0.0 || self.misses
    }

    /// Returns whether numbers look rounded: they have places after the point, and some need at least `least_digits` digits.
    ///
    /// 100000 and 100000.0 need none.
    pub(super) fn is_rounded(&self, least_digits: i32) -> bool {
        let has_digits = self.needed >= least_digits && self.has_places();
        has_digits || self.is_binary_single || self.least > 0.0
    }

    /// Returns whether numbers have places after the point.
    pub(super) fn has_places(&self) -> bool {
        self.places.is_some_and(|places| places.0 > 0)
    }

    /// Returns one unit in the last place of a coordinate of a magnitude, both in m: twice its greatest rounding. 0 if no number was recorded.
    ///
    /// 10^−p with p the most places after the point, or 10^(⌊log10 |x|⌋ + 1 − d) with d the most digits in all, whichever is fixed in the file; where this is unknown, the larger one.
    /// It is at least the step of f32 at x, 24 bits, where the numbers come from f32. Units other than metres and the distances of joined vertices are included.
    #[must_use]
    pub fn unit(&self, magnitude: f64) -> f64 {
        let unit = match self.scale {
            Some(scale) => scale * self.unit_in_file(magnitude / scale),
            None => self.unit_in_file(magnitude),
        };
        unit.max(self.least)
    }

    fn unit_in_file(&self, magnitude: f64) -> f64 {
        if self.is_binary_single {
            return step_of_single(magnitude);
        }
        let Some((places, _)) = self.places else {
            return 0.0;
        };
        let by_places = 10_f64.powi(places.saturating_neg());
        let by_digits = if magnitude > 0.0 {
            10_f64.powf(magnitude.log10().floor() + 1.0 - f64::from(self.digits.0))
        } else {
            0.0
        };
        let unit = match self.counts() {
            Counts::Places => by_places,
            Counts::Digits | Counts::Either if magnitude <= 0.0 => by_places,
            Counts::Digits => by_digits,
            Counts::Either => by_places.max(by_digits),
        };
        if self.is_single() {
            unit.max(step_of_single(magnitude))
        } else {
            unit
        }
    }

    /// Returns whether the numbers come from f32.
    fn is_single(&self) -> bool {
        self.is_binary_single || self.single.is_some_and(|bits| bits >= SINGLE_BITS)
    }

    /// Returns which kind of digits has a fixed number.
    fn counts(&self) -> Counts {
        let n_with_places = self.places.map_or(0, |places| places.1);
        if self.by_places {
            Counts::Places
        } else if self.has_exponent {
            Counts::Digits
        } else {
            match n_with_places.cmp(&self.digits.1) {
                Ordering::Greater => Counts::Places,
                Ordering::Equal => Counts::Either,
                Ordering::Less => Counts::Digits,
            }
        }
    }
}

impl fmt::Display for Written {
    /// Writes the rounding of the coordinates: "to 6 digits", "to 2 decimals", "to f32", "to 1.0e-7 m".
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let places = self.places.map_or(0, |places| places.0);
        match self.counts() {
            _ if self.is_single() => write!(f, "to f32"),
            // Digits were counted of no coordinate, but of the transformation that placed it.
            _ if self.places.is_none() && self.least > 0.0 => write!(f, "to {:.1e} m", self.least),
            Counts::Places if places > 0 => write!(f, "to {places} decimals"),
            Counts::Places => write!(f, "to whole numbers"),
            Counts::Digits | Counts::Either => write!(f, "to {} digits", self.digits.0),
        }
    }
}

/// The kind of digits whose number is the same in all coordinates of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Counts {
    /// Places after the point.
    Places,
    /// Digits in all.
    Digits,
    /// Either of the two.
    Either,
}

/// Counts a number among those with the most places or digits.
fn count(most: &mut (i32, u32), of_number: i32) {
    if of_number > most.0 {
        *most = (of_number, 1);
    } else if of_number == most.0 {
        most.1 = most.1.saturating_add(1);
    }
}

/// Returns the distance from an f32 of a magnitude to the next.
fn step_of_single(magnitude: f64) -> f64 {
    let single = nearest_single(magnitude).abs();
    f64::from(single.next_up()) - f64::from(single)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "it is asked whether numbers come from f32"
)]
fn nearest_single(x: f64) -> f32 {
    x as f32
}

/// Returns the evidence of a decimal number for f32, in hundredths of a bit; `None` if it is not the text of an f32.
///
/// It is the logarithm of the number of such decimal numbers for each f32.
fn single_bits(value: f64, places: i32, short_places: i32) -> Option<u32> {
    let own = 10_f64.powi(places.saturating_neg());
    let off = (f64::from(nearest_single(value)) - value).abs();
    if off > 0.5 * own * (1.0 + 1e-6) {
        return None;
    }
    if short_places <= SHORT_PLACES || own <= 0.0 {
        return Some(0);
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to a small range"
    )]
    let bits = (100.0 * (step_of_single(value.abs()) / own).log2()).clamp(0.0, 1e6) as u32;
    Some(bits)
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
            // A map with six digits: each axis has a unit of its own.
            ("northing", &["461256", "5.30115e+06", "512"], 5.30115e6, 10.0),
            ("easting", &["461256", "5.30115e+06", "512"], 461_256.0, 1.0),
            ("height", &["461256", "5.30115e+06", "512"], 512.0, 1e-3),
            ("%.7g", &["461256.3", "5301152", "12.34567", "512.25"], 5_301_152.0, 1.0),
            (
                "places, though a northing is whole",
                &["461256.5", "5301152", "512.5", "12.5"],
                5_301_152.0,
                0.1,
            ),
            ("Python's round", &["1e-06", "3.0", "12.345678"], 0.5, 1e-6),
            ("f32, nine digits", &["0.333333343", "0.5"], 0.333, 2.0_f64.powi(-25)),
            (
                "f32, as short as can be",
                &[
                    "2.2687285",
                    "3.6948674",
                    "3.5275493",
                    "2.510138",
                    "2.9908702",
                    "0.1",
                    "0.33333334",
                ],
                2.6,
                2.0_f64.powi(-22),
            ),
            (
                "f32 in f64, Python",
                &["0.30000001192092896", "-4.371138828673793e-08", "2.0"],
                2.0,
                2.0_f64.powi(-22),
            ),
            ("eighths are no f32", &["100000.125", "200001.25"], 2e5, 1e-3),
        ] {
            let mut written = Written::new();
            for token in tokens {
                written.see(token);
            }
            let unit = written.unit(magnitude);
            assert!((unit - expected).abs() <= 1e-12 * expected, "{name}: {unit:e}");
            let told = written.to_string();
            let is_right = match name {
                "%.3f" => told == "to 3 decimals",
                "northing" => told == "to 6 digits",
                "f32, nine digits" => told == "to f32",
                "whole" => told == "to whole numbers" || told == "to 2 digits",
                _ => true,
            };
            assert!(is_right, "{name}: {told}");
        }
    }

    #[test]
    fn binary_numbers_have_the_bits_of_f32_and_units_a_scale() {
        let mut meant = Written::new();
        for x in [0.25_f32, -3.0, 1024.0, 0.375] {
            meant.see_single(x);
        }
        assert!(!meant.shows_rounding() && meant.unit(1024.0) <= 0.0);
        let mut rounded = meant;
        rounded.see_single(0.1);
        assert!(rounded.shows_rounding() && rounded.to_string() == "to f32");
        let is = |found: f64, expected: f64| assert!((found - expected).abs() <= 1e-12 * expected, "{found:e}");
        is(rounded.unit(0.1), 2.0_f64.powi(-27));
        rounded.scale(1e-3);
        is(rounded.unit(0.1e-3), 1e-3 * 2.0_f64.powi(-27));
        // An f64 has the digits of its shortest text: six decimals here, or as many digits, whichever is coarser.
        let mut double = Written::new();
        for x in [0.333_333, 2.0, 0.125] {
            double.see_binary(x);
        }
        assert!(double.shows_rounding());
        is(double.unit(1.0), 1e-5);
        double.at_least(1e-4);
        is(double.unit(1.0), 1e-4);
        assert_eq!(double.joined_beyond_digits(1.0), None);
        double.join_over(1e-6);
        assert_eq!(double.joined_beyond_digits(1.0), None);
        double.join_over(0.5);
        is(double.unit(1.0), 1.0);
        is(double.joined_beyond_digits(1.0).expect("a distance"), 0.5);
        let mut placed = Written::new();
        placed.at_least(2e-7);
        assert_eq!(placed.to_string(), "to 2.0e-7 m");
    }

    #[test]
    fn absurd_exponents_do_no_harm() {
        let mut written = Written::new();
        for token in ["0e99999999999", "1e-400", "0e2147483647", "0e-2147483648"] {
            written.see(token);
            assert!(written.unit(1.0).is_finite());
        }
    }

    #[test]
    fn short_decimals_and_whole_numbers_are_meant() {
        for (tokens, expected) in [
            (&["0.25", "3.125", "-1000"] as &[_], false),
            (&["461256", "5301152", "512.5"], false),
            (&["1.000000", "0.500000", "-3.100000"], false),
            (&["0.333333"], true),
            (&["12.3456", "1"], true),
            (&["5.30115e+06", "512"], true),
            (&["1e-05", "1.5e3"], false),
            (&["1.000000e+00", "2.500000e-01"], false),
            // A small thing near a large one.
            (&["-100000", "90000.0", "0.1"], false),
        ] {
            let mut written = Written::new();
            for token in tokens {
                written.see(token);
            }
            assert_eq!(written.shows_rounding(), expected, "{tokens:?}");
            assert!(expected || !written.is_rounded(Written::MIN_DIGITS), "{tokens:?}");
        }
    }
}
