//! Fields of form factors: right ones pass verification with the known means, wrong ones do not.

use std::fmt::Write as _;
use std::num::NonZeroU32;

use glam::{DQuat, DVec3};
use radiosity::geometry::point_form_factor::point_form_factor;
use radiosity::geometry::sampling::Sequence;
use radiosity::mesh::{Mesh, Subdivision};
use radiosity::progress::Silent;
use radiosity::render::verify::{VerifyError, VerifyReport, WallReport, verify, verify_image};
use radiosity::render::{
    Attributes, DirectMethod, Field, FieldInput, FieldRecord, Image, RayView, RenderSettings, Samples, SurfaceMean,
    UnfoldedView, View, ViewDescription, exr, field,
};
use radiosity::scene::{Camera, builtin, load};
use radiosity::scene::{FaceId, Scene, SurfaceId};
use radiosity::visibility::Visibility;
use radiosity::visibility::embree::EmbreeVisibility;

fn n(n: u32) -> NonZeroU32 {
    NonZeroU32::new(n).unwrap()
}

pub(crate) const METHODS: [DirectMethod; 3] = [
    DirectMethod::Exact,
    DirectMethod::CosineRays {
        n: NonZeroU32::new(256).unwrap(),
    },
    DirectMethod::Polygons {
        n: NonZeroU32::new(8).unwrap(),
    },
];

pub(crate) struct Made {
    pub(crate) means: Vec<SurfaceMean>,
    scene: Scene,
    mesh: Mesh,
    pub(crate) image: Image,
    pub(crate) attributes: Attributes,
}

/// The unfolded field of a built-in scene, each face in 3 × 3 patches.
fn render_field(name: &str, surface: &str, n_pixels: u32, direct: DirectMethod) -> Made {
    let scene = builtin::build(name, None).unwrap().scene;
    let view = UnfoldedView::new(&scene, n(n_pixels)).unwrap();
    let settings = RenderSettings {
        direct,
        ..RenderSettings::default()
    };
    field_of(scene, surface, &view, settings)
}

/// The field of a scene, each face in 3 × 3 patches.
pub(crate) fn field_of(scene: Scene, surface: &str, view: &dyn View, settings: RenderSettings) -> Made {
    let mesh = Mesh::new(&scene, Subdivision::Uniform(3)).unwrap();
    let visibility = EmbreeVisibility::new(&scene).unwrap();
    let number = scene.surfaces.iter().position(|s| s.name == surface).unwrap();
    let input = FieldInput {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        surface: SurfaceId(u32::try_from(number).unwrap()),
    };
    let Field { image, means } = field(&input, view, &settings, &Silent).unwrap();
    let record = FieldRecord {
        surface: surface.to_owned(),
    };
    let solution = serde_json::json!({});
    let attributes =
        Attributes::new(&scene, view.description(), settings, visibility.offset(), solution).with_field(record);
    Made {
        means,
        scene,
        mesh,
        image,
        attributes,
    }
}

pub(crate) fn check(field: &Made) -> VerifyReport {
    verify_image(&field.image, &field.attributes).unwrap()
}

pub(crate) fn wall<'a>(report: &'a VerifyReport, name: &str) -> &'a WallReport {
    report.walls.iter().find(|wall| wall.name == name).unwrap()
}

#[test]
fn a_field_goes_through_a_file_and_has_its_own_layers() {
    let made = render_field("cube", "z1", 16, DirectMethod::Exact);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field.exr");
    exr::write(&path, &made.image, &made.attributes).unwrap();
    let (image, attributes) = exr::read(&path).unwrap();
    assert_eq!((&image, &attributes), (&made.image, &made.attributes));
    let names: Vec<&str> = image.layers().iter().map(|layer| layer.name.as_str()).collect();
    let expected = ["N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "Y", "Z", "error", "patch"];
    assert_eq!(names, expected);
    let report = verify(&path).unwrap();
    assert!(report.passed && report.field.as_deref() == Some("z1"), "{report:#?}");
}

#[test]
fn every_pixel_of_the_cube_is_the_closed_form() {
    let made = render_field("cube", "z1", 192, DirectMethod::Exact);
    let report = check(&made);
    assert!(report.passed, "{report:#?}");
    assert_eq!((report.n_checked, report.n_not_checkable), (6 * 192 * 192, 0));
    // Half an ulp of an f32 below 1/2, which no form factor of the cube reaches.
    assert!(report.max_error <= 2f64.powi(-26), "{}", report.max_error);
    // The midpoint rule on 192 × 192 pixels leaves less than 1e-6; the values are those of the scene's README.
    for (surface, mean) in made.scene.surfaces.iter().zip(&made.means) {
        let exact = match surface.name.as_str() {
            "z0" => 0.199_824_895_698_387_4,
            "z1" => 0.0,
            _ => 0.200_043_776_075_403_15,
        };
        assert_eq!((mean.n_pixels, mean.n_samples), (192 * 192, 192 * 192));
        assert!(
            (mean.form_factor.unwrap() - exact).abs() < 1e-6,
            "{}: {mean:?}",
            surface.name
        );
        assert!((wall(&report, &surface.name).exact.unwrap()[0] - exact).abs() < 1e-12);
    }
}

#[test]
fn rays_agree_with_the_closed_form_within_their_confidence() {
    for direct in METHODS {
        let made = render_field("cube", "x0", 24, direct);
        let report = check(&made);
        assert!(report.passed && report.n_not_checkable == 0, "{direct:?}: {report:#?}");
        // The standard error says how far off a pixel is: the root mean square of error / standard error is about 1, and below it for scrambled points.
        if let DirectMethod::CosineRays { .. } = direct {
            let (values, errors) = (made.image.f32("Y").unwrap(), made.image.f32("error").unwrap());
            let emitter = made.scene.polygon(FaceId(0));
            let patches = made.image.u32("patch").unwrap();
            let position = ["P.X", "P.Y", "P.Z"].map(|name| made.image.f32(name).unwrap());
            let (mut squares, mut count) = (0.0, 0.0);
            for (k, &patch) in patches.iter().enumerate().filter(|(k, _)| errors[*k] > 0.0) {
                let at = position.map(|layer| f64::from(layer[k])).into();
                let exact = point_form_factor(at, made.mesh.patches[patch as usize].normal, &emitter);
                squares += ((f64::from(values[k]) - exact) / f64::from(errors[k])).powi(2);
                count += 1.0;
            }
            let deviation = (squares / count).sqrt();
            assert!(count > 2000.0 && (0.02..1.1).contains(&deviation), "{deviation}");
        }
    }
}

#[test]
fn half_hidden_walls_have_the_known_mean() {
    // The scene's README: computed independently, to 1e-11.
    let (a_to_b, free) = (0.102_930_079_594_358_68, 0.205_860_159_188_717_36);
    for direct in [METHODS[0], METHODS[1]] {
        let made = render_field("corridor", "B", 160, direct);
        let report = check(&made);
        assert!(report.passed, "{direct:?}: {report:#?}");
        assert_eq!(report.n_not_checkable, 0);
        let known = wall(&report, "A");
        assert!((known.exact.unwrap()[0] - a_to_b).abs() < 1e-10, "{known:?}");
        // 160 × 16 midpoints of a field that is half in penumbra; noise beside it.
        let room = 3e-5 + known.statistical[0];
        assert!((known.mean[0] - a_to_b).abs() < room, "{known:?}");
        // Far below what the partition takes away.
        assert!(room < 0.01 * free);
    }
    // Shadow rays to a few points of the emitter are drawn again.
    let report = check(&render_field("corridor", "B", 60, METHODS[2]));
    assert!(report.passed && report.complete && report.n_drawn > 300, "{report:#?}");
    let known = wall(&report, "A");
    assert!((known.exact.unwrap()[0] - a_to_b).abs() < 1e-10, "{known:?}");
    // 8 rays from each of 360 pixels.
    assert!(known.tolerance[0] < 0.25 * a_to_b, "{known:?}");
}

/// Changes the field at the pixels that are chosen, by number and value.
fn change(made: &mut Made, layer: &str, new: impl Fn(usize, f32) -> f32) -> usize {
    let old = made.image.f32(layer).unwrap().to_vec();
    let values: Vec<f32> = old.iter().enumerate().map(|(k, &y)| new(k, y)).collect();
    let n_changed = old.iter().zip(&values).filter(|(a, b)| a.to_bits() != b.to_bits());
    let n_changed = n_changed.count();
    made.image.insert(layer, Samples::F32(values));
    n_changed
}

/// Where the surface is hidden in part, the rays' noise hides nothing: every pixel is what its own rays find.
#[test]
fn shadow_rays_are_drawn_again() {
    let variants = [
        RenderSettings::default(),
        RenderSettings {
            sequence: Sequence::Random,
            seed: 5,
            ..RenderSettings::default()
        },
        RenderSettings {
            samples: n(2),
            ..RenderSettings::default()
        },
    ];
    for (variant, rays) in variants.into_iter().zip([64, 10, 3]) {
        let settings = RenderSettings {
            direct: DirectMethod::Polygons { n: n(rays) },
            ..variant
        };
        let scene = builtin::build("room-box", None).unwrap().scene;
        let view = UnfoldedView::new(&scene, n(40)).unwrap();
        let surface = scene.surfaces[0].name.clone();
        let made = || field_of(scene.clone(), &surface, &view, settings);
        let right = made();
        let report = check(&right);
        assert!(
            report.passed && report.n_drawn > 200 && 50 * report.n_not_checkable < report.n_pixels,
            "{rays}: {report:#?}"
        );
        let errors = right.image.f32("error").unwrap().to_vec();
        let is_mixed = |k: usize| errors[k] > 0.0;
        // Half of the value, at one pixel, at some, and at all where rays decide.
        for every in [1, 7, 1000] {
            let mut half = made();
            let first = (0..errors.len()).find(|&k| is_mixed(k)).unwrap();
            let is_chosen = |k: usize| is_mixed(k) && (k - first).is_multiple_of(every);
            let n_changed = change(&mut half, "Y", |k, y| if is_chosen(k) { 0.5 * y } else { y });
            let found = check(&half);
            assert!(!found.passed, "{rays}, {every}: {found:#?}");
            // All but those that cannot be checked, and the few of whose rays rounding decides.
            assert!(
                10 * found.n_outside >= 9 * n_changed && n_changed > 0,
                "{rays}, {every}: {n_changed}, {found:#?}"
            );
        }
        // The stated errors, and the points of another seed.
        let mut bold = made();
        change(&mut bold, "error", |_, e| 0.9 * e);
        let found = check(&bold);
        assert!(!found.passed && found.n_inconsistent > 100, "{rays}: {found:#?}");
        let mut other = made();
        other.attributes.render.seed += 1;
        assert!(!check(&other).passed);
    }
}

/// Emitters of two surfaces share the stream of a pixel in an order that the file does not tell: the rays cannot be drawn again, and the report says that this is not all.
#[test]
fn what_cannot_be_checked_is_told() {
    let mut made = render_field("corridor", "B", 60, METHODS[2]);
    made.attributes.field = None;
    let lit = |name: &str| f64::from(u8::from(["B", "partition"].contains(&name)));
    for surface in &mut made.attributes.surfaces {
        for polygon in &mut surface.polygons {
            polygon.exitance = [lit(&surface.name); 3];
            polygon.reflectance = [0.0; 3];
        }
    }
    let values = made.image.f32("Y").unwrap().to_vec();
    let zero = vec![0.0; values.len()];
    let radiance: Vec<f32> = values.iter().map(|y| y / std::f32::consts::PI).collect();
    for c in ["R", "G", "B"] {
        for (layer, channel) in [
            ("direct", &values),
            ("irradiance", &values),
            ("radiosity", &values),
            ("albedo", &zero),
        ] {
            made.image
                .insert(&format!("{layer}.{c}"), Samples::F32(channel.clone()));
        }
        made.image.insert(c, Samples::F32(radiance.clone()));
    }
    let report = check(&made);
    assert!(
        !report.complete && report.n_not_checkable > 100 && report.n_drawn == 0,
        "{report:#?}"
    );
}

#[test]
fn wrong_fields_fail() {
    for direct in METHODS {
        // A field to another surface, and all values a little high.
        let mut other = render_field("cube", "z1", 24, direct);
        other.attributes = other.attributes.with_field(FieldRecord {
            surface: "x0".to_owned(),
        });
        assert!(!check(&other).passed, "{direct:?}");
        let mut high = render_field("cube", "z1", 24, direct);
        change(&mut high, "Y", |_, y| 1.01 * y);
        assert!(!check(&high).passed, "{direct:?}");
    }
    // One pixel by 1e-6, where there is no noise.
    let mut one = render_field("cube", "z1", 24, DirectMethod::Exact);
    let ViewDescription::Unfolded(layout) = &one.attributes.view else {
        panic!("an unfolded view");
    };
    let tile = layout.tiles.iter().find(|tile| tile.name == "y0").unwrap();
    let at = (tile.top as usize + 7) * one.image.width() + tile.left as usize + 5;
    change(&mut one, "Y", |k, y| if k == at { y + 1e-6 } else { y });
    let report = check(&one);
    assert!(!report.passed && report.n_outside == 1, "{report:#?}");
    // A field as if the partition were not there.
    let mut free = render_field("corridor", "B", 60, DirectMethod::Exact);
    let emitter = free.scene.polygon(FaceId(1));
    let points = ["P.X", "P.Y", "P.Z"].map(|name| free.image.f32(name).unwrap().to_vec());
    let patches = free.image.u32("patch").unwrap().to_vec();
    let unhindered = |k: usize, y: f32| {
        let Some(patch) = free.mesh.patches.get(patches[k] as usize) else {
            return y;
        };
        let point = [0, 1, 2].map(|c| f64::from(points[c][k])).into();
        let exact = point_form_factor(point, patch.normal, &emitter);
        #[expect(clippy::cast_possible_truncation, reason = "a layer is f32")]
        let value = exact as f32;
        value
    };
    let values = free.image.f32("Y").unwrap().iter().enumerate();
    let values = values.map(|(k, &y)| unhindered(k, y)).collect();
    free.image.insert("Y", Samples::F32(values));
    let unhidden = check(&free);
    assert!(!unhidden.passed && unhidden.n_outside > 100, "{unhidden:#?}");
    // A surface that is not there.
    let lost = free.attributes.with_field(FieldRecord {
        surface: "C".to_owned(),
    });
    let error = verify_image(&free.image, &lost).unwrap_err();
    assert!(matches!(error, VerifyError::NoSuchSurface(name) if name == "C"));
}

/// Where edges run through pixels, each sample counts for its own surface: the means are those of the same samples as pixels of their own.
#[test]
fn means_are_of_samples() {
    let scene = builtin::build("cube", None).unwrap().scene;
    let camera = Camera::default_view(&scene);
    let means = |width: u32, samples: u32| {
        let ray = |x: f64, y: f64| camera.primary_ray(x, y, width, width);
        let view = RayView::new(width, width, ray, serde_json::Value::Null);
        let settings = RenderSettings {
            direct: DirectMethod::Exact,
            samples: n(samples),
            ..RenderSettings::default()
        };
        field_of(scene.clone(), "z1", &view, settings).means
    };
    let (coarse, fine) = (means(15, 4), means(60, 1));
    for (k, (of_coarse, of_fine)) in coarse.iter().zip(&fine).enumerate() {
        let counts = (of_coarse.n_samples, of_fine.n_pixels);
        assert_eq!(counts, (of_fine.n_samples, of_fine.n_samples), "{k}");
        match (of_coarse.form_factor, of_fine.form_factor) {
            (Some(a), Some(b)) => assert!((a - b).abs() < 1e-12, "{k}: {a} {b}"),
            (a, b) => assert_eq!(a, b, "{k}"),
        }
    }
    // The surface itself is seen, and does not see itself.
    let own = scene.surfaces.iter().position(|surface| surface.name == "z1").unwrap();
    assert_eq!(coarse[own].form_factor, Some(0.0));
}

/// A room with a block on its floor as a file with six decimals has it, with the block turned, or everything.
fn turned(all: bool) -> Scene {
    // Counter-clockwise seen from outside; bits of a corner's number say where it is along x, y and z.
    const FACES: [[usize; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let whole = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), if all { 0.7 } else { 0.0 });
    let (about, own) = (DVec3::new(1.3, 2.1, 0.0), DQuat::from_rotation_z(0.4));
    let boxes = [
        ("room", DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0)),
        ("block", DVec3::new(0.8, 1.5, 0.0), DVec3::new(1.9, 2.6, 1.2)),
    ];
    let mut text = String::new();
    for (first, (name, low, high)) in [1, 9].into_iter().zip(boxes) {
        let is_room = name == "room";
        for k in 0..8 {
            let pick = |axis: usize| if k >> axis & 1 == 1 { high[axis] } else { low[axis] };
            let corner = DVec3::new(pick(0), pick(1), pick(2));
            let v = whole
                * if is_room {
                    corner
                } else {
                    about + own * (corner - about)
                };
            writeln!(text, "v {:.6} {:.6} {:.6}", v.x, v.y, v.z).unwrap();
        }
        for (side, mut corners) in ["x0", "x1", "y0", "y1", "z0", "z1"].iter().zip(FACES) {
            if is_room {
                corners.reverse();
            }
            let [a, b, c, d] = corners.map(|k| k + first);
            writeln!(text, "o {name}_{side}\nf {a} {b} {c} {d}").unwrap();
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("turned.obj");
    std::fs::write(&path, text).unwrap();
    load(&path).unwrap().scene
}

/// What rounding to six decimals makes of faces that touch is allowed for, by what it changes at each pixel, and no more.
#[test]
fn coordinates_of_six_decimals_pass() {
    for (all, surface) in [
        (false, "room_z1"),
        (false, "room_x0"),
        (false, "block_z1"),
        (true, "room_z1"),
        (true, "block_x1"),
    ] {
        for direct in METHODS {
            let scene = turned(all);
            let view = UnfoldedView::new(&scene, n(50)).unwrap();
            let settings = RenderSettings {
                direct,
                ..RenderSettings::default()
            };
            let mut made = field_of(scene, surface, &view, settings);
            let report = check(&made);
            assert!(report.passed, "{all}, {surface}, {direct:?}: {report:#?}");
            assert!(
                500 * report.n_not_checkable < report.n_pixels,
                "{all}, {surface}, {direct:?}: {report:#?}"
            );
            if direct != DirectMethod::Exact {
                continue;
            }
            assert!(report.tolerance.max_rounding < 1e-6, "{all}, {surface}: {report:#?}");
            let n_changed = change(&mut made, "Y", |_, y| if y > 0.0 { y + 1e-6 } else { y });
            let high = check(&made);
            assert!(!high.passed && n_changed > 1000, "{high:#?}");
            assert!(
                high.n_outside + high.n_not_checkable >= n_changed,
                "{all}, {surface}: {n_changed}, {high:#?}"
            );
        }
    }
}
