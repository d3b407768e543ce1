//! Several ranks under `mpirun`: the bytes of a single run, one message and one exit code, and checkpoints that survive a rank.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use radiosity::form_factor::registry::METHODS;
use radiosity::solver::registry::SOLVERS;
use serde_json::Value;

use crate::cases::n_cases;
use crate::program::{PROGRAM, names, radiosity, stderr, succeed, with_scene};
use crate::threads::without_measurements;

/// Tells whether the program is built with MPI, and says so where it is not.
fn has_mpi() -> bool {
    if !cfg!(feature = "mpi") {
        eprintln!("skipped: ranks need a build with `--features mpi`");
    }
    cfg!(feature = "mpi")
}

/// One after the other: ranks that wait for a message keep a core busy, and tests that waited for one another would keep a thread.
#[test]
fn ranks_do_what_one_process_does() {
    if !has_mpi() {
        return;
    }
    form_factors_are_the_same_bytes_on_any_number_of_ranks();
    light_and_pictures_are_the_same_bytes_on_any_number_of_ranks();
    every_method_and_solver_gives_the_same_bytes_and_the_furnace();
    a_solver_by_rows_is_refused_where_all_rows_do_not_fit_on_each_rank();
    an_error_is_one_message_and_one_exit_code();
    ranks_with_different_scenes_are_refused();
    a_killed_rank_ends_all_and_a_later_run_goes_on();
    #[cfg(target_os = "linux")]
    a_rank_that_is_killed_in_a_pass_or_a_file_leaves_nothing();
}

/// Returns a command that runs a line of shell on so many ranks, each with the rank's number in `$PMI_RANK`.
fn ranks(n: usize, at: &Path, shell: &str) -> Command {
    let mut command = Command::new("mpirun");
    command.current_dir(at).stdin(Stdio::null());
    command.args(["-n", &n.to_string(), "bash", "-c", shell, PROGRAM]);
    command
}

/// Runs the program on so many ranks, one thread each.
fn on_ranks(n: usize, at: &Path, arguments: &[&str]) -> Output {
    let all = [arguments, &["--threads", "1"]].concat();
    ranks(n, at, "exec \"$0\" \"$@\"").args(all).output().unwrap()
}

/// Returns what a run prints as JSON, without measurements, and the files that it wrote, which are removed.
fn results(at: &Path, output: &Output, files: &[&str]) -> (Value, Vec<Vec<u8>>) {
    assert!(output.status.success(), "{}", stderr(output));
    let mut document: Value = serde_json::from_slice(&output.stdout).unwrap();
    without_measurements(&mut document);
    let taken = |file: &&str| {
        let bytes = std::fs::read(at.join(file)).unwrap();
        std::fs::remove_file(at.join(file)).unwrap();
        bytes
    };
    (document, files.iter().map(taken).collect())
}

/// Runs a command without MPI, and on 1, 2 and 3 ranks: all print and write the same, which is returned.
fn expect_equal(at: &Path, arguments: &[&str], files: &[&str]) -> Value {
    expect_equal_on(&[1, 2, 3], at, arguments, files)
}

/// Returns one rank and, in turn, two or three; all of these where all cases are asked for.
fn in_turn(k: usize) -> &'static [usize] {
    n_cases([&[1, 2], &[1, 3]][k % 2], &[1, 2, 3])
}

/// Does the same on some numbers of ranks.
fn expect_equal_on(numbers: &[usize], at: &Path, arguments: &[&str], files: &[&str]) -> Value {
    let arguments = [arguments, &["--json"]].concat();
    let expected = results(at, &radiosity(at, &arguments), files);
    for &n in numbers {
        let found = results(at, &on_ranks(n, at, &arguments), files);
        assert_eq!(found.0, expected.0, "{arguments:?} on {n} ranks");
        assert!(found.1 == expected.1, "{arguments:?} on {n} ranks: {files:?} differ");
    }
    expected.0
}

fn form_factors_are_the_same_bytes_on_any_number_of_ranks() {
    for (scene, cut) in [("room-box", "5"), ("crater", "1")] {
        let directory = with_scene(scene);
        let at = directory.path();
        let cut = ["form-factors", "scene.obj", "--subdivide", cut];
        let exact = ["--tolerance", "1e-4", "-o", "F.npz"];
        expect_equal(at, &[&cut[..], &exact].concat(), &["F.npz"]);
        if scene == "room-box" {
            // Rows that are balanced, and as they were shot.
            for (k, (method, balance)) in [("sr", "on"), ("sr", "off"), ("qmc", "on")].into_iter().enumerate() {
                let settings = ["--method", method, "--balance", balance, "-o", "F.npz"];
                expect_equal_on(in_turn(k), at, &[&cut[..], &settings].concat(), &["F.npz"]);
            }
        }
    }
    // Batches of `exact` that end within a row of a grid.
    let directory = with_scene("room-box");
    let at = directory.path();
    let cut = [
        "form-factors",
        "scene.obj",
        "--subdivide",
        "20",
        "--tolerance",
        "1e-2",
        "-o",
        "F.npz",
        "--json",
    ];
    let expected = results(at, &radiosity(at, &cut), &["F.npz"]);
    assert!(results(at, &on_ranks(2, at, &cut), &["F.npz"]) == expected);
    // Every format, with the rows of other ranks; more ranks than some have rows.
    for file in ["F.npy", "F.mtx", "F.csv", "F.exr", "F.vf", "F.vtu"] {
        let directory = with_scene("room-box");
        let at = directory.path();
        let work = [
            "form-factors",
            "scene.obj",
            "--subdivide",
            "5",
            "--tolerance",
            "1e-3",
            "-o",
            file,
            "--json",
        ];
        let expected = results(at, &radiosity(at, &work), &[file]);
        let n = if file == "F.npy" { 4 } else { 2 };
        assert!(
            results(at, &on_ranks(n, at, &work), &[file]) == expected,
            "{file} on {n} ranks"
        );
    }
    // Many rows of tiles, in f32, and rows that are balanced.
    let directory = with_scene("room-box");
    let at = directory.path();
    let cut = ["form-factors", "scene.obj", "--subdivide", "9", "--precision", "f32"];
    let symmetric = [
        "--method",
        "sr",
        "--rays",
        "64",
        "--storage",
        "symmetric",
        "-o",
        "F.npz",
    ];
    expect_equal(at, &[&cut[..], &symmetric].concat(), &["F.npz"]);
    let rows = ["--row-tolerance", "1e-2", "-o", "F.npz"];
    expect_equal(at, &[&cut[..], &rows].concat(), &["F.npz"]);
}

fn light_and_pictures_are_the_same_bytes_on_any_number_of_ranks() {
    let directory = with_scene("room-box");
    let at = directory.path();
    let solve = [
        "solve",
        "scene.obj",
        "--subdivide",
        "5",
        "--form-factor-tolerance",
        "1e-4",
        "-o",
        "B.csv",
    ];
    for (k, solver) in ["auto", "gauss-seidel", "pcg"].into_iter().enumerate() {
        let solve = [&solve[..], &["--solver", solver]].concat();
        expect_equal_on(in_turn(k), at, &solve, &["B.csv"]);
    }
    // Rows in parts: pooled, averaged with their reverse ones, and as they are.
    let solves = [
        ("sr", "auto"),
        ("sr", "sor"),
        ("qmc", "gmres"),
        ("gauss-lambert", "pcg"),
        ("pdm", "jacobi"),
    ];
    for (k, (method, solver)) in solves.into_iter().enumerate() {
        let solve = [
            "solve",
            "scene.obj",
            "--subdivide",
            "5",
            "-o",
            "B.csv",
            "--method",
            method,
        ];
        expect_equal_on(
            in_turn(k),
            at,
            &[&solve[..], &["--solver", solver]].concat(),
            &["B.csv"],
        );
    }
    let render = [
        "render",
        "scene.obj",
        "--subdivide",
        "3",
        "--width",
        "80",
        "--height",
        "70",
        "-o",
        "p.exr",
    ];
    expect_equal(at, &render, &["p.exr", "p.png"]);
    let gather = [
        "--final-gather",
        "--noise",
        "0.2",
        "--samples",
        "2",
        "--checkpoint",
        "c",
    ];
    expect_equal(at, &[&render[..], &gather].concat(), &["p.exr", "p.png"]);
    let unstored = ["--on-the-fly", "--method", "sr", "--rays", "64", "--solver", "jacobi"];
    let solve = ["solve", "scene.obj", "--subdivide", "3", "-o", "B.csv"];
    expect_equal(at, &[&solve[..], &unstored].concat(), &["B.csv"]);
    let frames = "[[frame]]\nname = \"a\"\n[[frame]]\nname = \"b\"\n[[frame.move]]\nsurface = \"box_z1\"\ntranslate = [0.0, 0.0, 0.1]\n";
    std::fs::write(at.join("f.toml"), frames).unwrap();
    let files = ["p-a.exr", "p-b.exr", "p-a.png", "p-b.png"];
    expect_equal(
        at,
        &[&render[..], &["--frames", "f.toml", "--checkpoint", "c"]].concat(),
        &files,
    );
    let cube = with_scene("cube");
    let at = cube.path();
    let surface = |name: &str, kelvin: u32| {
        format!("[[surface]]\nname = \"{name}\"\nemissivity = 0.8\ntemperature_k = {kelvin}.0\n")
    };
    std::fs::write(at.join("b.toml"), surface("x0", 400) + &surface("*", 300)).unwrap();
    expect_equal(
        at,
        &[
            "heat",
            "scene.obj",
            "--boundary",
            "b.toml",
            "--subdivide",
            "3",
            "-o",
            "T.csv",
        ],
        &["T.csv"],
    );
}

/// Every method and every solver on ranks; in a closed room of one reflectance and one exitance, B = E / (1 − ρ) on every patch by every solver.
fn every_method_and_solver_gives_the_same_bytes_and_the_furnace() {
    let directory = with_scene("cube");
    let at = directory.path();
    let materials = ["wall", "light"].map(|name| format!("newmtl {name}\nKd 0.7 0.7 0.7\nKe 2.5 2.5 2.5\n"));
    std::fs::write(at.join("scene.mtl"), materials.concat()).unwrap();
    let cut = ["scene.obj", "--subdivide", "4"];
    for (k, method) in METHODS.iter().enumerate() {
        let factors = ["form-factors", "--method", method.name, "-o", "F.npz"];
        expect_equal_on(in_turn(k), at, &[&factors[..], &cut].concat(), &["F.npz"]);
    }
    let exact = SOLVERS.iter().enumerate();
    let exact = exact.map(|(k, solver)| ("exact", solver.name, in_turn(k)));
    // Rays, whose rows are balanced.
    let balanced = ["auto", "gauss-seidel", "pcg", "gmres"].into_iter().enumerate();
    let balanced = balanced.map(|(k, solver)| ("sr", solver, in_turn(k + 1)));
    for (method, solver, numbers) in exact.chain(balanced) {
        let light = ["solve", "--method", method, "--solver", solver, "-o", "B.csv"];
        let found = expect_equal_on(numbers, at, &[&light[..], &cut].concat(), &["B.csv"]);
        for surface in found["surfaces"].as_array().unwrap() {
            let radiosity = surface["radiosity"][0].as_f64().unwrap();
            assert!(
                (radiosity * 0.3 / 2.5 - 1.0).abs() < 1e-5,
                "{method} {solver} {surface}"
            );
        }
    }
}

/// Form factors would fit in parts, and are refused to a solver that needs all of them on each rank.
fn a_solver_by_rows_is_refused_where_all_rows_do_not_fit_on_each_rank() {
    let directory = with_scene("room-box");
    let at = directory.path();
    let solve = ["solve", "scene.obj", "-o", "B.csv", "--form-factor-tolerance", "1e-2"];
    let explain = ["--subdivide", "12", "--explain"];
    let output = on_ranks(4, at, &[&solve[..], &explain].concat());
    let explained = String::from_utf8(output.stdout).unwrap();
    assert!(explained.contains("44 % of exchange areas"), "{explained}");
    std::fs::remove_file(at.join("B.csv")).unwrap();
    let by_rows = ["--subdivide", "40", "--memory-limit", "2.5GB", "--solver", "sor"];
    let output = on_ranks(4, at, &[&solve[..], &by_rows].concat());
    let refused = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{refused}");
    assert!(
        refused.contains("`sor` goes by rows") && refused.contains("`pcg`"),
        "{refused}"
    );
    assert_eq!(refused.lines().filter(|line| line.starts_with("radiosity:")).count(), 1);
    assert!(!names(at).contains(&"B.csv".to_owned()));
}

/// One line, whatever went wrong on all ranks or on one, and one exit code.
fn an_error_is_one_message_and_one_exit_code() {
    let directory = with_scene("cube");
    let at = directory.path();
    let cases: [(&[&str], i32, &str); 5] = [
        (&["solve", "none.obj"], 1, "none.obj"),
        (&["solve", "scene.obj", "--solver", "none"], 2, "none"),
        (&["form-factors", "scene.obj", "--time-limit", "9s"], 2, "--time-limit"),
        (&["points", "scene.obj", "p.csv", "-o", "q.csv"], 2, "`points`"),
        (&["compare", "scene.obj", "-o", "d"], 2, "`compare`"),
    ];
    for (arguments, code, part) in cases {
        let output = on_ranks(3, at, arguments);
        let lines = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {lines}");
        let own = lines.lines().filter(|line| line.starts_with("radiosity:"));
        assert_eq!(own.count(), 1, "{arguments:?}: {lines}");
        assert!(lines.contains(part), "{arguments:?}: {lines}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
    }
    // On one rank alone: it speaks, and the others end.
    let output = ranks(
        3,
        at,
        "if [ $PMI_RANK = 1 ]; then cd /; fi; exec \"$0\" form-factors scene.obj -o F.npz",
    )
    .output();
    let output = output.unwrap();
    let lines = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{lines}");
    let own: Vec<&str> = lines.lines().filter(|line| line.starts_with("radiosity:")).collect();
    assert!(
        matches!(own[..], [only] if only.contains("rank 1") && only.contains("scene.obj")),
        "{lines}"
    );
    assert!(!names(at).contains(&"F.npz".to_owned()));
}

fn ranks_with_different_scenes_are_refused() {
    let directory = with_scene("cube");
    let at = directory.path();
    succeed(at, &["scene", "room-box", "-o", "other.obj"]);
    let shell =
        "file=scene.obj; if [ $PMI_RANK = 2 ]; then file=other.obj; fi; exec \"$0\" form-factors $file -o F.npz";
    let output = ranks(3, at, shell).output().unwrap();
    let lines = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{lines}");
    assert!(
        lines.contains("rank 2 on") && lines.contains("another scene"),
        "{lines}"
    );
    assert!(!names(at).contains(&"F.npz".to_owned()));
}

/// Runs the program on two ranks, and kills the second once `is_time`, which is given the numbers of both processes: all end, and none succeeds.
fn kill_second(at: &Path, arguments: &[&str], is_time: impl Fn([u32; 2]) -> bool) {
    let mut command = ranks(2, at, "echo $$ >pid.$PMI_RANK; exec \"$0\" \"$@\"");
    let mut child = command
        .args(arguments)
        .args(["--threads", "1"])
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let pid = |rank: u32| {
        let text = std::fs::read_to_string(at.join(format!("pid.{rank}"))).ok()?;
        text.trim().parse::<u32>().ok()
    };
    let second = loop {
        if let Some(pids) = pid(0).zip(pid(1))
            && is_time(pids.into())
        {
            break pids.1;
        }
        assert!(child.try_wait().unwrap().is_none(), "it ended before it was killed");
        std::thread::sleep(Duration::from_millis(1));
    };
    let killed = Command::new("kill").args(["-9", &second.to_string()]).status();
    assert!(killed.unwrap().success());
    assert!(!child.wait().unwrap().success());
    for rank in 0..2 {
        std::fs::remove_file(at.join(format!("pid.{rank}"))).unwrap();
    }
}

/// A rank is killed while form factors are computed: all end, no file is half-written, and runs on other numbers of ranks go on to the same bytes.
fn a_killed_rank_ends_all_and_a_later_run_goes_on() {
    let directory = with_scene("room-box");
    let at = directory.path();
    let work = "form-factors scene.obj --subdivide 10 --tolerance 1e-7 -o F.npz".split(' ');
    let work: Vec<&str> = work.collect();
    let kept = [&work[..], &["--checkpoint", "c"]].concat();
    succeed(at, &work);
    let expected = std::fs::read(at.join("F.npz")).unwrap();
    std::fs::remove_file(at.join("F.npz")).unwrap();
    for n_after in [1, 2, 3] {
        let length = || at.join("c.1").metadata().map_or(0, |found| found.len());
        kill_second(at, &kept, |_| length() >= 1000);
        assert_eq!(names(at), ["c.0", "c.1", "scene.mtl", "scene.obj"]);
        let output = if n_after == 1 {
            radiosity(at, &kept)
        } else {
            on_ranks(n_after, at, &kept)
        };
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(
            std::fs::read(at.join("F.npz")).unwrap() == expected,
            "on {n_after} ranks"
        );
        assert_eq!(names(at), ["F.npz", "scene.mtl", "scene.obj"]);
        std::fs::remove_file(at.join("F.npz")).unwrap();
    }
}

/// The same in a pass, and while files are written: nothing is left, and the next run makes the bytes of one that nobody disturbed.
#[cfg(target_os = "linux")]
fn a_rank_that_is_killed_in_a_pass_or_a_file_leaves_nothing() {
    let directory = with_scene("room-box");
    let at = directory.path();
    // Nothing but passes, each of which shoots all rays anew: half a second of them.
    let in_a_pass = |[_, second]: [u32; 2]| {
        let stat = std::fs::read_to_string(format!("/proc/{second}/stat")).unwrap_or_default();
        let ticks = stat.split_whitespace().nth(13).and_then(|n| n.parse::<u64>().ok());
        ticks.is_some_and(|ticks| ticks > 50)
    };
    // The first rank has a file open that has no name.
    let in_a_file = |[first, _]: [u32; 2]| {
        let Ok(open) = std::fs::read_dir(format!("/proc/{first}/fd")) else {
            return false;
        };
        let mut targets = open.filter_map(|entry| std::fs::read_link(entry.ok()?.path()).ok());
        targets.any(|target| target.starts_with(at) && target.to_string_lossy().contains("/#"))
    };
    let expect_nothing_left = |line: &str, is_time: &dyn Fn([u32; 2]) -> bool| {
        let arguments: Vec<&str> = line.split(' ').collect();
        let result = arguments[arguments.len() - 1];
        succeed(at, &arguments);
        let expected = std::fs::read(at.join(result)).unwrap();
        std::fs::remove_file(at.join(result)).unwrap();
        kill_second(at, &arguments, is_time);
        assert_eq!(names(at), ["scene.mtl", "scene.obj"], "{result}");
        let output = on_ranks(2, at, &arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(std::fs::read(at.join(result)).unwrap() == expected, "{result}");
        std::fs::remove_file(at.join(result)).unwrap();
    };
    let passes = "solve scene.obj --subdivide 6 --on-the-fly --method sr --rays 4096 --solver jacobi -o B.csv";
    expect_nothing_left(passes, &in_a_pass);
    let file = "form-factors scene.obj --subdivide 15 --tolerance 1e-2 -o F.mtx";
    expect_nothing_left(file, &in_a_file);
}

/// Launchers tell ranks by variables: a build that cannot share work says so once, and computes nothing.
#[cfg(not(feature = "mpi"))]
#[test]
fn a_build_without_mpi_refuses_several_ranks() {
    let directory = with_scene("cube");
    let at = directory.path();
    for [size, rank] in [
        ["PMI_SIZE", "PMI_RANK"],
        ["OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"],
    ] {
        let on = |n: &str, own: &str| {
            let mut command = Command::new(PROGRAM);
            command.current_dir(at).env(size, n).env(rank, own);
            command
                .args(["form-factors", "scene.obj", "-o", "F.npz"])
                .output()
                .unwrap()
        };
        for own in ["0", "1"] {
            let output = on("2", own);
            assert_eq!(output.status.code(), Some(2));
            let lines = stderr(&output);
            assert_eq!(lines.lines().count(), usize::from(own == "0"), "{lines}");
            assert!(
                own == "1" || lines.contains("2 ranks") && lines.contains("--features mpi"),
                "{lines}"
            );
        }
        assert!(!names(at).contains(&"F.npz".to_owned()));
        assert!(on("1", "0").status.success());
        std::fs::remove_file(at.join("F.npz")).unwrap();
    }
}
