//! The light of each surface, for documents.

use serde::{Deserialize, Serialize};

use super::{DirectDaylight, Model};
use crate::heat::Sunlit;
use crate::matrix::operator::Block;
use crate::solver::Solution;

/// A surface and its patches.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
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
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LitSurface {
    /// The surface.
    #[serde(flatten)]
    pub surface: SurfaceRecord,
    /// The area mean of the radiosity, W·m⁻², of each channel.
    #[cfg_attr(test, schemars(with = "Vec<Option<f64>>"))]
    pub radiosity: Vec<f64>,
    /// The sunlight, where the sun shines.
    #[serde(flatten)]
    pub sun: Option<SunlitSurface>,
    /// The light of the sky, where it shines.
    #[serde(flatten)]
    pub sky: Option<SkylitSurface>,
}

/// The light straight from the sky on a surface.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SkylitSurface {
    /// The area mean of the irradiance straight from the sky, W·m⁻², of each channel.
    pub sky_irradiance: Vec<f64>,
    /// The error of that, W·m⁻².
    pub sky_irradiance_error: Vec<f64>,
}

/// The sunlight on a surface.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SunlitSurface {
    /// The fraction of its area that the sun lights.
    pub sunlit_fraction: f64,
    /// The error of that.
    pub sunlit_fraction_error: f64,
    /// The area mean of the irradiance straight from the sun, W·m⁻², of each channel.
    pub sun_irradiance: Vec<f64>,
    /// The error of that, W·m⁻².
    pub sun_irradiance_error: Vec<f64>,
}

impl SunlitSurface {
    /// Returns the surfaces of a model with the means of the sunlight.
    #[must_use]
    fn of(model: &Model, sunlit: &Sunlit) -> Vec<Self> {
        let one = |values: &[f64]| model.surface_means(&Block::from_values(values.to_vec(), 1));
        let [fractions, fraction_errors] =
            [&sunlit.light.fraction, &sunlit.light.fraction_error].map(|values| one(values));
        let [irradiances, errors] = [&sunlit.irradiance, &sunlit.error].map(|block| model.surface_means(block));
        let of_surface = |k: usize| Self {
            sunlit_fraction: fractions[k][0],
            sunlit_fraction_error: fraction_errors[k][0],
            sun_irradiance: irradiances[k].clone(),
            sun_irradiance_error: errors[k].clone(),
        };
        (0..model.scene.surfaces.len()).map(of_surface).collect()
    }
}

impl LitSurface {
    /// Returns the surfaces of a model with the means of a solution, and of the direct light of sun and sky.
    #[must_use]
    pub fn in_daylight(model: &Model, solution: &Solution, direct: &DirectDaylight) -> Vec<Self> {
        let mut surfaces = Self::of(model, solution);
        if let Some(sunlit) = &direct.sun {
            for (surface, sun) in surfaces.iter_mut().zip(SunlitSurface::of(model, sunlit)) {
                surface.sun = Some(sun);
            }
        }
        if let Some(light) = &direct.sky {
            let [irradiances, errors] = light.each_ref().map(|block| model.surface_means(block));
            for (surface, (sky_irradiance, sky_irradiance_error)) in
                surfaces.iter_mut().zip(irradiances.into_iter().zip(errors))
            {
                surface.sky = Some(SkylitSurface {
                    sky_irradiance,
                    sky_irradiance_error,
                });
            }
        }
        surfaces
    }

    /// Returns the surfaces of a model with the means of a solution.
    #[must_use]
    pub fn of(model: &Model, solution: &Solution) -> Vec<Self> {
        let means = model.surface_means(&solution.radiosity);
        let surfaces = SurfaceRecord::of(model).into_iter().zip(means);
        let record = |(surface, radiosity)| Self {
            surface,
            radiosity,
            sun: None,
            sky: None,
        };
        surfaces.map(record).collect()
    }
}
