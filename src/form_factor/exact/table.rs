//! Pairs of two faces, computed together.

use std::ops::Range;

use super::corners::CornerSums;
use super::lattice::Repeats;
use crate::form_factor::pairs::Exchange;

/// Two faces with fewer pairs than this are not looked at as a whole: they have few corners in common.
pub(super) const MIN_PAIRS: usize = 16;

/// Pairs of two faces, computed together.
pub(super) enum Table {
    Repeats(Repeats),
    Corners(CornerSums),
}

impl Table {
    pub(super) fn covers(&self, rows: &Range<usize>) -> bool {
        match self {
            Self::Repeats(_) => true,
            Self::Corners(sums) => sums.covers(rows),
        }
    }

    pub(super) fn get(&self, i: usize, j: usize) -> Exchange {
        match self {
            Self::Repeats(repeats) => repeats.get(i, j),
            Self::Corners(sums) => sums.get(i, j),
        }
    }
}
