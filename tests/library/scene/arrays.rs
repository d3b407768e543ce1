//! Scenes from arrays: their agreement with scenes from files, and refusals.

#![expect(clippy::shadow_unrelated, reason = "every step of a test names its own results")]

use std::fmt::Write as _;

use radiosity::scene::{
    Arrays, Flip, LengthUnit, LoadOptions, Loaded, SceneError, SceneErrorKind, SceneWarningKind, from_arrays, load,
};

/// A unit cube that faces inwards, moved and cut into triangles where that is wanted.
struct Cube {
    vertices: Vec<[f64; 3]>,
    corners: Vec<u32>,
    ends: Vec<usize>,
}

impl Cube {
    fn new(offset: f64, in_triangles: bool) -> Self {
        let at = |k: u32, axis: u32| offset + f64::from(k >> axis & 1);
        let vertices = (0..8).map(|k| [at(k, 0), at(k, 1), at(k, 2)]).collect();
        let sides = [
            [0, 1, 3, 2],
            [4, 6, 7, 5],
            [0, 4, 5, 1],
            [1, 5, 7, 3],
            [3, 7, 6, 2],
            [2, 6, 4, 0],
        ];
        let faces: Vec<Vec<u32>> = sides
            .into_iter()
            .flat_map(|[a, b, c, d]| {
                if in_triangles {
                    vec![vec![a, b, c], vec![a, c, d]]
                } else {
                    vec![vec![a, b, c, d]]
                }
            })
            .collect();
        let ends = faces.iter().scan(0, |end, face| {
            *end += face.len();
            Some(*end)
        });
        Self {
            ends: ends.collect(),
            corners: faces.concat(),
            vertices,
        }
    }

    fn arrays(&self) -> Arrays<'_> {
        Arrays {
            vertices: &self.vertices,
            corners: &self.corners,
            ends: &self.ends,
            surface_names: &[],
            surfaces: &[],
            reflectance: &[[0.5; 3]],
            exitance: &[[0.0; 3]],
        }
    }

    fn scene(&self) -> Result<Loaded, SceneError> {
        from_arrays(&self.arrays(), &LoadOptions::default())
    }
}

fn names(loaded: &Loaded) -> Vec<&str> {
    loaded
        .scene
        .surfaces
        .iter()
        .map(|surface| surface.name.as_str())
        .collect()
}

#[test]
fn arrays_and_files_are_one_scene() {
    let cube = Cube::new(0.125, true);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("cube.obj");
    let mut text = String::new();
    for [x, y, z] in &cube.vertices {
        writeln!(text, "v {x:?} {y:?} {z:?}").unwrap();
    }
    for face in cube.corners.chunks(3) {
        writeln!(text, "f {} {} {}", face[0] + 1, face[1] + 1, face[2] + 1).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let (here, there) = (cube.scene().unwrap(), load(&path).unwrap());
    assert_eq!(names(&here), names(&there));
    assert_eq!(names(&here), ["part1", "part3", "part5", "part7", "part9", "part11"]);
    assert_eq!(here.scene.vertices, there.scene.vertices);
    for (a, b) in here.scene.faces.iter().zip(&there.scene.faces) {
        assert_eq!((a.corners, a.surface), (b.corners, b.surface));
    }
}

#[test]
fn surfaces_and_materials_are_those_of_the_faces() {
    let cube = Cube::new(0.0, false);
    let surface_names = ["side", "end"].map(str::to_owned);
    let reflectance = [0.1, 0.2, 0.1, 0.2, 0.3, 0.1].map(|rho| [rho; 3]);
    let arrays = Arrays {
        surface_names: &surface_names,
        surfaces: &[1, 1, 0, 0, 0, 0],
        reflectance: &reflectance,
        exitance: &[[1.0, 2.0, 3.0]],
        ..cube.arrays()
    };
    let loaded = from_arrays(&arrays, &LoadOptions::default()).unwrap();
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    let scene = &loaded.scene;
    assert_eq!(scene.materials.len(), 3, "one for each reflectance");
    for (k, face) in scene.faces.iter().enumerate() {
        assert_eq!(
            scene.surfaces[face.surface.0 as usize].name,
            if k < 2 { "end" } else { "side" }
        );
        let material = &scene.materials[face.material.0 as usize];
        assert_eq!(
            (material.reflectance, material.exitance),
            (reflectance[k], [1.0, 2.0, 3.0])
        );
    }
}

#[test]
fn units_windings_and_distances_are_those_of_the_options() {
    let mut cube = Cube::new(0.0, false);
    let options = LoadOptions::default().unit(LengthUnit::Centimetre).flip(Flip::All);
    let loaded = from_arrays(&cube.arrays(), &options).unwrap();
    let (low, high) = loaded.scene.bounding_box();
    assert!((high - low - glam::DVec3::splat(0.01)).length() < 1e-15);
    let area: f64 = loaded
        .scene
        .face_ids()
        .map(|face| loaded.scene.area_vector(face).length())
        .sum();
    assert!((area - 6e-4).abs() < 1e-15);
    let first = loaded.scene.face_ids().next().unwrap();
    assert!(loaded.scene.area_vector(first).z < 0.0, "the floor looks down");
    // A vertex of its own for one face, a hair off the others.
    cube.vertices.push([0.0, 0.0, 1e-9]);
    cube.corners[20] = 8;
    let joined = from_arrays(&cube.arrays(), &LoadOptions::default().merge_tolerance(1e-6)).unwrap();
    assert_eq!(joined.scene.vertices.len(), 8);
    let merged = |kind: &SceneWarningKind| matches!(kind, SceneWarningKind::MergedVertices { count: 1, .. });
    assert!(
        joined.warnings.iter().any(|warning| merged(&warning.kind)),
        "{:?}",
        joined.warnings
    );
}

#[test]
fn refusals_name_the_face_or_the_vertex() {
    let refused = |change: fn(&mut Cube)| {
        let mut cube = Cube::new(0.0, false);
        change(&mut cube);
        let error = cube.scene().expect_err("refused");
        (error.at.to_string().trim_end_matches(": ").to_owned(), error.kind)
    };
    let (at, kind) = refused(|cube| cube.vertices[3][1] = f64::NAN);
    assert!(
        at == "vertex 3" && matches!(kind, SceneErrorKind::BadCoordinate { .. }),
        "{at} {kind:?}"
    );
    let (at, kind) = refused(|cube| cube.vertices[7][0] = 1e30);
    assert!(
        at == "vertex 7" && matches!(kind, SceneErrorKind::BadCoordinate { .. }),
        "{at} {kind:?}"
    );
    let (at, kind) = refused(|cube| cube.corners[5] = 8);
    assert!(
        at == "face 1" && matches!(kind, SceneErrorKind::IndexOutOfRange { .. }),
        "{at} {kind:?}"
    );
    let (at, kind) = refused(|cube| {
        cube.corners.truncate(22);
        cube.ends[5] = 22;
    });
    assert!(
        at == "face 5" && matches!(kind, SceneErrorKind::TooFewCorners { count: 2 }),
        "{at} {kind:?}"
    );
    let (at, kind) = refused(|cube| {
        cube.corners.extend_from_within(0..4);
        cube.ends.push(28);
    });
    assert!(
        at == "face 6" && matches!(kind, SceneErrorKind::DuplicateFace { .. }),
        "{at} {kind:?}"
    );
    let cube = Cube::new(0.0, false);
    let arrays = Arrays {
        reflectance: &[[1.5; 3]],
        ..cube.arrays()
    };
    let error = from_arrays(&arrays, &LoadOptions::default()).unwrap_err();
    assert!(
        matches!(error.kind, SceneErrorKind::ReflectanceOutOfRange { .. }),
        "{error}"
    );
    let nothing = Arrays {
        corners: &[],
        ends: &[],
        ..cube.arrays()
    };
    let error = from_arrays(&nothing, &LoadOptions::default()).unwrap_err();
    assert!(matches!(error.kind, SceneErrorKind::NoFaces), "{error}");
}
