//! Statistics of repeated measurements, and the probability of a deviation.

use std::f64::consts::PI;

use serde::Serialize;

/// The half-width of the 99.9 % range of a normal distribution, in standard deviations.
pub const Z_999: f64 = 3.290_526_731_491_9;

/// How some measured values are distributed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Spread {
    /// The middle value, or the mean of the two in the middle.
    pub median: f64,
    /// The arithmetic mean.
    pub mean: f64,
    /// The standard deviation of a sample, with n − 1; 0 for a single value.
    pub sd: f64,
    /// The least.
    pub min: f64,
    /// The greatest.
    pub max: f64,
}

impl Spread {
    /// Returns the spread of `values`.
    ///
    /// # Panics
    /// If there is no value.
    #[must_use]
    #[track_caller]
    pub fn of(values: &[f64]) -> Self {
        assert!(!values.is_empty(), "a spread needs a value");
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        Self {
            median: 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]),
            mean,
            sd: (squares / (n as f64 - 1.0).max(1.0)).sqrt(),
            min: sorted[0],
            max: sorted[n - 1],
        }
    }
}

/// Returns erfc x = 2/√π ∫_x^∞ exp(−t²) dt for x ≥ 0.
///
/// Below 2 by the series 2x/√π exp(−x²) Σ (2x²)^k / (1·3·…·(2k+1)), beyond by Laplace's continued fraction. Accuracy: relative error below 1e-13.
fn erfc(x: f64) -> f64 {
    let density = (-x * x).exp();
    if x < 2.0 {
        let (mut term, mut sum, mut odd) = (x, x, 1.0);
        while term > 1e-17 * sum {
            odd += 2.0;
            term *= 2.0 * x * x / odd;
            sum += term;
        }
        return 1.0 - 2.0 / PI.sqrt() * density * sum;
    }
    let fraction = (1..=80).rev().fold(x, |below, k| x + 0.5 * f64::from(k) / below);
    density / (PI.sqrt() * fraction)
}

/// Returns the probability that a normal variable is farther from its mean than `z` standard deviations, to either side.
#[must_use]
pub fn normal_two_sided(z: f64) -> f64 {
    erfc(z.abs() / 2f64.sqrt())
}

/// Returns the probability that a χ² variable with `degrees` degrees of freedom exceeds `x`.
///
/// Q(k/2, y) with y = x/2 from Q(1/2, y) = erfc √y or Q(1, y) = exp(−y) upwards by Q(a + 1, y) = Q(a, y) + y^a exp(−y) / Γ(a + 1).
/// Accuracy: relative error below 1e-12 up to a hundred degrees.
#[must_use]
pub fn chi_squared_above(x: f64, degrees: u32) -> f64 {
    if x <= 0.0 || degrees == 0 {
        return if x <= 0.0 { 1.0 } else { 0.0 };
    }
    let y = 0.5 * x;
    // The next term, y^a exp(−y) / Γ(a + 1), is in logarithms, as its factors leave the range of f64.
    let (mut a, mut sum, mut logarithm) = if degrees % 2 == 1 {
        (0.5, erfc(y.sqrt()), 0.5 * y.ln() - y - (0.5 * PI.sqrt()).ln())
    } else {
        (1.0, (-y).exp(), y.ln() - y)
    };
    while a < 0.5 * f64::from(degrees) - 0.25 {
        sum += logarithm.exp();
        a += 1.0;
        logarithm += (y / a).ln();
    }
    // The sum is a probability, above 1 by rounding only.
    sum.min(1.0)
}

/// Returns the two-sided probability of a sample variance at least as far out as `ratio` times the true one: that of the same side, doubled.
///
/// `degrees` is the number of normal samples less one. Accuracy of the lower tail: 1e-15 absolute.
#[must_use]
pub fn variance_two_sided(ratio: f64, degrees: u32) -> f64 {
    let above = chi_squared_above(ratio * f64::from(degrees), degrees);
    (2.0 * above.min(1.0 - above)).min(1.0)
}

/// Returns the share of `values` below `value`, in per cent, equal ones counted half.
#[must_use]
pub fn percentile(value: f64, values: &[f64]) -> f64 {
    let counted = |v: &f64| match v.total_cmp(&value) {
        std::cmp::Ordering::Less => 1.0,
        std::cmp::Ordering::Equal => 0.5,
        std::cmp::Ordering::Greater => 0.0,
    };
    100.0 * values.iter().map(counted).sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(a: f64, b: f64, rel_tol: f64) {
        assert!((a - b).abs() <= rel_tol * b.abs(), "{a} is not {b}");
    }

    #[test]
    fn tails_of_the_normal_distribution() {
        // Abramowitz and Stegun, tables 7.1 and 26.1 (erfc 0.5, erfc 3, Q(4.5)), and the definition of the constant.
        assert_close(erfc(0.5), 0.479_500_122_186_953_5, 1e-13);
        assert_close(erfc(3.0), 2.209_049_699_858_544e-5, 1e-12);
        assert_close(0.5 * normal_two_sided(4.5), 3.397_673_124_730_06e-6, 1e-12);
        assert_close(normal_two_sided(Z_999), 1e-3, 1e-11);
        assert_close(erfc(2.0 - 1e-12), erfc(2.0), 1e-10);
    }

    #[test]
    fn tails_of_the_chi_squared_distribution() {
        // Quantiles from standard tables, and two closed forms: exp(−x/2) and exp(−x/2)(1 + x/2).
        assert_close(chi_squared_above(10.827_566_170_662_73, 1), 1e-3, 1e-9);
        assert_close(chi_squared_above(3.0, 2), (-1.5f64).exp(), 1e-14);
        assert_close(chi_squared_above(3.0, 4), (-1.5f64).exp() * 2.5, 1e-14);
        assert_close(chi_squared_above(58.301_173_489_794_1, 29), 1e-3, 1e-6);
        assert_close(chi_squared_above(13.121_148_879_541, 29), 0.995, 1e-6);
        assert_close(variance_two_sided(58.301_173_489_794_1 / 29.0, 29), 2e-3, 1e-6);
        assert!(variance_two_sided(1.0, 29) > 0.9);
        assert!(variance_two_sided(0.2, 29) < 1e-5);
    }

    #[test]
    fn spreads_and_percentiles() {
        let spread = Spread::of(&[4.0, 1.0, 2.0, 9.0]);
        let expected = [3.0, 4.0, (38.0_f64 / 3.0).sqrt(), 1.0, 9.0];
        for (a, b) in [spread.median, spread.mean, spread.sd, spread.min, spread.max]
            .iter()
            .zip(expected)
        {
            assert_close(*a, b, 1e-15);
        }
        assert!(Spread::of(&[2.0]).sd.abs() < 1e-300);
        assert_close(percentile(2.0, &[1.0, 2.0, 3.0, 4.0]), 37.5, 1e-15);
    }
}
