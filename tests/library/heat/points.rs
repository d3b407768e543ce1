//! Free points: mean radiant temperature by solid angles, factors behind occluders, and positions of points.

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
use crate::support::Uniform;

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
            body: None,
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

/// Inside is what the backs of one piece of the surface surround: a block on a floor, with a bottom that lies on it or without one, whatever way points face, and the hollow of thick walls is not.
#[test]
fn insides_are_told_from_hollows() {
    let part = |name: &'static str, low: DVec3, size: [f64; 3], n: usize, turned: bool| {
        let faces = inside(size).into_iter().flat_map(|(_, faces)| faces).take(n);
        let placed = faces.map(|face| {
            let mut face: Vec<DVec3> = face.into_iter().map(|v| v + low).collect();
            if turned {
                face.reverse();
            }
            face
        });
        (name, placed.collect::<Vec<_>>())
    };
    let middle = DVec3::new(1.0, 1.0, 0.5);
    let downwards = PointQuery {
        position: middle,
        normal: Some(-DVec3::Z),
    };
    let queries = [
        around(middle.to_array()),
        downwards,
        around([1.0, 1.0, 1.5]),
        around([3.0, 3.0, 0.1]),
    ];
    let statuses = |parts: &[(&str, Vec<Vec<DVec3>>)]| -> Vec<PointStatus> {
        let text = "[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 290\n";
        let found = look(&scene(parts), 1, text, &queries);
        found.iter().map(|view| view.status).collect()
    };
    let (inside_solid, free) = (PointStatus::InsideSolid, PointStatus::Free);
    let room = part("room", DVec3::ZERO, [4.0; 3], 6, false);
    let low = DVec3::new(0.5, 0.5, 0.0);
    let block = part("block", low, [1.0; 3], 6, true);
    assert_eq!(
        statuses(&[room.clone(), block.clone()]),
        [inside_solid, inside_solid, free, free]
    );
    // The last two of the six sides are the bottom and the top.
    let mut bottomless = block;
    bottomless.1.remove(4);
    let ground = (
        "ground",
        vec![rectangle([-5.0, -5.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0])],
    );
    for floor in [room.clone(), ground] {
        assert_eq!(
            statuses(&[floor, bottomless.clone()]),
            [inside_solid, inside_solid, free, free]
        );
    }
    // A shelf in a room of thick walls: its back is seen, and the outer walls surround every place.
    let walls = part("walls", DVec3::splat(-0.5), [5.0; 3], 6, true);
    let shelf = (
        "shelf",
        vec![rectangle([0.5, 0.5, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])],
    );
    assert_eq!(statuses(&[room, walls, shelf]), [free; 4]);
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

/// A standing person in the sun and in the shade, worked by hand: T_mrt⁴ = 300⁴ + (0.7 / (0.97 σ)) (f_p I + Σ F B), f_p = 0.308 cos(h (0.998 − h² / 50000)), among black things of 300 K.
#[test]
fn a_person_feels_the_sun() {
    let (x, y) = ([2.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
    let roof = scene(&[
        ("up", vec![rectangle([-1.0, -1.0, 1.0], x, y)]),
        ("down", vec![rectangle([-1.0, -1.0, 1.0], y, x)]),
    ]);
    let all = "[surroundings]\ntemperature_k = 300\n[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 300\n";
    let feel = |light: &str, position: [f64; 3], with_person: bool| {
        let mut cx = Context::default();
        let conditions = boundary(&format!("{light}{all}"), &roof).unwrap();
        let options = Subdivision::Uniform(2).into();
        let mut model = Model::new(roof.clone(), "here", options, Use::Light, &mut cx).unwrap();
        let factors = model
            .form_factors(&FormFactorRequest::default(), Need::default(), &mut cx)
            .unwrap();
        let request = SolveRequest::default();
        let study = model.heat(&factors, &conditions, &request, &mut cx).unwrap();
        let heat = Some((&study, &conditions));
        let found = model.points(&[around(position)], heat, with_person, &cx).unwrap();
        found[0].heat.unwrap().mean_radiant.unwrap()
    };
    let sun = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        format!("[sun]\ndirection = [{cos:?}, 0, {sin:?}]\nirradiance_w_m2 = 800\n")
    };
    // h = 30°: f_p = 0.268334; h = 60°: 0.174187.
    for (height, kelvin) in [(30.0, 322.609_476_575_9), (60.0, 315.222_578_545_4)] {
        let lit = feel(&sun(height), [50.0, 0.0, 0.0], true);
        within(lit.value, lit.error + 1e-9, kelvin, 1e-3);
        let without = feel(&sun(height), [50.0, 0.0, 0.0], false);
        within(without.value, without.error + 1e-9, 300.0, 1e-3);
        // 1 m below the roof, where its shadow falls.
        let back = 1.0 / f64::tan(f64::to_radians(height));
        let shaded = feel(&sun(height), [-back, 0.0, 0.0], true);
        within(shaded.value, shaded.error + 1e-9, 300.0, 1e-3);
    }
    // Under the middle of the roof, which takes a sixth of the sphere, a third is left of a sky of 100 W/m².
    let sky = feel("[sky]\nirradiance_w_m2 = 100\n", [0.0; 3], true);
    within(sky.value, sky.error + 1e-9, 303.853_112_595_7, 1e-2);
}

/// Returns random vectors with coordinates up to half of a scale.
fn random_vectors() -> impl FnMut(f64) -> DVec3 {
    let mut uniform = Uniform(1);
    move |scale| DVec3::from_array([0; 3].map(|_| uniform.between(-0.5, 0.5))) * scale
}

/// Holds views against `VisibleFactor` with all other plates but twins; returns how many factors are not 0.
fn as_by_clipping(
    plates: &[Vec<DVec3>],
    are_twins: impl Fn(usize, usize) -> bool,
    queries: &[PointQuery],
    views: &[PointView],
) -> usize {
    let mut n_seen = 0;
    for (view, query) in views.iter().zip(queries) {
        if view.status != PointStatus::Free {
            continue;
        }
        let (place, normal) = (query.position, query.normal.unwrap().normalize());
        let frame = normal.any_orthonormal_pair();
        let region = [place, place + 1e-6 * frame.0, place + 1e-6 * frame.1];
        for (k, plate) in plates.iter().enumerate() {
            let others = plates
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != k && !are_twins(*other, k));
            let occluders: Vec<Occluder<'_>> = others
                .map(|(_, corners)| Occluder {
                    corners: corners.as_slice().into(),
                    one_sided: false,
                    body: None,
                })
                .collect();
            let area = (plate[1] - plate[0]).cross(plate[2] - plate[0]);
            let expected = if area.dot(place - plate[0]) > 0.0 {
                VisibleFactor::new(&region, normal, plate, &occluders).at(place)
            } else {
                0.0
            };
            let found = view.surfaces[k];
            assert!((found.value - expected).abs() < 1e-9, "{k}: {found:?} {expected}");
            n_seen += usize::from(expected > 1e-6);
        }
    }
    n_seen
}

/// So it is among hundreds of plates, most of them hidden by several others together.
#[test]
fn in_clutter_all_is_seen_as_by_clipping_every_face() {
    let mut vector = random_vectors();
    let plates: Vec<Vec<DVec3>> = (0..300)
        .map(|k| {
            let (middle, a, b) = (vector(6.0), vector(1.5), vector(1.5));
            let corners = [-a - b, a - b, a + b, -a + b];
            let n = if k % 2 == 0 { 4 } else { 3 };
            corners[..n].iter().map(|v| middle + *v * 0.5).collect()
        })
        .collect();
    let names: Vec<String> = (0..plates.len()).map(|k| format!("p{k}")).collect();
    let named = names
        .iter()
        .map(String::as_str)
        .zip(plates.iter().map(|p| vec![p.clone()]));
    let all = scene(&named.collect::<Vec<_>>());
    let queries: Vec<PointQuery> = (0..12)
        .map(|_| PointQuery {
            position: vector(4.0),
            normal: Some(vector(1.0)),
        })
        .collect();
    let mut cx = Context::default();
    for cut in [1, 2] {
        let options = Subdivision::Uniform(cut).into();
        let model = Model::new(all.clone(), "here", options, Use::Points, &mut cx).unwrap();
        let views = model.points(&queries, None, false, &cx).unwrap();
        let n_seen = as_by_clipping(&plates, |_, _| false, &queries, &views);
        assert!(n_seen > 300, "{n_seen}");
    }
}

/// Plates in disorder, a closed box among them and a sheet: what a point with a normal sees of each is what `VisibleFactor` finds with all others as occluders, from many points.
#[test]
fn many_plates_hide_each_other() {
    let mut vector = random_vectors();
    let mut plates: Vec<Vec<DVec3>> = Vec::new();
    for k in 0..18 {
        let (middle, a, b) = (vector(6.0), vector(3.0), vector(3.0));
        let corners = [-a - b, a - b, a + b, -a + b];
        let n = if k % 2 == 0 { 4 } else { 3 };
        plates.push(corners[..n].iter().map(|v| middle + *v * 0.5).collect());
    }
    let corner = DVec3::new(-0.4, 0.3, -0.2);
    for (_, faces) in inside([0.9, 0.8, 0.7]) {
        plates.extend(
            faces
                .into_iter()
                .map(|face| face.into_iter().rev().map(|v| v + corner).collect()),
        );
    }
    let sheet: Vec<DVec3> = rectangle([1.5, -1.0, -1.0], [0.2, 1.5, 0.0], [0.0, 0.3, 1.5]);
    plates.push(sheet.iter().rev().copied().collect());
    plates.push(sheet);
    let names: Vec<String> = (0..plates.len()).map(|k| format!("p{k}")).collect();
    let surfaces: Vec<(&str, Vec<Vec<DVec3>>)> = names
        .iter()
        .map(String::as_str)
        .zip(plates.iter().map(|p| vec![p.clone()]))
        .collect();
    let all = scene(&surfaces);
    let text = "[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 300\n";
    let queries: Vec<PointQuery> = (0..40)
        .map(|_| PointQuery {
            position: vector(9.0),
            normal: Some(vector(1.0)),
        })
        .collect();
    let mut n_seen = 0;
    for cut in [1, 3] {
        let views = look(&all, cut, text, &queries);
        // The other side of a sheet lies in its plane, and hides nothing from its front.
        let n = plates.len();
        n_seen += as_by_clipping(
            &plates,
            |one, other| one.max(other) == n - 1 && one.min(other) == n - 2,
            &queries,
            &views,
        );
    }
    assert!(n_seen > 200, "{n_seen}");
}
