//! The exact method to a tolerance on row sums instead of entries.

use std::path::Path;
use std::time::Instant;

use super::batches::Finer;
use super::method::ExactMethod;
use super::stated::STORED;
use crate::form_factor::{ComputeResult, FormFactorError, FormFactorMethod, Input};
use crate::matrix::{FormFactors, StorageChoice};
use crate::progress::{Forecast, Progress};
use crate::ranks::Ranks;
use crate::setting::{Kind, Setting};

/// The error that the sum of each row may have.
pub static ROW_TOLERANCE: Setting = Setting {
    name: "row_tolerance",
    help: "The error that the sum of each row may have, in place of the tolerance of single form factors",
    letter: "T",
    kind: Kind::Number,
};

/// The tolerances of all entries at first: that of rows, between these.
///
/// Of a sphere in a room and a city of 2,300 faces, a tenth of it took 1.2 times as long in all.
const FIRST: [f64; 2] = [LEAST, 0.1];

/// The least error that is asked of an entry.
const LEAST: f64 = 1e-12;

/// The part of the worst row's error above which a further computation counts as no help.
const STUCK: f64 = 0.8;

/// Exchange areas such that every row's error is within a tolerance.
///
/// The error of a row is the sum over j of the errors that its entries state: all of one row may have one sign. Entries are computed to `row_tolerance` first. Where a row is above it,
/// its greatest errors are brought down to one level at which the row is within the tolerance: only partial pairs above the level of either row are computed again, beside the first result. With a checkpoint, the first computation
/// continues where an earlier run ended. Where entries miss their level and that does not help, as with rounded corners, [`Computed::tolerance_met`](crate::form_factor::Computed::tolerance_met) is false.
///
/// [`PairCounts::n_rays`](crate::form_factor::PairCounts::n_rays) are the rays of all computations; a pair counts as clipped or by rays each time that it was computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactRows {
    /// The tolerance of Σ_j F_ij, above 0.
    pub row_tolerance: f64,
    /// The most evaluations of the inner form factor for one pair.
    pub budget: usize,
}

impl FormFactorMethod for ExactRows {
    fn name(&self) -> &'static str {
        "exact"
    }

    fn working_byte(&self, n_patches: usize) -> u64 {
        ExactMethod::default().working_byte(n_patches)
    }

    fn matrices_beside(&self) -> u32 {
        1
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        if self.row_tolerance.is_nan() || self.row_tolerance <= 0.0 {
            return Err(FormFactorError::NotApplicable {
                method: "exact",
                reason: format!("the tolerance of rows is {}; give one above 0", self.row_tolerance),
            });
        }
        let [least, most] = FIRST;
        let method = ExactMethod {
            tolerance: self.row_tolerance.clamp(least, most),
            budget: self.budget,
        };
        let areas = input.mesh.areas();
        let mut found = method.compute(input, storage, progress)?;
        let mut worst = worst_row(&found.factors);
        let mut allowed = vec![f64::INFINITY; areas.len()];
        while worst > self.row_tolerance && !progress.is_late() {
            let rows = Rows {
                factors: &found.factors,
                areas: &areas,
                tolerance: method.tolerance,
                allowed: &allowed,
            };
            let levels = rows.levels(self.row_tolerance);
            if levels == allowed {
                break;
            }
            let finer = Finer {
                factors: &found.factors,
                allowed: &levels,
            };
            let earlier = found.pairs.unwrap_or_default();
            // A checkpoint has the pieces of the first computation only.
            found = method.refine(input, finer, storage, &Unkept(progress))?;
            if let Some(pairs) = &mut found.pairs {
                pairs.clipped += earlier.clipped;
                pairs.by_rays += earlier.by_rays;
                pairs.n_rays += earlier.n_rays;
            }
            allowed = levels;
            let before = std::mem::replace(&mut worst, worst_row(&found.factors));
            if worst > STUCK * before {
                break;
            }
        }
        found.tolerance_met = worst <= self.row_tolerance;
        if let Some(pairs) = found.pairs.as_mut().filter(|_| found.tolerance_met) {
            // Entries above their level do not matter where their rows are within the tolerance.
            (pairs.n_above_tolerance, pairs.n_above_by_rounding) = (0, 0);
        }
        Ok(found)
    }
}

/// Computed rows, and the errors that their entries were allowed.
struct Rows<'a> {
    factors: &'a FormFactors,
    /// A_i, m².
    areas: &'a [f64],
    /// Of A_i F_ij / min(A_i, A_j).
    tolerance: f64,
    /// See [`Finer::allowed`].
    allowed: &'a [f64],
}

impl Rows<'_> {
    /// Returns for each row the error of its exchange areas, m², that brings it to a tolerance where all that have more are brought down to it; the one before for rows within the tolerance, and for those that it cannot help.
    fn levels(&self, row_tolerance: f64) -> Vec<f64> {
        let of_row = |i: usize| [self.level(i, row_tolerance * self.areas[i]).unwrap_or(self.allowed[i])];
        self.factors.numbers_of_rows(of_row).into_flattened()
    }

    /// Returns the level L such that the errors of row i, min(error, L), sum to `rest`, m²; `None` where they are within it already, or those that missed their level before are above it.
    fn level(&self, i: usize, mut rest: f64) -> Option<f64> {
        let area = self.areas[i];
        let mut errors = Vec::new();
        self.factors.for_each_in_row(i, |j, _, error| {
            let error = error * area;
            let goal = self.tolerance * area.min(self.areas[j]);
            let goal = goal.min(self.allowed[i]).min(self.allowed[j]);
            if error > goal * (1.0 + STORED) {
                rest -= error;
            } else if error > 0.0 {
                errors.push(error);
            }
        });
        errors.sort_unstable_by(f64::total_cmp);
        for (k, error) in errors.iter().enumerate() {
            let n = errors.len() - k;
            if error * n as f64 > rest {
                return (rest > 0.0).then(|| (rest / n as f64).max(LEAST * area));
            }
            rest -= error;
        }
        None
    }
}

/// Returns the greatest error of a row: the sum of the errors that its entries state.
pub fn worst_row(factors: &FormFactors) -> f64 {
    let of_row = |i: usize| {
        let mut sum = 0.0;
        factors.for_each_in_row(i, |_, _, error| sum += error);
        [sum]
    };
    factors
        .numbers_of_rows(of_row)
        .into_flattened()
        .into_iter()
        .fold(0.0, f64::max)
}

/// Progress without a checkpoint.
struct Unkept<'a>(&'a dyn Progress);

impl Progress for Unkept<'_> {
    fn begin(&self, stage: &str, total: u64) {
        self.0.begin(stage, total);
    }

    fn advance(&self, steps: u64) {
        self.0.advance(steps);
    }

    fn forecast(&self, forecast: &Forecast) {
        self.0.forecast(forecast);
    }

    fn deadline(&self) -> Option<Instant> {
        self.0.deadline()
    }

    fn is_late(&self) -> bool {
        self.0.is_late()
    }

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    fn opened(&self, checkpoint: &Path) {
        self.0.opened(checkpoint);
    }

    fn ranks(&self) -> &dyn Ranks {
        self.0.ranks()
    }
}
