//! Rows of F beside the same rows of its transpose, block by block, so that each pass over F reads memory in order.

use std::ops::Range;

use super::choice::Place;
use super::form_factors::FormFactors;
use super::kernel::sizes::SIDE;
use super::tile::Entry;
use crate::matrix::tile::index;

/// Rows that are transposed at a time, at least: a few cache lines of every row of F.
const BLOCK_ROWS: usize = 32;

/// More are where they have no more entries than this together, so that the look into each row of F is worth it: 12 MB for each thread.
const BLOCK_ENTRIES: f64 = 524_288.0;

/// But no fewer blocks than these, for the threads.
const MIN_BLOCKS: usize = 64;

/// One place of F and its mirror image: (F_ij, standard error) and (F_ji, standard error).
pub(crate) struct Pair {
    pub(crate) there: (f64, f64),
    pub(crate) back: (f64, f64),
}

impl FormFactors {
    /// Returns the ranges of this rank's rows in which the transpose is best asked for.
    pub(crate) fn row_blocks(&self) -> Vec<Range<usize>> {
        let own = self.own_rows();
        // On a disk, rows are best read together with those of their tiles.
        let n_together = match self.storage().place {
            Place::Memory { .. } => self.rows_of_block(),
            Place::Disk(_) => SIDE,
        };
        let starts = own.clone().step_by(n_together);
        starts.map(|start| start..own.end.min(start + n_together)).collect()
    }

    fn rows_of_block(&self) -> usize {
        let n = self.n_rows();
        let per_row = (self.density() * n as f64).max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 1 to BLOCK_ENTRIES"
        )]
        let fitting = (BLOCK_ENTRIES / per_row) as usize;
        fitting.min(n / MIN_BLOCKS).max(BLOCK_ROWS)
    }

    /// Calls `visit(i, j, pair)` for all i in `rows` and all j from `first_column` on where F_ij or F_ji is stored, row by row in
    /// ascending order.
    pub(crate) fn for_each_pair(
        &self,
        rows: Range<usize>,
        first_column: usize,
        mut visit: impl FnMut(usize, usize, Pair),
    ) {
        let others = first_column..self.n_rows();
        if let Some(row_factors) = self.entries.row_factors() {
            for i in rows {
                self.for_each_number(i, others.clone(), &mut |j, value, std_error| {
                    let scaled = |factor: f64| (factor * value, factor * std_error);
                    let (there, back) = (scaled(row_factors[i]), scaled(row_factors[j]));
                    visit(i, j, Pair { there, back });
                });
            }
            return;
        }
        let columns = self.entries.columns(rows.clone(), others.clone());
        let mut row = Vec::new();
        for (i, column) in rows.zip(columns) {
            row.clear();
            self.entries.for_each(i, others.clone(), &mut |j, value, std_error| {
                row.push((index(j), value, std_error));
            });
            merge(&row, &column, |j, pair| visit(i, j, pair));
        }
    }
}

fn merge(mut row: &[Entry], mut column: &[Entry], mut visit: impl FnMut(usize, Pair)) {
    let take = |list: &mut &[Entry], j: u32| match list.split_first() {
        Some((&(k, value, std_error), rest)) if k == j => {
            *list = rest;
            (value, std_error)
        }
        _ => (0.0, 0.0),
    };
    while let Some(j) = row.first().into_iter().chain(column.first()).map(|entry| entry.0).min() {
        let (there, back) = (take(&mut row, j), take(&mut column, j));
        visit(j as usize, Pair { there, back });
    }
}
