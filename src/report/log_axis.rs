//! A logarithmic axis for `plotters`.
//!
//! The library's own treats values below 2.2e-16 as zero and labels only powers of ten; errors may be smaller, and times may span less.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

/// An axis from one positive number to a larger one, with equal ratios at equal distances.
#[derive(Clone, Debug)]
pub(super) struct LogAxis {
    range: Range<f64>,
}

impl LogAxis {
    /// Returns an axis that covers `values` with a margin; values that are not positive and finite are ignored.
    pub(super) fn covering(values: impl IntoIterator<Item = f64>) -> Self {
        let usable = values.into_iter().filter(|v| v.is_finite() && *v > 0.0);
        let (low, high) = usable.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (0.1, 1.0) };
        // At least half a decade keeps a single value off an empty range.
        let missing = (0.5 - (high / low).log10()).max(0.0);
        let margin = 10f64.powf(0.5 * missing + 0.06 * (high / low).log10().max(1.0));
        Self {
            range: low / margin..high * margin,
        }
    }

    /// Returns the lower end.
    pub(super) fn low(&self) -> f64 {
        self.range.start
    }

    fn decades(&self) -> f64 {
        (self.range.end / self.range.start).log10()
    }

    /// Returns the marks m · 10^k inside the axis for each m, ascending.
    fn marks(&self, mantissas: &[u8], every: i32) -> Vec<f64> {
        #[expect(clippy::cast_possible_truncation, reason = "the logarithm of a finite f64 is small")]
        let exponents = self.range.start.log10().floor() as i32..=self.range.end.log10().ceil() as i32;
        exponents
            .filter(|k| k.rem_euclid(every) == 0)
            .flat_map(|k| mantissas.iter().map(move |&m| power_of_ten(m, k)))
            .filter(|v| self.range.contains(v))
            .collect()
    }
}

/// Returns m · 10^k, correctly rounded, for labels.
fn power_of_ten(mantissa: u8, exponent: i32) -> f64 {
    format!("{mantissa}e{exponent}").parse().unwrap_or(f64::NAN)
}

impl Ranged for LogAxis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let share = (value / self.range.start).log10() / self.decades();
        #[expect(clippy::cast_possible_truncation, reason = "a place in pixels, which saturates")]
        let offset = (share * f64::from(limit.1 - limit.0)).round() as i32;
        limit.0.saturating_add(offset)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let every = if self.decades() > 9.0 { 2 } else { 1 };
        if hint.weight().allow_light_points() && self.decades() <= 7.0 {
            return self.marks(&[1, 2, 3, 4, 5, 6, 7, 8, 9], 1);
        }
        // A range with at most two powers of ten is also labelled between them.
        let powers = self.marks(&[1], every);
        match powers.len() {
            0 => self.marks(&[1, 2, 3, 4, 5, 6, 7, 8, 9], 1),
            1..=2 => self.marks(&[1, 2, 5], 1),
            _ => powers,
        }
    }

    fn range(&self) -> Range<f64> {
        self.range.clone()
    }
}

impl ValueFormatter<f64> for LogAxis {
    fn format_ext(&self, value: &f64) -> String {
        label(*value, self.range.start < 1e-3)
    }
}

/// Returns a number as a label: 0.02, or in powers of ten 2×10⁻², 10⁻⁵, 1.
fn label(value: f64, in_powers: bool) -> String {
    if (1.0..1e4).contains(&value) || !in_powers && (1e-3..1.0).contains(&value) {
        return format!("{value}");
    }
    let scientific = format!("{value:e}");
    let Some((mantissa, exponent)) = scientific.split_once('e') else {
        return scientific;
    };
    let raised: String = exponent.chars().map(superscript).collect();
    if mantissa == "1" {
        format!("10{raised}")
    } else {
        format!("{mantissa}×10{raised}")
    }
}

fn superscript(digit: char) -> char {
    match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        other => other
            .to_digit(10)
            .and_then(|d| char::from_u32(0x2070 + d))
            .unwrap_or(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters::coord::ranged1d::BoldPoints;

    #[test]
    fn equal_ratios_are_equal_distances_below_the_rounding_of_one() {
        let axis = LogAxis { range: 1e-20..1e-10 };
        assert_eq!([1e-20, 1e-15, 1e-10].map(|v| axis.map(&v, (0, 1000))), [0, 500, 1000]);
        assert_eq!([1e-20, 1e-15, 1e-10].map(|v| axis.map(&v, (1000, 0))), [1000, 500, 0]);
    }

    #[test]
    fn a_narrow_axis_has_labels_too() {
        let labels = |low, high| -> Vec<String> {
            let axis = LogAxis { range: low..high };
            axis.key_points(BoldPoints(10))
                .iter()
                .map(|v| axis.format_ext(v))
                .collect()
        };
        assert_eq!(labels(0.15, 6.0), ["0.2", "0.5", "1", "2", "5"]);
        assert_eq!(labels(3e-6, 2e-3), ["10⁻⁵", "10⁻⁴", "10⁻³"]);
        assert_eq!(labels(0.31, 0.65), ["0.4", "0.5", "0.6"]);
    }

    #[test]
    fn an_axis_covers_what_it_is_made_for() {
        let axis = LogAxis::covering([3e-5, 0.0, f64::NAN, 0.2]);
        assert!(axis.range.start < 3e-5 && axis.range.start > 1e-5);
        assert!(axis.range.end > 0.2 && axis.range.end < 0.6);
        let single = LogAxis::covering([1.0]);
        assert!(single.range.start < 0.6 && single.range.end > 1.7);
        assert!(LogAxis::covering([]).decades() > 0.5);
    }
}
