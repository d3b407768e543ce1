//! Pairs of two faces, computed together.

use std::ops::Range;

use super::corners::CornerSums;
use super::lattice::Repeats;
use crate::form_factor::pairs::Exchange;

/// The fewest pairs of two faces that are computed together: with fewer, the faces have few corners in common.
pub(super) const MIN_PAIRS: usize = 16;

/// Pairs of two faces, computed together.
pub(super) enum Table {
    Repeats(Repeats),
    /// Of the rows of a batch.
    Corners(CornerSums, Range<usize>),
}

impl Table {
    /// Returns whether it holds these rows of a batch, to the bits of a table that is made for them.
    ///
    /// Sums over corners hold more rows than they are made for: whole rows of a grid. The last bits depend on where these begin, and a batch may be the first of a run that continues from a
    /// checkpoint, or of a rank. So none is kept for the next batch.
    pub(super) fn is_of(&self, rows: &Range<usize>) -> bool {
        match self {
            Self::Repeats(_) => true,
            Self::Corners(_, own) => own == rows,
        }
    }

    pub(super) fn get(&self, i: usize, j: usize) -> Exchange {
        match self {
            Self::Repeats(repeats) => repeats.get(i, j),
            Self::Corners(sums, _) => sums.get(i, j),
        }
    }
}
