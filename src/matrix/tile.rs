//! A range of rows, as form-factor methods emit them.

/// The hits that an entry may have missed by chance: of entries with F = 1.5 / N, rays miss 22 %.
pub(in crate::matrix) const MISSED_HITS: f64 = 1.5;

/// One entry of a row: column j, form factor F_ij, standard error of F_ij (0 where it is exact or unknown).
pub type Entry = (u32, f64, f64);

/// The fate of the rays that left one patch.
///
/// A method leaves it at its default where a row is not made of rays that leave the patch over its hemisphere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RowTally {
    /// Rays that left the patch over its hemisphere.
    pub n_rays: u64,
    /// Rays that hit nothing: they end in the surroundings.
    pub n_escaped: u64,
    /// Rays that hit the back of a face, which is black and absorbs their light.
    pub n_absorbed: u64,
    /// The sums of the rays' weights, or `None` where each ray weighs 1 / `n_rays`.
    pub weights: Option<RayWeights>,
}

/// Sums over the weights w of the rays of one patch, where these differ from ray to ray; Σ w = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayWeights {
    /// Σ w over the rays that hit nothing.
    pub escaped: f64,
    /// Σ w over the rays that hit a back.
    pub absorbed: f64,
    /// Σ w² over all rays; 0 if the rays are not independent samples, so that the errors of the entries mean more than the rays' number.
    pub squared: f64,
}

impl RowTally {
    /// Returns the fraction of the patch's light that hits nothing, or `None` without rays.
    #[must_use]
    pub fn escaped(&self) -> Option<f64> {
        let fraction = |w: RayWeights| w.escaped;
        self.fraction(fraction, self.n_escaped)
    }

    /// Returns the fraction of the patch's light that black back faces absorb, or `None` without rays.
    #[must_use]
    pub fn absorbed(&self) -> Option<f64> {
        let fraction = |w: RayWeights| w.absorbed;
        self.fraction(fraction, self.n_absorbed)
    }

    /// Returns the number of rays of equal weight that have the same variance, 1 / Σ w², or `None` without rays that are independent.
    #[must_use]
    pub fn effective_rays(&self) -> Option<f64> {
        self.squared().map(f64::recip)
    }

    /// Returns the error 1.5 / N of all form factors together that none of the independent rays hit; `None` without such rays.
    pub(crate) fn open_error(&self) -> Option<f64> {
        self.effective_rays().map(|n| MISSED_HITS / n)
    }

    /// Returns Σ w², or `None` without rays that are independent.
    fn squared(&self) -> Option<f64> {
        let squared = self.weights.map_or_else(|| (self.n_rays as f64).recip(), |w| w.squared);
        (self.n_rays > 0 && squared > 0.0).then_some(squared)
    }

    /// Returns the standard error of a form factor that is the share F of the row's independent rays, sqrt(p (1 − p) Σ w²); 0 without such rays.
    ///
    /// p is F; above one half it is the lower (N F + 1) / (N + 2) of Laplace's rule, as no number of rays that all hit one patch proves that no light goes elsewhere.
    /// Where rays differ in weight p is always that of the rule: a few rays of little weight prove nothing about rays of more weight.
    pub(crate) fn noise_of(&self, factor: f64) -> f64 {
        let Some(squared) = self.squared() else {
            return 0.0;
        };
        let by_laplace = laplace(squared.recip(), factor);
        let has_equal_weights = squared * self.n_rays as f64 <= 1.0 + 1e-9;
        let p = if has_equal_weights {
            factor.min(by_laplace)
        } else {
            by_laplace
        };
        (p * (1.0 - p) * squared).max(0.0).sqrt()
    }

    /// Returns the standard error of a form factor that is the share F of N rays from points of `n_nets` low-discrepancy nets.
    ///
    /// It is k^(−1/8) of [`noise_of`](Self::noise_of), with k = N F / `n_nets` the cells of a net that make it up. Of a net in four dimensions about k^(3/4) cells are at their border, and these alone are uncertain; in two,
    /// k^(1/2), which this exceeds.
    pub(crate) fn noise_of_nets(&self, factor: f64, n_nets: usize) -> f64 {
        let hits = (self.n_rays as f64 / n_nets as f64 * factor).max(1.0);
        self.noise_of(factor) * hits.powf(-0.125)
    }

    /// Returns the standard error sqrt(F / N) of a form factor without a hit among the row's N rays, if the other patch's rays give `factor`.
    ///
    /// Rays that are not independent count as if they were. 0 without rays.
    pub(crate) fn noise_of_missed(&self, factor: f64) -> f64 {
        let n = self.effective_rays().unwrap_or(self.n_rays as f64);
        if n > 0.0 {
            (factor.clamp(0.0, 1.0) / n).sqrt()
        } else {
            0.0
        }
    }

    /// Returns the variance of a fraction of the patch's light that was counted by its N rays.
    ///
    /// It is p (1 − p) / N with p = (N `fraction` + 1) / (N + 2) by Laplace's rule, as no count proves that a fraction is 0 or 1.
    /// Rays that are not independent count as if they were; without rays the fraction may be anything.
    pub(crate) fn variance_of(&self, fraction: f64) -> f64 {
        let n = self.effective_rays().unwrap_or(self.n_rays as f64).max(1.0);
        let p = laplace(n, fraction).clamp(0.0, 1.0);
        p * (1.0 - p) / n
    }

    /// Returns whether the rays that end outside fronts are at most all rays, and the sums of weights are possible.
    pub(crate) fn is_consistent(&self) -> bool {
        let lost = self.n_escaped.checked_add(self.n_absorbed);
        let in_range = |w: &RayWeights| {
            [w.escaped, w.absorbed, w.squared]
                .iter()
                .all(|x| (0.0..=1.0 + 1e-9).contains(x))
        };
        lost.is_some_and(|lost| lost <= self.n_rays) && self.weights.as_ref().is_none_or(in_range)
    }

    fn fraction(&self, weighted: impl Fn(RayWeights) -> f64, counted: u64) -> Option<f64> {
        let equal = || counted as f64 / self.n_rays as f64;
        (self.n_rays > 0).then(|| self.weights.map_or_else(equal, weighted))
    }
}

/// Returns the expected share of the light by Laplace's rule, (n `fraction` + 1) / (n + 2), where the share `fraction` of `n` rays was counted.
pub(in crate::matrix) fn laplace(n: f64, fraction: f64) -> f64 {
    (n * fraction + 1.0) / (n + 2.0)
}

/// Consecutive rows of form factors, each a sorted list of its entries: the unit of parallel work.
#[derive(Clone, Debug, PartialEq)]
pub struct RowTile {
    first_row: usize,
    /// Row k holds `entries[ends[k − 1]..ends[k]]`.
    ends: Vec<usize>,
    entries: Vec<Entry>,
    tallies: Vec<RowTally>,
}

impl RowTile {
    /// Returns a tile without rows; the first row pushed is row `first_row` of the matrix.
    #[must_use]
    pub fn new(first_row: usize) -> Self {
        Self {
            first_row,
            ends: Vec::new(),
            entries: Vec::new(),
            tallies: Vec::new(),
        }
    }

    /// Adds the next row. Columns that are not mentioned are zero.
    ///
    /// # Panics
    /// If the columns are not strictly ascending.
    #[track_caller]
    pub fn push_row(&mut self, entries: &[Entry], tally: RowTally) {
        assert!(entries.is_sorted_by(|a, b| a.0 < b.0), "columns are strictly ascending");
        // An entry that is certainly zero means no more than its absence.
        self.entries.extend(
            entries
                .iter()
                .filter(|(_, value, error)| !is_zero(*value) || !is_zero(*error)),
        );
        self.ends.push(self.entries.len());
        self.tallies.push(tally);
    }

    /// Returns the number of the first row.
    #[must_use]
    pub fn first_row(&self) -> usize {
        self.first_row
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.ends.len()
    }

    /// Returns the tile with the entries of each row i divided by `divisor(i)`.
    pub(in crate::matrix) fn divided(mut self, divisor: impl Fn(usize) -> f64) -> Self {
        let mut begin = 0;
        for (i, &end) in (self.first_row..).zip(&self.ends) {
            let by = divisor(i);
            for (_, value, error) in &mut self.entries[begin..end] {
                *value /= by;
                *error /= by;
            }
            begin = end;
        }
        self
    }

    /// Returns the number of entries in all rows; entries that are zero with a standard error of zero are not stored.
    #[must_use]
    pub fn n_entries(&self) -> usize {
        self.entries.len()
    }

    /// Returns the entries of the `k`-th row of the tile, in ascending order of the columns.
    ///
    /// # Panics
    /// If the tile has no row `k`.
    #[must_use]
    #[track_caller]
    pub fn row(&self, k: usize) -> &[Entry] {
        let begin = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.entries[begin..self.ends[k]]
    }

    /// Returns the tallies of all rows.
    #[must_use]
    pub fn tallies(&self) -> &[RowTally] {
        &self.tallies
    }
}

/// Returns whether a number is exactly zero, of either sign.
pub(in crate::matrix) fn is_zero(value: f64) -> bool {
    matches!(value.classify(), std::num::FpCategory::Zero)
}

/// Returns a row number as a column number.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the number of patches is checked against u32 when form factors are stored"
)]
pub(in crate::matrix) fn index(row: usize) -> u32 {
    row as u32
}
