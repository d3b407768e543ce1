//! Hostile files, sizes and paths: every command reports the fault in one line, and leaves no file behind.
#![cfg(unix)]

use std::path::Path;
use std::process::Output;

use crate::program::{limited, names};

/// Runs the program with at most 3 GB of address space for what it allocates, so that what is asked for in vain shows, and 60 s.
fn radiosity(directory: &Path, arguments: &[&str]) -> Output {
    let shell = "ulimit -v 3000000; exec timeout -k 1 60";
    limited(directory, shell, arguments).output().unwrap()
}

/// A folder with a scene, one valid file of every kind that is read back, and files that are none.
fn folder() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    let run = |arguments: &[&str]| {
        let output = radiosity(directory.path(), arguments);
        assert!(
            output.status.success(),
            "{arguments:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
    };
    run(&["scene", "cube", "-o", "s.obj"]);
    for file in ["F.npz", "F.npy", "F.mtx"] {
        run(&[
            "form-factors",
            "s.obj",
            "--subdivide",
            "2",
            "--method",
            "sr",
            "--rays",
            "100",
            "-o",
            file,
        ]);
    }
    run(&[
        "render",
        "s.obj",
        "-o",
        "i.exr",
        "--camera",
        "unfolded",
        "--width",
        "4",
        "--direct-samples",
        "16",
    ]);
    run(&[
        "voxel",
        "s.obj",
        "--voxels",
        "8",
        "--radius",
        "2",
        "--links",
        "disk",
        "--link-file",
        "l",
    ]);
    std::fs::write(
        at("c.toml"),
        "eye = [0.5, 0.5, 0.5]\nlook_at = [1.0, 0.5, 0.5]\nup = [0.0, 0.0, 1.0]\nfov = 60.0\n",
    )
    .unwrap();
    std::fs::write(at("a.toml"), "[surface.x0]\nexitance = [1.0, 1.0, 1.0]\n").unwrap();
    std::fs::create_dir(at("folder")).unwrap();
    for ending in ["obj", "npz", "npy", "mtx", "exr", "toml", "links"] {
        std::fs::write(at(&format!("zero.{ending}")), "").unwrap();
        // Bytes that are no text, and that no format begins with.
        let noise: Vec<u8> = (0..5000_u32)
            .map(|k| (k.wrapping_mul(2_654_435_761) >> 13).to_le_bytes()[0] | 1)
            .collect();
        std::fs::write(at(&format!("noise.{ending}")), noise).unwrap();
        std::fs::create_dir(at(&format!("folder.{ending}"))).unwrap();
    }
    for ending in ["npz", "mtx"] {
        std::os::unix::fs::symlink("/dev/zero", at(&format!("endless.{ending}"))).unwrap();
    }
    std::fs::copy(at("F.npy.json"), at("zero.npy.json")).unwrap();
    std::fs::copy(at("F.npy.json"), at("noise.npy.json")).unwrap();
    directory
}

/// A command line, the exit code that it must end with, and what its one line must contain.
type Case<'a> = (Vec<&'a str>, i32, &'a str);

fn expect(directory: &Path, (arguments, code, needle): &Case<'_>) -> Result<(), String> {
    let before = names(directory);
    let output = radiosity(directory, arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    let lines: Vec<&str> = message.lines().filter(|line| !line.contains("warning:")).collect();
    let after = names(directory);
    let is_right = output.status.code() == Some(*code)
        && message.contains(needle)
        && !message.contains("a defect")
        && lines.len() == 1
        && after == before;
    if is_right {
        return Ok(());
    }
    let new: Vec<&String> = after.iter().filter(|name| !before.contains(name)).collect();
    Err(format!(
        "{arguments:?}: {}, wanted {code} and `{needle}`, new files {new:?}: {message}\n",
        output.status
    ))
}

fn expect_all(directory: &Path, cases: &[Case<'_>]) {
    let wrong: String = cases.iter().filter_map(|case| expect(directory, case).err()).collect();
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn files_that_are_none_are_refused_by_every_command_that_reads_them() {
    let directory = folder();
    let mut cases: Vec<Case<'_>> = Vec::new();
    for file in ["zero.obj", "noise.obj", "folder.obj", "none.obj", "none/none.obj"] {
        for command in ["form-factors", "solve", "voxel"] {
            cases.push((vec![command, file], 1, file));
        }
        cases.push((vec!["render", file, "-o", "new.exr"], 1, file));
        cases.push((vec!["compare", file, "-o", "new"], 1, file));
    }
    for ending in ["npz", "npy", "mtx"] {
        for name in ["zero", "noise", "folder", "none"] {
            let file: &'static str = format!("{name}.{ending}").leak();
            cases.push((vec!["solve", "s.obj", "--form-factors", file], 1, file));
        }
    }
    for file in ["noise.toml", "folder.toml", "none.toml"] {
        cases.push((vec!["solve", "s.obj", "--lighting", file], 1, file));
        cases.push((vec!["render", "s.obj", "--camera", file, "-o", "new.exr"], 1, file));
    }
    cases.push((
        vec!["render", "s.obj", "--camera", "zero.toml", "-o", "new.exr"],
        1,
        "zero.toml",
    ));
    for file in ["zero.exr", "noise.exr", "folder.exr", "none.exr", "s.obj"] {
        cases.push((vec!["verify", file], 1, file));
    }
    for file in ["zero.links", "noise.links", "folder.links", "s.obj"] {
        cases.push((
            vec![
                "voxel",
                "s.obj",
                "--voxels",
                "8",
                "--radius",
                "2",
                "--links",
                "disk",
                "--link-file",
                file,
            ],
            1,
            file,
        ));
    }
    // Without end.
    for arguments in [
        &["form-factors", "/dev/zero"][..],
        &["solve", "s.obj", "--lighting", "/dev/zero"],
        &["solve", "s.obj", "--form-factors", "endless.npz"],
        &["solve", "s.obj", "--form-factors", "endless.mtx"],
        &["render", "s.obj", "-o", "new.exr", "--camera", "/dev/zero"],
        &["render", "s.obj", "-o", "new.exr", "--frames", "/dev/zero"],
        &["verify", "/dev/zero"],
        &[
            "voxel",
            "s.obj",
            "--voxels",
            "8",
            "--links",
            "disk",
            "--link-file",
            "/dev/zero",
        ],
    ] {
        cases.push((arguments.to_vec(), 1, "is a device"));
    }
    for file in ["noise.links", "folder", "s.obj", "none/none"] {
        cases.push((vec!["solve", "s.obj", "--checkpoint", file], 1, file));
    }
    expect_all(directory.path(), &cases);
}

#[test]
fn outputs_that_cannot_be_written_are_refused_and_leave_nothing() {
    let directory = folder();
    let mut cases: Vec<Case<'_>> = Vec::new();
    for (command, endings) in [
        (
            &["form-factors", "s.obj"][..],
            &["npz", "npy", "mtx", "exr", "csv", "vtu"][..],
        ),
        (&["solve", "s.obj"], &["npz", "csv", "vtu"]),
        (&["render", "s.obj", "--width", "4"], &["exr"]),
        (&["voxel", "s.obj", "--voxels", "8", "--radius", "2"], &["vtu", "exr"]),
    ] {
        for ending in endings {
            for place in ["none/new", "s.obj/new", "/dev/full/new"] {
                let file: &'static str = format!("{place}.{ending}").leak();
                cases.push(([command, &["-o", file]].concat(), 1, file));
            }
        }
    }
    for (command, ending) in [
        ("form-factors", "npz"),
        ("solve", "npz"),
        ("render", "exr"),
        ("voxel", "exr"),
    ] {
        let file: &'static str = format!("folder.{ending}").leak();
        cases.push((vec![command, "s.obj", "-o", file], 1, file));
    }
    cases.push((vec!["scene", "cube", "-o", "none/new.obj"], 1, "none/new"));
    cases.push((vec!["scene", "cube", "-o", "folder"], 1, "folder"));
    cases.push((vec!["scene", "cube", "-o", "/dev/full"], 1, "/dev/full"));
    cases.push((vec!["compare", "s.obj", "-o", "s.obj"], 1, "s.obj"));
    cases.push((
        vec!["solve", "s.obj", "--scratch", "none", "--storage", "disk"],
        1,
        "none",
    ));
    expect_all(directory.path(), &cases);
}

#[test]
fn sizes_that_no_machine_has_are_refused_by_name() {
    let directory = folder();
    let huge = "10000000000000000000";
    let cases: Vec<Case<'_>> = vec![
        (vec!["form-factors", "s.obj", "--subdivide", "4294967295"], 1, "s.obj"),
        (vec!["form-factors", "s.obj", "--subdivide", "60000"], 1, "s.obj"),
        (vec!["form-factors", "s.obj", "--max-edge", "1e-300"], 1, "s.obj"),
        (vec!["form-factors", "s.obj", "--max-edge", "0"], 2, "--max-edge"),
        (vec!["form-factors", "s.obj", "--max-edge", "nan"], 2, "--max-edge"),
        (
            vec!["form-factors", "s.obj", "--subdivide", "60", "--memory-limit", "1"],
            1,
            "limit",
        ),
        (
            vec!["solve", "s.obj", "--subdivide", "60", "--memory-limit", "1000"],
            1,
            "limit",
        ),
        (
            vec!["render", "s.obj", "-o", "new.exr", "--memory-limit", "1000"],
            1,
            "limit",
        ),
        (vec!["verify", "i.exr", "--memory-limit", "1000"], 1, "limit"),
        (
            vec!["render", "s.obj", "-o", "new.exr", "--width", "4294967295"],
            2,
            "--width",
        ),
        (vec!["voxel", "s.obj", "--voxels", "4294967295"], 2, "4294967295"),
        (vec!["voxel", "s.obj", "--radius", "4294967295"], 2, "4294967295"),
        (
            vec!["scene", "sphere-room-r1", "--level", "4294967295", "-o", "new.obj"],
            2,
            "level",
        ),
        (
            vec!["solve", "s.obj", "--method", "hemicube", "--resolution", huge],
            2,
            "--resolution",
        ),
        (
            vec!["solve", "s.obj", "--method", "pdm", "--points", huge],
            2,
            "--points",
        ),
        (
            vec!["solve", "s.obj", "--method", "sg", "--points", huge],
            2,
            "--points",
        ),
        (vec!["solve", "s.obj", "--method", "qmc", "--rays", "0"], 2, "--rays"),
        (vec!["solve", "s.obj", "--threads", "1000000000"], 2, "--threads"),
    ];
    expect_all(directory.path(), &cases);
}

#[test]
fn what_a_pipe_gives_is_read_once() {
    let directory = folder();
    let run = |from: &str, arguments: &[&str]| {
        let pipe = arguments[1];
        // What waits for a reader that never comes must not hold the test's own pipes.
        let shell = format!("mkfifo {pipe} && ({{ cat {from} > {pipe}; }} > /dev/null 2>&1 &) && exec timeout -k 1 60");
        let output = limited(directory.path(), &shell, arguments).output().unwrap();
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {} {message}", output.status);
        output.stdout
    };
    let row_sums = |name: &str| {
        let sums = std::fs::read_to_string(directory.path().join(name)).unwrap();
        assert!(sums.lines().count() > 1, "{sums}");
        sums
    };
    run("s.obj", &["form-factors", "pipe.obj", "-o", "new.csv"]);
    let output = radiosity(directory.path(), &["form-factors", "s.obj", "-o", "same.csv"]);
    assert!(output.status.success());
    assert_eq!(row_sums("new.csv"), row_sums("same.csv"));
    let said = run("i.exr", &["verify", "pipe.exr"]);
    let of_file = radiosity(directory.path(), &["verify", "i.exr"]);
    assert_eq!(String::from_utf8_lossy(&said), String::from_utf8_lossy(&of_file.stdout));
    assert!(of_file.status.success());
}

#[test]
fn settings_of_solvers_that_are_too_large_do_no_harm() {
    let directory = folder();
    for more in [
        ["gmres", "--restart"],
        ["anderson", "--depth"],
        // A closed room of reflectance 0.5 to 1e-6: without a bound one pass would take these many steps.
        ["progressive-refinement", "--steps-per-pass"],
        ["overshooting", "--steps-per-pass"],
    ] {
        let output = radiosity(
            directory.path(),
            &[
                "solve",
                "s.obj",
                "--subdivide",
                "2",
                "--solver",
                more[0],
                more[1],
                "18446744073709551615",
            ],
        );
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code().is_some_and(|code| code <= 3),
            "{more:?}: {} {message}",
            output.status
        );
        assert!(!message.contains("a defect"), "{more:?}: {message}");
    }
}

/// Headers that promise more than the file holds.
#[test]
fn promises_of_headers_are_not_believed() {
    let directory = folder();
    let at = |name: &str| directory.path().join(name);
    let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999, 9999999999), }";
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    npy.extend(u16::try_from(text.len()).unwrap().to_le_bytes());
    npy.extend(text.bytes());
    std::fs::write(at("huge.npy"), &npy).unwrap();
    std::fs::copy(at("F.npy.json"), at("huge.npy.json")).unwrap();
    let mtx = std::fs::read_to_string(at("F.mtx")).unwrap();
    let (comments, rest) = mtx.split_at(mtx.find("\n24 ").unwrap() + 1);
    let entries = rest.split_once('\n').unwrap().1;
    std::fs::write(
        at("huge.mtx"),
        format!("{comments}4000000000 4000000000 16000000000000000000\n{entries}"),
    )
    .unwrap();
    let mut npz = std::fs::read(at("F.npz")).unwrap();
    let place = npz.windows(5).position(|w| w == b"(25,)").unwrap();
    npz[place..place + 5].copy_from_slice(b"(99,)");
    std::fs::write(at("huge.npz"), &npz).unwrap();
    // A row of a hundred million pixels, in each part of a picture.
    let mut exr = std::fs::read(at("i.exr")).unwrap();
    let window = b"dataWindow\0box2i\0\x10\0\0\0";
    let starts: Vec<usize> = (0..exr.len()).filter(|&k| exr[k..].starts_with(window)).collect();
    assert!(!starts.is_empty());
    for start in starts {
        let right = start + window.len() + 8;
        exr[right..right + 4].copy_from_slice(&100_000_000_i32.to_le_bytes());
    }
    std::fs::write(at("huge.exr"), &exr).unwrap();
    let mut cases: Vec<Case<'_>> = ["huge.npy", "huge.mtx", "huge.npz"]
        .into_iter()
        .map(|file| (vec!["solve", "s.obj", "--form-factors", file], 1, file))
        .collect();
    cases.push((vec!["verify", "huge.exr"], 1, "bytes of pixels"));
    expect_all(directory.path(), &cases);
}

/// Every file that carries a checksum is refused when it is cut or a bit of it is flipped, or it says the same as before.
#[test]
fn cut_and_flipped_files_are_refused_or_say_the_same() {
    let directory = folder();
    let at = |name: &str| directory.path().join(name);
    let kinds: [(&str, &[&str]); 5] = [
        ("F.npz", &["solve", "s.obj", "--form-factors", "x.npz", "--json"]),
        ("F.npy", &["solve", "s.obj", "--form-factors", "x.npy", "--json"]),
        ("F.mtx", &["solve", "s.obj", "--form-factors", "x.mtx", "--json"]),
        (
            "l",
            &[
                "voxel",
                "s.obj",
                "--voxels",
                "8",
                "--radius",
                "2",
                "--links",
                "disk",
                "--link-file",
                "x.l",
                "--json",
            ],
        ),
        ("i.exr", &["verify", "x.exr", "--json"]),
    ];
    let results = |output: &Output| {
        let mut document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        for varying in ["stages", "total_s", "memory_peak_bytes", "history", "setup_s"] {
            document.as_object_mut().unwrap().remove(varying);
        }
        document
    };
    for (name, command) in kinds {
        let whole = std::fs::read(at(name)).unwrap();
        let target = at(command.iter().find(|a| a.starts_with("x.")).unwrap());
        std::fs::write(&target, &whole).unwrap();
        if name == "F.npy" {
            std::fs::copy(at("F.npy.json"), at("x.npy.json")).unwrap();
        }
        let right = radiosity(directory.path(), command);
        assert!(
            right.status.success(),
            "{name}: {}",
            String::from_utf8_lossy(&right.stderr)
        );
        let right = results(&right);
        let n = whole.len();
        let cuts = (0..12).map(|k| (k * n / 12 + k, None));
        let flips = (0..24).map(|k| (k * (n - 1) / 23, Some(1_u8 << (k % 8))));
        for (place, flip) in cuts.chain(flips) {
            let mut bytes = whole.clone();
            match flip {
                None => bytes.truncate(place.min(n - 1)),
                Some(bit) => bytes[place] ^= bit,
            }
            std::fs::write(&target, &bytes).unwrap();
            let output = radiosity(directory.path(), command);
            let message = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(!message.contains("a defect"), "{name} {place} {flip:?}: {message}");
            match output.status.code() {
                Some(0) => assert_eq!(results(&output), right, "{name} {place} {flip:?}"),
                Some(1 | 2) => assert!(
                    message.lines().count() == 1 && message.contains("x."),
                    "{name} {place} {flip:?}: {message}"
                ),
                // A picture whose pixels differ from the closed form.
                Some(4) => assert_eq!(name, "i.exr"),
                _ => panic!("{name} {place} {flip:?}: {} {message}", output.status),
            }
        }
    }
}
