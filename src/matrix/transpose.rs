//! Rows of F beside the same rows of its transpose, block by block, so that each pass over F reads memory in order.

use std::borrow::Cow;
use std::ops::Range;

use super::form_factors::FormFactors;
use super::kernel::sizes::SIDE;
use super::team::rows_of;
use super::tile::{Entry, RowTally, RowTile, index};
use super::together::{decode, encode, parts, with_lengths};
use crate::threads;

/// The fewest rows that are transposed at a time: a few cache lines of every row of F.
const BLOCK_ROWS: usize = 32;

/// The entries of a larger block, at most, so that the access to each row of F is worth it: 12 MB for each thread.
const BLOCK_ENTRIES: f64 = 524_288.0;

/// The fewest blocks, for the threads.
const MIN_BLOCKS: usize = 64;

/// One place of F and its mirror image: (F_ij, standard error) and (F_ji, standard error).
pub(crate) struct Pair {
    pub(crate) there: (f64, f64),
    pub(crate) back: (f64, f64),
}

/// Entries of columns that ranks send one another at a time, where a block has fewer: some 80 MB.
pub(crate) const ENTRIES_AT_ONCE: f64 = 4_194_304.0;

/// Some rows, beside the same rows of the transpose.
pub(crate) struct RowBlock<'a> {
    factors: &'a FormFactors,
    pub(crate) rows: Range<usize>,
    /// Their columns, where other ranks store parts of them.
    columns: Option<Vec<Vec<Entry>>>,
}

impl FormFactors {
    /// Returns the results of `work` for blocks of this rank's rows, in order. Collective.
    pub(crate) fn map_row_blocks<R: Send>(&self, work: impl Fn(&RowBlock<'_>) -> R + Sync + Send) -> Vec<R> {
        if !self.needs_columns() {
            let blocks = blocks_in(self.own_rows(), self.rows_together());
            let n = self.n_rows();
            return threads::map(threads::pay(n * n), blocks.len(), |k| {
                work(&self.row_block(blocks[k].clone()))
            });
        }
        let mut all = Vec::new();
        let act = |blocks: &[RowBlock<'_>]| all.append(&mut threads::collect_from(blocks, &work));
        self.for_each_round(self.rows_together(), act);
        all
    }

    /// Returns whether entries of columns come from other ranks.
    pub(super) fn needs_columns(&self) -> bool {
        self.held_rows().is_some() && !self.is_symmetric()
    }

    /// Returns rows whose columns are stored here.
    pub(super) fn row_block(&self, rows: Range<usize>) -> RowBlock<'_> {
        let (factors, columns) = (self, None);
        RowBlock { factors, rows, columns }
    }

    /// Calls `act` with blocks of `n_together` of this rank's rows, with the columns that other ranks send. Collective.
    ///
    /// It is called equally often on each rank, without blocks on ranks that have finished.
    pub(super) fn for_each_round(&self, n_together: usize, mut act: impl FnMut(&[RowBlock<'_>])) {
        let (Some(together), Some(held)) = (&self.together, self.held_rows()) else {
            return;
        };
        let ranks = together.team.ranks();
        let n = self.n_rows();
        let of_ranks: Vec<Vec<Range<usize>>> = (0..ranks.size())
            .map(|rank| blocks_in(rows_of(n, &together.team.blocks_of(n, rank)), n_together))
            .collect();
        let per_block = (self.density() * (n * n_together) as f64).max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "up to ENTRIES_AT_ONCE"
        )]
        let n_at_once = ((ENTRIES_AT_ONCE / per_block) as usize).max(1);
        let n_most = of_ranks.iter().map(Vec::len).max().unwrap_or(0);
        // By turns, so that all ranks have work.
        let all_asked: Vec<(usize, &Range<usize>)> = (0..n_most)
            .flat_map(|k| {
                of_ranks
                    .iter()
                    .enumerate()
                    .filter_map(move |(rank, own)| Some((rank, own.get(k)?)))
            })
            .collect();
        for asked in all_asked.chunks(n_at_once) {
            let columns_of = |block: &Range<usize>| {
                let mut tile = RowTile::new(block.start);
                for column in self.entries.columns(block.clone(), held.clone()) {
                    tile.push_row(&column, RowTally::default());
                }
                encode(&tile)
            };
            let columns: Vec<Vec<u8>> = threads::collect_from(asked, |(_, block)| columns_of(block));
            let came = ranks.all_gather(&with_lengths(&columns));
            let columns_of_ranks: Vec<Vec<&[u8]>> = came.iter().map(|bytes| parts(bytes)).collect();
            let with_columns: Vec<RowBlock<'_>> = threads::collect_flat(asked.len(), |k| {
                let (rank, rows) = &asked[k];
                (*rank == ranks.rank()).then(|| RowBlock {
                    factors: self,
                    rows: (*rows).clone(),
                    columns: Some(joined(&columns_of_ranks, k, rows.len())),
                })
            });
            act(&with_columns);
        }
    }

    /// Returns the best number of rows to transpose at a time.
    fn rows_together(&self) -> usize {
        // On a disk, rows are best read together with those of their tiles.
        if self.storage().place.is_on_disk() {
            return SIDE;
        }
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
}

/// Cuts rows into blocks.
fn blocks_in(rows: Range<usize>, n_together: usize) -> Vec<Range<usize>> {
    let starts = rows.clone().step_by(n_together);
    starts.map(|start| start..rows.end.min(start + n_together)).collect()
}

/// Returns the columns of block `k`, of which each rank sent its part, one rank after the other.
fn joined(of_ranks: &[Vec<&[u8]>], k: usize, n_columns: usize) -> Vec<Vec<Entry>> {
    let mut columns: Vec<Vec<Entry>> = vec![Vec::new(); n_columns];
    for tile in of_ranks.iter().filter_map(|parts| decode(parts[k])) {
        for (column, row) in columns.iter_mut().zip(0..tile.n_rows()) {
            column.extend_from_slice(tile.row(row));
        }
    }
    columns
}

impl RowBlock<'_> {
    /// Calls `visit(i, j, pair)` for all i of the rows and all j from `first_column` on where F_ij or F_ji is stored, row by row in
    /// ascending order.
    pub(crate) fn for_each_pair(&self, first_column: usize, mut visit: impl FnMut(usize, usize, Pair)) {
        let (factors, rows) = (self.factors, self.rows.clone());
        let others = first_column..factors.n_rows();
        let entries = factors.by_rows();
        if let Some(row_factors) = entries.row_factors() {
            for i in rows {
                factors.for_each_number(i, others.clone(), &mut |j, value, std_error| {
                    let scaled = |factor: f64| (factor * value, factor * std_error);
                    let (there, back) = (scaled(row_factors[i]), scaled(row_factors[j]));
                    visit(i, j, Pair { there, back });
                });
            }
            return;
        }
        let columns = match &self.columns {
            Some(columns) => Cow::Borrowed(columns),
            None => Cow::Owned(entries.columns(rows.clone(), others.clone())),
        };
        let mut row = Vec::new();
        for (i, column) in rows.zip(columns.iter()) {
            row.clear();
            entries.for_each(i, others.clone(), &mut |j, value, std_error| {
                row.push((index(j), value, std_error));
            });
            let begin = column.partition_point(|entry| (entry.0 as usize) < others.start);
            merge(&row, &column[begin..], |j, pair| visit(i, j, pair));
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
