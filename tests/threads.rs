//! Equal bytes at any number of threads, for every command that computes.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "support/program.rs"]
mod program;

use program::succeed as run;
use serde_json::Value;

/// Removes what is allowed to differ: times and memory.
fn without_measurements(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.retain(|name, _| !name.ends_with("_s") && name != "stages" && name != "memory_peak_byte");
            members.values_mut().for_each(without_measurements);
        }
        Value::Array(items) => items.iter_mut().for_each(without_measurements),
        _ => {}
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a list of commands")]
fn every_command_gives_equal_bytes_at_one_two_and_four_threads() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    run(at, &["scene", "room-box", "-o", "s.obj"]);
    run(at, &["scene", "cube", "-o", "cube.obj"]);
    let sr = ["--method", "sr", "--rays", "300"];
    let cases: Vec<(Vec<&str>, Option<&str>)> = vec![
        (
            [
                &["form-factors", "s.obj", "--subdivide", "3"][..],
                &sr,
                &["-o", "o.npz"],
            ]
            .concat(),
            Some("o.npz"),
        ),
        (
            vec!["form-factors", "s.obj", "--subdivide", "2", "-o", "o.npz"],
            Some("o.npz"),
        ),
        (
            vec!["form-factors", "s.obj", "--method", "qmc", "-o", "o.mtx"],
            Some("o.mtx"),
        ),
        (
            vec![
                "form-factors",
                "s.obj",
                "--subdivide",
                "2",
                "--storage",
                "disk",
                "-o",
                "o.npy",
            ],
            Some("o.npy"),
        ),
        (vec!["solve", "s.obj", "--subdivide", "3", "-o", "o.csv"], Some("o.csv")),
        (
            [
                &["solve", "s.obj", "--solver", "multigrid", "--subdivide", "4"][..],
                &sr,
                &["-o", "o.npz"],
            ]
            .concat(),
            Some("o.npz"),
        ),
        (
            [
                &["solve", "s.obj", "--on-the-fly", "--solver", "gmres"][..],
                &sr,
                &["-o", "o.vtu"],
            ]
            .concat(),
            Some("o.vtu"),
        ),
        (
            vec!["render", "s.obj", "--max-edge", "0.5", "--width", "40", "-o", "o.exr"],
            Some("o.exr"),
        ),
        (
            vec![
                "render",
                "s.obj",
                "--max-edge",
                "0.5",
                "--width",
                "40",
                "-o",
                "o.exr",
                "--flat",
            ],
            Some("o.png"),
        ),
        (
            vec!["voxel", "s.obj", "--voxels", "16", "--radius", "4", "-o", "o.vtu"],
            Some("o.vtu"),
        ),
        (
            vec![
                "voxel",
                "s.obj",
                "--voxels",
                "16",
                "--radius",
                "4",
                "--links",
                "disk",
                "--link-file",
                "o.links",
            ],
            Some("o.links"),
        ),
        (
            vec![
                "voxel",
                "s.obj",
                "--voxels",
                "16",
                "--radius",
                "4",
                "--adaptive",
                "0.1",
                "-o",
                "o.exr",
            ],
            Some("o.exr"),
        ),
    ];
    for (arguments, file) in &cases {
        let with = |threads: &str| {
            if let Some(file) = file {
                std::fs::remove_file(at.join(file)).ok();
            }
            let text = run(at, &[arguments, &["--threads", threads, "--json"][..]].concat());
            let mut document: Value = serde_json::from_slice(&text).unwrap();
            without_measurements(&mut document);
            (document, file.map(|file| std::fs::read(at.join(file)).unwrap()))
        };
        let one = with("1");
        for threads in ["2", "4"] {
            let more = with(threads);
            assert_eq!(one.0, more.0, "{arguments:?} at {threads} threads");
            assert!(one.1 == more.1, "{arguments:?} at {threads} threads: {file:?} differs");
        }
    }
    // What verifies says the same, too.
    run(
        at,
        &[
            "render", "cube.obj", "--camera", "unfolded", "--width", "8", "-o", "o.exr",
        ],
    );
    let [one, four] = ["1", "4"].map(|threads| {
        let mut document: Value =
            serde_json::from_slice(&run(at, &["verify", "o.exr", "--json", "--threads", threads])).unwrap();
        without_measurements(&mut document);
        document
    });
    assert_eq!(one, four);
}
