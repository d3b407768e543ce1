//! Experiments: the methods side by side on one scene, and the papers' tables beside our results.
//!
//! [`compare`](compare()) runs every setting of every method ([`SWEEPS`]) over several seeds, and reports its error against a [`Reference`] and its run time. [`baranoski`] reproduces the tables of
//! that paper, [`lewis`] those of the paper on multigrid. [`malgouyres`] measures the error of the paper on voxels. [`crater`] compares the shadow of a tessellated crater with its closed form.
//! [`pictures`] compares ways to render one solution. [`stability`] tries every solver on stiff, extreme and impossible systems.
//!
//! Run times are results here, and the only ones that vary between runs. `radiosity reproduce` keeps them apart: files with `time` in their names contain
//! them, and so does `index.html`, the page of all results ([`page`](crate::report::page)); all others have the same bytes for the same settings. The printed report and `--json` include both.

pub mod baranoski;
pub mod compare;
pub mod crater;
pub mod findings;
mod known;
pub mod lewis;
pub mod malgouyres;
mod pareto;
pub mod pictures;
mod reference;
mod solved;
pub mod stability;
pub mod statistics;
mod storage;
mod sweep;

pub use compare::{CaseSummary, CompareSettings, Comparison, LeftOut, Run, compare};
pub use reference::{Reference, ReferenceKind, ReferenceLevel, ReferenceValues};
pub use storage::{StorageFigures, storage_figures};
pub use sweep::{Parameter, RayUse, SWEEPS, Sweep, sweep_by_name};

use crate::form_factor::FormFactorError;
use crate::matrix::MatrixError;
use crate::parameter::Named;
use crate::solver::StopReason;

/// A reason why an experiment failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// A method failed.
    #[error("{method} with {parameter} {value}: {source}")]
    Method {
        /// The method's name in the sweep.
        method: &'static str,
        /// The parameter that varies.
        parameter: &'static str,
        /// Its value.
        value: u64,
        /// The error.
        source: FormFactorError,
    },
    /// The reference could not be computed.
    #[error("the reference: {0}")]
    Reference(#[source] FormFactorError),
    /// The form factors of a model could not be computed.
    #[error(transparent)]
    FormFactors(FormFactorError),
    /// Form factors could not be stored.
    #[error(transparent)]
    Matrix(#[from] MatrixError),
    /// A built-in scene could not be made.
    #[error(transparent)]
    Scene(#[from] crate::scene::SceneError),
    /// A scene could not be cut into patches.
    #[error(transparent)]
    Mesh(#[from] crate::mesh::MeshError),
    /// The ray tracer failed.
    #[error(transparent)]
    Embree(#[from] crate::embree::EmbreeError),
    /// A radiosity system was refused.
    #[error(transparent)]
    Solver(#[from] crate::solver::SolverError),
    /// A reference solution did not converge.
    #[error("the reference: {solver} {stop_reason} at a relative residual of {residual_l2:.1e}")]
    Unsolved {
        /// The solver.
        solver: &'static str,
        /// The stop reason.
        stop_reason: StopReason,
        /// The relative residual.
        residual_l2: f64,
    },
    /// A study could not be made.
    #[error(transparent)]
    Study(#[from] crate::workflow::WorkflowError),
    /// A plot could not be drawn.
    #[error(transparent)]
    Plot(#[from] crate::report::plot::PlotError),
    /// An image could not be encoded.
    #[error("the image cannot be encoded: {0}")]
    Image(String),
    /// Too few runs for an ensemble.
    #[error("{n_seeds} seeds are too few; give at least {least}")]
    TooFewSeeds {
        /// The requested number.
        n_seeds: u64,
        /// The least number.
        least: u64,
    },
}

impl ExperimentError {
    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        match self {
            Self::Method {
                method,
                parameter,
                value,
                source,
            } => format!("{method} with {parameter} {value}: {}", source.text(named)),
            Self::Reference(error) => format!("the reference: {}", error.text(named)),
            Self::FormFactors(error) => error.text(named),
            Self::Matrix(error) => error.text(named),
            Self::Scene(error) => error.text(named),
            Self::Mesh(error) => error.text(named),
            Self::Solver(error) => error.text(named),
            Self::Study(error) => error.text(named),
            other => other.to_string(),
        }
    }
}
