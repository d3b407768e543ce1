//! Final gather against irradiances that are known.

use std::num::NonZeroU32;

use radiosity::geometry::DVec3;
use radiosity::geometry::point_form_factor::point_form_factor;
use radiosity::matrix::operator::Block;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::render::{DirectMethod, GatherReport, GatherSettings, Image, RenderSettings, UnfoldedView, render};
use radiosity::scene::{FaceId, Scene};
use radiosity::visibility::embree::EmbreeVisibility;

use crate::support::n_cases;

use super::scenes::{Builder, WALLS, box_scene, box_walls, flat_input, rectangle};

fn settings(noise: f64, samples: u32, direct: DirectMethod) -> RenderSettings {
    let n = |n| NonZeroU32::new(n).unwrap();
    RenderSettings {
        flat: true,
        samples: n(samples),
        direct,
        gather: Some(GatherSettings {
            noise,
            max_rays: n(1 << 16),
        }),
        ..RenderSettings::default()
    }
}

/// Renders the unfolded view of a scene of one patch a face with given radiosities.
fn gathered(scene: &Scene, radiosity: &[f64], settings: &RenderSettings) -> (Image, Mesh) {
    let mesh = Mesh::new(scene, Subdivision::Uniform(1)).unwrap();
    let visibility = EmbreeVisibility::new(scene).unwrap();
    let view = UnfoldedView::new(scene, NonZeroU32::new(16).unwrap()).unwrap();
    let radiosity = Block::from_values(radiosity.to_vec(), 1);
    // Flat: what a ray meets has the patch's own radiosity, whatever its irradiance.
    let input = flat_input(scene, &mesh, &visibility, &radiosity);
    let image = render(&input, &view, settings, &Silent).unwrap();
    (image, mesh)
}

/// A cube in which one wall has a radiosity of 1 that is all reflected light: the gathered irradiance is the form factor to it.
#[test]
fn what_is_gathered_converges_to_the_closed_form() {
    let scene = box_scene(DVec3::ONE, [[0.0; 3]; 6], [[0.5; 3]; 6]);
    let bright = scene.polygon(FaceId(0));
    let run = |noise: f64, samples: u32| {
        let settings = settings(noise, samples, DirectMethod::Exact);
        let (image, mesh) = gathered(&scene, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], &settings);
        let position = ["P.X", "P.Y", "P.Z"].map(|name| image.f32(name).unwrap());
        let layer = |name: &str| image.f32(name).unwrap();
        let (values, variances, radiosity) = (layer("irradiance.G"), layer("variance.G"), layer("radiosity.G"));
        let (mut squares, mut normalised, mut relative, mut n) = (0.0, 0.0, 0.0, 0.0_f64);
        for (k, &patch) in image.u32("patch").unwrap().iter().enumerate() {
            let rays = image.u32("samples").unwrap()[k];
            let Some(patch) = mesh.patches.get(patch as usize) else {
                assert_eq!(rays, 0);
                continue;
            };
            assert!(rays >= 64 && rays.is_power_of_two(), "{rays}");
            let at: DVec3 = position.map(|along| f64::from(along[k])).into();
            let exact = point_form_factor(at, patch.normal, &bright);
            let (value, variance) = (f64::from(values[k]), f64::from(variances[k]));
            assert!((f64::from(radiosity[k]) - 0.5 * value).abs() < 1e-6);
            if patch.face == FaceId(0) {
                assert_eq!(
                    (values[k].to_bits(), variances[k].to_bits()),
                    (0, 0),
                    "a wall does not see itself"
                );
                continue;
            }
            squares += (value - exact).powi(2);
            relative += ((value - exact) / exact).powi(2);
            // Where all rays meet the same there is no spread to see; one ray more or less, which brings 1, is always possible.
            normalised += (value - exact).powi(2) / variance.max(f64::from(rays).powi(-2));
            n += 1.0;
        }
        let root = |sum: f64| (sum / n).sqrt();
        let report = GatherReport::new(&image, settings.gather.unwrap());
        assert_eq!((report.n_above, report.n_pixels), (0, 6 * 256));
        (root(squares), root(relative), root(normalised), report)
    };
    for samples in [2, 1].into_iter().take(n_cases(1, 2)) {
        let (coarse, relative, normalised, report) = run(0.05, samples);
        // The mean over a pixel is compared with the value at its centre: 16 pixels a wall leave 1e-3 of curvature, far below this noise.
        // A standard error from the sixteen nets of the pilot rays is itself off by 18 %.
        assert!(relative < 1.5 * 0.05, "{samples}: {relative}");
        // Student's t with 15 degrees of freedom has the deviation √(15/13) = 1.07, and stated errors are 1.195 times the spread of the nets: 0.90. The one ray that is always possible makes that less.
        assert!((0.7..1.7).contains(&normalised), "{samples}: {normalised}");
        let (fine, fine_relative, _, more) = run(0.005, samples);
        assert!(fine_relative < 1.5 * 0.005, "{samples}: {fine_relative}");
        assert!(fine < 0.2 * coarse, "{samples}: {fine} {coarse}");
        // A tenth of the noise costs less than a hundred times as much, because the points are scrambled nets.
        assert!(
            more.n_rays > 4 * report.n_rays && more.n_rays < 60 * report.n_rays,
            "{more:?} {report:?}"
        );
    }
}

/// Uniform light: B = E / (1 − ρ) everywhere, whatever the direct pass leaves to be gathered, and without noise.
#[test]
fn the_furnace_is_gathered_exactly() {
    let (exitance, reflectance) = (0.3, 0.6);
    let scene = box_scene(DVec3::new(1.0, 2.0, 0.5), [[exitance; 3]; 6], [[reflectance; 3]; 6]);
    let radiosity = exitance / (1.0 - reflectance);
    for direct in [DirectMethod::Off, DirectMethod::Exact] {
        let (image, _) = gathered(&scene, &[radiosity; 6], &settings(0.01, 1, direct));
        for (k, &rays) in image
            .u32("samples")
            .unwrap()
            .iter()
            .enumerate()
            .filter(|(_, n)| **n > 0)
        {
            // All rays meet the same: that is believed after 3 / 0.01 of them.
            assert_eq!(rays, 512);
            for name in ["irradiance.R", "radiosity.B"] {
                let value = f64::from(image.f32(name).unwrap()[k]);
                assert!((value - radiosity).abs() < 1e-6, "{direct:?} {name} {value}");
            }
            assert!(image.f32("variance.G").unwrap()[k] < 1e-12);
        }
    }
}

#[test]
fn gathering_does_not_depend_on_the_number_of_threads() {
    let scene = box_scene(DVec3::ONE, [[0.0; 3]; 6], [[0.5; 3]; 6]);
    let image = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = settings(0.02, 2, DirectMethod::Off);
        pool.install(|| gathered(&scene, &[1.0, 0.0, 0.5, 0.0, 0.0, 0.0], &settings).0)
    };
    assert!(image(1) == image(3));
}

/// A room of 4 × 3 × 2.5 m with a square spot a millimetre below its ceiling, `radius` from its centre to its sides.
fn room_with_a_spot(radius: f64) -> Scene {
    let size = DVec3::new(4.0, 3.0, 2.5);
    let mut builder = Builder::default();
    for (name, wall) in WALLS.iter().zip(box_walls(size)) {
        let surface = builder.surface(name);
        let material = builder.material([0.0; 3], [0.5; 3]);
        builder.face(surface, material, &wall);
    }
    let (surface, material) = (builder.surface("spot"), builder.material([0.0; 3], [0.5; 3]));
    let corner = DVec3::new(2.0 - radius, 1.5 - radius, 2.499);
    let spot = rectangle(corner, DVec3::Y * 2.0 * radius, DVec3::X * 2.0 * radius);
    builder.face(surface, material, &spot);
    builder.scene
}

/// Light from a small bright spot, as above an up-light, is neither missed nor is its noise stated too small.
#[test]
fn rare_light_is_neither_missed_nor_understated() {
    let scene = room_with_a_spot(0.1);
    let (all, spot) = (0.02, 10.0);
    let polygon = scene.polygon(FaceId(6));
    for noise in [0.1, 0.05].into_iter().take(n_cases(1, 2)) {
        let (image, mesh) = gathered(
            &scene,
            &[all, all, all, all, all, all, spot],
            &settings(noise, 1, DirectMethod::Off),
        );
        let layer = |name: &str| image.f32(name).unwrap();
        let position = ["P.X", "P.Y", "P.Z"].map(layer);
        let (values, variances) = (layer("irradiance.G"), layer("variance.G"));
        let (mut n, mut n_beyond, mut sum, mut exact_sum) = (0.0, 0.0, 0.0, 0.0);
        for (k, &patch) in image.u32("patch").unwrap().iter().enumerate() {
            // The ceiling and the spot, a millimetre below, do not see it from its front.
            let Some(patch) = mesh.patches.get(patch as usize).filter(|patch| patch.face.0 < 5) else {
                continue;
            };
            let at: DVec3 = position.map(|along| f64::from(along[k])).into();
            let exact = all + (spot - all) * point_form_factor(at, patch.normal, &polygon);
            let error = f64::from(values[k]) - exact;
            n += 1.0;
            n_beyond += f64::from(u8::from(error.abs() > 5.0 * f64::from(variances[k]).sqrt()));
            sum += f64::from(values[k]);
            exact_sum += exact;
        }
        let (beyond, bias) = (n_beyond / n, sum / exact_sum - 1.0);
        assert!(
            beyond <= 0.01,
            "{noise}: {beyond} of the pixels are beyond five standard errors"
        );
        assert!(bias.abs() < 0.2 * noise, "{noise}: {bias}");
    }
}
