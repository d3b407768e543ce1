//! Rows stored as sorted lists of their entries (compressed sparse rows).

use std::ops::Range;

use super::gather::{SparseRows, multiply_sparse_rows};
use super::panels::Panels;
use super::store::{Numbers, Store};
use crate::matrix::backend::Sizes;
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::dot::add_dot;
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::scalar::Scalar;
use crate::matrix::operator::Block;
use crate::matrix::tile::RowTile;

/// A tile in compressed sparse rows.
#[derive(Debug)]
pub(in crate::matrix) struct SparseTile<T> {
    panels: Panels,
    /// Part k of a row holds the places `begins[k]..begins[k + 1]`.
    begins: Vec<usize>,
    columns: Vec<u32>,
    numbers: Numbers<T>,
}

impl<T: Scalar> SparseTile<T> {
    pub(in crate::matrix) fn new(tile: &RowTile, n: usize) -> Result<Self, MatrixError> {
        let size = tile.n_entries();
        let panels = Panels::new(tile.n_rows(), n, size, ENTRIES_OF_PART);
        let mut stored = Self {
            panels,
            begins: Vec::with_capacity(panels.all().len() * tile.n_rows() + 1),
            columns: Vec::with_capacity(size),
            numbers: Numbers::with_capacity(size),
        };
        stored.begins.push(0);
        for (k, part) in panels.parts(tile) {
            for &entry in part {
                if stored.numbers.push(tile.first_row() + k, entry, n)? {
                    stored.columns.push(entry.0);
                }
            }
            stored.begins.push(stored.columns.len());
        }
        Ok(stored)
    }

    /// Returns the places of the part of a row in a panel.
    fn part(&self, panel: usize, row: usize) -> Range<usize> {
        let part = self.panels.place(panel, row);
        self.begins[part]..self.begins[part + 1]
    }

    /// Returns those of some positions whose columns lie in `columns`.
    fn within(&self, places: Range<usize>, columns: Range<usize>) -> Range<usize> {
        let of_part = &self.columns[places.clone()];
        let first_from = |column: usize| places.start + of_part.partition_point(|&c| (c as usize) < column);
        first_from(columns.start)..first_from(columns.end)
    }
}

/// The least average number of entries of a part of a row.
const ENTRIES_OF_PART: usize = 64;

impl<T: Scalar> Store for SparseTile<T> {
    fn for_each(&self, row: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        for panel in self.panels.with(&columns) {
            for place in self.within(self.part(panel, row), columns.clone()) {
                let (value, std_error) = self.numbers.at(place);
                visit(self.columns[place] as usize, value, std_error);
            }
        }
    }

    fn dot_off_diagonal(&self, row: usize, diagonal: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let mut add = |places: Range<usize>| {
            let columns = &self.columns[places.clone()];
            let values = &self.numbers.values[places];
            add_dot(values, |k| columns[k] as usize, 1.0, x.values(), sum);
        };
        let (mut on_diagonal, with_diagonal) = (0.0, self.panels.of(diagonal));
        for panel in self.panels.all() {
            let part = self.part(panel, row);
            if panel == with_diagonal {
                let on = self.within(part.clone(), diagonal..diagonal + 1);
                add(part.start..on.start);
                add(on.end..part.end);
                on_diagonal = on
                    .map(|place| self.numbers.values[place].to_f64())
                    .next()
                    .unwrap_or(0.0);
            } else {
                add(part);
            }
        }
        on_diagonal
    }

    fn apply(&self, row: usize, planes: &Planes, y: &mut [f64]) {
        let rows = SparseRows {
            panels: self.panels,
            first_row: row,
            begins: &self.begins,
            columns: &self.columns,
            values: &self.numbers.values,
        };
        multiply_sparse_rows(rows, planes, y);
    }

    fn n_stored(&self) -> usize {
        self.numbers.values.len()
    }

    fn sizes(&self) -> Sizes {
        self.numbers
            .sizes_beside(size_of_val(self.begins.as_slice()) + size_of_val(self.columns.as_slice()))
    }
}
