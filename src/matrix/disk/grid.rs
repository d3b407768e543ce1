//! A matrix that is not symmetric, in full rows of tiles.

use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use super::tile_file::{Band, Part, TileFile, visit_nothing_known};
use crate::matrix::backend::{Backend, share_of};
use crate::matrix::choice::{Place, Precision, Scratch, StorageChoice};
use crate::matrix::error::{DiskError, MatrixError};
use crate::matrix::kernel::scalar::{Scalar, rounded};
use crate::matrix::kernel::sizes::{SIDE, block_rows, for_each_block};
use crate::matrix::operator::Block;
use crate::matrix::square::{Placed, Square};
use crate::matrix::tile::{Entry, RowTile, index, is_zero};
use crate::threads;

/// F_ij on a disk, in full rows of tiles.
#[derive(Debug)]
pub(super) struct Grid<T>(pub(super) TileFile<T>);

/// Stores an n by n matrix on a disk, of which `rows` yields tiles of [`SIDE`] rows in order (the last may have fewer).
///
/// `E` is the error of the iterator.
pub(in crate::matrix) fn from_rows<E: From<MatrixError>>(
    n: usize,
    choice: StorageChoice<'_>,
    scratch: Scratch<'_>,
    rows: impl Iterator<Item = Result<RowTile, E>>,
) -> Result<Arc<dyn Backend>, E> {
    fn build<T: Scalar, E: From<MatrixError>>(
        n: usize,
        choice: StorageChoice<'_>,
        scratch: Scratch<'_>,
        rows: impl Iterator<Item = Result<RowTile, E>>,
    ) -> Result<Arc<dyn Backend>, E> {
        let mut file = TileFile::<T>::create(n, false, scratch).map_err(MatrixError::from)?;
        for tile in rows {
            file.push_row(&squares(&tile?, n, choice)?).map_err(MatrixError::from)?;
        }
        Ok(Arc::new(Grid(file)))
    }
    match choice.precision {
        Precision::F64 => build::<f64, E>(n, choice, scratch, rows),
        Precision::F32 => build::<f32, E>(n, choice, scratch, rows),
    }
}

/// Cuts full rows into square tiles.
pub(in crate::matrix) fn squares<T: Scalar>(
    tile: &RowTile,
    n: usize,
    choice: StorageChoice<'_>,
) -> Result<Vec<Square<T>>, MatrixError> {
    let rows = tile.first_row()..tile.first_row() + tile.n_rows();
    let mut tiles: Vec<Vec<Placed<T>>> = vec![Vec::new(); n.div_ceil(SIDE)];
    for i in rows.clone() {
        for &entry in tile.row(i - rows.start) {
            let (value, std_error) = rounded::<T>(i, entry, n)?;
            // A value that is 0 in the precision is left out.
            if !is_zero(value.to_f64()) || std_error > 0.0 {
                tiles[entry.0 as usize / SIDE].push((i, entry.0, value, std_error));
            }
        }
    }
    let square =
        |(k, entries): (usize, &Vec<_>)| Square::new(entries, &rows, &(k * SIDE..n.min((k + 1) * SIDE)), choice.layout);
    Ok(tiles.iter().enumerate().map(square).collect())
}

impl<T: Scalar> Grid<T> {
    /// Sets `y` to the products of some rows of tiles, from the one `first` on, with x.
    fn apply_from(&self, first: usize, x: &Block, y: &mut [f64]) {
        let n_channels = x.n_channels();
        let n_terms = x.n_rows() * x.n_rows() * n_channels;
        let blocks: Vec<(usize, &mut [f64])> = y.chunks_mut(SIDE * n_channels).enumerate().collect();
        threads::for_each(threads::pay(n_terms), blocks, |(k, sums)| {
            let own = first + k;
            sums.fill(0.0);
            let result = self.0.for_each_tile(own, Part::Numbers, |block, tile| {
                let x_from = &x.values()[block * SIDE * n_channels..];
                for (row, sum) in sums.chunks_exact_mut(n_channels).enumerate() {
                    tile.add_row(row, None, 1.0, x_from, sum);
                }
            });
            if self.0.note(result).is_none() {
                sums.fill(f64::NAN);
            }
        });
    }
}

impl<T: Scalar> Backend for Grid<T> {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (own, row) = (i / SIDE, i % SIDE);
        // A single block is not worth a band.
        let single = (columns.len() == 1).then_some(columns.start / SIDE);
        let first_block = single.unwrap_or(0);
        let mut work = |tiles: &[Square<T>]| {
            for_each_block(columns.clone(), |first, part, block| {
                let shifted = &mut |k, value, std_error| visit(first + k, value, std_error);
                tiles[block - first_block].for_each_in_row(row, part, shifted);
            });
        };
        let result = match single {
            Some(block) => self.0.read(own, block..block + 1, Part::All).map(|tiles| work(&tiles)),
            None => self.0.with_band(Band::Row(own), Part::All, |tiles| work(tiles)),
        };
        if self.0.note(result).is_none() {
            visit_nothing_known(columns, visit);
        }
    }

    fn columns(&self, range: Range<usize>, rows: Range<usize>) -> Vec<Vec<Entry>> {
        let of_column = |j: usize| {
            let (own, column) = (j / SIDE, j % SIDE);
            let mut list = Vec::new();
            let mut push = |i, value, std_error| list.push((index(i), value, std_error));
            let result = self.0.with_band(Band::Column(own), Part::All, |tiles| {
                for_each_block(rows.clone(), |first, part, block| {
                    let shifted = &mut |k, value, std_error| push(first + k, value, std_error);
                    tiles[block].for_each_in_column(column, part, shifted);
                });
            });
            if self.0.note(result).is_none() {
                visit_nothing_known(rows.clone(), &mut push);
            }
            list
        };
        range.map(of_column).collect()
    }

    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let (own, row) = (i / SIDE, i % SIDE);
        let result = self.0.with_band(Band::Row(own), Part::Numbers, |tiles| {
            let mut diagonal = 0.0;
            for (block, tile) in tiles.iter().enumerate() {
                let x_from = &x.values()[block * SIDE * x.n_channels()..];
                let except = (block == own).then_some(row);
                diagonal += tile.add_row(row, except, 1.0, x_from, sum);
            }
            diagonal
        });
        self.0.note(result).unwrap_or_else(|| {
            sum.fill(f64::NAN);
            f64::NAN
        })
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        self.apply_from(0, x, y.values_mut());
    }

    fn share_of_pass(&self, x: &Block, rank: usize, n_ranks: usize) -> Vec<f64> {
        let (n, blocks) = (x.n_rows(), share_of(block_rows(x.n_rows()).len(), rank, n_ranks));
        let n_own = n.min(blocks.end * SIDE) - n.min(blocks.start * SIDE);
        let mut sums = vec![0.0; n_own * x.n_channels()];
        self.apply_from(blocks.start, x, &mut sums);
        sums
    }

    fn end_pass(&self, shares: &[f64], y: &mut Block) {
        y.values_mut().copy_from_slice(shares);
    }

    fn pass_byte(&self) -> usize {
        self.stored_byte()
    }

    fn n_nonzero(&self) -> usize {
        self.0.n_nonzero()
    }

    fn stored_byte(&self) -> usize {
        usize::try_from(self.0.n_byte()).unwrap_or(usize::MAX)
    }

    fn place(&self) -> Place<'_> {
        self.0.place()
    }

    fn failure(&self) -> Option<&DiskError> {
        self.0.failure()
    }
}
