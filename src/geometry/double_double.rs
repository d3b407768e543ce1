//! Numbers of about 31 digits, for sums whose cancellation exceeds the digits of an `f64`.

use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::OnceLock;

/// An unevaluated sum hi + lo with |lo| ≤ ulp(hi)/2: 106 bits.
///
/// Sums, products, quotients and roots are accurate to a few times 2⁻¹⁰⁴, relative; logarithms and angles to 1e-30.
/// Source: T. J. Dekker, Numer. Math. 18, 1971. Departures: none.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct DoubleDouble {
    hi: f64,
    lo: f64,
}

/// Returns the rounded sum and its rounding error, exactly.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// The same where |a| ≥ |b|.
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// Returns the rounded product and its rounding error, exactly.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    if cfg!(target_feature = "fma") {
        return (product, a.mul_add(b, -product));
    }
    let ((a1, a0), (b1, b0)) = (halves(a), halves(b));
    (product, ((a1 * b1 - product) + a1 * b0 + a0 * b1) + a0 * b0)
}

/// Splits a number into two of at most 26 bits.
fn halves(a: f64) -> (f64, f64) {
    let c = 134_217_729.0 * a; // 2^27 + 1
    let high = c - (c - a);
    (high, a - high)
}

impl DoubleDouble {
    pub(super) const ZERO: Self = Self { hi: 0.0, lo: 0.0 };

    pub(super) fn new(x: f64) -> Self {
        Self { hi: x, lo: 0.0 }
    }

    pub(super) fn to_f64(self) -> f64 {
        self.hi
    }

    /// Returns the exact product of two `f64`.
    pub(super) fn product(a: f64, b: f64) -> Self {
        let (hi, lo) = two_product(a, b);
        Self { hi, lo }
    }

    /// Returns the exact difference of two `f64`.
    pub(super) fn difference(a: f64, b: f64) -> Self {
        let (hi, lo) = two_sum(a, -b);
        Self { hi, lo }
    }

    /// Multiplies by a power of two, exactly.
    pub(super) fn scale(self, power: f64) -> Self {
        Self {
            hi: self.hi * power,
            lo: self.lo * power,
        }
    }

    fn times(self, b: f64) -> Self {
        let (product, error) = two_product(self.hi, b);
        let (hi, lo) = quick_two_sum(product, error + self.lo * b);
        Self { hi, lo }
    }

    pub(super) fn sqrt(self) -> Self {
        if self.hi <= 0.0 {
            return Self::ZERO;
        }
        let inverse = 1.0 / self.hi.sqrt();
        let root = self.hi * inverse;
        let (hi, lo) = quick_two_sum(root, (self - Self::product(root, root)).hi * inverse * 0.5);
        Self { hi, lo }
    }

    /// Returns the natural logarithm of a positive normal number.
    pub(super) fn ln(self) -> Self {
        let tables = Tables::get();
        let exponent = ((self.hi.to_bits() >> 52) & 0x7ff) as i32 - 1023;
        let power = 2.0_f64.powi(-exponent);
        let mantissa = self.scale(power);
        let k = nearest_step(mantissa.hi - 1.0);
        let c = 1.0 + k as f64 / STEPS as f64;
        let z = (mantissa - Self::new(c)) / (mantissa + Self::new(c));
        tables.ln_2.times(f64::from(exponent)) + tables.logarithms[k] + tables.odd_series(z, 1.0).scale(2.0)
    }

    /// Returns the angle of the vector (x, y), for y ≥ 0: from 0 to π; 0 for the zero vector.
    pub(super) fn angle(y: Self, x: Self) -> Self {
        let tables = Tables::get();
        let across = if x.hi < 0.0 { -x } else { x };
        let steep = y > across;
        let (small, large) = if steep { (across, y) } else { (y, across) };
        if large.hi <= 0.0 {
            return Self::ZERO;
        }
        let k = nearest_step(small.hi / large.hi);
        let c = k as f64 / STEPS as f64;
        let z = (small - large.times(c)) / (large + small.times(c));
        let mut angle = tables.angles[k] + tables.odd_series(z, -1.0);
        if steep {
            angle = tables.angles[STEPS].scale(2.0) - angle;
        }
        if x.hi < 0.0 {
            angle = tables.angles[STEPS].scale(4.0) - angle;
        }
        angle
    }
}

const STEPS: usize = 64;

/// Returns the nearest multiple of 1/64 to a number from 0 to 1.
fn nearest_step(x: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 64"
    )]
    let k = (x * STEPS as f64).round() as usize;
    k.min(STEPS)
}

struct Tables {
    /// 1/(2k + 1)
    odd_inverses: [DoubleDouble; 4],
    /// ln(1 + k/64)
    logarithms: [DoubleDouble; STEPS + 1],
    /// atan(k/64)
    angles: [DoubleDouble; STEPS + 1],
    ln_2: DoubleDouble,
}

impl Tables {
    fn get() -> &'static Self {
        static TABLES: OnceLock<Tables> = OnceLock::new();
        TABLES.get_or_init(|| {
            let one = DoubleDouble::new(1.0);
            let zero = [DoubleDouble::ZERO; STEPS + 1];
            let mut tables = Self {
                odd_inverses: [1.0, 3.0, 5.0, 7.0].map(|n| one / DoubleDouble::new(n)),
                logarithms: zero,
                angles: zero,
                ln_2: DoubleDouble::ZERO,
            };
            let steps = STEPS as f64;
            for k in 0..STEPS {
                let (a, b) = (k as f64 / steps, (k + 1) as f64 / steps);
                let ratio = DoubleDouble::new(b - a) / DoubleDouble::new(2.0 + a + b);
                tables.logarithms[k + 1] = tables.logarithms[k] + tables.odd_series(ratio, 1.0).scale(2.0);
                let tangent = DoubleDouble::new(b - a) / DoubleDouble::new(1.0 + a * b);
                tables.angles[k + 1] = tables.angles[k] + tables.odd_series(tangent, -1.0);
            }
            tables.ln_2 = tables.logarithms[STEPS];
            tables
        })
    }

    /// Returns Σ sign^k z^(2k+1)/(2k+1) for |z| ≤ 1/64: artanh z for sign 1, arctan z for sign −1.
    fn odd_series(&self, z: DoubleDouble, sign: f64) -> DoubleDouble {
        let square = (z * z).scale(sign);
        let x = square.hi;
        // From the fifth term on (2^−48 of the first) an f64 is enough; the first omitted term is 2^−108 of the sum.
        let tail = [9.0, 11.0, 13.0, 15.0, 17.0]
            .into_iter()
            .rev()
            .fold(0.0, |sum, n| sum * x + 1.0 / n);
        let sum = self
            .odd_inverses
            .iter()
            .rev()
            .fold(DoubleDouble::new(tail), |sum, &inverse| sum * square + inverse);
        z * sum
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let (high, high_error) = two_sum(self.hi, other.hi);
        let (low, low_error) = two_sum(self.lo, other.lo);
        let (high, rest) = quick_two_sum(high, high_error + low);
        let (hi, lo) = quick_two_sum(high, rest + low_error);
        Self { hi, lo }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    fn neg(self) -> Self {
        Self {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let (product, error) = two_product(self.hi, other.hi);
        let (hi, lo) = quick_two_sum(product, error + (self.hi * other.lo + self.lo * other.hi));
        Self { hi, lo }
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        let rest = self - other.times(first);
        let second = rest.hi / other.hi;
        let third = (rest - other.times(second)).hi / other.hi;
        let (hi, lo) = quick_two_sum(first, second);
        Self { hi, lo } + Self::new(third)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The value of a decimal with up to 32 digits after the leading one, as a sum of exact parts.
    fn parts(high: f64, low: f64) -> DoubleDouble {
        let (hi, lo) = two_sum(high, low);
        DoubleDouble { hi, lo }
    }

    fn distance(a: DoubleDouble, b: DoubleDouble) -> f64 {
        (a - b).hi.abs()
    }

    #[test]
    fn arithmetic_inverts_itself() {
        let mut x: f64 = 0.37;
        for _ in 0..1000 {
            x = (x * 3.9 * (1.0 - x)).clamp(0.01, 0.99);
            let a = DoubleDouble::new(x) / DoubleDouble::new(3.0);
            let b = DoubleDouble::new(1.0 - x * x) / DoubleDouble::new(7.0) - a;
            assert!(distance(a * b / b, a) < 1e-31 && distance(a + b - b, a) < 1e-31);
            assert!(distance(a.sqrt() * a.sqrt(), a) < 1e-31);
        }
    }

    #[test]
    fn logarithms_and_angles_obey_their_addition_theorems() {
        let mut x: f64 = 0.41;
        for k in 0..1000 {
            x = (x * 3.9 * (1.0 - x)).clamp(0.01, 0.99);
            let a = DoubleDouble::new(x * 10.0_f64.powi(k % 20 - 10)) / DoubleDouble::new(3.0);
            let b = DoubleDouble::new(1.1 - x) / DoubleDouble::new(7.0);
            assert!(distance((a * b).ln(), a.ln() + b.ln()) < 1e-29, "{a:?}");
            assert!((a.ln().hi - a.hi.ln()).abs() < 1e-14);
            // arg(u v) = arg u + arg v, taken below π.
            let (u, v) = ((a, b), (DoubleDouble::new(0.3), DoubleDouble::new(x)));
            let (re, im) = (u.0 * v.0 - u.1 * v.1, u.0 * v.1 + u.1 * v.0);
            let sum = DoubleDouble::angle(u.1, u.0) + DoubleDouble::angle(v.1, v.0);
            assert!(distance(DoubleDouble::angle(im, re), sum) < 1e-30, "{a:?} {b:?}");
            assert!((DoubleDouble::angle(b, -a).hi - b.hi.atan2(-a.hi)).abs() < 1e-15);
        }
    }

    #[test]
    fn constants_to_thirty_digits() {
        let ln_2 = parts(std::f64::consts::LN_2, 2.319_046_813_846_299_6e-17);
        assert!(distance(DoubleDouble::new(2.0).ln(), ln_2) < 1e-31);
        assert!(distance(DoubleDouble::new(0.5).ln(), -ln_2) < 1e-31);
        let pi = parts(std::f64::consts::PI, 1.224_646_799_147_353_2e-16);
        let angle = |y, x| DoubleDouble::angle(DoubleDouble::new(y), DoubleDouble::new(x));
        assert!(distance(angle(0.0, -1.0), pi) < 1e-31);
        assert!(distance(angle(2.0, 2.0).scale(4.0), pi) < 1e-31);
        assert!(distance(angle(1.0, 0.0).scale(2.0), pi) < 1e-31);
        assert_eq!(angle(0.0, 0.0), DoubleDouble::ZERO);
    }
}
