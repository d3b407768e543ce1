//! Pieces of form factors that a checkpoint keeps.

use super::PairCounts;
use crate::matrix::{Entry, RayWeights, RowTally, RowTile};
use crate::progress::Progress;

/// What a method computes as one piece.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    pub(super) tiles: Vec<RowTile>,
    pub(super) counts: PairCounts,
    pub(super) tolerance_met: bool,
}

impl Piece {
    /// Returns a piece of rows that know nothing of pairs.
    pub(super) fn of_rows(tile: RowTile) -> Self {
        Self {
            tiles: vec![tile],
            counts: PairCounts::default(),
            tolerance_met: true,
        }
    }

    fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut number = |n: u64| bytes.extend(n.to_le_bytes());
        let c = self.counts;
        for n in [
            c.not_facing,
            c.full,
            c.hidden,
            c.partial,
            c.n_rays,
            c.n_above_tolerance,
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

    /// Returns `None` for what [`encode`](Self::encode) does not write.
    fn decode(bytes: &[u8]) -> Option<Self> {
        let (numbers, []) = bytes.as_chunks::<8>() else {
            return None;
        };
        let mut numbers = numbers.iter().map(|number| u64::from_le_bytes(*number));
        let mut next = || numbers.next();
        let counts = PairCounts {
            not_facing: next()?,
            full: next()?,
            hidden: next()?,
            partial: next()?,
            n_rays: next()?,
            n_above_tolerance: next()?,
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

/// Returns piece k if an earlier run kept it.
pub(super) fn take(progress: &dyn Progress, k: u64) -> Option<Piece> {
    Piece::decode(&progress.checkpoint()?.piece(k)?)
}

/// Keeps piece k for a later run, if the caller asked for that and all of the piece was computed.
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
        huge[71] = 255;
        assert_eq!(Piece::decode(&huge), None, "more tiles than there are bytes");
    }
}
