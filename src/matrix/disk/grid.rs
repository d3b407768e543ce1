//! A matrix that is not symmetric, in full rows of tiles.

use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use super::tile_file::{Band, Part, TileFile, visit_nothing_known};
use crate::matrix::backend::{Backend, Filling, Sizes};
use crate::matrix::choice::{Layout, Place, Precision, Scratch, StorageChoice};
use crate::matrix::error::{DiskError, MatrixError};
use crate::matrix::kernel::scalar::{Scalar, rounded};
use crate::matrix::kernel::sizes::{SIDE, block_rows, for_each_block};
use crate::matrix::operator::Block;
use crate::matrix::square::{Placed, Square};
use crate::matrix::team::rows_of;
use crate::matrix::tile::{Entry, RowTile, index, is_zero};
use crate::matrix::together::{Share, stored_rows};
use crate::threads;

/// F_ij on a disk, in full rows of tiles: all of them, or those of this rank.
#[derive(Debug)]
pub(super) struct Grid<T> {
    file: TileFile<T>,
    layout: Layout,
    share: Option<Share>,
    sizes: Sizes,
}

/// Makes a scratch file for an n by n matrix.
pub(in crate::matrix) fn fill(
    n: usize,
    choice: StorageChoice<'_>,
    scratch: Scratch<'_>,
) -> Result<Box<dyn Filling>, DiskError> {
    Ok(match choice.precision {
        Precision::F64 => Box::new(Grid::<f64>::new(n, choice, scratch)?),
        Precision::F32 => Box::new(Grid::<f32>::new(n, choice, scratch)?),
    })
}

/// Cuts full rows into square tiles.
pub(in crate::matrix) fn squares<T: Scalar>(
    tile: &RowTile,
    n: usize,
    layout: Layout,
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
        |(k, entries): (usize, &Vec<_>)| Square::new(entries, &rows, &(k * SIDE..n.min((k + 1) * SIDE)), layout);
    Ok(tiles.iter().enumerate().map(square).collect())
}

impl<T: Scalar> Grid<T> {
    pub(super) fn new(n: usize, choice: StorageChoice<'_>, scratch: Scratch<'_>) -> Result<Self, DiskError> {
        Ok(Self {
            file: TileFile::create(n, scratch)?,
            layout: choice.layout,
            share: Share::of(n, choice),
            sizes: Sizes::default(),
        })
    }

    #[cfg(all(test, unix))]
    pub(super) fn file(&self) -> &std::fs::File {
        self.file.file()
    }

    /// Returns the blocks of rows that are stored here.
    fn blocks(&self) -> Range<usize> {
        let all = || 0..block_rows(self.file.n()).len();
        self.share.as_ref().map_or_else(all, |share| share.blocks.clone())
    }
}

impl<T: Scalar> Filling for Grid<T> {
    fn push(&mut self, tile: &RowTile) -> Result<(), MatrixError> {
        let block = tile.first_row() / SIDE;
        if self.blocks().contains(&block) {
            let squares = squares(tile, self.file.n(), self.layout)?;
            self.file.put_row(block, 0, &squares)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Arc<dyn Backend> {
        let n_byte = self.file.n_byte(self.blocks());
        let own = Sizes {
            n_nonzero: self.file.n_nonzero(self.blocks()).iter().sum(),
            pass_byte: n_byte,
            stored_byte: n_byte,
        };
        self.sizes = self.share.as_ref().map_or(own, |share| share.add_up(own));
        Arc::from(self as Box<dyn Backend>)
    }
}

impl<T: Scalar> Backend for Grid<T> {
    fn for_each(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (own, row) = (i / SIDE, i % SIDE);
        let only = (columns.len() == 1).then_some(columns.start / SIDE);
        let read = self.file.with_band(Band::Row(own), only, Part::All, |tile| {
            for_each_block(columns.clone(), |first, part, block| {
                let shifted = &mut |k, value, std_error| visit(first + k, value, std_error);
                if let Some(tile) = tile(block) {
                    tile.for_each_in_row(row, part, shifted);
                }
            });
        });
        if self.file.note(read).is_none() {
            visit_nothing_known(columns, visit);
        }
    }

    fn columns(&self, range: Range<usize>, rows: Range<usize>) -> Vec<Vec<Entry>> {
        let of_column = |j: usize| {
            let (own, column) = (j / SIDE, j % SIDE);
            let mut list = Vec::new();
            let mut push = |i, value, std_error| list.push((index(i), value, std_error));
            let read = self.file.with_band(Band::Column(own), None, Part::All, |tile| {
                for_each_block(rows.clone(), |first, part, block| {
                    let shifted = &mut |k, value, std_error| push(first + k, value, std_error);
                    if let Some(tile) = tile(block) {
                        tile.for_each_in_column(column, part, shifted);
                    }
                });
            });
            if self.file.note(read).is_none() {
                visit_nothing_known(rows.clone(), &mut push);
            }
            list
        };
        range.map(of_column).collect()
    }

    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let (own, row) = (i / SIDE, i % SIDE);
        let result = self.file.with_band(Band::Row(own), None, Part::Numbers, |tile| {
            let mut diagonal = 0.0;
            for block in 0..block_rows(x.n_rows()).len() {
                let Some(tile) = tile(block) else { continue };
                let x_from = &x.values()[block * SIDE * x.n_channels()..];
                let except = (block == own).then_some(row);
                diagonal += tile.add_row(row, except, 1.0, x_from, sum);
            }
            diagonal
        });
        self.file.note(result).unwrap_or_else(|| {
            sum.fill(f64::NAN);
            f64::NAN
        })
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        let n_channels = x.n_channels();
        let n_terms = x.n_rows() * x.n_rows() * n_channels;
        let all = y.values_mut().chunks_mut(SIDE * n_channels).enumerate();
        let own = self.blocks();
        let blocks: Vec<(usize, &mut [f64])> = all.skip(own.start).take(own.len()).collect();
        threads::for_each(threads::pay(n_terms), blocks, |(block, sums)| {
            sums.fill(0.0);
            let read = self.file.for_each_tile(block, Part::Numbers, |column, tile| {
                let x_from = &x.values()[column * SIDE * n_channels..];
                for (row, sum) in sums.chunks_exact_mut(n_channels).enumerate() {
                    tile.add_row(row, None, 1.0, x_from, sum);
                }
            });
            if self.file.note(read).is_none() {
                sums.fill(f64::NAN);
            }
        });
        if let Some(share) = &self.share {
            share.complete(y);
        }
    }

    fn sizes(&self) -> Sizes {
        self.sizes
    }

    fn held_rows(&self) -> Option<Range<usize>> {
        self.share.as_ref().map(|share| share.rows.clone())
    }

    fn whole(&self) -> Option<Arc<dyn Backend>> {
        let share = self.share.as_ref()?;
        let n = self.file.n();
        let mut file = self.file.beside(share.blocks.clone());
        let blocks = share.blocks.clone();
        let sent = blocks.map(|block| stored_rows(self, rows_of(n, &(block..block + 1)), |_| 0..n));
        share.exchange(sent, |came| {
            let made = threads::collect_from(&came, |tile| squares::<T>(tile, n, self.layout));
            for (tile, squares) in came.iter().zip(made) {
                let block = tile.first_row() / SIDE;
                if !share.blocks.contains(&block) {
                    let written = file.put_row(block, 0, &squares.expect("what was stored is stored again"));
                    file.note(written);
                }
            }
        });
        Some(Arc::new(Self {
            file,
            layout: self.layout,
            share: None,
            sizes: self.sizes,
        }))
    }

    fn place(&self) -> Place<'_> {
        Place::Disk(self.file.scratch())
    }

    fn failure(&self) -> Option<&DiskError> {
        self.file.failure()
    }
}
