//! The repair of rows of low-discrepancy rays: it adds the other patch's rays, and keeps the sums of the rows.

use crate::matrix::bounds::Open;
use crate::matrix::error::MatrixError;
use crate::matrix::form_factors::FormFactors;
use crate::matrix::kernel::sizes::{SIDE, block_rows};
use crate::matrix::tile::{Entry, RowTile, index};
use crate::matrix::transpose::{Pair, RowBlock};
use crate::threads;

/// The variance of a row's own entries relative to that of independent rays, in its effect on Σ_j F_ij B_j.
///
/// Errors of neighbouring entries in a row of low-discrepancy rays cancel: a ray that a net sends to one of two neighbours is missing at the other. Those of the reverse entries, which
/// come from as many other rows, do not cancel. 0.3 gave the least error of B of 1, 0.3, 0.1, 0.03 and 0.01 over seven scenes.
const OWN_VARIANCE: f64 = 0.3;

/// Rows that are computed at the same time, in at least as many blocks as there are threads.
const AT_ONCE: usize = 2048;

impl FormFactors {
    /// Returns form factors whose entries are means with their reverse ones, weighted by inverse variances, and whose rows keep their sums.
    ///
    /// F'_ij = w F_ij + (1 − w) A_j F_ji / A_i with w = p_i / (p_i + p_j), p_i = N_i / (0.3 A_i) and p_j = N_j / A_j. The variances of the two are A_i F_ij A_i / N_i and
    /// A_i F_ij A_j / N_j but for the factor 0.3: a row of low-discrepancy rays is more accurate in sums of neighbouring entries than entry by entry. The part of Σ_j F_ij, a sum
    /// that the row's own rays count exactly, that a row then misses is shared out by the variances of its entries. Small patches are so found by their own rays, and patches of equal size keep most of their own
    /// estimates. Rows without independent rays, and symmetric form factors, stay unchanged.
    ///
    /// Entries are not symmetric: A_i F_ij and A_j F_ji agree to the remaining noise.
    /// Error of an entry: that of the mean of independent estimates, or the step by the row's sum, where that is greater.
    /// Source: weighted least squares. Departures: the factor 0.3 is measured.
    ///
    /// # Errors
    /// [`MatrixError::Disk`], and as [`from_tiles`](Self::from_tiles).
    pub fn pooled(&self) -> Result<Self, MatrixError> {
        if self.is_symmetric() {
            return Ok(self.clone());
        }
        let mut pooled = if self.needs_columns() {
            Self::from_own_rows(self.areas.clone(), self.tallies.clone(), self.storage(), |push| {
                let mut pushed = Ok(());
                self.for_each_round(SIDE, |blocks| {
                    for tile in threads::collect_from(blocks, |block| self.pooled_rows(block)) {
                        pushed = std::mem::replace(&mut pushed, Ok(())).and_then(|()| push(&tile));
                    }
                });
                pushed
            })?
        } else {
            // Tiles begin in the same rows on any number of ranks, and so are stored alike.
            let blocks: Vec<_> = block_rows(self.n_rows()).collect();
            let n_at_once = (AT_ONCE / SIDE).max(rayon::current_num_threads());
            let tiles = blocks
                .chunks(n_at_once)
                .flat_map(|some| threads::collect_from(some, |rows| self.pooled_rows(&self.row_block(rows.clone()))));
            Self::from_tiles(self.areas.clone(), tiles, self.storage())?
        };
        pooled.open = self.open.as_ref().map(Open::pooled);
        Ok(self.if_readable(pooled)?)
    }

    fn pooled_rows(&self, block: &RowBlock<'_>) -> RowTile {
        let rows = block.rows.clone();
        let mut lists: Vec<Vec<Pooled>> = vec![Vec::new(); rows.len()];
        let mut sums = vec![0.0; rows.len()];
        block.for_each_pair(0, |i, j, pair| {
            lists[i - rows.start].push(self.pooled_entry((i, j), &pair));
            sums[i - rows.start] += pair.there.0;
        });
        let mut tile = RowTile::new(rows.start);
        for ((i, list), sum) in rows.zip(&lists).zip(sums) {
            tile.push_row(&with_sum(list, sum), self.tallies[i]);
        }
        tile
    }

    fn pooled_entry(&self, (i, j): (usize, usize), pair: &Pair) -> Pooled {
        let rays = |k: usize| self.tallies[k].effective_rays();
        let (value, error) = pair.there;
        let Some((n_i, n_j)) = rays(i).zip(rays(j)).filter(|_| i != j) else {
            let column = index(j);
            return Pooled {
                column,
                value,
                error,
                variance: error * error,
            };
        };
        let ratio = self.areas[j] / self.areas[i];
        let reverse = ratio * pair.back.0;
        // An entry that no ray of one patch hit has the noise of a count at the value of the other's rays.
        let noise = |k: usize, (found, stated): (f64, f64), other: f64| {
            if found > 0.0 {
                stated
            } else {
                self.tallies[k].noise_of_missed(other)
            }
        };
        let own_error = noise(i, pair.there, reverse);
        let reverse_error = ratio * noise(j, pair.back, value / ratio);
        // The precisions p_i and p_j, both times A_i A_j.
        let (own, other) = (n_i * self.areas[j] / OWN_VARIANCE, n_j * self.areas[i]);
        let (w, v) = (own / (own + other), other / (own + other));
        let mean = w * value + v * reverse;
        Pooled {
            column: index(j),
            value: mean,
            error: (w * own_error).hypot(v * reverse_error),
            variance: mean * self.areas[j] / (own + other),
        }
    }
}

/// An entry before the correction of its row's sum.
#[derive(Clone, Copy)]
struct Pooled {
    column: u32,
    value: f64,
    error: f64,
    /// Its variance, up to a factor common to the row.
    variance: f64,
}

/// Returns entries with the sum `sum`: the missing part is shared out by their variances.
fn with_sum(list: &[Pooled], sum: f64) -> Vec<Entry> {
    let found: f64 = list.iter().map(|entry| entry.value).sum();
    let variance: f64 = list.iter().map(|entry| entry.variance).sum();
    let step = if variance > 0.0 { (sum - found) / variance } else { 0.0 };
    let moved: Vec<f64> = list
        .iter()
        .map(|entry| (entry.value + step * entry.variance).max(0.0))
        .collect();
    // Where entries stop at zero, the others are too large, and rounding leaves some.
    let total: f64 = moved.iter().sum();
    let scale = if total > 0.0 { sum / total } else { 1.0 };
    let entries = list.iter().zip(moved).map(|(entry, value)| {
        let value = value * scale;
        (entry.column, value, entry.error.max((value - entry.value).abs()))
    });
    entries.collect()
}
