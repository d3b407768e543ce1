//! Scenes from arrays: the same as from a file, and every refusal by its kind and its position.

use glam::DVec3;
use radiosity::scene::{
    Earlier, Material, MaterialId, Origin, Scene, SceneBuilder, SceneErrorKind, SceneWarningKind, SurfaceId, load,
};

fn grey(reflectance: f64, exitance: f64) -> Material {
    Material {
        name: "grey".into(),
        reflectance: [reflectance; 3],
        exitance: [exitance; 3],
    }
}

/// A builder with a surface and a material.
fn begun() -> (SceneBuilder, [SurfaceId; 1], [MaterialId; 1]) {
    let mut builder = SceneBuilder::new();
    let surface = builder.surface("floor").unwrap();
    let material = builder.material(grey(0.5, 0.0)).unwrap();
    (builder, [surface], [material])
}

/// A square that is turned out of the axes, so high.
fn square(height: f64) -> Vec<[f64; 3]> {
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.7);
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    corners
        .map(|(x, y)| (turn * DVec3::new(x, y, height)).to_array())
        .to_vec()
}

/// Builds faces over some vertices, and expects to be refused at a place for a reason.
#[track_caller]
fn expect_refused(faces: &[Vec<u32>], vertices: &[[f64; 3]], place: &str, reason: impl Fn(&SceneErrorKind) -> bool) {
    let (mut builder, surfaces, materials) = begun();
    let added = builder.faces(vertices, faces, &surfaces, &materials);
    let error = added.and_then(|()| builder.build()).unwrap_err();
    assert!(error.at.to_string() == place && reason(&error.kind), "{error:?}");
}

fn face(number: u32) -> Origin {
    Origin::Memory {
        element: format!("face {number}"),
    }
}

#[test]
fn faces_are_refused_by_their_number() {
    let two: Vec<[f64; 3]> = square(0.0).into_iter().chain(square(1.0)).collect();
    let first = || vec![0, 1, 2, 3];
    expect_refused(&[first(), vec![4, 5, 9]], &two, "face 1: ", |kind| {
        matches!(
            kind,
            SceneErrorKind::IndexOutOfRange {
                index: 9,
                n_vertices: 8
            }
        )
    });
    expect_refused(&[first(), vec![4, 5]], &two, "face 1: ", |kind| {
        matches!(kind, SceneErrorKind::TooFewCorners { count: 2 })
    });
    expect_refused(&[first(), vec![4, 6, 5, 7]], &two, "face 1: ", |kind| {
        matches!(kind, SceneErrorKind::SelfIntersecting)
    });
    expect_refused(
        &[first(), vec![4, 5, 6, 7], vec![2, 3, 0, 1]],
        &two,
        "face 2: ",
        |kind| {
            matches!(
                kind,
                SceneErrorKind::DuplicateFace {
                    first: Earlier::Number(0)
                }
            ) && kind.to_string().contains("repeats face 0")
        },
    );
    // Half of the first square again, as a triangle of its own, and the other half.
    expect_refused(&[first(), vec![0, 1, 2], vec![0, 2, 3]], &two, "face 1: ", |kind| {
        matches!(
            kind,
            SceneErrorKind::OverlappingFaces {
                first: Earlier::Number(0)
            }
        )
    });
    let mut bad = two.clone();
    bad[5][1] = f64::NAN;
    expect_refused(&[first()], &bad, "vertex 5: ", |kind| {
        matches!(kind, SceneErrorKind::BadCoordinate { .. })
    });
    expect_refused(&[], &two, "the scene: ", |kind| matches!(kind, SceneErrorKind::NoFaces));
}

#[test]
fn slices_have_one_for_each_face_or_one_for_all() {
    let (mut builder, [surface], materials) = begun();
    let faces = [[0, 1, 2], [0, 2, 3], [3, 2, 1]];
    let error = builder
        .faces(&square(0.0), &faces, &[surface; 2], &materials)
        .unwrap_err();
    assert!(
        matches!(
            error.kind,
            SceneErrorKind::NotOneEach {
                what: "surfaces",
                n: 2,
                n_faces: 3
            }
        ),
        "{error}"
    );
    builder
        .faces(&square(0.0), &faces[..2], &[surface; 2], &materials)
        .unwrap();
    assert_eq!(builder.build().unwrap().scene.faces.len(), 2);
}

#[test]
fn materials_are_refused_by_their_name() {
    for (reflectance, exitance, kind) in [
        (1.5, 0.0, "reflectance_out_of_range"),
        (f64::NAN, 0.0, "reflectance_out_of_range"),
        (0.5, -1.0, "exitance_out_of_range"),
        (0.5, f64::INFINITY, "exitance_out_of_range"),
        (0.5, 1e-320, "too_dim"),
    ] {
        let error = SceneBuilder::new().material(grey(reflectance, exitance)).unwrap_err();
        assert_eq!(
            (error.kind(), error.at.to_string().as_str()),
            (kind, "material `grey`: ")
        );
    }
    let mut builder = SceneBuilder::new();
    let surface = builder.surface("lamp").unwrap();
    let bright = builder.material(grey(0.5, 1e301)).unwrap();
    builder
        .faces(&square(0.0), &[[0, 1, 2, 3]], &[surface], &[bright])
        .unwrap();
    assert_eq!(builder.build().unwrap_err().kind(), "too_bright");
}

/// What faces lack is told with their number, and how many do.
#[test]
fn faces_without_an_area_are_skipped_and_told() {
    let (mut builder, surfaces, materials) = begun();
    let faces = [vec![0, 1, 2, 3], vec![0, 1, 0], vec![2, 3, 2]];
    builder.faces(&square(0.0), &faces, &surfaces, &materials).unwrap();
    let loaded = builder.build().unwrap();
    assert_eq!(loaded.scene.faces.len(), 1);
    let [warning] = &loaded.warnings[..] else {
        panic!("{:?}", loaded.warnings)
    };
    assert_eq!(
        (&warning.at, &warning.kind),
        (&face(1), &SceneWarningKind::ZeroAreaFaces { count: 2 })
    );
}

/// Gives the vertices and faces of a scene to a builder.
fn built_again(scene: &Scene) -> Scene {
    let mut builder = SceneBuilder::new();
    let of = |surface: &radiosity::scene::Surface| surface.name.clone();
    let surfaces: Vec<SurfaceId> = scene.surfaces.iter().map(|s| builder.surface(of(s)).unwrap()).collect();
    let materials: Vec<MaterialId> = scene
        .materials
        .iter()
        .map(|m| builder.material(m.clone()).unwrap())
        .collect();
    let vertices: Vec<[f64; 3]> = scene.vertices.iter().map(DVec3::to_array).collect();
    let corners: Vec<Vec<u32>> = scene.faces.iter().map(|f| f.corners.as_slice().to_vec()).collect();
    let of_faces: Vec<SurfaceId> = scene.faces.iter().map(|f| surfaces[f.surface.0 as usize]).collect();
    let made_of: Vec<MaterialId> = scene.faces.iter().map(|f| materials[f.material.0 as usize]).collect();
    builder.faces(&vertices, &corners, &of_faces, &made_of).unwrap();
    builder.build().unwrap().scene
}

/// The way to a scene does not matter: arrays give the same faces, surfaces and materials as a file.
#[test]
fn arrays_give_the_scene_of_a_file() {
    for name in ["cornell-box", "room-box", "corridor", "lewis-room"] {
        let file = format!("{}/scenes/{name}/scene.obj", env!("CARGO_MANIFEST_DIR"));
        let from_file = load(file).unwrap().scene;
        let from_arrays = built_again(&from_file);
        let outlines = |scene: &Scene| -> Vec<_> {
            let faces = scene.face_ids().zip(&scene.faces);
            faces
                .map(|(id, face)| (scene.polygon(id), face.surface, face.material))
                .collect()
        };
        assert_eq!(outlines(&from_arrays), outlines(&from_file), "{name}");
        assert_eq!(from_arrays.surfaces, from_file.surfaces, "{name}");
        assert_eq!(from_arrays.materials, from_file.materials, "{name}");
    }
}
