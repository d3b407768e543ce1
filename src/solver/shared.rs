//! Passes over the form factors that ranks share.

use crate::matrix::DiskError;
use crate::matrix::operator::{Block, Components, LinearOperator, RowAccess};
use crate::ranks::Ranks;

/// Form factors that all ranks hold, and apply together to the bytes of a single rank.
pub(crate) struct SharedPasses<'a> {
    factors: &'a dyn LinearOperator,
    ranks: &'a dyn Ranks,
}

impl<'a> SharedPasses<'a> {
    /// Wraps form factors; each rank must apply them in the same order as the others.
    pub(crate) fn new(factors: &'a dyn LinearOperator, ranks: &'a dyn Ranks) -> Self {
        Self { factors, ranks }
    }
}

impl LinearOperator for SharedPasses<'_> {
    fn n_rows(&self) -> usize {
        self.factors.n_rows()
    }

    #[track_caller]
    fn apply(&self, x: &Block, y: &mut Block) {
        let n_ranks = self.ranks.size();
        let share = (n_ranks > 1).then(|| self.factors.share_of_pass(x, self.ranks.rank(), n_ranks));
        match share.flatten() {
            Some(share) => self.factors.end_pass(&self.ranks.all_gather_numbers(&share), y),
            None => self.factors.apply(x, y),
        }
    }

    fn rows(&self) -> Option<&dyn RowAccess> {
        self.factors.rows()
    }

    fn of_rows(&self, of_row: &(dyn Fn(&dyn RowAccess, usize) -> Vec<f64> + Sync)) -> Option<Vec<f64>> {
        self.factors.of_rows(of_row)
    }

    fn has_rows(&self) -> bool {
        self.factors.has_rows()
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        self.factors.reciprocal_areas()
    }

    fn components(&self) -> Option<Components> {
        self.factors.components()
    }

    fn failure(&self) -> Option<&DiskError> {
        self.factors.failure()
    }
}
