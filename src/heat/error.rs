//! Errors of boundary conditions that have no solution on a scene.

use crate::printable::{counted, printable_message};

/// A reason why boundary conditions do not fit a scene, or have no temperatures.
///
/// Every message is one line: the fault, the number, and the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HeatError {
    /// The number of conditions differs from that of the surfaces.
    #[error("boundary conditions for {found} surfaces, and the scene has {expected}; make them for this scene")]
    OtherScene {
        /// The number of surfaces of the scene.
        expected: usize,
        /// The number of surfaces with a condition.
        found: usize,
    },
    /// A value of a surface is out of its range.
    #[error("{}", printable_message(&format!("surface `{surface}`: {key}: {wrong}")))]
    OutOfRange {
        /// The surface.
        surface: String,
        /// The key of the value.
        key: &'static str,
        /// The fault.
        wrong: String,
    },
    /// Two sides of a sheet do not coincide.
    #[error("{}", printable_message(&format!(
        "`{}` and `{}` are two sides of one sheet, but {} of the first {} no coincident patch on the second; \
         give both the same corners and the same subdivision",
        surfaces[0], surfaces[1], counted(*n_alone, "patch"), if *n_alone == 1 { "has" } else { "have" }
    )))]
    Apart {
        /// The surfaces.
        surfaces: [String; 2],
        /// The number of patches of the first that have no counterpart.
        n_alone: usize,
    },
    /// Nothing determines the temperatures of an enclosure.
    #[error("{}", printable_message(&format!(
        "no temperature is given in the enclosure of `{surface}` ({}): {}; give one of its surfaces a `temperature_k`, or open the scene",
        counted(*n_patches, "patch"), why(*imbalance_w, *has_solutions)
    )))]
    NoTemperature {
        /// A surface of it.
        surface: String,
        /// The number of its patches.
        n_patches: usize,
        /// The heat that is supplied to it, solar heat included, W.
        imbalance_w: f64,
        /// True if that is 0 to rounding: then every temperature is a solution.
        has_solutions: bool,
    },
    /// More heat is removed from a surface than it can absorb at absolute zero.
    #[error("{}", printable_message(&format!(
        "surface `{surface}` has no temperature: {taken:.3e} W/m² are removed from a patch, more than the {arriving:.3e} W/m² that it can absorb; raise its supplied heat"
    )))]
    BelowZero {
        /// The surface.
        surface: String,
        /// The heat removed from a patch, W·m⁻².
        taken: f64,
        /// The flux that it would absorb at 0 K, W·m⁻².
        arriving: f64,
    },
}

impl HeatError {
    /// Returns the surface that the error concerns, and the key of its entry; an empty key means the condition.
    pub(super) fn place(&self) -> Option<(&str, &'static str)> {
        match self {
            Self::OtherScene { .. } => None,
            Self::OutOfRange { surface, key, .. } => Some((surface, key)),
            Self::Apart { surfaces, .. } => Some((&surfaces[0], "")),
            Self::NoTemperature { surface, .. } | Self::BelowZero { surface, .. } => Some((surface, "")),
        }
    }
}

fn why(imbalance_w: f64, has_solutions: bool) -> String {
    if has_solutions {
        format!("supplied heats balance to {imbalance_w:.3e} W, and infinitely many temperatures solve it")
    } else {
        format!("supplied heats sum to {imbalance_w:.3e} W, not 0, and no temperature solves it")
    }
}
