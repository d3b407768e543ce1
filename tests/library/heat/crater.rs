//! A bowl-shaped crater in sunlight: Ingersoll's temperatures of its shadow, as `docs/heat.md` derives them.

use radiosity::scene::Scene;

use super::{SIGMA, circle, heat, scene};

const DEPTH: f64 = 1.0;
const DIAMETER: f64 = 4.0;

/// A part of a sphere in rings of as many faces.
fn bowl(n_rings: usize, n_around: usize) -> Scene {
    let radius = (0.25 * DIAMETER * DIAMETER + DEPTH * DEPTH) / (2.0 * DEPTH);
    let half_angle = (0.5 * DIAMETER / radius).asin();
    let ring = |k: usize| {
        let angle = half_angle * k as f64 / n_rings as f64;
        circle(radius * angle.sin(), radius * (1.0 - angle.cos()) - DEPTH, n_around)
    };
    let mut faces = Vec::new();
    for k in 0..n_rings {
        let (inner, outer) = (ring(k), ring(k + 1));
        for j in 0..n_around {
            if k == 0 {
                faces.push(vec![inner(j), outer(j), outer(j + 1)]);
            } else {
                faces.push(vec![inner(j), outer(j), outer(j + 1), inner(j + 1)]);
            }
        }
    }
    scene(&[("crater", faces)])
}

#[test]
fn shadows_in_a_crater_have_one_temperature() {
    let (emissivity, absorptance, sun) = (0.95, 0.88, 1361.0);
    let height = 12.0_f64.to_radians();
    let text = format!(
        "[sun]\ndirection = [{:?}, 0.0, {:?}]\nirradiance_w_m2 = {sun}\n\
         [[surface]]\nname = \"crater\"\nemissivity = {emissivity}\nabsorptance = {absorptance}\nadiabatic = true\n",
        height.cos(),
        height.sin()
    );
    let (albedo, f) = (
        1.0 - absorptance,
        1.0 / (1.0 + DIAMETER.powi(2) / (4.0 * DEPTH.powi(2))),
    );
    let absorbed = absorptance * sun * height.sin() * f / (1.0 - f * albedo) * (emissivity + albedo * (1.0 - f));
    let expected = (absorbed / (emissivity * SIGMA)).powf(0.25);
    let off = |n_rings: usize| {
        let found = heat(&bowl(n_rings, 4 * n_rings), 1, &text);
        let (lit, kelvin) = (found.patches("sunlit_fraction"), found.patches("temperature_k"));
        let shadowed: Vec<f64> = lit
            .iter()
            .zip(kelvin)
            .filter(|(lit, _)| **lit <= 0.0)
            .map(|(_, t)| *t)
            .collect();
        assert!(10 * shadowed.len() > lit.len(), "{} of {}", shadowed.len(), lit.len());
        let worst = shadowed.iter().map(|t| (t / expected - 1.0).abs()).fold(0.0, f64::max);
        let mean = shadowed.iter().sum::<f64>() / shadowed.len() as f64;
        ((mean / expected - 1.0).abs(), worst)
    };
    let (coarse, fine) = (off(4), off(8));
    assert!(fine.0 < 0.4 * coarse.0 && fine.0 < 5e-3, "{coarse:?} {fine:?}");
    assert!(fine.1 < 2e-2, "{fine:?}");
}

/// What `radiosity reproduce crater` prints: every level comes nearer to the closed form, and what is stated covers all but the tessellation.
#[test]
fn the_reproduction_converges() {
    let results = radiosity::experiment::crater::reproduce(4, &radiosity::progress::Silent).unwrap();
    assert_eq!((results.runs.len(), results.checks.len()), (9, 6));
    assert!(results.checks.iter().all(|check| check.is_met), "{:?}", results.checks);
    let finest = &results.runs[7];
    assert_eq!((finest.n_faces, finest.height_deg), (1024, 12.0));
    assert!((finest.ingersoll_k - 177.42).abs() < 5e-3, "{finest:?}");
    assert!(
        (finest.mean_k - finest.ingersoll_k).abs() < 0.1 && finest.mean_k_error < 1e-2,
        "{finest:?}"
    );
}
