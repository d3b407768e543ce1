//! A matrix that is not symmetric, in full rows of tiles.

use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use super::super::operator::Block;
use super::super::square::{Placed, SIDE, Square};
use super::super::store::{Scalar, rounded};
use super::super::tile::is_zero;
use super::super::{MatrixError, Precision, RowTile, StorageChoice};
use super::bands::Band;
use super::tile_file::{Part, TileFile};
use super::{DiskError, Place, Scratch};
use crate::threads;

/// A matrix on a disk, whatever the precision of its numbers. Where it cannot be read, numbers are NaN, and [`failure`](Self::failure) tells why.
pub(in super::super) trait General: Debug + Send + Sync {
    /// Calls `visit(j, number, standard error)` in ascending order for all j in `columns` where row i has an entry.
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64));

    /// Calls `visit(i, number, standard error)` in ascending order for all i in `rows` where column j has an entry.
    fn for_each_in_column(&self, j: usize, rows: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64));

    /// Adds Σ_{j ≠ i} a_ij x_j to `sum` and returns a_ii.
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64;

    /// Computes y = A x.
    fn apply(&self, x: &Block, y: &mut Block);

    /// Returns how many numbers are not zero.
    fn n_nonzero(&self) -> usize;

    /// Returns the bytes on the disk.
    fn stored_byte(&self) -> usize;

    fn place(&self) -> Place<'_>;

    fn failure(&self) -> Option<&DiskError>;
}

/// Stores an n by n matrix on a disk, of which `rows` yields tiles of [`SIDE`] rows in order (the last may have fewer).
///
/// `E` is the error of the iterator.
pub(in super::super) fn from_rows<E: From<MatrixError>>(
    n: usize,
    choice: StorageChoice<'_>,
    scratch: Scratch<'_>,
    rows: impl Iterator<Item = Result<RowTile, E>>,
) -> Result<Arc<dyn General>, E> {
    fn build<T: Scalar, E: From<MatrixError>>(
        n: usize,
        choice: StorageChoice<'_>,
        scratch: Scratch<'_>,
        rows: impl Iterator<Item = Result<RowTile, E>>,
    ) -> Result<Arc<dyn General>, E> {
        let mut file = TileFile::<T>::create(n, false, scratch).map_err(MatrixError::from)?;
        for tile in rows {
            file.push_row(&squares(&tile?, n, choice)?).map_err(MatrixError::from)?;
        }
        Ok(Arc::new(file))
    }
    match choice.precision {
        Precision::F64 => build::<f64, E>(n, choice, scratch, rows),
        Precision::F32 => build::<f32, E>(n, choice, scratch, rows),
    }
}

/// Cuts full rows into square tiles.
pub(super) fn squares<T: Scalar>(
    tile: &RowTile,
    n: usize,
    choice: StorageChoice<'_>,
) -> Result<Vec<Square<T>>, MatrixError> {
    let rows = tile.first_row()..tile.first_row() + tile.n_rows();
    let mut tiles: Vec<Vec<Placed<T>>> = vec![Vec::new(); n.div_ceil(SIDE)];
    for i in rows.clone() {
        for &entry in tile.row(i - rows.start) {
            let (value, std_error) = rounded::<T>(i, entry, n)?;
            // What is too small for the precision is left out.
            if !is_zero(value.to_f64()) || std_error > 0.0 {
                tiles[entry.0 as usize / SIDE].push((i, entry.0, value, std_error));
            }
        }
    }
    let square =
        |(k, entries): (usize, &Vec<_>)| Square::new(entries, &rows, &(k * SIDE..n.min((k + 1) * SIDE)), choice.layout);
    Ok(tiles.iter().enumerate().map(square).collect())
}

/// Calls `visit(first, part of the block, block)` for the blocks of [`SIDE`] places that `range` meets.
pub(in super::super) fn for_each_block(range: Range<usize>, mut visit: impl FnMut(usize, Range<usize>, usize)) {
    if range.is_empty() {
        return;
    }
    for block in range.start / SIDE..=(range.end - 1) / SIDE {
        let first = block * SIDE;
        let part = range.start.max(first) - first..range.end.min(first + SIDE) - first;
        visit(first, part, block);
    }
}

/// Reports every number of `range` as NaN.
pub(in super::super) fn visit_nothing_known(range: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
    for k in range {
        visit(k, f64::NAN, f64::NAN);
    }
}

impl<T: Scalar> General for TileFile<T> {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (own, row) = (i / SIDE, i % SIDE);
        // A single place is not worth a band.
        let single = (columns.len() == 1).then_some(columns.start / SIDE);
        let first_block = single.unwrap_or(0);
        let mut work = |tiles: &[Square<T>]| {
            for_each_block(columns.clone(), |first, part, block| {
                let shifted = &mut |k, value, std_error| visit(first + k, value, std_error);
                tiles[block - first_block].for_each_in_row(row, part, shifted);
            });
        };
        let result = match single {
            Some(block) => self.read(own, block..block + 1, Part::All).map(|tiles| work(&tiles)),
            None => self.with_band(Band::Row(own), Part::All, |tiles| work(tiles)),
        };
        if self.note(result).is_none() {
            visit_nothing_known(columns, visit);
        }
    }

    fn for_each_in_column(&self, j: usize, rows: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (own, column) = (j / SIDE, j % SIDE);
        let result = self.with_band(Band::Column(own), Part::All, |tiles| {
            for_each_block(rows.clone(), |first, part, block| {
                let shifted = &mut |k, value, std_error| visit(first + k, value, std_error);
                tiles[block].for_each_in_column(column, part, shifted);
            });
        });
        if self.note(result).is_none() {
            visit_nothing_known(rows, visit);
        }
    }

    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let (own, row) = (i / SIDE, i % SIDE);
        let result = self.with_band(Band::Row(own), Part::Numbers, |tiles| {
            let mut diagonal = 0.0;
            for (block, tile) in tiles.iter().enumerate() {
                let x_from = &x.values()[block * SIDE * x.n_channels()..];
                let except = (block == own).then_some(row);
                diagonal += tile.add_row(row, except, 1.0, x_from, sum);
            }
            diagonal
        });
        self.note(result).unwrap_or_else(|| {
            sum.fill(f64::NAN);
            f64::NAN
        })
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        let n_channels = x.n_channels();
        let n_terms = x.n_rows() * x.n_rows() * n_channels;
        let blocks: Vec<(usize, &mut [f64])> = y.values_mut().chunks_mut(SIDE * n_channels).enumerate().collect();
        threads::for_each(threads::pay(n_terms), blocks, |(own, sums)| {
            sums.fill(0.0);
            let result = self.for_each_tile(own, Part::Numbers, |block, tile| {
                let x_from = &x.values()[block * SIDE * n_channels..];
                for (row, sum) in sums.chunks_exact_mut(n_channels).enumerate() {
                    tile.add_row(row, None, 1.0, x_from, sum);
                }
            });
            if self.note(result).is_none() {
                sums.fill(f64::NAN);
            }
        });
    }

    fn n_nonzero(&self) -> usize {
        self.n_nonzero()
    }

    fn stored_byte(&self) -> usize {
        usize::try_from(self.n_byte()).unwrap_or(usize::MAX)
    }

    fn place(&self) -> Place<'_> {
        self.place()
    }

    fn failure(&self) -> Option<&DiskError> {
        self.failure()
    }
}
