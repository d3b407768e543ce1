//! Methods that compute the exchange area of one pair of patches at a time: A_i F_ij = A_j F_ji is computed once.

use std::ops::Range;

use super::facing::Facing;
use super::kept::{self, Part, Piece};
use super::rounded::RoundedRows;
use super::{Computed, FormFactorError, Input, PairCounts, shared};
use crate::matrix::{Entry, FormFactors, RowTally, RowTile, StorageChoice};
use crate::mesh::PatchId;
use crate::progress::Progress;

/// The number of rows of the upper triangle that are computed as one piece of parallel work.
const ROWS_PER_TILE: usize = 8;

/// The exchange area of a pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Exchange {
    /// A_i F_ij = A_j F_ji, m².
    pub(super) area: f64,
    /// An estimate of its absolute error, m².
    pub(super) error: f64,
}

/// A worker that computes pairs on one thread; made once for every tile.
pub(super) trait PairWorker {
    /// Computes the exchange areas of patch `i` with each of `others`, all of which face it, in their order.
    ///
    /// `emit` is called once for each, in order. Fails where the method cannot treat a pair.
    fn row(&mut self, i: usize, others: &[usize], emit: &mut dyn FnMut(Exchange)) -> Result<(), FormFactorError>;

    /// Returns what this worker did; `not_facing` is counted by the caller.
    fn counts(&self) -> PairCounts;

    /// Returns false if a budget was spent before a tolerance was met.
    fn tolerance_met(&self) -> bool {
        true
    }
}

/// Computes the upper triangle, tile by tile in parallel, and stores it symmetric.
///
/// Patches of one plane, and patches behind each other's planes, are left out: they exchange nothing.
pub(super) fn by_pairs<W: PairWorker>(
    input: Input<'_>,
    storage: StorageChoice,
    progress: &dyn Progress,
    worker: impl Fn() -> W + Sync,
) -> Result<Computed, FormFactorError> {
    let n = input.mesh.n_patches();
    progress.begin("form factors", (n as u64 * (n as u64).saturating_sub(1)) / 2);
    let facing = Facing::new(input.mesh);
    let rounded = RoundedRows::new(input);
    let tile_byte = (ROWS_PER_TILE * n * size_of::<Entry>()) as u64;
    let rows_of = |k: usize| k * ROWS_PER_TILE..n.min((k + 1) * ROWS_PER_TILE);
    let n_pairs = |k: usize| rows_of(k).map(|i| (n - 1 - i) as u64).sum::<u64>();
    let results = shared::pieces(
        progress,
        n.div_ceil(ROWS_PER_TILE),
        (tile_byte, storage.place.waiting_byte()),
        |k| {
            let rows = rows_of(k);
            let part = Part {
                first_row: rows.start,
                n,
                is_upper: true,
            };
            let result = match kept::take(progress, k as u64, part, |end| end == rows.end) {
                Some(piece) => Ok(piece),
                None if progress.is_cancelled() => Err(FormFactorError::Interrupted),
                None => tile(rows, &facing, rounded.as_ref(), &mut worker())
                    .inspect(|piece| kept::keep(progress, k as u64, piece)),
            };
            progress.advance(n_pairs(k));
            result
        },
        n_pairs,
    );
    let mut counts = PairCounts::default();
    let mut tolerance_met = true;
    let mut failure = None;
    // In order: of several errors the first row's is always reported.
    let upper = results.map_while(|result| match result {
        Ok(piece) => {
            counts = counts.plus(piece.counts);
            tolerance_met &= piece.tolerance_met;
            Some(piece.tiles)
        }
        Err(error) => {
            failure = Some(error);
            None
        }
    });
    let factors = FormFactors::from_exchange_tiles(input.mesh.areas(), upper.flatten(), storage);
    if let Some(error) = failure {
        return Err(error);
    }
    Ok(Computed {
        factors: factors?,
        pairs: Some(counts),
        tolerance_met,
    })
}

fn tile(
    rows: Range<usize>,
    facing: &Facing,
    rounded: Option<&RoundedRows<'_>>,
    worker: &mut impl PairWorker,
) -> Result<Piece, FormFactorError> {
    let mut tile = RowTile::new(rows.start);
    let mut not_facing = 0;
    let (mut others, mut entries) = (Vec::new(), Vec::new());
    for i in rows {
        others.clear();
        entries.clear();
        others.extend((i + 1..facing.len()).filter(|&j| facing.pair(i, j)));
        not_facing += (facing.len() - 1 - i - others.len()) as u64;
        let mut columns = others.iter();
        worker.row(i, &others, &mut |exchange| {
            if let Some(&j) = columns.next() {
                entries.push((PatchId::from_index(j).0, exchange.area, exchange.error));
            }
        })?;
        assert_eq!(entries.len(), others.len(), "one exchange area for each pair");
        if let Some(rounded) = rounded {
            rounded.add(i, 1.0, i + 1..facing.len(), &mut entries);
        }
        tile.push_row(&entries, RowTally::default());
    }
    let counts = PairCounts {
        not_facing,
        ..worker.counts()
    };
    Ok(Piece {
        tiles: vec![tile],
        counts,
        tolerance_met: worker.tolerance_met(),
    })
}
