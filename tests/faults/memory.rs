//! The memory limit for users: which work fits, goes to a disk or is refused, and the files that a full disk leaves.
#![cfg(target_os = "linux")]
#![expect(clippy::shadow_unrelated, reason = "each run of a test has its own limit and result")]

use std::fmt::Write as _;

use crate::program::{document, limited, names, radiosity, succeed, with_scene};

/// Solves the cube twice, with plenty of memory and with `limit`, and compares.
fn solve_within(subdivide: &str, limit: &str, limit_byte: u64) {
    let directory = with_scene("cube");
    let solve = |limit: &str| {
        let common = [
            "solve",
            "scene.obj",
            "--method",
            "closed-form",
            "--threads",
            "2",
            "--subdivide",
            subdivide,
        ];
        let (code, result) = document(
            directory.path(),
            &[&common[..], &["--memory-limit", limit, "-o", "b.csv"]].concat(),
        );
        assert_eq!(code, 0, "{result}");
        (result, std::fs::read(directory.path().join("b.csv")).unwrap())
    };
    let (plenty, in_memory) = solve("100G");
    let (little, on_disk) = solve(limit);
    assert_eq!(plenty["form_factors"]["storage"]["place"], "memory");
    assert_eq!(little["form_factors"]["storage"]["place"], "disk");
    let stored = little["form_factors"]["stored_bytes"].as_u64().unwrap();
    let peak = little["memory_peak_bytes"].as_u64().unwrap();
    assert!(peak <= limit_byte, "{peak} bytes of {limit_byte}");
    assert!(
        peak < stored,
        "the matrix of {stored} bytes is larger than all that was held, {peak} bytes"
    );
    assert_eq!(in_memory, on_disk, "the same sums in the same order");
    assert!(!names(directory.path()).iter().any(|name| name.contains("tmp")));
}

#[test]
fn a_matrix_larger_than_the_limit_is_solved_within_it() {
    // 4056 patches: 84 MB on the disk.
    solve_within("26", "64MiB", 64 << 20);
}

#[test]
#[ignore = "takes minutes"]
fn a_large_matrix_is_solved_within_a_quarter_of_its_size() {
    // 20184 patches: 2 GB on the disk.
    solve_within("58", "450MiB", 450 << 20);
}

/// What the library of MPI takes in each process, MiB, where the program is built with it.
const OF_MPI: u64 = if cfg!(feature = "mpi") { 6 } else { 0 };

/// A command line, its limit in MiB, and where the form factors go within it, if the command tells.
type Case<'a> = (&'a str, u64, &'a str);

/// The peak that a process has seen stays below the limit for every command that takes one, wherever the numbers go.
#[test]
fn the_peak_stays_below_the_limit() {
    let directory = with_scene("cube");
    succeed(directory.path(), &["scene", "room-box", "-o", "room.obj"]);
    let cases: [Case<'_>; 16] = [
        ("form-factors scene.obj --subdivide 2", 24, "memory"),
        // 1944 patches, computed in batches: all pairs at once would take 90 MB.
        ("form-factors scene.obj --subdivide 18", 80, "memory"),
        ("form-factors scene.obj --subdivide 18 -o F.npz", 52, "disk"),
        (
            "form-factors scene.obj --subdivide 18 --method closed-form -o F.npy",
            40,
            "disk",
        ),
        (
            "form-factors scene.obj --subdivide 18 --method sr --rays 64 --balance off -o G.npz",
            40,
            "memory",
        ),
        ("form-factors room.obj --subdivide 8 --method qmc", 40, "memory"),
        ("solve scene.obj --form-factors F.npz", 80, "memory"),
        ("solve scene.obj --form-factors F.npz", 41, "disk"),
        (
            "solve scene.obj --subdivide 18 --method sr --rays 64 -o b.vtu",
            48,
            "memory",
        ),
        ("render scene.obj --subdivide 6 --width 128 -o i.exr", 64, ""),
        (
            "render scene.obj --subdivide 6 --width 64 --final-gather --noise 0.2 -o i.exr",
            64,
            "",
        ),
        (
            "render scene.obj --subdivide 16 --method sr --rays 64 --width 32 -o i.exr",
            48,
            "",
        ),
        ("field scene.obj --surface x0 --width 128 -o i.exr", 64, ""),
        ("compare cube --methods sr,closed-form --seeds 2 -o out", 40, ""),
        // 192 by 144 pixels of 33 layers.
        (
            "render scene.obj --camera unfolded --direct rays --rays 16 --width 48 -o v.exr",
            48,
            "",
        ),
        ("verify v.exr", 28, ""),
    ];
    let mut wrong = String::new();
    for (line, limit, place) in cases {
        let limit = limit + OF_MPI;
        let limit_text = format!("{limit}MiB");
        let words: Vec<&str> = line
            .split(' ')
            .chain(["--threads", "2", "--memory-limit", &limit_text])
            .collect();
        let (code, result) = document(directory.path(), &words);
        let peak = result["memory_peak_bytes"].as_u64().unwrap_or(u64::MAX);
        let found = if line.starts_with("form-factors") {
            &result["storage"]["place"]
        } else {
            &result["form_factors"]["storage"]["place"]
        };
        if code != 0 || peak > limit << 20 || (!place.is_empty() && found != place) {
            let _ = writeln!(
                wrong,
                "{line}: {limit} MiB, {code}, {found}, {} KiB at most, {}",
                peak >> 10,
                result["error"]
            );
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// The same for voxels: links in memory, on a disk and nowhere.
#[test]
fn voxels_and_their_links_stay_below_the_limit() {
    let directory = with_scene("room-box");
    let voxel = "voxel scene.obj --voxels 64";
    let mut wrong = String::new();
    for (more, limit, choice) in [
        ("--radius 8", 48, "memory"),
        ("--radius 8", 26, "disk"),
        ("--radius 8 --links recompute", 28, "recompute"),
        ("--radius 8 --links recompute -o v.vtu", 32, "recompute"),
        ("--radius 8 --solver gmres --links disk", 40, "disk"),
        ("--radius 4 --adaptive 0.1", 48, "memory"),
        ("--radius 4 --width 64 -o v.exr", 80, "memory"),
    ] {
        std::fs::remove_file(directory.path().join("scene.links")).ok();
        let limit = limit + OF_MPI;
        let limit_text = format!("{limit}MiB");
        let words = voxel.split(' ').chain(more.split(' '));
        let words: Vec<&str> = words
            .chain(["--explain", "--threads", "2", "--memory-limit", &limit_text])
            .collect();
        let (code, result) = document(directory.path(), &words);
        let peak = result["memory_peak_bytes"].as_u64().unwrap_or(u64::MAX);
        let decisions = result["decisions"].as_array().cloned().unwrap_or_default();
        let found = decisions.iter().find(|decision| decision["subject"] == "links");
        let found = found.map_or(&serde_json::Value::Null, |decision| &decision["choice"]);
        if code != 0 || peak > limit << 20 || found != choice {
            let _ = writeln!(
                wrong,
                "{more}: {limit} MiB, {code}, {found}, {} KiB at most, {}",
                peak >> 10,
                result["error"]
            );
        }
    }
    for more in [
        "--voxels 64 --memory-limit 16MiB",
        "--voxels 4096 --memory-limit 200MiB",
        "--voxels 64 --links memory --radius 40 --memory-limit 64MiB",
    ] {
        let words: Vec<&str> = ["voxel", "scene.obj"].into_iter().chain(more.split(' ')).collect();
        let output = radiosity(directory.path(), &words);
        let text = crate::program::stderr(&output);
        assert_eq!(
            (output.status.code(), text.lines().count()),
            (Some(1), 1),
            "{more}: {text}"
        );
        assert!(text.contains("raise --memory-limit"), "{more}: {text}");
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// A scene of many faces takes most of its memory while it is read: it is refused, or the peak stays below the limit.
#[test]
fn a_scene_is_read_within_the_limit_or_not_at_all() {
    let directory = tempfile::tempdir().unwrap();
    let n = 120;
    let mut text = String::new();
    for k in 0..(n + 1) * (n + 1) {
        let _ = writeln!(text, "v {} {} 0", k % (n + 1), k / (n + 1));
    }
    for k in 0..n * n {
        let a = k / n * (n + 1) + k % n + 1;
        let _ = writeln!(text, "f {a} {} {} {}", a + 1, a + n + 2, a + n + 1);
    }
    std::fs::write(directory.path().join("many.obj"), &text).unwrap();
    let (mut n_refused, mut n_done) = (0, 0);
    for limit in (12_u64..=52).step_by(8) {
        let limit_text = format!("{limit}MiB");
        let words = [
            "voxel",
            "many.obj",
            "--voxels",
            "8",
            "--radius",
            "2",
            "--memory-limit",
            &limit_text,
        ];
        let (code, result) = document(directory.path(), &words);
        if code == 0 {
            let peak = result["memory_peak_bytes"].as_u64().unwrap();
            assert!(peak <= limit << 20, "{limit} MiB: {} KiB", peak >> 10);
            n_done += 1;
        } else {
            assert_eq!(result["error"]["kind"], "memory_limit", "{result}");
            n_refused += u32::from(result["error"]["message"].as_str().unwrap().contains("to read it"));
        }
    }
    assert!(n_refused > 0 && n_done > 0, "{n_refused} refused, {n_done} done");
}

#[test]
fn what_cannot_fit_is_refused_with_one_line() {
    let directory = with_scene("cube");
    let refused = |arguments: &[&str]| {
        let output = radiosity(directory.path(), arguments);
        assert_eq!(output.status.code(), Some(1));
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(text.lines().count(), 1, "{text}");
        text
    };
    let tiny = refused(&[
        "solve",
        "scene.obj",
        "--subdivide",
        "20",
        "--memory-limit",
        "4MiB",
        "--quiet",
    ]);
    assert!(tiny.contains("--memory-limit") && tiny.contains("4 MiB"), "{tiny}");
    let dense = [
        "form-factors",
        "scene.obj",
        "--subdivide",
        "20",
        "--memory-limit",
        "60M",
        "--storage",
        "dense",
    ];
    assert!(refused(&dense).contains("--storage auto or disk"));
    let compared = refused(&["compare", "scene.obj", "--memory-limit", "8M", "--quiet"]);
    assert!(compared.contains("--memory-limit"), "{compared}");
    // Six million patches are not made before it is seen that they do not fit.
    let fine = refused(&["solve", "scene.obj", "--subdivide", "1000", "--memory-limit", "300M"]);
    assert!(
        fine.contains("6000000 patches") && fine.contains("subdivide less"),
        "{fine}"
    );
    let nowhere = [
        "solve",
        "scene.obj",
        "--storage",
        "disk",
        "--scratch",
        "no/such",
        "--quiet",
    ];
    assert!(refused(&nowhere).contains("no/such: cannot write the scratch file"));
}

#[test]
fn flags_choose_storage_and_precision_and_contradictions_are_refused() {
    let directory = with_scene("cube");
    let solve = |arguments: &[&str]| {
        let common = [
            "solve",
            "scene.obj",
            "--subdivide",
            "3",
            "--method",
            "sr",
            "--rays",
            "500",
        ];
        document(directory.path(), &[&common[..], arguments].concat())
    };
    for (storage, layout, place) in [
        ("dense", "dense", "memory"),
        ("sparse", "sparse", "memory"),
        ("symmetric", "auto", "memory"),
        ("disk", "auto", "disk"),
    ] {
        for precision in ["f32", "f64"] {
            let (code, result) = solve(&["--storage", storage, "--precision", precision]);
            assert_eq!(code, 0);
            let stored = &result["form_factors"]["storage"];
            assert_eq!(stored["layout"], layout);
            assert_eq!(stored["place"], place);
            assert_eq!(stored["precision"], precision);
        }
    }
    for arguments in [
        &["--storage", "symmetric", "--balance", "off"][..],
        &["--memory-limit", "many"],
        &["--storage", "tape"],
    ] {
        let output = radiosity(directory.path(), &[&["solve", "scene.obj"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}

#[test]
fn a_full_disk_is_told_and_leaves_nothing() {
    let directory = with_scene("cube");
    // A limit on the size of files, and no signal when it is met, is what a full disk looks like to the program.
    let arguments = [
        "solve",
        "scene.obj",
        "--method",
        "closed-form",
        "--subdivide",
        "8",
        "--storage",
        "disk",
        "--scratch",
        ".",
        "--quiet",
    ];
    let before = names(directory.path());
    let output = limited(directory.path(), "trap '' XFSZ; ulimit -f 64; exec", &arguments)
        .output()
        .unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(
        text.contains("cannot write the scratch file") && text.contains("--scratch"),
        "{text}"
    );
    assert_eq!(text.lines().count(), 1);
    assert_eq!(names(directory.path()), before);
}

#[test]
fn a_file_is_read_straight_to_a_disk() {
    let directory = with_scene("cube");
    let compute = [
        "form-factors",
        "scene.obj",
        "--method",
        "closed-form",
        "--subdivide",
        "4",
        "--quiet",
    ];
    for file in ["f.npz", "f.npy", "f.mtx"] {
        assert!(
            radiosity(directory.path(), &[&compute[..], &["-o", file]].concat())
                .status
                .success()
        );
        let solve = |storage: &str| {
            document(
                directory.path(),
                &["solve", "scene.obj", "--form-factors", file, "--storage", storage],
            )
        };
        let ((code, memory), (_, disk)) = (solve("auto"), solve("disk"));
        assert_eq!(code, 0, "{memory}");
        assert_eq!(disk["form_factors"]["storage"]["place"], "disk");
        assert_eq!(memory["surfaces"], disk["surfaces"], "{file}");
    }
}

#[test]
fn what_is_no_file_of_form_factors_is_named() {
    let directory = with_scene("cube");
    let at = |name: &str| directory.path().join(name);
    let compute = [
        "form-factors",
        "scene.obj",
        "--method",
        "closed-form",
        "--quiet",
        "-o",
        "good.mtx",
    ];
    assert!(radiosity(directory.path(), &compute).status.success());
    let good = std::fs::read_to_string(at("good.mtx")).unwrap();
    std::fs::create_dir(at("folder.npz")).unwrap();
    for empty in ["empty.npz", "empty.npy", "empty.mtx"] {
        std::fs::write(at(empty), "").unwrap();
    }
    let last = good.trim_end().rfind('\n').unwrap();
    let digit = good.rfind(['1', '2']).unwrap();
    let changed = format!("{}7{}", &good[..digit], &good[digit + 1..]);
    let huge = good.replace("\n6 6 ", "\n18446744073709551615 18446744073709551615 ");
    for (name, text) in [
        ("short.mtx", &good[..=last]),
        ("changed.mtx", &changed),
        ("huge.mtx", &huge),
        ("long.mtx", &format!("{good}1 2 0.5\n")),
        // Rows and columns count from 1.
        ("zeroth.mtx", &good.replace("\n2 ", "\n0 ")),
        (
            "foreign.mtx",
            "%%MatrixMarket matrix coordinate real general\n2 2 1\n1 2 0.5\n",
        ),
        ("noise.mtx", "\u{1}\u{2}"),
    ] {
        std::fs::write(at(name), text).unwrap();
    }
    for name in [
        "folder.npz",
        "empty.npz",
        "empty.npy",
        "empty.mtx",
        "short.mtx",
        "changed.mtx",
        "huge.mtx",
        "long.mtx",
        "zeroth.mtx",
        "foreign.mtx",
        "noise.mtx",
        "none.mtx",
    ] {
        let (code, result) = document(
            directory.path(),
            &["solve", "scene.obj", "--form-factors", name, "--quiet"],
        );
        assert_eq!(code, 1, "{name}: {result}");
        let message = result["error"]["message"].as_str().unwrap();
        assert!(
            message.contains(name) && result["error"]["kind"] != "defect",
            "{message}"
        );
    }
    let cube = ["solve", "scene.obj", "--form-factors", "good.mtx", "--quiet"];
    assert_eq!(document(directory.path(), &cube).0, 0);
    assert!(
        radiosity(directory.path(), &["scene", "corridor", "-o", "other.obj"])
            .status
            .success()
    );
    let (code, other) = document(
        directory.path(),
        &["solve", "other.obj", "--form-factors", "good.mtx", "--quiet"],
    );
    assert_eq!(code, 1);
    assert_eq!(other["error"]["kind"], "other_geometry");
}
