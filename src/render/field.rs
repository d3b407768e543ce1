//! The form factor from every visible point to one surface.

use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};

use super::display::Unwatched;
use super::error::RenderError;
use super::image::Image;
use super::input::RenderInput;
use super::outdoors::Outdoors;
use super::renderer::SurfaceSums;
use super::run::rendered;
use super::settings::RenderSettings;
use super::view::View;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::scene::{Material, MaterialId, Scene, SurfaceId};
use crate::visibility::Visibility;

/// The default number of rays to each face of the surface, for a field by [`DirectMethod::Polygons`](super::DirectMethod::Polygons).
pub const FIELD_SHADOW_RAYS: NonZeroU32 = NonZeroU32::MIN.saturating_add(63);

/// The description of a field of form factors in an image file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldRecord {
    /// The name of the target surface.
    pub surface: String,
}

/// A scene and the target surface of form factors.
#[derive(Clone, Copy)]
pub struct FieldInput<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its patches, for the layer `patch`; the form factors do not depend on them.
    pub mesh: &'a Mesh,
    /// Visibility.
    pub visibility: &'a dyn Visibility,
    /// The surface.
    pub surface: SurfaceId,
}

/// Renders the form factor F(x → S) from every visible point x to the visible part of a surface S.
///
/// F is the irradiance at x where S alone emits, 1 W·m⁻², and nothing reflects: `settings.direct` selects the method, and the error is that of the
/// [method](super::DirectMethod). It is 0 on backs of faces and in the background.
///
/// Layers (f32 but for `patch`): `Y` the form factor, in \[0, 1\], the mean over the pixel's samples; `error` its standard error as if all samples were
/// independent, 0 for methods without one; `N.X/Y/Z`, `P.X/Y/Z`, `Z` and `patch` as in [`render`](super::render()).
///
/// Equal arguments give equal images at any number of threads.
///
/// # Errors
/// [`RenderError::Empty`], [`RenderError::TooLarge`].
///
/// # Panics
/// If the scene has no such surface.
#[doc(alias = "view factor")]
#[track_caller]
pub fn field(
    input: &FieldInput<'_>,
    view: &dyn View,
    settings: &RenderSettings,
    progress: &dyn Progress,
) -> Result<Field, RenderError> {
    assert!(
        (input.surface.0 as usize) < input.scene.surfaces.len(),
        "a surface of the scene"
    );
    let scene = lit_by(input.scene, input.surface);
    let dark = Block::zeros(input.mesh.n_patches(), 1);
    let lit = RenderInput {
        scene: &scene,
        mesh: input.mesh,
        visibility: input.visibility,
        radiosity: &dark,
        irradiance: &dark,
        indirect_irradiance: Some(&dark),
        error: None,
        outdoors: Outdoors::default(),
    };
    let (lit_image, sums) = rendered(&lit, view, settings, progress, &Unwatched)?;
    let mut image = Image::new(lit_image.width(), lit_image.height());
    let renamed = |name: &str| match name {
        "direct.R" => Some("Y".to_owned()),
        "direct_error.R" => Some("error".to_owned()),
        _ => (["Z", "patch", "pixel_samples"].contains(&name) || name.starts_with("N.") || name.starts_with("P."))
            .then(|| name.to_owned()),
    };
    for layer in lit_image.into_layers() {
        if let Some(name) = renamed(&layer.name) {
            image.insert(&name, layer.samples);
        }
    }
    let means = surface_means(&image, input, &sums);
    Ok(Field { image, means })
}

/// Returns the scene with two materials: one surface emits 1 W·m⁻², and nothing reflects.
fn lit_by(scene: &Scene, surface: SurfaceId) -> Scene {
    let material = |name: &str, exitance: f64| Material {
        name: name.to_owned(),
        reflectance: [0.0; 3],
        exitance: [exitance; 3],
    };
    let mut lit = scene.clone();
    lit.materials = vec![material("dark", 0.0), material("light", 1.0)];
    for face in &mut lit.faces {
        face.material = MaterialId(u32::from(face.surface == surface));
    }
    lit
}

/// A field of form factors.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Its layers.
    pub image: Image,
    /// Its mean over the visible part of each surface of the scene.
    pub means: Vec<SurfaceMean>,
}

/// The mean of a field over what an image shows of the front of one surface.
///
/// It is the mean over the samples of all pixels, each by its share of its pixel and each on one surface alone, so that no other surface has a part in it; in an unfolded view it is the area mean, the form
/// factor from the surface. There samples lie on a regular grid, as for the midpoint rule: with h its spacing on the surface, the mean is off by O(h²) where F is smooth and the surface's edges run along
/// the grid, and by (F at the edge − its mean) · perimeter · h / (2 area) at most where they do not, mostly by much less.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SurfaceMean {
    /// The number of pixels whose centre shows the surface.
    pub n_pixels: u64,
    /// The number of samples that show its front.
    pub n_samples: u64,
    /// The mean form factor of these samples; `None` without any.
    pub form_factor: Option<f64>,
}

/// Returns the mean of each surface.
fn surface_means(image: &Image, input: &FieldInput<'_>, sums: &SurfaceSums) -> Vec<SurfaceMean> {
    let mut n_pixels = vec![0; input.scene.surfaces.len()];
    for &patch in image.u32("patch").unwrap_or_default() {
        if let Some(patch) = input.mesh.patches.get(patch as usize) {
            n_pixels[patch.surface.0 as usize] += 1;
        }
    }
    (0..)
        .map(SurfaceId)
        .zip(n_pixels)
        .map(|(surface, n_pixels)| {
            let sum = sums.get(&surface).copied().unwrap_or_default();
            SurfaceMean {
                n_pixels,
                n_samples: sum.n_samples,
                form_factor: (sum.n_samples > 0).then(|| sum.irradiance / sum.share),
            }
        })
        .collect()
}
