//! Rows stored in full.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::ops::Range;

use super::store::Store;
use crate::matrix::backend::Sizes;
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::aligned::Aligned;
use crate::matrix::kernel::lanes::{add_row, multiply_rows};
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::scalar::{Scalar, rounded};
use crate::matrix::operator::Block;
use crate::matrix::tile::{RowTile, is_zero};

/// A tile as a row-major array of all n columns.
#[derive(Debug)]
pub(in crate::matrix) struct DenseTile<T> {
    n_columns: usize,
    values: Aligned<T>,
    /// As `values`, or empty where every standard error is zero.
    std_errors: Vec<f32>,
    n_nonzero: usize,
}

impl<T: Scalar> DenseTile<T> {
    pub(in crate::matrix) fn new(tile: &RowTile, n: usize) -> Result<Self, MatrixError> {
        let size = tile.n_rows() * n;
        let mut values = Aligned::filled(size, T::from_f64(0.0));
        let mut std_errors = Vec::new();
        let mut n_nonzero = 0;
        for k in 0..tile.n_rows() {
            for &entry in tile.row(k) {
                let (value, std_error) = rounded::<T>(tile.first_row() + k, entry, n)?;
                let place = k * n + entry.0 as usize;
                values[place] = value;
                n_nonzero += usize::from(!is_zero(value.to_f64()));
                if std_error > 0.0 {
                    std_errors.resize(size, 0.0);
                    std_errors[place] = std_error;
                }
            }
        }
        Ok(Self {
            n_columns: n,
            values,
            std_errors,
            n_nonzero,
        })
    }

    fn row(&self, row: usize) -> &[T] {
        &self.values[row * self.n_columns..(row + 1) * self.n_columns]
    }

    fn std_error(&self, row: usize, column: usize) -> f64 {
        self.std_errors
            .get(row * self.n_columns + column)
            .map_or(0.0, |&error| f64::from(error))
    }
}

impl<T: Scalar> Store for DenseTile<T> {
    fn for_each(&self, row: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let values = &self.row(row)[columns.clone()];
        for (column, value) in columns.zip(values) {
            let (value, std_error) = (value.to_f64(), self.std_error(row, column));
            if !is_zero(value) || !is_zero(std_error) {
                visit(column, value, std_error);
            }
        }
    }

    fn dot_off_diagonal(&self, row: usize, diagonal: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let values = self.row(row);
        let (before, after) = (&values[..diagonal], &values[diagonal + 1..]);
        let (x_before, x_after) = x.values().split_at(diagonal * x.n_channels());
        add_row(before, x_before, sum);
        add_row(after, &x_after[x.n_channels()..], sum);
        values[diagonal].to_f64()
    }

    fn apply(&self, row: usize, planes: &Planes, y: &mut [f64]) {
        let begin = row * self.n_columns;
        let n_values = y.len() / planes.n_channels() * self.n_columns;
        multiply_rows(&self.values[begin..begin + n_values], self.n_columns, planes, y);
    }

    fn add_row(&self, row: usize, factor: f64, sum: &mut [f64]) -> usize {
        for (sum, value) in sum.iter_mut().zip(self.row(row)) {
            *sum += factor * value.to_f64();
        }
        self.n_columns
    }

    fn n_stored(&self) -> usize {
        self.values.len()
    }

    fn sizes(&self) -> Sizes {
        let pass_byte = size_of_val(&*self.values);
        Sizes {
            n_nonzero: self.n_nonzero,
            pass_byte,
            stored_byte: pass_byte + size_of_val(self.std_errors.as_slice()),
        }
    }
}
