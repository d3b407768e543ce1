//! The exact method to a tolerance on row sums instead of entries.

use std::path::Path;
use std::time::Instant;

use super::method::ExactMethod;
use crate::form_factor::{ComputeResult, Computed, FormFactorError, FormFactorMethod, Input};
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

/// The tolerance of entries at which the search for one that rows meet begins, as a part of theirs.
///
/// At 1e-3 to 1e-5 the worst rows of a room, a sphere in a room and a city of about 1,000 to 4,332 faces had errors of 7 to 80 times it; a tenth of it took 1.1 to 2 times as long.
const FIRST: f64 = 0.1;

/// The same, at most.
const LOOSEST: f64 = 0.1;

/// The least tolerance of entries that is tried.
const LEAST: f64 = 1e-12;

/// The part of the tolerance of rows that is aimed at.
const BEYOND: f64 = 0.7;

/// The power of the error by which the tolerance changes: errors of rows fall more slowly.
const POWER: f64 = 1.5;

/// The part of the worst row's error above which a tighter tolerance counts as no help.
const STUCK: f64 = 0.8;

/// The part of a tolerance that is tried where the one before was no help.
const FAR: f64 = 0.1;

/// Exchange areas such that every row's error is within a tolerance.
///
/// The error of a row is the sum over j of the errors that its entries state: all of one row may have one sign. Entries are computed to a tenth of `row_tolerance` first,
/// and again to a smaller tolerance as long as a row is above it; with a checkpoint, the first of these computations
/// continues where an earlier run ended. Where entries miss their own tolerance and that does not help, as with rounded corners, [`Computed::tolerance_met`] is false.
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

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        if self.row_tolerance.is_nan() || self.row_tolerance <= 0.0 {
            return Err(FormFactorError::NotApplicable {
                method: "exact",
                reason: format!("the tolerance of rows is {}; give one above 0", self.row_tolerance),
            });
        }
        let mut method = ExactMethod {
            tolerance: (FIRST * self.row_tolerance).clamp(LEAST, LOOSEST),
            budget: self.budget,
        };
        let mut found = method.compute(input, storage, progress)?;
        let mut worst = worst_row(&found.factors);
        let mut most = 1.0;
        while worst > self.row_tolerance {
            method.tolerance *= (BEYOND * (self.row_tolerance / worst).powf(POWER)).min(most);
            if method.tolerance < LEAST || progress.is_late() {
                break;
            }
            // Only one matrix is held at a time, and a checkpoint has the pieces of one tolerance only.
            drop(found);
            found = method.compute(input, storage, &Unkept(progress))?;
            let before = std::mem::replace(&mut worst, worst_row(&found.factors));
            let is_stuck = worst > STUCK * before;
            // With entries within a tolerance of T / n, rows of n are within T: only where they miss theirs no tolerance helps.
            if is_stuck && !found.tolerance_met {
                break;
            }
            most = if is_stuck { FAR } else { 1.0 };
        }
        Ok(Computed {
            tolerance_met: worst <= self.row_tolerance,
            ..found
        })
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
