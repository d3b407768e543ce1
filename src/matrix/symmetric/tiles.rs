//! Symmetric matrices: the upper triangle in square tiles, each applied together with its transpose.

use std::cmp::Ordering;
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use super::build::row_of_tiles;
use super::pass::{PassSums, PieceOfY};
use crate::in_order::InOrder;
use crate::matrix::backend::{Backend, Sizes};
use crate::matrix::choice::{Layout, Place, StorageChoice};
use crate::matrix::disk::{Band, Part, TileFile, visit_nothing_known};
use crate::matrix::error::{DiskError, MatrixError};
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::scalar::Scalar;
use crate::matrix::kernel::sizes::{SIDE, block_rows, for_each_block};
use crate::matrix::operator::Block;
use crate::matrix::square::Square;
use crate::matrix::team::rows_of;
use crate::matrix::tile::RowTile;
use crate::matrix::together::{Share, stored_rows};
use crate::threads;

/// Returns f_i = max A / A_i.
pub(in crate::matrix) fn row_factors(areas: &[f64]) -> Vec<f64> {
    let area_max = areas.iter().copied().fold(0.0, f64::max);
    areas.iter().map(|a| area_max / a).collect()
}

/// The tiles that this rank stores.
#[derive(Clone, Debug)]
pub(super) struct Stored {
    n_blocks: usize,
    layout: Layout,
    /// The blocks of rows all of whose tiles a rank of several stores; `None` where all tiles are stored.
    share: Option<Share>,
}

impl Stored {
    /// Returns the stored part of an n by n matrix.
    pub(super) fn new(n: usize, choice: StorageChoice<'_>) -> Self {
        Self {
            n_blocks: block_rows(n).len(),
            layout: choice.layout,
            share: Share::of(n, choice),
        }
    }

    /// Returns the blocks of rows all of whose tiles are stored.
    fn own(&self) -> Range<usize> {
        self.share
            .as_ref()
            .map_or(0..self.n_blocks, |share| share.blocks.clone())
    }

    /// Returns the J of the tiles (I, J), J ≥ I, that are stored: all where row I is this rank's, otherwise those of its columns.
    pub(super) fn columns(&self, row: usize) -> Range<usize> {
        let own = self.own();
        if own.contains(&row) {
            row..self.n_blocks
        } else {
            own.start.max(row).min(own.end)..own.end
        }
    }
}

/// The tiles (I, J) with J ≥ I, or those that this rank stores.
#[derive(Debug)]
pub(super) struct Tiles<T> {
    n: usize,
    /// f_i = max A / A_i: F_ij = f_i s_ij.
    row_factors: Vec<f64>,
    sizes: Sizes,
    stored: Stored,
    rows: Rows<T>,
}

#[derive(Debug)]
enum Rows<T> {
    /// `[I][J − first]`, first being that of [`Stored::columns`].
    Memory(Vec<Vec<Square<T>>>),
    Disk(TileFile<T>),
}

/// The most pieces into which the rows of tiles are divided when the matrix is applied: enough for the threads of one machine.
const PIECES: usize = 64;

/// Rows of tiles of each piece, or half as many where there are few, so that the vectors of all pieces are small beside the matrix.
const ROWS_PER_PIECE: usize = 4;

/// Numbers whose sums over the pieces one thread computes at a time.
const SUMS_PER_TASK: usize = 1024;

/// Returns the block rows of each piece of an n by n matrix, with about equally many tiles in each.
fn pieces(n: usize) -> Vec<Range<usize>> {
    let n_blocks = block_rows(n).len();
    let n_tiles = n_blocks * (n_blocks + 1) / 2;
    // It depends on n alone, so that the order of the sums does not depend on the number of threads; several pieces are an even number, since most machines have an even number of threads.
    let n_pieces = (n_blocks / ROWS_PER_PIECE).next_multiple_of(2).clamp(1, PIECES);
    let mut pieces = Vec::with_capacity(n_pieces);
    let (mut begin, mut n_before) = (0, 0);
    for end in 1..=n_blocks {
        n_before += n_blocks + 1 - end;
        if n_before * n_pieces >= (pieces.len() + 1) * n_tiles || end == n_blocks {
            pieces.push(begin..end);
            begin = end;
        }
    }
    pieces
}

impl<T: Scalar> Tiles<T> {
    /// Stores rows of tiles, all [`block_rows`] of them. Collective where ranks store parts.
    pub(super) fn collect<E: From<MatrixError>>(
        row_factors: Vec<f64>,
        place: Place<'_>,
        part: Stored,
        rows: impl Iterator<Item = Result<Vec<Square<T>>, E>>,
    ) -> Result<Arc<dyn Backend>, E> {
        let mut tiles = Self::new(row_factors, place, part)?;
        let mut n_rows = 0;
        for row in rows {
            tiles.put_row(n_rows, row?).map_err(MatrixError::from)?;
            n_rows += 1;
        }
        assert_eq!(n_rows, block_rows(tiles.n).len(), "a tile for every row of blocks");
        Ok(Arc::new(tiles.finish()))
    }

    /// Returns a matrix without tiles.
    pub(super) fn new(row_factors: Vec<f64>, place: Place<'_>, stored: Stored) -> Result<Self, MatrixError> {
        let n = row_factors.len();
        let rows = match place {
            Place::Memory { .. } => Rows::Memory(std::iter::repeat_with(Vec::new).take(stored.n_blocks).collect()),
            Place::Disk(scratch) => Rows::Disk(TileFile::create(n, scratch)?),
        };
        Ok(Self {
            n,
            row_factors,
            sizes: Sizes::default(),
            stored,
            rows,
        })
    }

    /// Stores the tiles of a row of tiles: those of [`Stored::columns`].
    pub(super) fn put_row(&mut self, row: usize, tiles: Vec<Square<T>>) -> Result<(), DiskError> {
        let columns = self.stored.columns(row);
        assert_eq!(tiles.len(), columns.len(), "a row is complete");
        match &mut self.rows {
            Rows::Memory(rows) => {
                rows[row] = tiles;
                Ok(())
            }
            Rows::Disk(file) => file.put_row(row, columns.start, &tiles),
        }
    }

    /// Ends the matrix once all tiles are stored. Collective where ranks store parts.
    pub(super) fn finish(mut self) -> Self {
        let own = self.own_sizes();
        self.sizes = self.stored.share.as_ref().map_or(own, |share| share.add_up(own));
        self
    }

    /// Returns what this rank's rows of tiles take; entries beside the diagonal count twice.
    fn own_sizes(&self) -> Sizes {
        let own = self.stored.own();
        match &self.rows {
            Rows::Memory(rows) => {
                let of_row = |tiles: &Vec<Square<T>>| {
                    let mut sizes: Sizes = tiles.iter().map(Square::sizes).sum();
                    sizes.n_nonzero = 2 * sizes.n_nonzero - tiles.first().map_or(0, |tile| tile.sizes().n_nonzero);
                    sizes
                };
                threads::collect_from(&rows[own], of_row).into_iter().sum()
            }
            Rows::Disk(file) => {
                let [diagonal, others] = file.n_nonzero(own.clone());
                let n_byte = file.n_byte(own);
                Sizes {
                    n_nonzero: diagonal + 2 * others,
                    pass_byte: n_byte,
                    stored_byte: n_byte,
                }
            }
        }
    }

    /// Calls `visit(J, tile)` for the tiles (I, J), J ≥ I, that are stored, in order.
    fn for_each_tile(&self, row: usize, part: Part, mut visit: impl FnMut(usize, &Square<T>)) -> Result<(), DiskError> {
        match &self.rows {
            Rows::Memory(rows) => {
                for (k, tile) in rows[row].iter().enumerate() {
                    if let Some(next) = rows[row].get(k + 1) {
                        next.ask();
                    }
                    visit(self.stored.columns(row).start + k, tile);
                }
                Ok(())
            }
            Rows::Disk(file) => file.for_each_tile(row, part, visit),
        }
    }

    /// Returns the result of `work` for the tiles that hold the rows of block `own`, found by the other block.
    ///
    /// Tiles before `own` hold these rows as columns; a tile that is not stored is `None`. `only` names the single block that `work` reads. `None` if the tiles cannot be read.
    fn with_cross<R>(
        &self,
        own: usize,
        only: Option<usize>,
        part: Part,
        work: impl for<'t> FnOnce(&dyn Fn(usize) -> Option<&'t Square<T>>) -> R,
    ) -> Option<R> {
        match &self.rows {
            Rows::Memory(rows) => Some(work(&|block| {
                let (row, column) = (own.min(block), own.max(block));
                rows[row].get(column.checked_sub(self.stored.columns(row).start)?)
            })),
            Rows::Disk(file) => file.note(file.with_band(Band::Cross(own), only, part, work)),
        }
    }

    /// Returns the products of the tiles of some block rows, to be added to y.
    fn apply_piece(&self, piece: Range<usize>, x: &Planes) -> PieceOfY {
        let mut sums = PassSums::new(piece.start * SIDE, self.n, x.n_channels());
        for i in piece {
            let rows = i * SIDE..self.n.min((i + 1) * SIDE);
            let read = self.for_each_tile(i, Part::Numbers, |j, tile| {
                let columns = j * SIDE..self.n.min((j + 1) * SIDE);
                sums.add(tile, x, rows.clone(), columns);
            });
            sums.end_rows(rows);
            if let Rows::Disk(file) = &self.rows
                && file.note(read).is_none()
            {
                sums.spoil();
            }
        }
        sums.finish()
    }

    /// Sets the rows of y from `first` on to the sums of all pieces, in their order.
    fn add_up(&self, parts: &[PieceOfY], first: usize, n_channels: usize, y: &mut [f64]) {
        let y_len = y.len();
        let tasks: Vec<(usize, &mut [f64])> = y.chunks_mut(SUMS_PER_TASK * n_channels).enumerate().collect();
        threads::for_each(threads::pay(y_len * parts.len()), tasks, |(task, y_rows)| {
            let begin = first + task * SUMS_PER_TASK;
            let rows = begin..begin + y_rows.len() / n_channels;
            for c in 0..n_channels {
                let mut sums = [0.0; SUMS_PER_TASK];
                for part in parts {
                    part.add_to(&mut sums, &rows, c);
                }
                let sums = sums.iter().zip(&self.row_factors[rows.clone()]);
                for (row, (sum, factor)) in y_rows.chunks_exact_mut(n_channels).zip(sums) {
                    row[c] = sum * factor;
                }
            }
        });
    }
}

impl<T: Scalar> Backend for Tiles<T> {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (own, row) = (i / SIDE, i % SIDE);
        // A single block is not worth a band.
        let only = (columns.len() == 1).then_some(columns.start / SIDE);
        let found = self.with_cross(own, only, Part::All, |tile| {
            for_each_block(columns.clone(), |first, part, block| {
                let shifted = &mut |k, value, std_error| visit(first + k, value, std_error);
                match tile(block) {
                    Some(tile) if block < own => tile.for_each_in_column(row, part, shifted),
                    Some(tile) => tile.for_each_in_row(row, part, shifted),
                    None => {}
                }
            });
        });
        if found.is_none() {
            visit_nothing_known(columns, visit);
        }
    }

    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let factor = self.row_factors[i];
        let (own, row) = (i / SIDE, i % SIDE);
        let x_from = |block: usize| &x.values()[block * SIDE * x.n_channels()..];
        let found = self.with_cross(own, None, Part::Numbers, |tile| {
            let mut diagonal = 0.0;
            for block in 0..self.stored.n_blocks {
                let Some(found) = tile(block) else { continue };
                match block.cmp(&own) {
                    Ordering::Less => found.add_column(row, factor, x_from(block), sum),
                    Ordering::Equal => diagonal = found.add_row(row, Some(row), factor, x_from(own), sum),
                    Ordering::Greater => {
                        found.add_row(row, None, factor, x_from(block), sum);
                    }
                }
            }
            factor * diagonal
        });
        found.unwrap_or_else(|| {
            sum.fill(f64::NAN);
            f64::NAN
        })
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        let planes = Planes::of(x);
        let rows = rows_of(self.n, &self.stored.own());
        // Pieces behind the rows add nothing to them.
        let mut pieces = pieces(self.n);
        pieces.retain(|piece| piece.start * SIDE < rows.end);
        let pay = threads::pay_for_pass(self.n * self.n * x.n_channels(), self.sizes.pass_byte);
        let parts = threads::map(pay, pieces.len(), |k| self.apply_piece(pieces[k].clone(), &planes));
        let n_channels = y.n_channels();
        let own = rows.start * n_channels..rows.end * n_channels;
        self.add_up(&parts, rows.start, n_channels, &mut y.values_mut()[own]);
        if let Some(share) = &self.stored.share {
            share.complete(y);
        }
    }

    fn row_factors(&self) -> Option<&[f64]> {
        Some(&self.row_factors)
    }

    fn scaled(&self, d: &[f64]) -> Result<Arc<dyn Backend>, MatrixError> {
        let n_blocks = self.stored.n_blocks;
        let scale_row = |i: usize| -> Result<Vec<Square<T>>, MatrixError> {
            let mut row = Vec::with_capacity(self.stored.columns(i).len());
            self.for_each_tile(i, Part::All, |j, tile| {
                let first = (i * SIDE, j * SIDE);
                row.push(tile.scaled(first, self.n, |a, b| d[first.0 + a] * d[first.1 + b]));
            })?;
            let mut row = row.into_iter().collect::<Result<Vec<_>, _>>()?;
            Square::join_lists(&mut row);
            Ok(row)
        };
        let row_byte = (self.n * SIDE * (size_of::<T>() + size_of::<f32>())) as u64;
        let rows = InOrder::new(n_blocks, row_byte, self.place().waiting_byte(), scale_row);
        Self::collect(self.row_factors.clone(), self.place(), self.stored.clone(), rows)
    }

    fn held_rows(&self) -> Option<Range<usize>> {
        self.stored.share.as_ref().map(|share| share.rows.clone())
    }

    fn whole(&self) -> Option<Arc<dyn Backend>> {
        let share = self.stored.share.as_ref()?;
        let all = Stored {
            share: None,
            ..self.stored.clone()
        };
        let (kept, rows) = match &self.rows {
            Rows::Memory(rows) => (0..0, Rows::Memory(rows.iter().map(|_| Vec::new()).collect())),
            Rows::Disk(file) => (share.blocks.clone(), Rows::Disk(file.beside(share.blocks.clone()))),
        };
        let mut whole = Self {
            n: self.n,
            row_factors: self.row_factors.clone(),
            sizes: self.sizes,
            stored: all,
            rows,
        };
        let blocks = share.blocks.clone();
        let sent = blocks.map(|k| stored_rows(self, rows_of(self.n, &(k..k + 1)), |i| i..self.n));
        share.exchange(sent, |came| {
            let is_new = |tile: &RowTile| !kept.contains(&(tile.first_row() / SIDE));
            let new: Vec<RowTile> = came.into_iter().filter(is_new).collect();
            let made = threads::collect_from(&new, |tile| {
                let k = tile.first_row() / SIDE;
                row_of_tiles::<T>(tile, self.n, whole.stored.layout, whole.stored.columns(k))
            });
            for (tile, row) in new.iter().zip(made) {
                let row = row.expect("what was stored is stored again");
                let written = whole.put_row(tile.first_row() / SIDE, row);
                if let Rows::Disk(file) = &whole.rows {
                    file.note(written);
                }
            }
        });
        Some(Arc::new(whole))
    }

    fn sizes(&self) -> Sizes {
        self.sizes
    }

    fn place(&self) -> Place<'_> {
        match &self.rows {
            Rows::Memory(_) => Place::default(),
            Rows::Disk(file) => Place::Disk(file.scratch()),
        }
    }

    fn failure(&self) -> Option<&DiskError> {
        match &self.rows {
            Rows::Memory(_) => None,
            Rows::Disk(file) => file.failure(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::product::roundings;

    #[test]
    fn every_row_is_in_one_piece_and_no_sum_is_longer_than_its_bound_says() {
        for n in (1..700).chain((700..40_000).step_by(61)) {
            let pieces = pieces(n);
            let n_blocks = block_rows(n).len();
            assert_eq!((pieces[0].start, pieces[pieces.len() - 1].end), (0, n_blocks));
            assert!(pieces.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert!(pieces.len() == 1 || pieces.len().is_multiple_of(2), "{n}");
            // A term of a column: one addition for each row of its piece, and one for each piece.
            let longest = pieces
                .iter()
                .map(|piece| n.min(piece.end * SIDE) - piece.start * SIDE)
                .max();
            let n_terms = longest.expect("a piece") + pieces.len();
            // A term of a row: its partial sum, the total, its piece and the others.
            assert!((n_terms.max(n / 8 + 4 + pieces.len()) as f64) < roundings(n), "{n}");
        }
    }
}
