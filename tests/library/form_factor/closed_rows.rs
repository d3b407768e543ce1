//! The rows that are known to sum to 1: rooms with objects in them, beside them, and with inverted normals.

#![expect(clippy::shadow_unrelated, reason = "a scene in its places is still that scene")]

use glam::{DQuat, DVec3};
use radiosity::audit::{Claims, Repair, doubted_rows};
use radiosity::form_factor::{ExactMethod, FormFactorMethod as _, closed_rows};
use radiosity::matrix::{Closed, FormFactors, RowTile, StorageChoice};
use radiosity::report::form_factors::FormFactorReport;
use radiosity::scene::topology::{Enclosure, is_watertight};
use radiosity::scene::{Corners, FaceId, Scene, builtin, write_obj};

use crate::program::{document, radiosity, stderr};
use crate::support::rooms::{Prepared, Shapes, moved, with_decimals, written_as};
use crate::support::{Uniform, n_cases};

/// A room of 4 m × 4 m × 3 m: faces 0 to 5.
fn room() -> Shapes {
    let mut shapes = Shapes::default();
    cube(&mut shapes, [0.0, 0.0, 0.0], [4.0, 4.0, 3.0], true);
    shapes
}

fn cube(shapes: &mut Shapes, low: [f64; 3], high: [f64; 3], inwards: bool) {
    shapes.cuboid(low.into(), high.into(), DQuat::IDENTITY, inwards);
}

fn room_with_a_turned_box() -> Scene {
    let mut shapes = room();
    cube(&mut shapes, [0.5, 0.5, 0.5], [1.5, 1.5, 1.5], true);
    shapes.scene()
}

/// An L-shaped room of 10 faces, and a box in its notch: outside of the room, but in the box around it.
fn l_shaped_room(with_box: bool) -> Scene {
    let outline = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0], [2.0, 4.0], [0.0, 4.0]];
    let at = |k: usize, z: f64| DVec3::new(outline[k % 6][0], outline[k % 6][1], z);
    let mut shapes = Shapes::default();
    for k in 0..6 {
        shapes.face(&[at(k, 3.0), at(k + 1, 3.0), at(k + 1, 0.0), at(k, 0.0)]);
    }
    for (z, up) in [(0.0, true), (3.0, false)] {
        for part in [[0, 1, 2, 3], [0, 3, 4, 5]] {
            let mut corners = part.map(|k| at(k, z));
            if !up {
                corners.reverse();
            }
            shapes.face(&corners);
        }
    }
    if with_box {
        cube(&mut shapes, [2.5, 2.5, 1.0], [2.9, 3.5, 2.0], false);
    }
    shapes.scene()
}

/// The same scene elsewhere: turned, far from the origin and large.
fn places(scene: &Scene) -> [Scene; 4] {
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    [
        scene.clone(),
        moved(scene, turn, 1.0, DVec3::ZERO),
        moved(scene, DQuat::IDENTITY, 1.0, DVec3::new(5e5, 5.4e6, 100.0)),
        moved(scene, turn.inverse(), 1e4, DVec3::ONE),
    ]
}

/// Asserts of a scene in several places which faces' rows are closed.
#[track_caller]
fn assert_rows(name: &str, scene: &Scene, watertight: bool, turned: &[u32], is_closed: impl Fn(usize) -> bool) {
    for (place, scene) in places(scene).into_iter().enumerate() {
        let expected = Enclosure {
            watertight,
            turned: turned.iter().map(|&face| FaceId(face)).collect(),
        };
        assert_eq!(Enclosure::of(&scene), expected, "{name} {place}");
        assert_eq!(is_watertight(&scene), watertight, "{name} {place}");
        let prepared = Prepared::new(scene, 3);
        for (patch, closed) in prepared.mesh.patches.iter().zip(closed_rows(prepared.input())) {
            let face = patch.face.0 as usize;
            // Askew, the boxes around patches overlap where the patches do not, and less is known.
            let may_miss = place % 2 == 1;
            assert!(
                closed == is_closed(face) || (may_miss && !closed),
                "{name} {place}: a patch of face {face}"
            );
        }
    }
}

#[test]
fn rows_are_closed_in_rooms_with_objects_that_face_outwards() {
    assert_rows("a room", &room().scene(), true, &[], |_| true);
    assert_rows("an L", &l_shaped_room(false), true, &[], |_| true);
    let mut shapes = room();
    cube(&mut shapes, [0.5, 0.5, 0.5], [1.5, 1.5, 1.5], false);
    cube(&mut shapes, [2.5, 0.5, 0.5], [3.0, 1.5, 1.5], false);
    shapes.ball(DVec3::new(2.5, 2.5, 2.0), 0.4, 1);
    assert_rows("boxes and a ball", &shapes.scene(), true, &[], |_| true);
    // A cell within a block within a room, and a block within that.
    let mut shapes = room();
    cube(&mut shapes, [0.5, 0.5, 0.5], [3.5, 3.5, 2.5], false);
    cube(&mut shapes, [1.0, 1.0, 1.0], [3.0, 3.0, 2.0], true);
    cube(&mut shapes, [1.5, 1.5, 1.2], [2.5, 2.5, 1.8], false);
    assert_rows("rooms in rooms", &shapes.scene(), true, &[], |_| true);
    let sheet = [[1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [3.0, 3.0, 1.0], [1.0, 3.0, 1.0]].map(DVec3::from);
    let mut shapes = room();
    shapes.face(&sheet);
    shapes.face(&[sheet[3], sheet[2], sheet[1], sheet[0]]);
    assert_rows("a sheet", &shapes.scene(), true, &[], |_| true);
}

#[test]
fn rows_that_meet_backs_or_the_open_are_not_closed() {
    assert_rows("a turned box", &room_with_a_turned_box(), true, &[6], |face| face >= 6);
    assert_rows("a box in the notch", &l_shaped_room(true), false, &[], |face| face < 10);
    let mut shapes = Shapes::default();
    cube(&mut shapes, [-1.0; 3], [5.0, 5.0, 4.0], false);
    cube(&mut shapes, [0.0; 3], [4.0, 4.0, 3.0], true);
    assert_rows("a house", &shapes.scene(), false, &[], |face| face >= 6);
    let mut shapes = Shapes::default();
    cube(&mut shapes, [0.0; 3], [4.0, 4.0, 3.0], false);
    cube(&mut shapes, [0.5; 3], [1.5; 3], false);
    assert_rows("a block in a block", &shapes.scene(), false, &[], |_| false);
    let mut shapes = room();
    cube(&mut shapes, [1.0; 3], [2.0; 3], false);
    cube(&mut shapes, [1.2; 3], [1.8; 3], false);
    assert_rows("a block in a block in a room", &shapes.scene(), true, &[], |face| {
        face < 12
    });
}

#[test]
fn builtin_scenes_have_no_turned_pieces() {
    for name in builtin::names() {
        let scene = builtin::build(name, None).unwrap().scene;
        assert_eq!(Enclosure::of(&scene).turned, [], "{name}");
    }
}

#[test]
fn rows_that_are_claimed_closed_and_are_not_are_doubted() {
    let prepared = Prepared::new(room_with_a_turned_box(), 2);
    let factors = prepared.compute(&ExactMethod::default());
    let claims = Claims {
        closed: Closed::Everywhere(true),
        may_escape: &[],
        reciprocity: ExactMethod::default().reciprocity(),
        errors_known: true,
        repair: Repair::Not,
        by_rule: false,
    };
    let doubted = doubted_rows(&factors, claims).unwrap();
    for (i, patch) in prepared.mesh.patches.iter().enumerate() {
        let is_short = factors.row_sum(i) < 1.0 - 1e-4;
        assert_eq!(doubted[i], is_short, "{i}: {}", factors.row_sum(i));
        assert!(patch.face.0 < 6 || !is_short);
    }
    assert!(doubted.contains(&true));
    let open = Claims {
        closed: Closed::Everywhere(false),
        ..claims
    };
    assert!(!doubted_rows(&factors, open).unwrap().contains(&true));
}

#[test]
fn balancing_leaves_what_is_not_known_and_the_turned_box_is_named() {
    let directory = tempfile::tempdir().unwrap();
    for (name, scene) in [("turned", room_with_a_turned_box()), ("notch", l_shaped_room(true))] {
        let file = format!("{name}.obj");
        write_obj(&scene, directory.path().join(&file)).unwrap();
        let factors = |balance: &str| {
            let (code, document) = document(
                directory.path(),
                &["form-factors", &file, "--balance", balance, "--strict"],
            );
            assert_eq!(code, 0, "{name} {balance}");
            document
        };
        let (off, on) = (factors("off"), factors("on"));
        let value = |of: &serde_json::Value, i: usize, j: usize| of["surface_form_factor"][i][j].as_f64().unwrap();
        let n = scene.surfaces.len();
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let moved = (value(&on, i, j) - value(&off, i, j)).abs();
            assert!(moved < 1e-6, "{name} {i} {j}: {moved:e}");
        }
    }
    let output = radiosity(directory.path(), &["form-factors", "turned.obj"]);
    let text = stderr(&output);
    assert!(
        text.contains("turned.obj:") && text.contains("`face6`") && text.contains("its normals point inwards"),
        "{text}"
    );
}

/// Nothing makes rows that sum to 3 in a closed room right, whether they state an error or not.
#[test]
fn rows_beyond_all_error_are_not_scaled_to_1() {
    let directory = tempfile::tempdir().unwrap();
    let scene = builtin::build("cube", None).unwrap().scene;
    write_obj(&scene, directory.path().join("scene.obj")).unwrap();
    let prepared = Prepared::new(scene, 2);
    for (method, name) in [("exact", "F.mtx"), ("exact", "F.npy"), ("sr", "F.npz")] {
        let right = prepared.compute(&*crate::support::rooms::quick(method, 1));
        for (times, is_wrong) in [(1.0, false), (3.0, true), (0.5, true)] {
            let mut tile = RowTile::new(0);
            for i in 0..right.n_rows() {
                let mut entries = Vec::new();
                right.for_each_in_row(i, |j, value, error| {
                    entries.push((u32::try_from(j).unwrap(), times * value, error));
                });
                tile.push_row(&entries, right.tallies()[i]);
            }
            let areas = right.areas().to_vec();
            let factors = FormFactors::from_tiles(areas, [tile], StorageChoice::default()).unwrap();
            let settings = serde_json::json!({"subdivide": 2, "method": method});
            let report = FormFactorReport {
                scene: &prepared.scene,
                mesh: &prepared.mesh,
                factors: &factors,
                tolerance_met: true,
                pairs: None,
                sky: None,
                settings: settings.as_object().unwrap(),
                surface: None,
                is_closed: true,
                dense: false,
            };
            report.write(&directory.path().join(name)).unwrap();
            let solve = ["solve", "scene.obj", "--form-factors", name, "--balance", "on"];
            let (_, document) = document(directory.path(), &solve);
            let warnings = document["warnings"].as_array().unwrap();
            let is_told = warnings
                .iter()
                .any(|text| text.as_str().unwrap().contains("not repaired"));
            assert_eq!(is_told, is_wrong, "{name} {times}: {warnings:?}");
            for end in ["min", "max"] {
                let sum = document["form_factors"]["row_sum"][end].as_f64().unwrap();
                assert!((sum - times).abs() < 0.05, "{name} {times}: {sum}");
            }
        }
    }
}

/// A closed white room has no finite solution, and form factors that lose a little of its light by their errors do not give it one.
#[test]
fn a_closed_white_room_is_refused_however_inexact_its_form_factors_are() {
    let directory = tempfile::tempdir().unwrap();
    let mut shapes = room();
    cube(&mut shapes, [0.5, 0.7, 0.4], [1.5, 1.4, 1.3], false);
    cube(&mut shapes, [2.5, 2.2, 1.4], [3.1, 3.4, 2.3], false);
    let scene = shapes.scene();
    write_obj(&scene, directory.path().join("scene.obj")).unwrap();
    let white = scene.surfaces.iter().map(|surface| {
        let name = &surface.name;
        format!("[surface.{name}]\nreflectance = 1.0\nexitance = 1.0\n")
    });
    std::fs::write(directory.path().join("white.toml"), white.collect::<String>()).unwrap();
    let solve = ["solve", "scene.obj", "--lighting", "white.toml", "--method"];
    for more in [
        &["qmc"][..],
        &["qmc", "--balance", "on"],
        &["gauss-lambert", "--points", "2"],
    ] {
        let (code, document) = document(directory.path(), &[&solve[..], more].concat());
        let message = document["error"]["message"].as_str().unwrap_or_default();
        assert!(
            code == 1 && message.contains("no finite solution"),
            "{more:?}: {document}"
        );
    }
}

/// Appends a flat rectangle, cut at random into smaller ones whose edges do not meet end to end.
fn tiles(shapes: &mut Shapes, [corner, u, v]: [DVec3; 3], depth: u32, random: &mut impl FnMut() -> f64) {
    if depth == 0 {
        return shapes.face(&[corner, corner + u, corner + u + v, corner + v]);
    }
    let part = 0.25 + 0.5 * random();
    let halves = if random() < 0.5 {
        [[corner, part * u, v], [corner + part * u, (1.0 - part) * u, v]]
    } else {
        [[corner, u, part * v], [corner + part * v, u, (1.0 - part) * v]]
    };
    for half in halves {
        tiles(shapes, half, depth - 1, random);
    }
}

/// A room of 4 m × 3 m × 2 m whose walls are cut each in its own way, so that faces meet in T-junctions and corners are off each other by rounding.
fn tiled_room(seed: u64) -> Scene {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut random = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let [x, y, z] = [4.0 * DVec3::X, 3.0 * DVec3::Y, 2.0 * DVec3::Z];
    let all = x + y + z;
    let mut shapes = Shapes::default();
    for wall in [
        [DVec3::ZERO, x, y],
        [DVec3::ZERO, y, z],
        [DVec3::ZERO, z, x],
        [all, -y, -x],
        [all, -z, -y],
        [all, -x, -z],
    ] {
        tiles(&mut shapes, wall, 3, &mut random);
    }
    shapes.scene()
}

/// Returns the scene without a face.
fn without(scene: &Scene, face: usize) -> Scene {
    let mut less = scene.clone();
    less.faces.remove(face);
    less
}

/// Returns the scene with a face wound the other way.
fn with_turned(scene: &Scene, face: usize) -> Scene {
    let mut other = scene.clone();
    other.faces[face].corners = match other.faces[face].corners {
        Corners::Triangle([a, b, c]) => Corners::Triangle([a, c, b]),
        Corners::Quad([a, b, c, d]) => Corners::Quad([a, d, c, b]),
    };
    other
}

/// Returns the scene with a gap of so much of its size, about, around a face.
fn with_a_gap(scene: &Scene, face: usize, gap: f64) -> Scene {
    let mut gaping = scene.clone();
    let corners = scene.polygon(FaceId(u32::try_from(face).unwrap()));
    let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let first = u32::try_from(gaping.vertices.len()).unwrap();
    gaping.vertices.extend(corners.iter().map(|v| v.lerp(middle, gap)));
    gaping.faces[face].corners = Corners::Quad([0, 1, 2, 3].map(|corner| first + corner));
    gaping
}

fn all_closed(scene: Scene) -> bool {
    let prepared = Prepared::new(scene, 2);
    let rows = closed_rows(prepared.input());
    let is_closed = is_watertight(&prepared.scene);
    assert!(is_closed || !rows.contains(&true));
    is_closed && !rows.contains(&false)
}

#[test]
fn rooms_whose_faces_meet_in_t_junctions_are_closed() {
    for seed in 1..20 {
        let room = tiled_room(seed);
        for (place, scene) in places(&room).into_iter().enumerate() {
            assert!(all_closed(scene), "{seed} {place}");
        }
        let turn = DQuat::from_axis_angle(DVec3::new(2.0, 1.0, 2.0) / 3.0, 0.1 + seed as f64);
        let rounded = with_decimals(6, &moved(&room, turn, 1.0, DVec3::new(20.0, 3.0, -7.0)));
        assert!(all_closed(rounded), "{seed}: with six decimals");
        let k = usize::try_from(seed).unwrap() % room.faces.len();
        assert!(
            !is_watertight(&without(&room, k)) && !is_watertight(&with_turned(&room, k)),
            "{seed}"
        );
        // A gap around a tile that is wider than rounding opens the room.
        let gaping = with_a_gap(&room, k, 1e-6);
        assert!(!is_watertight(&gaping), "{seed}: a gap");
    }
}

/// Walls of an L-shaped room, and tiles of a room of many, that end so far from the others as coordinates do that were computed: they are closed, and what little leaves is stated.
#[test]
fn rooms_whose_faces_miss_by_a_rounding_error_are_closed() {
    let directory = tempfile::tempdir().unwrap();
    let rooms: Vec<Scene> = [1e-13, 1e-11, 1e-10]
        .into_iter()
        .flat_map(|gap| {
            let raised = (0..6).map(move |k| {
                let mut scene = l_shaped_room(false);
                for corner in scene.faces[k].corners.as_slice().to_vec() {
                    let own = scene.vertices[corner as usize] + 10.0 * gap * DVec3::Z;
                    scene.vertices.push(own);
                    let new = u32::try_from(scene.vertices.len()).unwrap() - 1;
                    if own.z < 1.0 {
                        let Corners::Quad(corners) = &mut scene.faces[k].corners else {
                            panic!("a quad");
                        };
                        corners.iter_mut().filter(|v| **v == corner).for_each(|v| *v = new);
                    }
                }
                scene
            });
            let tiled = (1..6).map(move |seed| {
                let room = tiled_room(seed);
                let k = 7 * usize::try_from(seed).unwrap() % room.faces.len();
                with_a_gap(&room, k, gap)
            });
            raised.chain(tiled).collect::<Vec<_>>()
        })
        .collect();
    for (k, room) in rooms.iter().enumerate() {
        for (place, scene) in places(room).into_iter().enumerate() {
            assert!(all_closed(scene), "{k} {place}");
        }
    }
    for (k, room) in rooms.iter().enumerate().skip(1).step_by(n_cases(8, 4)) {
        let file = format!("{k}.obj");
        write_obj(room, directory.path().join(&file)).unwrap();
        for more in [
            &[][..],
            &["--balance", "closure"],
            &["--method", "sr", "--balance", "closure"],
            &["--method", "hemicube"],
        ] {
            let arguments = [&["form-factors", &file, "--strict"], more].concat();
            let (code, found) = document(directory.path(), &arguments);
            assert!(code == 0 && found["closed"] == true, "{k} {more:?}: {found}");
            assert_eq!(found["warnings"], serde_json::json!([]), "{k} {more:?}");
            assert!(found["closure_error_max"].is_number(), "{k} {more:?}");
        }
        let [open, closed] =
            ["--open", "--closed"].map(|flag| document(directory.path(), &["form-factors", &file, flag]).1);
        expect_sky_within_its_error(&open, &closed);
    }
}

/// Nothing escapes from a scene that is closed, but for what the error says; what its rows miss of 1 shows how much may.
#[track_caller]
fn expect_sky_within_its_error(open: &serde_json::Value, closed: &serde_json::Value) {
    let numbers = |of: &serde_json::Value, name: &str| -> Vec<f64> {
        let all = of[name].as_array().unwrap().iter();
        all.map(|x| x.as_f64().unwrap()).collect()
    };
    let (sky, error) = (numbers(open, "sky_factor"), numbers(open, "sky_factor_error"));
    let stated = numbers(closed, "sky_factor_error");
    assert!(numbers(closed, "sky_factor").iter().all(|x| x.to_bits() == 0));
    for k in 0..sky.len() {
        assert!(
            stated[k] + error[k] >= sky[k] && stated[k] <= 2.0 * sky[k] + 2.0 * error[k] + 1e-12,
            "{k}: {:e}, stated {:e}",
            sky[k],
            stated[k]
        );
    }
}

/// Where a user says that a scene is closed, its rows may miss of 1 what rays do not rule out: an error, no broken law.
#[test]
fn what_leaves_a_room_that_is_stated_to_be_closed_is_its_error() {
    let directory = tempfile::tempdir().unwrap();
    let gaps = [(5, 1e-4), (2, 1e-7), (3, 1e-6), (4, 1e-5)];
    for &(seed, gap) in &gaps[..n_cases(2, gaps.len())] {
        let room = tiled_room(seed);
        write_obj(&with_a_gap(&room, 11, gap), directory.path().join("scene.obj")).unwrap();
        for method in ["exact", "sr", "hemicube", "sg5"] {
            let run = |flag: &str| {
                document(
                    directory.path(),
                    &["form-factors", "scene.obj", "--strict", "--method", method, flag],
                )
            };
            let [(_, open), (code, closed)] = ["--open", "--closed"].map(run);
            assert!(code == 0 && closed["closed"] == true, "{gap:e} {method}: {closed}");
            if method == "exact" {
                expect_sky_within_its_error(&open, &closed);
                // A narrower slit is below what rows are known to.
                assert!(
                    gap < 1e-5 || open["sky_factor"][11].as_f64().unwrap() > 0.0,
                    "{gap:e}: {open}"
                );
            }
        }
    }
}

#[test]
fn edges_of_more_than_two_faces_do_not_open_a_room() {
    // Two blocks along one edge, and two at a corner.
    let mut shapes = room();
    cube(&mut shapes, [0.5; 3], [1.5; 3], false);
    cube(&mut shapes, [1.5, 1.5, 0.5], [2.5, 2.5, 1.5], false);
    cube(&mut shapes, [2.5, 2.5, 1.5], [3.0, 3.0, 2.0], false);
    assert!(all_closed(shapes.scene()));
    // Half-rooms whose floors, walls and ceilings end at a partition of two sides, or of one.
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let partition = [
        at(2.0, 0.0, 0.0),
        at(2.0, 3.0, 0.0),
        at(2.0, 3.0, 2.5),
        at(2.0, 0.0, 2.5),
    ];
    let half_rooms = || {
        let mut shapes = Shapes::default();
        for (low, skipped) in [(0.0, 1), (2.0, 0)] {
            let mut whole = Shapes::default();
            whole.cuboid(at(low, 0.0, 0.0), at(low + 2.0, 3.0, 2.5), DQuat::IDENTITY, true);
            let whole = whole.scene();
            for face in whole.face_ids().filter(|face| face.0 != skipped) {
                shapes.face(&whole.polygon(face));
            }
        }
        shapes
    };
    assert!(all_closed(half_rooms().scene()));
    let mut two_sided = half_rooms();
    two_sided.face(&partition);
    two_sided.face(&[partition[3], partition[2], partition[1], partition[0]]);
    assert!(all_closed(two_sided.scene()));
    let mut one_sided = half_rooms();
    one_sided.face(&partition);
    let prepared = Prepared::new(one_sided.scene(), 2);
    assert!(is_watertight(&prepared.scene));
    // It faces to higher x: what lies there sees its front, and the other half its back.
    let closed = closed_rows(prepared.input());
    for (patch, closed) in prepared.mesh.patches.iter().zip(closed) {
        assert!(
            !(closed && patch.centroid.x < 2.0),
            "a back is seen from {}",
            patch.centroid
        );
    }
}

/// A block as wide as the room covers a part of its floor and of three walls, with edges in common: what lies under it sees its inside.
#[test]
fn a_block_that_shares_edges_with_the_room_does_not_close_what_it_covers() {
    let mut shapes = room();
    cube(&mut shapes, [0.0; 3], [4.0, 1.0, 1.0], false);
    let scene = shapes.scene();
    assert!(is_watertight(&scene));
    let prepared = Prepared::new(scene, 1);
    let factors = prepared.compute(&ExactMethod::default());
    for (i, closed) in closed_rows(prepared.input()).into_iter().enumerate() {
        assert!(
            !closed || (factors.row_sum(i) - 1.0).abs() < 1e-5,
            "{i}: {}",
            factors.row_sum(i)
        );
    }
}

#[test]
fn sheets_in_a_room_do_not_open_it_and_their_backs_count() {
    let mut shapes = room();
    shapes.face(&[[1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [3.0, 3.0, 1.5], [1.0, 3.0, 1.5]].map(DVec3::from));
    for (place, scene) in places(&shapes.scene()).into_iter().enumerate() {
        assert!(is_watertight(&scene), "{place}");
        assert!(!closed_rows(Prepared::new(scene, 2).input()).contains(&true), "{place}");
    }
    // One that pierces a wall lets no light out, and shows its back on either side.
    let mut shapes = room();
    shapes.face(&[[3.0, 1.0, 1.0], [5.0, 1.0, 1.0], [5.0, 3.0, 1.0], [3.0, 3.0, 1.0]].map(DVec3::from));
    let scene = shapes.scene();
    assert!(!is_watertight(&scene), "light leaves it outside");
    assert!(!closed_rows(Prepared::new(scene, 2).input()).contains(&true));
}

/// A T-junction room in a file, and what flags say of it, and of one with a hole.
/// Corners of the two sides that were computed in different ways are some ulps apart: the sides then cross, or face each other across next to nothing.
#[test]
fn the_sides_of_a_sheet_see_the_room_and_not_each_other() {
    for seed in 0..24 {
        let mut random = Uniform(seed);
        let axis = DVec3::new(random.next() - 0.5, random.next() - 0.5, random.next() - 0.5);
        let turn = DQuat::from_axis_angle(axis.normalize(), random.between(0.0, 3.0));
        let (most, middle) = (random.scale(1e-16, 1e-12), DVec3::new(3.0, 2.5, 2.0));
        let sheet = [[2.0, 1.0, 1.0], [2.5, 4.0, 1.0], [2.5, 4.0, 3.0], [2.0, 1.0, 3.0]].map(DVec3::from);
        let mut side = |reversed: bool| {
            let mut corners = sheet.map(|v| {
                let off = DVec3::new(random.next() - 0.5, random.next() - 0.5, random.next() - 0.5);
                middle + turn * (v - middle) + 12.0 * most * off
            });
            if reversed {
                corners.reverse();
            }
            corners
        };
        let sides = [side(false), side(true)];
        let mut shapes = Shapes::default();
        shapes.cuboid(DVec3::ZERO, 2.0 * middle, turn, true);
        for corners in &sides {
            shapes.face(corners);
        }
        let scene = shapes.scene();
        for places in [2, 3, 6] {
            // Where it is bent beyond a millionth, each side is two triangles.
            let turned = Enclosure::of(&written_as(|x| format!("{x:.places$}"), &scene)).turned;
            assert!(turned.is_empty(), "seed {seed}, {places} decimals: {turned:?}");
        }
        let found = Prepared::new(scene, 1).compute(&ExactMethod::default());
        for i in 0..8 {
            let (sum, stated) = (0..8).fold((0.0, 0.0), |(sum, stated), j| {
                (sum + found.get(i, j), stated + found.std_error(i, j))
            });
            assert!(
                (sum - 1.0).abs() <= stated + 1e-9,
                "seed {seed} {most:e}: row {i}: {sum} {stated:e}"
            );
        }
        assert!(found.get(6, 7) < 1e-12, "seed {seed} {most:e}: {}", found.get(6, 7));
    }
}

#[test]
fn a_user_may_say_that_a_room_is_closed_or_open() {
    let directory = tempfile::tempdir().unwrap();
    let room = tiled_room(5);
    write_obj(&room, directory.path().join("room.obj")).unwrap();
    let k = 11;
    write_obj(&without(&room, k), directory.path().join("hole.obj")).unwrap();
    let run = |scene: &str, more: &[&str]| document(directory.path(), &[&["form-factors", scene], more].concat());
    let (code, detected) = run("room.obj", &["--balance", "closure"]);
    assert!(code == 0 && detected["closed"] == true, "{detected}");
    assert!(detected["closure_error_max"].as_f64().unwrap() < 1e-9);
    let (code, open) = run("room.obj", &["--open"]);
    assert!(
        code == 0 && open["closed"] == false && open["closure_error_max"].is_null(),
        "{open}"
    );
    let (code, refused) = run("hole.obj", &["--closed"]);
    let message = refused["error"]["message"].as_str().unwrap();
    assert!(
        code == 1
            && message.contains("hole.obj: `face")
            && message.contains("(line ")
            && message.contains("leaves the scene"),
        "{message}"
    );
    // A gap far below what is refused.
    let gaping = with_a_gap(&room, k, 1e-6);
    write_obj(&gaping, directory.path().join("gap.obj")).unwrap();
    let (_, detected) = run("gap.obj", &[]);
    assert_eq!(detected["closed"], false);
    let (code, stated) = run("gap.obj", &["--closed", "--balance", "closure"]);
    assert!(code == 0 && stated["closed"] == true, "{stated}");
    // What the gap loses is beyond the errors of exact entries, and so is stated, not spread.
    let closure = stated["closure_error_max"].as_f64().unwrap();
    assert!(closure > 1e-9 && closure < 1e-4, "{closure:e}");
    // Nor are blocks in it whose bottoms lie on the floor, and see nothing.
    let mut shapes = Shapes::default();
    for face in gaping.face_ids() {
        shapes.face(&gaping.polygon(face));
    }
    cube(&mut shapes, [1.0, 1.0, 0.0], [2.0, 2.0, 1.0], false);
    write_obj(&shapes.scene(), directory.path().join("block.obj")).unwrap();
    let (code, stated) = run("block.obj", &["--closed", "--method", "centre"]);
    assert!(code == 0 && stated["closed"] == true, "{stated}");
    let white = room.surfaces.iter().map(|surface| {
        let name = &surface.name;
        format!("[surface.{name}]\nreflectance = 1.0\nexitance = 1.0\n")
    });
    std::fs::write(directory.path().join("white.toml"), white.collect::<String>()).unwrap();
    for (scene, more) in [("room.obj", &[][..]), ("gap.obj", &["--closed"])] {
        let (code, result) = document(
            directory.path(),
            &[&["solve", scene, "--lighting", "white.toml"], more].concat(),
        );
        let message = result["error"]["message"].as_str().unwrap_or_default();
        assert!(
            code == 1 && message.contains("no finite solution"),
            "{scene} {more:?} {result}"
        );
    }
}

/// `voxel` and `compare` take the same flags.
#[test]
fn voxels_and_comparisons_may_be_said_to_be_closed_or_open() {
    let directory = tempfile::tempdir().unwrap();
    let room = tiled_room(5);
    write_obj(&room, directory.path().join("room.obj")).unwrap();
    write_obj(&without(&room, 11), directory.path().join("hole.obj")).unwrap();
    write_obj(&with_a_gap(&room, 11, 1e-6), directory.path().join("gap.obj")).unwrap();
    let run = |first: &[&str], more: &[&str]| document(directory.path(), &[first, more].concat());
    for first in [&["voxel", "--voxels", "20", "hole.obj"][..], &["compare", "hole.obj"]] {
        let (code, refused) = run(first, &["--closed"]);
        let message = refused["error"]["message"].as_str().unwrap();
        assert!(code == 1 && message.contains("leaves the scene"), "{message}");
        let (code, _) = run(first, &["--closed", "--open"]);
        assert_eq!(code, 2);
    }
    // Only in a closed room light that reaches the outside is a leak.
    for (scene, more, is_closed) in [
        ("room.obj", &[][..], true),
        ("room.obj", &["--open"], false),
        ("gap.obj", &[], false),
        ("gap.obj", &["--closed"], true),
    ] {
        let (_, result) = run(&["voxel", "--voxels", "20", scene], more);
        let mut left_out = result["left_out"].as_array().unwrap().iter();
        let is_left_out = left_out.any(|item| item.as_str().unwrap().contains("search for leaks"));
        assert_eq!(is_left_out, !is_closed, "{scene} {more:?}: {result}");
        let stated = more.first().map(|flag| flag.trim_start_matches('-'));
        assert_eq!(result["settings"]["closure"].as_str(), stated, "{scene} {more:?}");
    }
    let quick = [
        "--methods",
        "centre",
        "--seeds",
        "1",
        "--visibility",
        "on",
        "--tolerance",
        "1e-2",
    ];
    let (code, compared) = run(&["compare", "gap.obj", "--closed", "-o", "compared"], &quick);
    assert!(code == 0 && compared["settings"]["closure"] == "closed", "{compared}");
}
