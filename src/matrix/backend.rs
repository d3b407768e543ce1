//! The interface of all storages of form factors.

use std::fmt::Debug;
use std::iter::Sum;
use std::ops::Range;
use std::sync::Arc;

use super::choice::Place;
use super::error::{DiskError, MatrixError};
use super::operator::Block;
use super::tile::{Entry, RowTile, index};

/// What stored entries take, each counted once where ranks store parts.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::matrix) struct Sizes {
    /// The number of nonzero entries.
    pub(in crate::matrix) n_nonzero: usize,
    /// The bytes that a pass reads.
    pub(in crate::matrix) pass_byte: usize,
    /// The bytes of numbers and standard errors, in memory or on the disk.
    pub(in crate::matrix) stored_byte: usize,
}

impl Sum for Sizes {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), |a, b| Self {
            n_nonzero: a.n_nonzero.saturating_add(b.n_nonzero),
            pass_byte: a.pass_byte.saturating_add(b.pass_byte),
            stored_byte: a.stored_byte.saturating_add(b.stored_byte),
        })
    }
}

/// A stored n by n matrix F, of any layout, precision and place.
///
/// F_ij is the number stored for (i, j), times f_i where there are [`row_factors`](Self::row_factors). Products are
/// products with F. Where a disk cannot be read, numbers are NaN from then on, and [`failure`](Self::failure) returns the reason.
pub(in crate::matrix) trait Backend: Debug + Send + Sync {
    /// Calls `visit(j, number, standard error)` in ascending order for all j in `columns` where row i has an entry, without the factor of the row.
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64));

    /// Computes y = F x.
    fn apply(&self, x: &Block, y: &mut Block);

    /// Adds Σ_{j ≠ i} F_ij x_j to `sum` and returns F_ii.
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64;

    /// Adds `factor` F_ij to `sum[j]` for every j, and returns the number of entries visited.
    fn add_row(&self, i: usize, factor: f64, sum: &mut [f64]) -> usize {
        let row_factor = factor * self.row_factors().map_or(1.0, |factors| factors[i]);
        let mut n_entries = 0;
        self.for_each(i, 0..sum.len(), &mut |j, value, _| {
            sum[j] += row_factor * value;
            n_entries += 1;
        });
        n_entries
    }

    /// Returns the columns `range` in `rows` as sorted lists of their entries, without the factors of the rows.
    fn columns(&self, range: Range<usize>, rows: Range<usize>) -> Vec<Vec<Entry>> {
        let mut columns = vec![Vec::new(); range.len()];
        for j in rows {
            self.for_each(j, range.clone(), &mut |i, value, std_error| {
                columns[i - range.start].push((index(j), value, std_error));
            });
        }
        columns
    }

    /// Returns f_i = max A / A_i for every row if the numbers s_ij = A_i F_ij / max A are stored, which are symmetric to the last bit.
    fn row_factors(&self) -> Option<&[f64]> {
        None
    }

    /// Returns the matrix with d_i s_ij d_j in place of s_ij; standard errors are scaled alike, and the steps of the numbers added to them.
    ///
    /// # Errors
    /// [`MatrixError::NotSymmetric`] where F itself is stored; [`MatrixError::Value`], [`MatrixError::Disk`].
    fn scaled(&self, _d: &[f64]) -> Result<Arc<dyn Backend>, MatrixError> {
        Err(MatrixError::NotSymmetric)
    }

    /// Returns what the entries take, those that other ranks store included.
    fn sizes(&self) -> Sizes;

    /// Returns the rows of which this rank stores every number; `None` where it stores all rows.
    ///
    /// Where it does not, [`for_each`](Self::for_each) visits the entries of other rows that it stores, and [`apply`](Self::apply) is collective.
    fn held_rows(&self) -> Option<Range<usize>> {
        None
    }

    /// Returns the matrix with all rows; `None` where it has all already. Collective.
    fn whole(&self) -> Option<Arc<dyn Backend>> {
        None
    }

    /// Returns the place of the numbers.
    fn place(&self) -> Place<'_> {
        Place::default()
    }

    /// Returns the first failure to read numbers.
    fn failure(&self) -> Option<&DiskError> {
        None
    }
}

/// A matrix whose rows come in order.
pub(in crate::matrix) trait Filling {
    /// Stores the next rows, if they are this rank's: on a disk [`SIDE`](super::kernel::sizes::SIDE) of them, the last ones of the matrix maybe fewer.
    fn push(&mut self, tile: &RowTile) -> Result<(), MatrixError>;

    /// Ends the matrix. Collective where ranks store parts.
    fn finish(self: Box<Self>) -> Arc<dyn Backend>;
}
