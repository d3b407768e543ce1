//! What a solver says of itself to the registry.

use super::settings::SolverSettings;
use super::solve::Solver;
use crate::setting::Use;

/// A solver as the registry knows it; the solver's own file fills it in.
#[derive(Debug)]
pub struct SolverEntry {
    /// The name on the command line.
    pub name: &'static str,
    /// What it does, in a few words.
    pub summary: &'static str,
    /// The settings that it uses.
    pub settings: &'static [Use],
    /// What symmetric exchange areas A_i F_ij are to it, as it is set.
    pub symmetry: fn(&SolverSettings) -> Symmetry,
    /// Whether it uses [`SolverSettings::hierarchy`].
    pub uses_hierarchy: bool,
    /// Makes the solver from settings with the defaults put in.
    pub make: fn(&SolverSettings) -> Option<Box<dyn Solver>>,
}

/// What symmetric exchange areas A_i F_ij are to a solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Symmetry {
    /// Of no use.
    Unused,
    /// It takes less time with them.
    Helps,
    /// It needs them.
    Needed,
}
