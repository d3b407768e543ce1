//! The JSON documents about each surface.

use serde::Serialize;

use crate::render::SurfaceMean;
use crate::scene::Scene;
use crate::voxel::SurfelMean;
use crate::workflow::{Model, SurfaceRecord};

/// A surface and the form factor from it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct FieldSurface {
    /// The surface.
    #[serde(flatten)]
    pub surface: SurfaceRecord,
    /// The mean of the field.
    #[serde(flatten)]
    pub mean: SurfaceMean,
}

impl FieldSurface {
    /// Returns the surfaces of a model with the means of a field.
    #[must_use]
    pub fn of(model: &Model, means: &[SurfaceMean]) -> Vec<Self> {
        let surfaces = SurfaceRecord::of(model).into_iter().zip(means.iter().cloned());
        surfaces.map(|(surface, mean)| Self { surface, mean }).collect()
    }
}

/// A surface as its voxels have it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct VoxelSurface {
    /// Its name.
    pub name: String,
    /// The area of its surfels, m².
    pub area_m2: f64,
    /// How many surfels it has: one in each of its voxels.
    pub n_voxels: u64,
    /// The area mean of the radiosity, W·m⁻², of each channel.
    #[cfg_attr(test, schemars(with = "Vec<Option<f64>>"))]
    pub radiosity: Vec<f64>,
}

impl VoxelSurface {
    /// Returns the surfaces of a scene with the means over their surfels.
    #[must_use]
    pub fn of(scene: &Scene, means: Vec<SurfelMean>) -> Vec<Self> {
        let surfaces = scene.surfaces.iter().zip(means);
        let record = |(surface, mean): (&crate::scene::Surface, SurfelMean)| Self {
            name: surface.name.clone(),
            area_m2: mean.area,
            n_voxels: mean.n_surfels,
            radiosity: mean.value,
        };
        surfaces.map(record).collect()
    }
}
