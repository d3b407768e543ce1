//! Equal bytes at any number of threads, for every command that computes.

use std::path::Path;

use serde_json::Value;

use crate::cases::n_cases;
use crate::program::succeed as run;

/// Removes what is allowed to differ: times, memory, and what tells how many threads there were.
pub(crate) fn without_measurements(value: &mut Value) {
    match value {
        Value::Object(members) => {
            const MEASURED: [&str; 3] = ["stages", "memory_peak_bytes", "machine"];
            members.retain(|name, _| !name.ends_with("_s") && !MEASURED.contains(&name.as_str()));
            members.values_mut().for_each(without_measurements);
        }
        Value::Array(items) => items.iter_mut().for_each(without_measurements),
        _ => {}
    }
}

/// Runs a command at 1 and 4 threads, with all cases at 2 too: what it tells and the files that it writes are the same.
fn expect_equal(at: &Path, arguments: &[&str], files: &[&str]) {
    let with = |threads: &str| {
        for file in files {
            std::fs::remove_file(at.join(file)).ok();
        }
        let text = run(at, &[arguments, &["--threads", threads, "--json"]].concat());
        let mut document: Value = serde_json::from_slice(&text).unwrap();
        without_measurements(&mut document);
        let read = |file: &&str| std::fs::read(at.join(file)).unwrap();
        (document, files.iter().map(read).collect::<Vec<_>>())
    };
    let one = with("1");
    for &threads in n_cases(&["4"][..], &["2", "4"]) {
        let more = with(threads);
        assert_eq!(one.0, more.0, "{arguments:?} at {threads} threads");
        assert!(one.1 == more.1, "{arguments:?} at {threads} threads: {files:?} differ");
    }
}

/// A command line, and the files that it writes.
type Case<'a> = (&'a str, &'a [&'a str]);

#[test]
fn pictures_and_fields_give_equal_bytes_at_any_number_of_threads() {
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    run(at, &["scene", "room-box", "-o", "s.obj"]);
    run(at, &["scene", "cube", "-o", "cube.obj"]);
    let scene = std::fs::read_to_string(at.join("s.obj")).unwrap();
    let mut names = scene
        .lines()
        .filter_map(|line| line.strip_prefix("o ").or(line.strip_prefix("g ")));
    let side = names.find(|name| name.starts_with("box")).unwrap();
    std::fs::write(
        at.join("f.toml"),
        format!(
            "[[frame]]\nname = \"a\"\n[[frame]]\nname = \"b\"\n[[frame.move]]\nsurface = \"{side}\"\ntranslate = [0.05, 0, 0]\n\
             [[frame]]\nname = \"c\"\ncamera = \"unfolded\"\n"
        ),
    )
    .unwrap();
    let frames: &[&str] = &["o-a.exr", "o-b.exr", "o-c.exr", "o-a.png", "o-b.png", "o-c.png"];
    let cases: [Case<'_>; 11] = [
        ("field s.obj --surface SIDE --width 24 -o o.exr", &["o.exr", "o.png"]),
        (
            "field s.obj --surface SIDE --width 24 --method qmc -o o.exr",
            &["o.exr"],
        ),
        (
            "field s.obj --surface SIDE --width 16 --method sr --rays 64 -o o.exr",
            &["o.exr"],
        ),
        ("render s.obj --frames f.toml --subdivide 2 --width 24 -o o.exr", frames),
        (
            "render s.obj --frames f.toml --subdivide 2 --width 12 --final-gather --noise 0.1 -o o.exr",
            frames,
        ),
        (
            "render s.obj --on-the-fly --method sr --rays 64 --subdivide 2 --width 24 -o o.exr",
            &["o.exr"],
        ),
        (
            "solve s.obj --subdivide 2 --form-factor-tolerance 1e-9 -o o.vtu",
            &["o.vtu"],
        ),
        (
            "solve cube.obj --subdivide 12 --storage disk --precision f32 -o o.npz",
            &["o.npz"],
        ),
        (
            "form-factors s.obj --subdivide 2 --method hemicube --resolution 32 -o o.csv",
            &["o.csv"],
        ),
        (
            "voxel s.obj --voxels 20 --radius 4 --solver gmres --links recompute -o o.vtu",
            &["o.vtu"],
        ),
        ("scene sphere-room-r1 -o o.obj", &["o.obj"]),
    ];
    for (line, files) in cases {
        let words: Vec<&str> = line
            .split(' ')
            .map(|word| if word == "SIDE" { side } else { word })
            .collect();
        expect_equal(at, &words, files);
    }
}

#[test]
#[expect(clippy::too_many_lines, reason = "a list of commands")]
fn every_command_gives_equal_bytes_at_any_number_of_threads() {
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
        expect_equal(at, arguments, file.as_slice());
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
