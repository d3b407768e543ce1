//! Checks of form factors by their own closure, reciprocity and bounds.

use serde::Serialize;

use super::form_factors::FormFactors;
use super::transpose::RowBlock;

/// Least and greatest of some values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct MinMax {
    /// The least.
    pub min: f64,
    /// The greatest.
    pub max: f64,
}

/// Checks of closure and reciprocity. Values that are not finite are refused before, by
/// [`FormFactors::from_tiles`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Checks {
    /// Least and greatest Σ_j F_ij.
    pub row_sum: MinMax,
    /// max_i |1 − Σ_j F_ij| over the rows that are known to sum to 1. Over the others that have rays max_i |1 − Σ_j F_ij − sky_i − back_i|, with the fractions of
    /// the row's rays that escaped and that backs took. `None` if there are neither.
    pub closure_error_max: Option<f64>,
    /// max_ij |A_i F_ij − A_j F_ji| / min(A_i, A_j).
    pub reciprocity_error_max: f64,
    /// max_ij A_i F_ij / min(A_i, A_j): above 1, more light would arrive than can.
    pub exchange_ratio_max: f64,
    /// How many F_ij are negative.
    pub n_negative: u64,
    /// Rays of all rows.
    pub n_rays: u64,
    /// Rays of all rows that hit nothing.
    pub n_escaped: u64,
    /// Rays of all rows that hit a back.
    pub n_absorbed: u64,
}

/// The rows that are known to sum to 1: those of patches all of whose light arrives at fronts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Closed<'a> {
    /// All, or none.
    Everywhere(bool),
    /// The rows for which this is true, \[n\].
    Where(&'a [bool]),
}

impl Closed<'_> {
    /// Returns whether row `i` is known to sum to 1.
    #[must_use]
    pub fn row(&self, i: usize) -> bool {
        match self {
            Self::Everywhere(closed) => *closed,
            Self::Where(rows) => rows[i],
        }
    }
}

impl From<bool> for Closed<'_> {
    fn from(closed: bool) -> Self {
        Self::Everywhere(closed)
    }
}

impl<'a> From<&'a [bool]> for Closed<'a> {
    fn from(rows: &'a [bool]) -> Self {
        Self::Where(rows)
    }
}

/// The expected row sums, \[n\] each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RowTargets {
    /// Σ_j F_ij + lost_i.
    pub sums: Vec<f64>,
    /// An estimate of the fraction of the row's light that no front receives, where that is uncertain.
    ///
    /// It may be changed as the entries are. 0 in rows whose sums are to be met exactly.
    pub lost: Vec<f64>,
    /// The variance of each estimate.
    pub lost_variance: Vec<f64>,
}

impl RowTargets {
    /// Lets a row keep its sum.
    ///
    /// # Panics
    /// If there is no such row.
    #[track_caller]
    pub fn keep(&mut self, row: usize, sum: f64) {
        self.sums[row] = sum.max(0.0);
        self.lost[row] = 0.0;
        self.lost_variance[row] = 0.0;
    }

    #[track_caller]
    pub(super) fn expect_rows(&self, n: usize) {
        let lengths = [self.sums.len(), self.lost.len(), self.lost_variance.len()];
        assert_eq!(lengths, [n; 3], "one target per row");
    }
}

impl<T: AsRef<[f64]> + ?Sized> From<&T> for RowTargets {
    /// Returns sums that are to be met exactly.
    fn from(sums: &T) -> Self {
        let sums = sums.as_ref();
        Self {
            sums: sums.to_vec(),
            lost: vec![0.0; sums.len()],
            lost_variance: vec![0.0; sums.len()],
        }
    }
}

impl From<&Self> for RowTargets {
    fn from(targets: &Self) -> Self {
        targets.clone()
    }
}

impl FormFactors {
    /// Checks closure, reciprocity, bounds and signs; one pass over F and its transpose.
    ///
    /// `closed`: the rows that sum to 1; true for all if light cannot leave the scene and no back can be seen.
    /// Accuracy: rounding, about 1e-16 in each difference and n 1e-16 in each sum.
    #[must_use]
    pub fn checks<'a>(&self, closed: impl Into<Closed<'a>>) -> Checks {
        let closed = closed.into();
        let blocks = self.map_row_blocks(|block| self.check_rows(block, closed));
        let own = blocks.into_iter().fold(nothing(), join);
        let of_ranks = self.gathered(own.numbers().to_vec());
        let of_ranks = of_ranks.as_chunks().0.iter().map(Checks::of_numbers);
        let mut checks = of_ranks.fold(nothing(), join);
        for tally in self.tallies() {
            checks.n_rays += tally.n_rays;
            checks.n_escaped += tally.n_escaped;
            checks.n_absorbed += tally.n_absorbed;
        }
        checks
    }

    fn check_rows(&self, block: &RowBlock<'_>, closed: Closed<'_>) -> Checks {
        let rows = block.rows.clone();
        let mut checks = nothing();
        let mut row_sums = vec![0.0; rows.len()];
        block.for_each_pair(0, |i, j, pair| {
            let (a_i, a_j) = (self.areas[i], self.areas[j]);
            let (there, back) = (a_i * pair.there.0, a_j * pair.back.0);
            let smaller = a_i.min(a_j);
            checks.reciprocity_error_max = checks.reciprocity_error_max.max((there - back).abs() / smaller);
            checks.exchange_ratio_max = checks.exchange_ratio_max.max(there / smaller);
            checks.n_negative += u64::from(pair.there.0 < 0.0);
            row_sums[i - rows.start] += pair.there.0;
        });
        for (i, row_sum) in rows.zip(row_sums) {
            checks.row_sum.min = checks.row_sum.min.min(row_sum);
            checks.row_sum.max = checks.row_sum.max.max(row_sum);
            // Light that leaves a closed row is an error, however well it is counted.
            let lost = if closed.row(i) { Some(0.0) } else { self.lost(i, closed) };
            let error = lost.map(|lost| (1.0 - row_sum - lost).abs());
            checks.closure_error_max = greater(checks.closure_error_max, error);
        }
        checks
    }

    /// Returns the fraction of the light of patch i that no front receives, where it is known.
    ///
    /// It is the fraction of its rays that escaped or that back faces absorbed; in a row that `closed`
    /// names none may escape, and back faces absorb the rays that slip in where two faces touch.
    pub(crate) fn lost(&self, i: usize, closed: Closed<'_>) -> Option<f64> {
        let tally = &self.tallies[i];
        if closed.row(i) {
            return Some(tally.absorbed().unwrap_or(0.0));
        }
        tally.escaped().zip(tally.absorbed()).map(|(e, a)| e + a)
    }

    /// Returns the row sums that [`balanced`](Self::balanced) should restore.
    ///
    /// A row that `closed` names has the sum 1 less the fraction of its rays that back faces absorbed. Another row of rays has the sum 1 together with its
    /// loss, the fraction of its N rays that escaped or that back faces absorbed. The variance of the loss is p (1 − p) / N with p = (N lost + 1) / (N + 2), which does not
    /// vanish where no ray, or every ray, is lost. A row without rays keeps its sum.
    #[must_use]
    pub fn row_targets<'a>(&self, closed: impl Into<Closed<'a>>) -> RowTargets {
        let closed = closed.into();
        let rows = self.numbers_of_rows(|i| match self.lost(i, closed) {
            Some(lost) if closed.row(i) => [(1.0 - lost).max(0.0), 0.0, 0.0],
            Some(lost) => [1.0, lost, self.tallies[i].variance_of(lost)],
            None => [self.row_sum(i).max(0.0), 0.0, 0.0],
        });
        let column = |k: usize| rows.iter().map(|row| row[k]).collect();
        RowTargets {
            sums: column(0),
            lost: column(1),
            lost_variance: column(2),
        }
    }
}

impl Checks {
    /// Returns the checks as numbers for other ranks.
    fn numbers(&self) -> [f64; 6] {
        [
            self.row_sum.min,
            self.row_sum.max,
            self.closure_error_max.unwrap_or(f64::NEG_INFINITY),
            self.reciprocity_error_max,
            self.exchange_ratio_max,
            f64::from_bits(self.n_negative),
        ]
    }

    fn of_numbers(numbers: &[f64; 6]) -> Self {
        let [min, max, closure, reciprocity, exchange, n_negative] = *numbers;
        Self {
            row_sum: MinMax { min, max },
            closure_error_max: (closure.is_nan() || closure >= 0.0).then_some(closure),
            reciprocity_error_max: reciprocity,
            exchange_ratio_max: exchange,
            n_negative: n_negative.to_bits(),
            ..nothing()
        }
    }
}

fn nothing() -> Checks {
    Checks {
        row_sum: MinMax {
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
        },
        closure_error_max: None,
        reciprocity_error_max: 0.0,
        exchange_ratio_max: 0.0,
        n_negative: 0,
        n_rays: 0,
        n_escaped: 0,
        n_absorbed: 0,
    }
}

fn join(a: Checks, b: Checks) -> Checks {
    Checks {
        row_sum: MinMax {
            min: a.row_sum.min.min(b.row_sum.min),
            max: a.row_sum.max.max(b.row_sum.max),
        },
        closure_error_max: greater(a.closure_error_max, b.closure_error_max),
        reciprocity_error_max: a.reciprocity_error_max.max(b.reciprocity_error_max),
        exchange_ratio_max: a.exchange_ratio_max.max(b.exchange_ratio_max),
        n_negative: a.n_negative + b.n_negative,
        n_rays: a.n_rays + b.n_rays,
        n_escaped: a.n_escaped + b.n_escaped,
        n_absorbed: a.n_absorbed + b.n_absorbed,
    }
}

fn greater(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.into_iter().chain(b).reduce(f64::max)
}
