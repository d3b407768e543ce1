//! Which rows are known to sum to 1: rooms with objects in them, beside them, and wound the wrong way.

#![expect(clippy::shadow_unrelated, reason = "a scene in its places is still that scene")]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "support/program.rs"]
mod program;
mod support;

use glam::{DQuat, DVec3};
use program::{document, radiosity, stderr};
use radiosity::audit::{Claims, Repair, doubted_rows};
use radiosity::form_factor::{ExactMethod, FormFactorMethod as _, closed_rows};
use radiosity::matrix::{Closed, FormFactors, RowTile, StorageChoice};
use radiosity::report::form_factors::FormFactorReport;
use radiosity::scene::topology::{Enclosure, is_watertight};
use radiosity::scene::{FaceId, Scene, builtin, write_obj};
use support::rooms::{Prepared, Shapes, moved};

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
        text.contains("turned.obj:") && text.contains("`face6`") && text.contains("reverse its winding"),
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
        let right = prepared.compute(&*support::rooms::quick(method, 1));
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
                settings: settings.as_object().unwrap(),
                surface: None,
            };
            report.write(&directory.path().join(name)).unwrap();
            let solve = ["solve", "scene.obj", "--form-factors", name, "--balance", "on"];
            let (_, document) = document(directory.path(), &solve);
            let warnings = document["warnings"].as_array().unwrap();
            let is_told = warnings
                .iter()
                .any(|text| text.as_str().unwrap().contains("left as they are"));
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
