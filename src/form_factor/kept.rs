//! Pieces of form factors, as a checkpoint stores them and ranks send them.

use super::PairCounts;
use crate::matrix::{Entry, RayWeights, RowTally, RowTile};
use crate::progress::Progress;

/// The layout mark of every piece; it changes with the layout. Pieces without a mark begin with a count, which is smaller.
const LAYOUT: u64 = u64::from_le_bytes(*b"piece 3\n");

/// The unit of work of a method, as checkpoints store it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) tiles: Vec<RowTile>,
    pub(super) counts: PairCounts,
    pub(super) tolerance_met: bool,
}

impl Piece {
    /// Returns a piece of rows without counts of pairs.
    pub(super) fn of_rows(tile: RowTile) -> Self {
        Self {
            tiles: vec![tile],
            counts: PairCounts::default(),
            tolerance_met: true,
        }
    }

    /// Returns the piece as bytes.
    pub(super) fn encode(&self) -> Vec<u8> {
        let n_entries: usize = self.tiles.iter().map(RowTile::n_entries).sum();
        let n_rows: usize = self.tiles.iter().map(RowTile::n_rows).sum();
        let mut bytes = Vec::with_capacity(24 * n_entries + 64 * n_rows + 256);
        let mut number = |n: u64| bytes.extend_from_slice(&n.to_le_bytes());
        number(LAYOUT);
        let c = self.counts;
        for n in [
            c.not_facing,
            c.full,
            c.hidden,
            c.partial,
            c.clipped,
            c.by_rays,
            c.n_rays,
            c.n_above_tolerance,
            c.n_above_by_rounding,
            c.rounding_error_max.to_bits(),
            c.kept,
        ] {
            number(n);
        }
        number(u64::from(self.tolerance_met));
        number(self.tiles.len() as u64);
        for tile in &self.tiles {
            number(tile.first_row() as u64);
            number(tile.n_rows() as u64);
            for (k, tally) in tile.tallies().iter().enumerate() {
                number(tally.n_rays);
                number(tally.n_escaped);
                number(tally.n_absorbed);
                number(u64::from(tally.weights.is_some()));
                if let Some(weights) = tally.weights {
                    for weight in [weights.escaped, weights.absorbed, weights.squared] {
                        number(weight.to_bits());
                    }
                }
                number(tile.row(k).len() as u64);
                for &(column, value, error) in tile.row(k) {
                    number(u64::from(column));
                    number(value.to_bits());
                    number(error.to_bits());
                }
            }
        }
        bytes
    }

    /// Returns the row after the last, or `None` if these cannot be consecutive rows of form factors from `part.first_row` on.
    fn end(&self, part: Part) -> Option<usize> {
        let c = self.counts;
        // Sums over all pieces stay far below 2^64.
        let counts = [
            c.not_facing,
            c.full,
            c.hidden,
            c.partial,
            c.clipped,
            c.by_rays,
            c.n_rays,
            c.n_above_tolerance,
            c.n_above_by_rounding,
            c.kept,
        ];
        let is_error = c.rounding_error_max.is_finite() && c.rounding_error_max >= 0.0;
        if !is_error || counts.iter().any(|&count| count >> 48 != 0) {
            return None;
        }
        let mut end = part.first_row;
        for tile in &self.tiles {
            if tile.first_row() != end || tile.n_rows() > part.n - end {
                return None;
            }
            for (k, tally) in tile.tallies().iter().enumerate() {
                let first = if part.is_upper { end + k } else { 0 };
                let is_entry = |entry: &Entry| {
                    let (column, value, error) = *entry;
                    (first..part.n).contains(&(column as usize)) && value.is_finite() && error >= 0.0
                };
                if !tile.row(k).iter().all(is_entry) || !tally.is_consistent() {
                    return None;
                }
            }
            end += tile.n_rows();
        }
        Some(end)
    }

    /// Reads a piece; `None` for bytes that [`encode`](Self::encode) does not write.
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let (numbers, []) = bytes.as_chunks::<8>() else {
            return None;
        };
        let mut numbers = numbers.iter().map(|number| u64::from_le_bytes(*number));
        let mut next = || numbers.next();
        if next()? != LAYOUT {
            return None;
        }
        let counts = PairCounts {
            not_facing: next()?,
            full: next()?,
            hidden: next()?,
            partial: next()?,
            clipped: next()?,
            by_rays: next()?,
            n_rays: next()?,
            n_above_tolerance: next()?,
            n_above_by_rounding: next()?,
            rounding_error_max: f64::from_bits(next()?),
            kept: next()?,
        };
        let tolerance_met = next()? == 1;
        let mut tiles = Vec::new();
        for _ in 0..next()? {
            let mut tile = RowTile::new(usize::try_from(next()?).ok()?);
            for _ in 0..next()? {
                let mut tally = RowTally {
                    n_rays: next()?,
                    n_escaped: next()?,
                    n_absorbed: next()?,
                    weights: None,
                };
                if next()? == 1 {
                    tally.weights = Some(RayWeights {
                        escaped: f64::from_bits(next()?),
                        absorbed: f64::from_bits(next()?),
                        squared: f64::from_bits(next()?),
                    });
                }
                let mut entries: Vec<Entry> = Vec::new();
                for _ in 0..next()? {
                    let column = u32::try_from(next()?).ok()?;
                    if entries.last().is_some_and(|last| last.0 >= column) {
                        return None;
                    }
                    entries.push((column, f64::from_bits(next()?), f64::from_bits(next()?)));
                }
                tile.push_row(&entries, tally);
            }
            tiles.push(tile);
        }
        next().is_none().then_some(Self {
            tiles,
            counts,
            tolerance_met,
        })
    }
}

/// Where a piece belongs in an n by n matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub(super) first_row: usize,
    pub(super) n: usize,
    /// True if rows begin at the diagonal.
    pub(super) is_upper: bool,
}

/// Returns piece k if an earlier run stored it and it is valid: rows from the first of `part` on, up to an end (not included) that is `right`.
///
/// A right checksum does not prove that this program wrote it.
pub(super) fn take(progress: &dyn Progress, k: u64, part: Part, right: impl FnOnce(usize) -> bool) -> Option<Piece> {
    let piece = Piece::decode(&progress.checkpoint()?.piece(k)?)?;
    let end = piece.end(part)?;
    (end > part.first_row && right(end)).then_some(piece)
}

/// Stores piece k for a later run, if the caller asked for that and all of the piece was computed.
pub(super) fn keep(progress: &dyn Progress, k: u64, piece: &Piece) {
    if let Some(checkpoint) = progress.checkpoint()
        && !progress.is_cancelled()
    {
        checkpoint.keep(k, &piece.encode());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_come_back_to_the_last_bit() {
        let mut tile = RowTile::new(16);
        let weights = Some(RayWeights {
            escaped: 0.125,
            absorbed: 0.0,
            squared: 1e-3,
        });
        let tally = RowTally {
            n_rays: 1000,
            n_escaped: 125,
            n_absorbed: 1,
            weights,
        };
        tile.push_row(&[(0, 0.1, 1e-300), (7, 1.0 / 3.0, 0.0)], tally);
        tile.push_row(&[], RowTally::default());
        let piece = Piece {
            tiles: vec![tile, RowTile::new(18)],
            counts: PairCounts {
                full: 5,
                n_above_by_rounding: 2,
                rounding_error_max: 1.5e-3,
                ..PairCounts::default()
            },
            tolerance_met: false,
        };
        let bytes = piece.encode();
        assert_eq!(Piece::decode(&bytes), Some(piece));
        for cut in 0..bytes.len() {
            assert_eq!(Piece::decode(&bytes[..cut]), None);
        }
        let mut huge = bytes.clone();
        huge[111] = 255;
        assert_eq!(Piece::decode(&huge), None, "more tiles than there are bytes");
    }

    /// A right checksum does not make a piece of this work: a piece that does not fit is computed anew.
    #[test]
    fn pieces_that_do_not_fit_are_no_pieces() {
        let part = Part {
            first_row: 16,
            n: 24,
            is_upper: true,
        };
        let with = |first_row: usize, entry: Entry, tally: RowTally| {
            let mut tile = RowTile::new(first_row);
            tile.push_row(&[entry], tally);
            Piece::of_rows(tile)
        };
        let none = RowTally::default();
        let right = with(16, (20, 0.5, 0.0), none);
        assert_eq!(right.end(part), Some(17));
        let too_many = RowTally {
            n_rays: 3,
            n_escaped: 2,
            n_absorbed: u64::MAX,
            weights: None,
        };
        let mut counted = right.clone();
        counted.counts.full = u64::MAX;
        let mut doubtful = right.clone();
        doubtful.counts.rounding_error_max = f64::NAN;
        let mut twice = right.clone();
        twice.tiles.push(twice.tiles[0].clone());
        let mut long = right.clone();
        for _ in 0..8 {
            long.tiles[0].push_row(&[], none);
        }
        for wrong in [
            with(15, (20, 0.5, 0.0), none),
            with(17, (20, 0.5, 0.0), none),
            with(usize::MAX, (20, 0.5, 0.0), none),
            with(16, (15, 0.5, 0.0), none),
            with(16, (24, 0.5, 0.0), none),
            with(16, (20, f64::NAN, 0.0), none),
            with(16, (20, f64::INFINITY, 0.0), none),
            with(16, (20, 0.5, f64::NAN), none),
            with(16, (20, 0.5, -1.0), none),
            with(16, (20, 0.5, 0.0), too_many),
            counted,
            doubtful,
            twice,
            long,
        ] {
            assert_eq!(wrong.end(part), None, "{wrong:?}");
        }
    }
}
