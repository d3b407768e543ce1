//! Doors and windows that are drawn on their walls, in rooms that are turned and written with few decimals.

use std::fmt::Write as _;

use glam::{DQuat, DVec3};
use radiosity::form_factor::ExactMethod;
use radiosity::scene::{Loaded, SceneWarningKind, load};

use crate::support::Uniform;
use crate::support::rooms::{Prepared, with_digits};

/// The walls of a room of 5 x 4 x 3 m: a corner, two edges from there whose product faces inwards, and their lengths.
const WALLS: [(DVec3, DVec3, DVec3, [f64; 2]); 6] = [
    (DVec3::ZERO, DVec3::X, DVec3::Y, [5.0, 4.0]),
    (DVec3::new(0.0, 4.0, 3.0), DVec3::X, DVec3::NEG_Y, [5.0, 4.0]),
    (DVec3::ZERO, DVec3::Y, DVec3::Z, [4.0, 3.0]),
    (DVec3::new(5.0, 4.0, 0.0), DVec3::NEG_Y, DVec3::Z, [4.0, 3.0]),
    (DVec3::ZERO, DVec3::Z, DVec3::X, [3.0, 5.0]),
    (DVec3::new(5.0, 4.0, 0.0), DVec3::Z, DVec3::NEG_X, [3.0, 5.0]),
];

/// What `exact` is asked for; its rows are better.
const TOLERANCE: f64 = 1e-2;

/// A rectangle on a wall, and how far it stands out of it.
type Drawn = (usize, [f64; 2], [f64; 2], f64);

/// A room whose faces are written one surface each: first the walls, then what is drawn on them, or the other way round.
struct Room {
    turn: DQuat,
    shift: DVec3,
    /// Whether walls, and what is drawn on them, are written as triangles.
    in_halves: [bool; 2],
    drawn_first: bool,
}

impl Room {
    /// Returns a room that is turned about the vertical, or any way.
    fn random(random: &mut Uniform, is_upright: bool) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * random.next();
        let turn = if is_upright {
            DQuat::from_rotation_z(between(0.1, 1.4))
        } else {
            DQuat::from_euler(
                glam::EulerRot::XYZ,
                between(0.1, 1.4),
                between(-1.2, -0.2),
                between(0.1, 6.0),
            )
        };
        Self {
            turn,
            shift: DVec3::from_array([(); 3].map(|()| between(-3.0, 3.0))),
            in_halves: [between(0.0, 1.0) < 0.4, between(0.0, 1.0) < 0.4],
            drawn_first: between(0.0, 1.0) < 0.5,
        }
    }

    fn load(&self, faces: &[(String, bool, Vec<[DVec3; 4]>)], number: &dyn Fn(f64) -> String) -> Loaded {
        let (mut vertices, mut groups, mut n) = (String::new(), String::new(), 0);
        for (name, in_halves, outlines) in faces {
            let _ = writeln!(groups, "o {name}");
            for outline in outlines {
                for v in outline.map(|v| self.turn * v + self.shift) {
                    let _ = writeln!(vertices, "v {} {} {}", number(v.x), number(v.y), number(v.z));
                }
                let [a, b, c, d] = [1, 2, 3, 4].map(|k| n + k);
                let _ = if *in_halves {
                    writeln!(groups, "f {a} {b} {c}\nf {a} {c} {d}")
                } else {
                    writeln!(groups, "f {a} {b} {c} {d}")
                };
                n += 4;
            }
        }
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("room.obj");
        std::fs::write(&path, vertices + &groups).unwrap();
        load(&path).unwrap()
    }

    /// Returns the room with its walls and what is drawn on them, as a file with such numbers has it.
    fn with(&self, drawn: &[Drawn], number: &dyn Fn(f64) -> String) -> Loaded {
        let of_walls = (0..6).map(|k| {
            let [width, height] = WALLS[k].3;
            let whole = outline(k, [0.0, width], [0.0, height], 0.0);
            (format!("wall{k}"), self.in_halves[0], vec![whole])
        });
        let of_drawn = drawn.iter().enumerate().map(|(k, &(wall, x, y, height))| {
            let outlines = vec![outline(wall, x, y, height)];
            (format!("drawn{k}"), self.in_halves[1], outlines)
        });
        let (of_walls, of_drawn) = (of_walls.collect::<Vec<_>>(), of_drawn.collect());
        let faces = if self.drawn_first {
            [of_drawn, of_walls]
        } else {
            [of_walls, of_drawn]
        };
        self.load(&faces.concat(), number)
    }
}

fn outline(wall: usize, x: [f64; 2], y: [f64; 2], height: f64) -> [DVec3; 4] {
    let (origin, along, up, _) = WALLS[wall];
    let corner = |i: usize, j: usize| origin + x[i] * along + y[j] * up + height * along.cross(up);
    [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
}

/// A name, what is drawn, and the areas that are left of surfaces, in m².
type Case = (&'static str, Vec<Drawn>, &'static [(&'static str, f64)]);

/// How numbers are written.
type Number = Box<dyn Fn(f64) -> String>;

/// The ways in which numbers are written, with the unit of a coordinate below 10 m.
fn formats() -> Vec<(String, f64, Number)> {
    let by_places = [2, 3, 4, 6, 9, 15].map(|places: i32| {
        let digits = usize::try_from(places).unwrap();
        let number: Number = Box::new(move |x| format!("{x:.digits$}"));
        (format!("{places} decimals"), 10.0_f64.powi(-places), number)
    });
    let mut all = Vec::from(by_places);
    all.push(("%.6g".to_owned(), 1e-5, Box::new(|x| with_digits(6, x))));
    all
}

/// The number of faces that are drawn on others, and the area that these lost.
fn cut(loaded: &Loaded) -> Option<(usize, f64)> {
    loaded.warnings.iter().find_map(|warning| match warning.kind {
        SceneWarningKind::CutFaces { count, area, .. } => Some((count, area)),
        _ => None,
    })
}

/// Checks the areas of surfaces, and that the rows of their form factors sum to 1, but for what corners that are off by a unit change at the border.
fn check(loaded: Loaded, expected: &[(&str, f64)], unit: f64, case: &str) {
    let scene = loaded.scene;
    let mut areas = vec![0.0; scene.surfaces.len()];
    for (id, face) in scene.face_ids().zip(&scene.faces) {
        areas[face.surface.0 as usize] += scene.area_vector(id).length();
    }
    for (name, right) in expected {
        let k = scene.surfaces.iter().position(|surface| surface.name == *name).unwrap();
        let border = 4.0 + 4.0 * right.sqrt();
        assert!(
            (areas[k] - right).abs() <= unit * border + 1e-12,
            "{case}: {name} has {} m², not {right}",
            areas[k]
        );
    }
    let method = ExactMethod {
        tolerance: TOLERANCE,
        ..ExactMethod::default()
    };
    let room = Prepared::new(scene, 1);
    let computed = room.try_compute(&method).unwrap();
    let factors = room.by_surface(&computed.factors);
    for (k, area) in areas.iter().enumerate() {
        let sum: f64 = (0..areas.len())
            .map(|other| factors.form_factor[k * areas.len() + other])
            .sum();
        let most = 0.2 * TOLERANCE + 4.0 * unit / area.sqrt().min(1.0);
        assert!(
            (sum - 1.0).abs() <= most,
            "{case}: row of {} is {sum}",
            room.scene.surfaces[k].name
        );
    }
}

/// Pieces of a wall end at the corners of a door that is tilted out of it: what stands in between is then in front of one and behind another.
#[test]
fn a_door_that_moves_the_corners_of_its_wall_is_told_how_far() {
    let moved = |height: f64| {
        let wall = "v 0 0 0\nv 5 0 0\nv 5 3 0\nv 0 3 0\no wall\nf 1 2 3 4\n";
        let door = format!("v 1 0 0\nv 2 0 0\nv 2 2 {height:e}\nv 1 2 {height:e}\no door\nf 5 6 7 8\n");
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("scene.obj");
        std::fs::write(&path, format!("{wall}{door}")).unwrap();
        let warnings = load(&path).unwrap().warnings;
        let of_cut = |kind: &SceneWarningKind| match kind {
            SceneWarningKind::CutFaces { moved, .. } => Some((*moved, kind.to_string())),
            _ => None,
        };
        warnings.iter().find_map(|warning| of_cut(&warning.kind)).unwrap()
    };
    let (tilted, message) = moved(1e-9);
    assert!((tilted - 1e-9).abs() < 1e-15 && message.ends_with("corners move by 1.0e-9 m, which errors leave out"));
    let (flat, short) = moved(0.0);
    assert!(flat <= 0.0 && short.ends_with("m² in all"));
}

#[test]
fn rooms_with_doors_and_windows_are_closed_whatever_the_decimals() {
    let door: Drawn = (2, [1.0, 2.0], [0.0, 2.0], 0.0);
    let pane: Drawn = (2, [1.25, 1.75], [1.0, 1.5], 0.0);
    let over_the_door: Drawn = (2, [1.5, 2.8], [1.0, 1.9], 0.0);
    let as_large: Drawn = (2, [1.5, 2.5], [0.5, 2.5], 0.0);
    let in_the_corner: Drawn = (5, [2.0, 3.0], [0.0, 1.0], 0.0);
    let across: Drawn = (4, [1.0, 2.0], [0.0, 5.0], 0.0);
    let small: Drawn = (3, [2.0, 2.3], [2.0, 2.2], 0.0);
    let lamp: Drawn = (1, [2.0, 2.6], [1.5, 2.1], 0.0);
    let carpet: Drawn = (0, [1.0, 4.0], [1.0, 3.5], 0.0);
    let cases: [Case; 6] = [
        ("door", vec![door], &[("wall2", 10.0), ("drawn0", 2.0)]),
        (
            "pane",
            vec![door, pane],
            &[("wall2", 10.0), ("drawn0", 1.75), ("drawn1", 0.25)],
        ),
        (
            "two",
            vec![door, over_the_door],
            &[("wall2", 9.28), ("drawn0", 1.55), ("drawn1", 1.17)],
        ),
        (
            "as large",
            vec![door, as_large],
            &[("wall2", 8.75), ("drawn0", 1.25), ("drawn1", 2.0)],
        ),
        (
            "at edges",
            vec![in_the_corner, across],
            &[("wall5", 14.0), ("wall4", 10.0), ("drawn0", 1.0), ("drawn1", 5.0)],
        ),
        (
            "on all walls",
            vec![small, lamp, carpet],
            &[("wall3", 11.94), ("wall1", 19.64), ("wall0", 12.5), ("drawn2", 7.5)],
        ),
    ];
    let mut random = Uniform(1);
    for (format, unit, number) in &formats() {
        for (name, drawn, expected) in &cases {
            for is_upright in [true, false] {
                let mut room = Room::random(&mut random, is_upright);
                // Of equal areas the later counts.
                room.drawn_first &= *name != "as large";
                let loaded = room.with(drawn, number);
                let case = format!("{name}, {format}, upright: {is_upright}, halves: {:?}", room.in_halves);
                let (count, lost) = cut(&loaded).unwrap_or_else(|| panic!("{case}: nothing is cut"));
                assert_eq!(count, drawn.len() * if room.in_halves[1] { 2 } else { 1 }, "{case}");
                let all: f64 = drawn.iter().map(|(_, x, y, _)| (x[1] - x[0]) * (y[1] - y[0])).sum();
                assert!(
                    (lost - all).abs() <= 12.0 * unit * drawn.len() as f64 + 1e-12,
                    "{case}: {lost}"
                );
                check(loaded, expected, *unit, &case);
            }
        }
    }
}

/// What stands out by more than two roundings of a corner is not drawn, nor are tiles whose edges meet.
#[test]
fn what_is_apart_or_beside_is_not_drawn() {
    let mut random = Uniform(2);
    for (format, unit, number) in &formats()[..3] {
        for is_upright in [true, false, true, false, false] {
            let room = Room::random(&mut random, is_upright);
            for height in [3.5 * unit, 5.0 * unit, 0.02 + 3.5 * unit] {
                let drawn = [(2, [1.0, 2.0], [0.5, 2.0], height), (3, [1.0, 2.2], [1.0, 2.0], height)];
                assert_eq!(cut(&room.with(&drawn, number)), None, "{format} {height}");
            }
            let mut tiles = |wall: usize| {
                let [width, height] = WALLS[wall].3;
                let [x, y, z] = [(); 3].map(|()| 0.1 + 0.8 * random.next());
                let (x, y, z) = (x * width, y * height, z * height);
                let parts = [
                    ([0.0, x], [0.0, y]),
                    ([0.0, x], [y, height]),
                    ([x, width], [0.0, z]),
                    ([x, width], [z, height]),
                ];
                let outlines = parts.map(|(across, up)| outline(wall, across, up, 0.0));
                (format!("wall{wall}"), room.in_halves[0], outlines.to_vec())
            };
            let faces: Vec<_> = (0..6).map(&mut tiles).collect();
            assert_eq!(cut(&room.load(&faces, number)), None, "tiles, {format}");
        }
    }
}
