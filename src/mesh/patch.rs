//! One patch: an unknown of the radiosity system.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::scene::{Corners, FaceId, MaterialId, SurfaceId};

/// Index of a patch in [`Mesh::patches`](super::Mesh::patches).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct PatchId(pub u32);

impl PatchId {
    /// Returns the id of the patch at `index`.
    ///
    /// # Panics
    /// If `index` is not below 2^32; no mesh has as many patches.
    #[must_use]
    #[track_caller]
    pub fn from_index(index: usize) -> Self {
        Self(u32::try_from(index).expect("a patch index fits into 32 bits"))
    }
}

/// A flat triangle or convex quad with one radiosity.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Indices into [`Mesh::vertices`](super::Mesh::vertices), counter-clockwise seen from the front.
    pub corners: Corners,
    /// The face that the patch is a part of.
    pub face: FaceId,
    /// The surface that owns the face.
    pub surface: SurfaceId,
    /// The face's material.
    pub material: MaterialId,
    /// A_i in m².
    pub area: f64,
    /// The unit normal of the face, on the side that sees.
    pub normal: DVec3,
    /// The centroid.
    pub centroid: DVec3,
}

/// A point on a patch, as weights of its corners.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PatchPoint {
    /// The patch.
    pub patch: PatchId,
    /// Weights of the corners in their order; the fourth is 0 in a triangle.
    pub weights: [f64; 4],
}
