//! The entry of a solver in the registry.

use super::settings::SolverSettings;
use super::solve::Solver;
use crate::setting::Use;

/// A solver in the registry; the solver's own file fills it in.
#[derive(Debug)]
pub struct SolverEntry {
    /// The name on the command line.
    pub name: &'static str,
    /// A description in a few words.
    pub summary: &'static str,
    /// The settings that it uses.
    pub settings: &'static [Use],
    /// Its need for symmetric exchange areas A_i F_ij, with its settings.
    pub symmetry: fn(&SolverSettings) -> Symmetry,
    /// Whether it uses [`SolverSettings::hierarchy`].
    pub uses_hierarchy: bool,
    /// Whether it reads the rows of F one after the other, so that each rank needs all of them.
    pub goes_by_rows: bool,
    /// Makes the solver from settings with the defaults put in.
    pub make: fn(&SolverSettings) -> Option<Box<dyn Solver>>,
}

/// The need of a solver for symmetric exchange areas A_i F_ij.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// Of no use.
    Unused,
    /// It takes less time with them.
    Helps,
    /// It needs them.
    Needed,
}
