//! Symmetric matrices from the rows of their upper triangles.

use std::ops::Range;
use std::sync::Arc;

use super::tiles::{Stored, Tiles, row_factors};
use crate::in_order::{InOrder, by_turns};
use crate::matrix::backend::Backend;
use crate::matrix::choice::{Layout, Precision, StorageChoice};
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::scalar::{Scalar, rounded};
use crate::matrix::kernel::sizes::{SIDE, block_rows};
use crate::matrix::square::{Placed, Square};
use crate::matrix::team::rows_of;
use crate::matrix::tile::{RowTile, index};
use crate::threads;

/// Stores the s_ij = A_i F_ij / max A between patches of these areas, computed by `upper` in parallel.
///
/// `upper` returns the entries on and above the diagonal for each of [`block_rows`], in the given columns, which are all that this rank stores of the block.
pub(in crate::matrix) fn from_blocks(
    areas: &[f64],
    choice: StorageChoice<'_>,
    upper: impl Fn(Range<usize>, Range<usize>) -> RowTile + Sync,
) -> Result<Arc<dyn Backend>, MatrixError> {
    fn build<T: Scalar>(
        areas: &[f64],
        choice: StorageChoice<'_>,
        upper: impl Fn(Range<usize>, Range<usize>) -> RowTile + Sync,
    ) -> Result<Arc<dyn Backend>, MatrixError> {
        let n = areas.len();
        let part = Stored::new(n, choice);
        let blocks: Vec<_> = block_rows(n).collect();
        let row_byte = (n * SIDE * size_of::<Placed<T>>()) as u64;
        let work = |k: usize| {
            let columns = part.columns(k);
            if columns.is_empty() {
                return Ok(Vec::new());
            }
            let tile = upper(blocks[k].clone(), rows_of(n, &columns));
            row_of_tiles::<T>(&tile, n, choice.layout, columns)
        };
        let rows = InOrder::new(blocks.len(), row_byte, choice.place.waiting_byte(), work);
        Tiles::<T>::collect(row_factors(areas), choice.place, part.clone(), rows)
    }
    match choice.precision {
        Precision::F64 => build::<f64>(areas, choice, upper),
        Precision::F32 => build::<f32>(areas, choice, upper),
    }
}

/// Stores the s_ij = A_i F_ij / max A between patches of these areas, in the order of their rows.
///
/// `upper` yields the entries on and above the diagonal for each of [`block_rows`]; `E` is the error of the iterator.
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
        let part = Stored::new(n, choice);
        let rows = by_turns(upper, |tile| {
            let tile: RowTile = tile?;
            let columns = part.columns(tile.first_row() / SIDE);
            Ok::<_, E>(row_of_tiles::<T>(&tile, n, choice.layout, columns)?)
        });
        Tiles::<T>::collect(row_factors(areas), choice.place, part.clone(), rows)
    }
    match choice.precision {
        Precision::F64 => build::<f64, E>(areas, choice, upper),
        Precision::F32 => build::<f32, E>(areas, choice, upper),
    }
}

/// Stores the s_ij = A_i F_ij / max A between patches of these areas, given in any order.
///
/// `give` adds the entries on and above the diagonal for each of [`block_rows`].
pub(in crate::matrix) fn from_parts(
    areas: &[f64],
    choice: StorageChoice<'_>,
    give: impl FnOnce(&mut Add<'_>) -> Result<(), MatrixError>,
) -> Result<Arc<dyn Backend>, MatrixError> {
    fn build<T: Scalar>(
        areas: &[f64],
        choice: StorageChoice<'_>,
        give: impl FnOnce(&mut Add<'_>) -> Result<(), MatrixError>,
    ) -> Result<Arc<dyn Backend>, MatrixError> {
        let n = areas.len();
        let part = Stored::new(n, choice);
        let mut made = Tiles::<T>::new(row_factors(areas), choice.place, part.clone())?;
        give(&mut |tiles| {
            let stored = threads::collect_from(&tiles, |tile| {
                let k = tile.first_row() / SIDE;
                (k, row_of_tiles::<T>(tile, n, choice.layout, part.columns(k)))
            });
            for (k, squares) in stored {
                made.put_row(k, squares?)?;
            }
            Ok(())
        })?;
        Ok(Arc::new(made.finish()))
    }
    match choice.precision {
        Precision::F64 => build::<f64>(areas, choice, give),
        Precision::F32 => build::<f32>(areas, choice, give),
    }
}

/// Adds the rows of some blocks.
pub(in crate::matrix) type Add<'a> = dyn FnMut(Vec<RowTile>) -> Result<(), MatrixError> + 'a;

/// Cuts rows of the upper triangle into the tiles of some blocks of `columns`; the one on the diagonal gets its lower half.
pub(in crate::matrix) fn row_of_tiles<T: Scalar>(
    upper: &RowTile,
    n: usize,
    layout: Layout,
    columns: Range<usize>,
) -> Result<Vec<Square<T>>, MatrixError> {
    let rows = upper.first_row()..upper.first_row() + upper.n_rows();
    let begin = columns.start * SIDE;
    let end = n.min(columns.end * SIDE);
    let mut tiles: Vec<Vec<Placed<T>>> = vec![Vec::new(); columns.len()];
    for i in rows.clone() {
        for &entry in upper.row(i - rows.start) {
            // Other entries are stored by another rank, or lie below the diagonal and are stored by none.
            if (entry.0 as usize >= rows.start && (entry.0 as usize) < begin) || entry.0 as usize >= end.max(begin) {
                continue;
            }
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
            tiles[j / SIDE - columns.start].push((i, entry.0, value, std_error));
            if i < j && j < rows.end {
                tiles[0].push((j, index(i), value, std_error));
            }
        }
    }
    if begin == rows.start
        && let Some(diagonal) = tiles.first_mut()
    {
        diagonal.sort_unstable_by_key(|&(i, j, ..)| (i, j));
    }
    let square = |(k, entries): (usize, &Vec<_>)| {
        let first = begin + k * SIDE;
        Square::new(entries, &rows, &(first..n.min(first + SIDE)), layout)
    };
    let mut squares: Vec<_> = tiles.iter().enumerate().map(square).collect();
    Square::join_lists(&mut squares);
    Ok(squares)
}
