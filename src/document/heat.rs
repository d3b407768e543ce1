//! The documents of `heat` and `points`.

use serde::Serialize;

use super::{FormFactorRecord, Quality};
use crate::heat::{HeatBalance, PointStatus, PointView, SurfaceHeat};
use crate::workflow::{FormFactorStudy, HeatStudy, MeshError, Model};

/// The result of `heat`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct HeatDocument {
    /// How many patches there are.
    pub n_patches: usize,
    /// The surfaces, in file order.
    pub surfaces: Vec<SurfaceHeat>,
    /// Where the heat comes from and goes.
    #[serde(flatten)]
    pub balance: HeatBalance,
    /// The greatest error of a surface's irradiance, relative to the larger of that and its emissive power.
    pub relative_error_max: f64,
    /// The change by a mesh of about a quarter of the patches; null where that is not known.
    pub mesh_error: Option<MeshError>,
    /// How good the solution of the solar band is; null without sun and sky.
    pub solar: Option<Quality>,
    /// How good that of the thermal band is.
    pub thermal: Quality,
    /// The form factors.
    pub form_factors: FormFactorRecord,
}

impl HeatDocument {
    /// Returns what was found in a model.
    #[must_use]
    pub fn new(model: &Model, factors: &FormFactorStudy, study: &HeatStudy) -> Self {
        Self {
            n_patches: model.mesh.n_patches(),
            surfaces: study.heat.surfaces.clone(),
            balance: study.heat.balance,
            relative_error_max: study.heat.relative_error,
            mesh_error: study.mesh_error.clone(),
            solar: study.solar.as_ref().map(|solution| Quality::new(solution, study.error)),
            thermal: Quality::new(&study.thermal, study.error),
            form_factors: factors.into(),
        }
    }
}

/// The result of `points`.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct PointsDocument {
    /// How many points there are.
    pub n_points: usize,
    /// How many of them lie on a face.
    pub n_on_face: usize,
    /// How many of them lie inside of a solid.
    pub n_inside_solid: usize,
}

impl PointsDocument {
    /// Counts what points are.
    #[must_use]
    pub fn new(views: &[PointView]) -> Self {
        let n_of = |status: PointStatus| views.iter().filter(|view| view.status == status).count();
        Self {
            n_points: views.len(),
            n_on_face: n_of(PointStatus::OnFace),
            n_inside_solid: n_of(PointStatus::InsideSolid),
        }
    }
}
