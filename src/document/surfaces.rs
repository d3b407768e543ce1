//! What documents hold of each surface.

use serde::Serialize;

use crate::render::SurfaceMean;
use crate::scene::Scene;
use crate::solver::Solution;
use crate::voxel::SurfelMean;
use crate::workflow::Model;

/// A surface and its patches.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct SurfaceRecord {
    /// Its name: an `o` or `g` group of the scene's file.
    pub name: String,
    /// The area of its patches, m².
    pub area_m2: f64,
    /// How many patches it has.
    pub n_patches: u64,
}

impl SurfaceRecord {
    /// Returns the surfaces of a model, in file order.
    #[must_use]
    pub fn of(model: &Model) -> Vec<Self> {
        let mut counts = vec![0u64; model.scene.surfaces.len()];
        for patch in &model.mesh.patches {
            counts[patch.surface.0 as usize] += 1;
        }
        let surfaces = model.scene.surfaces.iter().zip(model.surface_areas()).zip(counts);
        let record = |((surface, area_m2), n_patches): ((&crate::scene::Surface, f64), u64)| Self {
            name: surface.name.clone(),
            area_m2,
            n_patches,
        };
        surfaces.map(record).collect()
    }
}

/// A surface and its light.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct LitSurface {
    /// The surface.
    #[serde(flatten)]
    pub surface: SurfaceRecord,
    /// The area mean of the radiosity, W·m⁻², of each channel.
    #[cfg_attr(feature = "cli", schemars(with = "Vec<Option<f64>>"))]
    pub radiosity: Vec<f64>,
}

impl LitSurface {
    /// Returns the surfaces of a model with the means of a solution.
    #[must_use]
    pub fn of(model: &Model, solution: &Solution) -> Vec<Self> {
        let means = model.surface_means(&solution.radiosity);
        let surfaces = SurfaceRecord::of(model).into_iter().zip(means);
        let record = |(surface, radiosity)| Self { surface, radiosity };
        surfaces.map(record).collect()
    }
}

/// A surface and the form factor from it.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
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
#[cfg_attr(feature = "cli", derive(schemars::JsonSchema))]
pub struct VoxelSurface {
    /// Its name.
    pub name: String,
    /// The area of its surfels, m².
    pub area_m2: f64,
    /// How many surfels it has: one in each of its voxels.
    pub n_voxels: u64,
    /// The area mean of the radiosity, W·m⁻², of each channel.
    #[cfg_attr(feature = "cli", schemars(with = "Vec<Option<f64>>"))]
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
