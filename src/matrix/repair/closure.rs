//! The repair that moves each entry by its own error: least squares under row sums and signs.

use std::ops::Range;

use super::balance::{BalanceReport, expect_targets};
use crate::matrix::checks::RowTargets;
use crate::matrix::error::MatrixError;
use crate::matrix::form_factors::FormFactors;
use crate::matrix::symmetric;
use crate::matrix::tile::{RowTally, RowTile, index};

/// The most halvings of a step that does not bring the row sums nearer to their targets.
const MAX_HALVINGS: usize = 8;

/// The unknowns of the dual problem: one multiplier per row, in units of 1 over the largest area.
type Multipliers = Vec<f64>;

/// An upper triangle of exchange areas with their variances, in units of the largest area; each moves in proportion to its variance.
struct Problem<'a> {
    factors: &'a FormFactors,
    /// A_i, in units of the largest.
    areas: Vec<f64>,
    /// The target sums of the rows of exchange areas, with their losses.
    targets: Vec<f64>,
    /// The loss of each row, with its variance.
    lost: Vec<(f64, f64)>,
    n_passes: usize,
}

impl FormFactors {
    /// Returns form factors whose rows sum to `targets`, each entry moved in proportion to its own variance.
    ///
    /// The exchange areas x_ij = x_ji ≥ 0 minimise Σ_{i ≤ j} (x_ij − a_ij)² / s_ij² under Σ_j x_ij = A_i sum_i, with a_ij = A_i F_ij and s_ij its standard
    /// error: x_ij = max(0, a_ij + s_ij² (λ_i + λ_j)). The loss of a row is one more entry of it, with the variance in `targets`. Entries without an error stay unchanged, so that partial pairs do not spoil full and hidden
    /// ones; reciprocity is kept to the last bit. The error of an entry becomes its step, where that is greater than the error.
    ///
    /// The repair corrects the row sums; entries improve as far as their errors locate the defect. For form factors by counts
    /// of rays, where an entry that was never hit has no error, use [`balanced`](Self::balanced).
    ///
    /// λ is found by Newton's method on the dual problem, whose linear systems (a Laplacian with plus signs) are solved by conjugate gradients with the diagonal as preconditioner.
    /// It stops when every row sum is within `tolerance` of its target, after `max_passes` passes over F, or when no step helps; the result is then the best one found, and
    /// the report states its error. Rows without any error keep their sums.
    ///
    /// Source: weighted least squares with its Karush-Kuhn-Tucker conditions. Departures: none.
    ///
    /// # Errors
    /// [`MatrixError::NotSymmetric`] unless [`is_symmetric`](Self::is_symmetric), [`MatrixError::Target`] if a target is
    /// negative or not finite, [`MatrixError::Value`] if an exchange area is too large for the precision of the storage, [`MatrixError::Disk`].
    ///
    /// # Panics
    /// If there is not one target per row.
    #[track_caller]
    pub fn closed(
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
        let area_max = self.areas.iter().copied().fold(0.0, f64::max);
        let areas: Vec<f64> = self.areas.iter().map(|area| area / area_max).collect();
        let mut problem = Problem {
            factors: self,
            targets: areas.iter().zip(&targets.sums).map(|(area, sum)| area * sum).collect(),
            lost: (0..areas.len())
                .map(|i| (areas[i] * targets.lost[i], areas[i].powi(2) * targets.lost_variance[i]))
                .collect(),
            areas,
            n_passes: 0,
        };
        let (multipliers, report) = self.if_readable(problem.solve(tolerance, max_passes))?;
        if multipliers.iter().all(|l| l.abs() <= 0.0) {
            return Ok((self.clone(), report));
        }
        let exchange = symmetric::from_blocks(&self.areas, self.storage(), |rows, columns| {
            let mut tile = RowTile::new(rows.start);
            let mut entries = Vec::new();
            for i in rows {
                entries.clear();
                problem.for_each_stored(i, i.max(columns.start)..columns.end, |j, a, s| {
                    if j >= i {
                        let moved = moved((i, j), (a, s * s), &multipliers).max(0.0);
                        entries.push((index(j), moved, s.max((moved - a).abs())));
                    }
                });
                tile.push_row(&entries, RowTally::default());
            }
            tile
        })?;
        Ok((self.if_readable(self.with_exchange(exchange))?, report))
    }
}

/// Returns a_ij + s_ij² (λ_i + λ_j), on the diagonal a_ii + s_ii² λ_i.
fn moved((i, j): (usize, usize), (a, variance): (f64, f64), multipliers: &[f64]) -> f64 {
    let other = if i == j { 0.0 } else { multipliers[j] };
    a + variance * (multipliers[i] + other)
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

impl Problem<'_> {
    fn for_each_in_row(&self, i: usize, mut visit: impl FnMut(usize, f64, f64)) {
        let area = self.areas[i];
        self.factors
            .for_each_in_row(i, |j, value, error| visit(j, area * value, area * error));
    }

    /// Visits the entries of a row that this rank stores, its own row or not.
    fn for_each_stored(&self, i: usize, columns: Range<usize>, mut visit: impl FnMut(usize, f64, f64)) {
        let (area, factor) = (self.areas[i], self.factors.row_factor(i));
        self.factors.entries.for_each(i, columns, &mut |j, number, error| {
            visit(j, area * (factor * number), area * (factor * error));
        });
    }

    /// Computes one number per row from its entries; one pass over F.
    fn pass(&mut self, term: impl Fn((usize, usize), (f64, f64)) -> f64 + Sync) -> Vec<f64> {
        self.n_passes += 1;
        let problem = &*self;
        let sum_of_row = |i| {
            let mut sum = 0.0;
            problem.for_each_in_row(i, |j, a, s| sum += term((i, j), (a, s * s)));
            [sum]
        };
        self.factors.numbers_of_rows(sum_of_row).into_flattened()
    }

    /// Returns the missing part of each row of exchange areas, and the greatest as a form factor, of those rows that can be moved.
    fn defect(&mut self, multipliers: &[f64], can_move: &[bool]) -> (Vec<f64>, f64) {
        let mut defect = self.pass(|place, entry| moved(place, entry, multipliers).max(0.0));
        let mut worst: f64 = 0.0;
        for (i, sum) in defect.iter_mut().enumerate() {
            let lost = moved((i, i), self.lost[i], multipliers).max(0.0);
            *sum = self.targets[i] - *sum - lost;
            if can_move[i] {
                worst = worst.max((*sum / self.areas[i]).abs());
            }
        }
        (defect, worst)
    }

    /// Returns for each row whether it has any entry or loses light, and whether one of these has an error; one pass over F.
    fn what_rows_have(&mut self) -> (Vec<bool>, Vec<bool>) {
        self.n_passes += 1;
        let problem = &*self;
        let of_row = |i| {
            let (lost, variance) = problem.lost[i];
            let (mut sees, mut can_move) = (lost > 0.0, variance > 0.0);
            problem.for_each_in_row(i, |_, a, s| {
                sees |= a > 0.0 || s > 0.0;
                can_move |= s > 0.0;
            });
            [sees, can_move].map(f64::from)
        };
        let rows = self.factors.numbers_of_rows(of_row).into_iter();
        rows.map(|[sees, can_move]| (sees > 0.0, can_move > 0.0)).unzip()
    }

    /// Returns the best multipliers found, and their report.
    fn solve(&mut self, tolerance: f64, max_passes: usize) -> (Multipliers, BalanceReport) {
        let mut best = vec![0.0; self.areas.len()];
        // The missing part of a row without any error stays, and must not hide the progress of the others.
        let (sees, can_move) = self.what_rows_have();
        let (mut defect, mut worst) = self.defect(&best, &can_move);
        while worst > tolerance && self.n_passes < max_passes {
            let step = self.newton_step(&best, &defect, tolerance, max_passes);
            let better = (0..=MAX_HALVINGS).find_map(|k| {
                let part = 0.5_f64.powi(i32::try_from(k).unwrap_or(i32::MAX));
                let next: Multipliers = best.iter().zip(&step).map(|(l, d)| l + part * d).collect();
                let (of_next, worst_of_next) = self.defect(&next, &can_move);
                (worst_of_next < worst).then_some((next, of_next, worst_of_next))
            });
            let Some(found) = better else {
                break;
            };
            (best, defect, worst) = found;
        }
        let lacks = defect.iter().zip(&self.areas).map(|(lack, area)| (lack / area).abs());
        let row_error_max = lacks.fold(0.0, f64::max);
        let report = BalanceReport {
            n_passes: self.n_passes,
            row_error_max,
            n_empty_rows: sees
                .iter()
                .zip(&self.targets)
                .filter(|(sees, target)| !**sees && **target > 0.0)
                .count(),
            converged: row_error_max <= tolerance,
        };
        (best, report)
    }

    /// Solves Σ_j s_ij² (d_i + d_j) = defect over the entries that are not at zero, by conjugate gradients.
    fn newton_step(&mut self, multipliers: &[f64], defect: &[f64], tolerance: f64, max_passes: usize) -> Vec<f64> {
        let variance_of = |place: (usize, usize), entry: (f64, f64)| {
            if moved(place, entry, multipliers) > 0.0 {
                entry.1
            } else {
                0.0
            }
        };
        let of_lost: Vec<f64> = (0..self.lost.len())
            .map(|i| variance_of((i, i), self.lost[i]))
            .collect();
        let mut diagonal = self.pass(variance_of);
        diagonal.iter_mut().zip(&of_lost).for_each(|(d, v)| *d += v);
        let scaled = |r: &[f64]| -> Vec<f64> {
            let ratio = |(x, d): (&f64, &f64)| if *d > 0.0 { x / d } else { 0.0 };
            r.iter().zip(&diagonal).map(ratio).collect()
        };
        // The missing part of a row without an error cannot be supplied.
        let give = |(r, d): (&f64, &f64)| if *d > 0.0 { *r } else { 0.0 };
        let mut r: Vec<f64> = defect.iter().zip(&diagonal).map(give).collect();
        let mut z = scaled(&r);
        let (mut direction, mut rz) = (z.clone(), dot(&r, &z));
        let mut step = vec![0.0; r.len()];
        while self.n_passes < max_passes {
            let most = r.iter().zip(&self.areas).map(|(r, area)| (r / area).abs());
            if most.fold(0.0, f64::max) <= 0.1 * tolerance {
                break;
            }
            let mut image = self.pass(|(i, j), entry| {
                let other = if i == j { 0.0 } else { direction[j] };
                variance_of((i, j), entry) * (direction[i] + other)
            });
            for (i, q) in image.iter_mut().enumerate() {
                *q += of_lost[i] * direction[i];
            }
            let curvature = dot(&direction, &image);
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let alpha = rz / curvature;
            step.iter_mut().zip(&direction).for_each(|(s, d)| *s += alpha * d);
            r.iter_mut().zip(&image).for_each(|(r, q)| *r -= alpha * q);
            z = scaled(&r);
            let next_rz = dot(&r, &z);
            let beta = next_rz / rz;
            rz = next_rz;
            direction.iter_mut().zip(&z).for_each(|(d, z)| *d = z + beta * *d);
        }
        step
    }
}
