//! One half of a comparison, with its scene and reference.

use super::{CompareSettings, Comparison, compare};
use crate::experiment::{ExperimentError, Reference};
use crate::form_factor::{ExactMethod, FormFactorMethod as _, Input};
use crate::mesh::{Mesh, Subdivision};
use crate::scene::Scene;
use crate::workflow::{Context, MatrixDemand, Model};

/// The least number of patches into which a scene is cut.
const PATCHES: f64 = 200.0;

/// The ratio of the requested tolerance to that of the reference.
const TIGHTER: f64 = 100.0;

/// The number of matrices beside the one that is computed: the references with visibility and without.
const REFERENCES: u32 = 2;

/// One half of a comparison: with or without occluders.
#[derive(Clone, Debug)]
pub struct Part {
    /// The half: `on` or `off`.
    pub visibility: &'static str,
    /// The reference that errors are measured against.
    pub reference: Reference,
    /// The measurements.
    pub comparison: Comparison,
}

/// Returns the default subdivision of a scene for a comparison, into at least 200 patches.
#[must_use]
pub fn default_subdivision(scene: &Scene) -> Subdivision {
    let n = (PATCHES / scene.faces.len().max(1) as f64).sqrt().ceil();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 1 and 15"
    )]
    Subdivision::Uniform(n as u32)
}

/// Returns the known properties of the form factors of a comparison.
#[must_use]
pub fn matrix_demand(mesh: &Mesh) -> MatrixDemand {
    MatrixDemand {
        by_rows: true,
        repaired: false,
        n_entries: u64::MAX,
        n_beside: REFERENCES,
        // No method needs more memory than the reference.
        working_byte: ExactMethod::default().working_byte(mesh.n_patches()),
    }
}

impl Part {
    /// Finds the reference, at a hundredth of `tolerance` if no better one is known, and runs all settings.
    ///
    /// # Errors
    /// [`ExperimentError`] if a method fails.
    pub fn measure(
        model: &Model,
        settings: &CompareSettings<'_>,
        visibility: &'static str,
        tolerance: f64,
        cx: &Context,
    ) -> Result<Self, ExperimentError> {
        let input = Self::input(model, visibility);
        let occluders = !model.plan.convex_and_empty;
        let reference = cx.time("reference", || {
            let tolerance = tolerance / TIGHTER;
            Reference::find(input, occluders, tolerance, settings.storage, &cx.progress())
        })?;
        let comparison = cx.time("compare", || compare(input, &reference, settings, &cx.progress()))?;
        Ok(Self {
            visibility,
            reference,
            comparison,
        })
    }

    /// Returns the input of the methods, without occluders if `visibility` is `off`.
    #[must_use]
    pub fn input<'a>(model: &'a Model, visibility: &str) -> Input<'a> {
        Input {
            scene: &model.scene,
            mesh: &model.mesh,
            visibility: &model.visibility,
            unoccluded: visibility == "off",
        }
    }
}
