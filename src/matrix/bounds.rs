//! Bounds of entries that no ray has hit.

use std::fmt::Debug;
use std::num::NonZeroUsize;
use std::sync::Arc;

/// Bounds of form factors that no ray of a row has hit.
pub(crate) trait UpperBounds: Debug + Send + Sync {
    /// Returns whether part of each patch lies in front of the other's plane; otherwise F_ij is 0.
    fn are_facing(&self, i: usize, j: usize) -> bool;

    /// Returns the greatest possible F_ij, above 0 for patches that face each other, if the number of rays allows `by_count`.
    fn missed(&self, i: usize, j: usize, by_count: f64) -> f64;

    /// Returns the number of points along each side of a patch that its rays start from; `None` if they start anywhere.
    fn points(&self) -> Option<NonZeroUsize>;
}

/// The greatest possible size of entries that are not stored.
#[derive(Clone, Debug)]
pub(in crate::matrix) struct Open {
    pub(in crate::matrix) bounds: Arc<dyn UpperBounds>,
    /// True if an entry stands for the rays of both patches.
    pub(in crate::matrix) is_pooled: bool,
}

impl Open {
    /// Returns the same for entries that stand for the rays of both patches.
    pub(in crate::matrix) fn pooled(&self) -> Self {
        Self {
            is_pooled: true,
            ..self.clone()
        }
    }
}
