//! Work that signals or a kill stop, and its continuation by the next run.
#![cfg(unix)]
#![expect(clippy::shadow_unrelated, reason = "each run of a test has its own output")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use crate::program::{command, names, radiosity, succeed};

fn start(directory: &Path, arguments: &[&str]) -> Child {
    command(directory, arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill")
        .args([name, &child.id().to_string()])
        .status()
        .unwrap();
    assert!(sent.success());
}

/// Waits until a file has more than so many bytes.
fn wait_for(path: &Path, byte: u64, child: &mut Child) {
    while path.metadata().map_or(0, |found| found.len()) <= byte {
        assert!(
            child.try_wait().unwrap().is_none(),
            "it ends before it has written to {}",
            path.display()
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn with_scene() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    succeed(directory.path(), &["scene", "room-box", "-o", "room.obj"]);
    directory
}

/// Some seconds of work, of which a piece is kept every few milliseconds.
const WORK: &[&str] = &[
    "form-factors",
    "room.obj",
    "--subdivide",
    "8",
    "--method",
    "sr",
    "--rays",
    "20000",
    "-o",
    "F.npz",
];
const KEPT: &[&str] = &["--checkpoint", "kept"];

#[test]
fn signals_end_the_work_with_one_line_and_it_goes_on_from_there() {
    let directory = with_scene();
    let at = |name: &str| directory.path().join(name);
    let before = names(directory.path());
    assert!(radiosity(directory.path(), WORK).status.success());
    let whole = std::fs::read(at("F.npz")).unwrap();
    std::fs::remove_file(at("F.npz")).unwrap();
    let with_checkpoint = [WORK, KEPT].concat();
    let mut size = 56;
    for (name, code) in [("-INT", 130), ("-TERM", 143)] {
        let mut child = start(directory.path(), &with_checkpoint);
        wait_for(&at("kept"), size, &mut child);
        signal(&child, name);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code));
        let message = text(&output.stderr);
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(
            message.contains(&format!("interrupted by SIG{}", &name[1..])) && message.contains("kept"),
            "{message}"
        );
        assert_eq!(
            names(directory.path()),
            [&before[..], &["kept".to_owned()]]
                .concat()
                .into_iter()
                .collect::<std::collections::BTreeSet<_>>()
                .into_iter()
                .collect::<Vec<_>>()
        );
        size = at("kept").metadata().unwrap().len();
    }
    // Other settings are other work.
    let other = radiosity(directory.path(), &[&with_checkpoint[..], &["--seed", "1"]].concat());
    assert_eq!(other.status.code(), Some(1));
    assert!(
        text(&other.stderr).contains("other settings"),
        "{}",
        text(&other.stderr)
    );
    let output = radiosity(directory.path(), &with_checkpoint);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(std::fs::read(at("F.npz")).unwrap() == whole, "the same bytes");
    assert!(!at("kept").exists(), "what is done needs no checkpoint");
}

#[test]
fn a_signal_without_a_checkpoint_leaves_nothing_and_says_so_in_the_document() {
    let directory = with_scene();
    let before = names(directory.path());
    let mut child = start(directory.path(), &[WORK, &["--json"]].concat());
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "the work takes longer than this");
    signal(&child, "-INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["error"]["kind"], "interrupted");
    assert_eq!(names(directory.path()), before);
}

/// Some seconds of final gather over three pictures, one of them with an object elsewhere.
const PICTURES: &[&str] = &[
    "render",
    "room.obj",
    "--frames",
    "frames.toml",
    "--subdivide",
    "2",
    "--width",
    "32",
    "--final-gather",
    "--noise",
    "0.02",
    "-o",
    "p.exr",
    "--checkpoint",
    "kept",
];

fn with_frames() -> tempfile::TempDir {
    let directory = with_scene();
    let scene = std::fs::read_to_string(directory.path().join("room.obj")).unwrap();
    let side = scene
        .lines()
        .find_map(|line| line.strip_prefix("g box").or(line.strip_prefix("o box")))
        .unwrap();
    let frames = format!(
        "[[frame]]\nname = \"a\"\n[[frame]]\nname = \"b\"\n[[frame.move]]\nsurface = \"box{side}\"\ntranslate = [0.05, 0, 0]\n\
         [[frame]]\nname = \"c\"\ncamera = \"unfolded\"\n"
    );
    std::fs::write(directory.path().join("frames.toml"), frames).unwrap();
    directory
}

#[test]
fn final_gather_and_frames_go_on_to_the_same_bytes() {
    let directory = with_frames();
    let at = |name: &str| directory.path().join(name);
    let pictures = ["p-a.exr", "p-b.exr", "p-c.exr", "p-a.png", "p-c.png"];
    let without = &PICTURES[..PICTURES.len() - 2];
    let output = radiosity(directory.path(), &[without, &["--json"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let told_whole: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let whole: Vec<Vec<u8>> = pictures.iter().map(|name| std::fs::read(at(name)).unwrap()).collect();
    for name in pictures {
        std::fs::remove_file(at(name)).unwrap();
    }
    // Form factors take some kilobytes; what comes after them is of the pictures. Each time the work gets somewhat further.
    let mut size = 40_000;
    let mut n_stopped = 0;
    for (name, code) in [("-INT", 130), ("-TERM", 143), ("-INT", 130), ("-TERM", 143)] {
        let mut child = start(directory.path(), PICTURES);
        while at("kept").metadata().map_or(0, |found| found.len()) <= size {
            if child.try_wait().unwrap().is_some() {
                break;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        if child.try_wait().unwrap().is_none() {
            signal(&child, name);
        }
        let output = child.wait_with_output().unwrap();
        if output.status.success() {
            break;
        }
        assert_eq!(output.status.code(), Some(code), "{}", text(&output.stderr));
        assert!(
            text(&output.stderr).contains("continues from them"),
            "{}",
            text(&output.stderr)
        );
        n_stopped += 1;
        size = at("kept").metadata().unwrap().len() + 100_000;
    }
    assert!(n_stopped >= 2, "the work is long enough to be stopped more than once");
    let output = radiosity(directory.path(), &[PICTURES, &["--json"]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let told: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for (name, expected) in pictures.iter().zip(&whole) {
        assert!(std::fs::read(at(name)).unwrap() == *expected, "{name}: the same bytes");
    }
    for k in 0..3 {
        assert_eq!(
            told["frames"][k]["final_gather"],
            told_whole["frames"][k]["final_gather"]
        );
    }
    assert!(!at("kept").exists(), "what is done needs no checkpoint");
}

#[test]
fn a_finished_frame_is_not_rendered_again_unless_it_was_changed() {
    let directory = with_frames();
    let at = |name: &str| directory.path().join(name);
    let mut child = start(directory.path(), PICTURES);
    while !at("p-b.exr").exists() {
        assert!(
            child.try_wait().unwrap().is_none(),
            "it ends before there is a second frame"
        );
        std::thread::sleep(Duration::from_millis(2));
    }
    signal(&child, "-INT");
    let stopped = child.wait_with_output().unwrap();
    if stopped.status.success() {
        return; // The third picture was faster than the signal.
    }
    assert_eq!(stopped.status.code(), Some(130));
    let first = std::fs::read(at("p-a.exr")).unwrap();
    let written = at("p-a.exr").metadata().unwrap().modified().unwrap();
    // The first frame stays as it is; one that somebody else wrote to is made again.
    std::fs::write(at("p-b.exr"), b"changed").unwrap();
    assert!(radiosity(directory.path(), PICTURES).status.success());
    assert_eq!(at("p-a.exr").metadata().unwrap().modified().unwrap(), written);
    assert!(std::fs::read(at("p-a.exr")).unwrap() == first);
    assert!(std::fs::read(at("p-b.exr")).unwrap() != b"changed");
}

#[test]
fn links_are_kept_when_a_signal_comes() {
    let directory = with_scene();
    let work = [
        "voxel",
        "room.obj",
        "--voxels",
        "160",
        "--radius",
        "8",
        "--passes",
        "1",
        "--links",
        "disk",
        "--link-file",
        "l",
        "-o",
        "v.vtu",
    ];
    let part = directory.path().join("l.part");
    let mut child = start(directory.path(), &work);
    wait_for(&part, 1000, &mut child);
    // The file belongs to one process.
    let second = radiosity(directory.path(), &work);
    assert_eq!(second.status.code(), Some(1));
    assert!(
        text(&second.stderr).contains("another process"),
        "{}",
        text(&second.stderr)
    );
    signal(&child, "-TERM");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(143), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("continues from them") && part.exists());
    assert!(!directory.path().join("v.vtu").exists());
    assert!(radiosity(directory.path(), &work).status.success());
    let resumed = std::fs::read(directory.path().join("l")).unwrap();
    std::fs::remove_file(directory.path().join("l")).unwrap();
    assert!(radiosity(directory.path(), &work).status.success());
    assert!(
        std::fs::read(directory.path().join("l")).unwrap() == resumed,
        "the same bytes"
    );
}

/// Kills the work `n` times at moments that are spread over all of it; after each kill a file under an output's name is a whole one.
fn killed(n: u32) {
    let directory = with_scene();
    let at = |name: &str| -> PathBuf { directory.path().join(name) };
    let work = [WORK, KEPT].concat();
    let started = std::time::Instant::now();
    assert!(radiosity(directory.path(), &work).status.success());
    let whole_time = started.elapsed();
    let whole = std::fs::read(at("F.npz")).unwrap();
    let mut n_killed = 0;
    for k in 0..n {
        std::fs::remove_file(at("F.npz")).ok();
        if k % 5 == 0 {
            std::fs::remove_file(at("kept")).ok();
        }
        let mut child = start(directory.path(), &work);
        // A golden section covers an interval evenly; some kills fall on the writing of the output, some after the end.
        let share = (f64::from(k) * 0.618_033_988_75).fract() * 1.1;
        std::thread::sleep(whole_time.mul_f64(share));
        n_killed += u32::from(child.kill().is_ok() && child.wait().unwrap().code().is_none());
        if at("F.npz").exists() {
            assert!(
                std::fs::read(at("F.npz")).unwrap() == whole,
                "kill {k}: a file that looks complete is"
            );
        }
    }
    assert!(n_killed > 0, "some kills came in time");
    let output = radiosity(directory.path(), &work);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(
        std::fs::read(at("F.npz")).unwrap() == whole,
        "the same bytes after {n_killed} kills"
    );
}

#[test]
fn a_few_kills_leave_no_file_that_is_not_whole() {
    killed(5);
}

#[test]
#[ignore = "takes minutes"]
fn fifty_kills_leave_no_file_that_is_not_whole() {
    killed(50);
}

/// Two processes at once write the same outputs, several times; each time what is there is one's or the other's.
fn do_not_mix(arguments: &[&str], outputs: &[&str]) {
    let directory = with_scene();
    let work = |seed: &'static str| [arguments, &["--seed", seed]].concat();
    let found = || -> Vec<Vec<u8>> {
        let read = |name: &&str| std::fs::read(directory.path().join(name)).unwrap();
        outputs.iter().map(read).collect()
    };
    let alone = ["1", "2"].map(|seed| {
        succeed(directory.path(), &work(seed));
        found()
    });
    for k in 0..outputs.len() {
        assert_ne!(alone[0][k], alone[1][k], "{}", outputs[k]);
    }
    for _ in 0..4 {
        let children = ["1", "2"].map(|seed| start(directory.path(), &work(seed)));
        for child in children {
            assert!(child.wait_with_output().unwrap().status.success());
        }
        assert!(
            alone.contains(&found()),
            "the outputs are those of one of the two, whole"
        );
    }
}

#[test]
fn two_processes_with_one_output_do_not_mix() {
    let factors = [&WORK[..3], &["4", "--method", "sr", "--rays", "2000"]].concat();
    do_not_mix(&[&factors[..], &["-o", "F.npz"]].concat(), &["F.npz"]);
    // The matrix and, in a second file, its description.
    do_not_mix(&[&factors[..], &["-o", "F.npy"]].concat(), &["F.npy", "F.npy.json"]);
}

/// The files hold times, so that no two runs write the same bytes; the page and the document tell whose they are by their seed.
#[test]
fn two_processes_with_one_folder_do_not_mix() {
    let directory = with_scene();
    let compare = |seed: &'static str| {
        [
            "compare",
            "cube",
            "--methods",
            "sr",
            "--seeds",
            "2",
            "--visibility",
            "off",
            "-o",
            "out",
            "--seed",
            seed,
        ]
    };
    for _ in 0..4 {
        let children = ["1", "2"].map(|seed| start(directory.path(), &compare(seed)));
        for child in children {
            assert!(child.wait_with_output().unwrap().status.success());
        }
        let read = |name: &str| std::fs::read_to_string(directory.path().join("out").join(name)).unwrap();
        let (document, page) = (read("results.json"), read("index.html"));
        let whose = ["1", "2"].map(|seed| {
            let in_document =
                document.contains(&format!("\"seed\": {seed}\n")) || document.contains(&format!("\"seed\": {seed},"));
            (in_document, page.contains(&format!("seed</th><td>{seed}</td>")))
        });
        assert!(
            whose == [(true, true), (false, false)] || whose == [(false, false), (true, true)],
            "{whose:?}"
        );
    }
}
