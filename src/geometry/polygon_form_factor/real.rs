//! The operations that the contour integral requires of its numbers, so that one source serves two precisions.

use std::num::NonZeroUsize;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::OnceLock;

use glam::DVec3;

use crate::geometry::double_double::DoubleDouble;
use crate::geometry::gauss_legendre;

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
        RULES[n - 1].get_or_init(|| gauss_legendre::rounded_rule(at_least_one(n)))
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
        RULES[n - 1].get_or_init(|| gauss_legendre::rule(at_least_one(n)))
    }
}

fn at_least_one(n: usize) -> NonZeroUsize {
    NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN)
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
