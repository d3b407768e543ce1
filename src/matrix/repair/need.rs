//! The choice of a repair by the use of the form factors.

use super::balance::BalanceReport;
use crate::matrix::checks::RowTargets;
use crate::matrix::error::MatrixError;
use crate::matrix::form_factors::FormFactors;
use crate::matrix::tile::RowTally;

/// The use of form factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// For themselves.
    AsTheyAre,
    /// For a solver that works with any, and better with symmetric ones if `gains`.
    Light {
        /// Whether it works better with symmetric ones.
        gains: bool,
    },
    /// For a solver that works with symmetric ones alone.
    Symmetry,
}

/// The sampling of form factors, as far as repairs differ by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampling {
    /// Rows by a rule.
    Rule,
    /// Rows that count independent rays.
    Rays,
    /// Rows that count rays of low-discrepancy points.
    Nets,
    /// Pairs with the noise of rays between them, in rows that are known to sum to 1.
    NoisyPairs,
    /// Pairs without noise, or in rows of unknown sums.
    Pairs,
}

impl Sampling {
    /// Returns the sampling of rows; `is_net`: rays come from low-discrepancy points.
    #[must_use]
    pub fn of_rows(has_rays: bool, is_net: bool) -> Self {
        match (has_rays, is_net) {
            (false, _) => Self::Rule,
            (true, false) => Self::Rays,
            (true, true) => Self::Nets,
        }
    }

    /// Returns the sampling of symmetric form factors.
    #[must_use]
    pub fn of_pairs(is_noisy: bool) -> Self {
        if is_noisy { Self::NoisyPairs } else { Self::Pairs }
    }
}

/// A repair of form factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RepairKind {
    /// None.
    Nothing,
    /// [`FormFactors::pooled`].
    Pooled,
    /// [`FormFactors::symmetrised`] and [`FormFactors::closed`].
    Closed,
    /// [`FormFactors::symmetrised`] and [`FormFactors::balanced`].
    Rescaled,
}

impl Default for Need {
    /// For light, by a solver that works better with symmetric ones.
    fn default() -> Self {
        Self::Light { gains: true }
    }
}

impl Need {
    /// Returns the repair that suits the need.
    ///
    /// Errors of neighbouring low-discrepancy rays in a row cancel, which a mean with the reverse rows destroys: either symmetric repair may leave a greater error of B than none, and
    /// pooled rows hardly do. Random rays and noisy pairs have no such cancellation. Five scenes are in `docs/stated-errors.md`.
    #[must_use]
    pub fn repair(self, sampling: Sampling) -> RepairKind {
        match (self, sampling) {
            (Self::AsTheyAre, _) | (_, Sampling::Pairs) | (Self::Light { gains: false }, Sampling::Rule) => {
                RepairKind::Nothing
            }
            (Self::Light { .. }, Sampling::Nets) => RepairKind::Pooled,
            (_, Sampling::Rays | Sampling::Nets | Sampling::NoisyPairs) => RepairKind::Closed,
            (_, Sampling::Rule) => RepairKind::Rescaled,
        }
    }
}

impl FormFactors {
    /// Returns form factors after a repair, and how it went where it is iterative.
    ///
    /// `targets`, `tolerance` and `max_passes` are those of [`closed`](Self::closed) and [`balanced`](Self::balanced).
    ///
    /// # Errors
    /// Those of the functions that the [`RepairKind`]s name.
    ///
    /// # Panics
    /// If there is not one target per row.
    #[track_caller]
    pub fn repaired(
        &self,
        kind: RepairKind,
        targets: &RowTargets,
        tolerance: f64,
        max_passes: usize,
    ) -> Result<(Self, Option<BalanceReport>), MatrixError> {
        let symmetric = || self.symmetrised();
        let (repaired, report) = match kind {
            RepairKind::Nothing => return Ok((self.clone(), None)),
            RepairKind::Pooled => return Ok((self.pooled()?, None)),
            RepairKind::Closed => symmetric()?.closed(targets, tolerance, max_passes)?,
            RepairKind::Rescaled => symmetric()?.balanced(targets, tolerance, max_passes)?,
        };
        Ok((repaired, Some(report)))
    }

    /// Returns whether every row is a count of independent rays.
    #[must_use]
    pub fn has_rays(&self) -> bool {
        self.tallies().iter().map(RowTally::effective_rays).all(|n| n.is_some())
    }
}
