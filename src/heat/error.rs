//! Why boundary conditions have no solution on a scene.

use crate::printable::{counted, printable_message};

/// Why boundary conditions do not fit a scene, or have no temperatures.
///
/// Every message is one line: what is wrong, the number, and the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HeatError {
    /// There is not one condition for every surface.
    #[error("boundary conditions for {found} surfaces, and the scene has {expected}; make them for this scene")]
    OtherScene {
        /// Surfaces of the scene.
        expected: usize,
        /// The surfaces that have a condition.
        found: usize,
    },
    /// A value of a surface is out of its range.
    #[error("{}", printable_message(&format!("surface `{surface}`: {key}: {wrong}")))]
    OutOfRange {
        /// The surface.
        surface: String,
        /// The fault.
        key: &'static str,
        /// How.
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
        /// The patches of the first that have no counterpart.
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
        /// The patches of it.
        n_patches: usize,
        /// The heat that is supplied to it, solar heat included, W.
        imbalance_w: f64,
        /// True if that is 0 to rounding: then any temperature will do.
        has_solutions: bool,
    },
    /// More heat leaves a surface than arrives at absolute zero.
    #[error("{}", printable_message(&format!(
        "surface `{surface}` has no temperature: {taken:.3e} W/m² are removed from a patch, more than the {arriving:.3e} W/m² that it can absorb; raise its supplied heat"
    )))]
    BelowZero {
        /// The surface.
        surface: String,
        /// The heat that is taken from a patch, W·m⁻².
        taken: f64,
        /// The flux that it would absorb at 0 K, W·m⁻².
        arriving: f64,
    },
}

impl HeatError {
    /// Returns the surface that the error is about, and the key of its entry; nothing for the key is the condition.
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
