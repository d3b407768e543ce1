//! The JSON documents about images.

use std::cmp::Ordering;

use serde::Serialize;

use super::{FieldSurface, FormFactorRecord, LitSurface, Quality, SolverRecord};
use crate::form_factor::Change;
use crate::parameter::Named;
use crate::render::GatherReport;
use crate::scene::Motion;
use crate::solver::{ChoiceReason, Energy, StopReason};
use crate::workflow::{FormFactorStudy, FrameStudy, MeshError, PoseStudy};

/// The result of `render`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct RenderDocument {
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
    /// The OpenEXR file.
    pub image: String,
    /// The PNG file.
    pub preview: String,
    /// The cost of final gather; null without it.
    pub final_gather: Option<GatherReport>,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
}

/// The result of `render --frames`: what stands first is of the pose whose solution is worst, with the worst figures of all poses.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FramesDocument {
    /// How the solution was reached.
    #[serde(flatten)]
    pub solver: SolverRecord,
    /// The form factors of that pose.
    pub form_factors: FormFactorRecord,
    /// How many lightings there are.
    pub n_lightings: usize,
    /// The poses, in the order of their first frames.
    pub poses: Vec<PoseRecord>,
    /// The frames, in the order of the list.
    pub frames: Vec<FrameRecord>,
}

impl FramesDocument {
    /// Returns the document of poses, each with the record of its solution, and of frames.
    ///
    /// # Panics
    /// If there is no pose.
    #[must_use]
    #[track_caller]
    pub fn new(poses: Vec<(SolverRecord, PoseRecord)>, frames: Vec<FrameRecord>, n_lightings: usize) -> Self {
        let worst = poses.iter().max_by(|(_, a), (_, b)| a.order(b));
        let (solver, at_worst) = worst.cloned().expect("a sequence has a pose");
        let qualities: Vec<Quality> = poses.iter().map(|(_, pose)| pose.quality).collect();
        Self {
            solver: SolverRecord {
                quality: solver.quality.with_worst_of(&qualities),
                ..solver
            },
            form_factors: at_worst.form_factors,
            n_lightings,
            poses: poses.into_iter().map(|(_, pose)| pose).collect(),
            frames,
        }
    }
}

impl PoseRecord {
    /// Returns the record of a pose; `solver` is the record of its solution.
    #[must_use]
    pub fn new(study: &PoseStudy<'_>, solver: &SolverRecord) -> Self {
        Self {
            frames: study.frames.iter().map(|frame| frame.name.clone()).collect(),
            n_lightings: study.n_lightings,
            solver: solver.solver.clone(),
            why: solver.why,
            n_passes: solver.n_passes,
            form_factors: FormFactorRecord::from(study.factors),
            update: study.change.map(|change| UpdateRecord::new(change, study.factors)),
            quality: solver.quality,
        }
    }

    /// Compares the quality of two poses: by the end of the solver, the tolerance of the form factors, the residual.
    fn order(&self, other: &Self) -> Ordering {
        let rank = |pose: &Self| (severity(pose.quality.stop_reason), !pose.form_factors.tolerance_met);
        let residual = |pose: &Self| pose.quality.residual_l2.unwrap_or(f64::INFINITY);
        let by_residual = residual(self).total_cmp(&residual(other));
        rank(self).cmp(&rank(other)).then(by_residual)
    }
}

/// Returns the severity of the end of a solver, for comparisons.
fn severity(reason: StopReason) -> u8 {
    match reason {
        StopReason::Converged => 0,
        StopReason::MaxPasses => 1,
        StopReason::Stagnated => 2,
        _ => 3,
    }
}

/// One pose of a sequence.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PoseRecord {
    /// The names of its frames.
    pub frames: Vec<String>,
    /// How many lightings were solved together.
    pub n_lightings: usize,
    /// The solver.
    pub solver: String,
    /// Why `auto` chose it.
    #[cfg_attr(test, schemars(with = "Option<String>"))]
    pub why: Option<ChoiceReason>,
    /// Passes over the form factors.
    pub n_passes: usize,
    /// The form factors.
    pub form_factors: FormFactorRecord,
    /// The fate of the first pose's form factors; null of that one.
    pub update: Option<UpdateRecord>,
    /// How good the solution is.
    #[serde(flatten)]
    pub quality: Quality,
}

/// The fate of the first pose's form factors in a later one.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct UpdateRecord {
    /// Faces that moved.
    pub n_moved_faces: usize,
    /// Pairs of patches that face each other and were taken over; 0 where the method computes everything anew.
    pub n_kept: u64,
    /// Pairs that face each other and were computed anew; null of methods that do not look at pairs.
    pub n_recomputed: Option<u64>,
}

impl UpdateRecord {
    /// Returns the reuse of form factors after a change.
    #[must_use]
    pub fn new(change: &Change, study: &FormFactorStudy) -> Self {
        Self {
            n_moved_faces: change.n_faces(),
            n_kept: study.pairs.map_or(0, |pairs| pairs.kept),
            n_recomputed: study.pairs.map(|pairs| pairs.full + pairs.partial + pairs.hidden),
        }
    }
}

/// One frame of a sequence.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FrameRecord {
    /// Its name.
    pub name: String,
    /// The file of its lighting; null where the materials are the scene's own.
    pub lighting: Option<String>,
    /// The motions in it.
    pub moves: Vec<Motion>,
    /// Where its camera comes from.
    pub camera: String,
    /// The OpenEXR file.
    pub image: String,
    /// The PNG file.
    pub preview: String,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// The cost of final gather; null without it.
    pub final_gather: Option<GatherReport>,
    /// The change by a mesh of about a quarter of the patches; null where that is not known.
    pub mesh_error: Option<MeshError>,
    /// The power balance of each channel.
    pub energy: Vec<Energy>,
    /// The surfaces, in file order.
    pub surfaces: Vec<LitSurface>,
    /// How good the solution is.
    #[serde(flatten)]
    pub quality: Quality,
}

impl FrameRecord {
    /// Returns the record of a frame, with parameters as `named` writes them.
    #[must_use]
    pub fn new(study: &FrameStudy<'_>, named: Named<'_>) -> Self {
        let (frame, image) = (study.frame, &study.image);
        Self {
            name: frame.name.clone(),
            lighting: study.lighting_file.map(|lighting| lighting.display().to_string()),
            moves: frame.motions.clone(),
            camera: frame.view.camera_text(named),
            image: frame.output.display().to_string(),
            preview: frame.preview.display().to_string(),
            width: image.width(),
            height: image.height(),
            final_gather: study.gather,
            mesh_error: study.mesh_error.clone(),
            energy: study.solution.energy.clone(),
            surfaces: LitSurface::in_daylight(study.model, &study.solution, &study.direct),
            quality: Quality::new(&study.solution, study.error),
        }
    }
}

/// The result of `field`.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FieldDocument {
    /// The surface that the form factors are to.
    pub surface: String,
    /// The OpenEXR file.
    pub image: String,
    /// The PNG file.
    pub preview: String,
    /// Pixels.
    pub width: usize,
    /// Pixels.
    pub height: usize,
    /// The surfaces, in file order, with the mean of the form factors from each.
    pub surfaces: Vec<FieldSurface>,
}
