//! A full disk: every command that writes reports it in one line that names the file, and leaves no half-written file.
//!
//! The disk is a tmpfs of one process; skipped, with a word, where the system does not let a test mount one.
#![cfg(target_os = "linux")]

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use crate::program::{PROGRAM, stderr, succeed};

/// What a command left behind.
struct Ended {
    output: Output,
    /// The names on the small disk afterwards.
    left: Vec<String>,
}

/// Runs the program in `directory`, where `full/` is a disk with room for `page` pages of 4096 bytes.
fn on_small_disk(directory: &Path, page: u32, arguments: &[&str]) -> Ended {
    // Names of its own for mounts: the disk goes with the last process that sees it.
    let script = format!(
        "mount -t tmpfs -o size={}k none full || exit 99; \"$0\" \"$@\"; code=$?; ls -A full >left; exit $code",
        4 * page
    );
    let output = Command::new("unshare")
        .args(["--mount", "--map-root-user", "--user", "sh", "-c", &script, PROGRAM])
        .args(arguments)
        .current_dir(directory)
        .output()
        .unwrap();
    let left = std::fs::read_to_string(directory.join("left")).unwrap_or_default();
    Ended {
        output,
        left: left.lines().map(str::to_owned).collect(),
    }
}

/// Returns a folder with a scene and an empty folder `full`, or `None` where no disk can be mounted.
#[expect(clippy::print_stderr, reason = "says that it was skipped")]
fn folder() -> Option<tempfile::TempDir> {
    let directory = tempfile::tempdir().unwrap();
    std::fs::create_dir(directory.path().join("full")).unwrap();
    let may_mount = Command::new("unshare")
        .args([
            "--mount",
            "--map-root-user",
            "--user",
            "sh",
            "-c",
            "mount -t tmpfs none full",
        ])
        .current_dir(directory.path())
        .output()
        .is_ok_and(|output| output.status.success());
    if !may_mount {
        eprintln!("skipped: no disk can be mounted here");
        return None;
    }
    succeed(directory.path(), &["scene", "cube", "-o", "s.obj"]);
    Some(directory)
}

#[test]
fn every_command_that_writes_says_that_there_is_no_room() {
    let Some(directory) = folder() else { return };
    let at = directory.path();
    let scene = ["scene", "sphere-room-r1", "-o", "full/s.obj"];
    let factors = [
        "form-factors",
        "s.obj",
        "--subdivide",
        "6",
        "--method",
        "closed-form",
        "-o",
    ];
    let solve = [
        "solve",
        "s.obj",
        "--subdivide",
        "12",
        "--method",
        "sr",
        "--rays",
        "64",
        "-o",
    ];
    let picture = ["--camera", "unfolded", "--width", "24", "-o"];
    let mut cases: Vec<(Vec<&str>, &str)> = vec![(scene.to_vec(), "full/s.obj")];
    for file in ["full/F.npz", "full/F.npy", "full/F.mtx", "full/F.exr", "full/F.vtu"] {
        cases.push(([&factors[..], &[file]].concat(), file));
    }
    for file in ["full/B.csv", "full/B.npz", "full/B.vtu"] {
        cases.push(([&solve[..], &[file]].concat(), file));
    }
    cases.push((
        [&["render", "s.obj"], &picture[..], &["full/i.exr"]].concat(),
        "full/i.",
    ));
    cases.push((
        [&["field", "s.obj", "--surface", "x0"], &picture[..], &["full/i.exr"]].concat(),
        "full/i.",
    ));
    let voxel = ["voxel", "s.obj", "--voxels", "24", "--radius", "6", "--passes", "1"];
    for more in [
        &["--links", "disk", "--link-file", "full/l"][..],
        &["-o", "full/B.vtu"],
        &["-o", "full/i.exr"],
    ] {
        cases.push((
            [&voxel[..], more].concat(),
            more[more.len() - 1].trim_end_matches("exr"),
        ));
    }
    cases.push((
        vec![
            "compare",
            "cube",
            "--methods",
            "sr,closed-form",
            "--seeds",
            "2",
            "-o",
            "full",
        ],
        "full/",
    ));
    cases.push((
        vec![
            "solve",
            "s.obj",
            "--subdivide",
            "12",
            "--storage",
            "disk",
            "--scratch",
            "full",
        ],
        "full",
    ));
    let mut wrong = String::new();
    for (arguments, needle) in cases {
        let Ended { output, left } = on_small_disk(at, 2, &arguments);
        let message = stderr(&output);
        let lines = message.lines().filter(|line| !line.contains("warning:")).count();
        if output.status.code() != Some(1) || lines != 1 || !message.contains(needle) || !left.is_empty() {
            let _ = writeln!(wrong, "{arguments:?}: {}, {left:?}: {message}", output.status);
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// A checkpoint is a convenience: without room for it the work goes on to the same result.
#[test]
fn work_goes_on_without_room_for_its_checkpoint() {
    let Some(directory) = folder() else { return };
    let work = |output: &'static str| {
        [
            "form-factors",
            "s.obj",
            "--subdivide",
            "8",
            "--method",
            "sr",
            "--rays",
            "256",
            "-o",
            output,
        ]
    };
    succeed(directory.path(), &work("alone.npz"));
    let with = [&work("F.npz")[..], &["--checkpoint", "full/kept"]].concat();
    let Ended { output, left } = on_small_disk(directory.path(), 3, &with);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{message}");
    assert!(
        message.contains("full/kept") && message.contains("the checkpoint is incomplete"),
        "{message}"
    );
    assert!(left.is_empty(), "{left:?}");
    let read = |name: &str| std::fs::read(directory.path().join(name)).unwrap();
    assert!(read("F.npz") == read("alone.npz"), "the same bytes");
}
