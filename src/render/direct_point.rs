//! A point that receives direct light, the estimate there, and its shadow rays.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::mesh::PatchId;
use crate::scene::FaceId;
use crate::visibility::RayBatch;

/// A front-facing point at which the direct irradiance is wanted.
#[derive(Clone, Copy, Debug)]
pub(super) struct DirectPoint {
    pub(super) face: FaceId,
    pub(super) patch: PatchId,
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
    /// The number of the point's own random stream.
    pub(super) stream: u64,
}

/// The estimate at one point, per channel.
///
/// The variance is that of the mean of independent samples; it is 0 where all samples agree.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct DirectEstimate {
    pub(super) mean: [f64; 3],
    pub(super) variance: [f64; 3],
}

/// Rays from a point to the light, with their weights and whether they are occluded.
#[derive(Default)]
pub(super) struct ShadowRays {
    pub(super) rays: RayBatch,
    pub(super) blocked: Vec<bool>,
    pub(super) weights: Vec<f64>,
}
