//! Faces that end where walls stand on them, and those that do not.

use serde_json::Value;
use tempfile::TempDir;

use super::program::{document, radiosity, stderr};

/// A turned room of 4 m × 4 m × 3 m with a wall across it, whose ends are so far from the bright side.
fn divided_room(feet: [f64; 2]) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let materials = "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\nKe 1\n";
    std::fs::write(directory.path().join("scene.mtl"), materials).unwrap();
    let turned = |x: f64, y: f64, z: u32| format!("v {} {} {z}\n", 0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
    let plan = [
        (0.0, 0.0),
        (4.0, 0.0),
        (4.0, 4.0),
        (0.0, 4.0),
        (feet[0], 0.0),
        (feet[1], 4.0),
    ];
    let levels = [0, 3].into_iter();
    let vertices: String = levels.flat_map(|z| plan.map(|(x, y)| turned(x, y, z))).collect();
    let faces = [
        ("floor", "1 2 3 4"),
        ("ceiling", "10 9 8 7"),
        ("front", "7 11 5 1"),
        ("front_dark", "11 8 2 5"),
        ("dark", "8 9 3 2"),
        ("back_dark", "9 12 6 3"),
        ("back", "12 10 4 6"),
        ("wall", "5 6 12 11"),
        ("wall_dark", "11 12 6 5"),
    ];
    let faces = faces.map(|(name, corners)| format!("o {name}\nf {corners}\n")).concat();
    let lamp = "usemtl lamp\no lamp\nf 10 7 1 4\n";
    let text = format!("mtllib scene.mtl\n{vertices}usemtl grey\n{faces}{lamp}");
    std::fs::write(directory.path().join("scene.obj"), text).unwrap();
    directory
}

/// A wall parts a turned room in two: where it runs across the patches of floor and ceiling, these reach from one side to the other; where it stands on their borders, none does.
#[test]
fn light_that_passes_under_a_wall_is_warned_of() {
    let warned = |feet: [f64; 2], n: &str| {
        let directory = divided_room(feet);
        let output = radiosity(directory.path(), &["solve", "scene.obj", "--subdivide", n]);
        assert!(output.status.success(), "{output:?}");

        // What is beyond the wall is dark where faces end at it.
        let arguments = ["solve", "scene.obj", "--subdivide", n, "--cut-at-walls", "--json"];
        let cut = radiosity(directory.path(), &arguments);
        assert!(cut.status.success(), "{cut:?}");
        assert_eq!(stderr(&cut), "");
        let cut: Value = serde_json::from_slice(&cut.stdout).unwrap();
        assert_eq!(cut["settings"]["cut_at_walls"], true);
        let radiosity = |name: &str| {
            let surfaces = cut["surfaces"].as_array().unwrap();
            surfaces.iter().find(|own| own["name"] == name).unwrap()["radiosity"][0]
                .as_f64()
                .unwrap()
        };
        assert!(
            ["dark", "wall", "back_dark"]
                .iter()
                .all(|name| radiosity(name).to_bits() == 0)
        );
        assert!(radiosity("floor") > 0.1);
        stderr(&output).contains("the mesh is too coarse for `")
    };
    assert!(warned([2.9, 3.1], "4") && warned([2.9, 3.1], "12"));
    assert!(!warned([2.0, 2.0], "4"));
}

#[test]
fn form_factors_of_cut_faces_are_used_again() {
    let directory = divided_room([2.9, 3.1]);
    let run = |arguments: &[&str]| document(directory.path(), arguments);
    let cut = ["--subdivide", "2", "--cut-at-walls"];
    let made = run(&[&["form-factors", "scene.obj", "-o", "cut.npz"], &cut[..]].concat()).1;
    run(&["form-factors", "scene.obj", "-o", "whole.npz", "--subdivide", "2"]);
    for flags in [&[][..], &cut, &["--cut-at-walls"]] {
        let (code, solved) = run(&[&["solve", "scene.obj", "--form-factors", "cut.npz"], flags].concat());
        assert_eq!((code, &solved["n_patches"]), (0, &made["n_patches"]), "{flags:?}");
    }
    let arguments = ["solve", "scene.obj", "--form-factors", "whole.npz", "--cut-at-walls"];
    let refused = radiosity(directory.path(), &arguments);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("whole.npz is for --subdivide 2 without --cut-at-walls"));
}

#[test]
fn pictures_cut_faces_of_themselves_and_sequences_say_by_what() {
    let directory = divided_room([2.9, 3.1]);
    let render = |more: &[&str]| {
        let cheap = [
            "render",
            "scene.obj",
            "-o",
            "out.exr",
            "--width",
            "8",
            "--method",
            "sr",
            "--rays",
            "16",
            "--json",
        ];
        let output = radiosity(directory.path(), &[&cheap, more].concat());
        assert!(output.status.success(), "{output:?}");
        (
            serde_json::from_slice::<Value>(&output.stdout).unwrap(),
            stderr(&output),
        )
    };
    assert_eq!(render(&[]).0["settings"]["cut_at_walls"], true);
    assert_eq!(render(&["--max-edge", "1"]).0["settings"]["cut_at_walls"], Value::Null);
    let said = "faces end at walls where these stand in scene.obj";
    for (move_, expected) in [
        ("", false),
        (
            "[[frame.move]]\nsurface = [\"wall\", \"wall_dark\"]\ntranslate = [-0.5, 0, 0]\n",
            true,
        ),
    ] {
        std::fs::write(
            directory.path().join("frames.toml"),
            format!("[[frame]]\nname = \"a\"\n{move_}"),
        )
        .unwrap();
        assert_eq!(
            render(&["--frames", "frames.toml"]).1.contains(said),
            expected,
            "{move_}"
        );
    }
}
