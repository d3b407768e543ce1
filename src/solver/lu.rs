//! Dense LU factorisation, for `direct` and for the coarsest level of `multigrid`.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::perm::PermRef;
use faer::{Mat, MatMut, Par};

/// The number of rows up to which plain substitution takes less time than the preparation of a better method.
const SMALL: usize = 32;

/// P M = L U of a square matrix, with partial pivoting in f64.
///
/// The sums are divided into the parts of `par`, whatever the number of threads: equal parts give equal bytes.
pub(super) struct Lu {
    /// L below the diagonal, U on and above it.
    packed: Mat<f64>,
    permutation: Vec<usize>,
    inverse: Vec<usize>,
    par: Par,
}

impl Lu {
    /// Factors in place of `matrix`, \[n, n\]; n³ / 3 multiplications.
    pub(super) fn new(mut matrix: Mat<f64>, par: Par) -> Self {
        let n = matrix.nrows();
        let (mut permutation, mut inverse) = (vec![0; n], vec![0; n]);
        let scratch = factor::lu_in_place_scratch::<usize, f64>(n, n, par, faer::Spec::default());
        let _ = factor::lu_in_place(
            matrix.as_mut(),
            &mut permutation,
            &mut inverse,
            par,
            MemStack::new(&mut MemBuffer::new(scratch)),
            faer::Spec::default(),
        );
        Self {
            packed: matrix,
            permutation,
            inverse,
            par,
        }
    }

    /// Returns n.
    pub(super) fn n(&self) -> usize {
        self.packed.nrows()
    }

    /// x ← M⁻¹ x for one vector; `x`: \[n\].
    pub(super) fn solve_vector(&self, x: &mut [f64]) {
        let n = self.n();
        if n > SMALL {
            return self.solve(MatMut::from_column_major_slice_mut(x, n, 1));
        }
        let mut y = [0.0; SMALL];
        for (y_i, &row) in y.iter_mut().zip(&self.permutation) {
            *y_i = x[row];
        }
        for j in 0..n {
            let y_j = y[j];
            let below = self.packed.col_as_slice(j)[j + 1..].iter();
            y[j + 1..n].iter_mut().zip(below).for_each(|(y_i, l)| *y_i -= l * y_j);
        }
        for j in (0..n).rev() {
            let column = self.packed.col_as_slice(j);
            y[j] /= column[j];
            let y_j = y[j];
            y[..j].iter_mut().zip(column).for_each(|(y_i, u)| *y_i -= u * y_j);
        }
        x.copy_from_slice(&y[..n]);
    }

    /// x ← M⁻¹ x, column by column; `x`: \[n, k\].
    pub(super) fn solve(&self, x: MatMut<f64>) {
        let n = self.n();
        let scratch = solve::solve_in_place_scratch::<usize, f64>(n, x.ncols(), self.par);
        solve::solve_in_place(
            self.packed.as_ref(),
            self.packed.as_ref(),
            PermRef::new_checked(&self.permutation, &self.inverse, n),
            x,
            self.par,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vector_is_solved_for_as_a_matrix_is() {
        for n in [1, 2, 6, SMALL, SMALL + 1] {
            // The rows need exchanging, as the diagonal is not the greatest.
            let entry = |i: usize, j: usize| {
                ((i * 31 + j * 17 + i * j) % 13) as f64 + if (i + 1) % n == j { 40.0 } else { 0.0 }
            };
            let lu = Lu::new(Mat::from_fn(n, n, entry), Par::Seq);
            let x: Vec<f64> = (0..n).map(|k| 1.0 + k as f64).collect();
            let image = |i: usize| (0..n).map(|j| entry(i, j) * x[j]).sum::<f64>();
            let mut found: Vec<f64> = (0..n).map(image).collect();
            let mut expected = found.clone();
            lu.solve_vector(&mut found);
            lu.solve(MatMut::from_column_major_slice_mut(&mut expected, n, 1));
            for ((a, b), wanted) in found.iter().zip(&expected).zip(&x) {
                // Condition numbers of some hundred, times the roundings of n terms.
                assert!(
                    (a - b).abs() < 1e-11 * wanted && (a - wanted).abs() < 1e-11 * wanted,
                    "{n}: {a} {b} {wanted}"
                );
            }
        }
    }
}
