//! The contents of an image's layers.

use std::f64::consts::PI;
use std::num::NonZeroU32;

use radiosity::geometry::{DVec3, polygon};
use radiosity::matrix::operator::Block;
use radiosity::progress::Silent;
use radiosity::render::{
    DirectMethod, Image, Outdoors, RayView, RenderError, RenderInput, RenderSettings, UnfoldedView, render,
};
use radiosity::visibility::Visibility;
use radiosity::visibility::brute_force::BruteForce;
use radiosity::visibility::embree::EmbreeVisibility;

use super::scenes::{Builder, Solved, box_scene, bright_cube, rectangle};

fn n(n: u32) -> NonZeroU32 {
    NonZeroU32::new(n).unwrap()
}

/// A camera in the middle of the front side that looks along +y, x to the right, z up; 90° across.
fn camera(width: u32, height: u32, eye: DVec3) -> RayView<impl Fn(f64, f64) -> (DVec3, DVec3) + Sync> {
    let half = 0.5 * f64::from(width);
    let ray = move |x: f64, y: f64| {
        let (right, up) = ((x - half) / half, (0.5 * f64::from(height) - y) / half);
        (eye, DVec3::new(right, 1.0, up) * 3.0)
    };
    RayView::new(width, height, ray, serde_json::json!({"eye": eye.to_array()}))
}

fn rgb(image: &Image, prefix: &str, k: usize) -> [f64; 3] {
    ["R", "G", "B"].map(|c| {
        let name = if prefix.is_empty() {
            c.to_owned()
        } else {
            format!("{prefix}.{c}")
        };
        f64::from(image.f32(&name).unwrap()[k])
    })
}

fn xyz(image: &Image, prefix: &str, k: usize) -> DVec3 {
    DVec3::from(["X", "Y", "Z"].map(|c| f64::from(image.f32(&format!("{prefix}.{c}")).unwrap()[k])))
}

fn near(a: [f64; 3], b: [f64; 3], tolerance: f64) -> bool {
    (0..3).all(|c| (a[c] - b[c]).abs() <= tolerance)
}

/// All layers of a perspective view against the scene, looked up by hand.
#[test]
fn perspective_layers_describe_what_the_camera_sees() {
    let solved = Solved::new(bright_cube(), 4);
    let embree = EmbreeVisibility::new(&solved.scene).unwrap();
    let brute = BruteForce::new(&solved.scene);
    let eye = DVec3::new(0.45, 0.2, 0.55);
    let view = camera(40, 30, eye);
    let settings = RenderSettings {
        flat: true,
        ..RenderSettings::default()
    };
    for visibility in [&embree as &dyn Visibility, &brute] {
        let image = render(&solved.input(visibility), &view, &settings, &Silent).unwrap();
        for k in 0..40 * 30 {
            let (point, normal) = (xyz(&image, "P", k), xyz(&image, "N", k));
            let patch = image.u32("patch").unwrap()[k];
            let record = &solved.mesh.patches[patch as usize];
            let corners = solved.mesh.polygon(radiosity::mesh::PatchId(patch));
            assert!((normal - record.normal).length() < 1e-6);
            assert!(polygon::planarity_error(&corners) < 1e-15 && (point - corners[0]).dot(normal).abs() < 1e-6);
            let across = (corners[1] - corners[0]).length();
            let (u, v) = (
                (point - corners[0]).dot(corners[1] - corners[0]) / across.powi(2),
                (point - corners[0]).dot(corners[3] - corners[0]) / across.powi(2),
            );
            assert!((-1e-5..1.0 + 1e-5).contains(&u) && (-1e-5..1.0 + 1e-5).contains(&v));
            // The pixel's ray goes through the point; depth is along y.
            let (column, row) = ((k % 40) as f64 + 0.5, (k / 40) as f64 + 0.5);
            let direction = DVec3::new((column - 20.0) / 20.0, 1.0, (15.0 - row) / 20.0);
            assert!((point - eye).cross(direction).length() < 1e-6);
            let depth = f64::from(image.f32("Z").unwrap()[k]);
            assert!((depth - (point.y - eye.y)).abs() < 1e-6);
            // Flat: the patch's own values.
            let material = &solved.scene.materials[record.material.0 as usize];
            let b = <[f64; 3]>::try_from(solved.radiosity.row(patch as usize)).unwrap();
            let h = <[f64; 3]>::try_from(solved.irradiance.row(patch as usize)).unwrap();
            assert!(near(rgb(&image, "radiosity", k), b, 1e-6));
            assert!(near(rgb(&image, "irradiance", k), h, 1e-6));
            assert!(near(rgb(&image, "", k), b.map(|b| b / PI), 1e-6));
            assert!(near(rgb(&image, "albedo", k), material.reflectance, 1e-7));
        }
    }
}

/// Interpolation is continuous over a wall and keeps its mean close; radiosity follows from irradiance with the wall's own material.
#[test]
fn interpolated_walls_are_smooth() {
    let solved = Solved::new(bright_cube(), 6);
    let visibility = BruteForce::new(&solved.scene);
    let (image, attributes) = solved.unfold(&visibility, 48, RenderSettings::default());
    let radiosity::render::ViewDescription::Unfolded(layout) = &attributes.view else {
        panic!("an unfolded view");
    };
    let width = image.width();
    let mut largest_step = 0.0_f64;
    let mut largest_flat_step = 0.0_f64;
    for tile in &layout.tiles {
        let material = &solved.scene.materials[tile.surface.0 as usize];
        let index = |i: u32, j: u32| (tile.top + j) as usize * width + (tile.left + i) as usize;
        for j in 0..48 {
            for i in 0..48 {
                let k = index(i, j);
                let (h, b) = (rgb(&image, "irradiance", k), rgb(&image, "radiosity", k));
                let follows = [0, 1, 2].map(|c| material.exitance[c] + material.reflectance[c] * h[c]);
                assert!(near(b, follows, 1e-6));
                if i > 0 {
                    let left = rgb(&image, "irradiance", index(i - 1, j));
                    largest_step = (0..3).map(|c| (h[c] - left[c]).abs()).fold(largest_step, f64::max);
                    let patch = |pixel: usize| image.u32("patch").unwrap()[pixel] as usize;
                    let row = |pixel: usize| solved.irradiance.row(patch(pixel)).to_vec();
                    let (here, there) = (row(k), row(index(i - 1, j)));
                    largest_flat_step = (0..3)
                        .map(|c| (here[c] - there[c]).abs())
                        .fold(largest_flat_step, f64::max);
                }
            }
        }
    }
    // Eight pixels a patch: a step is an eighth of the patches' one or, along a wall's border where the mean is one-sided, less.
    assert!(largest_flat_step > 0.1);
    assert!(
        largest_step < largest_flat_step / 7.9,
        "{largest_step} {largest_flat_step}"
    );
}

/// Backs are black, the void is zero and has no patch.
#[test]
fn backs_are_black_and_background_is_zero() {
    let mut builder = Builder::default();
    let white = builder.material([1.0; 3], [0.5; 3]);
    let surface = builder.surface("front");
    builder.face(
        surface,
        white,
        &rectangle(DVec3::new(-1.5, 2.0, 0.0), DVec3::X, DVec3::Z),
    );
    let back = builder.surface("back");
    builder.face(back, white, &rectangle(DVec3::new(0.5, 2.0, 0.0), DVec3::Z, DVec3::X));
    let scene = builder.scene;
    let mesh = radiosity::mesh::Mesh::new(&scene, radiosity::mesh::Subdivision::Uniform(1)).unwrap();
    let visibility = BruteForce::new(&scene);
    let grey = |value: f64| Block::from_values(vec![value; 2], 1);
    let (radiosity, irradiance) = (grey(1.5), grey(1.0));
    let input = RenderInput {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        radiosity: &radiosity,
        irradiance: &irradiance,
        indirect_irradiance: None,
        error: None,
        outdoors: Outdoors::default(),
    };
    // Three columns: at x/y = −2/3, 0, 2/3 of the middle row.
    let view = camera(3, 3, DVec3::new(0.0, 0.5, 0.5));
    let image = render(&input, &view, &RenderSettings::default(), &Silent).unwrap();
    let patches = &image.u32("patch").unwrap()[3..6];
    let (facing, reversed) = if scene.area_vector(radiosity::scene::FaceId(0)).y < 0.0 {
        (3, 5)
    } else {
        (5, 3)
    };
    assert!(patches.contains(&0) && patches.contains(&1) && patches[1] == u32::MAX);
    assert!(
        near(rgb(&image, "radiosity", facing), [1.5; 3], 1e-7),
        "one channel stands for three"
    );
    assert!(near(rgb(&image, "radiosity", reversed), [0.0; 3], 0.0));
    assert!(xyz(&image, "N", reversed).y > 0.9, "a back keeps its own normal");
    for layer in image.layers() {
        if layer.name != "patch" {
            assert_eq!(image.f32(&layer.name).unwrap()[4].to_bits(), 0, "{}", layer.name);
        }
    }
    let direct = RenderSettings {
        direct: DirectMethod::CosineRays { n: n(4) },
        ..RenderSettings::default()
    };
    let error = render(&input, &view, &direct, &Silent).unwrap_err();
    assert!(matches!(error, RenderError::MissingIndirect));
}

/// With s × s samples a colour is their mean, at the same places as in a finer image.
#[test]
fn supersampling_is_the_mean_of_a_finer_image() {
    let solved = Solved::new(bright_cube(), 2);
    let visibility = BruteForce::new(&solved.scene);
    let render_with = |pixels: u32, samples: u32| {
        let settings = RenderSettings {
            samples: n(samples),
            ..RenderSettings::default()
        };
        let view = camera(pixels, pixels, DVec3::new(0.5, 0.1, 0.5));
        render(&solved.input(&visibility), &view, &settings, &Silent).unwrap()
    };
    let (coarse, fine, plain) = (render_with(8, 2), render_with(16, 1), render_with(8, 1));
    for y in 0..8 {
        for x in 0..8 {
            let mut mean = [0.0; 3];
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let part = rgb(&fine, "", (2 * y + j) * 16 + 2 * x + i);
                for c in 0..3 {
                    mean[c] += 0.25 * part[c];
                }
            }
            assert!(near(rgb(&coarse, "", y * 8 + x), mean, 1e-7));
        }
    }
    for name in ["P.X", "P.Y", "P.Z", "N.X", "Z"] {
        assert_eq!(coarse.f32(name), plain.f32(name), "{name} belongs to the centre");
    }
    assert_eq!(coarse.u32("patch"), plain.u32("patch"));
}

/// The two direct methods agree with each other where a plate throws a shadow with a penumbra.
#[test]
fn direct_methods_agree_in_a_penumbra() {
    let mut exitance = [[0.0; 3]; 6];
    exitance[4] = [0.0; 3];
    let mut builder = Builder {
        scene: box_scene(DVec3::ONE, exitance, [[0.3; 3]; 6]),
    };
    let bright = builder.material([5.0, 1.0, 0.0], [0.0; 3]);
    let black = builder.material([0.0; 3], [0.0; 3]);
    let lamp = builder.surface("lamp");
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    builder.face(
        lamp,
        bright,
        &rectangle(at(0.3, 0.3, 0.9), DVec3::Y * 0.4, DVec3::X * 0.4),
    );
    let plate = builder.surface("plate");
    builder.face(
        plate,
        black,
        &rectangle(at(0.35, 0.35, 0.5), DVec3::X * 0.3, DVec3::Y * 0.3),
    );
    builder.face(
        plate,
        black,
        &rectangle(at(0.35, 0.35, 0.5), DVec3::Y * 0.3, DVec3::X * 0.3),
    );
    let scene = builder.scene;
    let mesh = radiosity::mesh::Mesh::new(&scene, radiosity::mesh::Subdivision::Uniform(1)).unwrap();
    let visibility = EmbreeVisibility::new(&scene).unwrap();
    let zero = Block::zeros(mesh.n_patches(), 3);
    let input = RenderInput {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        radiosity: &zero,
        irradiance: &zero,
        indirect_irradiance: Some(&zero),
        error: None,
        outdoors: Outdoors::default(),
    };
    let view = UnfoldedView::new(&scene, n(16)).unwrap();
    let floor = view
        .layout()
        .tiles
        .iter()
        .find(|tile| tile.name == "z0")
        .unwrap()
        .clone();
    let render_with = |direct: DirectMethod| {
        let settings = RenderSettings {
            direct,
            ..RenderSettings::default()
        };
        render(&input, &view, &settings, &Silent).unwrap()
    };
    let rays = render_with(DirectMethod::CosineRays { n: n(4096) });
    let polygons = render_with(DirectMethod::Polygons { n: n(256) });
    let (mut n_penumbra, mut worst) = (0, 0.0_f64);
    for j in 0..16 {
        for i in 0..16 {
            let k = (floor.top + j) as usize * rays.width() + (floor.left + i) as usize;
            let (a, b) = (rgb(&rays, "direct", k), rgb(&polygons, "direct", k));
            let sigma = rgb(&rays, "direct_error", k)[0].hypot(rgb(&polygons, "direct_error", k)[0]);
            n_penumbra += usize::from(rgb(&polygons, "direct_error", k)[0] > 0.0);
            worst = worst.max((a[0] - b[0]).abs() / sigma.max(1e-9));
            assert!(
                (a[0] - b[0]).abs() <= 4.0 * sigma + 1e-4,
                "{i} {j}: {a:?} {b:?} {sigma}"
            );
            assert!(
                (a[1] - a[0] / 5.0).abs() < 1e-6 && a[2].to_bits() == 0,
                "colours are the lamp's"
            );
        }
    }
    assert!(n_penumbra > 40, "{n_penumbra} pixels in the penumbra");
    // In the middle of the floor the plate hides most of the lamp, but not in the corner.
    assert!(worst > 0.1, "the errors are not exaggerated beyond all use: {worst}");
}

/// Points exactly on the edge between two walls, and emitters that touch the walls, are not shadowed by rounding.
#[test]
fn edges_between_walls_are_lit() {
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.9);
    let mut exitance = [[0.0; 3]; 6];
    exitance[5] = [1.0; 3];
    let mut scene = box_scene(DVec3::ONE, exitance, [[0.0; 3]; 6]);
    for vertex in &mut scene.vertices {
        *vertex = turn * *vertex;
    }
    let solved = Solved::new(scene, 1);
    let visibility = EmbreeVisibility::new(&solved.scene).unwrap();
    // One column of pixels, all on the line x = 0, y = 1 between two walls, well above the floor.
    let eye = turn * DVec3::new(0.5, 0.5, 0.5);
    let ray = |_, y: f64| (eye, turn * DVec3::new(0.0, 1.0, 1.0 - y / 500.0) - eye);
    let view = RayView::new(1, 500, ray, serde_json::Value::Null);
    for direct in [
        DirectMethod::Polygons { n: n(64) },
        DirectMethod::CosineRays { n: n(1024) },
    ] {
        let settings = RenderSettings {
            direct,
            ..RenderSettings::default()
        };
        let image = render(&solved.input(&visibility), &view, &settings, &Silent).unwrap();
        for k in 0..500 {
            let height = 1.0 - (k as f64 + 0.5) / 500.0;
            // Howell's B-4 with the ceiling cut at the corner: a unit square whose corner lies straight above, 1 − height away.
            let d = 1.0 - height;
            let exact = (1.0f64.atan2(d) - d / d.hypot(1.0) * (1.0 / d.hypot(1.0)).atan()) / (2.0 * PI);
            let found = rgb(&image, "direct", k)[0];
            let tolerance = if matches!(direct, DirectMethod::Polygons { .. }) {
                1e-6
            } else {
                5.0 * (exact * (1.0 - exact) / 1024.0).sqrt()
            };
            assert!(
                (found - exact).abs() < tolerance,
                "{direct:?} {height}: {found} {exact}"
            );
        }
    }
}
