//! The numbers of a row of a matrix that a solver makes for its own use, in f64 or rounded to f32.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::ops::Range;

use pulp::Simd;

use super::aligned::{Aligned, LINE_BYTE};
use super::lanes::{InnerLoop, add_row, ahead_byte, dispatch, dot};
use super::prefetch::prefetch;
use super::scalar::Scalar;

/// Rows that are multiplied at a time, so that their sums are independent.
pub(crate) const ROWS_AT_ONCE: usize = 4;

/// Numbers below which choosing an instruction set takes longer than adding up.
const SHORT: usize = 32;

/// Numbers that are multiplied with vectors of f64.
pub(crate) enum Coefficients {
    /// Unrounded.
    Double(Aligned<f64>),
    /// Rounded, each by at most 6e-8 of itself, or 1e-45: half of the memory and of the data of a product.
    Single(Aligned<f32>),
}

impl Coefficients {
    pub(crate) fn exact(values: &[f64]) -> Self {
        Self::Double(Aligned::copied(values))
    }

    pub(crate) fn rounded(values: &[f64]) -> Self {
        let rounded: Vec<f32> = values.iter().map(|&value| f32::from_f64(value)).collect();
        Self::Single(Aligned::copied(&rounded))
    }

    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Double(values) => values.len(),
            Self::Single(values) => values.len(),
        }
    }

    /// Returns a number, or `None` beyond the last.
    pub(crate) fn get(&self, at: usize) -> Option<f64> {
        match self {
            Self::Double(values) => values.get(at).copied(),
            Self::Single(values) => values.get(at).map(|&value| value.into()),
        }
    }

    pub(crate) fn for_each(&self, mut visit: impl FnMut(usize, f64)) {
        match self {
            Self::Double(values) => (0..).zip(values.iter()).for_each(|(k, &value)| visit(k, value)),
            Self::Single(values) => (0..).zip(values.iter()).for_each(|(k, &value)| visit(k, value.into())),
        }
    }

    /// Returns whether there are enough of them for [`products`].
    pub(crate) fn is_long(&self) -> bool {
        self.len() >= SHORT
    }

    /// Returns Σ a x over some of the numbers, the first of which meets the first x.
    pub(crate) fn product(&self, range: Range<usize>, x: &[f64]) -> f64 {
        match self {
            Self::Double(values) => product(&values[range], x),
            Self::Single(values) => product(&values[range], x),
        }
    }

    /// Prefetches the first entries that [`products`] reads.
    pub(crate) fn announce(&self) {
        fn ask<T>(values: &[T]) {
            let n_values = values.len().min(ahead_byte(ROWS_AT_ONCE) / size_of::<T>());
            for place in (0..n_values).step_by(LINE_BYTE / size_of::<T>()) {
                prefetch(values, place);
            }
        }
        match self {
            Self::Double(values) => ask(values),
            Self::Single(values) => ask(values),
        }
    }
}

/// Returns Σ a x of each row, from one of its numbers on, which meets the first x, in less time than one by one.
pub(crate) fn products(rows: [(&Coefficients, usize); ROWS_AT_ONCE], x: &[f64]) -> [f64; ROWS_AT_ONCE] {
    let mut sums = [0.0; ROWS_AT_ONCE];
    let double = rows.map(|(row, first)| match row {
        Coefficients::Double(values) => Some(&values[first..]),
        Coefficients::Single(_) => None,
    });
    let single = rows.map(|(row, first)| match row {
        Coefficients::Single(values) => Some(&values[first..]),
        Coefficients::Double(_) => None,
    });
    match (double, single) {
        ([Some(a), Some(b), Some(c), Some(d)], _) => dispatch(Four([a, b, c, d], x, &mut sums)),
        (_, [Some(a), Some(b), Some(c), Some(d)]) => dispatch(Four([a, b, c, d], x, &mut sums)),
        _ => sums = rows.map(|(row, first)| row.product(first..row.len(), x)),
    }
    sums
}

/// The loop of [`products`].
struct Four<'a, T>([&'a [T]; ROWS_AT_ONCE], &'a [f64], &'a mut [f64; ROWS_AT_ONCE]);

impl<T: Scalar> InnerLoop for Four<'_, T> {
    #[expect(
        clippy::inline_always,
        reason = "what is not inlined is not compiled for the instruction set"
    )]
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        *self.2 = dot::<S, T, N, ROWS_AT_ONCE, 1>(simd, self.0, [self.1]).map(|[sum]| sum);
    }
}

/// Returns Σ a x over all a.
fn product<T: Scalar>(a: &[T], x: &[f64]) -> f64 {
    if a.len() < SHORT {
        return short_product(a, x);
    }
    let mut sum = [0.0];
    add_row(a, x, &mut sum);
    sum[0]
}

/// Returns Σ a x in independent partial sums.
fn short_product<T: Scalar>(a: &[T], x: &[f64]) -> f64 {
    const N: usize = 4;
    let ((a, a_rest), (x, x_rest)) = (a.as_chunks::<N>(), x.as_chunks::<N>());
    let mut sums = [0.0; N];
    for (a, x) in a.iter().zip(x) {
        for k in 0..N {
            sums[k] += a[k].to_f64() * x[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(x_rest).map(|(a, x)| a.to_f64() * x).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::kernel::lanes::tests::numbers;

    #[test]
    fn products_are_sums_of_all_terms_however_many_there_are() {
        for n in [0, 1, 5, 31, 32, 33, 100, 1000] {
            let (a, x) = (numbers(n, 1), numbers(n, 2));
            let narrow: Vec<f64> = a.iter().map(|&value| f32::from_f64(value).into()).collect();
            for (row, values) in [(Coefficients::exact(&a), &a), (Coefficients::rounded(&a), &narrow)] {
                assert_eq!((row.len(), row.is_long()), (n, n >= 32));
                let mut n_visited = 0;
                row.for_each(|k, value| {
                    assert_eq!((k, value.to_bits()), (n_visited, values[k].to_bits()));
                    assert_eq!(row.get(k), Some(value));
                    n_visited += 1;
                });
                assert_eq!((n_visited, row.get(n)), (n, None));
                for first in [0, n / 3, n] {
                    let terms = values[first..].iter().zip(&x);
                    let expected: f64 = terms.map(|(a, x)| a * x).sum();
                    // Terms of one sign: n roundings of at most 1.1e-16 of the sum each.
                    let tolerance = n as f64 * f64::EPSILON * expected;
                    let x = &x[..n - first];
                    assert!((row.product(first..n, x) - expected).abs() <= tolerance, "{n} {first}");
                    for product in products([(&row, first); 4], x) {
                        assert!((product - expected).abs() <= tolerance, "{n} {first}");
                        // The order of the additions is the same.
                        assert!(n - first < SHORT || product.to_bits() == row.product(first..n, x).to_bits());
                    }
                }
            }
        }
    }

    #[test]
    fn rows_of_both_kinds_are_multiplied_together() {
        let (a, x) = (numbers(100, 1), numbers(100, 2));
        let (double, single) = (Coefficients::exact(&a), Coefficients::rounded(&a));
        let [p, q, r, s] = products([(&double, 0), (&single, 0), (&double, 50), (&double, 0)], &x);
        assert_eq!(p.to_bits(), s.to_bits());
        assert!((p - q).abs() <= 6e-8 * p && p.to_bits() != q.to_bits() && r < p);
    }
}
