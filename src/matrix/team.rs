//! Ranks that work on one matrix, and the rows of each.

use std::ops::Range;
use std::sync::Arc;

use super::kernel::sizes::{SIDE, block_rows};
use crate::ranks::Ranks;

/// The ranks that work on one matrix, and the rows of each.
#[derive(Debug)]
pub struct Team {
    ranks: Arc<dyn Ranks>,
    /// The share of the rows that lie before the first of each rank, and 1 at the end, \[K + 1\].
    bounds: Vec<f64>,
}

impl Team {
    /// Gives each rank a range of the rows, so that all ranks have about as much work.
    ///
    /// `work` has the work of rows that lie at equal distances; without any, each rank has as many rows as the others. All ranks have to give the same numbers.
    #[must_use]
    pub fn new(ranks: &Arc<dyn Ranks>, work: &[f64]) -> Self {
        let size = ranks.size();
        let work = if work.is_empty() { &[1.0] } else { work };
        let total: f64 = work.iter().sum();
        let mut bounds = vec![0.0];
        let mut before = 0.0;
        for (k, &own) in work.iter().enumerate() {
            // The work before a bound grows evenly within the rows that a number stands for.
            while bounds.len() < size && before + own >= total * bounds.len() as f64 / size as f64 && own > 0.0 {
                let within = (total * bounds.len() as f64 / size as f64 - before) / own;
                bounds.push((k as f64 + within) / work.len() as f64);
            }
            before += own;
        }
        bounds.resize(size, 1.0);
        bounds.push(1.0);
        Self {
            ranks: Arc::clone(ranks),
            bounds,
        }
    }

    /// Returns the ranks.
    pub(super) fn ranks(&self) -> &dyn Ranks {
        &*self.ranks
    }

    /// Returns the blocks of rows that are a rank's, of an n by n matrix.
    pub(super) fn blocks_of(&self, n: usize, rank: usize) -> Range<usize> {
        let n_blocks = block_rows(n).len();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a share of the blocks"
        )]
        let blocks_before = |share: f64| (share * n_blocks as f64).round() as usize;
        blocks_before(self.bounds[rank])..blocks_before(self.bounds[rank + 1])
    }

    /// Returns the blocks of rows that are this rank's, of an n by n matrix.
    pub(super) fn own_blocks(&self, n: usize) -> Range<usize> {
        self.blocks_of(n, self.ranks.rank())
    }
}

/// Returns the rows of some blocks of an n by n matrix.
pub(super) fn rows_of(n: usize, blocks: &Range<usize>) -> Range<usize> {
    (blocks.start * SIDE).min(n)..(blocks.end * SIDE).min(n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranks::threads::on_ranks;

    /// Ranges follow one another, and have the same work to within a block on each side.
    #[test]
    fn ranges_of_ranks_have_equal_work() {
        let n = 64 * 100;
        for size in [1, 2, 3, 7, 13] {
            for work in [
                &[][..],
                &[1.0],
                &[3.0, 1.0],
                &[0.0, 0.0, 5.0, 0.0, 1.0],
                &[0.0],
                &[2.0; 9],
            ] {
                let ranges = on_ranks(size, |ranks| Team::new(&ranks, work).own_blocks(n));
                assert_eq!((ranges[0].start, ranges[size - 1].end), (0, 100));
                assert!(ranges.windows(2).all(|pair| pair[0].end == pair[1].start));
                let (total, per_block) = (work.iter().sum::<f64>(), work.len() as f64 / 100.0);
                if total == 0.0 {
                    continue;
                }
                let most = work.iter().copied().fold(0.0, f64::max) * per_block;
                for range in ranges {
                    // A block lies in the middle of what its number stands for.
                    let own = range.map(|block| work[(2 * block + 1) * work.len() / 200] * per_block);
                    let off = own.sum::<f64>() - total / size as f64;
                    assert!(off.abs() <= 2.0 * most, "{size} ranks, {work:?}: {off}");
                }
            }
        }
    }
}
