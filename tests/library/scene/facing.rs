//! Faces with inverted normals: which are found, and which scenes have none.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use radiosity::scene::{Corners, Scene, SurfaceId, builtin, load};
use radiosity::visibility::embree::EmbreeVisibility;
use radiosity::visibility::facing::{Facing, look};

fn facing(scene: &Scene) -> Facing {
    look(scene, &EmbreeVisibility::new(scene).unwrap())
}

fn turn(scene: &mut Scene, faces: impl Iterator<Item = usize>) {
    for face in faces {
        match &mut scene.faces[face].corners {
            Corners::Triangle(v) => v.reverse(),
            Corners::Quad(v) => v.reverse(),
        }
    }
}

fn scene_of(text: &str) -> Scene {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("scene.obj");
    std::fs::write(
        directory.path().join("a.mtl"),
        "newmtl lamp\nKd 0.5\nKe 1\nnewmtl grey\nKd 0.5\n",
    )
    .unwrap();
    std::fs::write(&file, format!("mtllib a.mtl\n{text}")).unwrap();
    load(&file).unwrap().scene
}

fn names(scene: &Scene, facing: &Facing) -> Vec<String> {
    let name = |id: SurfaceId| scene.surfaces[id.0 as usize].name.clone();
    facing.turned.iter().map(|turned| name(turned.surface)).collect()
}

#[test]
fn scenes_that_are_right_have_no_turned_faces() {
    for name in builtin::names() {
        let scene = builtin::build(name, None).unwrap().scene;
        assert_eq!(facing(&scene), Facing::default(), "{name}");
    }
    let exporters = Path::new("tests/data/obj/valid/exporters");
    for name in ["blender 5.obj", "trimesh.obj"] {
        let scene = load(exporters.join(name)).unwrap().scene;
        assert_eq!(facing(&scene), Facing::default(), "{name}");
    }
}

#[test]
fn each_wall_of_a_room_that_is_turned_is_named() {
    let room = builtin::build("room-box", None).unwrap().scene;
    for face in 0..6 {
        let mut one = room.clone();
        turn(&mut one, std::iter::once(face));
        let found = facing(&one);
        let surface = room.faces[face].surface.0 as usize;
        assert_eq!(names(&one, &found), [room.surfaces[surface].name.as_str()]);
        assert!(!found.none_sees);
        // The last wall is the only one that emits.
        assert_eq!(found.no_emitter_sees, room.surfaces[surface].name == "room_z1");
    }
    // The same where all walls are one surface, as programs export a room.
    let mut merged = room;
    for face in &mut merged.faces {
        face.surface = SurfaceId(0);
    }
    turn(&mut merged, [2, 3].into_iter());
    let found = facing(&merged);
    assert_eq!((found.turned.len(), found.turned[0].n_faces), (1, 2));
}

#[test]
fn a_room_that_is_turned_as_a_whole_sees_nothing() {
    let mut cube = builtin::build("cube", None).unwrap().scene;
    turn(&mut cube, 0..6);
    let found = facing(&cube);
    assert!(
        found.none_sees && found.no_emitter_sees && found.turned.is_empty(),
        "{found:?}"
    );
    // The sides of the box inside still see one another.
    let mut furnished = builtin::build("room-box", None).unwrap().scene;
    turn(&mut furnished, 0..12);
    let of_furnished = facing(&furnished);
    assert!(
        !of_furnished.none_sees && of_furnished.no_emitter_sees,
        "{of_furnished:?}"
    );
}

#[test]
fn open_scenes_sheets_and_outer_sides_raise_no_alarm() {
    let plate = "v 1 1 2\nv 1 2 2\nv 2 2 2\nv 2 1 2\n";
    let ground = "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\n";
    let cases = [
        (
            "a lamp over the ground",
            format!("{plate}{ground}o lamp\nusemtl lamp\nf 1 2 3 4\no ground\nusemtl grey\nf 5 6 7 8\n"),
        ),
        (
            "a lamp of two triangles",
            format!("{plate}o lamp\nusemtl lamp\nf 1 2 3\nf 1 3 4\n"),
        ),
        // Both of its sides: the upper one sees nothing, and the ground sees the lower one.
        (
            "a sheet over the ground",
            format!(
                "{plate}{ground}o lamp\nusemtl lamp\nf 1 2 3 4\no back\nusemtl grey\nf 4 3 2 1\no ground\nf 5 6 7 8\n"
            ),
        ),
        // 1e-4 of the hemisphere: no ray meets it by chance.
        (
            "small and far",
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 60\nv 0 1 60\nv 1 0 60\nusemtl lamp\nf 1 2 3\nusemtl grey\nf 4 5 6\n"
                .to_owned(),
        ),
    ];
    for (name, text) in cases {
        assert_eq!(facing(&scene_of(&text)), Facing::default(), "{name}");
    }
    // A room in a house: outer walls around it, 0.2 m off, see nothing.
    let mut house = builtin::build("room-box", None).unwrap().scene;
    let room = builtin::build("room-box", None).unwrap().scene;
    let (low, high) = room.bounding_box();
    let n = u32::try_from(house.vertices.len()).unwrap();
    let middle = 0.5 * (low + high);
    house
        .vertices
        .extend(room.vertices.iter().map(|&v| v + 0.2 * (v - middle).signum()));
    for mut face in room.faces.iter().take(6).copied() {
        if let Corners::Quad(v) = &mut face.corners {
            *v = v.map(|k| k + n);
            v.reverse();
        }
        house.faces.push(face);
    }
    assert_eq!(facing(&house), Facing::default());
}

#[test]
fn the_highest_roof_of_a_town_is_not_turned() {
    // The ground sees the back of the higher roof within the walls, whose outer sides see each other.
    let house = |x: u32, height: u32| {
        let corners = [(0, 0), (1, 0), (1, 1), (0, 1)];
        let levels = [0, height].into_iter();
        let vertex = |(z, (dx, y)): (u32, (u32, u32))| format!("v {} {y} {z}\n", x + dx);
        let vertices = levels.flat_map(|z| corners.map(|corner| vertex((z, corner))));
        vertices.collect::<String>()
    };
    let sides = |k: i32| {
        let walls = (1..=4).map(|a| (a, a % 4 + 1));
        let wall = |(a, b): (i32, i32)| format!("f {} {} {} {}\n", k + a, k + b, k + b + 4, k + a + 4);
        let roof = format!("f {} {} {} {}\n", k + 5, k + 6, k + 7, k + 8);
        walls.map(wall).collect::<String>() + &roof
    };
    let town = format!(
        "{}{}v -3 -3 0\nv 7 -3 0\nv 7 4 0\nv -3 4 0\nusemtl grey\no houses\n{}{}o ground\nusemtl lamp\nf 17 18 19 20\n",
        house(0, 2),
        house(3, 1),
        sides(0),
        sides(8)
    );
    assert_eq!(facing(&scene_of(&town)), Facing::default());
}

#[test]
fn a_mesh_of_many_faces_is_looked_at_by_its_surfaces() {
    let file = PathBuf::from("scenes/living-room/scene.obj");
    let mut scene = load(&file).unwrap().scene;
    assert!(scene.faces.len() > 2048);
    let emitters: Vec<usize> = (0..scene.faces.len())
        .filter(|&face| scene.materials[scene.faces[face].material.0 as usize].exitance[0] > 0.0)
        .collect();
    turn(&mut scene, emitters.into_iter());
    assert!(facing(&scene).no_emitter_sees || !facing(&scene).turned.is_empty());
}

/// A bowl of a sphere of 1 m, 12 by 4 faces, open at the top; seen from above it is concave. Coordinates have nine digits, as files have.
fn bowl(opens_up: bool) -> String {
    let (n, m) = (12, 4);
    let mut text = String::new();
    for ring in 0..=m {
        let polar = 0.2 + 0.9 * f64::from(ring) / f64::from(m);
        for k in 0..n {
            let azimuth = 0.1 + std::f64::consts::TAU * f64::from(k) / f64::from(n);
            let (radius, height) = (polar.sin(), -polar.cos());
            writeln!(
                text,
                "v {:.9} {:.9} {height:.9}",
                radius * azimuth.cos(),
                radius * azimuth.sin()
            )
            .unwrap();
        }
    }
    text += "o bowl\nusemtl grey\n";
    for ring in 0..m {
        for k in 0..n {
            let at = |i: i32, j: i32| i * n + (j % n) + 1;
            let mut corners = [at(ring, k), at(ring, k + 1), at(ring + 1, k + 1), at(ring + 1, k)];
            if opens_up {
                corners.reverse();
            }
            let [a, b, c, d] = corners;
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    text
}

/// High above the bowl, where its faces do not see them from either side: two plates that face each other, and a solid that looks outwards.
const OTHERS: &str = "v 0 0 20\nv 1 0 20\nv 1 1 20\nv 0 1 20\nv 0 0 21\nv 0 1 21\nv 1 1 21\nv 1 0 21\n\
    o below\nusemtl grey\nf -8 -7 -6 -5\no above\nusemtl lamp\nf -4 -3 -2 -1\n\
    v 3 0 20\nv 4 0 20\nv 4 1 20\nv 3 1 20\nv 3 0 21\nv 4 0 21\nv 4 1 21\nv 3 1 21\no solid\nusemtl grey\n\
    f -8 -5 -6 -7\nf -4 -3 -2 -1\nf -8 -7 -3 -4\nf -7 -6 -2 -3\nf -6 -5 -1 -2\nf -5 -8 -4 -1\n";

#[test]
fn a_surface_that_is_concave_from_behind_alone_is_found() {
    for (opens_up, is_alone) in [(true, true), (false, true), (true, false), (false, false)] {
        let scene = scene_of(&(bowl(opens_up) + if is_alone { "" } else { OTHERS }));
        let found = facing(&scene);
        let inside_out: Vec<&str> = found
            .inside_out
            .iter()
            .map(|id| scene.surfaces[id.0 as usize].name.as_str())
            .collect();
        assert_eq!(found.none_sees, !opens_up && is_alone, "{opens_up} {is_alone}");
        let expected: &[&str] = if opens_up || is_alone { &[] } else { &["bowl"] };
        assert_eq!(inside_out, expected, "{opens_up} {is_alone}");
    }
}

#[test]
fn faces_that_see_only_backs_are_counted() {
    let mut text = String::from("usemtl grey\n");
    // A ground of 3 by 3 faces below a ceiling of 2 by 2, which looks up or down.
    for looks_down in [false, true] {
        for (n, z) in [(3, 0.0), (2, 1.0)] {
            writeln!(text, "o s{n}").unwrap();
            for (x, y) in (0..n).flat_map(|x| (0..n).map(move |y| (x, y))) {
                let at = |k: i32| 3.0 * f64::from(k) / f64::from(n);
                let (x, y) = ([at(x), at(x + 1)], [at(y), at(y + 1)]);
                for (i, j) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                    writeln!(text, "v {} {} {z}", x[i], y[j]).unwrap();
                }
                let is_reversed = n == 2 && looks_down;
                text += if is_reversed {
                    "f -1 -2 -3 -4\n"
                } else {
                    "f -4 -3 -2 -1\n"
                };
            }
        }
        let found = facing(&scene_of(&text));
        assert_eq!(found.n_see_only_backs, if looks_down { 0 } else { 9 });
        text.clear();
    }
}
