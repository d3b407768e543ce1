//! The program as its users and their scripts meet it: exit codes, messages, documents, files.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::shadow_unrelated,
    reason = "each run of a test has its own output, code and result"
)]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn radiosity(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_radiosity"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap()
}

/// Runs with `--json` and returns the exit code and the document.
fn document(directory: &Path, arguments: &[&str]) -> (i32, Value) {
    let output = radiosity(directory, &[arguments, &["--json"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    (output.status.code().unwrap(), value)
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A directory with a built-in scene as `scene.obj`.
fn with_scene(name: &str) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let output = radiosity(directory.path(), &["scene", name, "-o", "scene.obj"]);
    assert!(output.status.success(), "{}", stderr(&output));
    directory
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

#[test]
fn form_factors_of_the_cube_as_a_document() {
    let directory = with_scene("cube");
    let (code, result) = document(
        directory.path(),
        &[
            "form-factors",
            "scene.obj",
            "--subdivide",
            "3",
            "--method",
            "sr",
            "--rays",
            "2000",
        ],
    );
    assert_eq!(code, 0);
    assert_eq!(result["schema_version"], 1);
    assert_eq!(result["n_patches"], 54);
    assert_eq!(result["n_surfaces"], 6);
    assert_eq!(result["n_rays"], 108_000);
    assert_eq!(result["n_escaped"], 0);
    let names: Vec<&str> = result["surfaces"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| s["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["x0", "x1", "y0", "y1", "z0", "z1"]);
    let first = numbers(&result["surface_form_factor"][0]);
    let error = numbers(&result["surface_error"][0]);
    for (j, exact) in [0.0, 0.199_825, 0.200_044, 0.200_044, 0.200_044, 0.200_044]
        .iter()
        .enumerate()
    {
        assert!((first[j] - exact).abs() < 4.0 * error[j] + 1e-6, "{first:?}");
        assert!(error[j] < 5e-3);
    }
    assert!((result["row_sum"]["min"].as_f64().unwrap() - 1.0).abs() < 1e-12);
    assert!(result["closure_error_max"].as_f64().unwrap() < 1e-12);
    assert!(result["reciprocity_error_max"].as_f64().unwrap() > 0.0);
    assert_eq!(numbers(&result["sky_factor"]), [0.0; 6]);
    assert!(result["stages"]["form_factors_s"].as_f64().unwrap() > 0.0);
    assert!(result["memory_peak_byte"].as_u64().unwrap() > 1_000_000);
    assert!(
        result["left_out"]
            .as_array()
            .unwrap()
            .iter()
            .any(|x| x.as_str().unwrap().contains("channels"))
    );
}

#[test]
fn the_same_seed_gives_the_same_result_at_any_number_of_threads() {
    let directory = with_scene("room-box");
    let run = |threads: &str| {
        let (code, mut result) = document(
            directory.path(),
            &[
                "solve",
                "scene.obj",
                "--subdivide",
                "2",
                "--method",
                "sr",
                "--rays",
                "500",
                "--seed",
                "5",
                "--threads",
                threads,
            ],
        );
        assert_eq!(code, 0);
        for varying in ["stages", "total_s", "memory_peak_byte", "history"] {
            result.as_object_mut().unwrap().remove(varying);
        }
        result
    };
    let one = run("1");
    assert_eq!(one, run("2"));
    assert_eq!(one, run("4"));
    assert!(one["surfaces"][0]["radiosity"][0].as_f64().unwrap() > 0.0);
}

#[test]
fn solvers_agree_and_say_how_they_stopped() {
    let directory = with_scene("lewis-room");
    let solve = |solver: &str| {
        let (code, result) = document(
            directory.path(),
            &[
                "solve",
                "scene.obj",
                "--method",
                "sr",
                "--rays",
                "1000",
                "--balance",
                "on",
                "--solver",
                solver,
                "--tolerance",
                "1e-10",
            ],
        );
        assert_eq!(code, 0);
        assert_eq!(result["solver"], solver);
        assert_eq!(result["stop_reason"], "converged");
        assert!(result["residual_l2"].as_f64().unwrap() <= 1e-10);
        assert!(!result["history"].as_array().unwrap().is_empty());
        let surfaces = result["surfaces"].as_array().unwrap().clone();
        surfaces
            .iter()
            .map(|s| s["radiosity"][0].as_f64().unwrap())
            .collect::<Vec<_>>()
    };
    let (a, b) = (solve("gauss-seidel"), solve("pcg"));
    for (x, y) in a.iter().zip(&b) {
        assert!((x - y).abs() < 1e-8 * x.abs(), "{a:?} {b:?}");
    }
}

#[test]
fn settings_go_to_the_solvers_that_use_them() {
    let directory = with_scene("lewis-room");
    let common = ["solve", "scene.obj", "--method", "sr", "--rays", "500"];
    for (flags, used_by) in [
        (&["--solver", "pcg", "--omega", "1.5"][..], "`sor`"),
        (&["--solver", "jacobi", "--bounds", "average"], "`chebyshev`"),
        (&["--solver", "sor", "--steps-per-pass", "5"], "`overshooting`"),
        (&["--solver", "sor", "--display-ambient"], "`progressive-refinement`"),
        (&["--solver", "sor", "--omega", "2"], "between 0 and 2"),
    ] {
        let output = radiosity(directory.path(), &[&common, flags].concat());
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{flags:?}: {message}");
        assert!(
            message.contains(used_by) && message.trim_end().lines().count() == 1,
            "{flags:?}: {message}"
        );
    }
    for flags in [
        &["--solver", "sor", "--omega", "1.2"][..],
        &["--solver", "chebyshev", "--bounds", "average"],
    ] {
        let (code, result) = document(directory.path(), &[&common, flags].concat());
        assert_eq!(code, 0, "{flags:?}");
        assert_eq!(result["stop_reason"], "converged");
    }
}

/// A picture after few steps: the estimate of the light under way brings the room's mean near its end.
#[test]
fn light_under_way_can_be_shown() {
    let directory = with_scene("lewis-room");
    let total = |flags: &[&str]| {
        let common = [
            "solve",
            "scene.obj",
            "--method",
            "sr",
            "--rays",
            "500",
            "--balance",
            "on",
        ];
        let (code, result) = document(directory.path(), &[&common, flags].concat());
        let surfaces = result["surfaces"].as_array().unwrap();
        let of = |s: &Value| s["area_m2"].as_f64().unwrap() * s["radiosity"][0].as_f64().unwrap();
        (code, surfaces.iter().map(of).sum::<f64>(), result)
    };
    let (code, exact, _) = total(&["--solver", "pcg"]);
    assert_eq!(code, 0);
    let few = [
        "--solver",
        "progressive-refinement",
        "--steps-per-pass",
        "10",
        "--max-passes",
        "3",
    ];
    let (code, plain, result) = total(&few);
    assert_eq!((code, &result["n_steps"]), (3, &Value::from(30)));
    let (_, shown, result) = total(&[&few[..], &["--display-ambient"]].concat());
    assert_eq!(result["settings"]["display_ambient"], true);
    assert!(
        (shown - exact).abs() < 0.25 * (plain - exact).abs(),
        "{shown} {plain} {exact}"
    );
}

#[test]
fn too_few_passes_are_exit_code_3_and_still_give_a_document() {
    let directory = with_scene("lewis-room");
    let (code, result) = document(
        directory.path(),
        &[
            "solve",
            "scene.obj",
            "--method",
            "sr",
            "--rays",
            "200",
            "--solver",
            "pcg",
            "--max-passes",
            "2",
            "--tolerance",
            "1e-12",
        ],
    );
    assert_eq!(code, 3);
    assert_eq!(result["stop_reason"], "max_passes");
    assert_eq!(result["n_passes"], 2);
}

#[test]
fn the_solution_is_written_as_csv() {
    let directory = with_scene("cube");
    let output = radiosity(
        directory.path(),
        &["solve", "scene.obj", "--subdivide", "2", "-o", "b.csv"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let table = std::fs::read_to_string(directory.path().join("b.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 25);
    assert_eq!(
        lines[0],
        "patch,surface,area_m2,x_m,y_m,z_m,radiosity_grey,irradiance_grey"
    );
    assert!(lines[1].starts_with("0,x0,0.25,0.0,"), "{}", lines[1]);
    let output = radiosity(directory.path(), &["solve", "scene.obj", "-o", "b.txt"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn bad_input_gets_one_line_and_exit_code_1() {
    let directory = with_scene("cube");
    std::fs::write(directory.path().join("bad.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n").unwrap();
    std::fs::write(directory.path().join("empty.obj"), "").unwrap();
    for (file, needle) in [
        ("bad.obj", "bad.obj:4:"),
        ("empty.obj", "empty.obj:"),
        ("missing.obj", "missing.obj:"),
        (".", ".:"),
    ] {
        for command in ["form-factors", "solve", "render"] {
            let mut arguments = vec![command, file];
            if command == "render" {
                arguments.extend(["-o", "x.exr"]);
            }
            let output = radiosity(directory.path(), &arguments);
            assert_eq!(output.status.code(), Some(1), "{arguments:?}");
            let message = stderr(&output);
            assert_eq!(message.lines().count(), 1, "{message}");
            assert!(message.contains(needle) && !message.contains("panicked"), "{message}");
            assert!(output.stdout.is_empty());
            assert!(!directory.path().join("x.exr").exists());
        }
    }
    let (code, result) = document(directory.path(), &["solve", "bad.obj"]);
    assert_eq!(code, 1);
    assert_eq!(result["error"]["kind"], "index_out_of_range");
    assert_eq!(result["error"]["file"], "bad.obj");
    assert_eq!(result["error"]["line"], 4);
}

#[test]
fn usage_errors_are_exit_code_2() {
    let directory = with_scene("cube");
    for arguments in [
        &["solve", "scene.obj", "--method", "hyper"] as &[&str],
        &["solve", "scene.obj", "--solver", "magic"],
        &["solve", "scene.obj", "--subdivide", "2", "--max-edge", "0.1"],
        &["solve", "scene.obj", "--method", "sr", "--rays", "0"],
        &["solve", "scene.obj", "--tolerance", "-1"],
        &["paint", "scene.obj"],
        &["form-factors"],
    ] {
        let output = radiosity(directory.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(!stderr(&output).is_empty());
    }
    let (code, result) = document(directory.path(), &["solve", "scene.obj", "--method", "hyper"]);
    assert_eq!(code, 2);
    assert_eq!(result["error"]["kind"], "usage");
}

#[test]
fn a_room_that_cannot_lose_light_has_no_solution() {
    let directory = with_scene("cube");
    let library = "newmtl wall\nKd 1 1 1\nnewmtl lamp\nKd 1 1 1\nKe 1 1 1\n";
    let obj = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    std::fs::write(directory.path().join("scene.mtl"), {
        let names = obj.lines().filter_map(|line| line.strip_prefix("usemtl "));
        let mut text = String::from(library);
        for (k, name) in names.collect::<std::collections::BTreeSet<_>>().into_iter().enumerate() {
            text.push_str(&["newmtl ", name, "\nKd 1 1 1\nKe ", &k.to_string(), " 1 1\n"].concat());
        }
        text
    })
    .unwrap();
    let (code, result) = document(
        directory.path(),
        &["solve", "scene.obj", "--method", "sr", "--rays", "100"],
    );
    assert_eq!(code, 1);
    assert_eq!(result["error"]["kind"], "no_finite_solution");
}

#[test]
fn explain_says_what_is_left_out() {
    let directory = with_scene("cube");
    let output = radiosity(
        directory.path(),
        &[
            "form-factors",
            "scene.obj",
            "--method",
            "sr",
            "--rays",
            "100",
            "--explain",
        ],
    );
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("channels: 1 (every material is grey)"), "{text}");
    assert!(text.contains("closure: closed"), "{text}");
    assert!(text.contains("visibility: none needed"), "{text}");
    assert!(text.contains("left out:"), "{text}");
}

#[test]
fn an_unfolded_cube_is_proved_and_a_tampered_one_is_not() {
    let directory = with_scene("cube");
    let output = radiosity(
        directory.path(),
        &[
            "render",
            "scene.obj",
            "-o",
            "cube.exr",
            "--camera",
            "unfolded",
            "--width",
            "24",
            "--direct-samples",
            "512",
        ],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let (code, result) = document(directory.path(), &["verify", "cube.exr"]);
    assert_eq!(code, 0, "{result}");
    assert_eq!(result["passed"], true);
    assert!(result["n_checked"].as_u64().unwrap() >= 5 * 24 * 24);
    assert!(result["max_error"].as_f64().unwrap() > 0.0);

    // The same picture of another light: the description says 10 % more than the pixels show.
    let mut bytes = std::fs::read(directory.path().join("cube.exr")).unwrap();
    let needle = b"\"exitance\":[1.0,1.0,1.0]";
    let at = bytes.windows(needle.len()).position(|w| w == needle).unwrap();
    bytes[at..at + needle.len()].copy_from_slice(b"\"exitance\":[1.1,1.1,1.1]");
    std::fs::write(directory.path().join("brighter.exr"), bytes).unwrap();
    let (code, result) = document(directory.path(), &["verify", "brighter.exr"]);
    assert_eq!(code, 4, "{result}");
    assert_eq!(result["passed"], false);
}

#[test]
fn a_picture_is_written_whole_with_its_preview() {
    let directory = with_scene("cornell-box");
    let arguments = [
        "render",
        "scene.obj",
        "-o",
        "box.exr",
        "--width",
        "64",
        "--max-edge",
        "0.2",
        "--method",
        "sr",
        "--rays",
        "500",
        "--samples",
        "1",
    ];
    let (code, result) = document(directory.path(), &arguments);
    assert_eq!(code, 0, "{result}");
    assert_eq!(
        (result["width"].as_u64(), result["height"].as_u64()),
        (Some(64), Some(64))
    );
    assert_eq!(result["image"], "box.exr");
    let first = std::fs::read(directory.path().join("box.exr")).unwrap();
    let preview = std::fs::read(directory.path().join("box.png")).unwrap();
    assert!(first.starts_with(&[0x76, 0x2f, 0x31, 0x01]) && preview.starts_with(b"\x89PNG"));
    // Again, with another number of threads: the same bytes, in place of the old file.
    let (code, _) = document(directory.path(), &[&arguments as &[&str], &["--threads", "1"]].concat());
    assert_eq!(code, 0);
    assert_eq!(first, std::fs::read(directory.path().join("box.exr")).unwrap());
    let left: Vec<_> = std::fs::read_dir(directory.path())
        .unwrap()
        .map(|f| f.unwrap().file_name())
        .collect();
    // scene.obj, scene.mtl, camera.toml, box.exr, box.png: nothing temporary.
    assert_eq!(left.len(), 5, "{left:?}");
}

#[test]
fn an_output_that_cannot_be_written_is_refused_before_the_work() {
    let directory = with_scene("cube");
    std::fs::create_dir(directory.path().join("folder.exr")).unwrap();
    for (name, code) in [("no/such/dir/x.exr", 1), ("folder.exr", 1), ("x.png", 2), ("x", 2)] {
        let output = radiosity(directory.path(), &["render", "scene.obj", "-o", name, "--width", "8"]);
        assert_eq!(output.status.code(), Some(code), "{name}");
        assert_eq!(stderr(&output).lines().count(), 1, "{}", stderr(&output));
        assert!(stderr(&output).contains(name), "{}", stderr(&output));
        assert!(output.stdout.is_empty(), "{name}");
    }
}

#[test]
fn every_method_runs_from_the_command_line() {
    let directory = with_scene("cube");
    for (method, setting, value) in [
        ("centre", "normalise", Value::from(false)),
        ("pdm", "points", 5.into()),
        ("sr", "rays", 4096.into()),
        ("sg", "points", 5.into()),
        ("sg5", "rays", 4096.into()),
        ("sg10", "sequence", "sobol".into()),
        ("hemicube", "resolution", 256.into()),
        ("gauss-lambert", "points", 5.into()),
        ("contour", "points", 5.into()),
        ("closed-form", "seed", 0.into()),
        ("qmc", "rays", 64.into()),
        ("exact", "tolerance", 1e-6.into()),
    ] {
        let (code, result) = document(directory.path(), &["form-factors", "scene.obj", "--method", method]);
        assert_eq!(code, 0, "{method}");
        assert_eq!(result["settings"]["method"], method);
        assert_eq!(result["settings"][setting], value, "{method}");
        let shoots = method.starts_with('s') || method == "hemicube";
        assert_eq!(result["pairs"].is_null(), shoots, "{method}");
        assert_eq!(result["n_rays"].as_u64().unwrap() > 0, shoots, "{method}");
        let left_out = result["left_out"].to_string();
        assert_eq!(
            left_out.contains("rays between patches"),
            !shoots,
            "{method}: {left_out}"
        );
    }
    let occluded = with_scene("room-box");
    let (_, counted) = document(
        occluded.path(),
        &["form-factors", "scene.obj", "--method", "qmc", "--rays", "16"],
    );
    let pairs = &counted["pairs"];
    assert_eq!(counted["n_rays"], pairs["n_rays"]);
    assert!(pairs["n_rays"].as_u64().unwrap() > 100 && pairs["partial"].as_u64().unwrap() > 0);
}

#[test]
fn flags_that_a_method_has_no_use_for_are_usage_errors() {
    let directory = with_scene("cube");
    for (arguments, users) in [
        (["--method", "pdm", "--rays", "10"], "`sr`, `sg`, `sg5`, `sg10`, `qmc`"),
        (["--method", "sg5", "--points", "3"], "`pdm`, `sg`, `hemicube`"),
        (["--method", "sr", "--resolution", "64"], "`hemicube`"),
        (["--method", "qmc", "--sequence", "random"], "`sr`, `sg`, `sg5`, `sg10`"),
        (["--normalise", "--method", "contour", "--quiet"], "`centre`"),
    ] {
        let output = radiosity(
            directory.path(),
            &[&["form-factors", "scene.obj"][..], &arguments].concat(),
        );
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains(users), "{}", stderr(&output));
    }
    let output = radiosity(directory.path(), &["form-factors", "scene.obj", "--method", "magic"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("gauss-lambert"), "{}", stderr(&output));
    // The sequence is the direct pass's too, whatever the method.
    let render = [
        "render",
        "scene.obj",
        "-o",
        "cube.exr",
        "--width",
        "8",
        "--method",
        "contour",
        "--sequence",
        "random",
    ];
    assert_eq!(radiosity(directory.path(), &render).status.code(), Some(0));
}

/// Runs, expects success, and returns the document without what varies from run to run.
fn repeatable(directory: &Path, arguments: &[&str]) -> Value {
    let (code, mut result) = document(directory, arguments);
    assert_eq!(code, 0, "{result}");
    for varying in [
        "stages",
        "total_s",
        "memory_peak_byte",
        "history",
        "settings",
        "left_out",
    ] {
        result.as_object_mut().unwrap().remove(varying);
    }
    result
}

#[test]
fn form_factors_from_a_file_give_the_same_solution() {
    let directory = with_scene("room-box");
    let directory = directory.path();
    let computing = ["--subdivide", "2", "--method", "sr", "--rays", "500"];
    let direct = repeatable(directory, &[&["solve", "scene.obj"], &computing[..]].concat());
    for (file, threads) in [("F.npz", "1"), ("G.npz", "2")] {
        let written = [
            &["form-factors", "scene.obj", "-o", file, "--threads", threads],
            &computing[..],
        ]
        .concat();
        assert_eq!(repeatable(directory, &written)["output"], file);
        // The patches come from the file.
        let reused = repeatable(directory, &["solve", "scene.obj", "--form-factors", file]);
        assert_eq!(reused, direct);
    }
    let bytes = |file: &str| std::fs::read(directory.join(file)).unwrap();
    assert!(bytes("F.npz") == bytes("G.npz"), "equal work gives equal bytes");

    // Other materials have the same form factors.
    let library = std::fs::read_to_string(directory.join("scene.mtl")).unwrap();
    std::fs::write(directory.join("scene.mtl"), library.replace("Kd 0.", "Kd 0.0")).unwrap();
    let darker = repeatable(directory, &["solve", "scene.obj", "--form-factors", "F.npz"]);
    assert_eq!(darker["form_factors"], direct["form_factors"]);
    assert_ne!(darker["surfaces"], direct["surfaces"]);
}

#[test]
fn form_factors_of_another_scene_or_for_other_patches_are_refused() {
    let directory = with_scene("cube");
    let directory = directory.path();
    let run = |arguments: &[&str]| radiosity(directory, arguments);
    assert!(
        run(&[
            "form-factors",
            "scene.obj",
            "--method",
            "sr",
            "--rays",
            "100",
            "--max-edge",
            "0.5",
            "-o",
            "F.npz"
        ])
        .status
        .success()
    );
    assert!(
        run(&["scene", "lewis-room", "--level", "1", "-o", "other.obj"])
            .status
            .success()
    );
    let output = run(&["solve", "other.obj", "--form-factors", "F.npz"]);
    assert_eq!(output.status.code(), Some(1));
    let message = stderr(&output);
    assert_eq!(message.lines().count(), 1, "{message}");
    for part in ["F.npz", "other.obj", "radiosity form-factors other.obj -o F.npz"] {
        assert!(message.contains(part), "{message}");
    }
    let solve = ["solve", "scene.obj", "--form-factors", "F.npz"];
    for (flags, code, part) in [
        (&["--max-edge", "0.5"][..], 0, ""),
        (&["--max-edge", "0.25"], 2, "--max-edge 0.5"),
        (&["--subdivide", "2"], 2, "--max-edge 0.5"),
        (&["--rays", "100"], 2, "--rays"),
        (&["--method", "sr"], 2, "--method"),
    ] {
        let output = run(&[&solve[..], flags].concat());
        assert_eq!(output.status.code(), Some(code), "{flags:?} {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{}", stderr(&output));
    }
    let (code, result) = document(directory, &["solve", "scene.obj", "--form-factors", "missing.npz"]);
    assert_eq!((code, &result["error"]["kind"]), (1, &Value::from("unreadable")));
    let (code, result) = document(directory, &["form-factors", "scene.obj", "-o", "F.txt"]);
    assert_eq!((code, &result["error"]["kind"]), (2, &Value::from("usage")));
    // Half of a file is not one.
    let bytes = std::fs::read(directory.join("F.npz")).unwrap();
    std::fs::write(directory.join("F.npz"), &bytes[..bytes.len() / 2]).unwrap();
    let (code, result) = document(directory, &solve);
    assert_eq!((code, &result["error"]["kind"]), (1, &Value::from("damaged")));
    assert_eq!(result["error"]["file"], "F.npz");
}

#[test]
fn auto_is_the_default_and_says_what_it_took() {
    let directory = with_scene("lewis-room");
    let solve = |more: &[&str]| {
        let base = [
            "solve",
            "scene.obj",
            "--subdivide",
            "4",
            "--method",
            "sr",
            "--rays",
            "500",
        ];
        let arguments = [&base[..], more].concat();
        let (code, result) = document(directory.path(), &arguments);
        assert_eq!(code, 0, "{result}");
        result
    };
    let chosen = solve(&[]);
    assert_eq!(chosen["settings"]["solver"], "auto");
    assert_ne!(chosen["solver"], "auto", "the one that did the work");
    assert!(chosen["why"].as_str().unwrap().len() > 20);
    let raw = solve(&["--balance", "off"]);
    assert_ne!(raw["solver"], "pcg", "not symmetric");
    let named = solve(&["--solver", "pcg", "--start", "ambient"]);
    assert!(named["why"].is_null());
    assert_eq!(named["settings"]["start"], "ambient");
    let energy = &named["energy"][0];
    let watts = |key: &str| energy[key].as_f64().unwrap();
    let lost = watts("emitted") - watts("absorbed") - watts("escaped");
    assert!(lost.abs() < 1e-5 * watts("emitted"), "{energy}");
    let unused = radiosity(
        directory.path(),
        &["solve", "scene.obj", "--solver", "pcg", "--depth", "4"],
    );
    assert_eq!(unused.status.code(), Some(2));
    assert!(stderr(&unused).contains("--depth") && stderr(&unused).contains("anderson"));
}

/// Two lightings at once are the same as each of them alone, and the sum of two lights is the sum of their radiosities.
#[test]
fn lightings_go_through_the_matrix_together() {
    let directory = with_scene("cube");
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    let scene = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    let surfaces: Vec<&str> = scene
        .lines()
        .filter_map(|l| l.strip_prefix("o ").or(l.strip_prefix("g ")))
        .collect();
    let (first, second) = (surfaces[0], surfaces[5]);
    let light = |name: &str, e: &str| format!("[surface.\"{name}\"]\nexitance = {e}\nreflectance = 0.5\n");
    let dark: String = surfaces[1..5].iter().map(|name| light(name, "0.0")).collect();
    write(
        "a.toml",
        &format!("{dark}{}{}", light(first, "[1.0, 2.0, 0.0]"), light(second, "0.0")),
    );
    write(
        "b.toml",
        &format!("{dark}{}{}", light(first, "0"), light(second, "3.0")),
    );
    write(
        "both.toml",
        &format!("{dark}{}{}", light(first, "[1.0, 2.0, 0.0]"), light(second, "3.0")),
    );
    let factors = [
        "form-factors",
        "scene.obj",
        "--subdivide",
        "3",
        "--method",
        "closed-form",
        "-o",
        "f.npz",
    ];
    assert!(radiosity(directory.path(), &factors).status.success());
    let base = ["solve", "scene.obj", "--form-factors", "f.npz", "--tolerance", "1e-10"];
    let all = [
        "--lighting",
        "a.toml",
        "--lighting",
        "b.toml",
        "--lighting",
        "both.toml",
        "-o",
        "out.csv",
    ];
    let (code, together) = document(directory.path(), &[&base[..], &all[..]].concat());
    assert_eq!(code, 0, "{together}");
    let lightings = together["lightings"].as_array().unwrap();
    assert_eq!(lightings.len(), 3);
    // The second one is grey: one channel is enough.
    for (k, (name, n_channels)) in [("a", 3), ("b", 1), ("both", 3)].into_iter().enumerate() {
        assert_eq!(lightings[k]["name"], name);
        assert_eq!(lightings[k]["n_channels"], n_channels);
        assert!(directory.path().join(format!("out-{name}.csv")).exists());
    }
    let n_surfaces = lightings[0]["surfaces"].as_array().unwrap().len();
    assert_eq!(n_surfaces, 6);
    for surface in 0..n_surfaces {
        let of = |lighting: &Value| numbers(&lighting["surfaces"][surface]["radiosity"]);
        let [a, b, both] = [of(&lightings[0]), of(&lightings[1]), of(&lightings[2])];
        for c in 0..3 {
            assert!(
                both[c] > 0.0 && (a[c] + b[0] - both[c]).abs() < 1e-8 * both[c],
                "{a:?} {b:?} {both:?}"
            );
        }
    }
    let alone = ["--lighting", "b.toml", "--solver", "gauss-seidel"];
    let (_, alone) = document(directory.path(), &[&base[..], &alone[..]].concat());
    let first_channels = |result: &Value| -> Vec<f64> {
        let surfaces = result["surfaces"].as_array().unwrap();
        surfaces.iter().map(|s| numbers(&s["radiosity"])[0]).collect()
    };
    let (beside, alone) = (first_channels(&lightings[1]), first_channels(&alone["lightings"][0]));
    assert_eq!((beside.len(), alone.len()), (6, 6));
    for (a, b) in beside.iter().zip(&alone) {
        assert!((a - b).abs() < 1e-8 * a);
    }
    for (text, expected) in [
        (
            "[surface.nothing]\nexitance = 1.0\n",
            "bad.toml:1: surface.nothing: the scene has no surface",
        ),
        ("[material.white]\nlight = 1.0\n", "bad.toml:2"),
        (&*format!("[surface.\"{first}\"]\nreflectance = 1.5\n"), "bad.toml:2"),
        (
            &*format!("[surface.\"{first}\"]\nexitance = [1.0, -1.0, 0.0]\n"),
            "bad.toml:2",
        ),
    ] {
        write("bad.toml", text);
        let output = radiosity(directory.path(), &[&base[..], &["--lighting", "bad.toml"]].concat());
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
}

/// Form factors that are computed again in every pass are the same ones.
#[test]
fn form_factors_need_not_be_stored() {
    let directory = with_scene("lewis-room");
    let base = [
        "solve",
        "scene.obj",
        "--subdivide",
        "2",
        "--method",
        "sr",
        "--rays",
        "500",
        "--solver",
        "gmres",
    ];
    let (code, stored) = document(directory.path(), &[&base[..], &["--balance", "off"]].concat());
    assert_eq!(code, 0);
    let (code, fly) = document(directory.path(), &[&base[..], &["--on-the-fly"]].concat());
    assert_eq!(code, 0);
    assert!(fly["form_factors"].is_null());
    assert_eq!(fly["n_passes"], stored["n_passes"]);
    for surface in 0..6 {
        let of = |result: &Value| numbers(&result["surfaces"][surface]["radiosity"])[0];
        assert!((of(&fly) - of(&stored)).abs() < 1e-12 * of(&stored));
    }
    for (more, expected) in [(["--method", "qmc"], "pairs"), (["--solver", "pcg"], "balanced")] {
        let arguments = [&["solve", "scene.obj", "--on-the-fly"][..], &more].concat();
        let refused = radiosity(directory.path(), &arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(stderr(&refused).contains(expected), "{}", stderr(&refused));
    }
}

/// Two plates 1e-5 m apart, 4 m wide: rays start 6e-6 m off each.
#[test]
fn rays_that_start_too_far_off_a_narrow_gap_are_told_of() {
    let directory = tempfile::tempdir().unwrap();
    let plates = "o low\nv -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nf 1 2 3 4\n\
                  o high\nv -2 -2 1e-5\nv 2 -2 1e-5\nv 2 2 1e-5\nv -2 2 1e-5\nf 8 7 6 5\n";
    std::fs::write(directory.path().join("plates.obj"), plates).unwrap();
    let with = |method: &str| {
        let output = radiosity(directory.path(), &["form-factors", "plates.obj", "--method", method]);
        assert!(output.status.success(), "{}", stderr(&output));
        stderr(&output)
    };
    let told = with("sr");
    assert!(
        told.contains("`low` (line 6) and `high` (line 12) are 1.00e-5 m apart") && told.contains("6.00e-6 m off"),
        "{told}"
    );
    assert!(!with("closed-form").contains("apart"), "no ray, no warning");
}

/// A field of form factors as a document; `verify` recognises the file, and a wrong surface is a usage error.
#[test]
fn a_field_of_form_factors_is_rendered_and_verified() {
    let directory = with_scene("cube");
    let field = ["field", "scene.obj", "--surface", "z1", "-o", "f.exr"];
    let (code, result) = document(
        directory.path(),
        &[&field[..], &["--camera", "unfolded", "--width", "16"]].concat(),
    );
    assert_eq!(
        (code, &result["command"], &result["surface"]),
        (0, &"field".into(), &"z1".into())
    );
    assert_eq!(
        (&result["width"], &result["height"], &result["settings"]["method"]),
        (&64.into(), &48.into(), &"exact".into())
    );
    let surfaces = result["surfaces"].as_array().unwrap();
    for (name, exact) in [("z0", 0.199_824_9), ("x0", 0.200_043_8), ("z1", 0.0)] {
        let surface = surfaces.iter().find(|surface| surface["name"] == name).unwrap();
        assert_eq!(surface["n_pixels"], 256);
        // The midpoint rule on 16 × 16 pixels.
        assert!(
            (surface["form_factor"].as_f64().unwrap() - exact).abs() < 2e-4,
            "{surface}"
        );
    }
    let (code, report) = document(directory.path(), &["verify", "f.exr"]);
    assert_eq!(
        (code, &report["passed"], &report["field"]),
        (0, &true.into(), &"z1".into())
    );
    let text = String::from_utf8(radiosity(directory.path(), &["verify", "f.exr"]).stdout).unwrap();
    assert!(
        text.starts_with("form factors to z1") && !text.contains("W/m²"),
        "{text}"
    );
    assert!(directory.path().join("f.png").is_file());

    let shot = [
        &field[..],
        &["--method", "sr", "--rays", "64", "--camera", "unfolded", "--width", "8"],
    ]
    .concat();
    let (code, result) = document(directory.path(), &shot);
    assert_eq!((code, &result["settings"]["rays"]), (0, &64.into()));
    assert_eq!(document(directory.path(), &["verify", "f.exr"]).0, 0);

    for (flags, word) in [
        (
            &["field", "scene.obj", "--surface", "roof", "-o", "f.exr"][..],
            "no surface `roof`",
        ),
        (
            &["field", "scene.obj", "--surface", "z1", "-o", "f.exr", "--rays", "9"],
            "--rays",
        ),
        (&["field", "scene.obj", "--surface", "z1", "-o", "f.png"], ".exr"),
    ] {
        let output = radiosity(directory.path(), flags);
        assert_eq!(output.status.code(), Some(2), "{flags:?}");
        assert!(
            stderr(&output).contains(word) && stderr(&output).lines().count() == 1,
            "{}",
            stderr(&output)
        );
    }
}

/// A sequence of lightings and cameras: one file each, the same as when rendered alone, with the form factors computed once.
#[test]
fn frames_share_form_factors_and_equal_single_pictures() {
    let directory = with_scene("cube");
    let path = |name: &str| directory.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(path(name), text).unwrap();
    write(
        "red.toml",
        "[surface.z1]\nexitance = [2.0, 0.5, 0.25]\n[surface.x0]\nreflectance = 0.5\n",
    );
    write(
        "frames.toml",
        "[[frame]]\nname = \"a\"\ncamera = \"unfolded\"\n\n[[frame]]\nname = \"b\"\nlighting = \"red.toml\"\ncamera = \"unfolded\"\n\n\
         [[frame]]\nname = \"c\"\nlighting = \"red.toml\"\n",
    );
    let common = [
        "render",
        "scene.obj",
        "--subdivide",
        "2",
        "--width",
        "12",
        "--direct",
        "exact",
    ];
    let frames = [&common[..], &["--frames", "frames.toml", "-o", "f.exr"]].concat();
    let (code, result) = document(directory.path(), &frames);
    assert_eq!((code, &result["n_lightings"]), (0, &2.into()), "{result}");
    let made = result["frames"].as_array().unwrap();
    let names: Vec<&str> = made.iter().map(|frame| frame["image"].as_str().unwrap()).collect();
    assert_eq!(names, ["f-a.exr", "f-b.exr", "f-c.exr"]);
    assert_eq!((&made[0]["width"], &made[2]["width"]), (&48.into(), &12.into()));
    for (frame, emitted) in [(&made[0], 1.0), (&made[1], 2.0)] {
        let surfaces = frame["surfaces"].as_array().unwrap();
        let lamp = surfaces.iter().find(|surface| surface["name"] == "z1").unwrap();
        assert!(
            (lamp["radiosity"][0].as_f64().unwrap() - emitted).abs() < 1e-12,
            "{lamp}"
        );
    }
    for name in ["f-a.exr", "f-b.exr"] {
        let (code, report) = document(directory.path(), &["verify", name]);
        assert_eq!((code, &report["n_not_checkable"]), (0, &0.into()), "{report}");
    }
    // The first frame alone: the same picture.
    let alone = [&common[..], &["--camera", "unfolded", "-o", "alone.exr"]].concat();
    assert_eq!(document(directory.path(), &alone).0, 0);
    let layers = |name: &str| radiosity::render::exr::read(&path(name)).unwrap().0;
    let (first, single) = (layers("f-a.exr"), layers("alone.exr"));
    for layer in ["R", "direct.G", "irradiance.B"] {
        assert_eq!(first.f32(layer), single.f32(layer), "{layer}");
    }

    for (text, words) in [
        ("", "no [[frame]]"),
        (
            "[[frame]]\nname = \"a\"\n[[frame]]\nname = \"a\"\n",
            "two frames are called `a`",
        ),
        ("[[frame]]\nname = \"a/b\"\n", "bad.toml:1"),
        ("[[frame]]\nname = \"a\"\nlight = \"x\"\n", "bad.toml:3"),
        ("[[frame]]\nname = \"a\"\nlighting = \"none.toml\"\n", "none.toml"),
    ] {
        write("bad.toml", text);
        let bad = [&common[..], &["--frames", "bad.toml", "-o", "f.exr"]].concat();
        let output = radiosity(directory.path(), &bad);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{text}: {message}");
        assert!(
            message.contains(words) && message.lines().count() == 1,
            "{text}: {message}"
        );
    }
}

#[test]
fn final_gather_says_what_it_took_and_a_missing_viewer_is_a_warning() {
    let directory = with_scene("room-box");
    let common = [
        "render",
        "scene.obj",
        "--subdivide",
        "2",
        "--width",
        "12",
        "-o",
        "g.exr",
        "--final-gather",
    ];
    let (code, result) = document(directory.path(), &[&common[..], &["--noise", "0.1"]].concat());
    assert_eq!(code, 0, "{result}");
    let report = &result["final_gather"];
    assert!(
        report["n_rays"].as_u64().unwrap() >= 64 * 144 && report["n_above"] == 0,
        "{report}"
    );
    let (image, attributes) = radiosity::render::exr::read(&directory.path().join("g.exr")).unwrap();
    assert!(attributes.render.gather.is_some());
    let total: u64 = image.u32("samples").unwrap().iter().map(|&n| u64::from(n)).sum();
    assert_eq!(report["n_rays"], total);
    for layer in ["variance.R", "error.G", "direct.B"] {
        assert!(
            image.f32(layer).unwrap().iter().all(|x| x.is_finite() && *x >= 0.0),
            "{layer}"
        );
    }
    // A budget spent above the tolerance.
    let few = ["--noise", "0.001", "--gather-rays", "64"];
    let (code, result) = document(directory.path(), &[&common[..], &few].concat());
    assert_eq!(code, 3);
    assert!(
        result["final_gather"]["n_above"].as_u64().unwrap() > 50,
        "{}",
        result["final_gather"]
    );
    // Port 1 is nobody's.
    let output = radiosity(
        directory.path(),
        &[&common[..], &["--noise", "0.1", "--display", "127.0.0.1:1"]].concat(),
    );
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{message}");
    assert_eq!(message.matches("no viewer at 127.0.0.1:1").count(), 1, "{message}");
    let useless = radiosity(
        directory.path(),
        &["render", "scene.obj", "-o", "g.exr", "--noise", "0.1"],
    );
    assert_eq!(useless.status.code(), Some(2));
}

#[test]
fn closure_is_repaired_where_it_is_known() {
    let directory = with_scene("cube");
    let method = [
        "--subdivide",
        "2",
        "--method",
        "sr",
        "--rays",
        "500",
        "--balance",
        "closure",
    ];
    let (code, result) = document(
        directory.path(),
        &[&["form-factors", "scene.obj"], &method[..]].concat(),
    );
    assert_eq!(code, 0);
    assert_eq!(result["settings"]["balance"], "closure");
    assert!(result["closure_error_max"].as_f64().unwrap() < 1e-9, "{result:#}");
    // Two walls: open, and `exact` counts nothing that leaves.
    let open = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 1 2 3 4\nf 8 7 6 5\n";
    std::fs::write(directory.path().join("open.obj"), open).unwrap();
    let arguments = ["form-factors", "open.obj", "--balance", "closure"];
    let message = stderr(&radiosity(directory.path(), &arguments));
    assert!(message.contains("--balance closure changes nothing"), "{message}");
    assert!(!stderr(&radiosity(directory.path(), &arguments[..2])).contains("--balance"));
}

#[test]
fn libraries_outside_the_scenes_folder_are_read_on_request() {
    let directory = with_scene("cube");
    std::fs::create_dir(directory.path().join("inner")).unwrap();
    let obj = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    let outside = obj.replace("mtllib scene.mtl", "mtllib ../scene.mtl");
    assert_ne!(outside, obj);
    std::fs::write(directory.path().join("inner/scene.obj"), outside).unwrap();
    let arguments = ["form-factors", "inner/scene.obj", "--allow-outside"];
    assert_eq!(radiosity(directory.path(), &arguments).status.code(), Some(0));
    let refused = radiosity(directory.path(), &arguments[..2]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(stderr(&refused).contains("--allow-outside"), "{}", stderr(&refused));
}
