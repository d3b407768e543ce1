//! A matrix in tiles of rows, in memory; each of several ranks stores a part.

use std::ops::Range;
use std::sync::Arc;

use super::choose::store;
use super::store::Store;
use crate::matrix::backend::{Backend, Filling, Sizes};
use crate::matrix::choice::{Layout, Precision, StorageChoice};
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::planes::Planes;
use crate::matrix::operator::Block;
use crate::matrix::tile::RowTile;
use crate::matrix::together::{Share, stored_rows};
use crate::threads;

/// Rows of y that one thread computes at a time: enough to hide the start of a task.
const ROWS_PER_TASK: usize = 16;

/// F_ij, by rows: all of them, or those of this rank.
#[derive(Debug)]
pub(in crate::matrix) struct Rows {
    n: usize,
    layout: Layout,
    precision: Precision,
    tiles: Vec<Arc<dyn Store>>,
    /// The first row of each tile, ascending, and the end of the last.
    firsts: Vec<usize>,
    end: usize,
    /// Of several ranks, each stores the tiles in which any of its rows lie.
    share: Option<Share>,
    sizes: Sizes,
}

impl Rows {
    /// Returns an n by n matrix without rows; each of several ranks stores its own of the rows that are [pushed](Filling::push).
    pub(in crate::matrix) fn new(n: usize, choice: StorageChoice<'_>) -> Self {
        Self {
            n,
            layout: choice.layout,
            precision: choice.precision,
            tiles: Vec::new(),
            firsts: Vec::new(),
            end: 0,
            share: Share::of(n, choice),
            sizes: Sizes::default(),
        }
    }

    /// Returns the tiles whose first row is this rank's: each tile belongs to one rank.
    fn begun_here(&self) -> Range<usize> {
        let own = self.own();
        let place = |row: usize| self.firsts.partition_point(|&first| first < row);
        place(own.start)..place(own.end)
    }

    /// Returns the rows whose products are computed here.
    fn own(&self) -> Range<usize> {
        self.share.as_ref().map_or(0..self.n, |share| share.rows.clone())
    }

    /// Returns the tile of row i, and the number of the row in it, if it is stored here.
    fn locate(&self, i: usize) -> Option<(&dyn Store, usize)> {
        let tile = self.firsts.partition_point(|&first| first <= i).checked_sub(1)?;
        (i < self.end).then(|| (&*self.tiles[tile], i - self.firsts[tile]))
    }

    /// As [`locate`](Self::locate), of a row that is stored here.
    #[track_caller]
    fn located(&self, i: usize) -> (&dyn Store, usize) {
        self.locate(i).expect("a row that is stored here")
    }

    /// Returns the rows of each task of a pass, with the number of their tile.
    fn tasks(&self) -> Vec<(usize, Range<usize>)> {
        let own = self.own();
        let mut tasks = Vec::with_capacity(own.len() / ROWS_PER_TASK + self.tiles.len());
        for (k, &first) in self.firsts.iter().enumerate() {
            let end = self.firsts.get(k + 1).copied().unwrap_or(self.end).min(own.end);
            let starts = (first.max(own.start)..end).step_by(ROWS_PER_TASK);
            tasks.extend(starts.map(|begin| (k, begin..end.min(begin + ROWS_PER_TASK))));
        }
        tasks
    }
}

impl Filling for Rows {
    fn push(&mut self, tile: &RowTile) -> Result<(), MatrixError> {
        let rows = tile.first_row()..tile.first_row() + tile.n_rows();
        let is_kept = |share: &Share| rows.start < share.rows.end && share.rows.start < rows.end;
        if self.share.as_ref().is_none_or(is_kept) {
            self.tiles.push(store(tile, self.n, (self.layout, self.precision))?);
            self.firsts.push(rows.start);
            self.end = rows.end;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Arc<dyn Backend> {
        let own = self.begun_here().map(|k| self.tiles[k].sizes()).sum();
        self.sizes = self.share.as_ref().map_or(own, |share| share.add_up(own));
        Arc::from(self as Box<dyn Backend>)
    }
}

impl Backend for Rows {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        if let Some((tile, row)) = self.locate(i) {
            tile.for_each(row, columns, visit);
        }
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        let (tasks, planes, n_channels) = (self.tasks(), Planes::of(x), y.n_channels());
        let mut rest = &mut y.values_mut()[self.own().start * n_channels..];
        let mut with_sums = Vec::with_capacity(tasks.len());
        for (k, rows) in tasks {
            let (sums, after) = rest.split_at_mut(rows.len() * n_channels);
            rest = after;
            with_sums.push((&self.tiles[k], rows.start - self.firsts[k], sums));
        }
        let n_terms = n_channels * self.tiles.iter().map(|tile| tile.n_stored()).sum::<usize>();
        let pay = threads::pay_for_pass(n_terms, self.sizes.pass_byte);
        threads::for_each(pay, with_sums, |(tile, row, sums)| {
            tile.apply(row, &planes, sums);
        });
        if let Some(share) = &self.share {
            share.complete(y);
        }
    }

    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let (tile, row) = self.located(i);
        tile.dot_off_diagonal(row, i, x, sum)
    }

    fn add_row(&self, i: usize, factor: f64, sum: &mut [f64]) -> usize {
        let (tile, row) = self.located(i);
        tile.add_row(row, factor, sum)
    }

    fn sizes(&self) -> Sizes {
        self.sizes
    }

    fn held_rows(&self) -> Option<Range<usize>> {
        self.share.as_ref().map(|share| share.rows.clone())
    }

    fn whole(&self) -> Option<Arc<dyn Backend>> {
        let share = self.share.as_ref()?;
        let sent = self.begun_here().map(|k| {
            let end = self.firsts.get(k + 1).copied().unwrap_or(self.end);
            stored_rows(self, self.firsts[k]..end, |_| 0..self.n)
        });
        let mut tiles: Vec<(usize, usize, Arc<dyn Store>)> = Vec::new();
        share.exchange(sent, |came| {
            tiles.append(&mut threads::collect_from(&came, |tile| {
                let stored = store(tile, self.n, (self.layout, self.precision));
                let stored = stored.expect("what was stored is stored again");
                (tile.first_row(), tile.first_row() + tile.n_rows(), stored)
            }));
        });
        tiles.sort_unstable_by_key(|tile| tile.0);
        Some(Arc::new(Self {
            firsts: tiles.iter().map(|tile| tile.0).collect(),
            end: tiles.last().map_or(0, |tile| tile.1),
            tiles: tiles.into_iter().map(|tile| tile.2).collect(),
            share: None,
            ..*self
        }))
    }
}
