//! Scenes from OBJ and MTL files: the scenes that are read, the warnings and the refusals.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use radiosity::scene::{
    Corners, LoadOptions, Loaded, MAX_CORNERS, Scene, SceneWarning, SceneWarningKind, load, load_with,
};

const VALID: &str = "tests/data/obj/valid";
const INVALID: &str = "tests/data/obj/invalid";

fn valid(name: &str) -> Loaded {
    load(Path::new(VALID).join(name)).unwrap_or_else(|error| panic!("{error}"))
}

/// The messages of a valid file, without the directory.
fn warnings(loaded: &Loaded) -> Vec<String> {
    let text = |w: &radiosity::scene::SceneWarning| w.to_string().replace(&format!("{VALID}/"), "");
    loaded.warnings.iter().map(text).collect()
}

fn surface_names(scene: &Scene) -> Vec<&str> {
    scene.surfaces.iter().map(|s| s.name.as_str()).collect()
}

/// The surface name and the line of each face.
fn face_owners(scene: &Scene) -> Vec<(&str, u32)> {
    let owner = |f: &radiosity::scene::Face| (scene.surfaces[f.surface.0 as usize].name.as_str(), f.line);
    scene.faces.iter().map(owner).collect()
}

fn area(scene: &Scene) -> f64 {
    scene.face_ids().map(|f| scene.area_vector(f).length()).sum()
}

fn assert_close(a: f64, b: f64, rel_tol: f64) {
    assert!((a - b).abs() <= rel_tol * b.abs(), "{a} is not {b}");
}

#[test]
fn the_same_quad_is_read_from_every_dialect() {
    for name in ["quad.obj", "bom_crlf.obj", "cr.obj", "tabs_comments.obj"] {
        let loaded = valid(name);
        assert_eq!(warnings(&loaded), [""; 0], "{name}");
        let scene = loaded.scene;
        assert_eq!(
            scene.vertices,
            [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y],
            "{name}"
        );
        assert_eq!(scene.faces.len(), 1, "{name}");
        assert_eq!(scene.faces[0].corners, Corners::Quad([0, 1, 2, 3]), "{name}");
        assert_eq!(scene.materials[0].name, "lamp", "{name}");
        assert_eq!(
            scene.materials[0].exitance.map(f64::to_bits),
            [1.0_f64; 3].map(f64::to_bits)
        );
        assert_eq!(
            scene.materials[0].reflectance.map(f64::to_bits),
            [0.0_f64; 3].map(f64::to_bits)
        );
    }
    assert_eq!(face_owners(&valid("quad.obj").scene), [("face1", 7)]);
    assert_eq!(face_owners(&valid("bom_crlf.obj").scene), [("plate", 8)]);
    assert_eq!(face_owners(&valid("cr.obj").scene), [("plate", 8)]);
    assert_eq!(face_owners(&valid("tabs_comments.obj").scene), [("my plate", 10)]);
}

/// File, names of the surfaces, number of faces, area, number of warnings.
type Exported<'a> = (&'a str, &'a [&'a str], usize, f64, usize);

#[test]
fn what_other_programs_export_is_read() {
    let cases: [Exported<'_>; 4] = [
        // Loose edges and points are skipped, which is a warning; `(null)` is no material of the library, and there is a `Ks`.
        ("blender.obj", &["Cube.001", "Plane"], 3, 8.5, 3),
        // Curves are skipped, which is a warning (and none of the next three emits light, which is a warning), an outline of five corners becomes triangles, and a group that comes back is one surface.
        ("rhino.obj", &["floor", "ceiling"], 5, 18.0 + 16.0 + 0.5, 3),
        // Millimetres, 5400 km from the origin; materials are named, and there is no library.
        ("freecad.obj", &["Wall"], 3, 12e6 + 6e6, 2),
        ("tinkercad.obj", &["group_0_16089887"], 3, 150.0, 1),
    ];
    for (name, surfaces, n_faces, expected_area, n_warnings) in cases {
        let loaded = valid(&format!("exporters/{name}"));
        assert_eq!(surface_names(&loaded.scene), surfaces, "{name}");
        assert_eq!(loaded.scene.faces.len(), n_faces, "{name}");
        // Coordinates are f64: a difference of two at 5e6 is right to 1e-9.
        assert_close(area(&loaded.scene), expected_area, 1e-12);
        assert_eq!(warnings(&loaded).len(), n_warnings, "{name}: {:?}", warnings(&loaded));
    }
    let blender = valid("exporters/blender.obj").scene;
    let lamp = blender.materials.iter().find(|m| m.name == "Lamp").unwrap();
    assert_close(lamp.exitance[0], 5.0, 1e-15);
}

/// Files that programs wrote, not people: `README.md` beside the corpora says which.
#[test]
fn files_that_exporters_wrote_are_read() {
    // File, surfaces, faces, the area of the first surface in m², the reflectance of its first material, and warnings.
    type Case = (&'static str, &'static [&'static str], usize, f64, f64, usize);
    let cases: [Case; 3] = [
        (
            "blender 5.obj",
            &["Room", "Box.001", "Ceiling_lamp", "Ball"],
            48,
            24.0,
            0.7,
            // It writes a `Ks` for every material, and edges of no face as lines.
            2,
        ),
        // 180 of 255; nothing emits light, which is a warning, and there is a `Ks`.
        ("trimesh.obj", &["room", "ball"], 92, 24.0, 0.705_882_35, 2),
        ("meshio.obj", &["face1", "face2", "face3", "part4"], 5, 1.0, 0.5, 2),
    ];
    for (name, surfaces, n_faces, expected_area, reflectance, n_warnings) in cases {
        let loaded = valid(&format!("exporters/{name}"));
        let scene = &loaded.scene;
        assert_eq!(surface_names(scene), surfaces, "{name}");
        assert_eq!(scene.faces.len(), n_faces, "{name}");
        let of_first = scene
            .face_ids()
            .filter(|&face| scene.faces[face.0 as usize].surface.0 == 0);
        let found: f64 = of_first.map(|face| scene.area_vector(face).length()).sum();
        // Whole numbers have all their digits in the files.
        assert_close(found, expected_area, 1e-15);
        let material = &scene.materials[scene.faces[0].material.0 as usize];
        assert_close(material.reflectance[0], reflectance, 1e-15);
        assert_eq!(warnings(&loaded).len(), n_warnings, "{name}: {:?}", warnings(&loaded));
    }
    let scene = valid("exporters/blender 5.obj").scene;
    let lit = scene.face_ids().filter(|&face| {
        let material = scene.faces[face.0 as usize].material;
        scene.materials[material.0 as usize].exitance[0] > 0.0
    });
    let lamp: f64 = lit.map(|face| scene.area_vector(face).length()).sum();
    // A hexagon in a circle of 0.3 m, with six digits after the point for each corner.
    assert_close(lamp, 1.5 * 3.0_f64.sqrt() * 0.09, 1e-5);
}

#[test]
fn a_continued_face_has_its_first_line() {
    let scene = valid("continuation.obj").scene;
    assert_eq!(face_owners(&scene), [("face1", 8), ("face2", 11)]);
    assert_eq!(scene.faces[0].corners, Corners::Quad([0, 1, 2, 3]));
    assert_eq!(scene.faces[1].corners, Corners::Quad([3, 2, 1, 0]));
}

#[test]
fn negative_indices_count_from_the_last_vertex_so_far() {
    let scene = valid("negative.obj").scene;
    assert_eq!(scene.area_vector(radiosity::scene::FaceId(0)), DVec3::Z);
    assert_eq!(scene.area_vector(radiosity::scene::FaceId(1)), DVec3::NEG_Z);
    assert_eq!(scene.polygon(radiosity::scene::FaceId(1))[0], DVec3::new(0.0, 1.0, 1.0));
}

#[test]
fn lines_points_and_texture_coordinates_are_ignored() {
    let scene = valid("textured.obj").scene;
    assert_eq!(face_owners(&scene), [("face1", 10), ("face2", 13)]);
    assert_eq!(scene.faces[1].corners, Corners::Triangle([0, 3, 2]));
}

#[test]
fn the_last_group_names_the_surface_whatever_the_material() {
    let loaded = valid("groups.obj");
    assert_eq!(warnings(&loaded), [""; 0]);
    let scene = loaded.scene;
    assert_eq!(surface_names(&scene), ["top", "bottom"]);
    let owners = [("bottom", 14), ("top", 17), ("bottom", 19), ("bottom", 21)];
    assert_eq!(face_owners(&scene), owners);
    let materials: Vec<u32> = scene.faces.iter().map(|f| f.material.0).collect();
    assert_eq!(materials, [0, 1, 1, 0]);
    assert_eq!(scene.materials[0].name, "grey");
}

#[test]
fn faces_outside_groups_are_default_or_one_surface_each() {
    let scene = valid("default_group.obj").scene;
    assert_eq!(face_owners(&scene), [("default", 10), ("named", 12), ("default", 14)]);
    assert_eq!(surface_names(&scene), ["default", "named"]);
    let alone = valid("no_groups.obj").scene;
    // The second face has no area; the others keep their numbers.
    assert_eq!(surface_names(&alone), ["face1", "face3"]);
}

#[test]
fn a_concave_polygon_becomes_triangles_of_its_area() {
    let scene = valid("split.obj").scene;
    // A U of eight corners (16 m² less a notch of 6), and the notch's rim read backwards as a concave quad.
    let areas = |surface: u32| -> f64 {
        let of_surface = scene
            .face_ids()
            .filter(|f| scene.faces[f.0 as usize].surface.0 == surface);
        of_surface.map(|f| scene.area_vector(f).z).sum()
    };
    assert_close(areas(0), 10.0, 1e-15);
    assert_eq!(scene.faces.iter().filter(|f| f.surface.0 == 0).count(), 6);
    assert!(
        scene
            .face_ids()
            .filter(|f| scene.faces[f.0 as usize].surface.0 == 0)
            .all(|f| scene.area_vector(f).z > 0.0)
    );
    assert_close(areas(1), -3.0, 1e-15);
    assert!(scene.faces.iter().all(|f| f.line == 11 || f.surface.0 == 1));
}

#[test]
fn a_bent_quad_becomes_two_triangles_with_one_line() {
    let loaded = valid("bent.obj");
    assert_eq!(
        warnings(&loaded),
        ["bent.obj:7: a face is not flat; it is cut into triangles, which may not be those that were meant"]
    );
    let scene = loaded.scene;
    assert_eq!(face_owners(&scene), [("face1", 7), ("face1", 7)]);
    assert!(scene.faces.iter().all(|f| matches!(f.corners, Corners::Triangle(_))));
}

/// The number of warnings of a quad of 1 m with a corner that much off its plane.
fn n_doubts(height: f64) -> usize {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("bent.obj");
    std::fs::write(directory.path().join("a.mtl"), "newmtl a\nKd 0.5\nKe 1\n").unwrap();
    let text = format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 {height}\nv 0 1 0\nusemtl a\nf 1 2 3 4\n");
    std::fs::write(&file, text).unwrap();
    load(&file).unwrap().warnings.len()
}

#[test]
fn a_quad_is_doubted_where_it_matters_how_it_is_cut() {
    // A corner that is lifted by h moves each corner h / 4 off the mean plane, and the limit is a thousandth of √2 m.
    assert_eq!((n_doubts(5e-3), n_doubts(6e-3)), (0, 1));
}

#[test]
fn faces_that_touch_in_one_plane_are_legal() {
    let scene = valid("touching.obj").scene;
    assert_eq!(scene.faces.len(), 4);
}

/// A square of 316 × 316 tiles, all in one plane: no two overlap, and one more that does is cut out.
#[test]
fn overlaps_are_found_among_many_faces() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("tiles.obj");
    let n = 316_usize;
    let mut text: String = (0..=n)
        .flat_map(|y| (0..=n).map(move |x| format!("v {x} {y} 0\n")))
        .collect();
    for y in 0..n {
        for x in 0..n {
            let at = |dx: usize, dy: usize| (y + dy) * (n + 1) + x + dx + 1;
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    std::fs::write(&file, &text).unwrap();
    assert_eq!(load(&file).unwrap().scene.faces.len(), n * n);
    text += "v 100.2 200.3 0\nv 100.9 200.3 0\nv 100.2 200.9 0\nf -3 -2 -1\n";
    std::fs::write(&file, &text).unwrap();
    let loaded = load(&file).unwrap();
    let (n_cut, lost) = cut_faces(&loaded.warnings).unwrap();
    assert_eq!(n_cut, (1, u32::try_from(text.lines().count()).unwrap()));
    assert_close(lost, 0.21, 1e-12);
    let all: f64 = f64::from(u32::try_from(n * n).unwrap());
    assert_close(area(&loaded.scene), all, 1e-12);
}

/// Returns how many faces were cut out of others, the line of the first, and the area that the others lost.
fn cut_faces(warnings: &[SceneWarning]) -> Option<((usize, u32), f64)> {
    warnings.iter().find_map(|warning| match warning.kind {
        SceneWarningKind::CutFaces { count, area, .. } => Some(((count, warning.line()?), area)),
        _ => None,
    })
}

#[test]
fn overlaps_are_told_from_rounding_by_the_digits_of_the_file() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("plane.obj");
    // A floor of 4 m with another face of one winding in its plane or above it, far from the origin and near it.
    let load_with = |[x, y]: [f64; 2], [from, to]: [f64; 2], height: f64| {
        let mut text = String::new();
        for ([low, high], z) in [([0.0, 4.0], 0.0), ([from, to], height)] {
            for [u, v] in [[low, low], [high, low], [high, high], [low, high]] {
                writeln!(text, "v {:.3} {:.3} {:.3}", x + u, y + v, 100.0 + z).unwrap();
            }
        }
        text += "f 1 2 3 4\nf 5 6 7 8\n";
        std::fs::write(&file, text).unwrap();
        cut_faces(&load(&file).unwrap().warnings).map(|(_, area)| area)
    };
    for origin in [[0.0, 0.0], [5e5, 5.4e6]] {
        for (decal, height, expected) in [
            ([1.0, 3.0], 0.0, Some(4.0)),
            ([3.9, 6.0], 0.0, Some(0.01)),
            ([4.0, 6.0], 0.0, None),
            ([1.0, 3.0], 0.004, None),
        ] {
            let found: Option<f64> = load_with(origin, decal, height);
            let is_right = match (found, expected) {
                (Some(area), Some(right)) => (area - right).abs() < 1e-8,
                (found, expected) => found == expected,
            };
            assert!(is_right, "{origin:?} {decal:?} {height}: {found:?}");
        }
    }
}

#[test]
fn a_gap_of_a_micrometre_survives() {
    let scene = valid("gap.obj").scene;
    assert_eq!(scene.vertices.len(), 12);
    let (low, high) = scene.bounding_box();
    assert_eq!((high.z - low.z).to_bits(), 1e-6_f64.to_bits());
    assert_close(area(&scene), 2.0 + 1e-6, 1e-15);
}

#[test]
fn identical_positions_are_one_vertex() {
    let scene = valid("merge.obj").scene;
    assert_eq!(scene.vertices.len(), 6);
    assert_eq!(scene.faces[1].corners, Corners::Quad([1, 4, 5, 2]));
}

/// What mirrors or lets light through is told once, with the first line; a black `Ks`, `d 1` and `illum` say nothing.
#[test]
fn what_is_not_diffuse_is_told_once() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("s.obj");
    let told = |first: &str, second: &str| {
        let library = format!(
            "newmtl a\nKd 0.5 0.5 0.5\nKe 1 1 1\nillum 2\n{first}\nnewmtl b\nKd 0.5 0.5 0.5\n{second}\nnewmtl c\nKs 1 1 1\n"
        );
        std::fs::write(directory.path().join("s.mtl"), library).unwrap();
        let faces = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\n";
        std::fs::write(
            &file,
            format!("mtllib s.mtl\n{faces}usemtl a\nf 1 2 3\nf 1 3 4\nusemtl b\nf 5 6 7\n"),
        )
        .unwrap();
        let folder = format!("{}/", directory.path().display());
        let loaded = load(&file).unwrap();
        let text = |w: &radiosity::scene::SceneWarning| w.to_string().replace(&folder, "");
        loaded.warnings.iter().map(text).collect::<Vec<_>>()
    };
    assert_eq!(told("Ks 0 0 0\nd 1.0\nTr 0", "d -halo 1"), [""; 0]);
    assert_eq!(told("Ks spectral x.rfl", "Kd 0.5 0.5 0.5"), [""; 0]);
    assert_eq!(
        told("Ks 0 0.2 0\nd 0.5", ""),
        ["s.mtl:5: `Ks` is not used: surfaces are diffuse and opaque"]
    );
    assert_eq!(
        told("illum 3\nTr 0.2", "d -halo 0.5"),
        [
            "s.mtl:6: `Tr` is not used: surfaces are diffuse and opaque; 2 materials are meant otherwise, this is the first"
        ]
    );
}

#[test]
fn a_two_sided_sheet_is_legal() {
    assert_eq!(valid("sheet.obj").scene.faces.len(), 2);
}

#[test]
fn faces_without_area_are_skipped_and_told_once() {
    let loaded = valid("zero_area.obj");
    assert_eq!(
        warnings(&loaded),
        ["zero_area.obj:8: 3 faces without an area are skipped, this is the first"]
    );
    assert_eq!(face_owners(&loaded.scene), [("face2", 9)]);
    assert_eq!(loaded.scene.vertices.len(), 4);
}

#[test]
fn missing_materials_reflect_a_half() {
    let half = [0.5_f64; 3].map(f64::to_bits);
    let bare = valid("no_material.obj");
    assert_eq!(
        warnings(&bare),
        [
            "no_material.obj:6: 2 faces have no material, this is the first; they reflect 0.5",
            "no_material.obj: no face emits light; give a material an exitance `Ke`"
        ]
    );
    assert_eq!(bare.scene.materials.len(), 1);
    assert_eq!(bare.scene.materials[0].reflectance.map(f64::to_bits), half);

    let lost = valid("missing_library.obj");
    assert_eq!(
        warnings(&lost),
        [
            "missing_library.obj:1: material library `not there.mtl` is not there; its materials reflect 0.5",
            "missing_library.obj:6: no library defines material `paint`; it reflects 0.5",
            "missing_library.obj: no face emits light; give a material an exitance `Ke`"
        ]
    );
    assert_eq!(lost.scene.materials[0].name, "paint");
    assert_eq!(lost.scene.materials[0].reflectance.map(f64::to_bits), half);
    let kinds: Vec<_> = lost.warnings.iter().map(|w| (w.kind(), w.line())).collect();
    assert_eq!(
        kinds,
        [
            ("missing_library", Some(1)),
            ("unknown_material", Some(6)),
            ("no_emission", None)
        ]
    );
}

#[test]
fn libraries_are_found_by_names_with_blanks_and_one_by_one() {
    let blanks = valid("library_with_blanks.obj");
    assert_eq!(warnings(&blanks), [""; 0]);
    assert_eq!(
        blanks.scene.materials[0].reflectance.map(f64::to_bits),
        [0.25_f64; 3].map(f64::to_bits)
    );
    assert_eq!(
        blanks.scene.materials[0].exitance.map(f64::to_bits),
        [2.0_f64; 3].map(f64::to_bits)
    );

    let two = valid("two_libraries.obj");
    assert_eq!(
        warnings(&two),
        [
            "odd.mtl:9: material `lamp` is defined again; this definition counts",
            "odd.mtl:9: material `lamp` has no `Kd`; it reflects 0.5",
            "odd.mtl:11: the texture of material `lamp` is not read; its `Kd` counts everywhere"
        ]
    );
    let values = |k: usize| two.scene.materials[k].reflectance.map(f64::to_bits);
    assert_eq!(values(0), [0.5_f64; 3].map(f64::to_bits));
    assert_eq!(
        two.scene.materials[0].exitance.map(f64::to_bits),
        [3.0_f64, 2.0, 1.0].map(f64::to_bits)
    );
    assert_eq!(two.scene.materials[1].name, "Material #25");
    assert_eq!(values(1), [0.1_f64, 0.2, 0.3].map(f64::to_bits));
    assert_eq!(two.scene.n_channels_needed(), 3);
    assert_eq!(blanks.scene.n_channels_needed(), 1);
}

#[test]
fn every_invalid_file_is_refused_in_its_own_words() {
    let expected = std::fs::read_to_string(Path::new(INVALID).join("expected.txt")).unwrap();
    let mut named = Vec::new();
    for (name, message) in expected.lines().map(|line| line.split_once('\t').unwrap()) {
        named.push(name.to_owned());
        let Err(error) = load(Path::new(INVALID).join(name)) else {
            panic!("{name} is accepted");
        };
        let text = error.to_string();
        assert_eq!(text, format!("{INVALID}/{message}"));
        // The parts that programs read say the same as the sentence.
        let place = match error.line() {
            Some(line) => format!("{}:{line}: ", error.file().unwrap().display()),
            None => format!("{}: ", error.file().unwrap().display()),
        };
        assert!(text.starts_with(&place), "{text} does not start with {place}");
        assert!(
            error
                .kind()
                .chars()
                .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_'),
            "{}",
            error.kind()
        );
    }
    let on_disk = std::fs::read_dir(INVALID)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut on_disk: Vec<String> = on_disk
        .filter(|name| Path::new(name).extension().is_some_and(|e| e == "obj"))
        .collect();
    on_disk.sort();
    named.sort();
    assert_eq!(on_disk, named, "every file of the corpus is tested");
}

/// What a fuzzer found once: a scene has its triangles and its area, all else its one line.
#[test]
fn findings_of_fuzzing_load_or_are_refused_in_one_line() {
    const FOUND: &str = "tests/data/obj/found";
    /// Triangles and their area, or the message.
    type Expected = Result<(usize, f64), &'static str>;
    let cases: [(&str, Expected); 1] = [
        // A regular hexagon with one corner moved to its middle, which lies on the line between two others: four of six triangles.
        ("corner_on_a_line.obj", Ok((4, 2.0 * 0.3 * 0.259_808))),
    ];
    for (name, expected) in &cases {
        match (load(Path::new(FOUND).join(name)), expected) {
            (Ok(loaded), Ok((n_faces, expected_area))) => {
                let scene = loaded.scene;
                assert!(
                    scene.face_ids().all(|face| scene.area_vector(face).length() > 0.0),
                    "{name}"
                );
                assert_eq!(scene.faces.len(), *n_faces, "{name}");
                assert_close(area(&scene), *expected_area, 1e-12);
            }
            (Err(error), Err(message)) => assert_eq!(error.to_string(), format!("{FOUND}/{message}")),
            (result, _) => panic!("{name}: {:?}", result.map(|loaded| loaded.warnings)),
        }
    }
    let on_disk = std::fs::read_dir(FOUND).unwrap();
    let mut on_disk: Vec<String> = on_disk
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    on_disk.sort();
    assert_eq!(on_disk, cases.map(|(name, _)| name), "every finding is tested");
}

#[test]
fn files_that_cannot_be_read_say_why() {
    let directory = tempfile::tempdir().unwrap();
    let missing = directory.path().join("no.obj");
    let message = |path: &Path| load(path).unwrap_err().to_string();
    assert_eq!(
        message(&missing),
        format!("{}: no such file; check the path", missing.display())
    );
    let itself = directory.path();
    assert_eq!(
        message(itself),
        format!("{}: is a directory; name the file in it", itself.display())
    );

    let scene = directory.path().join("a.obj");
    std::fs::write(&scene, "mtllib sub\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let library = directory.path().join("sub");
    std::fs::create_dir(&library).unwrap();
    assert_eq!(
        message(&scene),
        format!("{}: is a directory; name the file in it", library.display())
    );
    assert_eq!(load(&scene).unwrap_err().kind(), "unreadable");
}

#[test]
fn of_several_libraries_those_that_are_there_are_read() {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("a.mtl"), "newmtl paint\nKd 0.25\n").unwrap();
    let scene = directory.path().join("a.obj");
    for (names, missing) in [
        ("a.mtl b.mtl", "b.mtl"),
        ("c.MTL a.mtl", "c.MTL"),
        (".\\a.mtl d.mtl", "d.mtl"),
    ] {
        let text = format!("mtllib {names}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl paint\nf 1 2 3\n");
        std::fs::write(&scene, text).unwrap();
        let loaded = load(&scene).unwrap();
        assert_eq!(
            loaded.scene.materials[0].reflectance.map(f64::to_bits),
            [0.25_f64.to_bits(); 3]
        );
        let of_libraries = loaded
            .warnings
            .iter()
            .filter(|warning| warning.kind() == "missing_library");
        let told: Vec<String> = of_libraries.map(ToString::to_string).collect();
        assert_eq!(told.len(), 1, "{told:?}");
        assert!(
            told[0].contains(&format!("material library `{missing}` is not there")),
            "{told:?}"
        );
    }
}

#[test]
fn libraries_outside_the_scenes_folder_need_leave() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path().join("scenes/room");
    std::fs::create_dir_all(folder.join("materials")).unwrap();
    let library = "newmtl paint\nKd 0.25\n";
    let quarter = [0.25_f64.to_bits(); 3];
    std::fs::write(directory.path().join("paint.mtl"), library).unwrap();
    std::fs::write(folder.join("materials/paint.mtl"), library).unwrap();
    std::os::unix::fs::symlink(directory.path(), folder.join("way_out")).unwrap();
    std::os::unix::fs::symlink(directory.path().join("paint.mtl"), folder.join("linked.mtl")).unwrap();
    std::os::unix::fs::symlink(folder.join("materials"), folder.join("way_in")).unwrap();
    let scene = folder.join("a.obj");
    let naming = |name: &str| {
        let text = format!("\nmtllib {name}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl paint\nf 1 2 3\n");
        std::fs::write(&scene, text).unwrap();
    };
    let absolute = directory.path().join("paint.mtl").display().to_string();
    for name in [
        "../../paint.mtl",
        "materials/../../../paint.mtl",
        "way_out/paint.mtl",
        "linked.mtl",
        &absolute,
        // As programs on Windows write it.
        "..\\..\\paint.mtl",
        ".\\materials\\..\\..\\../paint.mtl",
        // The second of two words.
        "materials/paint.mtl ../../paint.mtl",
    ] {
        naming(name);
        let error = load(&scene).unwrap_err();
        assert_eq!((error.kind(), error.line()), ("outside_folder", Some(2)));
        assert_eq!(
            error.to_string(),
            format!(
                "{}:2: the library `{name}` lies outside the scene's folder; move it there, or say allow_outside",
                scene.display()
            )
        );
        let leave = LoadOptions::default().allow_outside(true);
        let allowed = load_with(&scene, &leave).unwrap().scene;
        assert_eq!(allowed.materials[0].reflectance.map(f64::to_bits), quarter);
    }
    for name in [
        "materials/paint.mtl",
        "materials/../materials/paint.mtl",
        "../room/materials/paint.mtl",
        "way_in/paint.mtl",
        "materials\\paint.mtl",
        ".\\materials\\paint.mtl",
        &folder.join("materials/paint.mtl").display().to_string(),
    ] {
        naming(name);
        let found = load(&scene).unwrap().scene;
        assert_eq!(found.materials[0].reflectance.map(f64::to_bits), quarter);
    }
    // One of the same name beside the scene takes its place, unless it may be read.
    std::fs::write(folder.join("paint.mtl"), "newmtl paint\nKd 0.5\n").unwrap();
    naming("../../paint.mtl");
    let found = load(&scene).unwrap();
    let told: Vec<(&str, String)> = found.warnings.iter().map(|w| (w.kind(), w.to_string())).collect();
    let outside = told.iter().find(|(kind, _)| *kind == "library_outside");
    let (_, text) = outside.unwrap_or_else(|| panic!("{told:?}"));
    assert!(
        text.contains("--allow-outside") && !text.contains("is not there"),
        "{text}"
    );
    assert_eq!(
        found.scene.materials[0].reflectance.map(f64::to_bits),
        [0.5_f64.to_bits(); 3]
    );
    let allowed = load_with(&scene, &LoadOptions::default().allow_outside(true)).unwrap();
    assert_eq!(allowed.scene.materials[0].reflectance.map(f64::to_bits), quarter);
    // What is not there at all is a warning wherever it would be.
    naming("../../none.mtl");
    assert!(load(&scene).is_ok());
}

/// Returns a directory with a scene `a.obj` of one triangle, whose material `paint` is to be in `a.mtl` beside it.
fn painted_triangle() -> (tempfile::TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let scene = directory.path().join("a.obj");
    let text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl paint\nf 1 2 3\n";
    std::fs::write(&scene, text).unwrap();
    (directory, scene)
}

/// Textures are not read, wherever they would be: one that gives bytes without end does not stop the program.
#[test]
fn textures_are_not_opened() {
    let (directory, scene) = painted_triangle();
    for texture in [
        "/dev/zero",
        "../../etc/passwd",
        "..\\..\\secret.png",
        "-s 1 1 1 /dev/zero",
    ] {
        let library = format!(
            "newmtl paint\nKd 0.25 0.25 0.25\nKe 1\nmap_Kd {texture}\nmap_Ke {texture}\nbump {texture}\nmap_d {texture}\n"
        );
        std::fs::write(directory.path().join("a.mtl"), library).unwrap();
        let loaded = load(&scene).unwrap();
        assert_eq!(loaded.warnings.len(), 1, "{texture}: {:?}", loaded.warnings);
        let told = loaded.warnings[0].to_string();
        assert!(
            told.contains("a.mtl:4: the texture of material `paint` is not read"),
            "{told}"
        );
    }
}

#[test]
fn keywords_of_materials_are_read_in_any_case_and_a_texture_of_light_is_told_as_one() {
    let (directory, scene) = painted_triangle();
    let library = "NewMtl paint\nkd 0.25 0.5 0.75\nKE 2\nmap_ke lamp.png\n";
    std::fs::write(directory.path().join("a.mtl"), library).unwrap();
    let loaded = load(&scene).unwrap();
    let paint = &loaded.scene.materials[0];
    assert_eq!(
        paint.reflectance.map(f64::to_bits),
        [0.25_f64, 0.5, 0.75].map(f64::to_bits)
    );
    assert_eq!(paint.exitance.map(f64::to_bits), [2.0_f64; 3].map(f64::to_bits));
    let [told] = warnings(&loaded).try_into().unwrap();
    assert!(
        told.ends_with("a.mtl:4: the texture of material `paint` is not read; its `Ke` counts everywhere"),
        "{told}"
    );
}

#[test]
fn a_face_of_too_many_corners_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let file: PathBuf = directory.path().join("long.obj");
    let n = MAX_CORNERS as usize + 1;
    // A staircase: no two corners alike.
    let corners: Vec<DVec3> = (0..n).map(|k| DVec3::new(k as f64, (k % 7) as f64, 0.0)).collect();
    std::fs::write(&file, one_face(&corners)).unwrap();
    let error = load(&file).unwrap_err();
    assert_eq!(error.kind(), "too_many");
    assert!(
        error
            .to_string()
            .ends_with(": 1048576 corners in one face is the limit, and there are more; split the scene")
    );
}

/// An OBJ file with one face.
fn one_face(corners: &[DVec3]) -> String {
    let vertex = |v: &DVec3| format!("v {:?} {:?} {:?}", v.x, v.y, v.z);
    let vertices: Vec<String> = corners.iter().map(vertex).collect();
    let numbers: Vec<String> = (1..=corners.len()).map(|k| k.to_string()).collect();
    format!("{}\nf {}\n", vertices.join("\n"), numbers.join(" "))
}

/// A statement, sensible or not.
fn statement() -> impl Strategy<Value = String> {
    let number = prop_oneof![
        4 => (-3_i32..4).prop_map(|x| x.to_string()),
        2 => (-1.0_f64..1.0).prop_map(|x| format!("{x}")),
        1 => prop::sample::select(vec!["1e-300", "1e14", "nan", "x", "1/2", "#", "\\", "-1//"]).prop_map(str::to_owned),
    ];
    let keyword = prop_oneof![
        4 => Just("v"), 4 => Just("f"), 1 => prop::sample::select(vec!["o", "g", "usemtl", "l", "vt", "mtllib", "#", "\u{feff}v"]),
    ];
    (keyword, prop::collection::vec(number, 0..9)).prop_map(|(keyword, words)| format!("{keyword} {}", words.join(" ")))
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..ProptestConfig::with_cases(512)
    })]

    #[test]
    fn no_text_makes_the_loader_panic(statements in prop::collection::vec(statement(), 0..40)) {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("soup.obj");
        let vertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\n";
        std::fs::write(&file, format!("{vertices}{}\n", statements.join("\n"))).unwrap();
        match load(&file) {
            Ok(loaded) => {
                prop_assert!(!loaded.scene.faces.is_empty());
                for face in loaded.scene.face_ids() {
                    prop_assert!(loaded.scene.area_vector(face).length() > 0.0);
                }
            }
            Err(error) => prop_assert!(!error.to_string().contains('\n'), "{error}"),
        }
    }

    /// A polygon that is star-shaped about a point inside it never crosses itself: it is accepted, and its area is kept.
    #[test]
    fn star_shaped_polygons_keep_their_area(
        radii in prop::collection::vec(0.2_f64..2.0, 3..40),
        shift in prop::array::uniform3(-100.0_f64..100.0),
        turn in prop::array::uniform3(-3.0_f64..3.0),
    ) {
        let turn = glam::DMat3::from_euler(glam::EulerRot::XYZ, turn[0], turn[1], turn[2]);
        let n = radii.len();
        let corners: Vec<DVec3> = radii.iter().enumerate().map(|(k, r)| {
            let (s, c) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
            DVec3::from_array(shift) + turn * DVec3::new(r * c, r * s, 0.0)
        }).collect();
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("star.obj");
        std::fs::write(&file, one_face(&corners)).unwrap();
        let scene = load(&file).unwrap_or_else(|error| panic!("{error}")).scene;
        let n_triangles: usize = scene.faces.iter().map(|f| f.corners.as_slice().len() - 2).sum();
        prop_assert_eq!(n_triangles, n - 2);
        let expected = 0.5 * (std::f64::consts::TAU / n as f64).sin()
            * (0..n).map(|k| radii[k] * radii[(k + 1) % n]).sum::<f64>();
        let total = scene.face_ids().map(|f| scene.area_vector(f).length()).sum::<f64>();
        // The corners are rounded at a distance of up to 180 m: 3e-14 m each.
        prop_assert!((total - expected).abs() < 1e-11, "{} is not {}", total, expected);
    }
}

/// What lies on a larger face of its plane keeps its area, and the larger one the rest; of equal ones the later stays whole.
#[test]
fn faces_that_overlap_are_cut() {
    for (name, areas, cut) in [
        ("drawn_on_wall.obj", &[0.12, 14.88] as &[f64], (1, 10)),
        ("drawn_half.obj", &[0.5, 1.0], (1, 13)),
        // Both triangles share an edge: they are one piece of the file, which names no surfaces.
        ("drawn_diagonals.obj", &[0.75], (1, 6)),
    ] {
        let loaded = valid(name);
        let (found, lost) = cut_faces(&loaded.warnings).unwrap();
        assert_eq!(found, cut, "{name}");
        let mut by_surface = vec![0.0; loaded.scene.surfaces.len()];
        for (id, face) in loaded.scene.face_ids().zip(&loaded.scene.faces) {
            by_surface[face.surface.0 as usize] += loaded.scene.area_vector(id).length();
        }
        for (area, right) in by_surface.iter().zip(areas) {
            assert_close(*area, *right, 1e-12);
        }
        assert!(lost > 0.1 && by_surface.len() == areas.len(), "{name}");
        // The cut scene, written and read, is the same.
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("again.obj");
        radiosity::scene::write_obj(&loaded.scene, &file).unwrap();
        let again = load(&file).unwrap();
        assert_eq!(cut_faces(&again.warnings), None, "{name}");
        assert_eq!(again.scene.content_hash(), loaded.scene.content_hash(), "{name}");
    }
}
