//! The form factors as a linear operator on blocks of vectors, the only view that solvers have.

use std::ops::Range;

use super::error::DiskError;
use crate::threads;

/// n rows by c channels of f64, row-major: the channel runs fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    n_channels: usize,
    values: Vec<f64>,
}

impl Block {
    /// Returns a block of zeros.
    ///
    /// # Panics
    /// If there is no channel.
    #[must_use]
    #[track_caller]
    pub fn zeros(n_rows: usize, n_channels: usize) -> Self {
        assert!(n_channels > 0, "a block has at least one channel");
        Self {
            n_channels,
            values: vec![0.0; n_rows * n_channels],
        }
    }

    /// Wraps `values` (row-major, channel fastest).
    ///
    /// # Panics
    /// If there is no channel, or the values do not fill whole rows.
    #[must_use]
    #[track_caller]
    pub fn from_values(values: Vec<f64>, n_channels: usize) -> Self {
        assert!(
            n_channels > 0 && values.len().is_multiple_of(n_channels),
            "values fill whole rows"
        );
        Self { n_channels, values }
    }

    /// Puts vectors of one length side by side, each as a channel.
    ///
    /// # Panics
    /// If there is no vector, or their lengths differ.
    #[must_use]
    #[track_caller]
    pub fn from_channels(channels: &[Vec<f64>]) -> Self {
        let n = channels.first().map_or(0, Vec::len);
        assert!(channels.iter().all(|own| own.len() == n), "vectors of one length");
        let rows = (0..n).flat_map(|i| channels.iter().map(move |own| own[i]));
        Self::from_values(rows.collect(), channels.len())
    }

    /// Puts the channels of blocks side by side.
    ///
    /// # Panics
    /// If there is no block, or they differ in their numbers of rows.
    #[must_use]
    #[track_caller]
    pub fn side_by_side(blocks: &[Self]) -> Self {
        let n = blocks.first().map_or(0, Self::n_rows);
        assert!(blocks.iter().all(|own| own.n_rows() == n), "blocks of one length");
        let rows = (0..n).flat_map(|i| blocks.iter().flat_map(move |own| own.row(i)));
        Self::from_values(rows.copied().collect(), blocks.iter().map(Self::n_channels).sum())
    }

    /// Returns one channel, \[n\].
    #[must_use]
    pub fn channel(&self, c: usize) -> Vec<f64> {
        self.values.iter().skip(c).step_by(self.n_channels).copied().collect()
    }

    /// Returns some of the channels.
    #[must_use]
    pub fn channels(&self, own: Range<usize>) -> Self {
        let n_channels = own.len();
        let rows = (0..self.n_rows()).flat_map(|i| &self.row(i)[own.clone()]);
        Self::from_values(rows.copied().collect(), n_channels)
    }

    /// Returns the block of `with(a, b)` of the values a and b of two blocks.
    ///
    /// # Panics
    /// If the shapes differ.
    #[must_use]
    #[track_caller]
    pub fn zip_with(&self, other: &Self, with: impl Fn(f64, f64) -> f64) -> Self {
        let shape = |block: &Self| (block.n_rows(), block.n_channels());
        assert_eq!(shape(self), shape(other), "blocks of one shape");
        let values = self.values.iter().zip(&other.values);
        Self::from_values(values.map(|(a, b)| with(*a, *b)).collect(), self.n_channels)
    }

    /// Returns the number of rows (patches).
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.values.len() / self.n_channels
    }

    /// Returns the number of channels.
    #[must_use]
    pub fn n_channels(&self) -> usize {
        self.n_channels
    }

    /// Returns all values, row-major.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns all values for writing, row-major.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Returns the channels of one row.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.n_channels..(i + 1) * self.n_channels]
    }

    /// Returns the channels of one row for writing.
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.n_channels..(i + 1) * self.n_channels]
    }
}

/// A square operator, such as the form-factor matrix F, that can be applied to a block of vectors.
///
/// Sums are f64 and reduced in an order that does not depend on the number of threads.
pub trait LinearOperator: Sync {
    /// Returns n, the number of patches.
    fn n_rows(&self) -> usize;

    /// Computes `y` = F `x`, every channel in one pass over F.
    fn apply(&self, x: &Block, y: &mut Block);

    /// Computes the share of a pass of rank `rank` of `n_ranks`, and returns numbers for [`end_pass`](Self::end_pass); `None` where a pass is not worth sharing.
    fn share_of_pass(&self, _x: &Block, _rank: usize, _n_ranks: usize) -> Option<Vec<f64>> {
        None
    }

    /// Sets `y` = F x, to the bytes of [`apply`](Self::apply), from the results of [`share_of_pass`](Self::share_of_pass) on each rank, one after the other.
    fn end_pass(&self, _shares: &[f64], _y: &mut Block) {}

    /// Returns access by rows, for solvers that need it, or `None` where rows are not cheap to read.
    fn rows(&self) -> Option<&dyn RowAccess>;

    /// Returns the results of `of_row` for each row, in the order of rows, shared by ranks that store parts; `None` where there are no rows.
    fn of_rows(&self, of_row: &(dyn Fn(&dyn RowAccess, usize) -> Vec<f64> + Sync)) -> Option<Vec<f64>> {
        let (rows, n) = (self.rows()?, self.n_rows());
        Some(threads::map(threads::pay(n * n), n, |i| of_row(rows, i)).concat())
    }

    /// Returns whether [`rows`](Self::rows) returns any, without its work.
    fn has_rows(&self) -> bool {
        self.rows().is_some()
    }

    /// Returns the A_i for which A_i F_ij is exactly symmetric, or `None` if reciprocity does not hold.
    fn reciprocal_areas(&self) -> Option<&[f64]>;

    /// Returns the connected components of the graph with an edge wherever F_ij > 0 or F_ji > 0.
    ///
    /// `None` where they are not cheap to find: then all patches count as one component.
    fn components(&self) -> Option<Components> {
        None
    }

    /// Returns the first failure to read the operator from a disk, or `None`.
    ///
    /// From then on `apply` and the rows may yield NaN. A [`RadiositySystem`](crate::solver::RadiositySystem) checks
    /// it, and so does every solver before it returns.
    fn failure(&self) -> Option<&DiskError> {
        None
    }
}

/// A partition of the patches into sets that exchange no light with one another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Components {
    /// The component of every patch, numbered from 0 in the order of their first patches.
    pub labels: Vec<u32>,
    /// The number of components.
    pub n_components: usize,
}

impl Components {
    /// Returns the partition of `n_rows` patches into a single component.
    #[must_use]
    pub fn single(n_rows: usize) -> Self {
        Self {
            labels: vec![0; n_rows],
            n_components: 1,
        }
    }
}

/// Rows of an operator, one at a time.
pub trait RowAccess: Sync {
    /// Adds Σ_{j≠i} F_ij x_j to `sum` (one entry per channel) and returns F_ii.
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64;

    /// Calls `visit` with j and F_ij for every entry of row i that may not be 0, j ascending.
    fn visit_row(&self, i: usize, visit: &mut dyn FnMut(usize, f64));

    /// Adds `factor` F_ij to `sum[j]` for every j, and returns the number of entries visited: n for a row stored in full.
    fn add_row(&self, i: usize, factor: f64, sum: &mut [f64]) -> usize {
        let mut n_entries = 0;
        self.visit_row(i, &mut |j, value| {
            sum[j] += factor * value;
            n_entries += 1;
        });
        n_entries
    }
}
