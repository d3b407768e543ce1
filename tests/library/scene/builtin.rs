//! The built-in scenes against their sources, and the files in `scenes/` against the built-in scenes.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;
use radiosity::scene::builtin::{self, Builtin};
use radiosity::scene::{Camera, Corners, FaceId, Scene, SceneWarningKind, load, write_obj};

fn built(name: &str) -> Builtin {
    builtin::build(name, None).unwrap_or_else(|error| panic!("{error}"))
}

fn scene(name: &str) -> Scene {
    built(name).scene
}

fn surface_names(scene: &Scene) -> Vec<&str> {
    scene.surfaces.iter().map(|s| s.name.as_str()).collect()
}

fn surface_areas(scene: &Scene) -> Vec<f64> {
    let mut areas = vec![0.0; scene.surfaces.len()];
    for face in scene.face_ids() {
        areas[scene.faces[face.0 as usize].surface.0 as usize] += scene.area_vector(face).length();
    }
    areas
}

fn assert_close(a: f64, b: f64, rel_tol: f64) {
    assert!((a - b).abs() <= rel_tol * b.abs(), "{a} is not {b}");
}

fn assert_all_close(a: &[f64], b: &[f64], rel_tol: f64) {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).for_each(|(a, b)| assert_close(*a, *b, rel_tol));
}

/// The edges that do not have exactly one partner in the opposite direction.
fn open_edges(scene: &Scene) -> Vec<(u32, u32)> {
    let mut count: HashMap<(u32, u32), usize> = HashMap::new();
    for face in &scene.faces {
        let v = face.corners.as_slice();
        for k in 0..v.len() {
            *count.entry((v[k], v[(k + 1) % v.len()])).or_default() += 1;
        }
    }
    let partner = |&(a, b): &(u32, u32)| count.get(&(b, a)).copied().unwrap_or(0);
    count
        .iter()
        .filter(|(edge, n)| **n != 1 || partner(edge) != 1)
        .map(|(edge, _)| *edge)
        .collect()
}

/// The exitance (first channel) of a face.
fn exitance(scene: &Scene, face: FaceId) -> f64 {
    scene.materials[scene.faces[face.0 as usize].material.0 as usize].exitance[0]
}

fn reflectance(scene: &Scene, face: FaceId) -> f64 {
    scene.materials[scene.faces[face.0 as usize].material.0 as usize].reflectance[0]
}

fn emitted_power(scene: &Scene) -> f64 {
    scene
        .face_ids()
        .map(|f| exitance(scene, f) * scene.area_vector(f).length())
        .sum()
}

fn points(json: &serde_json::Value) -> Vec<DVec3> {
    let point = |p: &serde_json::Value| DVec3::from_array([0, 1, 2].map(|k| p[k].as_f64().unwrap()));
    json.as_array().unwrap().iter().map(point).collect()
}

/// The same outline in the same winding, from whatever corner.
fn assert_same_outline(a: &[DVec3], b: &[DVec3]) {
    let turned = |k: usize| {
        let mut turned = a.to_vec();
        turned.rotate_left(k);
        turned
    };
    assert!((0..a.len()).any(|k| turned(k) == b), "{a:?} is not {b:?}");
}

fn reference() -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string("tests/data/reference/occluded.json").unwrap()).unwrap()
}

#[test]
fn every_scene_round_trips_and_matches_its_files() {
    for name in builtin::names() {
        let built = built(name);
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("scene.obj");
        write_obj(&built.scene, &file).unwrap();
        let mut loaded = load(&file).unwrap();
        // These are lit by the sun.
        let is_dark =
            |kind: &SceneWarningKind| ["crater", "street"].contains(&name) && *kind == SceneWarningKind::NoEmission;
        loaded.warnings.retain(|warning| !is_dark(&warning.kind));
        assert!(loaded.warnings.is_empty(), "{name}: {:?}", loaded.warnings);
        assert_eq!(loaded.scene.content_hash(), built.scene.content_hash(), "{name}");

        let in_tree = Path::new("scenes").join(name);
        for part in ["scene.obj", "scene.mtl"] {
            let (new, kept) = (
                std::fs::read(directory.path().join(part)),
                std::fs::read(in_tree.join(part)),
            );
            assert!(
                new.unwrap() == kept.unwrap(),
                "scenes/{name}/{part} is not what is built; write it anew"
            );
        }
        let camera_file = in_tree.join("camera.toml");
        let text = camera_file
            .exists()
            .then(|| std::fs::read_to_string(&camera_file).unwrap());
        assert_eq!(
            text,
            built.camera.as_ref().map(Camera::to_toml),
            "scenes/{name}/camera.toml"
        );
        assert!(in_tree.join("README.md").exists(), "{name} has no README.md");
    }
    let mut directories: Vec<_> = std::fs::read_dir("scenes")
        .unwrap()
        .map(|d| d.unwrap().file_name())
        .collect();
    let mut names: Vec<std::ffi::OsString> = builtin::names().map(Into::into).collect();
    directories.sort();
    names.sort();
    assert_eq!(directories, names);
}

#[test]
fn names_and_levels_are_checked() {
    let message = |name, level| builtin::build(name, level).unwrap_err().to_string();
    assert_eq!(
        message("teapot", None),
        "there is no built-in scene `teapot`; choose one of cube, cornell-box, lewis-room, sphere-room-r1, sphere-room-r2, corridor, room-box, living-room, crater, street"
    );
    assert_eq!(
        message("cube", Some(1)),
        "the built-in scene `cube` has no levels; leave the level out"
    );
    assert_eq!(
        message("lewis-room", Some(11)),
        "level 11 of `lewis-room` is too fine; the greatest level is 10"
    );
}

#[test]
fn the_cube_has_unit_walls_that_see_its_centre() {
    let cube = scene("cube");
    assert_eq!(surface_names(&cube), ["x0", "x1", "y0", "y1", "z0", "z1"]);
    assert_eq!(cube.vertices.len(), 8);
    assert_eq!(open_edges(&cube), []);
    let inward = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    for (face, normal) in cube.face_ids().zip(inward) {
        assert_eq!(cube.area_vector(face), normal);
        let centre = cube.polygon(face).iter().sum::<DVec3>() / 4.0;
        assert_eq!(centre, DVec3::splat(0.5) - 0.5 * normal);
        assert_close(exitance(&cube, face) + 1.0, if face.0 == 5 { 2.0 } else { 1.0 }, 0.0);
    }
    assert_eq!(cube.n_channels_needed(), 1);
}

#[test]
fn the_lewis_room_has_the_papers_patches_at_every_level() {
    let rho = [0.2, 0.6, 0.4, 0.8, 1.0, 1.0];
    for level in 0..5 {
        let room = builtin::build("lewis-room", Some(level)).unwrap().scene;
        let m = 1_u32 << level;
        assert_eq!(room.faces.len(), 6 * (m * m) as usize);
        assert_eq!(surface_names(&room), ["x0", "x1", "y0", "y1", "z0", "z1"]);
        assert_eq!(open_edges(&room), []);
        assert_all_close(&surface_areas(&room), &[1.0; 6], 1e-15);
        assert_close(emitted_power(&room), 0.25, 1e-15);
        for face in room.face_ids() {
            let (wall, rest) = (face.0 / (m * m), face.0 % (m * m));
            let (ia, ib) = (rest / m, rest % m);
            assert_close(reflectance(&room, face), rho[wall as usize], 0.0);
            let centre = room.polygon(face).iter().sum::<DVec3>() / 4.0;
            let (axis, side) = ((wall / 2) as usize, f64::from(wall % 2));
            let free: Vec<usize> = (0..3).filter(|k| *k != axis).collect();
            let at = |i: u32| (f64::from(i) + 0.5) / f64::from(m);
            let mut expected = DVec3::ZERO;
            (expected[axis], expected[free[0]], expected[free[1]]) = (side, at(ia), at(ib));
            assert!(centre.distance(expected) < 1e-15, "face {face:?}");
            let inward = DVec3::AXES[axis] * (1.0 - 2.0 * side);
            assert!(room.area_vector(face).normalize().distance(inward) < 1e-15);
            let in_hole = wall == 5 && (at(ia) - 0.5).abs() < 0.25 && (at(ib) - 0.5).abs() < 0.25;
            let emission = match level {
                0 | 1 if wall == 5 => 0.25,
                _ if level >= 2 && in_hole => 1.0,
                _ => 0.0,
            };
            assert!(
                (exitance(&room, face) - emission).abs() < 1e-15,
                "level {level}, face {face:?}"
            );
        }
    }
    assert_eq!(scene("lewis-room").faces.len(), 384);
}

#[test]
fn the_sphere_rooms_are_the_papers() {
    let kept = std::fs::read_to_string("tests/data/reference/sphere_room_r1.txt").unwrap();
    let rows: Vec<Vec<f64>> = kept
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(' ').map(|x| x.parse().unwrap()).collect())
        .collect();
    // The areas of the 128 flat faces.
    for (name, radius, sphere_area, rho_avg) in [
        ("sphere-room-r1", 1.0, 12.166_689_438_554_35, 0.78),
        ("sphere-room-r2", 2.0, 48.666_757_754_217_4, 0.77),
    ] {
        let room = scene(name);
        assert_eq!(room.faces.len(), 992);
        assert_eq!(rows.len(), 992);
        assert_eq!(surface_names(&room), ["x0", "x1", "y0", "y1", "z0", "z1", "sphere"]);
        assert_eq!(open_edges(&room), []);
        assert_all_close(
            &surface_areas(&room),
            &[36.0, 36.0, 36.0, 36.0, 36.0, 36.0, sphere_area],
            1e-14,
        );
        for (face, row) in room.face_ids().zip(&rows) {
            let of_sphere = room.faces[face.0 as usize].surface.0 == 6;
            assert_eq!(of_sphere, row[0] > 5.5);
            assert_close(f64::from(room.faces[face.0 as usize].surface.0), row[0], 0.0);
            let scale = if of_sphere { radius } else { 1.0 };
            let corners: Vec<DVec3> = row[1..]
                .as_chunks::<3>()
                .0
                .iter()
                .map(|c| scale * DVec3::from_array(*c))
                .collect();
            let polygon = room.polygon(face);
            assert_eq!(polygon.len(), if corners[2] == corners[3] { 3 } else { 4 });
            for (v, w) in polygon.iter().zip(&corners) {
                assert!(v.distance(*w) < 1e-15 * radius, "face {face:?}: {v} is not {w}");
            }
            if of_sphere {
                assert!(room.area_vector(face).dot(polygon[0]) > 0.0, "the sphere faces outward");
            }
        }
        assert_eq!(
            room.faces[864 + 16].corners.as_slice().len(),
            4,
            "flat within rounding: a quad"
        );
        assert_close(emitted_power(&room), 50.0 * 16.0 * 0.25, 1e-15);
        let light = FaceId(720 + 4 * 12 + 4);
        assert_close(exitance(&room, light), 50.0, 0.0);
        assert_close(reflectance(&room, light), reflectance(&room, FaceId(720)), 0.0);
        let area: f64 = surface_areas(&room).iter().sum();
        let weighted: f64 = room
            .face_ids()
            .map(|f| reflectance(&room, f) * room.area_vector(f).length())
            .sum();
        assert_close(weighted / area, rho_avg, 1e-14);
        assert_close(
            reflectance(&room, FaceId(0)) / reflectance(&room, FaceId(991)),
            0.92,
            1e-14,
        );
    }
}

#[test]
fn the_cornell_box_is_the_measured_one() {
    let Builtin { scene, camera } = built("cornell-box");
    let names = [
        "floor",
        "ceiling",
        "back",
        "right",
        "left",
        "light",
        "short_block",
        "tall_block",
    ];
    assert_eq!(surface_names(&scene), names);
    // Trapezoids, from the source's coordinates in mm; the left wall is two triangles.
    let left = {
        let [a, b, c, d] = [
            [552.8, 0.0, 0.0],
            [549.6, 0.0, 559.2],
            [556.0, 548.8, 559.2],
            [556.0, 548.8, 0.0],
        ]
        .map(DVec3::from_array);
        0.5 * ((b - a).cross(c - a).length() + (c - a).cross(d - a).length())
    };
    let expected = [
        0.5 * (552.8 + 549.6) * 559.2,
        556.0 * 559.2 - 130.0 * 105.0,
        0.5 * (549.6 + 556.0) * 548.8,
        559.2 * 548.8,
        left,
        130.0 * 105.0,
    ]
    .map(|mm2| mm2 * 1e-6);
    assert_all_close(&surface_areas(&scene)[..6], &expected, 1e-14);
    // The sum of the area vectors tells closedness: blocks lack their bottoms, the room its front.
    let vector_sum = |surface: u32| -> DVec3 {
        let own = scene
            .face_ids()
            .filter(|f| scene.faces[f.0 as usize].surface.0 == surface);
        own.map(|f| scene.area_vector(f)).sum()
    };
    let bottom = |corners: [[f64; 2]; 4]| -> f64 {
        let at = |k: usize| DVec3::new(corners[k % 4][0], 0.0, corners[k % 4][1]) * 1e-3;
        0.5 * (0..4).map(|k| at(k).cross(at(k + 1)).y).sum::<f64>()
    };
    let short = bottom([[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]]);
    let tall = bottom([[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]]);
    assert!(short > 0.025 && tall > 0.025);
    assert!(vector_sum(6).distance(DVec3::Y * short) < 1e-16);
    assert!(vector_sum(7).distance(DVec3::Y * tall) < 1e-16);
    let room: DVec3 = (0..6).map(vector_sum).sum();
    let front = 0.5 * (552.8 + 556.0) * 548.8 * 1e-6;
    assert!(room.distance(DVec3::NEG_Z * front) < 1e-15, "{room}");
    // Only the rim of the front and the foot of the blocks are open.
    let open = open_edges(&scene);
    assert_eq!(open.len(), 4 + 4 + 4);
    let on_rim = |v: u32| scene.vertices[v as usize].z == 0.0;
    let on_floor = |v: u32| scene.vertices[v as usize].y == 0.0;
    assert!(
        open.iter()
            .all(|&(a, b)| (on_rim(a) && on_rim(b)) || (on_floor(a) && on_floor(b)))
    );
    assert_eq!(scene.faces.len(), 1 + 4 + 1 + 1 + 2 + 1 + 5 + 5);

    let light = &scene.materials[scene.faces.iter().find(|f| f.surface.0 == 5).unwrap().material.0 as usize];
    let radiance = light.exitance.map(|e| e / std::f64::consts::PI);
    assert_all_close(&radiance, &[18.4, 15.6, 8.0], 1e-15);
    assert_eq!(scene.n_channels_needed(), 3);

    let camera = camera.unwrap();
    let fov = 2.0 * (0.025 / (2.0 * 0.035_f64)).atan().to_degrees();
    assert_close(camera.vertical_fov(), fov, 1e-14);
    // The photograph shows the red wall, at greater x, on the left.
    let (_, left_edge) = camera.primary_ray(0.0, 256.0, 512, 512);
    assert!(left_edge.x > 0.0 && left_edge.z > 0.0);
}

#[test]
fn the_corridor_is_the_reference_one() {
    let corridor = scene("corridor");
    assert_eq!(surface_names(&corridor), ["A", "B", "partition", "partition_back"]);
    let data = &reference()["corridor"];
    for (face, key) in corridor.face_ids().zip(["A", "B", "partition"]) {
        assert_same_outline(&corridor.polygon(face), &points(&data[key]));
    }
    let mut back = corridor.polygon(FaceId(3));
    back.reverse();
    assert_same_outline(&back, &corridor.polygon(FaceId(2)));
    // The partition faces A, its back faces B.
    assert_eq!(corridor.area_vector(FaceId(2)), DVec3::NEG_X * 5.0);
    assert_eq!(corridor.area_vector(FaceId(0)), DVec3::X * 10.0);
}

#[test]
fn the_room_with_a_box_is_the_reference_one() {
    let room = scene("room-box");
    let data = &reference()["room_box_12"];
    let areas: Vec<f64> = data["areas"]
        .as_array()
        .unwrap()
        .iter()
        .map(|a| a.as_f64().unwrap())
        .collect();
    assert_all_close(&surface_areas(&room), &areas, 1e-15);
    assert_eq!(open_edges(&room), []);
    let names = ["x0", "x1", "y0", "y1", "z0", "z1"];
    let expected: Vec<String> = ["room", "box"]
        .iter()
        .flat_map(|part| names.iter().map(move |side| format!("{part}_{side}")))
        .collect();
    assert_eq!(surface_names(&room), expected);
    for (k, part) in ["room", "box"].into_iter().enumerate() {
        let corners = points(&data[part]);
        let centre = 0.5 * (corners[0] + corners[1]);
        for side in 0..6_u32 {
            let face = FaceId(6 * u32::try_from(k).unwrap() + side);
            let axis = (side / 2) as usize;
            let polygon = room.polygon(face);
            let wall = corners[(side % 2) as usize][axis];
            assert!(polygon.iter().all(|v| (v[axis] - wall).abs() < 1e-15), "{face:?}");
            let inward = room.area_vector(face).dot(centre - polygon[0]) > 0.0;
            assert_eq!(inward, part == "room", "{face:?}");
        }
    }
    assert!(room.faces.iter().all(|f| matches!(f.corners, Corners::Quad(_))));
}

/// All corners of the crater are on its sphere, and its faces cover a little less than the cap.
#[test]
fn the_crater_is_a_spherical_cap() {
    let crater = scene("crater");
    assert_eq!(surface_names(&crater), ["crater"]);
    assert_eq!((crater.faces.len(), crater.vertices.len()), (256, 1 + 8 * 32));
    let middle = DVec3::new(0.0, 0.0, 1.5);
    for vertex in &crater.vertices {
        assert_close(vertex.distance(middle), 2.5, 1e-15);
        assert!((-1.0..=1e-15).contains(&vertex.z));
    }
    for face in crater.face_ids() {
        let centre = crater.polygon(face).iter().sum::<DVec3>() / crater.polygon(face).len() as f64;
        assert!(
            crater.area_vector(face).dot(middle - centre) > 0.0,
            "faces look inwards"
        );
    }
    let cap = 2.0 * std::f64::consts::PI * 2.5;
    let share = surface_areas(&crater)[0] / cap;
    assert!((0.98..1.0).contains(&share), "{share}");
}
