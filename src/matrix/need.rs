//! Which repair suits form factors, and what for.

use super::{BalanceReport, FormFactors, MatrixError, RowTally, RowTargets, Weighting};

/// What form factors are wanted for.
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

/// A repair of form factors that come by rows.
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

impl Need {
    /// Returns the repair of rows that leaves the smaller error of B, as far as the need allows.
    ///
    /// `has_rays`: rows are counts of independent rays; `is_net`: these come from low-discrepancy points, whose errors beside each other cancel in a row, which
    /// no mean with the reverse keeps. In a scene of 432 patches of equal size (`room-box`, six by six on each face, `sr`) B is off by 9.5e-4 without a repair, by 1.4e-3 after either symmetric one, and by 9e-4 pooled;
    /// with random rays by 5.0e-3, 3.5e-3 and 4.1e-3. Six scenes are in `docs/stated-errors.md`.
    #[must_use]
    pub fn repair(self, has_rays: bool, is_net: bool) -> RepairKind {
        match self {
            Self::Light { .. } if has_rays && is_net => RepairKind::Pooled,
            Self::Light { .. } | Self::Symmetry if has_rays => RepairKind::Closed,
            Self::AsTheyAre | Self::Light { gains: false } => RepairKind::Nothing,
            Self::Light { gains: true } | Self::Symmetry => RepairKind::Rescaled,
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
        let symmetric = || self.symmetrised(Weighting::default());
        let (repaired, report) = match kind {
            RepairKind::Nothing => return Ok((self.clone(), None)),
            RepairKind::Pooled => return Ok((self.pooled()?, None)),
            RepairKind::Closed => symmetric()?.closed(targets, tolerance, max_passes)?,
            RepairKind::Rescaled => symmetric()?.balanced(targets, tolerance, max_passes)?,
        };
        Ok((repaired, Some(report)))
    }

    /// Tells whether every row is a count of independent rays.
    #[must_use]
    pub fn has_rays(&self) -> bool {
        self.tallies().iter().map(RowTally::effective_rays).all(|n| n.is_some())
    }
}
