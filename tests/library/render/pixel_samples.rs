//! Low-discrepancy samples of pixels, more of them at edges.

use std::num::NonZeroU32;

use radiosity::geometry::DVec3;
use radiosity::matrix::operator::Block;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::render::verify::{VerifyError, verify_image};
use radiosity::render::{CameraRecord, DirectMethod, Image, RayView, RenderSettings, Samples, View, render};
use radiosity::scene::{Camera, Scene, builtin};
use radiosity::visibility::embree::EmbreeVisibility;

use super::field::{check, field_of};
use super::scenes::{Builder, Solved, bright_cube, flat_input, rectangle};

const LAMP: f64 = 50.0;
const WALL: f64 = 1.0;

fn adaptive(samples: u32, seed: u64) -> RenderSettings {
    RenderSettings {
        flat: true,
        samples: NonZeroU32::new(samples).unwrap(),
        adaptive: true,
        seed,
        ..RenderSettings::default()
    }
}

/// A lamp in the plane y = 1, in front of a wall that fills the view.
fn lamp_and_wall(corners: [DVec3; 4]) -> Scene {
    let mut builder = Builder::default();
    let (bright, dim) = (
        builder.material([LAMP; 3], [0.0; 3]),
        builder.material([0.0; 3], [0.5; 3]),
    );
    let (lamp, wall) = (builder.surface("lamp"), builder.surface("wall"));
    builder.face(lamp, bright, &corners);
    let far = rectangle(DVec3::new(-3.0, 1.5, -3.0), DVec3::X * 6.0, DVec3::Z * 6.0);
    builder.face(wall, dim, &far);
    builder.scene
}

/// Looks from the origin along +y; a pixel of the plane y = 1 has the side 2 / n.
fn square_view(n: u32) -> impl View {
    let half = 0.5 * f64::from(n);
    let ray = move |x: f64, y: f64| (DVec3::ZERO, DVec3::new((x - half) / half, 1.0, (half - y) / half));
    RayView::new(n, n, ray, serde_json::Value::Null)
}

/// Renders a scene of one patch a face with the radiosity of its own emitters or of the wall.
fn shown(scene: &Scene, n: u32, settings: &RenderSettings) -> Image {
    let mesh = Mesh::new(scene, Subdivision::Uniform(1)).unwrap();
    let visibility = EmbreeVisibility::new(scene).unwrap();
    let radiosity = Block::from_values(vec![LAMP, WALL], 1);
    let input = flat_input(scene, &mesh, &visibility, &radiosity);
    render(&input, &square_view(n), settings, &Silent).unwrap()
}

/// A parallelogram or trapezium about a centre in the plane y = 1, turned; lengths in pixels of an image of n.
fn lamp(n: u32, centre: [f64; 2], [width, height, skew]: [f64; 3], angle: f64) -> [DVec3; 4] {
    let (sin, cos) = angle.sin_cos();
    let corner = |x: f64, z: f64| {
        let (x, z) = (centre[0] + cos * x - sin * z, centre[1] + sin * x + cos * z);
        DVec3::new(x, 0.0, z) * (2.0 / f64::from(n)) + DVec3::Y
    };
    let (w, h) = (0.5 * width, 0.5 * height);
    [corner(-w, -h), corner(w, -h), corner(w - skew, h), corner(-w + skew, h)]
}

/// The area that the lamp covers in an image, in pixels.
fn lit_area(image: &Image) -> f64 {
    let values = image.f32("radiosity.G").unwrap();
    values.iter().map(|&b| (f64::from(b) - WALL) / (LAMP - WALL)).sum()
}

/// Long edges along the rows of pixels, as of the lamp of cornell-box, slightly and fully turned.
#[test]
fn a_lamp_has_the_area_of_its_polygon() {
    const N: u32 = 96;
    for (k, shape) in [
        [45.4, 8.9, 2.1],
        [40.0, 10.0, 0.0],
        [20.0, 20.0, 0.0],
        [70.0, 30.0, 9.0],
    ]
    .into_iter()
    .enumerate()
    {
        let [width, height, skew] = shape;
        let area = height * (width - skew);
        for (j, angle) in [0.0, 0.003, 0.05, 0.4, 0.785, 1.57].into_iter().enumerate() {
            let x = (6 * k + j) as f64;
            let centre = [0.37 * x - 4.0, 3.0 - 0.29 * x];
            let scene = lamp_and_wall(lamp(N, centre, shape, angle));
            let error = |settings: RenderSettings| lit_area(&shown(&scene, N, &settings)) / area - 1.0;
            for seed in [0, 1] {
                let found = error(adaptive(2, seed));
                assert!(found.abs() < 2e-3, "{shape:?} {angle} {seed}: {found}");
            }
        }
    }
}

/// What is narrower than the distance between samples is found by some pixels and missed by others, without bias.
#[test]
fn slivers_keep_their_area_on_average() {
    const N: u32 = 64;
    for (width, limit) in [(0.5, 0.01), (0.25, 0.02)] {
        let mut sum = 0.0;
        for k in 0..24_u32 {
            let angle = 0.05 + 0.13 * f64::from(k);
            let shape = [44.0, width, 0.0];
            let scene = lamp_and_wall(lamp(N, [0.3, -0.2], shape, angle));
            sum += lit_area(&shown(&scene, N, &adaptive(2, k.into()))) / (44.0 * width);
        }
        let bias = sum / 24.0 - 1.0;
        assert!(bias.abs() < limit, "{width}: {bias}");
    }
}

fn cornell_view(n: u32) -> impl View {
    let camera = Camera::new(DVec3::new(0.278, 0.273, -0.8), DVec3::Z, DVec3::Y, 39.3).unwrap();
    let parameters = serde_json::json!(CameraRecord::from(&camera));
    RayView::new(n, n, move |x: f64, y: f64| camera.primary_ray(x, y, n, n), parameters)
}

/// Four samples in most pixels show what hundreds show.
#[test]
fn the_mean_of_an_image_is_that_of_many_samples() {
    let scene = builtin::build("cornell-box", None).unwrap().scene;
    let mesh = Mesh::new(&scene, Subdivision::MaxEdge(0.3)).unwrap();
    let visibility = EmbreeVisibility::new(&scene).unwrap();
    let of_patch = |patch: &radiosity::mesh::Patch| {
        let material = &scene.materials[patch.material.0 as usize];
        [0, 1, 2].map(|c| material.exitance[c] + material.reflectance[c] * (0.5 + patch.centroid.y))
    };
    let radiosity = Block::from_values(mesh.patches.iter().flat_map(of_patch).collect(), 3);
    let input = flat_input(&scene, &mesh, &visibility, &radiosity);
    for n in [64, 101] {
        let mean = |settings: &RenderSettings, channel: &str| {
            let image = render(&input, &cornell_view(n), settings, &Silent).unwrap();
            let values = image.f32(channel).unwrap();
            values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
        };
        for channel in ["R", "B"] {
            let (few, many) = (mean(&adaptive(2, 0), channel), mean(&adaptive(16, 1), channel));
            let regular = RenderSettings {
                adaptive: false,
                ..adaptive(2, 0)
            };
            assert!((few / many - 1.0).abs() < 1e-3, "{n} {channel}: {few} {many}");
            // The fault that this mends.
            let of_grid = mean(&regular, channel) / many - 1.0;
            assert!(n != 64 || of_grid.abs() > 5e-3, "{channel}: {of_grid}");
        }
    }
}

/// Few samples where there is no edge, the same image for any number of threads, and no effect on an unfolded view.
#[test]
fn samples_are_many_at_edges_alone_and_do_not_depend_on_threads() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    let ray = |x: f64, y: f64| {
        (
            DVec3::new(0.5, 0.1, 0.5),
            DVec3::new(x / 35.0 - 1.0, 1.0, 1.0 - y / 35.0),
        )
    };
    let view = RayView::new(70, 70, ray, serde_json::Value::Null);
    let image = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&solved.input(&visibility), &view, &adaptive(2, 3), &Silent).unwrap())
    };
    let (one, three) = (image(1), image(3));
    assert!(one == three);
    let n_samples = one.u32("pixel_samples").unwrap();
    let normals = ["N.X", "N.Y", "N.Z"].map(|name| one.f32(name).unwrap());
    let mut n_edges = 0;
    for y in 1..69 {
        for x in 1..69 {
            let k = y * 70 + x;
            let [here, right, below] = [k, k + 1, k + 70].map(|k| normals.map(|n| n[k].to_bits()));
            // Between the centres of two pixels: within half a pixel of both.
            for (other, normal) in [(k + 1, right), (k + 70, below)] {
                assert!(normal == here || n_samples[k].max(n_samples[other]) >= 16, "{x} {y}");
            }
            n_edges += usize::from(n_samples[k] > 4);
            assert!([4, 16, 64].contains(&n_samples[k]));
        }
    }
    assert!((200..1500).contains(&n_edges), "{n_edges}");
    let regular = RenderSettings {
        adaptive: false,
        ..adaptive(2, 0)
    };
    assert!(solved.unfold(&visibility, 8, adaptive(2, 0)).0 == solved.unfold(&visibility, 8, regular).0);
}

/// Verification finds the same samples again.
#[test]
fn adaptive_images_are_verified() {
    for direct in [
        DirectMethod::Exact,
        DirectMethod::Polygons {
            n: NonZeroU32::new(16).unwrap(),
        },
    ] {
        let settings = RenderSettings {
            direct,
            flat: false,
            ..adaptive(2, 5)
        };
        let scene = builtin::build("cornell-box", None).unwrap().scene;
        let mut made = field_of(scene, "light", &cornell_view(40), settings);
        let report = check(&made);
        assert!(report.passed, "{report:#?}");
        assert!(report.n_not_checkable < 100, "{report:#?}");
        // A pixel that had other samples.
        let mut n_samples = made.image.u32("pixel_samples").unwrap().to_vec();
        n_samples[820] = 5;
        made.image.insert("pixel_samples", Samples::U32(n_samples));
        let error = verify_image(&made.image, &made.attributes).unwrap_err();
        assert!(matches!(error, VerifyError::BadSamples { pixel: 820 }), "{error}");
    }
}
