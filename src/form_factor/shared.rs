//! Pieces of form factors, one after the other: computed here, or by several ranks.

use std::ops::Range;

use super::FormFactorError;
use super::kept::Piece;
use crate::in_order::InOrder;
use crate::matrix::Entry;
use crate::progress::Progress;
use crate::ranks::{Code, InTurn, Ranks};
use crate::threads;

/// The fewest chunks of pieces for each rank, where there are pieces enough.
const CHUNKS_PER_RANK: usize = 16;

/// The most pieces of a chunk.
const MAX_PIECES: usize = 32;

/// The fewest and the most rows of a piece.
const MIN_ROWS: usize = 8;
const MAX_ROWS: usize = 16;

/// Stands for the length of a piece whose method failed; it fails again wherever it computes the piece.
const FAILED: u64 = u64::MAX;

/// Stands for the length of a piece of a rank that was to stop.
const INTERRUPTED: u64 = u64::MAX - 1;

type PieceResult = Result<Piece, FormFactorError>;

/// Yields pieces 0, 1, ..., `n` − 1, each of up to `item_byte`, of which `waiting_byte` may wait.
///
/// `work` computes a piece and advances the progress by `steps` of it. Several ranks share pieces out, and each of them gets all.
pub(super) fn pieces<'a>(
    progress: &'a dyn Progress,
    n: usize,
    (item_byte, waiting_byte): (u64, u64),
    work: impl Fn(usize) -> PieceResult + Sync + 'a,
    steps: impl Fn(usize) -> u64 + 'a,
) -> Box<dyn Iterator<Item = PieceResult> + 'a> {
    let ranks = progress.ranks();
    if ranks.size() == 1 {
        return Box::new(InOrder::new(n, item_byte, waiting_byte, work));
    }
    let n_together = pieces_together(n, ranks.size());
    let chunk = move |k: usize| k * n_together..n.min((k + 1) * n_together);
    let window = window(ranks, item_byte.saturating_mul(n_together as u64), waiting_byte);
    let work = std::sync::Arc::new(work);
    let again = std::sync::Arc::clone(&work);
    let of_chunk = move |k: usize| {
        let (work, chunk) = (&*work, chunk(k));
        threads::collect(chunk.len(), |i| work(chunk.start + i))
    };
    let code = Code {
        encode: |results: &Vec<PieceResult>| encode(results),
        decode: move |k: usize, bytes: &[u8]| decode(bytes, chunk(k), &*again),
    };
    let chunks = InTurn::new(ranks, (n.div_ceil(n_together), window), of_chunk, code);
    Box::new(chunks.enumerate().flat_map(move |(k, (results, is_own))| {
        if !is_own {
            progress.advance(chunk(k).map(&steps).sum());
        }
        results
    }))
}

/// Returns the number of pieces, of `n`, that make a chunk.
fn pieces_together(n: usize, n_ranks: usize) -> usize {
    (n / (CHUNKS_PER_RANK * n_ranks)).clamp(1, MAX_PIECES)
}

/// Returns the most bytes of results that wait on each of several ranks.
///
/// `working_byte` is the memory of a method for a chunk of its own; 0 for a method that shares out pieces of rows.
pub(crate) fn waiting_byte(n_patches: usize, n_ranks: usize, working_byte: u64) -> u64 {
    if n_ranks == 1 {
        return 0;
    }
    let n_pieces = n_patches.div_ceil(MIN_ROWS);
    let rows = (MAX_ROWS * pieces_together(n_pieces, n_ranks)).min(n_patches);
    let of_rows = (rows * size_of::<Entry>()) as u64 * n_patches as u64;
    let chunk = if working_byte > 0 { working_byte } else { of_rows };
    chunk.saturating_mul(2 * n_ranks as u64)
}

/// Returns the number of chunks that ranks may be ahead of the slowest: enough that none waits for an expensive chunk of another, as far as memory allows.
pub(super) fn window(ranks: &dyn Ranks, chunk_byte: u64, waiting_byte: u64) -> usize {
    let fitting = usize::try_from(waiting_byte / chunk_byte.max(1)).unwrap_or(usize::MAX);
    fitting.max(2 * ranks.size())
}

fn encode(results: &[PieceResult]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for result in results {
        match result {
            Ok(piece) => {
                let content = piece.encode();
                bytes.extend((content.len() as u64).to_le_bytes());
                bytes.extend(content);
            }
            Err(FormFactorError::Interrupted) => bytes.extend(INTERRUPTED.to_le_bytes()),
            Err(_) => bytes.extend(FAILED.to_le_bytes()),
        }
    }
    bytes
}

/// Returns pieces from their bytes. For an error, the piece is computed `again`, here.
fn decode(bytes: &[u8], pieces: Range<usize>, again: &dyn Fn(usize) -> PieceResult) -> Vec<PieceResult> {
    let mut rest = bytes;
    let mut next = |k: usize| {
        let Some((length, after)) = rest.split_first_chunk() else {
            return again(k);
        };
        rest = after;
        let length = u64::from_le_bytes(*length);
        if length == INTERRUPTED {
            return Err(FormFactorError::Interrupted);
        }
        let found = usize::try_from(length).ok().and_then(|n| rest.split_at_checked(n));
        let Some((content, others)) = found else {
            return again(k);
        };
        rest = others;
        Piece::decode(content).map_or_else(|| again(k), Ok)
    };
    pieces.map(&mut next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::RowTile;

    #[test]
    fn pieces_come_back_and_errors_are_found_again() {
        let piece = |row: usize| Piece::of_rows(RowTile::new(row));
        let fault = || FormFactorError::NotApplicable {
            method: "exact",
            reason: "again".to_owned(),
        };
        let bytes = encode(&[
            Ok(piece(3)),
            Err(fault()),
            Ok(piece(5)),
            Err(FormFactorError::Interrupted),
        ]);
        let again = |k: usize| -> PieceResult {
            assert_eq!(k, 8);
            Err(fault())
        };
        let results = decode(&bytes, 7..11, &again);
        let [
            Ok(first),
            Err(FormFactorError::NotApplicable { reason, .. }),
            Ok(third),
            Err(FormFactorError::Interrupted),
        ] = &results[..]
        else {
            panic!("{results:?}");
        };
        assert_eq!((first, third, reason.as_str()), (&piece(3), &piece(5), "again"));
    }
}
