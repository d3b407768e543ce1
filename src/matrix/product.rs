//! Products with the form factors, and their rows, for solvers.

use super::components;
use super::error::DiskError;
use super::form_factors::FormFactors;
use super::operator::{Block, Components, LinearOperator, RowAccess};
use crate::threads;

/// Applies F: y_ic = Σ_j F_ij x_jc.
///
/// Rows, and tiles of a symmetric matrix, are shared out to threads, and sums are taken in a fixed order: the
/// result is the same bytes at any number of threads and with any instruction set (AVX-512, AVX2 or less, chosen at run time), and
/// in each channel the same as if it were alone. Accuracy: the relative
/// rounding error is at most (max(16 n^½, n / 8) + 70) 1.1e-16 for terms of one sign, below 256 patches (n + 70) 1.1e-16.
/// A sum has eight partial sums, or goes down the rows of a symmetric matrix, of which at most so many are added one after another.
///
/// Speed: measured in `docs/performance.md`.
impl LinearOperator for FormFactors {
    fn n_rows(&self) -> usize {
        self.areas.len()
    }

    #[track_caller]
    fn apply(&self, x: &Block, y: &mut Block) {
        assert!(x.n_rows() == self.n_rows(), "x has one row per patch");
        assert!(
            y.n_rows() == self.n_rows() && y.n_channels() == x.n_channels(),
            "y has the shape of x"
        );
        self.entries.apply(x, y);
    }

    /// Returns access by rows; gathers them where ranks store parts.
    fn rows(&self) -> Option<&dyn RowAccess> {
        self.gather_rows();
        Some(self)
    }

    fn of_rows(&self, of_row: &(dyn Fn(&dyn RowAccess, usize) -> Vec<f64> + Sync)) -> Option<Vec<f64>> {
        let (own, n) = (self.own_rows(), self.n_rows());
        let numbers = threads::map(threads::pay(n * n), own.len(), |k| of_row(self, own.start + k));
        Some(self.gathered(numbers.concat()))
    }

    fn has_rows(&self) -> bool {
        true
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        self.is_symmetric().then_some(self.areas.as_slice())
    }

    fn components(&self) -> Option<Components> {
        Some(match self.held_rows() {
            Some(held) => self.components_of_parts(held),
            None => components::connected(self, self),
        })
    }

    fn failure(&self) -> Option<&DiskError> {
        self.failure()
    }
}

impl RowAccess for FormFactors {
    fn visit_row(&self, i: usize, visit: &mut dyn FnMut(usize, f64)) {
        self.for_each_in_row(i, |j, value, _| visit(j, value));
    }

    #[track_caller]
    fn add_row(&self, i: usize, factor: f64, sum: &mut [f64]) -> usize {
        assert_eq!(sum.len(), self.n_rows(), "one sum per column");
        self.by_rows().add_row(i, factor, sum)
    }

    #[track_caller]
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        assert!(
            x.n_rows() == self.n_rows() && x.n_channels() == sum.len(),
            "x has one row per patch, and sum one entry per channel"
        );
        self.by_rows().dot_off_diagonal(i, x, sum)
    }
}

/// Returns the most roundings in which a term of F x takes part, n being the number of patches: see the [`LinearOperator`] of [`FormFactors`].
pub(crate) fn roundings(n: usize) -> f64 {
    let n = n as f64;
    (16.0 * n.sqrt()).max(n / 8.0).min(n) + 70.0
}
