//! Errors of a radiosity system.

use thiserror::Error;

use crate::matrix::DiskError;
use crate::parameter::{Named, Parameter};

/// Why a radiosity system was refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SolverError {
    /// There is no patch.
    #[error("a radiosity system needs at least one patch")]
    Empty,
    /// Sizes that do not fit one another.
    #[error("{what}: {found}, but {expected} are needed")]
    Shape {
        /// The quantity of the wrong size.
        what: &'static str,
        /// The size that is needed.
        expected: usize,
        /// The size that was given.
        found: usize,
    },
    /// An area that is not a positive, finite number.
    #[error("patch {patch} has the area {area} m²; an area is positive and finite")]
    Area {
        /// The patch.
        patch: usize,
        /// Its area, m².
        area: f64,
    },
    /// A reflectance outside \[0, 1\], or not a number.
    #[error("patch {patch} has the reflectance {reflectance} in channel {channel}; a reflectance is in [0, 1]")]
    Reflectance {
        /// The patch.
        patch: usize,
        /// The channel.
        channel: usize,
        /// Its ρ.
        reflectance: f64,
    },
    /// An exitance that is negative, infinite or not a number.
    #[error("patch {patch} has the exitance {exitance} in channel {channel}; an exitance is finite and not negative")]
    Exitance {
        /// The patch.
        patch: usize,
        /// The channel.
        channel: usize,
        /// Its E, W·m⁻².
        exitance: f64,
    },
    /// Exitance for which the light of all patches may leave the range of numbers.
    #[error(
        "patch {patch} has the exitance {exitance:e} W/m2 in channel {channel}; above {limit:e} the light of all patches may leave the range of numbers"
    )]
    TooBright {
        /// The brightest patch.
        patch: usize,
        /// The channel.
        channel: usize,
        /// Its E, W·m⁻².
        exitance: f64,
        /// The greatest that is possible, W·m⁻².
        limit: f64,
    },
    /// Light enters an enclosure that neither absorbs it nor lets it out.
    #[error(
        "no finite solution in channel {channel}: the {n_patches} patches that exchange light with patch {patch} (component {component}) emit, \
         reflect everything, and let nothing out"
    )]
    NoFiniteSolution {
        /// The component, as [`RadiositySystem::components`](super::RadiositySystem::components) numbers them.
        component: u32,
        /// The number of its patches.
        n_patches: usize,
        /// An emitting patch of the enclosure.
        patch: usize,
        /// The channel.
        channel: usize,
    },
    /// The solver needs form factors with symmetric exchange areas.
    #[error("{solver} needs form factors whose exchange areas are symmetric: balance them first")]
    NeedsReciprocity {
        /// The solver's name.
        solver: &'static str,
    },
    /// The solver needs access to single rows.
    #[error("{solver} needs the rows of the form factors one at a time")]
    NeedsRows {
        /// The solver's name.
        solver: &'static str,
    },
    /// The solver needs more memory than its limit.
    #[error(
        "{solver} needs {needed_byte} bytes, above the limit of {limit_byte}: raise the limit, or take another solver"
    )]
    Memory {
        /// The solver's name.
        solver: &'static str,
        /// The memory needed.
        needed_byte: u64,
        /// The limit.
        limit_byte: u64,
    },
    /// No solver of this name.
    #[error("there is no solver `{name}`; known are {known}")]
    UnknownSolver {
        /// The name.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A relaxation factor outside (0, 2).
    #[error("the relaxation factor {value} is not between 0 and 2")]
    Omega {
        /// The factor.
        value: f64,
    },
    /// A setting that the solver does not use.
    #[error("{}", unused(.parameter.name(), .solver, .used_by))]
    UnusedSetting {
        /// The setting.
        parameter: Parameter,
        /// The solver's name.
        solver: &'static str,
        /// The solvers that use it.
        used_by: String,
    },
    /// A tolerance that is not a positive, finite number.
    #[error("the tolerance {value} is not positive and finite")]
    Tolerance {
        /// The tolerance.
        value: f64,
    },
    /// The form factors could not be read from their disk.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

fn unused(setting: &str, solver: &str, used_by: &str) -> String {
    format!("{setting} has no use with the solver `{solver}`; it goes with {used_by}")
}

impl SolverError {
    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        match self {
            Self::Disk(error) => error.text(named),
            Self::UnusedSetting {
                parameter,
                solver,
                used_by,
            } => unused(&named(*parameter, None), solver, used_by),
            other => other.to_string(),
        }
    }
}
