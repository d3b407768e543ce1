//! What documents say of surfaces.

use serde_json::{Value, json};

use crate::heat::Sunlit;
use crate::matrix::operator::Block;
use crate::scene::Surface;
use crate::solver::Solution;
use crate::workflow::Model;

/// Returns name, area and number of patches of each surface.
pub(super) fn surfaces_to_json(model: &Model) -> Value {
    let mut n_patches = vec![0u64; model.scene.surfaces.len()];
    for patch in &model.mesh.patches {
        n_patches[patch.surface.0 as usize] += 1;
    }
    let areas = model.surface_areas();
    let surface = |(k, s): (usize, &Surface)| json!({"name": s.name, "area_m2": areas[k], "n_patches": n_patches[k]});
    model.scene.surfaces.iter().enumerate().map(surface).collect()
}

/// Returns name, area and mean radiosity of each surface.
pub(super) fn surfaces_with_radiosity(model: &Model, solution: &Solution) -> Value {
    let means = model.surface_means(&solution.radiosity);
    let mut surfaces = surfaces_to_json(model);
    for (surface, mean) in surfaces.as_array_mut().into_iter().flatten().zip(means) {
        surface["radiosity"] = json!(mean);
    }
    surfaces
}

/// Adds what the sun lights of each surface: the fraction of its area, and the mean irradiance straight from the sun, each with its error.
pub(super) fn add_sun(surfaces: &mut Value, model: &Model, sunlit: &Sunlit) {
    let one = |values: &[f64]| Block::from_values(values.to_vec(), 1);
    let means = [
        ("sunlit_fraction", one(&sunlit.light.fraction)),
        ("sunlit_fraction_error", one(&sunlit.light.fraction_error)),
        ("sun_irradiance", sunlit.irradiance.clone()),
        ("sun_irradiance_error", sunlit.error.clone()),
    ];
    for (key, block) in means {
        let of_surfaces = model.surface_means(&block);
        for (surface, mean) in surfaces.as_array_mut().into_iter().flatten().zip(of_surfaces) {
            let is_fraction = key.starts_with("sunlit");
            surface[key] = if is_fraction { json!(mean[0]) } else { json!(mean) };
        }
    }
}
