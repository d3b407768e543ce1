//! Rows stored as sorted lists of their entries (compressed sparse rows).

use std::ops::Range;

use super::gather::{SparseRows, multiply_sparse_rows};
use super::operator::Block;
use super::planes::Planes;
use super::store::{Numbers, Scalar, Store, add_dot};
use super::{MatrixError, RowTile};

/// A tile in compressed sparse rows.
#[derive(Debug)]
pub(super) struct SparseTile<T> {
    /// Row k holds the places `begins[k]..begins[k + 1]`.
    begins: Vec<usize>,
    columns: Vec<u32>,
    numbers: Numbers<T>,
}

impl<T: Scalar> SparseTile<T> {
    pub(super) fn new(tile: &RowTile, n: usize) -> Result<Self, MatrixError> {
        let size = tile.n_entries();
        let mut stored = Self {
            begins: vec![0],
            columns: Vec::with_capacity(size),
            numbers: Numbers::with_capacity(size),
        };
        for k in 0..tile.n_rows() {
            for &entry in tile.row(k) {
                if stored.numbers.push(tile.first_row() + k, entry, n)? {
                    stored.columns.push(entry.0);
                }
            }
            stored.begins.push(stored.columns.len());
        }
        Ok(stored)
    }

    /// Returns the places of a row whose columns lie in `columns`.
    fn places(&self, row: usize, columns: Range<usize>) -> Range<usize> {
        let begin = self.begins[row];
        let in_row = &self.columns[begin..self.begins[row + 1]];
        let first_from = |column: usize| begin + in_row.partition_point(|&c| (c as usize) < column);
        first_from(columns.start)..first_from(columns.end)
    }
}

impl<T: Scalar> Store for SparseTile<T> {
    fn for_each(&self, row: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        for place in self.places(row, columns) {
            let (value, std_error) = self.numbers.at(place);
            visit(self.columns[place] as usize, value, std_error);
        }
    }

    fn dot_off_diagonal(&self, row: usize, diagonal: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let on = self.places(row, diagonal..diagonal + 1);
        for part in [self.begins[row]..on.start, on.end..self.begins[row + 1]] {
            let columns = &self.columns[part.clone()];
            add_dot(
                &self.numbers.values[part],
                |k| columns[k] as usize,
                1.0,
                x.values(),
                sum,
            );
        }
        on.map(|place| self.numbers.values[place].to_f64())
            .next()
            .unwrap_or(0.0)
    }

    fn apply(&self, row: usize, _: usize, x: &Block, planes: &Planes, y: &mut [f64]) {
        let rows = SparseRows {
            begins: &self.begins[row..=row + y.len() / x.n_channels()],
            columns: &self.columns,
            values: &self.numbers.values,
        };
        multiply_sparse_rows(rows, planes, y);
    }

    fn n_stored(&self) -> usize {
        self.numbers.values.len()
    }

    fn n_nonzero(&self) -> usize {
        self.numbers.n_nonzero
    }

    fn stored_byte(&self) -> usize {
        self.pass_byte() + self.numbers.error_byte()
    }

    fn pass_byte(&self) -> usize {
        size_of_val(self.begins.as_slice()) + size_of_val(self.columns.as_slice()) + self.numbers.value_byte()
    }
}
