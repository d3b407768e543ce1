//! The coarsest level, solved directly.

use super::matrices::Matrix;
use crate::solver::lu::{Dense, Lu};

/// A shift of the diagonal of I − K, so that enclosures that lose no light are not singular.
///
/// In a dark enclosure the solution stays 0, and a loss of 1e-8 is still solved for to 1e-6 of itself.
const SHIFT: f64 = 1e-14;

/// I − K of one channel, ready to be solved.
pub(super) enum Factored {
    /// For patches that do not exchange light, such as sets of patches: there may be as many as there are patches.
    Diagonal(Vec<f64>),
    /// For all others.
    Full(Lu),
}

impl Factored {
    pub(super) fn new(matrix: &Matrix, channel: usize) -> Self {
        let n = matrix.n_rows();
        let entry = |i: usize, j: usize| {
            let identity = if i == j { 1.0 + SHIFT } else { 0.0 };
            identity - matrix.at(i, j, channel)
        };
        if matrix.is_diagonal() {
            return Self::Diagonal((0..n).map(|i| entry(i, i)).collect());
        }
        Self::Full(Lu::new(Dense::from_fn(n, entry)))
    }

    /// Replaces f by (I − K)⁻¹ f.
    pub(super) fn solve(&self, f: &mut [f64]) {
        match self {
            Self::Diagonal(diagonal) => f.iter_mut().zip(diagonal).for_each(|(f, d)| *f /= d),
            Self::Full(lu) => lu.solve(f),
        }
    }

    /// Returns the multiplications of one solve.
    pub(super) fn multiply_adds(&self) -> f64 {
        match self {
            Self::Diagonal(diagonal) => diagonal.len() as f64,
            Self::Full(lu) => (lu.n() as f64).powi(2),
        }
    }

    /// Returns the multiplications of the factorisation, n³ / 3.
    pub(super) fn setup_multiply_adds(&self) -> f64 {
        match self {
            Self::Diagonal(_) => 0.0,
            Self::Full(lu) => (lu.n() as f64).powi(3) / 3.0,
        }
    }
}
