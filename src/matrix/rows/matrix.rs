//! A matrix in tiles of rows, in memory.

use std::ops::Range;
use std::sync::Arc;

use super::choose::store;
use super::store::Store;
use crate::matrix::backend::{Backend, share_of};
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

impl Rows {
    /// Returns the rows of each task of a pass, with the number of their tile.
    fn tasks(&self, n_rows: usize) -> Vec<(usize, Range<usize>)> {
        let mut tasks = Vec::with_capacity(n_rows / ROWS_PER_TASK + self.tiles.len());
        for (k, &first) in self.first_rows.iter().enumerate() {
            let end = self.first_rows.get(k + 1).copied().unwrap_or(n_rows);
            let starts = (first..end).step_by(ROWS_PER_TASK);
            tasks.extend(starts.map(|begin| (k, begin..end.min(begin + ROWS_PER_TASK))));
        }
        tasks
    }

    /// Sets `y` to the products of the rows of some tasks with x.
    fn apply_tasks(&self, tasks: &[(usize, Range<usize>)], x: &Block, y: &mut [f64]) {
        let planes = Planes::of(x);
        let mut rest = y;
        let mut with_sums = Vec::with_capacity(tasks.len());
        for (k, rows) in tasks {
            let (sums, after) = rest.split_at_mut(rows.len() * x.n_channels());
            rest = after;
            with_sums.push((&self.tiles[*k], rows.start - self.first_rows[*k], rows.start, sums));
        }
        let n_terms = x.n_channels() * self.tiles.iter().map(|tile| tile.n_stored()).sum::<usize>();
        let pay = threads::pay_for_pass(n_terms, self.pass_byte());
        threads::for_each(pay, with_sums, |(tile, row, i, sums)| {
            tile.apply(row, i, x, &planes, sums);
        });
    }
}

impl Backend for Rows {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (tile, row) = self.locate(i);
        tile.for_each(row, columns, visit);
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        self.apply_tasks(&self.tasks(x.n_rows()), x, y.values_mut());
    }

    fn share_of_pass(&self, x: &Block, rank: usize, n_ranks: usize) -> Vec<f64> {
        let tasks = self.tasks(x.n_rows());
        let own = &tasks[share_of(tasks.len(), rank, n_ranks)];
        let mut sums = vec![0.0; own.iter().map(|(_, rows)| rows.len()).sum::<usize>() * x.n_channels()];
        self.apply_tasks(own, x, &mut sums);
        sums
    }

    fn end_pass(&self, shares: &[f64], y: &mut Block) {
        y.values_mut().copy_from_slice(shares);
    }

    fn pass_byte(&self) -> usize {
        self.tiles.iter().map(|tile| tile.pass_byte()).sum()
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
