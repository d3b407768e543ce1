//! Bounds of entries that no ray has hit.

use std::fmt::Debug;
use std::num::NonZeroUsize;
use std::sync::Arc;

/// Bounds of form factors that no ray of a row has hit.
pub(crate) trait UpperBounds: Debug + Send + Sync {
    /// Returns whether part of each patch lies in front of the other's plane; else F_ij is 0.
    fn are_facing(&self, i: usize, j: usize) -> bool;

    /// Returns what F_ij may be, above 0 for patches that face each other, if the number of rays allows `by_count`.
    fn missed(&self, i: usize, j: usize, by_count: f64) -> f64;

    /// Returns the number of points along each side of a patch that its rays start from, if they start from points.
    fn points(&self) -> Option<NonZeroUsize>;
}

/// How much the entries that are not stored may be.
#[derive(Clone, Debug)]
pub(in crate::matrix) struct Open {
    pub(in crate::matrix) bounds: Arc<dyn UpperBounds>,
    /// True if an entry stands for the rays of both patches.
    pub(in crate::matrix) is_pooled: bool,
}

impl Open {
    /// Returns the same of entries that stand for the rays of both patches.
    pub(in crate::matrix) fn pooled(&self) -> Self {
        Self {
            is_pooled: true,
            ..self.clone()
        }
    }
}
