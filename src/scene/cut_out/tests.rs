use glam::{DQuat, DVec2, DVec3};

use super::*;
use crate::geometry::sampling::{PointStream, Sequence};
use crate::scene::{MaterialId, Surface, SurfaceId, Written};

/// An outline in the plane, with its surface.
type Drawn = (u32, Vec<DVec2>);

fn rectangle(surface: u32, x: [f64; 2], y: [f64; 2]) -> Drawn {
    let corner = |i: usize, j: usize| DVec2::new(x[i], y[j]);
    (surface, vec![corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)])
}

/// Places of the plane in space: along the axes, and turned and moved.
fn frames() -> [(DQuat, DVec3); 4] {
    let turn = |x: f64, y: f64, z: f64| DQuat::from_euler(glam::EulerRot::XYZ, x, y, z);
    [
        (DQuat::IDENTITY, DVec3::ZERO),
        (turn(0.3, -1.1, 0.7), DVec3::new(0.5, -0.25, 0.125)),
        (turn(-2.0, 0.4, 1.3), DVec3::new(-40.0, 7.0, 300.0)),
        (turn(0.0, 0.0, 0.5), DVec3::new(3.0, 1.0, 0.0)),
    ]
}

fn scene(drawn: &[Drawn], (turn, shift): (DQuat, DVec3)) -> Scene {
    let mut scene = Scene::default();
    let mut vertices = Vertices::of(&scene, 1e-12);
    let n_surfaces = drawn.iter().map(|(surface, _)| surface + 1).max().unwrap_or(0);
    scene.surfaces = (0..n_surfaces).map(|k| Surface { name: format!("s{k}") }).collect();
    for (line, (surface, corners)) in (1..).zip(drawn) {
        let place = |v: &DVec2| turn * DVec3::new(v.x, v.y, 0.0) + shift;
        let face = Face {
            corners: Corners::Triangle([0; 3]),
            surface: SurfaceId(*surface),
            material: MaterialId(*surface),
            line,
        };
        let outline: Vec<DVec3> = corners.iter().map(place).collect();
        let faces = vertices.faces(&mut scene, face, &[outline]).expect("a few");
        scene.faces.extend(faces);
    }
    scene
}

/// Rounds the coordinates of a scene to a number of decimals, as a file does.
fn rounded(mut scene: Scene, places: usize) -> Scene {
    let mut written = Written::default();
    for v in &mut scene.vertices {
        let text = v.to_array().map(|x| format!("{x:.places$}"));
        for token in &text {
            written.see(token);
        }
        *v = DVec3::from_array(text.map(|token| token.parse().expect("a number")));
    }
    scene.written = Some(written);
    scene
}

fn area_of(scene: &Scene, face: FaceId) -> f64 {
    scene.area_vector(face).length()
}

fn areas(scene: &Scene) -> Vec<f64> {
    let mut areas = vec![0.0; scene.surfaces.len()];
    for face in scene.face_ids() {
        areas[scene.faces[face.0 as usize].surface.0 as usize] += area_of(scene, face);
    }
    areas
}

fn total(scene: &Scene) -> f64 {
    areas(scene).iter().sum()
}

fn n_faces(scene: &Scene, surface: u32) -> usize {
    scene.faces.iter().filter(|face| face.surface.0 == surface).count()
}

/// Cuts a scene, and checks what always holds: areas add up, nothing overlaps, and corners that are meant to be one are one.
fn cut(mut scene: Scene, least: f64) -> (Scene, CutOut) {
    let before = total(&scene);
    let report = cut_out(&mut scene)
        .expect("no face coincides with another")
        .expect("overlaps");
    assert!((total(&scene) + report.area - before).abs() <= 1e-12 * before);
    assert_eq!(overlap::find(&scene), None);
    let least = least.max(1e-12);
    let used: BTreeSet<u32> = scene
        .faces
        .iter()
        .flat_map(|face| face.corners.as_slice().to_vec())
        .collect();
    let mut places: Vec<DVec3> = used.iter().map(|&v| scene.vertices[v as usize]).collect();
    places.sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
    for (k, place) in places.iter().enumerate() {
        let near = places[k + 1..].iter().take_while(|other| other.x - place.x <= least);
        for other in near {
            assert!(place.distance(*other) > least, "{place} and {other} are not one vertex");
        }
    }
    (scene, report)
}

fn assert_areas(scene: &Scene, expected: &[f64], relative: f64) {
    for (k, (area, right)) in areas(scene).iter().zip(expected).enumerate() {
        assert!(
            (area - right).abs() <= relative * right.max(1.0),
            "s{k}: {area}, not {right}"
        );
    }
}

const WALL: u32 = 0;

fn wall() -> Drawn {
    rectangle(WALL, [0.0, 5.0], [0.0, 3.0])
}

fn triangulated_wall() -> [Drawn; 2] {
    let (_, c) = wall();
    [(WALL, vec![c[0], c[1], c[2]]), (WALL, vec![c[0], c[2], c[3]])]
}

#[test]
fn a_door_and_windows_are_cut_out_of_their_wall() {
    let door = rectangle(1, [1.0, 2.0], [0.0, 2.0]);
    let window = rectangle(2, [3.0, 4.25], [1.0, 2.25]);
    let pane = rectangle(3, [1.25, 1.75], [1.0, 1.5]);
    let over_the_edge = rectangle(2, [4.5, 6.0], [1.0, 2.0]);
    let gable = (
        2,
        vec![DVec2::new(3.0, 1.0), DVec2::new(4.0, 1.0), DVec2::new(3.5, 2.0)],
    );
    for frame in frames() {
        for (name, drawn, expected, most) in [
            ("door", vec![door.clone()], vec![13.0, 2.0], 3),
            ("window", vec![window.clone()], vec![13.4375, 0.0, 1.5625], 4),
            (
                "both",
                vec![door.clone(), window.clone()],
                vec![11.4375, 2.0, 1.5625],
                7,
            ),
            ("pane", vec![door.clone(), pane.clone()], vec![13.0, 1.75, 0.0, 0.25], 3),
            ("over the edge", vec![over_the_edge.clone()], vec![14.5, 0.0, 1.5], 3),
            ("gable", vec![gable.clone()], vec![14.5, 0.0, 0.5], 6),
        ] {
            for order in 0..2 {
                let mut all = vec![wall()];
                all.extend(drawn.clone());
                if order == 1 {
                    all.reverse();
                }
                let (scene, report) = cut(scene(&all, frame), 0.0);
                assert_areas(&scene, &expected, 1e-12);
                assert!(
                    (3..=most).contains(&n_faces(&scene, WALL)),
                    "{name}: {}",
                    n_faces(&scene, WALL)
                );
                assert_eq!((report.count, report.covered), (drawn.len(), None), "{name}");
            }
            let mut all = triangulated_wall().to_vec();
            all.extend(drawn);
            let (scene, _) = cut(scene(&all, frame), 0.0);
            assert_areas(&scene, &expected, 1e-12);
        }
    }
}

#[test]
fn what_is_drawn_goes_before_what_it_is_drawn_on_however_that_is_cut() {
    // A carpet that is larger than each of the tiles below it, but not than the floor.
    let mut drawn = Vec::new();
    for (x, y) in (0..6).flat_map(|x| (0..6).map(move |y| (f64::from(x), f64::from(y)))) {
        drawn.push(rectangle(WALL, [x, x + 1.0], [y, y + 1.0]));
    }
    drawn.push(rectangle(1, [0.5, 4.5], [1.5, 3.0]));
    for frame in frames() {
        let (scene, report) = cut(scene(&drawn, frame), 0.0);
        assert_areas(&scene, &[30.0, 6.0], 1e-12);
        // Three tiles lie below it as a whole.
        let (_, n_covered) = report.covered.expect("tiles");
        assert_eq!((report.count, n_covered), (1, 3));
    }
}

#[test]
fn of_equal_faces_the_later_stays_whole() {
    let [left, right] = [[0.0, 2.0], [1.0, 3.0]].map(|x| rectangle(0, x, [0.0, 1.0]));
    for frame in frames() {
        for (first, second) in [(&left, &right), (&right, &left)] {
            let drawn = [(0, first.1.clone()), (1, second.1.clone())];
            let (exact, _) = cut(scene(&drawn, frame), 0.0);
            assert_areas(&exact, &[1.0, 2.0], 1e-12);
            let (six_decimals, _) = cut(rounded(scene(&drawn, frame), 6), 1e-6);
            assert_areas(&six_decimals, &[1.0, 2.0], 1e-5);
        }
    }
}

#[test]
fn coincident_faces_are_refused_and_sheets_stay() {
    let [lower, upper] = triangulated_wall();
    let (_, c) = wall();
    let other_halves = [(1, vec![c[0], c[1], c[3]]), (1, vec![c[1], c[2], c[3]])];
    let reversed: Vec<DVec2> = wall().1.into_iter().rev().collect();
    for frame in frames() {
        let again = (1, wall().1);
        let turned = (1, [&c[2..], &c[..2]].concat());
        for drawn in [
            vec![wall(), again],
            vec![wall(), turned],
            vec![lower.clone(), upper.clone(), (1, c.clone())],
            vec![
                lower.clone(),
                upper.clone(),
                other_halves[0].clone(),
                other_halves[1].clone(),
            ],
        ] {
            for places in [None, Some(6)] {
                let exact = scene(&drawn, frame);
                let mut scene = places.map_or(exact.clone(), |places| rounded(exact, places));
                assert!(matches!(cut_out(&mut scene), Err(Refused::Coincident(_))), "{drawn:?}");
            }
        }
        let door = (1, rectangle(1, [1.0, 2.0], [0.0, 2.0]).1.into_iter().rev().collect());
        let mut sheet = scene(&[wall(), (2, reversed.clone()), door], frame);
        // The door's winding is that of the back, which alone is cut.
        let report = cut_out(&mut sheet).expect("no face coincides with another");
        assert_eq!(report.map(|report| report.count), Some(1));
        assert_areas(&sheet, &[15.0, 2.0, 13.0], 1e-12);
        assert_eq!(n_faces(&sheet, WALL), 1);
    }
}

#[test]
fn rounded_coordinates_make_no_slivers() {
    for frame in &frames()[1..3] {
        let mut drawn = vec![wall(), rectangle(1, [0.5, 1.5], [0.0, 2.0])];
        let windows = (0..5).map(|k| 2.0 + 0.5 * f64::from(k));
        drawn.extend(windows.map(|x| rectangle(2, [x, x + 0.25], [1.0, 2.0])));
        for places in [5, 6, 9] {
            let unit = 10_f64.powi(-places);
            let scene = rounded(scene(&drawn, *frame), usize::try_from(places).expect("a few"));
            let (scene, report) = cut(scene, unit);
            assert_eq!(report.count, 6);
            assert_areas(&scene, &[11.75, 2.0, 1.25], 10.0 * unit);
            for face in scene
                .face_ids()
                .filter(|&face| scene.faces[face.0 as usize].surface.0 == WALL)
            {
                let corners = scene.polygon(face);
                let longest = corners
                    .iter()
                    .flat_map(|a| corners.iter().map(|b| a.distance(*b)))
                    .fold(0.0, f64::max);
                assert!(area_of(&scene, face) / longest > 0.05, "{places}: {corners:?}");
            }
        }
    }
}

/// A wall, whole or in triangles, with rectangles and triangles thrown on it that overlap at random: each point belongs to the smallest outline around it.
#[test]
fn every_point_belongs_to_the_smallest_face_around_it() {
    let inside = |corners: &[DVec2], p: DVec2| {
        let edges = (0..corners.len()).map(|k| [corners[k], corners[(k + 1) % corners.len()]]);
        let depths = edges.map(|[a, b]| (b - a).normalize().perp_dot(p - a));
        depths.fold(f64::INFINITY, f64::min)
    };
    let area = |corners: &[DVec2]| {
        let fan = corners[1..]
            .windows(2)
            .map(|w| (w[0] - corners[0]).perp_dot(w[1] - corners[0]));
        0.5 * fan.sum::<f64>()
    };
    for case in 0..60_u64 {
        let mut random = PointStream::new(Sequence::Sobol, case, 0);
        let n = 2 + case % 7;
        let mut drawn = if case % 3 == 0 {
            triangulated_wall().to_vec()
        } else {
            vec![wall()]
        };
        for surface in 1..=n {
            let [x, y, width, height] = random.next_point();
            let [turn, kind, ..] = random.next_point();
            let turn = if kind < 0.3 {
                DVec2::X
            } else {
                DVec2::from_angle(6.0 * turn)
            };
            let (middle, half) = (DVec2::new(5.0 * x, 3.0 * y), DVec2::new(0.1 + width, 0.1 + height));
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            let n_corners = if kind > 0.7 { 3 } else { 4 };
            let place = |corner: &[f64; 2]| middle + turn.rotate(half * DVec2::from_array(*corner));
            let surface = u32::try_from(surface).expect("a few");
            drawn.push((surface, corners[..n_corners].iter().map(place).collect()));
        }
        let (turn, shift) = frames()[usize::try_from(case % 4).expect("a few")];
        let (scene, _) = cut(scene(&drawn, (turn, shift)), 0.0);
        let flat = |face: FaceId| {
            let corners = scene
                .polygon(face)
                .into_iter()
                .map(|v| (turn.inverse() * (v - shift)).truncate());
            (scene.faces[face.0 as usize].surface.0, corners.collect::<Vec<_>>())
        };
        let faces: Vec<Drawn> = scene.face_ids().map(flat).collect();
        let mut whole = drawn[drawn.len() - usize::try_from(n).expect("a few")..].to_vec();
        whole.push(wall());
        whole.sort_by(|a, b| area(&a.1).total_cmp(&area(&b.1)));
        let mut n_seen = 0;
        for _ in 0..400 {
            let [x, y, ..] = random.next_point();
            let p = DVec2::new(7.0 * x - 1.0, 5.0 * y - 1.0);
            let expected = whole.iter().find(|(_, corners)| inside(corners, p) > 0.0);
            if whole
                .iter()
                .chain(&faces)
                .any(|(_, corners)| inside(corners, p).abs() < 1e-9)
            {
                continue;
            }
            let around: Vec<u32> = faces
                .iter()
                .filter(|(_, corners)| inside(corners, p) > 0.0)
                .map(|f| f.0)
                .collect();
            assert_eq!(
                around,
                expected.map(|f| f.0).into_iter().collect::<Vec<_>>(),
                "case {case}: {p}"
            );
            n_seen += 1;
        }
        assert!(n_seen > 350);
    }
}

#[test]
fn many_windows_leave_few_pieces() {
    let n = 100_u32;
    let mut drawn = vec![rectangle(WALL, [0.0, f64::from(n)], [0.0, f64::from(n)])];
    for (x, y) in (0..n).flat_map(|x| (0..n).map(move |y| (f64::from(x), f64::from(y)))) {
        drawn.push(rectangle(1, [x + 0.25, x + 0.75], [y + 0.25, y + 0.75]));
    }
    let (scene, report) = cut(scene(&drawn, frames()[1]), 0.0);
    let n_windows = drawn.len() - 1;
    assert_eq!(report.count, n_windows);
    assert_areas(&scene, &[7500.0, 2500.0], 1e-12);
    assert!(n_faces(&scene, WALL) <= 3 * n_windows + 1, "{}", n_faces(&scene, WALL));
}
