//! Methods that compute whole rows: tiles of rows are the unit of parallel work.

use std::ops::Range;
use std::sync::Arc;

use super::kept::{self, Part, Piece};
use super::rounded::RoundedRows;
use super::{Computed, FormFactorError, Input, shared};
use crate::matrix::{Entry, FormFactors, RowTile, StorageChoice, UpperBounds};
use crate::progress::Progress;

/// The number of rows that are computed as one piece of parallel work.
const ROWS_PER_TILE: usize = 16;

/// Computes all rows, tile by tile in parallel, and stores them in order.
///
/// Patches without an entry in a row were hit by no ray, and are at most as large as `bounds`; without bounds they are 0 for certain.
pub(super) fn by_rows(
    input: Input<'_>,
    storage: StorageChoice,
    progress: &dyn Progress,
    bounds: Option<Arc<dyn UpperBounds>>,
    tile: impl Fn(Range<usize>) -> RowTile + Sync,
) -> Result<Computed, FormFactorError> {
    let n = input.mesh.n_patches();
    progress.begin("form factors", n as u64);
    let rounded = RoundedRows::new(input);
    let tile_byte = (ROWS_PER_TILE * n * size_of::<Entry>()) as u64;
    let rows_of = |k: usize| k * ROWS_PER_TILE..n.min((k + 1) * ROWS_PER_TILE);
    let n_rows = |k: usize| rows_of(k).len() as u64;
    let pieces = shared::pieces(
        progress,
        n.div_ceil(ROWS_PER_TILE),
        (tile_byte, storage.place.waiting_byte()),
        |k| {
            let rows = rows_of(k);
            let part = Part {
                first_row: rows.start,
                n,
                is_upper: false,
            };
            let result = match kept::take(progress, k as u64, part, |end| end == rows.end) {
                Some(piece) => Ok(piece),
                None if progress.is_cancelled() => Err(FormFactorError::Interrupted),
                None => {
                    let exact = tile(rows);
                    let piece = Piece::of_rows(match &rounded {
                        Some(rounded) => with_rounding(&exact, input, rounded, bounds.as_deref()),
                        None => exact,
                    });
                    kept::keep(progress, k as u64, &piece);
                    Ok(piece)
                }
            };
            progress.advance(n_rows(k));
            result
        },
        n_rows,
    );
    let mut failure = None;
    let tiles = pieces.map_while(|result| result.map_err(|error| failure = Some(error)).ok());
    let factors = FormFactors::from_tiles(input.mesh.areas(), tiles.flat_map(|piece| piece.tiles), storage);
    if progress.is_cancelled() {
        return Err(FormFactorError::Interrupted);
    }
    if let Some(error) = failure {
        return Err(error);
    }
    let factors = factors?;
    Ok(Computed {
        factors: match bounds {
            None => factors,
            Some(bounds) => factors.with_bounds(bounds),
        },
        pairs: None,
        tolerance_met: true,
    })
}

/// Returns rows with the errors of rounded coordinates added.
fn with_rounding(
    rows: &RowTile,
    input: Input<'_>,
    rounded: &RoundedRows<'_>,
    bounds: Option<&dyn UpperBounds>,
) -> RowTile {
    let mut tile = RowTile::new(rows.first_row());
    for (k, &tally) in rows.tallies().iter().enumerate() {
        let i = rows.first_row() + k;
        let mut entries = rows.row(k).to_vec();
        if let Some((bounds, open)) = bounds.zip(tally.open_error()) {
            rounded.add_unhit(i, open, bounds, &mut entries);
        }
        rounded.add(i, input.mesh.patches[i].area, 0..input.mesh.n_patches(), &mut entries);
        tile.push_row(&entries, tally);
    }
    tile
}
