//! Scene files that nearly have their format: the scenes that are read from them, or the reasons of their refusal.

use std::path::PathBuf;

use radiosity::scene::{LoadOptions, Loaded, SceneError, SceneErrorKind, SceneWarningKind, load, load_with};
use tempfile::TempDir;

/// A square in two triangles, at a height.
fn square(z: f32) -> Vec<[[f32; 3]; 3]> {
    let [a, b, c, d] = [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
    vec![[a, b, c], [a, c, d]]
}

/// A solid of binary STL that states so many triangles.
fn solid(name: &str, n_stated: u32, triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = name.as_bytes().to_vec();
    bytes.resize(80, 0);
    bytes.extend(n_stated.to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn written(name: &str, content: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

fn read(name: &str, content: &[u8]) -> Result<Loaded, SceneError> {
    let (_folder, path) = written(name, content);
    load(path)
}

fn refusal(name: &str, content: &[u8]) -> String {
    read(name, content)
        .expect_err("a file that is refused")
        .kind
        .to_string()
}

fn surface_names(loaded: &Loaded) -> Vec<&str> {
    loaded.scene.surfaces.iter().map(|s| s.name.as_str()).collect()
}

#[test]
fn solids_of_binary_stl_one_after_another_are_surfaces() {
    let (low, high) = (square(0.0), square(1.0));
    let mut bytes = solid("floor", 2, &low);
    bytes.extend(solid("solid roof", 2, &high));
    let loaded = read("two.stl", &bytes).unwrap();
    assert_eq!(surface_names(&loaded), ["floor", "solid roof"]);
    assert_eq!(loaded.scene.faces.len(), 4);
    // Padding is no solid: less than a triangle, or headers of none.
    for n_blanks in [3, 49, 84, 300] {
        let mut padded = solid("Exported by a program", 2, &low);
        padded.resize(padded.len() + n_blanks, 0);
        let one = read("padded.stl", &padded).unwrap();
        assert_eq!(surface_names(&one), ["part1"], "{n_blanks} bytes");
    }
}

#[test]
fn triangles_that_binary_stl_does_not_state_are_not_left_out() {
    let mut many = square(0.0);
    many.extend(square(1.0));
    for n_stated in [0, 1, 2, 3] {
        let message = refusal("short.stl", &solid("", n_stated, &many));
        let expected = format!("expected the end of the file, or another solid, after {n_stated} triangles");
        assert!(message.starts_with(&expected), "{message}");
    }
    assert!(read("whole.stl", &solid("", 4, &many)).is_ok());
    assert!(refusal("long.stl", &solid("", 5, &many)).contains("states 5 triangles and has room for 4"));
}

#[test]
fn a_file_of_no_known_format_is_refused_as_that() {
    let off = b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for (name, content) in [("a.off", &off[..]), ("a.3mf", b"PK\x03\x04\xff\xfe\x00"), ("a", b"")] {
        let message = refusal(name, content);
        assert!(
            message.starts_with("the format is none of OBJ, STL"),
            "{name}: {message}"
        );
    }
    // By its suffix or by its content it is OBJ, which has no faces.
    for (name, content) in [("a.obj", &b"# empty\n"[..]), ("a.txt", b"v 0 0 0\nv 1 0 0\n")] {
        let error = read(name, content).expect_err("no faces");
        assert!(matches!(error.kind, SceneErrorKind::NoFaces), "{name}: {error}");
    }
}

#[test]
fn a_cell_array_of_a_format_without_any_is_refused() {
    let (_folder, path) = written("square.stl", &solid("", 2, &square(0.0)));
    let options = LoadOptions::default().surface_array(Some("surface".to_owned()));
    let error = load_with(path, &options).expect_err("no arrays");
    assert!(matches!(error.kind, SceneErrorKind::UnknownArray { .. }), "{error}");
}

#[test]
fn view3d_without_an_end_of_data_is_doubtful() {
    let open = "F 3\nV 1 0 0 0\nV 2 1 0 0\nV 3 0 1 0\nS 1 1 2 3 0 0 0 0.9 floor\n";
    let is_told = |text: &str| {
        let loaded = read("one.vs3", text.as_bytes()).unwrap();
        let mut kinds = loaded.warnings.iter().map(|warning| &warning.kind);
        kinds.any(|kind| matches!(kind, SceneWarningKind::NoEnd { .. }))
    };
    assert!(is_told(open));
    assert!(!is_told(&format!("{open}End of data\n")));
    assert!(!is_told(&format!("{open}*\n")));
}

#[test]
fn physical_groups_without_faces_are_told() {
    let mesh = |tags: &str| {
        format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 \"floor\"\n$EndPhysicalNames\n\
             $Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n$Elements\n1\n1 2 {tags} 1 2 3\n$EndElements\n"
        )
    };
    let empty = read("a.msh", mesh("2 0 1").as_bytes()).unwrap();
    let is_told = |kind: &SceneWarningKind| matches!(kind, SceneWarningKind::EmptyGroups { count: 1 });
    assert!(empty.warnings.iter().any(|warning| is_told(&warning.kind)));
    let named = read("a.msh", mesh("2 7 1").as_bytes()).unwrap();
    assert_eq!(surface_names(&named), ["floor"]);
    assert!(!named.warnings.iter().any(|warning| is_told(&warning.kind)));
    let parametric = mesh("2 7 1").replace("$Nodes", "$ParametricNodes");
    assert!(refusal("a.msh", parametric.as_bytes()).starts_with("`$ParametricNodes` are not read"));
}

#[test]
fn colours_of_vertices_and_deep_trees_of_gltf_are_told() {
    let gltf = |nodes: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"scene":0,"nodes":[{nodes}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":0}}}}]}}],
            "buffers":[{{"byteLength":36,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}]}}"#
        )
    };
    let loaded = read("a.gltf", gltf(r#"{"mesh":0}"#).as_bytes()).unwrap();
    let kinds: Vec<_> = loaded.warnings.iter().map(|warning| &warning.kind).collect();
    assert!(
        kinds.contains(&&SceneWarningKind::UnusedColours { count: 1 }),
        "{kinds:?}"
    );
    let mut chain: Vec<String> = (1..2000).map(|k| format!(r#"{{"children":[{k}]}}"#)).collect();
    chain.push(r#"{"mesh":0}"#.to_owned());
    let message = refusal("a.gltf", gltf(&chain.join(",")).as_bytes());
    assert!(
        message.starts_with("expected at most 1024 nodes below one another"),
        "{message}"
    );
}

/// A triangle in glTF: its version, the fields of its node, of its material, of its buffer view and of its accessor.
fn triangle(version: &str, [node, material, view, accessor]: [&str; 4]) -> String {
    format!(
        r#"{{"asset":{{"version":"{version}"}},"nodes":[{{"mesh":0{node}}}],"materials":[{{{material}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "buffers":[{{"byteLength":36,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36{view}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"{accessor}}}]}}"#
    )
}

#[test]
fn what_gltf_forbids_is_refused_in_its_own_keys() {
    let strength = |x: &str| {
        format!(
            r#""emissiveFactor":[1,1,1],"extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":{x}}}}}"#
        )
    };
    let (negative, bright, text) = (strength("-2"), strength("1e305"), strength("\"5\""));
    for (fields, message) in [
        (
            ["", "", r#","byteStride":4"#, ""],
            "expected a `byteStride` of the 12 bytes of an element, or more, found `4`",
        ),
        (
            ["", "", "", r#","byteOffset":9223372036854775804"#],
            "expected a `byteOffset` within the buffer view, found `9223372036854775804`",
        ),
        (
            ["", "", "", r#","byteOffset":4"#],
            "the file states 3 elements of an accessor and has room for 2",
        ),
        (
            ["", "", r#","byteOffset":12"#, ""],
            "the file states 36 bytes of a buffer view and has room for 24",
        ),
        (
            [r#","matrix":[1,0,0,0.5,0,1,0,0,0,0,1,0,0,0,0,1]"#, "", "", ""],
            "expected a `matrix` with the last row 0 0 0 1, found `0.5 0 0 1`",
        ),
        (
            [r#","rotation":[0,0,0,0]"#, "", "", ""],
            "expected a `rotation` of length 1, found `0 0 0 0`",
        ),
        (
            [
                "",
                r#""pbrMetallicRoughness":{"baseColorFactor":[0.5,2,0.5,1]}"#,
                "",
                "",
            ],
            "reflectance `baseColorFactor` 2 is outside [0, 1]",
        ),
        (
            ["", r#""emissiveFactor":[0,-1,0]"#, "", ""],
            "exitance `emissiveFactor` -1 is negative",
        ),
        (["", &negative, "", ""], "exitance `emissiveStrength` -2 is negative"),
        (
            ["", &bright, "", ""],
            "exitance `π × emissiveFactor × emissiveStrength` 3.14",
        ),
        (["", &text, "", ""], "expected a number as `emissiveStrength`"),
    ] {
        let found = refusal("a.gltf", triangle("2.0", fields).as_bytes());
        assert!(found.starts_with(message), "{message}: {found}");
    }
    for (version, content) in [
        ("1.0", triangle("1.0", [""; 4])),
        ("1.1", r#"{"asset":{"version":"1.1"},"nodes":{}}"#.to_owned()),
    ] {
        let found = refusal("a.gltf", content.as_bytes());
        assert!(
            found.starts_with(&format!("glTF of version {version} is not read")),
            "{found}"
        );
    }
}

#[test]
fn rotations_that_are_scaled_and_copies_of_gltf_are_told() {
    let kinds = |node: &str| {
        let loaded = read("a.gltf", triangle("2.0", [node, "", "", ""]).as_bytes()).unwrap();
        loaded
            .warnings
            .into_iter()
            .map(|warning| warning.kind)
            .collect::<Vec<_>>()
    };
    let scaled = SceneWarningKind::ScaledRotations { count: 1 };
    let copies = SceneWarningKind::UnreadCopies { count: 1 };
    assert!(kinds(r#","rotation":[0,0,1,1]"#).contains(&scaled));
    let instancing = r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}}"#;
    assert!(kinds(instancing).contains(&copies));
    let plain = kinds(r#","rotation":[0,0,0.70710678,0.70710678]"#);
    assert!(!plain.contains(&scaled) && !plain.contains(&copies), "{plain:?}");
    let missing = SceneWarningKind::MissingReflectance {
        keyword: "baseColorFactor",
        name: "material0".to_owned(),
    };
    assert!(plain.contains(&missing), "{plain:?}");
}
