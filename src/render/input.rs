//! The input of the renderer.

use super::outdoors::Outdoors;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::visibility::Visibility;

/// A scene with a solution; blocks have one row per patch and one (grey) or three channels.
#[derive(Clone, Copy)]
pub struct RenderInput<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its patches.
    pub mesh: &'a Mesh,
    /// Visibility.
    pub visibility: &'a dyn Visibility,
    /// B in W·m⁻².
    pub radiosity: &'a Block,
    /// H = F B in W·m⁻².
    pub irradiance: &'a Block,
    /// F (B − E), the irradiance without direct light from the emitters; needed for a direct pass.
    pub indirect_irradiance: Option<&'a Block>,
    /// The estimated error of B, in W·m⁻².
    pub error: Option<&'a Block>,
    /// Sun and sky; the irradiances of the patches include both, the indirect one only that of the sky.
    pub outdoors: Outdoors,
}
