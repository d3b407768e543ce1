//! The coarsest level, solved directly.

use faer::{Mat, Par};

use super::matrices::Matrix;
use crate::solver::lu::Lu;

/// Added to the diagonal of I − K, so that enclosures that lose no light are not singular: what does not shine in there stays 0, and a loss of
/// 1e-8 is still solved for to 1e-6 of itself.
const SHIFT: f64 = 1e-14;

/// I − K of one channel, factored.
pub(super) struct Factored(Lu);

impl Factored {
    /// One thread does it all: there are few patches.
    pub(super) fn new(matrix: &Matrix, channel: usize) -> Self {
        let n = matrix.n_rows();
        let system = Mat::from_fn(n, n, |i, j| {
            let identity = if i == j { 1.0 + SHIFT } else { 0.0 };
            identity - matrix.at(i, j, channel)
        });
        Self(Lu::new(system, Par::Seq))
    }

    /// Replaces f by (I − K)⁻¹ f.
    pub(super) fn solve(&self, f: &mut [f64]) {
        self.0.solve_vector(f);
    }

    /// Returns the multiplications of one solve.
    pub(super) fn multiply_adds(&self) -> f64 {
        (self.0.n() as f64).powi(2)
    }

    /// Returns the multiplications of the factorisation, n³ / 3.
    pub(super) fn setup_multiply_adds(&self) -> f64 {
        (self.0.n() as f64).powi(3) / 3.0
    }
}
