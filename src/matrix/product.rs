//! Products with the form factors, and their rows, for solvers.

use super::components;
use super::error::DiskError;
use super::form_factors::FormFactors;
use super::operator::{Block, Components, LinearOperator, RowAccess};

/// Applies F: y_ic = Σ_j F_ij x_jc.
///
/// Rows, and tiles of a symmetric matrix, are shared out to threads, and what belongs together is summed in a fixed order: the
/// result is the same bytes at any number of threads and with any instruction set (AVX-512, AVX2 or less, chosen at run time), and
/// in each channel the same as if it were alone. Accuracy: the relative
/// rounding error is at most (max(16 n^½, n / 8) + 70) 1.1e-16 for terms of one sign, below 256 patches (n + 70) 1.1e-16: a sum has eight partial sums, or goes down the rows of a symmetric matrix, of which at most so many are taken
/// one after another.
///
/// Speed: the time of a plain read of as many bytes by the time of a pass with one channel (1 is as fast as memory), and the time of
/// three channels by that of one. f32, n = 6144, sparse (as asked for) with a quarter of the entries, in runs of 32 (those of `exact` are 20 to 40 long on average in `room-box`,
/// `corridor` and `sphere-room-r1`) or at random places, medians of 21 rounds of
/// `cargo bench --bench matrix -- f32` on two cores of a Zen 4 server processor with 32 MB of third-level cache, of which one reads 22 to 28 GB/s and two 28 to 53; the least and
/// the greatest of three such runs:
///
/// | matrix | one thread: read / pass | three channels / one | two threads: read / pass | three channels / one |
/// |---|---|---|---|---|
/// | dense, rows | 0.85 to 0.93 | 1.05 to 1.07 | 0.93 to 0.99 | 1.04 to 1.07 |
/// | dense, symmetric (half the bytes) | 0.65 to 0.74 | 1.46 to 1.48 | 0.70 to 0.73 | 1.26 to 1.66 |
/// | sparse, rows, in runs | 0.60 to 0.73 | 1.34 to 1.44 | 0.71 to 0.82 | 1.23 to 1.50 |
/// | sparse, rows, at random | 0.66 to 0.76 | 1.32 to 1.35 | 0.73 to 0.77 | 1.18 to 1.36 |
/// | sparse, symmetric (half of the bytes of rows in runs, 0.29 of those at random), in runs | 0.37 to 0.44 | 1.81 to 1.86 | 0.41 to 0.53 | 1.76 to 2.01 |
/// | sparse, symmetric, at random | 0.18 to 0.22 | 1.96 to 2.00 | 0.31 to 0.34 | 1.96 to 1.99 |
///
/// With n = 18,432, where no cache holds anything (one run): dense rows 0.87, 1.11 and 0.88, 1.13; symmetric 0.77, 1.53 and 0.87, 1.19; sparse rows in runs 0.78, 1.57 and 0.93, 1.29.
///
/// A dense symmetric pass takes 0.60 to 0.63 of the time of one over all rows on one thread, and 0.44 to 0.65 on two. Where three channels take more than 1.3 of one, multiplications bound them: two
/// for each number and channel in a symmetric matrix, of which this processor does eight a cycle, 3.9 ms on one thread at 3.65 GHz for the 18.9 million numbers and three channels here, without all that goes with them; a read of them takes 2.9 to 3.4 ms. Sparse symmetric
/// matrices are so small, 4.3 to 4.6 bytes an entry, that instructions bound even one channel: sixteen places beside one another take the same ones, some nine cycles, and with three
/// channels twenty, whether one of them has an entry or all. That is 0.40 to 0.51 ns an entry in runs and 0.83 to 0.86 at random on one thread, 0.19 to 0.28 and 0.42 to 0.44 on two; by rows, where every
/// entry is stored twice, 0.26 to 0.30 and 0.45 to 0.58, 0.14 to 0.23 and 0.23 to 0.36 for each of the two. Rows in runs are stored as such blocks of sixteen columns too, 4.5 bytes an entry, and all sparse rows in panels of columns, so that x stays
/// in the first-level cache: without these, three channels took 1.6 times as long.
///
/// On a processor with AVX-512 whose cores read less fast, before the loops had their present form (without panels, with numbers asked into the first-level cache), the same were
/// 1.05 to 1.17 and 1.05 to 1.07 for dense rows, 1.10 to 1.50 and 1.24 to 1.52 for symmetric ones, 1.13 to 1.44 and 1.36 to 1.62 for sparse rows in runs, 0.61 to 0.96 and 0.98 to 1.22 at random, and
/// 0.29 to 0.58 and 1.62 to 2.20 for sparse symmetric matrices. Passes can be faster than the read where they ask for memory before they need it, which the read leaves to the processor.
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

    fn rows(&self) -> Option<&dyn RowAccess> {
        Some(self)
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        self.is_symmetric().then_some(self.areas.as_slice())
    }

    fn components(&self) -> Option<Components> {
        Some(components::connected(self, self))
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
        self.entries.add_row(i, factor, sum)
    }

    #[track_caller]
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        assert!(
            x.n_rows() == self.n_rows() && x.n_channels() == sum.len(),
            "x has one row per patch, and sum one entry per channel"
        );
        self.entries.dot_off_diagonal(i, x, sum)
    }
}

/// Returns how many roundings a term of F x takes part in at most, n being the number of patches: see the [`LinearOperator`] of [`FormFactors`].
pub(crate) fn roundings(n: usize) -> f64 {
    let n = n as f64;
    (16.0 * n.sqrt()).max(n / 8.0).min(n) + 70.0
}
