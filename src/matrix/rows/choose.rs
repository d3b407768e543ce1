//! The choice of the layout of a tile of rows.

use std::sync::Arc;

use super::blocks::{BlockTile, count_blocks};
use super::dense::DenseTile;
use super::sparse::SparseTile;
use super::store::Store;
use crate::matrix::choice::{Layout, Precision};
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::scalar::Scalar;
use crate::matrix::tile::RowTile;

/// The average number of entries, in each block of sixteen columns with any, from which on rows are stored in blocks.
///
/// With four a pass takes 1.15 of the time of one over lists where the matrix is in memory and 1.4 in a cache, three
/// channels 1.45 and 1.3; with five 0.7 to 0.85 and 1.0, and 1.0 and 1.0 (f32, AVX-512; `cargo bench --bench matrix -- "sparse f32 rows" 1/4`, with 1536 for a cache).
const BLOCKS_FROM: usize = 6;

/// Stores a tile of an n by n matrix in a layout and a precision.
pub(in crate::matrix) fn store(
    tile: &RowTile,
    n: usize,
    (layout, precision): (Layout, Precision),
) -> Result<Arc<dyn Store>, MatrixError> {
    match precision {
        Precision::F64 => store_as::<f64>(tile, n, layout),
        Precision::F32 => store_as::<f32>(tile, n, layout),
    }
}

fn store_as<T: Scalar>(tile: &RowTile, n: usize, layout: Layout) -> Result<Arc<dyn Store>, MatrixError> {
    Ok(if layout.is_full(tile.n_entries(), tile.n_rows() * n) {
        Arc::new(DenseTile::<T>::new(tile, n)?)
    } else if tile.n_entries() >= BLOCKS_FROM * count_blocks(tile) {
        Arc::new(BlockTile::<T>::new(tile, n)?)
    } else {
        Arc::new(SparseTile::<T>::new(tile, n)?)
    })
}
