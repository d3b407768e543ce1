//! Dense LU factorisation, for `direct` and for the coarsest level of `multigrid`.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::perm::PermRef;
use faer::{Mat, MatMut, Par};

/// P M = L U of a square matrix, with partial pivoting in f64.
///
/// The sums are divided into the parts that `par` says, whatever the number of threads: equal parts give equal bytes.
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
