//! A matrix in tiles of rows, in memory.

use std::ops::Range;
use std::sync::Arc;

use super::choose::store;
use super::store::Store;
use crate::matrix::backend::Backend;
use crate::matrix::choice::StorageChoice;
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::planes::Planes;
use crate::matrix::operator::Block;
use crate::matrix::tile::RowTile;
use crate::threads;

/// Rows of y that one thread computes at a time: enough to hide the start of a task.
const ROWS_PER_TASK: usize = 16;

/// F_ij, by rows.
#[derive(Debug, Default)]
pub(in crate::matrix) struct Rows {
    tiles: Vec<Arc<dyn Store>>,
    /// The first row of each tile, ascending.
    first_rows: Vec<usize>,
}

impl Rows {
    /// Adds the next rows of an n by n matrix.
    pub(in crate::matrix) fn push(
        &mut self,
        tile: &RowTile,
        n: usize,
        choice: StorageChoice<'_>,
    ) -> Result<(), MatrixError> {
        self.tiles.push(store(tile, n, choice)?);
        self.first_rows.push(tile.first_row());
        Ok(())
    }

    /// Returns the tile of row i, and the number of the row in it.
    #[track_caller]
    fn locate(&self, i: usize) -> (&dyn Store, usize) {
        let tile = self.first_rows.partition_point(|&first| first <= i) - 1;
        (&*self.tiles[tile], i - self.first_rows[tile])
    }
}

impl Backend for Rows {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (tile, row) = self.locate(i);
        tile.for_each(row, columns, visit);
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        let (n_rows, n_channels) = (x.n_rows(), x.n_channels());
        let planes = Planes::of(x);
        let mut tasks = Vec::with_capacity(n_rows / ROWS_PER_TASK + self.tiles.len());
        let mut rest = y.values_mut();
        for (k, (tile, &first)) in self.tiles.iter().zip(&self.first_rows).enumerate() {
            let end = self.first_rows.get(k + 1).copied().unwrap_or(n_rows);
            for begin in (first..end).step_by(ROWS_PER_TASK) {
                let n_sums = ROWS_PER_TASK.min(end - begin);
                let (sums, after) = rest.split_at_mut(n_sums * n_channels);
                rest = after;
                tasks.push((tile, begin - first, begin, sums));
            }
        }
        let n_terms = n_channels * self.tiles.iter().map(|tile| tile.n_stored()).sum::<usize>();
        let n_byte = self.tiles.iter().map(|tile| tile.pass_byte()).sum();
        threads::for_each(threads::pay_for_pass(n_terms, n_byte), tasks, |(tile, row, i, sums)| {
            tile.apply(row, i, x, &planes, sums);
        });
    }

    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let (tile, row) = self.locate(i);
        tile.dot_off_diagonal(row, i, x, sum)
    }

    fn add_row(&self, i: usize, factor: f64, sum: &mut [f64]) -> usize {
        let (tile, row) = self.locate(i);
        tile.add_row(row, factor, sum)
    }

    fn n_nonzero(&self) -> usize {
        self.tiles.iter().map(|tile| tile.n_nonzero()).sum()
    }

    fn stored_byte(&self) -> usize {
        self.tiles.iter().map(|tile| tile.stored_byte()).sum()
    }
}
