//! Repairs: reciprocity by averaging with the transpose, row sums by a symmetric scaling.

use std::sync::Arc;

use serde::Serialize;

use crate::matrix::backend::Backend;
use crate::matrix::bounds::Open;
use crate::matrix::checks::RowTargets;
use crate::matrix::error::MatrixError;
use crate::matrix::form_factors::FormFactors;
use crate::matrix::kernel::sizes::SIDE;
use crate::matrix::operator::{Block, LinearOperator};
use crate::matrix::symmetric;
use crate::matrix::tile::{RowTally, RowTile, index};
use crate::matrix::transpose::{Pair, RowBlock};
use crate::threads;

/// How a balance went.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct BalanceReport {
    /// Passes over F.
    pub n_passes: usize,
    /// max_i |Σ_j F_ij + lost_i − target_i| of the result, lost_i as the repair left it, over the rows that see anything or lose light.
    pub row_error_max: f64,
    /// Rows with a positive target that see nothing and lose nothing: no scaling can give them a sum.
    pub n_empty_rows: usize,
    /// True if `row_error_max` is within the tolerance.
    pub converged: bool,
}

/// The size of a factor d_i at which no scaling exists: the factors would go on to infinity and zero.
const RUNAWAY_FROM: f64 = 1e100;

/// Refuses row sums that form factors cannot have.
pub(in crate::matrix) fn expect_targets(targets: &RowTargets) -> Result<(), MatrixError> {
    for numbers in [&targets.sums, &targets.lost] {
        if let Some(row) = numbers.iter().position(|t| !(t.is_finite() && *t >= 0.0)) {
            let target = numbers[row];
            return Err(MatrixError::Target { row, target });
        }
    }
    Ok(())
}

impl FormFactors {
    /// Returns form factors with symmetric exchange areas: the weighted mean of A_i F_ij and A_j F_ji.
    ///
    /// a_ij = w A_i F_ij + (1 − w) A_j F_ji, symmetric to the last bit; its standard error is that of independent
    /// estimates. A matrix that is symmetric already is returned unchanged. Row sums change: on noisy form factors call
    /// [`balanced`](Self::balanced) next, without which the radiosities of a bright room get worse.
    ///
    /// Each estimate counts by the inverse of its variance. Between two rows of rays the variances are a A_i / N_i and a A_j / N_j
    /// for the same true exchange area a (up to 1 − F), so the weights are N_i / A_i and N_j / A_j: weights from the counts
    /// themselves would favour the estimate that happens to be smaller. Otherwise the weights are those of the standard errors,
    /// where both are known; where not, each counts half.
    /// Source: weighted least squares. Departures: none.
    ///
    /// # Errors
    /// [`MatrixError::Value`] if an exchange area is too large for the precision of the storage, [`MatrixError::Disk`].
    pub fn symmetrised(&self) -> Result<Self, MatrixError> {
        if self.is_symmetric() {
            return Ok(self.clone());
        }
        let area_max = self.areas.iter().copied().fold(0.0, f64::max);
        // N_i / A_i, the inverse of the variance of a row's exchange areas but for a factor that both estimates share.
        let rays = self.tallies.iter().map(RowTally::effective_rays);
        let ray_weights = rays.zip(&self.areas).map(|(n, area)| n.map(|n| n / (area / area_max)));
        let ray_weights: Vec<Option<f64>> = ray_weights.collect();
        let upper = |block: &RowBlock<'_>, columns: std::ops::Range<usize>| {
            let rows = block.rows.clone();
            let mut lists = vec![Vec::new(); rows.len()];
            block.for_each_pair(columns.start, |i, j, pair| {
                if j >= i && j < columns.end {
                    let weights = ray_weights[i].zip(ray_weights[j]);
                    let (exchange, std_error) = self.mean_exchange(weights, area_max, (i, j), &pair);
                    lists[i - rows.start].push((index(j), exchange, std_error));
                }
            });
            let mut tile = RowTile::new(rows.start);
            for list in &lists {
                tile.push_row(list, RowTally::default());
            }
            tile
        };
        let exchange = if self.needs_columns() {
            symmetric::from_parts(&self.areas, self.storage(), |add| {
                let mut added = Ok(());
                self.for_each_round(SIDE, |blocks| {
                    let tiles = threads::collect_from(blocks, |block| upper(block, block.rows.start..self.n_rows()));
                    let came = self.sent_by_all(&tiles);
                    added = std::mem::replace(&mut added, Ok(())).and_then(|()| add(came));
                });
                added
            })?
        } else {
            let upper = |rows, columns| upper(&self.row_block(rows), columns);
            symmetric::from_blocks(&self.areas, self.storage(), upper)?
        };
        Ok(self.if_readable(self.with_exchange(exchange))?)
    }

    /// Returns form factors whose rows sum to `targets`, by a symmetric scaling of the exchange areas.
    ///
    /// a'_ij = d_i d_j a_ij with d such that Σ_j a'_ij + d_i A_i lost_i = A_i sum_i. Reciprocity is kept to the last bit, and entries that
    /// are zero stay zero. Standard errors are scaled where that makes them greater, as a scaling does not make a number more accurate. The step of an entry is added
    /// to its error, as the former value may have been right: the error of a row is often that of one entry alone.
    /// Every pass replaces d_i by d_i sqrt(sum_i / row sum_i). In a cube the error halves with every pass: 33 passes to 1e-12, for 384 patches and for 6144.
    ///
    /// The loss of a row is scaled like its entries, as one more column, of a sky without a row whose sum is to be kept. In an open scene a row's loss is a
    /// count of its own rays and no better than its entries, which by then rest on the rays of both ends. With the loss fixed as it was counted, a patch that missed a
    /// small one with all of its rays would see nothing at all, and the other's hits would be lost with its misses. Sum and loss together are exactly 1 by geometry.
    /// Where losses are positive such a d always exists. Rows without a known loss have the loss 0, and sums that are met exactly.
    ///
    /// It stops when every row sum is within `tolerance` of its target, after `max_passes` (at least one), or when a factor
    /// runs away; the result is then the best one found, and the report states its error. Rows that see nothing stay empty.
    /// Without losses such a d exists if the zeros allow it: two patches that see only each other cannot both have the sum 1 unless their
    /// areas are equal.
    /// Source: Knight, Ruiz and Uçar 2014, "A symmetry preserving algorithm for matrix scaling", in the 1-norm.
    /// Departures: the row sums have targets other than 1; a column without a target.
    ///
    /// # Errors
    /// [`MatrixError::NotSymmetric`] unless [`is_symmetric`](Self::is_symmetric), [`MatrixError::Target`] if a target is
    /// negative or not finite, [`MatrixError::Disk`].
    ///
    /// # Panics
    /// If there is not one target per row.
    #[track_caller]
    pub fn balanced(
        &self,
        targets: impl Into<RowTargets>,
        tolerance: f64,
        max_passes: usize,
    ) -> Result<(Self, BalanceReport), MatrixError> {
        let targets = targets.into();
        targets.expect_rows(self.n_rows());
        if !self.is_symmetric() {
            return Err(MatrixError::NotSymmetric);
        }
        expect_targets(&targets)?;
        let (scaling, report) = self.if_readable(self.scaling(&targets, tolerance, max_passes))?;
        Ok((self.with_exchange(self.entries.scaled(&scaling)?), report))
    }

    /// Returns the best d found, and its report.
    fn scaling(&self, targets: &RowTargets, tolerance: f64, max_passes: usize) -> (Vec<f64>, BalanceReport) {
        let n = self.n_rows();
        let mut scaling = Block::from_values(vec![1.0; n], 1);
        let mut seen = Block::zeros(n, 1);
        let mut best = (scaling.values().to_vec(), f64::INFINITY, 0);
        let mut n_passes = 0;
        loop {
            n_passes += 1;
            self.apply(&scaling, &mut seen);
            let mut error_max: f64 = 0.0;
            let mut n_empty = 0;
            let mut next = scaling.clone();
            for (i, d) in next.values_mut().iter_mut().enumerate() {
                let target = targets.sums[i];
                let row_sum = *d * (seen.values()[i] + targets.lost[i]);
                if row_sum > 0.0 {
                    error_max = error_max.max((row_sum - target).abs());
                    *d *= (target / row_sum).sqrt();
                } else {
                    n_empty += usize::from(target > 0.0);
                }
            }
            if error_max < best.1 {
                best = (scaling.values().to_vec(), error_max, n_empty);
            }
            let ran_away = next.values().iter().any(|d| !d.is_finite() || *d > RUNAWAY_FROM);
            if best.1 <= tolerance || n_passes >= max_passes || ran_away {
                break;
            }
            scaling = next;
        }
        let (best_scaling, row_error_max, n_empty_rows) = best;
        let converged = row_error_max <= tolerance;
        let report = BalanceReport {
            n_passes,
            row_error_max,
            n_empty_rows,
            converged,
        };
        (best_scaling, report)
    }

    /// Returns the mean of A_i F_ij and A_j F_ji and its standard error, both divided by `area_max`.
    ///
    /// Swapping i and j swaps terms of commutative operations only, so that the result is the same to the last bit.
    fn mean_exchange(
        &self,
        ray_weights: Option<(f64, f64)>,
        area_max: f64,
        (i, j): (usize, usize),
        pair: &Pair,
    ) -> (f64, f64) {
        let (a_i, a_j) = (self.areas[i] / area_max, self.areas[j] / area_max);
        let (x, x_error) = (a_i * pair.there.0, a_i * pair.there.1);
        let (y, y_error) = (a_j * pair.back.0, a_j * pair.back.1);
        let by_errors = || {
            let ratio = x_error.max(y_error);
            let are_known = x_error > 0.0 && y_error > 0.0;
            are_known.then(|| ((ratio / x_error).powi(2), (ratio / y_error).powi(2)))
        };
        let (p, q) = ray_weights.or_else(by_errors).unwrap_or((1.0, 1.0));
        let (p, q) = (p / (p + q), q / (p + q));
        // f64::hypot is not required to be symmetric in its arguments to the last bit.
        let std_error = ((p * x_error).powi(2) + (q * y_error).powi(2)).sqrt();
        (p * x + q * y, std_error)
    }

    /// Returns form factors with other exchange areas between the same patches.
    pub(in crate::matrix) fn with_exchange(&self, exchange: Arc<dyn Backend>) -> Self {
        let mut factors = Self::of(self.areas.clone(), exchange, self.tallies.clone(), self.storage());
        factors.open = self.open.as_ref().map(Open::pooled);
        factors
    }
}
