//! The error of entries that no ray hit.

use std::num::NonZeroUsize;
use std::sync::Arc;

use super::form_factors::FormFactors;
use super::tile::MISSED_HITS;
use crate::matrix::bounds::{Open, UpperBounds};

impl FormFactors {
    /// States that entries that are not stored were hit by no ray, and are within `bounds`.
    pub(crate) fn with_bounds(mut self, bounds: Arc<dyn UpperBounds>) -> Self {
        let is_pooled = self.is_symmetric();
        self.open = Some(Open { bounds, is_pooled });
        self
    }

    /// Returns the error 1.5 / N of all entries together that no ray of row i hit; 0 where every error is stored.
    ///
    /// A count has each ray once, so that in a sum over the row all such entries are one cell of a multinomial distribution. N is
    /// [`effective_rays`](super::RowTally::effective_rays). A single entry may be off by as much, but at most by its upper bound: see [`std_error`](Self::std_error).
    ///
    /// # Panics
    /// If i is not less than n.
    #[must_use]
    #[track_caller]
    pub fn open_error(&self, i: usize) -> f64 {
        let rays = self.open.as_ref().and(self.tallies[i].open_error());
        rays.unwrap_or(0.0)
    }

    /// Returns the number of points along each side of a patch that its rays start from; `None` if they start anywhere.
    pub(crate) fn points(&self) -> Option<NonZeroUsize> {
        self.open.as_ref()?.bounds.points()
    }

    /// Returns the part of an entry's standard error beyond the noise of its row's rays; rays from points have the lower noise of low-discrepancy nets.
    pub(crate) fn beyond_noise(&self, i: usize, factor: f64, std_error: f64) -> f64 {
        let tally = &self.tallies[i];
        let noise = match self.points() {
            Some(n) => tally.noise_of_nets(factor, n.get() * n.get()),
            None => tally.noise_of(factor),
        };
        // Standard errors are stored in f32.
        (std_error - noise * (1.0 + 1e-6)).max(0.0)
    }

    /// Calls `visit(j, F_ij, standard error)` in ascending order of j for all entries of row i where one of the two is not zero.
    ///
    /// Entries that no ray hit are included (see [`std_error`](Self::std_error)).
    ///
    /// Work: up to one closed form for each of these.
    ///
    /// # Panics
    /// If i is not less than n.
    #[track_caller]
    pub fn for_each_error_in_row(&self, i: usize, mut visit: impl FnMut(usize, f64, f64)) {
        let mut next = 0;
        self.for_each_in_row(i, |j, value, error| {
            self.for_each_open(i, next..j, &mut visit);
            visit(j, value, error);
            next = j + 1;
        });
        self.for_each_open(i, next..self.n_rows(), &mut visit);
    }

    /// Returns the number of entries of row i that no ray hit although the patches face each other.
    pub(crate) fn n_open(&self, i: usize) -> usize {
        let Some(open) = &self.open else { return 0 };
        let (mut next, mut n_open) = (0, 0);
        let mut count = |columns: std::ops::Range<usize>| {
            n_open += columns.filter(|&j| open.bounds.are_facing(i, j)).count();
        };
        self.for_each_in_row(i, |j, _, _| {
            count(next..j);
            next = j + 1;
        });
        count(next..self.n_rows());
        n_open
    }

    fn for_each_open(&self, i: usize, columns: std::ops::Range<usize>, visit: &mut impl FnMut(usize, f64, f64)) {
        if self.open.is_none() {
            return;
        }
        for j in columns {
            let error = self.open_entry(i, j);
            if error > 0.0 {
                visit(j, 0.0, error);
            }
        }
    }

    /// Returns the error of an entry that is not stored.
    pub(super) fn open_entry(&self, i: usize, j: usize) -> f64 {
        let Some(open) = self.open.as_ref().filter(|open| open.bounds.are_facing(i, j)) else {
            return 0.0;
        };
        let rays = |k: usize| self.tallies[k].effective_rays().unwrap_or(0.0);
        // A ray of j is worth as much for A_i F_ij as A_i / A_j rays of i.
        let of_reverse = if open.is_pooled {
            rays(j) * self.areas[i] / self.areas[j]
        } else {
            0.0
        };
        let n = rays(i) + of_reverse;
        if n > 0.0 {
            open.bounds.missed(i, j, MISSED_HITS / n)
        } else {
            0.0
        }
    }
}
