//! Methods that compute whole rows: tiles of rows are the unit of parallel work.

use std::ops::Range;

use rayon::prelude::*;

use super::{Computed, FormFactorError, Input};
use crate::matrix::{FormFactors, RowTile, StorageChoice};
use crate::progress::Progress;

/// The number of rows that are computed as one piece of parallel work.
const ROWS_PER_TILE: usize = 16;

/// Computes all rows, tile by tile in parallel, and stores them in order.
pub(super) fn by_rows(
    input: Input<'_>,
    storage: StorageChoice,
    progress: &dyn Progress,
    tile: impl Fn(Range<usize>) -> RowTile + Sync,
) -> Result<Computed, FormFactorError> {
    let n = input.mesh.n_patches();
    progress.begin("form factors", n as u64);
    let tiles: Vec<RowTile> = (0..n.div_ceil(ROWS_PER_TILE))
        .into_par_iter()
        .map(|k| {
            let rows = k * ROWS_PER_TILE..n.min((k + 1) * ROWS_PER_TILE);
            let n_rows = rows.len() as u64;
            let result = tile(rows);
            progress.advance(n_rows);
            result
        })
        .collect();
    Ok(Computed {
        factors: FormFactors::from_tiles(input.mesh.areas(), tiles, storage)?,
        pairs: None,
        tolerance_met: true,
    })
}
