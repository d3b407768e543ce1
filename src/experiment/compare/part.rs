//! One half of a comparison, and what it is made on.

use super::{CompareSettings, Comparison, compare};
use crate::experiment::{ExperimentError, Reference};
use crate::form_factor::{ExactMethod, FormFactorMethod as _, Input};
use crate::mesh::{Mesh, Subdivision};
use crate::scene::Scene;
use crate::workflow::{Context, MatrixDemand, Model};

/// A scene is cut so that it has at least this many patches.
const PATCHES: f64 = 200.0;

/// How much tighter than the tolerance asked for the reference is.
const TIGHTER: f64 = 100.0;

/// Matrices that exist at a time beside the one that is being computed: the references with visibility and without.
const REFERENCES: u32 = 2;

/// One half of a comparison: occluders looked at or not.
#[derive(Clone, Debug)]
pub struct Part {
    /// `on` or `off`.
    pub visibility: &'static str,
    /// The reference that errors are measured against.
    pub reference: Reference,
    /// The measurements.
    pub comparison: Comparison,
}

/// Returns how a scene is cut for a comparison where nothing else is asked for: into 200 patches or more.
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

/// Returns what is known of the form factors of a comparison before any is computed.
#[must_use]
pub fn matrix_demand(mesh: &Mesh) -> MatrixDemand {
    MatrixDemand {
        by_rows: true,
        repaired: false,
        n_entries: u64::MAX,
        n_beside: REFERENCES,
        // No method takes more than the reference.
        working_byte: ExactMethod::default().working_byte(mesh.n_patches()),
    }
}

impl Part {
    /// Finds the reference, at a hundredth of `tolerance` where nothing is known of the scene, and runs all settings.
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

    /// Returns what the methods look at: occluders are left out where `visibility` is `off`.
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
