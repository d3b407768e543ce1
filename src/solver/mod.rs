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
mod choice;
mod columns;
mod deflation;
mod direct;
mod energy;
mod entry;
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
mod settings;
mod solution;
mod solve;
mod sor;
mod start;
mod stop;
mod system;
mod tournament;
pub(crate) mod twofold;
mod vectors;

pub use crate::matrix::operator;
pub use anderson::{Anderson, DEPTH};
pub use auto::Auto;
pub use carried_error::carried_error;
pub(crate) use carried_error::{carried, carried_error_with, irradiance_error};
pub use cg::ConjugateGradients;
pub use chebyshev::{BOUNDS, Chebyshev, SpectrumBounds};
pub use choice::{Choice, ChoiceReason};
pub use deflation::{DEFLATED_FROM, DEFLATION, Deflate};
pub use direct::Direct;
pub use energy::Energy;
pub use error::SolverError;
pub use gauss_seidel::GaussSeidel;
pub use gauss_seidel_ambient::GaussSeidelAmbient;
pub use gmres::{Gmres, RESTART};
pub use history::{Errors, HistoryEntry, Monitor};
pub use jacobi::Jacobi;
pub use mesh_error::{Coarsened, coarsened};
pub use multigrid::{CoarseMatrices, Coarsest, Defect, Multigrid};
pub use overshooting::Overshooting;
pub use pcg::Pcg;
pub use progressive_refinement::{DISPLAY_AMBIENT, ProgressiveRefinement, STEPS_PER_PASS};
pub use registry::solver;
pub use settings::SolverSettings;
pub use solution::{ChannelQuality, Solution};
pub use solve::{SolveOptions, SolveResult, Solver};
pub use sor::{OMEGA, Sor};
pub use start::Start;
pub use stop::{StopReason, Tolerance};
pub use system::RadiositySystem;
pub(crate) use system::power_of_two_below;
pub(crate) use vectors::relative_errors;
