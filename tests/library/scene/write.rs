//! Scenes written to files, exactly, deterministically, and whole or not at all; and the scene's hash.

use std::path::Path;

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::FileFailurePersistence;
use radiosity::scene::{Corners, Face, Material, MaterialId, Scene, Surface, SurfaceId, builtin, load, write_obj};

fn material(name: &str, reflectance: f64) -> Material {
    Material {
        name: name.to_owned(),
        reflectance: [reflectance, 0.25, 1.0 / 3.0],
        exitance: [1e-7, 0.0, 1e22],
    }
}

/// Two triangles whose surfaces and materials stand in the other order.
fn crossed() -> Scene {
    let face = |v: [u32; 3], surface: u32| Face {
        corners: Corners::Triangle(v),
        surface: SurfaceId(surface),
        material: MaterialId(surface),
        line: 0,
    };
    Scene {
        vertices: vec![
            DVec3::ZERO,
            DVec3::new(0.1, 0.0, -1e-6),
            DVec3::new(0.3, 1.0 / 3.0, 1e3),
            DVec3::Z,
        ],
        faces: vec![face([0, 1, 2], 1), face([0, 2, 3], 0)],
        surfaces: ["first", "the second #2"]
            .map(|name| Surface { name: name.to_owned() })
            .to_vec(),
        materials: vec![material("Material #1", 0.1), material("b", 0.9)],
        ..Scene::default()
    }
}

fn read(directory: &Path, name: &str) -> String {
    std::fs::read_to_string(directory.join(name)).unwrap()
}

#[test]
fn a_scene_is_written_as_expected() {
    let directory = tempfile::tempdir().unwrap();
    write_obj(&crossed(), directory.path().join("two faces.obj")).unwrap();
    assert_eq!(
        read(directory.path(), "two faces.obj"),
        "mtllib two faces.mtl\n\
         v 0.0 0.0 0.0\nv 0.1 0.0 -1e-6\nv 0.3 0.3333333333333333 1000.0\nv 0.0 0.0 1.0\n\
         o first\no the second #2\n\
         o the second #2\nusemtl b\nf 1 2 3\no first\nusemtl Material #1\nf 1 3 4\n"
    );
    assert_eq!(
        read(directory.path(), "two faces.mtl"),
        "newmtl Material #1\nKd 0.1 0.25 0.3333333333333333\nKe 1e-7 0.0 1e22\n\
         newmtl b\nKd 0.9 0.25 0.3333333333333333\nKe 1e-7 0.0 1e22\n"
    );
    let loaded = load(directory.path().join("two faces.obj")).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    assert_eq!(loaded.scene.content_hash(), crossed().content_hash());
    let names: Vec<_> = std::fs::read_dir(directory.path()).unwrap().collect();
    assert_eq!(names.len(), 2, "no temporary file is left");
}

#[test]
fn writing_replaces_a_file_whole() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("a.obj");
    std::fs::write(&file, "x".repeat(100_000)).unwrap();
    write_obj(&crossed(), &file).unwrap();
    assert!(read(directory.path(), "a.obj").ends_with("f 1 3 4\n"));
}

#[test]
fn what_cannot_be_written_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let error = |scene: &Scene, name: &str| write_obj(scene, directory.path().join(name)).unwrap_err();
    assert_eq!(error(&crossed(), "a.mtl").kind(), "not_obj");
    assert_eq!(error(&crossed(), "a").kind(), "not_obj");
    let missing = error(&crossed(), "no/such/a.obj");
    assert_eq!((missing.kind(), missing.file().is_some()), ("unwritable", true));
    for name in ["", " a", "a\nb", "the second #2"] {
        let mut scene = crossed();
        name.clone_into(&mut scene.surfaces[0].name);
        assert_eq!(error(&scene, "a.obj").kind(), "unwritable_name", "{name:?}");
    }
    let mut scene = crossed();
    scene.materials[1].name = "Material #1".to_owned();
    assert_eq!(
        error(&scene, "a.obj").to_string(),
        "the material name \"Material #1\" cannot be written (empty, repeated, framed by blanks, or of several lines); rename it"
    );
    assert_eq!(
        std::fs::read_dir(directory.path()).unwrap().count(),
        0,
        "nothing is left behind"
    );
}

#[test]
fn the_hash_is_of_the_content() {
    let directory = tempfile::tempdir().unwrap();
    let hash = |text: &str| {
        std::fs::write(directory.path().join("m.mtl"), "newmtl a\nKd 0.5\nnewmtl b\nKd 0.25\n").unwrap();
        std::fs::write(directory.path().join("a.obj"), format!("mtllib m.mtl\n{text}")).unwrap();
        load(directory.path().join("a.obj")).unwrap().scene.content_hash()
    };
    let plain = hash("v 0 0 0\nv 1 0 0\nv 0 1 0\no s\nusemtl a\nf 1 2 3\n");
    assert_eq!(plain.len(), 64);
    assert!(plain.chars().all(|c| c.is_ascii_digit() || ('a'..='f').contains(&c)));
    let formatted = "# hello\nv 9 9 9\nv 0.0 -0 0\nv 0 1.0e0 0\nv 1 0 0\ng none\ng s\nusemtl b\nusemtl a\nf 2 4 3\n";
    assert_eq!(hash(formatted), plain);
    for other in [
        "v 0 0 0\nv 1 0 0\nv 0 1.0000000000000002 0\no s\nusemtl a\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\no t\nusemtl a\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\no s\nusemtl b\nf 1 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\no s\nusemtl a\nf 1 3 2\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\no s\nusemtl a\nf 1 2 3\nf 1 3 2\n",
    ] {
        assert_ne!(hash(other), plain, "{other}");
    }
    let hashes: std::collections::HashSet<_> = builtin::names()
        .map(|name| builtin::build(name, None).unwrap().scene.content_hash())
        .collect();
    assert_eq!(hashes.len(), builtin::names().len());
}

#[test]
fn channels_and_emission_follow_the_materials_in_use() {
    let mut scene = crossed();
    assert!(scene.is_emitting());
    assert_eq!(scene.n_channels_needed(), 3);
    for m in &mut scene.materials {
        (m.reflectance, m.exitance) = ([0.5; 3], [0.0; 3]);
    }
    assert!(!scene.is_emitting());
    assert_eq!(scene.n_channels_needed(), 1);
    scene.materials.push(material("colourful and unused", 0.3));
    assert!(!scene.is_emitting());
    assert_eq!(scene.n_channels_needed(), 1);
    scene.materials[0].exitance[1] = 1.0;
    assert!(scene.is_emitting());
    assert_eq!(scene.n_channels_needed(), 3);
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource("regressions"))),
        ..ProptestConfig::with_cases(64)
    })]

    #[test]
    fn every_coordinate_comes_back_to_the_bit(
        x in prop::array::uniform2(-1.0_f64..1.0),
        exponent in prop::array::uniform2(-300_i32..0),
        z in 1.0_f64..1e3,
    ) {
        let mut scene = crossed();
        let [x, y] = [0, 1].map(|k| x[k] * 10.0_f64.powi(exponent[k]));
        scene.vertices[3] = DVec3::new(x, y, z);
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("a.obj");
        write_obj(&scene, &file).unwrap();
        let back = load(&file).unwrap().scene;
        prop_assert_eq!(back.content_hash(), scene.content_hash());
    }
}
