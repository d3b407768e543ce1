//! Images of light on voxels: of the surfaces that they represent, or of the voxels themselves.

use super::{Context, ImageView, Model, VoxelStudy, WorkflowError, warn_if_blank};
use crate::audit;
use crate::matrix::operator::Block;
use crate::mesh::Subdivision;
use crate::render::{Attributes, Image, Outdoors, RenderInput, RenderSettings, render};
use crate::scene::Scene;
use crate::visibility::Visibility as _;
use crate::voxel::{Grid, onto_patches, picture};

/// The size of patches of the image, in voxels: fine enough for the resolution of the voxels.
const PATCH_VOXELS: f64 = 2.0;

/// Returns the subdivision for an image of light on voxels, of which `n_voxels` lie along the longest axis.
#[must_use]
pub fn voxel_patches(scene: &Scene, n_voxels: u32) -> Subdivision {
    Grid::new(scene, n_voxels).map_or(Subdivision::Uniform(1), |grid| {
        Subdivision::MaxEdge(PATCH_VOXELS * grid.voxel_size)
    })
}

/// The request for an image of light on voxels.
#[derive(Clone, Copy)]
pub struct VoxelImageRequest<'a> {
    /// The view.
    pub view: &'a ImageView,
    /// The settings of the image.
    pub settings: RenderSettings,
    /// True if it shows the voxels themselves, not the surfaces that they represent.
    pub show_voxels: bool,
}

impl Model {
    /// Renders light on voxels, and returns the image with the attributes of its file.
    ///
    /// # Errors
    /// [`WorkflowError::Render`], and [`WorkflowError::Interrupted`].
    pub fn render_voxels(
        &self,
        study: &VoxelStudy,
        request: VoxelImageRequest<'_>,
        cx: &mut Context,
    ) -> Result<(Image, Attributes), WorkflowError> {
        let view = request.view.as_view();
        cx.settings.show_voxels = Some(request.show_voxels);
        let image = if request.show_voxels {
            cx.time("render", || picture(&study.voxels, &study.radiosity, view))
        } else {
            self.render_on_patches(study, request, cx)?
        };
        cx.audited(audit::picture(&image));
        // An image of the voxels themselves has other layers.
        if !request.show_voxels {
            let camera = request.view.origin().map(|origin| origin.text(&cx.naming));
            warn_if_blank(&image, view, camera.as_deref(), cx);
        }
        let offset = self.visibility.offset();
        let solution = cx.settings.record().into();
        let attributes = Attributes::new(&self.scene, view.description(), request.settings, offset, solution);
        Ok((image, attributes))
    }

    /// Renders the irradiance of the voxels on the patches of the surfaces that they represent.
    fn render_on_patches(
        &self,
        study: &VoxelStudy,
        request: VoxelImageRequest<'_>,
        cx: &mut Context,
    ) -> Result<Image, WorkflowError> {
        let irradiance = cx.time("display", || {
            onto_patches(&study.voxels, &self.scene.faces, &self.mesh, &study.irradiance)
        });
        let (reflectance, exitance) = self.materials();
        let radiosity = radiosity_of(&irradiance, &reflectance, &exitance);
        cx.judge_leaking_power((&reflectance, &exitance), &radiosity);
        let input = RenderInput {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            radiosity: &radiosity,
            irradiance: &irradiance,
            indirect_irradiance: None,
            error: None,
            outdoors: Outdoors::default(),
        };
        let view = request.view.as_view();
        Ok(cx.time("render", || render(&input, view, &request.settings, &cx.progress()))?)
    }
}

/// Returns B = E + ρ H, W·m⁻², \[n, c\].
fn radiosity_of(irradiance: &Block, reflectance: &Block, exitance: &Block) -> Block {
    let mut radiosity = exitance.clone();
    let terms = reflectance.values().iter().zip(irradiance.values());
    for (b, (rho, h)) in radiosity.values_mut().iter_mut().zip(terms) {
        *b += rho * h;
    }
    radiosity
}
