//! The operations that the contour integral requires of its numbers, so that one source serves two precisions.

use std::num::NonZeroUsize;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::OnceLock;

use gauss_quad::GaussLegendre;
use glam::DVec3;

use super::double_double::DoubleDouble;

/// The longest line rule that is stored.
pub(super) const LONGEST_RULE: usize = 48;

/// `f64` or [`DoubleDouble`].
pub(super) trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    /// A bound of the relative rounding error of one operation.
    const EPSILON: f64;

    fn new(x: f64) -> Self;
    fn to_f64(self) -> f64;
    /// Returns the nearest number.
    fn rounded(x: DoubleDouble) -> Self;
    /// Multiplies by a power of two.
    fn scale(self, power: f64) -> Self;
    fn sqrt(self) -> Self;
    /// Returns the natural logarithm of a positive number.
    fn ln(self) -> Self;
    /// Returns the angle of the vector (x, y), y ≥ 0, from 0 to π.
    fn angle(y: Self, x: Self) -> Self;
    /// Returns the nodes and weights of the Gauss-Legendre rule with `n` points on [0, 1], 1 ≤ n ≤ [`LONGEST_RULE`].
    fn line_rule(n: usize) -> &'static [(Self, Self)];
}

impl Real for f64 {
    const EPSILON: f64 = f64::EPSILON;

    fn new(x: f64) -> Self {
        x
    }
    fn to_f64(self) -> f64 {
        self
    }
    fn rounded(x: DoubleDouble) -> Self {
        x.to_f64()
    }
    fn scale(self, power: f64) -> Self {
        self * power
    }
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    fn ln(self) -> Self {
        self.ln()
    }
    fn angle(y: Self, x: Self) -> Self {
        y.atan2(x)
    }
    fn line_rule(n: usize) -> &'static [(Self, Self)] {
        static RULES: [OnceLock<Vec<(f64, f64)>>; LONGEST_RULE] = [const { OnceLock::new() }; LONGEST_RULE];
        RULES[n - 1].get_or_init(|| {
            let n = NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN);
            GaussLegendre::new(n)
                .iter()
                .map(|(node, weight)| (0.5 * (node + 1.0), 0.5 * weight))
                .collect()
        })
    }
}

impl Real for DoubleDouble {
    const EPSILON: f64 = 1e-31;

    fn new(x: f64) -> Self {
        Self::new(x)
    }
    fn to_f64(self) -> f64 {
        self.to_f64()
    }
    fn rounded(x: DoubleDouble) -> Self {
        x
    }
    fn scale(self, power: f64) -> Self {
        self.scale(power)
    }
    fn sqrt(self) -> Self {
        self.sqrt()
    }
    fn ln(self) -> Self {
        self.ln()
    }
    fn angle(y: Self, x: Self) -> Self {
        Self::angle(y, x)
    }
    fn line_rule(n: usize) -> &'static [(Self, Self)] {
        static RULES: [OnceLock<Vec<(DoubleDouble, DoubleDouble)>>; LONGEST_RULE] =
            [const { OnceLock::new() }; LONGEST_RULE];
        RULES[n - 1].get_or_init(|| {
            f64::line_rule(n)
                .iter()
                .map(|&(node, _)| refine_node(n, Self::new(2.0 * node - 1.0)))
                .collect()
        })
    }
}

/// Returns node and weight on [0, 1] from a node on [−1, 1] that is accurate to 1e-15.
fn refine_node(n: usize, start: DoubleDouble) -> (DoubleDouble, DoubleDouble) {
    let one = DoubleDouble::new(1.0);
    // Returns 1 − x² and (1 − x²) P′ besides P, the Legendre polynomial.
    let legendre = |x: DoubleDouble| {
        let (mut before, mut value) = (one, x);
        for k in 2..=n {
            let k = k as f64;
            let next = x * value * DoubleDouble::new(2.0 * k - 1.0) - before * DoubleDouble::new(k - 1.0);
            (before, value) = (value, next / DoubleDouble::new(k));
        }
        let flank = one - x * x;
        (value, flank, (before - x * value) * DoubleDouble::new(n as f64))
    };
    let mut node = start;
    for _ in 0..2 {
        let (value, flank, slope) = legendre(node);
        node = node - value * flank / slope;
    }
    let (_, flank, slope) = legendre(node);
    // Half of 2/((1 − x²) P′²), for an interval of half the length.
    ((node + one).scale(0.5), flank / (slope * slope))
}

/// A vector of three numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vector<T>([T; 3]);

impl Vector<DoubleDouble> {
    /// Returns high + low.
    pub(super) fn sum(high: DVec3, low: DVec3) -> Self {
        Self([0, 1, 2].map(|k| DoubleDouble::difference(high[k], -low[k])))
    }

    /// Returns the nearest `f64` vector and the rounded remainder.
    pub(super) fn split(self) -> (DVec3, DVec3) {
        let high = self.to_f64();
        (high, self.minus(Self::sum(high, DVec3::ZERO)).to_f64())
    }

    pub(super) fn round<T: Real>(self) -> Vector<T> {
        Vector(self.0.map(T::rounded))
    }
}

impl<T: Real> Vector<T> {
    pub(super) fn dot(self, other: Self) -> T {
        let [a, b, c] = [0, 1, 2].map(|k| self.0[k] * other.0[k]);
        a + b + c
    }

    pub(super) fn cross(self, other: Self) -> Self {
        Self([(1, 2), (2, 0), (0, 1)].map(|(j, k)| self.0[j] * other.0[k] - self.0[k] * other.0[j]))
    }

    /// Returns self + t · other.
    pub(super) fn plus(self, t: T, other: Self) -> Self {
        Self([0, 1, 2].map(|k| self.0[k] + t * other.0[k]))
    }

    pub(super) fn minus(self, other: Self) -> Self {
        Self([0, 1, 2].map(|k| self.0[k] - other.0[k]))
    }

    /// Multiplies by a power of two.
    pub(super) fn scale(self, power: f64) -> Self {
        Self(self.0.map(|x| x.scale(power)))
    }

    pub(super) fn to_f64(self) -> DVec3 {
        DVec3::from(self.0.map(T::to_f64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫₀¹ xᵐ = 1/(m + 1) up to the degree 2n − 1, to the last digits.
    #[test]
    fn line_rules_integrate_powers() {
        for n in [1, 2, 5, 16, 33, LONGEST_RULE] {
            for m in [0, 1, n, 2 * n - 1] {
                let mut sum = DoubleDouble::ZERO;
                for &(node, weight) in DoubleDouble::line_rule(n) {
                    sum = sum + (0..m).fold(weight, |power, _| power * node);
                }
                let exact = DoubleDouble::new(1.0) / DoubleDouble::new((m + 1) as f64);
                assert!((sum - exact).to_f64().abs() < 2e-30, "{n} {m}");
                let plain: f64 = f64::line_rule(n)
                    .iter()
                    .map(|&(node, weight)| weight * (0..m).fold(1.0, |power, _| power * node))
                    .sum();
                assert!((plain - exact.to_f64()).abs() < 2e-15, "{n} {m}");
            }
        }
    }
}
