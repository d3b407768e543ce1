//! Solutions with the factors, for a few vectors at once.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

/// Columns of the matrix that are taken at once: as many streams as processors read well.
pub(super) const STEP: usize = 8;

/// The number of rows up to which all columns are taken one by one.
pub(super) const SMALL: usize = 32;

/// Vectors that pass over the matrix together.
pub(super) const TOGETHER: usize = 4;

/// Replaces x by U⁻¹ L⁻¹ P x; `lu`: \[n, n\], `x`: \[n, k\], one vector after the other.
pub(super) fn solve(lu: &[f64], exchanges: &[usize], x: &mut [f64], arch: Arch) {
    let n = exchanges.len();
    for x in x.chunks_exact_mut(n) {
        super::update::exchange(x, 0, exchanges);
    }
    for x in x.chunks_mut(TOGETHER * n) {
        match x.len() / n {
            1 => arch.dispatch(Substitution::<1> { lu, n, x }),
            2 => arch.dispatch(Substitution::<2> { lu, n, x }),
            3 => arch.dispatch(Substitution::<3> { lu, n, x }),
            _ => arch.dispatch(Substitution::<TOGETHER> { lu, n, x }),
        }
    }
}

/// Forward and back substitution of K vectors.
struct Substitution<'a, const K: usize> {
    lu: &'a [f64],
    n: usize,
    x: &'a mut [f64],
}

impl<const K: usize> WithSimd for Substitution<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { lu, n, x } = self;
        let step = if n <= SMALL { SMALL } else { STEP };
        for begin in (0..n).step_by(step) {
            let end = n.min(begin + step);
            for x in x.chunks_exact_mut(n) {
                for j in begin..end {
                    let (solved, below) = x[..end].split_at_mut(j + 1);
                    subtract(below, solved[j], &lu[j * n + j + 1..j * n + end]);
                }
            }
            if end < n {
                subtract_columns::<K>(lu, n, begin, end..n, x);
            }
        }
        for end in (1..=n).rev().step_by(step) {
            let begin = end.saturating_sub(step);
            for x in x.chunks_exact_mut(n) {
                for j in (begin..end).rev() {
                    let (above, solved) = x.split_at_mut(j);
                    solved[0] /= lu[j * n + j];
                    subtract(&mut above[begin..], solved[0], &lu[j * n + begin..j * n + j]);
                }
            }
            if begin > 0 {
                subtract_columns::<K>(lu, n, begin, 0..begin, x);
            }
        }
    }
}

/// Subtracts `factor` times part of a column.
#[inline(always)]
fn subtract(x: &mut [f64], factor: f64, column: &[f64]) {
    for (x, m) in x.iter_mut().zip(column) {
        *x = m.mul_add(-factor, *x);
    }
}

/// Subtracts the products of [`STEP`] columns with their unknowns from other rows.
///
/// The columns begin at `first` and are taken in ascending order.
#[inline(always)]
fn subtract_columns<const K: usize>(lu: &[f64], n: usize, first: usize, rows: Range<usize>, x: &mut [f64]) {
    let columns: [&[f64]; STEP] = std::array::from_fn(|j| &lu[(first + j) * n..][rows.clone()]);
    let mut factors = [[0.0; STEP]; K];
    let mut vectors = x.chunks_exact_mut(n);
    let mut x: [&mut [f64]; K] = std::array::from_fn(|k| {
        let x = vectors.next().unwrap_or_default();
        for (factor, x) in factors[k].iter_mut().zip(&x[first..]) {
            *factor = -x;
        }
        &mut x[rows.clone()]
    });
    for i in 0..rows.len() {
        for (x, factors) in x.iter_mut().zip(&factors) {
            let mut sum = x[i];
            for (column, factor) in columns.iter().zip(factors) {
                sum = column[i].mul_add(*factor, sum);
            }
            x[i] = sum;
        }
    }
}
