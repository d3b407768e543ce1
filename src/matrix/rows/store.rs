//! The interface of the layouts of a tile of rows, the precision of the numbers, and the sums over a row.

use std::fmt::Debug;
use std::ops::Range;

use crate::matrix::backend::Sizes;
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::scalar::{Scalar, rounded};
use crate::matrix::operator::Block;
use crate::matrix::tile::{Entry, is_zero};

/// The numbers of a few consecutive rows, in some layout. Rows are counted from the tile's first.
pub(in crate::matrix) trait Store: Debug + Send + Sync {
    /// Calls `visit(column, number, standard error)` in ascending order for all of `columns` where one of the two is not zero.
    fn for_each(&self, row: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64));

    /// Adds Σ_{j ≠ `diagonal`} a_j x_j over the row to `sum` and returns a_`diagonal`.
    fn dot_off_diagonal(&self, row: usize, diagonal: usize, x: &Block, sum: &mut [f64]) -> f64;

    /// Sets `y` (row-major, one entry per channel) to the products of as many rows with `x`, from the row `row` on.
    fn apply(&self, row: usize, x: &Planes, y: &mut [f64]);

    /// Adds `factor` a_j to `sum[j]` over the row, and returns the count of the row's stored numbers.
    fn add_row(&self, row: usize, factor: f64, sum: &mut [f64]) -> usize {
        let mut n_stored = 0;
        self.for_each(row, 0..sum.len(), &mut |j, value, _| {
            sum[j] += factor * value;
            n_stored += 1;
        });
        n_stored
    }

    /// Returns the number of stored numbers, zeros of a dense tile included.
    fn n_stored(&self) -> usize;

    /// Returns what the numbers take.
    fn sizes(&self) -> Sizes;
}

/// The numbers of listed entries and their standard errors, entry by entry.
#[derive(Debug)]
pub(in crate::matrix) struct Numbers<T> {
    pub(in crate::matrix) values: Vec<T>,
    /// As `values`, up to the last that is not zero.
    std_errors: Vec<f32>,
    n_nonzero: usize,
}

impl<T: Scalar> Numbers<T> {
    /// Returns an empty list with this capacity.
    pub(in crate::matrix) fn with_capacity(n_values: usize) -> Self {
        Self {
            values: Vec::with_capacity(n_values),
            std_errors: Vec::new(),
            n_nonzero: 0,
        }
    }

    /// Adds an entry of a row of an n by n matrix; returns whether it is nonzero in the precision.
    pub(in crate::matrix) fn push(&mut self, row: usize, entry: Entry, n: usize) -> Result<bool, MatrixError> {
        let (value, std_error) = rounded::<T>(row, entry, n)?;
        let (has_value, has_error) = (!is_zero(value.to_f64()), std_error > 0.0);
        if has_error {
            self.std_errors.resize(self.values.len(), 0.0);
            self.std_errors.push(std_error);
        }
        if has_value || has_error {
            self.values.push(value);
            self.n_nonzero += usize::from(has_value);
        }
        Ok(has_value || has_error)
    }

    /// Returns a number and its standard error.
    pub(in crate::matrix) fn at(&self, place: usize) -> (f64, f64) {
        let std_error = self.std_errors.get(place).map_or(0.0, |&error| f64::from(error));
        (self.values[place].to_f64(), std_error)
    }

    /// Returns what the numbers take, beside `place_byte` bytes of their places.
    pub(in crate::matrix) fn sizes_beside(&self, place_byte: usize) -> Sizes {
        let pass_byte = place_byte + size_of_val(self.values.as_slice());
        Sizes {
            n_nonzero: self.n_nonzero,
            pass_byte,
            stored_byte: pass_byte + size_of_val(self.std_errors.as_slice()),
        }
    }
}
