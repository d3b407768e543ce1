//! What pictures want of the light that they show.

use crate::mesh::Subdivision;
use crate::scene::Scene;

/// Rays for each patch where the light is for a picture: enough that the noise of a patch does not show.
pub const PICTURE_RAYS: u64 = 16384;

/// The tolerance of form factors where the light is for a picture: below a tenth of a typical factor between patches of the default
/// size, which is 1/3000, and errors of both signs mostly cancel; patches of that size are off by more.
pub const PICTURE_TOLERANCE: f64 = 1e-5;

/// The number of patches that the subdivision for a picture aims at.
const PATCHES: f64 = 3000.0;

/// Returns patches of about equal size, 3000 in all, and a few more where contact edges cut faces.
#[must_use]
pub fn picture_patches(scene: &Scene) -> Subdivision {
    let area: f64 = scene.face_ids().map(|face| scene.area_vector(face).length()).sum();
    Subdivision::MaxEdge((area / PATCHES).sqrt())
}
