//! Sun and sky in pictures: sharp shadows, penumbras, the light of the sky, and the sky itself.

use glam::DVec3;

use radiosity::heat::{Sky, Sun};
use radiosity::mesh::Subdivision;
use radiosity::progress::Silent;
use radiosity::render::verify::{VerifyError, verify_image};
use radiosity::render::{Attributes, DirectMethod, GatherSettings, Image, RayView, RenderSettings, View as _, render};
use radiosity::scene::{Material, Scene, SceneBuilder};
use radiosity::workflow::{
    Context, Daylight, FormFactorRequest, ImageLight, Model, SkyRequest, SolveRequest, SunRequest, Use,
};

const SUN: [f64; 3] = [90.0, 60.0, 30.0];
const SKY: [f64; 3] = [40.0, 50.0, 80.0];
const SIDE: u32 = 64;

/// A floor of 4 m × 4 m, 1 m above its middle a plate of 1 m × 1 m with both of its sides.
fn scene() -> Scene {
    let square = |low: f64, side: f64, z: f64| {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [low + side * x, low + side * y, z])
    };
    let vertices = [square(0.0, 4.0, 0.0), square(1.5, 1.0, 1.0)].concat();
    let mut builder = SceneBuilder::new();
    let surfaces = ["floor", "plate", "under"].map(|name| builder.surface(name).unwrap());
    let grey = builder
        .material(Material {
            name: "grey".into(),
            reflectance: [0.5; 3],
            exitance: [0.0; 3],
        })
        .unwrap();
    let faces = [[0, 1, 2, 3], [4, 5, 6, 7], [7, 6, 5, 4]];
    builder.faces(&vertices, &faces, &surfaces, &[grey]).unwrap();
    builder.build().unwrap().scene
}

fn daylight(direction: DVec3, radius: f64) -> Daylight {
    Daylight {
        sun: Some(SunRequest {
            sun: Sun::new(direction, 90.0, radius).unwrap(),
            irradiance: SUN,
        }),
        sky: Some(SkyRequest {
            sky: Sky::new(80.0, DVec3::Z).unwrap(),
            irradiance: SKY,
        }),
    }
}

/// Straight down on the floor, a pixel for each 1/16 m and half a metre beyond each edge of the floor: what lies there is background.
fn from_above() -> RayView<impl Fn(f64, f64) -> (DVec3, DVec3) + Sync> {
    let ray = |x: f64, y: f64| {
        let at = |t: f64| 5.0 * t / f64::from(SIDE) - 0.5;
        (DVec3::new(at(x), at(y), 0.5), DVec3::NEG_Z)
    };
    RayView::new(SIDE, SIDE, ray, serde_json::json!({}))
}

fn lit(model: &mut Model, direct: DirectMethod, daylight: &Daylight) -> ImageLight {
    let requests = (&FormFactorRequest::default(), &SolveRequest::default());
    model
        .light_for_image(requests, (direct, daylight), false, &mut Context::default())
        .unwrap()
}

fn model(n: u32) -> Model {
    let cx = &mut Context::default();
    Model::new(scene(), "here", Subdivision::Uniform(n).into(), Use::Light, cx).unwrap()
}

fn rgb(image: &Image, prefix: &str, k: usize) -> [f64; 3] {
    ["R", "G", "B"].map(|c| f64::from(image.f32(&format!("{prefix}{c}")).unwrap()[k]))
}

/// The point of the floor at the centre of a pixel; `None` beside the floor.
fn place(k: usize) -> Option<DVec3> {
    let at = |t: u32| 5.0 * (f64::from(t) + 0.5) / f64::from(SIDE) - 0.5;
    let k = u32::try_from(k).unwrap();
    let point = DVec3::new(at(k % SIDE), at(k / SIDE), 0.0);
    let is_on = |x: f64| (0.0..4.0).contains(&x);
    (is_on(point.x) && is_on(point.y)).then_some(point)
}

fn pictured(model: &Model, light: &ImageLight, settings: &RenderSettings) -> Image {
    render(&light.input(model), &from_above(), settings, &Silent).unwrap()
}

/// The camera is below the plate: what it sees of the floor has the sun but in the shadow, whose border is exact; the background shows the sky nowhere, as it looks down.
#[test]
fn shadows_of_the_sun_are_sharp_at_every_pixel() {
    let direction = DVec3::new(0.3, -0.2, 1.0);
    let cosine = direction.normalize().z;
    let mut model = model(4);
    for direct in [
        DirectMethod::Exact,
        DirectMethod::Polygons {
            n: DirectMethod::SHADOW_RAYS,
        },
    ] {
        let light = lit(&mut model, direct, &daylight(direction, 0.0));
        let settings = RenderSettings {
            direct,
            ..RenderSettings::default()
        };
        let image = pictured(&model, &light, &settings);
        let mut n_dark = 0;
        for k in 0..(SIDE * SIDE) as usize {
            let (sun, radiance) = (rgb(&image, "direct.", k), rgb(&image, "", k));
            let Some(point) = place(k) else {
                assert_eq!((sun, radiance), ([0.0; 3], [0.0; 3]));
                continue;
            };
            let on_plate = point + direction;
            let is_in = |x: f64| (1.5..2.5).contains(&x);
            let is_dark = is_in(on_plate.x) && is_in(on_plate.y);
            n_dark += usize::from(is_dark);
            let expected = SUN.map(|s| if is_dark { 0.0 } else { s * cosine });
            assert!((0..3).all(|c| (sun[c] - expected[c]).abs() < 1e-4), "{point} {sun:?}");
        }
        assert!(n_dark > 100, "{n_dark}");
        // Another settings record would do: what is refused is the daylight.
        let record = serde_json::json!({ "sky_irradiance": SKY });
        let attributes = Attributes::new(&model.scene, from_above().description(), settings, 1e-6, record);
        let refused = verify_image(&image, &attributes).unwrap_err();
        assert!(matches!(refused, VerifyError::Daylight), "{refused}");
    }
}

/// A disc of 5°: in the mean over the floor the penumbra takes what the exact light of the patches has, within its own stated noise.
#[test]
fn a_disc_has_penumbras() {
    let mut model = model(8);
    let light = lit(
        &mut model,
        DirectMethod::Exact,
        &daylight(DVec3::new(0.0, 0.4, 1.0), 5.0),
    );
    let settings = RenderSettings {
        direct: DirectMethod::Exact,
        ..RenderSettings::default()
    };
    let image = pictured(&model, &light, &settings);
    let floor: Vec<usize> = (0..(SIDE * SIDE) as usize).filter(|&k| place(k).is_some()).collect();
    let n = floor.len() as f64;
    let mean: f64 = floor.iter().map(|&k| rgb(&image, "direct.", k)[0]).sum::<f64>() / n;
    let exact = &light.study.direct.sun.as_ref().unwrap().irradiance;
    let expected: f64 = (0..64).map(|i| exact.row(i)[0]).sum::<f64>() / 64.0;
    let variance: f64 = floor
        .iter()
        .map(|&k| rgb(&image, "direct_error.", k)[0].powi(2))
        .sum::<f64>()
        / (n * n);
    assert!(
        (mean - expected).abs() < 4.0 * variance.sqrt() + 2e-3 * expected,
        "{mean} {expected}"
    );
    let n_partial = floor
        .iter()
        .filter(|&&k| rgb(&image, "direct_error.", k)[0] > 0.0)
        .count();
    assert!(n_partial > 50, "{n_partial}");
}

/// Between patches or gathered by rays, the light of the sky on the floor is what the solution has; looking up, the background shows the sky.
#[test]
fn the_sky_lights_and_is_seen() {
    let mut model = model(8);
    let only_sky = Daylight {
        sun: None,
        ..daylight(DVec3::Z, 0.0)
    };
    let light = lit(&mut model, DirectMethod::Exact, &only_sky);
    let expected: f64 = (0..64).map(|i| light.study.solution.irradiance.row(i)[0]).sum::<f64>() / 64.0;
    for gather in [None, Some(GatherSettings::default())] {
        let settings = RenderSettings {
            direct: DirectMethod::Exact,
            gather,
            ..RenderSettings::default()
        };
        let image = pictured(&model, &light, &settings);
        let floor: Vec<usize> = (0..(SIDE * SIDE) as usize).filter(|&k| place(k).is_some()).collect();
        let mean: f64 = floor.iter().map(|&k| rgb(&image, "irradiance.", k)[0]).sum::<f64>() / floor.len() as f64;
        assert!(
            (mean - expected).abs() < 4e-3 * expected,
            "{gather:?}: {mean} {expected}"
        );
    }
    let up = RayView::new(
        2,
        2,
        |_, _| (DVec3::new(1.0, 1.0, 5.0), DVec3::new(0.2, 0.0, 1.0)),
        serde_json::json!({}),
    );
    let image = render(&light.input(&model), &up, &RenderSettings::default(), &Silent).unwrap();
    let seen = rgb(&image, "", 0);
    assert!(
        (0..3).all(|c| (seen[c] - SKY[c] / std::f64::consts::PI).abs() < 1e-5),
        "{seen:?}"
    );
    assert_eq!(image.u32("patch").unwrap()[0], u32::MAX);
}

/// The whole scene turned and moved with sun, sky and camera: the same light on every patch and the same picture.
#[test]
fn turned_and_moved_all_looks_the_same() {
    let direction = DVec3::new(0.3, -0.2, 1.0);
    let look = |turn: glam::DQuat, shift: DVec3| {
        let mut scene = scene();
        scene.vertices.iter_mut().for_each(|v| *v = turn * *v + shift);
        let mut daylight = daylight(turn * direction, 2.0);
        daylight.sky = daylight.sky.map(|sky| SkyRequest {
            sky: Sky::new(80.0, turn * DVec3::Z).unwrap(),
            ..sky
        });
        let cx = &mut Context::default();
        let mut model = Model::new(scene, "here", Subdivision::Uniform(4).into(), Use::Light, cx).unwrap();
        let settings = RenderSettings {
            direct: DirectMethod::Exact,
            ..RenderSettings::default()
        };
        let light = lit(&mut model, settings.direct, &daylight);
        let ray = move |x: f64, y: f64| {
            let at = |t: f64| 5.0 * t / f64::from(SIDE) - 0.5;
            let (from, towards) = (DVec3::new(at(x), at(y), 0.5), DVec3::NEG_Z);
            (turn * from + shift, turn * towards)
        };
        let view = RayView::new(SIDE, SIDE, ray, serde_json::json!({}));
        let image = render(&light.input(&model), &view, &settings, &Silent).unwrap();
        (light.study.solution.radiosity.values().to_vec(), image)
    };
    let (plain, first) = look(glam::DQuat::IDENTITY, DVec3::ZERO);
    let turn = glam::DQuat::from_axis_angle(DVec3::new(-0.4, 1.0, 0.7).normalize(), 2.0);
    let (turned, second) = look(turn, DVec3::new(3.0, -7.0, 1.5));
    let brightest = plain.iter().copied().fold(0.0, f64::max);
    for (a, b) in plain.iter().zip(&turned) {
        assert!((a - b).abs() < 2e-3 * brightest, "{a} {b}");
    }
    // The noise of a penumbra's directions is another: pixels are compared in the mean, and outside of it each by itself.
    let (mut sums, mut n_off) = ([0.0; 2], 0);
    for k in 0..(SIDE * SIDE) as usize {
        let (a, b) = (rgb(&first, "", k)[0], rgb(&second, "", k)[0]);
        sums[0] += a;
        sums[1] += b;
        n_off += usize::from((a - b).abs() > 0.01 * brightest);
    }
    assert!((sums[0] - sums[1]).abs() < 5e-3 * sums[0], "{sums:?}");
    assert!(n_off < (SIDE * SIDE) as usize / 20, "{n_off}");
}
