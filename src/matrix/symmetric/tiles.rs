//! Symmetric matrices: the upper triangle in square tiles, each applied together with its transpose.

use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use super::pass::{PassSums, PieceOfY};
use crate::in_order::{InOrder, by_turns};
use crate::matrix::backend::{Backend, share_of};
use crate::matrix::choice::{Layout, Place, Precision, StorageChoice};
use crate::matrix::disk::{Band, Part, TileFile, visit_nothing_known};
use crate::matrix::error::{DiskError, MatrixError};
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::scalar::{Scalar, rounded};
use crate::matrix::kernel::sizes::{SIDE, block_rows, for_each_block};
use crate::matrix::operator::Block;
use crate::matrix::square::{Placed, Square};
use crate::matrix::tile::{RowTile, index};
use crate::threads;

/// Returns f_i = max A / A_i.
pub(in crate::matrix) fn row_factors(areas: &[f64]) -> Vec<f64> {
    let area_max = areas.iter().copied().fold(0.0, f64::max);
    areas.iter().map(|a| area_max / a).collect()
}

/// Stores the s_ij = A_i F_ij / max A between patches of these areas, of which `upper` gives the entries on and above the diagonal for each of [`block_rows`], in parallel.
pub(in crate::matrix) fn from_blocks(
    areas: &[f64],
    choice: StorageChoice<'_>,
    upper: impl Fn(Range<usize>) -> RowTile + Sync,
) -> Result<Arc<dyn Backend>, MatrixError> {
    fn build<T: Scalar>(
        areas: &[f64],
        choice: StorageChoice<'_>,
        upper: impl Fn(Range<usize>) -> RowTile + Sync,
    ) -> Result<Arc<dyn Backend>, MatrixError> {
        let n = areas.len();
        let blocks: Vec<_> = block_rows(n).collect();
        let row_byte = (n * SIDE * size_of::<Placed<T>>()) as u64;
        let work = |k: usize| row_of_tiles::<T>(&upper(blocks[k].clone()), n, choice.layout);
        let rows = InOrder::new(blocks.len(), row_byte, choice.place.waiting_byte(), work);
        Ok(Arc::new(Tiles::<T>::collect(row_factors(areas), choice.place, rows)?))
    }
    match choice.precision {
        Precision::F64 => build::<f64>(areas, choice, upper),
        Precision::F32 => build::<f32>(areas, choice, upper),
    }
}

/// Stores the s_ij = A_i F_ij / max A between patches of these areas, of which `upper` yields the entries on and above the diagonal for each of [`block_rows`] in order.
///
/// `E` is the error of the iterator.
pub(in crate::matrix) fn from_rows<E: From<MatrixError> + Send>(
    areas: &[f64],
    choice: StorageChoice<'_>,
    upper: impl Iterator<Item = Result<RowTile, E>>,
) -> Result<Arc<dyn Backend>, E> {
    fn build<T: Scalar, E: From<MatrixError> + Send>(
        areas: &[f64],
        choice: StorageChoice<'_>,
        upper: impl Iterator<Item = Result<RowTile, E>>,
    ) -> Result<Arc<dyn Backend>, E> {
        let n = areas.len();
        let rows = by_turns(upper, |tile| Ok::<_, E>(row_of_tiles::<T>(&tile?, n, choice.layout)?));
        Ok(Arc::new(Tiles::<T>::collect(row_factors(areas), choice.place, rows)?))
    }
    match choice.precision {
        Precision::F64 => build::<f64, E>(areas, choice, upper),
        Precision::F32 => build::<f32, E>(areas, choice, upper),
    }
}

/// Cuts rows of the upper triangle into tiles; the one on the diagonal gets its lower half.
pub(in crate::matrix) fn row_of_tiles<T: Scalar>(
    upper: &RowTile,
    n: usize,
    layout: Layout,
) -> Result<Vec<Square<T>>, MatrixError> {
    let rows = upper.first_row()..upper.first_row() + upper.n_rows();
    let mut tiles: Vec<Vec<Placed<T>>> = vec![Vec::new(); (n - rows.start).div_ceil(SIDE)];
    for i in rows.clone() {
        for &entry in upper.row(i - rows.start) {
            let (value, std_error) = rounded::<T>(i, entry, n)?;
            if value.to_f64().abs() <= 0.0 && std_error <= 0.0 {
                continue; // Too small for the precision.
            }
            let j = entry.0 as usize;
            if j < i {
                return Err(MatrixError::BelowDiagonal {
                    row: i,
                    column: entry.0,
                });
            }
            tiles[(j - rows.start) / SIDE].push((i, entry.0, value, std_error));
            if i < j && j < rows.end {
                tiles[0].push((j, index(i), value, std_error));
            }
        }
    }
    tiles[0].sort_unstable_by_key(|&(i, j, ..)| (i, j));
    let square = |(k, entries): (usize, &Vec<_>)| {
        let first = rows.start + k * SIDE;
        Square::new(entries, &rows, &(first..n.min(first + SIDE)), layout)
    };
    let mut squares: Vec<_> = tiles.iter().enumerate().map(square).collect();
    Square::join_lists(&mut squares);
    Ok(squares)
}

/// The tiles (I, J) with J ≥ I.
#[derive(Debug)]
struct Tiles<T> {
    n: usize,
    /// f_i = max A / A_i: F_ij = f_i s_ij.
    row_factors: Vec<f64>,
    /// The data that a pass reads.
    pass_byte: usize,
    rows: Rows<T>,
}

#[derive(Debug)]
enum Rows<T> {
    /// `[I][J − I]`.
    Memory(Vec<Vec<Square<T>>>),
    Disk(TileFile<T>),
}

/// The most pieces into which the rows of tiles are divided when the matrix is applied: enough for the threads of one machine.
const PIECES: usize = 64;

/// Rows of tiles for each piece, or half as many where there are few, so that the vectors of all pieces are small beside the matrix.
const ROWS_PER_PIECE: usize = 4;

/// Numbers whose sums over the pieces one thread computes at a time.
const SUMS_PER_TASK: usize = 1024;

/// Returns the block rows of each piece of an n by n matrix: about as many tiles in one as in another.
fn pieces(n: usize) -> Vec<Range<usize>> {
    let n_blocks = block_rows(n).len();
    let n_tiles = n_blocks * (n_blocks + 1) / 2;
    // It depends on n alone, so that the order of the sums does not depend on the number of threads; an even number where there are several, since most machines have one of threads.
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
    /// Keeps rows of tiles, all [`block_rows`] of them.
    fn collect<E: From<MatrixError>>(
        row_factors: Vec<f64>,
        place: Place<'_>,
        rows: impl Iterator<Item = Result<Vec<Square<T>>, E>>,
    ) -> Result<Self, E> {
        let (n, mut n_rows) = (row_factors.len(), 0);
        let counted = rows.inspect(|_| n_rows += 1);
        let stored = match place {
            Place::Memory { .. } => Rows::Memory(counted.collect::<Result<_, E>>()?),
            Place::Disk(scratch) => {
                let mut file = TileFile::create(n, true, scratch).map_err(MatrixError::from)?;
                for row in counted {
                    file.push_row(&row?).map_err(MatrixError::from)?;
                }
                Rows::Disk(file)
            }
        };
        assert_eq!(n_rows, block_rows(n).len(), "a tile for every row of blocks");
        let pass_byte = match &stored {
            Rows::Memory(tiles) => tiles.iter().flatten().map(Square::pass_byte).sum(),
            Rows::Disk(file) => usize::try_from(file.n_byte()).unwrap_or(usize::MAX),
        };
        Ok(Self {
            n,
            row_factors,
            pass_byte,
            rows: stored,
        })
    }

    /// Calls `visit(J, tile)` for the tiles (I, J), J ≥ I, in order.
    fn for_each_tile(&self, row: usize, part: Part, mut visit: impl FnMut(usize, &Square<T>)) -> Result<(), DiskError> {
        match &self.rows {
            Rows::Memory(rows) => {
                for (k, tile) in rows[row].iter().enumerate() {
                    if let Some(next) = rows[row].get(k + 1) {
                        next.ask();
                    }
                    visit(row + k, tile);
                }
                Ok(())
            }
            Rows::Disk(file) => file.for_each_tile(row, part, visit),
        }
    }

    /// Returns what `work` makes of the tiles that hold the rows of block `own`, found by the other block: those before `own` hold
    /// them as columns. `only` names the single block that `work` asks for. `None` if the tiles cannot be read.
    fn with_cross<R>(
        &self,
        own: usize,
        only: Option<usize>,
        part: Part,
        work: impl for<'t> FnOnce(&dyn Fn(usize) -> &'t Square<T>) -> R,
    ) -> Option<R> {
        match &self.rows {
            Rows::Memory(rows) => Some(work(&|block| {
                if block < own {
                    &rows[block][own - block]
                } else {
                    &rows[own][block - own]
                }
            })),
            Rows::Disk(file) => file.note(match only {
                Some(block) => {
                    let (row, column) = (own.min(block), own.max(block));
                    let tile = file.read(row, column..column + 1, part);
                    tile.map(|tile| work(&|_| &tile[0]))
                }
                None => file.with_band(Band::Cross(own), part, |tiles| work(&|block| &tiles[block])),
            }),
        }
    }

    /// Returns what the tiles of some block rows add to y.
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

    /// Sets y to the sums of what all pieces add to it, in their order.
    fn add_up(&self, parts: &[PieceOfY], y: &mut Block) {
        let n_channels = y.n_channels();
        let tasks: Vec<(usize, &mut [f64])> = y
            .values_mut()
            .chunks_mut(SUMS_PER_TASK * n_channels)
            .enumerate()
            .collect();
        threads::for_each(
            threads::pay(self.n * parts.len() * n_channels),
            tasks,
            |(task, y_rows)| {
                let begin = task * SUMS_PER_TASK;
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
            },
        );
    }
}

impl<T: Scalar> Backend for Tiles<T> {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (own, row) = (i / SIDE, i % SIDE);
        // A single place is not worth a band.
        let only = (columns.len() == 1).then_some(columns.start / SIDE);
        let found = self.with_cross(own, only, Part::All, |tile| {
            for_each_block(columns.clone(), |first, part, block| {
                let shifted = &mut |k, value, std_error| visit(first + k, value, std_error);
                if block < own {
                    tile(block).for_each_in_column(row, part, shifted);
                } else {
                    tile(block).for_each_in_row(row, part, shifted);
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
            for block in 0..own {
                tile(block).add_column(row, factor, x_from(block), sum);
            }
            let diagonal = tile(own).add_row(row, Some(row), factor, x_from(own), sum);
            for block in own + 1..block_rows(self.n).len() {
                tile(block).add_row(row, None, factor, x_from(block), sum);
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
        let pieces = pieces(self.n);
        let pay = threads::pay_for_pass(self.n * self.n * x.n_channels(), self.pass_byte);
        let parts = threads::map(pay, pieces.len(), |k| self.apply_piece(pieces[k].clone(), &planes));
        self.add_up(&parts, y);
    }

    fn share_of_pass(&self, x: &Block, rank: usize, n_ranks: usize) -> Vec<f64> {
        let planes = Planes::of(x);
        let pieces = pieces(self.n);
        let own = &pieces[share_of(pieces.len(), rank, n_ranks)];
        let pay = threads::pay_for_pass(self.n * self.n * x.n_channels(), self.pass_byte);
        let parts = threads::map(pay, own.len(), |k| self.apply_piece(own[k].clone(), &planes));
        parts.iter().flat_map(|part| part.numbers(self.n)).collect()
    }

    fn end_pass(&self, shares: &[f64], y: &mut Block) {
        let mut rest = shares;
        let parts: Vec<PieceOfY> = pieces(self.n)
            .into_iter()
            .map(|piece| {
                let part;
                (part, rest) = PieceOfY::from_numbers(piece.start * SIDE, self.n, y.n_channels(), rest);
                part
            })
            .collect();
        self.add_up(&parts, y);
    }

    fn pass_byte(&self) -> usize {
        self.pass_byte
    }

    fn row_factors(&self) -> Option<&[f64]> {
        Some(&self.row_factors)
    }

    fn scaled(&self, d: &[f64]) -> Result<Arc<dyn Backend>, MatrixError> {
        let n_blocks = block_rows(self.n).len();
        let scale_row = |i: usize| -> Result<Vec<Square<T>>, MatrixError> {
            let mut row = Vec::with_capacity(n_blocks - i);
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
        Ok(Arc::new(Self::collect(self.row_factors.clone(), self.place(), rows)?))
    }

    fn n_nonzero(&self) -> usize {
        let rows = match &self.rows {
            Rows::Memory(rows) => rows,
            Rows::Disk(file) => return file.n_nonzero(),
        };
        let of_row = |tiles: &Vec<Square<T>>| {
            let counts = tiles.iter().enumerate();
            counts
                .map(|(k, tile)| tile.n_nonzero() * if k == 0 { 1 } else { 2 })
                .sum::<usize>()
        };
        rows.par_iter().map(of_row).sum()
    }

    fn stored_byte(&self) -> usize {
        match &self.rows {
            Rows::Memory(rows) => rows.iter().flatten().map(Square::stored_byte).sum(),
            Rows::Disk(file) => usize::try_from(file.n_byte()).unwrap_or(usize::MAX),
        }
    }

    fn place(&self) -> Place<'_> {
        match &self.rows {
            Rows::Memory(_) => Place::default(),
            Rows::Disk(file) => file.place(),
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
