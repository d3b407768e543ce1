//! Reference solutions.

use std::ops::ControlFlow;

use super::ExperimentError;
use crate::solver::{RadiositySystem, Solution, SolveOptions, SolverSettings, StopReason, Tolerance, solver};

/// The limit of passes of a reference.
const MAX_PASSES: usize = 10_000;

/// Solves a system with the named solver and its defaults; a solution that does not meet the tolerance is an error.
pub(super) fn solved(
    system: &RadiositySystem,
    name: &'static str,
    tolerance: Tolerance,
) -> Result<Solution, ExperimentError> {
    let options = SolveOptions {
        tolerance,
        max_passes: MAX_PASSES,
        ..SolveOptions::default()
    };
    let solver = solver(name, &SolverSettings::default())?;
    let solution = solver.solve(system, &options, &mut |_| ControlFlow::Continue(()))?;
    match solution.stop_reason {
        StopReason::Converged => Ok(solution),
        stop_reason => Err(ExperimentError::Unsolved {
            solver: name,
            stop_reason,
            residual_l2: solution.residual_l2,
        }),
    }
}
