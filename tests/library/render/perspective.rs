//! Perspective images against closed forms: right ones pass, wrong ones do not.

use std::num::NonZeroU32;

use radiosity::geometry::DVec3;
use radiosity::geometry::sampling::Sequence;
use radiosity::matrix::operator::Block;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::render::verify::verify_image;
use radiosity::render::{
    Attributes, CameraRecord, DirectMethod, FieldRecord, Outdoors, RayView, RenderInput, RenderSettings, Samples, View,
    ViewDescription, render,
};
use radiosity::scene::{Camera, builtin};
use radiosity::visibility::Visibility;
use radiosity::visibility::embree::EmbreeVisibility;

use crate::support::n_cases;

use super::field::{METHODS, Made, check, field_of, wall};

fn n(n: u32) -> NonZeroU32 {
    NonZeroU32::new(n).unwrap()
}

/// A camera's view, and what the image file says about it.
fn view(camera: Camera, width: u32, height: u32) -> impl View {
    let parameters = serde_json::json!(CameraRecord::from(&camera));
    let ray = move |x: f64, y: f64| camera.primary_ray(x, y, width, height);
    RayView::new(width, height, ray, parameters)
}

fn camera(eye: [f64; 3], at: [f64; 3], fov: f64) -> Camera {
    let [eye, at] = [eye, at].map(DVec3::from_array);
    Camera::new(eye, at - eye, DVec3::Z, fov).unwrap()
}

/// The field of the cube to its ceiling, from near a lower corner: five walls are seen.
fn cube(direct: DirectMethod, sequence: Sequence) -> Made {
    let settings = RenderSettings {
        direct,
        sequence,
        ..RenderSettings::default()
    };
    let view = view(camera([0.07, 0.11, 0.13], [0.9, 0.8, 0.6], 100.0), 72, 48);
    field_of(builtin::build("cube", None).unwrap().scene, "z1", &view, settings)
}

fn change(made: &mut Made, new: impl Fn(usize, f32) -> f32) {
    let old = made.image.f32("Y").unwrap().to_vec();
    let values = old.iter().enumerate().map(|(k, &y)| new(k, y)).collect();
    made.image.insert("Y", Samples::F32(values));
}

#[test]
fn every_pixel_of_the_cube_is_the_closed_form() {
    let report = check(&cube(DirectMethod::Exact, Sequence::Sobol));
    assert!(report.passed, "{report:#?}");
    assert_eq!(report.n_pixels, 72 * 48, "the cube is closed");
    assert!(
        report.n_not_checkable <= 5,
        "edges through a pixel's centre: {report:#?}"
    );
    // Half an ulp of an f32 below 1, which no form factor of the cube exceeds.
    assert!(report.max_error <= 2f64.powi(-25), "{}", report.max_error);
    assert!(report.deviation.is_none());
    let seen: Vec<&str> = report.walls.iter().map(|wall| wall.name.as_str()).collect();
    assert!(
        seen.len() >= 5 && seen.contains(&"z0") && seen.contains(&"z1"),
        "{seen:?}"
    );
    assert!(wall(&report, "z1").mean[0].abs() < 1e-12);
}

#[test]
fn rays_scatter_as_much_as_they_say() {
    for direct in METHODS {
        for sequence in [Sequence::Random, Sequence::Sobol] {
            let made = cube(direct, sequence);
            let report = check(&made);
            assert!(report.passed, "{direct:?} {sequence:?}: {report:#?}");
            assert!(report.n_checked > 3400);
            let DirectMethod::CosineRays { .. } = direct else {
                assert!(report.deviation.is_none() && report.max_error < 2e-7, "{report:#?}");
                continue;
            };
            let (found, most) = (report.deviation.unwrap(), report.tolerance.max_deviation.unwrap());
            // Of some 2400 pixels: the relative standard deviation of the root of their mean square is 1.5 %.
            match sequence {
                Sequence::Random => assert!((0.93..1.07).contains(&found) && most < 1.15, "{found} {most}"),
                Sequence::Sobol => assert!((0.02..0.9).contains(&found) && most < 1.8, "{found} {most}"),
            }
            // Half of the rays that the file tells of: 1.4 times the noise, which no single pixel gives away.
            if sequence == Sequence::Random {
                let mut fewer = made;
                fewer.attributes.render.direct = DirectMethod::CosineRays { n: n(512) };
                let boast = check(&fewer);
                assert!(!boast.passed && boast.n_outside == 0, "{boast:#?}");
                assert!(boast.deviation > boast.tolerance.max_deviation);
            }
        }
    }
}

#[test]
fn the_corridor_is_right_in_and_out_of_the_penumbra() {
    let view = view(camera([1.9, 0.5, 0.9], [0.2, 3.0, 0.3], 75.0), 64, 48);
    for (direct, samples) in [(METHODS[0], 2), (METHODS[1], 1)] {
        let settings = RenderSettings {
            direct,
            samples: n(samples),
            ..RenderSettings::default()
        };
        let scene = builtin::build("corridor", None).unwrap().scene;
        let made = field_of(scene, "B", &view, settings);
        let report = check(&made);
        assert!(report.passed, "{direct:?}: {report:#?}");
        assert!(report.n_checked > 500 && report.n_not_checkable < 40, "{report:#?}");
        assert!(wall(&report, "A").mean[0] > 0.01);
        // Light where nothing is.
        let background = made
            .image
            .u32("patch")
            .unwrap()
            .iter()
            .position(|&patch| patch == u32::MAX);
        let background = background.unwrap();
        let mut haunted = made;
        change(&mut haunted, |k, y| if k == background { 1e-6 } else { y });
        let lit = check(&haunted);
        assert!(!lit.passed && lit.n_outside == 1, "{lit:#?}");
    }
}

#[test]
fn wrong_fields_fail() {
    for direct in METHODS {
        let mut other = cube(direct, Sequence::Sobol);
        other.attributes = other.attributes.with_field(FieldRecord {
            surface: "x1".to_owned(),
        });
        assert!(!check(&other).passed, "{direct:?}");
        let mut high = cube(direct, Sequence::Sobol);
        change(&mut high, |_, y| 1.01 * y);
        assert!(!check(&high).passed, "{direct:?}");
    }
    let mut one = cube(DirectMethod::Exact, Sequence::Sobol);
    let at = 30 * 72 + 40;
    change(&mut one, |k, y| if k == at { y + 1e-6 } else { y });
    let spotted = check(&one);
    assert!(!spotted.passed && spotted.n_outside == 1, "{spotted:#?}");
    // Another camera than that which made it.
    let mut moved = cube(DirectMethod::Exact, Sequence::Sobol);
    let elsewhere = camera([0.0701, 0.11, 0.13], [0.9, 0.8, 0.6], 100.0);
    moved.attributes.view = ViewDescription::Perspective(serde_json::json!(CameraRecord::from(&elsewhere)));
    let lost = check(&moved);
    assert!(
        !lost.passed && lost.n_misplaced > 3000 && lost.n_outside > 1000,
        "{lost:#?}"
    );
}

/// A picture in colours, with several samples a pixel, backs of faces and background.
#[test]
fn the_direct_light_of_a_picture_is_right() {
    let scene = builtin::build("cornell-box", None).unwrap().scene;
    let mesh = Mesh::new(&scene, Subdivision::Uniform(2)).unwrap();
    let visibility = EmbreeVisibility::new(&scene).unwrap();
    let dark = Block::zeros(mesh.n_patches(), 3);
    let input = RenderInput {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        radiosity: &dark,
        irradiance: &dark,
        indirect_irradiance: Some(&dark),
        error: None,
        outdoors: Outdoors::default(),
    };
    let eye = DVec3::new(0.5, 0.45, -0.6);
    let camera = Camera::new(eye, DVec3::new(-0.35, -0.25, 1.0), DVec3::Y, 60.0).unwrap();
    let view = view(camera, 60, 60);
    for direct in [
        DirectMethod::Exact,
        DirectMethod::CosineRays { n: n(128) },
        DirectMethod::Polygons { n: n(16) },
    ] {
        let settings = RenderSettings {
            direct,
            samples: n(2),
            ..RenderSettings::default()
        };
        let image = render(&input, &view, &settings, &Silent).unwrap();
        let nothing = serde_json::json!({});
        let attributes = Attributes::new(&scene, view.description(), settings, visibility.offset(), nothing);
        let report = verify_image(&image, &attributes).unwrap();
        assert!(report.passed && report.n_pixels < 3600, "{direct:?}: {report:#?}");
        assert!(report.n_checked > 1500, "{report:#?}");
        if direct == DirectMethod::Exact {
            assert!(report.n_not_checkable < 20, "{report:#?}");
        }
        // Backs and background are black in every layer, and show their own place or none.
        let patches = image.u32("patch").unwrap();
        let background = patches.iter().position(|&patch| patch == u32::MAX).unwrap();
        let front = 30 * 60 + 30;
        for (k, layer) in image.layers().iter().enumerate() {
            let Some(old) = image.f32(&layer.name) else { continue };
            let wrongs = [(background, 7.0), (front, f32::NAN), (front, -9.0)];
            // What refuses a wrong value is the same in all layers: one each shows that it is asked.
            let (first, n_wrongs) = n_cases((k % 3, 1), (0, 3));
            for (pixel, value) in wrongs.into_iter().skip(first).take(n_wrongs) {
                let mut wrong = image.clone();
                let mut samples = old.to_vec();
                samples[pixel] = value;
                wrong.insert(&layer.name, Samples::F32(samples));
                let found = verify_image(&wrong, &attributes).unwrap();
                assert!(!found.passed, "{} {value}", layer.name);
            }
        }
        let mut paler = image.clone();
        let values = image.f32("radiosity.G").unwrap().iter().map(|b| 1.00001 * b).collect();
        paler.insert("radiosity.G", Samples::F32(values));
        assert!(verify_image(&paler, &attributes).unwrap().n_inconsistent > 1000);
    }
}
