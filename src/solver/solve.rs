//! The interface of all solvers, and the options that they share.

use super::error::SolverError;
use super::history::Monitor;
use super::solution::Solution;
use super::start::Start;
use super::stop::Tolerance;
use super::system::RadiositySystem;
use crate::matrix::operator::Block;

/// The settings of all solvers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOptions<'a> {
    /// The norm that must become small, and its limit.
    pub tolerance: Tolerance,
    /// The most passes; each reads all of F once.
    pub max_passes: usize,
    /// Passes without a new least residual after which the solver gives up, at least 1.
    ///
    /// It stops as [`StopReason::Diverged`](super::StopReason::Diverged) if the residual
    /// rose in each of the last half of them, otherwise as [`StopReason::Stagnated`](super::StopReason::Stagnated). They are counted anew while the residual has fallen in each of the last half of them, or
    /// risen less and less: near ρ = 1 sweeps raise it before they lower it.
    pub patience: usize,
    /// The first radiosities.
    pub start: Start,
    /// Lets solvers that need symmetric exchange areas run without, at the caller's risk: the true residual shows the effect.
    pub allow_nonreciprocal: bool,
    /// B*, W·m⁻², \[n, c\], where it is known: the history then holds the errors against it.
    pub reference: Option<&'a Block>,
    /// Calculates the true residual after every pass, for the history and to stop by: one more pass over F each, which the history's
    /// times and work leave out.
    pub true_history: bool,
}

impl Default for SolveOptions<'_> {
    /// 1e-6 on the relative residual, 1000 passes, a patience of 50, start B = E, symmetric exchange areas required where needed,
    /// true residuals only where they decide.
    fn default() -> Self {
        Self {
            tolerance: Tolerance::default(),
            max_passes: 1000,
            patience: 50,
            start: Start::default(),
            allow_nonreciprocal: false,
            reference: None,
            true_history: false,
        }
    }
}

/// The result of a solver.
pub type SolveResult = Result<Solution, SolverError>;

/// A method to solve the radiosity system.
pub trait Solver: Sync {
    /// Returns the name on the command line.
    fn name(&self) -> &'static str;

    /// Solves for the radiosities.
    ///
    /// `monitor` is called after every pass, and once more for a pass after which the true residual replaces an estimate;
    /// if it breaks, the solver computes the residual of its radiosities and returns them.
    /// Not converging is not an error: see [`Solution::stop_reason`].
    ///
    /// # Errors
    /// [`SolverError::Tolerance`] for a tolerance that is not positive and finite; [`SolverError::NeedsReciprocity`] and
    /// [`SolverError::NeedsRows`] if the form factors lack what the solver needs; [`SolverError::Memory`] if it needs more memory than it may take;
    /// [`SolverError::Disk`] if they cannot be read.
    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult;
}
