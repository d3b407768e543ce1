//! Free points: mean radiant temperature by solid angles, factors behind occluders, and where points are.

use std::f64::consts::PI;

use glam::DVec3;
use radiosity::form_factor::partial::VisibleFactor;
use radiosity::heat::{PointQuery, PointStatus, PointView};
use radiosity::matrix::Need;
use radiosity::mesh::Subdivision;
use radiosity::scene::Scene;
use radiosity::visibility::occluders::Occluder;
use radiosity::workflow::{Context, FormFactorRequest, Model, SolveRequest, Use};

use super::{boundary, inside, rectangle, scene, within};

fn look(scene: &Scene, cut: u32, text: &str, queries: &[PointQuery]) -> Vec<PointView> {
    let mut cx = Context::default();
    let conditions = boundary(text, scene).unwrap();
    let options = Subdivision::Uniform(cut).into();
    let mut model = Model::new(scene.clone(), "here", options, Use::Light, &mut cx).unwrap();
    let factors = model
        .form_factors(&FormFactorRequest::default(), Need::default(), &mut cx)
        .unwrap();
    let study = model
        .heat(&factors, &conditions, &SolveRequest::default(), &mut cx)
        .unwrap();
    let views = model.points(queries, Some((&study, &conditions)), false, &cx).unwrap();
    for view in &views {
        let sum: f64 = view.surfaces.iter().map(|own| own.value).sum();
        let all = sum + view.backs.value + view.surroundings.value;
        assert!((all - 1.0).abs() < 1e-12, "{view:?}");
    }
    views
}

fn around(position: [f64; 3]) -> PointQuery {
    PointQuery {
        position: DVec3::from_array(position),
        normal: None,
    }
}

/// In the middle of a box with one hot side T_mrt follows from the solid angle of that side, 4 asin(a b / sqrt((a² + 4 d²)(b² + 4 d²))).
#[test]
fn mean_radiant_temperatures_follow_from_solid_angles() {
    let text = "[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 290\n[[surface]]\nname = \"x0\"\ntemperature_k = 450\n";
    let (a, b, d) = (1.0_f64, 1.5_f64, 1.0_f64);
    let angle = 4.0 * (a * b / ((a * a + 4.0 * d * d) * (b * b + 4.0 * d * d)).sqrt()).asin();
    let share = angle / (4.0 * PI);
    let expected = (share * 450.0_f64.powi(4) + (1.0 - share) * 290.0_f64.powi(4)).powf(0.25);
    for cut in [1, 3] {
        let found = look(&scene(&inside([2.0, 1.0, 1.5])), cut, text, &[around([1.0, 0.5, 0.75])]);
        within(found[0].surfaces[0].value, 1e-13, share, 1.0);
        let kelvin = found[0].heat.unwrap().mean_radiant.unwrap();
        within(kelvin.value, kelvin.error, expected, 1e-3);
    }
}

/// What a plate hides is gone, whichever way it faces: as `VisibleFactor` has it, which clips in another way.
#[test]
fn occluders_hide_what_is_behind_them() {
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    let ceiling = rectangle([-2.0, -2.0, 2.0], y.map(|v| 4.0 * v), x.map(|v| 4.0 * v));
    let plate = rectangle([0.1, -0.3, 0.9], x, y);
    let both = scene(&[("ceiling", vec![ceiling.clone()]), ("plate", vec![plate.clone()])]);
    let text = "[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 300\n";
    for cut in [1, 4] {
        let place = DVec3::new(0.3, 0.2, 0.0);
        let query = PointQuery {
            position: place,
            normal: Some(DVec3::new(0.2, -0.1, 2.0)),
        };
        let found = look(&both, cut, text, &[query]);
        let normal = DVec3::new(0.2, -0.1, 2.0).normalize();
        let frame = normal.any_orthonormal_pair();
        let region = [place, place + 1e-3 * frame.0, place + 1e-3 * frame.1];
        let occluder = Occluder {
            corners: plate.as_slice().into(),
            one_sided: false,
        };
        let expected = VisibleFactor::new(&region, normal, &ceiling, &[occluder]).at(place);
        within(found[0].surfaces[0].value, 1e-12, expected, 1.0);
        // The plate faces up: from below its back is seen.
        let turned: Vec<DVec3> = plate.iter().rev().copied().collect();
        let back = VisibleFactor::new(&region, normal, &turned, &[]).at(place);
        within(found[0].backs.value, 1e-12, back, 1.0);
        assert!(found[0].surfaces[1].value <= 0.0);
    }
}

/// Both sides of a sheet are seen from their own side; inside of a solid, and on a face, the status says so.
#[test]
fn places_are_told() {
    let outside: Vec<_> = inside([1.0; 3])
        .into_iter()
        .map(|(name, faces)| {
            let turned = |face: Vec<DVec3>| face.into_iter().rev().collect();
            (name, faces.into_iter().map(turned).collect::<Vec<Vec<DVec3>>>())
        })
        .collect();
    let solid = scene(&outside);
    let text =
        "[surroundings]\ntemperature_k = 100\n[[surface]]\nname = \"*\"\nemissivity = 0.9\ntemperature_k = 300\n";
    let found = look(
        &solid,
        2,
        text,
        &[around([0.5; 3]), around([0.5, 0.5, 1.0]), around([0.5, 0.5, 3.0])],
    );
    let statuses: Vec<PointStatus> = found.iter().map(|view| view.status).collect();
    assert_eq!(
        statuses,
        [PointStatus::InsideSolid, PointStatus::OnFace, PointStatus::Free]
    );
    let sides = scene(&[
        ("up", vec![rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])]),
        ("down", vec![rectangle([0.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])]),
    ]);
    let both = look(&sides, 2, text, &[around([0.5, 0.5, 0.5]), around([0.5, 0.5, -0.5])]);
    for (view, seen) in both.iter().zip([0, 1]) {
        // A square from half its side above the middle: a sixth of the sphere.
        within(view.surfaces[seen].value, 1e-12, 1.0 / 6.0, 1.0);
        assert!(
            view.surfaces[1 - seen].value <= 0.0 && view.backs.value <= 0.0,
            "{view:?}"
        );
    }
}

/// Sun, sky and surroundings on points in the open and in shadow.
#[test]
fn light_arrives_at_points() {
    let plate = scene(&[(
        "plate",
        vec![rectangle([-0.5, -0.5, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])],
    )]);
    let text = "[surroundings]\ntemperature_k = 200\n[sun]\ndirection = [0, 0, 1]\nirradiance_w_m2 = 1000\n\
         [sky]\nirradiance_w_m2 = 100\n[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 200\n";
    let facing = |position: [f64; 3]| PointQuery {
        normal: Some(DVec3::Z),
        ..around(position)
    };
    let found = look(&plate, 2, text, &[facing([0.0; 3]), facing([3.0, 0.0, 0.0])]);
    for (view, lit) in found.iter().zip([0.0, 1.0]) {
        let heat = view.heat.unwrap();
        assert!((heat.sunlit.unwrap().value - lit).abs() <= 0.0);
        within(heat.sun.value, heat.sun.error, 1000.0 * lit, 1.0);
        within(
            heat.solar.value,
            heat.solar.error,
            100.0 * view.surroundings.value,
            1e-6,
        );
        within(
            heat.irradiance.value,
            heat.irradiance.error + 1e-9,
            super::SIGMA * 200.0_f64.powi(4),
            1e-3,
        );
    }
}

/// On a map, where coordinates are 10^7 times the size of faces, points see what they see near the origin: triangles of an octahedron in whole parts of 2^-20 m, one of them cut by a plate.
#[test]
fn views_from_points_are_the_same_far_from_the_origin() {
    let unit = 1.0 / 1_048_576.0;
    let [x, y, z] = [DVec3::X, DVec3::new(0.1, 1.1, 0.0), DVec3::new(0.2, 0.1, 0.9)];
    let sides = |signs: [f64; 3]| {
        let corners = vec![signs[0] * x, signs[1] * y, signs[2] * z];
        let is_inwards = signs.iter().product::<f64>() < 0.0;
        if is_inwards {
            corners
        } else {
            corners.into_iter().rev().collect()
        }
    };
    let signs = (0..8).map(|k| [0, 1, 2].map(|bit| if k >> bit & 1 == 0 { 1.0 } else { -1.0 }));
    let mut surfaces: Vec<(String, Vec<DVec3>)> = signs.enumerate().map(|(k, s)| (format!("s{k}"), sides(s))).collect();
    surfaces.push((
        "plate".into(),
        vec![0.3 * z - 0.1 * x, 0.3 * z + 0.1 * y, 0.35 * z + 0.1 * x - 0.1 * y],
    ));
    let text = "[[surface]]\nname = \"*\"\nemissivity = 0.9\ntemperature_k = 300\n";
    let from = |place: DVec3| {
        let at = |v: DVec3| (v * 0.25 / unit).round() * unit + place;
        let all: Vec<(&str, Vec<Vec<DVec3>>)> = surfaces
            .iter()
            .map(|(name, corners)| (name.as_str(), vec![corners.iter().map(|&v| at(v)).collect()]))
            .collect();
        let queries = [DVec3::new(0.05, -0.1, 0.02), DVec3::new(-0.2, 0.1, 0.1)].map(|v| around(at(v).to_array()));
        look(&scene(&all), 1, text, &queries)
    };
    let near = from(DVec3::ZERO);
    let fronts = |view: &PointView| view.surfaces.iter().map(|own| own.value).sum::<f64>();
    assert!(near.iter().all(|view| fronts(view) > 0.9), "{near:?}");
    for place in [
        DVec3::new(524_288.0, 5_242_880.0, 64.0),
        DVec3::new(-8_388_608.0, 4.0, 2_097_152.0),
    ] {
        for (found, expected) in from(place).iter().zip(&near) {
            assert_eq!(found.status, expected.status, "{place}");
            for (own, other) in found.surfaces.iter().zip(&expected.surfaces) {
                within(own.value, own.error + other.error, other.value, 1e-3);
            }
        }
    }
}
