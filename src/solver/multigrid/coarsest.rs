//! The coarsest level, solved directly.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::{factor, solve};
use faer::perm::PermRef;
use faer::{Mat, MatMut, Par};

use super::matrices::Matrix;

/// Added to the diagonal of I − K, so that enclosures that lose no light are not singular: what does not shine in there stays 0, and a loss of
/// 1e-8 is still solved for to 1e-6 of itself.
const SHIFT: f64 = 1e-14;

/// I − K of one channel, factored as P L U (partial pivoting).
pub(super) struct Factored {
    n: usize,
    /// L below the diagonal, U on and above.
    lu: Mat<f64>,
    forward: Vec<usize>,
    backward: Vec<usize>,
}

impl Factored {
    /// One thread does it all: the sums do not depend on how many there are.
    pub(super) fn new(matrix: &Matrix, channel: usize) -> Self {
        let n = matrix.n_rows();
        let mut lu = Mat::from_fn(n, n, |i, j| {
            let identity = if i == j { 1.0 + SHIFT } else { 0.0 };
            identity - matrix.at(i, j, channel)
        });
        let (mut forward, mut backward) = (vec![0; n], vec![0; n]);
        let scratch = factor::lu_in_place_scratch::<usize, f64>(n, n, Par::Seq, faer::Spec::default());
        let _ = factor::lu_in_place(
            lu.as_mut(),
            &mut forward,
            &mut backward,
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            faer::Spec::default(),
        );
        Self {
            n,
            lu,
            forward,
            backward,
        }
    }

    /// Replaces f by (I − K)⁻¹ f.
    pub(super) fn solve(&self, f: &mut [f64]) {
        let scratch = solve::solve_in_place_scratch::<usize, f64>(self.n, 1, Par::Seq);
        solve::solve_in_place(
            self.lu.as_ref(),
            self.lu.as_ref(),
            PermRef::new_checked(&self.forward, &self.backward, self.n),
            MatMut::from_column_major_slice_mut(f, self.n, 1),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
    }

    /// Returns the multiplications of one solve.
    pub(super) fn multiply_adds(&self) -> f64 {
        (self.n * self.n) as f64
    }

    /// Returns the multiplications of the factorisation, n³ / 3.
    pub(super) fn setup_multiply_adds(&self) -> f64 {
        (self.n as f64).powi(3) / 3.0
    }
}
