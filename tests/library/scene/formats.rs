//! Scenes in the formats of other programs: the same room of all of them, the division into surfaces, and the options of reading.

#![expect(clippy::shadow_unrelated, reason = "each case has a text and an error of its own")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use radiosity::form_factor::ExactMethod;
use radiosity::matrix::{FormFactors, SurfaceFormFactors};
use radiosity::scene::{
    Flip, Format, LengthUnit, LoadOptions, Loaded, Material, Origin, Scene, SceneErrorKind, SceneWarningKind, UpAxis,
    load, load_with,
};

use crate::support::rooms::Prepared;
use crate::support::worst_error;

const DATA: &str = "tests/data/formats";
const NAMES: [&str; 7] = ["floor", "ceiling", "x0", "x1", "y0", "y1", "block"];
const NUMBERED: [&str; 7] = [
    "surface1", "surface2", "surface3", "surface4", "surface5", "surface6", "surface7",
];

fn file(name: &str) -> PathBuf {
    Path::new(DATA).join(name)
}

fn read(name: &str) -> Loaded {
    load(file(name)).unwrap_or_else(|error| panic!("{error}"))
}

fn surface_names(scene: &Scene) -> Vec<&str> {
    scene.surfaces.iter().map(|s| s.name.as_str()).collect()
}

/// Returns the material of the first face of a surface, by the surface's place in [`NAMES`].
fn material_of(scene: &Scene, surface: &str) -> Material {
    let k = NAMES.iter().position(|known| *known == surface).unwrap();
    let face = scene.faces.iter().find(|face| face.surface.0 as usize == k).unwrap();
    scene.materials[face.material.0 as usize].clone()
}

fn kinds(loaded: &Loaded) -> Vec<&'static str> {
    loaded
        .warnings
        .iter()
        .map(radiosity::scene::SceneWarning::kind)
        .collect()
}

/// The files of a kind, `triangles` or `quads`.
fn files(kind: &str) -> Vec<String> {
    let entries = std::fs::read_dir(DATA).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names.filter(|name| name.starts_with(kind)).collect();
    names.sort();
    names
}

/// Returns F from one surface to another.
fn between(factors: &SurfaceFormFactors, i: usize, j: usize) -> f64 {
    factors.form_factor[i * factors.n_surfaces + j]
}

fn exact(scene: Scene) -> FormFactors {
    let method = ExactMethod {
        tolerance: 1e-6,
        ..ExactMethod::default()
    };
    Prepared::new(scene, 1).compute(&method)
}

/// Files of f64, text or binary; the others are of f32, or of text with fewer digits, and hold as many digits of form factors.
fn holds_all_digits(name: &str) -> bool {
    let is_single = ["stl", "glb", "gltf"].iter().any(|suffix| name.ends_with(suffix))
        || ["pyvista-binary.ply", "big-endian", "trimesh", "pyvista-ascii"]
            .iter()
            .any(|part| name.contains(part));
    !is_single
}

#[test]
fn the_same_room_of_every_program_has_the_same_form_factors() {
    for (kind, n_faces, n_files) in [("triangles", 24, 40), ("quads", 12, 26)] {
        let names = files(kind);
        assert!(names.len() >= n_files, "{names:?}");
        let reference = exact(read(&format!("{kind}-meshio-binary.vtk")).scene);
        let mut worst = [0.0_f64; 2];
        for name in &names {
            let scene = read(name).scene;
            assert_eq!(scene.faces.len(), n_faces, "{name}");
            let volume: f64 = scene
                .face_ids()
                .map(|f| scene.area_vector(f).dot(scene.polygon(f)[0]))
                .sum::<f64>()
                / 3.0;
            // The walls face inwards, the block outwards.
            let expected = 0.8 * 0.6 * 1.1 - 3.1 * 4.2 * 2.7;
            assert!((volume - expected).abs() < 1e-5, "{name}: {volume}");
            let factors = exact(scene);
            let all = holds_all_digits(name);
            for i in 0..n_faces {
                for j in 0..n_faces {
                    let off = (factors.get(i, j) - reference.get(i, j)).abs();
                    let stated = factors.std_error(i, j) + reference.std_error(i, j);
                    // Text has 12 to 17 digits, as its program writes them.
                    let bound = match (all, name.contains("gmsh") || name.contains("ascii")) {
                        (true, false) => 1e-12,
                        (true, true) => stated.min(1e-8),
                        _ => stated + 1e-12,
                    };
                    assert!(off <= bound, "{name} {i} {j}: {off:e}, stated {stated:e}");
                    worst[usize::from(all)] = worst[usize::from(all)].max(off);
                }
            }
            let stated = worst_error(&factors);
            assert!(stated <= if all { 1e-6 } else { 3e-5 }, "{name}: {stated:e}");
        }
        // What f32 leaves of them is seen.
        assert!(worst[0] > 1e-10 && worst[0] < 1e-5 && worst[1] < 1e-8, "{worst:?}");
    }
}

#[test]
fn surfaces_are_what_the_file_says_or_pieces_between_creases() {
    let walls =
        |step: usize, kind: &str| -> Vec<String> { (0..12).map(|k| format!("{kind}{}", k * step + 1)).collect() };
    for name in files("triangles") {
        let scene = read(&name).scene;
        let found = surface_names(&scene);
        // Of version 4.1, meshio writes the names of groups, but not what is in them.
        if name.contains(".msh") && !name.contains("meshio-41") || name.contains("trimesh.gl") {
            assert_eq!(found, NAMES, "{name}");
        } else if name.contains(".vt") {
            assert_eq!(found, NUMBERED, "{name}");
        } else {
            // STL, OBJ without groups, and PLY, into which none of these programs puts values of faces.
            assert_eq!(found, walls(2, "part"), "{name}");
        }
    }
    assert_eq!(surface_names(&read("quads-meshio-plain.obj").scene), walls(1, "face"));
    let named = |name: &str| {
        let options = LoadOptions::default().surface_array(Some("name".to_owned()));
        load_with(file(name), &options).unwrap().scene
    };
    for name in [
        "triangles-pyvista-binary.vtu",
        "triangles-pyvista-ascii.vtu",
        "quads-pyvista-grid.vtk",
    ] {
        assert_eq!(surface_names(&named(name)), NAMES, "{name}");
    }
    let missing = LoadOptions::default().surface_array(Some("nothing".to_owned()));
    let error = load_with(file("quads-pyvista-grid.vtk"), &missing).unwrap_err();
    assert!(
        matches!(&error.kind, SceneErrorKind::UnknownArray { known, .. } if known.contains("`surface`, `name`")),
        "{error}"
    );
}

/// The walls of a room are apart, those of a tube of twelve sides are one piece, until the angle says otherwise.
#[test]
fn creases_part_surfaces_at_an_angle() {
    let n = 12_u32;
    let mut text = String::new();
    for k in 0..n {
        let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / f64::from(n)).sin_cos();
        let _ = writeln!(text, "v {cos:.9} {sin:.9} 0\nv {cos:.9} {sin:.9} 2");
    }
    for k in 0..n {
        let (a, b) = (2 * k + 1, 2 * ((k + 1) % n) + 1);
        let _ = writeln!(text, "f {a} {b} {}\nf {a} {} {}", b + 1, b + 1, a + 1);
    }
    let bottom: Vec<String> = (0..n).rev().map(|k| (2 * k + 1).to_string()).collect();
    let _ = writeln!(text, "f {}", bottom.join(" "));
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("tube.obj");
    std::fs::write(&path, &text).unwrap();
    let names = |options: LoadOptions| {
        let scene = load_with(&path, &options).unwrap().scene;
        surface_names(&scene).into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(names(LoadOptions::default()), ["part1", "face25"]);
    let facets: Vec<String> = (0..n)
        .map(|k| format!("part{}", 2 * k + 1))
        .chain(["face25".into()])
        .collect();
    assert_eq!(names(LoadOptions::default().crease_angle(29.0)), facets);
    assert_eq!(names(LoadOptions::default().crease_angle(31.0)), ["part1", "face25"]);
    assert_eq!(names(LoadOptions::default().crease_angle(90.0)), ["part1"]);
    assert_eq!(names(LoadOptions::default().one_surface(true)), ["default"]);
    // A piece can be named to be turned.
    let options = LoadOptions::default().flip(Flip::Surfaces(vec!["face25".into()]));
    let turned = load_with(&path, &options).unwrap().scene;
    let last = turned.face_ids().last().unwrap();
    assert!(turned.area_vector(last).z > 0.0);
    let options = LoadOptions::default().flip(Flip::Surfaces(vec!["face26".into()]));
    let error = load_with(&path, &options).unwrap_err();
    assert!(error.to_string().contains("`part1`, `face25`"), "{error}");
}

#[test]
fn lengths_and_axes_are_those_of_the_scene() {
    let plain = read("quads-meshio-binary.vtk").scene;
    for (unit, metres) in [
        (LengthUnit::Millimetre, 1e-3),
        (LengthUnit::Centimetre, 1e-2),
        (LengthUnit::Inch, 0.0254),
        (LengthUnit::Foot, 0.3048),
    ] {
        let options = LoadOptions::default().unit(unit).up_axis(UpAxis::Y);
        for name in [
            "quads-meshio-binary.vtk",
            "quads-gmsh-41-ascii.msh",
            "quads-vtk-big-endian.ply",
        ] {
            let scene = load_with(file(name), &options).unwrap().scene;
            for (a, b) in plain.faces.iter().zip(&scene.faces) {
                let corners = a.corners.as_slice().iter().zip(b.corners.as_slice());
                for (v, w) in corners {
                    let DVec3 { x, y, z } = plain.vertices[*v as usize];
                    let expected = metres * DVec3::new(x, -z, y);
                    let off = scene.vertices[*w as usize].distance(expected);
                    assert!(off <= 1e-6 * metres, "{name} {unit:?}: {off:e}");
                }
            }
            // A step of a coordinate is as much smaller.
            let written = scene.written.unwrap();
            let ratio = written.unit(3.1 * metres) / read(name).scene.written.unwrap().unit(3.1);
            assert!((ratio / metres - 1.0).abs() < 1e-9, "{name} {unit:?}: {ratio:e}");
        }
    }
}

#[test]
fn rounding_is_that_of_the_file() {
    for (name, expected) in [
        ("triangles-trimesh-binary.stl", "to f32"),
        ("triangles-vtk-big-endian.ply", "to f32"),
        ("triangles-meshio-binary.ply", "to 17 digits"),
        ("triangles-pyvista-ascii.vtk", "to 11 digits"),
    ] {
        let scene = read(name).scene;
        let written = scene.written.unwrap();
        assert!(written.shows_rounding(), "{name}");
        if name.contains("binary.ply") {
            assert!(written.unit(1.0) < 1e-14, "{name}");
        } else {
            assert_eq!(written.to_string(), expected, "{name}");
        }
    }
    // 24 bits: the step of an f32 at 3.1 is 2^-22.
    let written = read("triangles-trimesh-binary.stl").scene.written.unwrap();
    assert!((written.unit(3.1) - 2.0_f64.powi(-22)).abs() < 1e-20);
}

/// Each triangle has vertices of its own, which differ in the last bits: they are told, and joined where that is wanted.
#[test]
fn nearly_equal_vertices_are_told_and_joined() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("shaken.stl");
    let original = std::fs::read(file("triangles-trimesh-binary.stl")).unwrap();
    let mut bytes = original.clone();
    for triangle in (0..24).step_by(2) {
        for corner in 0..3 {
            let at = 84 + 50 * triangle + 12 + 12 * corner;
            let x = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            bytes[at..at + 4].copy_from_slice(&(x + 4e-7).to_le_bytes());
        }
    }
    std::fs::write(&path, &bytes).unwrap();
    let told = load(&path).unwrap();
    let near = told.warnings.iter().find_map(|warning| match warning.kind {
        SceneWarningKind::NearlyEqualVertices { count, .. } => Some(count),
        _ => None,
    });
    assert!(
        near.is_some_and(|count| (8..=24).contains(&count)),
        "{:?}",
        told.warnings
    );
    assert!(told.scene.vertices.len() > 16);
    let joined = load_with(&path, &LoadOptions::default().merge_tolerance(1e-5)).unwrap();
    assert_eq!(joined.scene.vertices.len(), 16);
    assert!(kinds(&joined).contains(&"merged_vertices"), "{:?}", joined.warnings);
    // What was moved counts as rounding.
    assert!(joined.scene.written.unwrap().unit(1.0) >= 4e-7);
    assert_eq!(surface_names(&joined.scene).len(), 12);
    let untouched = read("triangles-trimesh-binary.stl");
    assert_eq!(untouched.scene.vertices.len(), 16);
    assert_eq!(kinds(&untouched), ["no_materials", "no_emission"]);
}

#[test]
fn what_is_no_face_is_told() {
    let first = read("box-gmsh-order-1.msh");
    let names = ["surface1", "surface2", "surface3", "surface4", "surface5", "surface6"];
    assert_eq!(surface_names(&first.scene), names);
    assert!(kinds(&first).contains(&"skipped_elements"), "{:?}", first.warnings);
    let second = read("box-gmsh-order-2.msh");
    assert_eq!(surface_names(&second.scene), names);
    assert_eq!(second.scene.faces.len(), first.scene.faces.len());
    assert!(kinds(&second).contains(&"higher_order"), "{:?}", second.warnings);
    for scene in [&first.scene, &second.scene] {
        let area: f64 = scene.face_ids().map(|f| scene.area_vector(f).length()).sum();
        assert!(
            (area - 2.0 * (3.1 * 4.2 + 3.1 * 2.7 + 4.2 * 2.7)).abs() < 1e-9,
            "{area}"
        );
    }
}

#[test]
fn the_materials_of_gltf_are_reflectance_and_exitance() {
    for name in ["triangles-trimesh.glb", "triangles-trimesh.gltf"] {
        let loaded = read(name);
        assert!(loaded.scene.is_emitting(), "{name}");
        let of = |surface: &str| material_of(&loaded.scene, surface);
        let ceiling = of("ceiling");
        for (channel, (factor, colour)) in [(1.0, 128.0), (0.8, 102.0), (0.6, 51.0)].into_iter().enumerate() {
            let off = ceiling.exitance[channel] / (std::f64::consts::PI * factor) - 1.0;
            assert!(off.abs() < 1e-12, "{name}: {:?}", ceiling.exitance);
            assert!(
                (ceiling.reflectance[channel] - colour / 255.0).abs() < 1e-6,
                "{name}: {:?}",
                ceiling.reflectance
            );
        }
        assert_eq!(of("floor").exitance.map(f64::to_bits), [0; 3]);
    }
}

/// A name beats a pattern, whatever their order, and the surface beats the material.
#[test]
fn materials_come_from_a_file() {
    let directory = tempfile::tempdir().unwrap();
    let paints = directory.path().join("paints.toml");
    let text = "[surface.\"*\"]\nreflectance = 0.2\n[surface.ceiling]\nexitance = [3.0, 2.0, 1.0]\n\
                [surface.\"x*\"]\nreflectance = 0.7\n[surface.x1]\nreflectance = 0.9\n[material.unassigned]\nreflectance = 0.1\n";
    std::fs::write(&paints, text).unwrap();
    let options = LoadOptions::default().materials(Some(paints.clone()));
    let loaded = load_with(file("triangles-gmsh-41-binary.msh"), &options).unwrap();
    assert_eq!(loaded.warnings, []);
    let of = |name: &str| material_of(&loaded.scene, name);
    for (name, reflectance) in [
        ("floor", 0.2),
        ("ceiling", 0.2),
        ("x0", 0.7),
        ("x1", 0.9),
        ("block", 0.2),
    ] {
        assert_eq!(
            of(name).reflectance.map(f64::to_bits),
            [f64::to_bits(reflectance); 3],
            "{name}"
        );
    }
    assert_eq!(
        of("ceiling").exitance.map(f64::to_bits),
        [3.0_f64, 2.0, 1.0].map(f64::to_bits)
    );
    let mut names: Vec<_> = loaded.scene.materials.iter().map(|m| m.name.clone()).collect();
    names.sort();
    names.dedup();
    assert_eq!(names.len(), loaded.scene.materials.len());
    // What is left bare is told.
    std::fs::write(&paints, "[surface.ceiling]\nexitance = 1.0\n").unwrap();
    assert_eq!(
        kinds(&load_with(file("triangles-gmsh-41-binary.msh"), &options).unwrap()),
        ["no_materials"]
    );
    std::fs::write(&paints, "[surface.\"door*\"]\nexitance = 1.0\n").unwrap();
    let error = load_with(file("triangles-gmsh-41-binary.msh"), &options).unwrap_err();
    assert_eq!(error.line(), Some(1), "{error}");
    assert!(error.to_string().contains("door*"), "{error}");
}

#[test]
fn formats_are_known_by_content_then_by_suffix() {
    let directory = tempfile::tempdir().unwrap();
    for (name, format) in [
        ("triangles-trimesh-binary.stl", "stl"),
        ("triangles-trimesh-ascii.stl", "stl"),
        ("triangles-meshio-binary.ply", "ply"),
        ("triangles-gmsh-22-binary.msh", "msh"),
        ("triangles-pyvista-binary.vtk", "vtk"),
        ("triangles-pyvista-binary.vtu", "vtk"),
        ("triangles-pyvista-binary.vtp", "vtk"),
        ("triangles-trimesh.glb", "gltf"),
        ("triangles-trimesh.gltf", "gltf"),
        ("triangles-trimesh-plain.obj", "obj"),
        ("view3d/l-room.vs3", "vs3"),
        ("view3d/l-room-by-origins.vs3", "vs3"),
    ] {
        assert_eq!(Format::of(file(name)).unwrap().name(), format, "{name}");
        for suffix in ["", "dat", "obj", "stl"] {
            let other = directory.path().join("scene").with_extension(suffix);
            std::fs::copy(file(name), &other).unwrap();
            assert_eq!(Format::of(&other).unwrap().name(), format, "{name} as {suffix}");
        }
    }
    for (suffix, format) in [
        ("stl", "stl"),
        ("VTU", "vtk"),
        ("glb", "gltf"),
        ("vs3", "vs3"),
        ("txt", "obj"),
    ] {
        let empty = directory.path().join("empty").with_extension(suffix);
        std::fs::write(&empty, "").unwrap();
        assert_eq!(Format::of(&empty).unwrap().name(), format, "{suffix}");
    }
    let stl = Format::named("STL");
    assert!(stl.is_some() && Format::named("step").is_none());
    let error = load_with(file("triangles-trimesh-plain.obj"), &LoadOptions::default().format(stl)).unwrap_err();
    assert_eq!(error.kind(), "truncated", "{error}");
}

/// The L-shaped room of View3D's manual, once by vertices and once by origins and angles, and its parts that are combined.
#[test]
fn keywords_of_stl_are_read_in_any_case() {
    let directory = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(file("triangles-trimesh-ascii.stl")).unwrap();
    for (name, text) in [
        ("a.stl", text.to_uppercase()),
        ("b", text.replacen("solid", "Solid", 1)),
    ] {
        let path = directory.path().join(name);
        std::fs::write(&path, text).unwrap();
        let loaded = load(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            loaded.scene.faces.len(),
            read("triangles-trimesh-ascii.stl").scene.faces.len()
        );
    }
}

#[test]
fn view3d_has_its_surfaces_parts_and_emissivities() {
    let names = [
        "south",
        "east",
        "inner-north",
        "inner-east",
        "north",
        "west",
        "ceiling",
        "floor",
    ];
    let [by_vertices, by_origins] = ["l-room.vs3", "l-room-by-origins.vs3"].map(|name| read(&format!("view3d/{name}")));
    for loaded in [&by_vertices, &by_origins] {
        assert_eq!(surface_names(&loaded.scene), names);
        assert_eq!(kinds(loaded), ["no_emission"]);
        let reflectance = |name: &str| {
            let k = names.iter().position(|known| *known == name).unwrap();
            let face = loaded
                .scene
                .faces
                .iter()
                .find(|face| face.surface.0 as usize == k)
                .unwrap();
            loaded.scene.materials[face.material.0 as usize].reflectance[0]
        };
        for (name, expected) in [("south", 0.1), ("inner-east", 0.2), ("floor", 0.5)] {
            assert!((reflectance(name) - expected).abs() < 1e-15, "{name}");
        }
    }
    let [one, other] = [by_vertices, by_origins].map(|loaded| {
        let prepared = Prepared::new(loaded.scene, 1);
        let factors = prepared.compute(&ExactMethod {
            tolerance: 1e-7,
            ..ExactMethod::default()
        });
        prepared.by_surface(&factors)
    });
    for i in 0..8 {
        let sum: f64 = (0..8).map(|j| between(&one, i, j)).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{i}: {sum}");
        for j in 0..8 {
            assert!((between(&one, i, j) - between(&other, i, j)).abs() < 1e-6, "{i} {j}");
        }
    }
}

#[test]
fn view3d_has_subsurfaces_masks_null_surfaces_and_obstructions() {
    let loaded = read("view3d/window-mask-null.vs3");
    let scene = &loaded.scene;
    assert_eq!(
        surface_names(scene),
        ["wall", "wall-2", "window", "mask", "hole", "obstructions"]
    );
    assert_eq!(
        kinds(&loaded),
        ["moved_masks", "black_surfaces", "black_surfaces", "no_emission"]
    );
    let area = |k: u32| -> f64 {
        let own = scene.face_ids().filter(|f| scene.faces[f.0 as usize].surface.0 == k);
        own.map(|f| scene.area_vector(f).length()).sum()
    };
    for (k, expected) in [(0, 0.96), (1, 0.75), (2, 0.25), (3, 0.04), (4, 0.04), (5, 0.02)] {
        assert!((area(k) - expected).abs() < 1e-12, "{k}: {}", area(k));
    }
    let prepared = Prepared::new(scene.clone(), 1);
    let factors = prepared.compute(&ExactMethod {
        tolerance: 1e-6,
        ..ExactMethod::default()
    });
    let factors = prepared.by_surface(&factors);
    // The mask sees its base alone, and this sees it, but for the gap.
    assert!(
        (between(&factors, 3, 0) - 1.0).abs() < 1e-3,
        "{}",
        between(&factors, 3, 0)
    );
    assert!(
        (between(&factors, 0, 3) * 0.96 - 0.04).abs() < 1e-4,
        "{}",
        between(&factors, 0, 3)
    );
    assert!(between(&factors, 1, 3) < 1e-12 && between(&factors, 2, 3) < 1e-12);
    assert!(between(&factors, 1, 4) > 1e-3 && between(&factors, 2, 5) > 1e-4);
}

/// Cells of more or fewer points than their type has are refused by number, type and counts; none becomes another face.
#[test]
fn cells_of_vtk_have_the_points_of_their_type() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("a.vtk");
    let points = "0 0 0\n1 0 0\n2 0 0\n0 1 0\n1 1 0\n2 1 0\n0 2 0\n1 2 0\n2 2 0\n";
    let refused = |kind: u8, n: usize| {
        let own: Vec<String> = (0..n).map(|k| k.to_string()).collect();
        let (first, size) = ("3 0 1 3", n + 5);
        let text = format!(
            "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 9 double\n{points}\
             CELLS 2 {size}\n{first}\n{n} {}\nCELL_TYPES 2\n5 {kind}\n",
            own.join(" ")
        );
        std::fs::write(&path, text).unwrap();
        load(&path).err().map(|error| error.to_string())
    };
    for (kind, n) in [(5, 3), (8, 4), (9, 4), (22, 6), (23, 8), (28, 9), (30, 6), (34, 7)] {
        for wrong in [n - 1, n + 1].into_iter().filter(|wrong| *wrong < 10) {
            let error = refused(kind, wrong).unwrap_or_else(|| panic!("type {kind} of {wrong} points"));
            for part in [
                "cell 1",
                &format!("{n} points in a cell of type {kind} ("),
                &format!("found `{wrong}`"),
            ] {
                assert!(error.contains(part), "{part}: {error}");
            }
        }
    }
    for (kind, n) in [(6, 2), (36, 7)] {
        let error = refused(kind, n).unwrap_or_else(|| panic!("type {kind} of {n} points"));
        assert!(error.contains(&format!("of type {kind} (")), "{error}");
    }
    let text = std::fs::read_to_string(file("triangles-pyvista-ascii.vtu")).unwrap();
    let start = text.find("Name=\"types\"").unwrap();
    let types = start + text[start..].find('\n').unwrap();
    let first = types + text[types..].find('5').unwrap();
    std::fs::write(&path, format!("{}9{}", &text[..first], &text[first + 1..])).unwrap();
    let error = load(&path).unwrap_err().to_string();
    assert!(
        error.contains("cell 0") && error.contains("4 points in a cell of type 9 (quad)"),
        "{error}"
    );
}

#[test]
fn what_is_wrong_has_its_place() {
    let directory = tempfile::tempdir().unwrap();
    let refused = |name: &str, content: &[u8]| {
        let path = directory.path().join(name);
        std::fs::write(&path, content).unwrap();
        let error = load(&path).expect_err(name);
        assert_eq!(error.to_string().lines().count(), 1, "{error}");
        error
    };
    let stl = std::fs::read(file("triangles-trimesh-binary.stl")).unwrap();
    let mut not_a_number = stl.clone();
    not_a_number[84 + 50 * 3 + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = refused("nan.stl", &not_a_number);
    let element = |error: &radiosity::scene::SceneError| match &error.at {
        Origin::Element { element, .. } => element.clone(),
        other => panic!("{other:?}"),
    };
    assert_eq!(
        (error.kind(), element(&error)),
        ("bad_coordinate", "triangle 4".to_owned())
    );
    // The sixth triangle again.
    let mut repeated = stl.clone();
    repeated.copy_within(84 + 50 * 5..84 + 50 * 6, 84 + 50 * 9);
    let error = refused("repeated.stl", &repeated);
    assert_eq!(
        (error.kind(), element(&error)),
        ("duplicate_face", "triangle 10".to_owned())
    );
    assert!(error.to_string().contains("repeats triangle 6"), "{error}");
    let text = std::fs::read_to_string(file("triangles-meshio-ascii.ply")).unwrap();
    let error = refused(
        "index.ply",
        text.replace("\n3 8 9 ", "\n3 8 99 ")
            .replace("\n3 8 11 ", "\n3 8 99 ")
            .as_bytes(),
    );
    assert_eq!(error.kind(), "index_out_of_range");
    assert!(error.line().is_some(), "{error}");
    let text = std::fs::read_to_string(file("triangles-gmsh-22-ascii.msh")).unwrap();
    let error = refused("word.msh", text.replace("0 0 2.7", "0 zero 2.7").as_bytes());
    assert_eq!(error.kind(), "bad_coordinate");
    let line = text.lines().position(|line| line.ends_with("0 0 2.7")).unwrap() + 1;
    assert_eq!(error.line(), u32::try_from(line).ok(), "{error}");
    let text = std::fs::read_to_string(file("triangles-pyvista-ascii.vtu")).unwrap();
    let error = refused(
        "type.vtu",
        text.replace("type=\"Float64\"", "type=\"Float65\"").as_bytes(),
    );
    assert!(error.kind() == "malformed" && error.line().is_some(), "{error}");
    let text = std::fs::read_to_string(file("triangles-trimesh.gltf")).unwrap();
    assert_eq!(
        refused("cut.gltf", &text.as_bytes()[..text.len() / 2]).kind(),
        "malformed"
    );
    let text = std::fs::read_to_string(file("view3d/l-room.vs3")).unwrap();
    let error = refused("base.vs3", text.replace("S  3    6   7", "S  3    6  77").as_bytes());
    assert_eq!(
        (error.kind(), error.line()),
        ("index_out_of_range", Some(24)),
        "{error}"
    );
}
