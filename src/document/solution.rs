//! The JSON documents about solutions.

use serde::Serialize;

use super::{FormFactorRecord, LitSurface};
use crate::solver::{ChoiceReason, Energy, HistoryEntry, Solution};
use crate::workflow::{MeshError, Model, Quality, TotalError};

/// How a solution was reached.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SolverRecord {
    /// Steps of methods that shoot from one patch after the other; null of others.
    pub n_steps: Option<u64>,
    /// How many patches there are.
    pub n_patches: usize,
    /// How many channels there are: 1 where all is grey, else 3, of each lighting.
    pub n_channels: usize,
    /// The solver: the one that was asked for, or that `auto` chose; `none` where nothing reflects.
    pub solver: String,
    /// Why `auto` chose it.
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub why: Option<ChoiceReason>,
    /// Passes over the form factors.
    pub n_passes: usize,
    /// The work before the first pass, in passes over the form factors.
    pub setup_work: f64,
    /// Wall time before the first pass, s.
    pub setup_s: f64,
    /// The state after each pass; 0 is the start.
    pub history: Vec<HistoryEntry>,
    /// How good the solution is.
    #[serde(flatten)]
    pub quality: Quality,
}

impl SolverRecord {
    /// Returns the record of a solution; `solver` is the requested one.
    #[must_use]
    pub fn new(model: &Model, solver: &str, solution: &Solution, stated: TotalError) -> Self {
        let selections = &solution.selections;
        Self {
            n_steps: (!selections.is_empty()).then(|| selections.iter().sum::<u64>()),
            n_patches: model.mesh.n_patches(),
            n_channels: solution.radiosity.n_channels(),
            solver: solution.solver_name(solver).to_owned(),
            why: solution.choice.as_ref().map(|choice| choice.why),
            n_passes: solution.n_passes,
            setup_work: solution.setup_work,
            setup_s: solution.setup_s,
            history: solution.history.clone(),
            quality: Quality::new(solution, stated),
        }
    }
}

/// The result of `solve`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SolveDocument {
    /// How the solution was reached.
    #[serde(flatten)]
    pub solver: SolverRecord,
    /// The power balance of each channel.
    pub energy: Vec<Energy>,
    /// The surfaces, in file order.
    pub surfaces: Vec<LitSurface>,
    /// The form factors; null where none are stored.
    pub form_factors: Option<FormFactorRecord>,
    /// The change by a mesh of about a quarter of the patches; null where that is not known.
    pub mesh_error: Option<MeshError>,
}

/// The result of `solve` with lightings.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LightingsDocument {
    /// How the solution was reached.
    #[serde(flatten)]
    pub solver: SolverRecord,
    /// The form factors.
    pub form_factors: FormFactorRecord,
    /// The light of each lighting.
    pub lightings: Vec<LightingRecord>,
}

/// The light of one lighting.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LightingRecord {
    /// The name of the lighting: that of its file, without directory and ending.
    pub name: String,
    /// 1 where all is grey, else 3.
    pub n_channels: usize,
    /// The power balance of each channel.
    pub energy: Vec<Energy>,
    /// The surfaces, in file order.
    pub surfaces: Vec<LitSurface>,
    /// The change by a mesh of about a quarter of the patches; null where that is not known.
    pub mesh_error: Option<MeshError>,
    /// The file that was written.
    pub output: Option<String>,
    /// How good the solution is.
    #[serde(flatten)]
    pub quality: Quality,
}
