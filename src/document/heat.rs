//! The documents of `heat` and `points`.

use serde::Serialize;

use super::FormFactorRecord;
use crate::heat::{PointStatus, PointView};
use crate::workflow::{FormFactorStudy, HeatStep, HeatStudy, Model};

/// The result of `heat`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct HeatDocument {
    /// How many patches there are.
    pub n_patches: usize,
    /// Temperatures, fluxes and their balance.
    #[serde(flatten)]
    pub result: HeatStep,
    /// The form factors.
    pub form_factors: FormFactorRecord,
}

impl HeatDocument {
    /// Returns the document of the heat of a model.
    #[must_use]
    pub fn new(model: &Model, factors: &FormFactorStudy, study: &HeatStudy) -> Self {
        Self {
            n_patches: model.mesh.n_patches(),
            result: HeatStep::new(study),
            form_factors: factors.into(),
        }
    }
}

/// The result of `points`.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PointsDocument {
    /// How many points there are.
    pub n_points: usize,
    /// How many of them lie on a face.
    pub n_on_face: usize,
    /// How many of them lie inside of a solid.
    pub n_inside_solid: usize,
}

impl PointsDocument {
    /// Counts points by their status.
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
