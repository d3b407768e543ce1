//! The solver that `auto` chose, and the reason.

use std::fmt;

use serde::{Serialize, Serializer};

use crate::printable::counted;

/// A solver, and why it was chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Choice {
    /// Its name.
    pub solver: &'static str,
    /// Why.
    pub why: ChoiceReason,
}

/// Why [`Auto`](super::Auto) chose a solver: one sentence, as text and as JSON.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChoiceReason {
    /// A sweep of `gauss-seidel` solves one equation.
    OnePatch,
    /// There is nothing to iterate.
    NothingReflects,
    /// Plain reflections die out as fast as anything.
    FadesFast {
        /// A bound of the spectral radius of diag(ρ) F.
        spectral_radius: f64,
    },
    /// Factorisations cost less than passes.
    FewPatches {
        /// One for each distinct reflectance of a channel.
        n_factorisations: usize,
        /// n.
        n_patches: usize,
        /// The channels that they serve.
        n_channels: usize,
    },
    /// Passes may be so many that a factorisation costs less.
    SpreadEigenvalues {
        /// An estimate of Σ λ² / n over the eigenvalues of diag(ρ) F.
        mean_square: f64,
        /// The passes of conjugate gradients at worst.
        n_passes_max: f64,
    },
    /// Passes are few: by `pcg` where the exchange areas are symmetric, else by `gmres`.
    Passes {
        /// Whether they are.
        symmetric: bool,
        /// The greatest mean reflectance of a component that emits.
        mean_reflectance: f64,
        /// Bounds of the spectral radius of diag(ρ) F.
        spectral_radius: [f64; 2],
    },
}

impl fmt::Display for ChoiceReason {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::OnePatch => write!(f, "one patch, whose equation a sweep solves"),
            Self::NothingReflects => write!(f, "nothing that light meets reflects it"),
            Self::FadesFast { spectral_radius } => {
                write!(f, "light fades to {spectral_radius:.3} or less with every reflection")
            }
            Self::FewPatches {
                n_factorisations,
                n_patches,
                n_channels,
            } => write!(
                f,
                "{} of {} for {} take less time than passes would",
                counted(*n_factorisations, "factorisation"),
                counted(*n_patches, "patch"),
                counted(*n_channels, "channel"),
            ),
            Self::SpreadEigenvalues {
                mean_square,
                n_passes_max,
            } => write!(
                f,
                "the eigenvalues do not cluster (their mean square is {mean_square:.2}): passes could be up to {n_passes_max:.0}"
            ),
            Self::Passes {
                symmetric,
                mean_reflectance,
                spectral_radius: [low, high],
            } => write!(
                f,
                "the exchange areas are {}symmetric; mean reflectance {mean_reflectance:.3}, spectral radius within {low:.3} to {high:.3}",
                if *symmetric { "" } else { "not " }
            ),
        }
    }
}

impl Serialize for ChoiceReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
