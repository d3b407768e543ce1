//! Solvers of the radiosity system B = E + diag(ρ) F B.
//!
//! A [`RadiositySystem`] holds a validated system, a [`Solver`] turns it into a [`Solution`]; the [`registry`] finds solvers by
//! name. Every solution carries the true residual of the radiosities that are returned, however the solver kept
//! its own accounts, and a bound of their error.

mod ambient;
mod anderson;
mod auto;
mod best;
mod carried_error;
mod cg;
mod chebyshev;
mod columns;
mod deflation;
mod direct;
mod energy;
mod error;
mod error_bound;
mod gauss_seidel;
mod gauss_seidel_ambient;
mod gmres;
mod history;
mod iteration;
mod jacobi;
mod lanczos;
mod lu;
mod mesh_error;
mod multigrid;
mod overshooting;
mod pcg;
mod progressive_refinement;
pub mod registry;
mod scaled;
mod solution;
mod sor;
mod start;
mod stop;
mod system;
mod tournament;
pub(crate) mod twofold;
mod vectors;

pub use crate::matrix::operator;
pub use anderson::Anderson;
pub use auto::{Auto, ChoiceReason};
pub use carried_error::carried_error;
pub(crate) use carried_error::relative_errors;
pub use cg::ConjugateGradients;
pub use chebyshev::{Chebyshev, SpectrumBounds};
pub use deflation::{DEFLATED_FROM, Deflate};
pub use direct::Direct;
pub use energy::Energy;
pub use error::SolverError;
pub use gauss_seidel::GaussSeidel;
pub use gauss_seidel_ambient::GaussSeidelAmbient;
pub use gmres::Gmres;
pub use history::{Errors, HistoryEntry};
pub use jacobi::Jacobi;
pub use mesh_error::{Coarsened, coarsened};
pub use multigrid::{CoarseMatrices, Coarsest, Defect, Multigrid};
pub use overshooting::Overshooting;
pub use pcg::Pcg;
pub use progressive_refinement::ProgressiveRefinement;
pub use registry::{SolverSettings, solver};
pub use solution::{ChannelQuality, Choice, Solution};
pub use sor::Sor;
pub use start::Start;
pub use stop::{StopReason, Tolerance};
pub use system::RadiositySystem;
pub(crate) use system::power_of_two_below;

use std::ops::ControlFlow;

use crate::matrix::operator::Block;

/// What all solvers can be told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOptions<'a> {
    /// What has to become small, and how small.
    pub tolerance: Tolerance,
    /// Passes that may be spent; each reads all of F once.
    pub max_passes: usize,
    /// Passes without a new least residual after which the solver gives up: as [`StopReason::Diverged`] if the residual
    /// rose in each of the last half of them, else as [`StopReason::Stagnated`]. At least 1. They are counted anew while the residual has fallen in each of the last half of them, or
    /// risen less and less: near ρ = 1 sweeps raise it before they lower it.
    pub patience: usize,
    /// The first radiosities.
    pub start: Start,
    /// Lets solvers that need symmetric exchange areas run without, at the caller's risk: the true residual tells what came of it.
    pub allow_nonreciprocal: bool,
    /// B*, W·m⁻², \[n, c\], where it is known: the history then tells the errors against it.
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

/// A method to solve the radiosity system.
pub trait Solver: Sync {
    /// Returns the name on the command line.
    fn name(&self) -> &'static str;

    /// Solves for the radiosities.
    ///
    /// `monitor` is called after every pass, and once more for a pass after which the true residual replaces an estimate;
    /// if it breaks, the solver checks what it has and returns it.
    /// Not converging is not an error: see [`Solution::stop_reason`].
    ///
    /// # Errors
    /// [`SolverError::Tolerance`] for a tolerance that is not positive and finite; [`SolverError::NeedsReciprocity`] and
    /// [`SolverError::NeedsRows`] if the form factors lack what the solver needs; [`SolverError::Memory`] if it needs more memory than it may take;
    /// [`SolverError::Disk`] if they cannot be read.
    fn solve(
        &self,
        system: &RadiositySystem,
        options: &SolveOptions,
        monitor: &mut dyn FnMut(&HistoryEntry) -> ControlFlow<()>,
    ) -> Result<Solution, SolverError>;
}
