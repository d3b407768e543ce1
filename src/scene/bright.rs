//! The range of exitances within which all computed light stays in the range of f64.

use super::{Material, Scene};

/// The greatest exitance, in W·m⁻²: light computed from more would leave the range of f64.
pub const MAX_EXITANCE: f64 = 1e300;

/// The least exitance beside 0, in W·m⁻².
///
/// Near the least f64 numbers have fewer digits, too few for the conservation checks.
pub const MIN_EXITANCE: f64 = 1e-300;

/// Returns whether an exitance is above 0 and below [`MIN_EXITANCE`].
pub(super) fn is_too_dim(exitance: f64) -> bool {
    exitance > 0.0 && exitance < MIN_EXITANCE
}

/// The greatest power, in W, and the greatest radiosity, in W·m⁻², that one material or surface may cause with all reflections.
const MAX_LIGHT: f64 = 1e305;

/// Returns the greatest exitance of a surface, in W·m⁻².
///
/// Repeated reflection adds up to E / (1 − ρ) at most, and its power to E A / (1 − ρ). `area`: A, in m²; `reflectance_max`: the greatest ρ of the scene.
pub(super) fn exitance_limit(area: f64, reflectance_max: f64) -> f64 {
    // An open room of ρ = 1 has a solution; the largest f64 below 1 bounds its ρ.
    let absorbed = (1.0 - reflectance_max).max(f64::EPSILON / 2.0);
    MAX_EXITANCE.min(MAX_LIGHT * absorbed / area.max(1.0))
}

/// Returns the brightest patch and channel, its exitance and the greatest possible one, W·m⁻², where the light of all patches may leave the range of f64.
///
/// `areas`: A, in m², \[n\]; `reflectance` and `exitance`: ρ and E, \[n, c\], row by row.
pub(crate) fn too_bright_patch(
    areas: &[f64],
    reflectance: &[f64],
    exitance: &[f64],
) -> Option<(usize, usize, f64, f64)> {
    let reflectance_max = reflectance.iter().copied().fold(0.0, f64::max);
    let n_channels = exitance.len() / areas.len().max(1);
    (0..n_channels).find_map(|c| {
        let of_patch = |i: usize| exitance[i * n_channels + c];
        let brightest = (0..areas.len()).max_by(|&i, &j| of_patch(i).total_cmp(&of_patch(j)))?;
        let most = of_patch(brightest);
        // The area that emits as much as all patches together.
        let area: f64 = areas
            .iter()
            .enumerate()
            .map(|(i, area)| area * (of_patch(i) / most))
            .sum();
        let limit = exitance_limit(area, reflectance_max);
        (most > limit).then_some((brightest, c, most, limit))
    })
}

/// Returns a material whose faces emit too much light, with its exitance and the greatest possible one, in W·m⁻².
pub(super) fn too_bright(scene: &Scene) -> Option<(&Material, f64, f64)> {
    let mut areas = vec![0.0; scene.materials.len()];
    for (id, face) in scene.face_ids().zip(&scene.faces) {
        areas[face.material.0 as usize] += scene.area_vector(id).length();
    }
    let reflectance_max = scene.reflectance_max();
    let all = scene.materials.iter().zip(areas).map(|(material, area)| {
        let value = material.exitance.into_iter().fold(0.0, f64::max);
        (material, value, exitance_limit(area, reflectance_max))
    });
    let mut above = all.filter(|(_, value, limit)| value > limit);
    above.next()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_of_patches_stays_within_the_range_of_numbers() {
        let found = |exitance: [f64; 4], rho: f64| too_bright_patch(&[2.0, 0.5], &[rho; 4], &exitance);
        assert_eq!(found([0.0; 4], 1.0), None);
        assert_eq!(found([1.0, 0.0, 0.0, 1e300], 0.5), None);
        assert_eq!(
            found([1.0, 0.0, 0.0, 1.1e300], 0.5),
            Some((1, 1, 1.1e300, MAX_EXITANCE))
        );
        // The sum of all orders of reflection overflows before the light itself does.
        let (patch, channel, most, limit) = found([1e299, 0.0, 3e299, 0.0], 1.0 - 1e-9).expect("too bright");
        assert_eq!((patch, channel, most.to_bits()), (1, 0, 3e299_f64.to_bits()));
        // The power is that of 2 / 3 + 1 / 2 m² of the brightest patch.
        let expected = MAX_LIGHT * 1e-9 / (2.0 / 3.0 + 0.5);
        assert!((limit / expected - 1.0).abs() < 1e-6, "{limit:e} {expected:e}");
    }
}
