//! Solutions: solvers, lightings, form factors from files or none.

use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::{document, numbers, radiosity, stderr, with_scene};

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
fn the_mesh_sets_the_tolerance_where_none_is_given() {
    let directory = with_scene("room-box");
    let solve = |flags: &[&str]| {
        let (code, result) = document(directory.path(), &[&["solve", "scene.obj"], flags].concat());
        assert_eq!(code, 0);
        result
    };
    let tolerance = |result: &Value| result["settings"]["form_factor_tolerance"].clone();
    let chosen = solve(&["--subdivide", "12"]);
    let of_mesh = chosen["mesh_error"]["surface_mean_max"].as_f64().unwrap();
    let found = tolerance(&chosen).as_f64().unwrap();
    assert!(found > 1e-6 && found <= 0.1 * of_mesh, "{found} {of_mesh}");
    let exact = solve(&["--subdivide", "12", "--form-factor-tolerance", "1e-7"]);
    let radiosities = |result: &Value| -> Vec<f64> {
        let surfaces = result["surfaces"].as_array().unwrap();
        surfaces.iter().flat_map(|s| numbers(&s["radiosity"])).collect()
    };
    assert_ne!(
        chosen["surfaces"], exact["surfaces"],
        "the tolerance changes the result"
    );
    for (b, truth) in radiosities(&chosen).iter().zip(&radiosities(&exact)) {
        assert!((b - truth).abs() < 0.1 * of_mesh * truth, "{b} {truth}");
    }
    assert_eq!(tolerance(&solve(&["--subdivide", "4"])), 1e-6, "few patches");
    assert_eq!(
        tolerance(&solve(&["--subdivide", "12", "--form-factor-tolerance", "1e-5"])),
        1e-5
    );
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
        (&["--solver", "cg", "--deflation", "never"], "`pcg`, `gmres`"),
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
    for (solver, more) in [
        ("gmres", &["--restart", "20"][..]),
        ("auto", &["--restart", "20"]),
        ("pcg", &["--balance", "on"]),
        ("auto", &["--balance", "on"]),
    ] {
        let passes = |deflation: &str| {
            let flags = ["--subdivide", "2", "--solver", solver, "--deflation", deflation];
            let (code, result) = document(directory.path(), &[&common[..], &flags, more].concat());
            assert_eq!(code, 0, "{solver} {deflation}");
            assert_eq!(result["settings"]["deflation"], deflation);
            if more[0] == "--restart" {
                assert_eq!(result["settings"]["restart"], 20);
            }
            result["n_passes"].as_u64().unwrap()
        };
        assert!(passes("always") < passes("never"), "{solver} {more:?}");
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
    // All that is said of the light is said of what is shown.
    let leaving = result["energy"][0]["leaving"].as_f64().unwrap();
    assert!((leaving / shown - 1.0).abs() < 1e-12, "{leaving} {shown}");
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
    let (about, lines): (Vec<&str>, Vec<&str>) = table.lines().partition(|line| line.starts_with("# "));
    let about: Vec<&str> = about.iter().map(|line| &line[2..]).collect();
    let about: Value = serde_json::from_str(&about.join("\n")).unwrap();
    assert_eq!(about["format"], "radiosity solution 1");
    assert_eq!(about["stop_reason"], "converged");
    assert_eq!(lines.len(), 25);
    assert_eq!(
        lines[0],
        "patch,surface,area_m2,x_m,y_m,z_m,radiosity_grey,irradiance_grey,error_grey,\
         sky_factor,sky_factor_error,back_factor,back_factor_error"
    );
    assert!(lines[1].starts_with("0,x0,0.25,0.0,"), "{}", lines[1]);
    let output = radiosity(directory.path(), &["solve", "scene.obj", "-o", "b.txt"]);
    assert_eq!(output.status.code(), Some(2));
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
    assert_eq!(result["error"]["file"], "scene.obj");
    let message = result["error"]["message"].as_str().unwrap();
    assert!(
        message
            .starts_with("scene.obj: no finite solution: the enclosure of `x0` (6 patches) emits, but absorbs nothing")
            && message.ends_with("lower a `Kd` below 1 there, or open the scene"),
        "{message}"
    );
}

/// Runs, expects success, and returns the document without what varies from run to run.
fn repeatable(directory: &Path, arguments: &[&str]) -> Value {
    let (code, mut result) = document(directory, arguments);
    assert_eq!(code, 0, "{result}");
    for varying in [
        "stages",
        "total_s",
        "memory_peak_bytes",
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
fn auto_is_the_default_and_says_what_it_took() {
    let directory = with_scene("lewis-room");
    let solve = |more: &[&str]| {
        let base = [
            "solve",
            "scene.obj",
            "--subdivide",
            "2",
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
}

#[test]
fn a_bad_lighting_is_refused_in_one_line() {
    let directory = with_scene("cube");
    let file = directory.path().join("bad.toml");
    for (text, expected) in [
        // A list is no table, whose parts are named, and has no more numbers than there are channels.
        (
            "[surface]\n\"x0\" = [1.0, 0.5, 7.0]\n",
            "bad.toml:2: invalid type: list, expected a table with `exitance` or `reflectance`",
        ),
        (
            "[material]\nwhite = []\n",
            "bad.toml:2: invalid type: list, expected a table with `exitance` or `reflectance`",
        ),
        (
            "[material.white]\nexitance = [1.0, 0.5, 0.5, 7.0]\n",
            "bad.toml:2: expected a number, or three",
        ),
        (
            "[surface.nothing]\nexitance = 1.0\n",
            "bad.toml:1: surface.nothing: the scene has no surface",
        ),
        (
            "[surface.\"two\\nlines\"]\nreflectance = 0.5\n",
            "bad.toml:1: surface.two\u{fffd}lines: the scene has no surface",
        ),
        ("[material.white]\nlight = 1.0\n", "bad.toml:2"),
        ("[surface.\"x0\"]\nreflectance = 1.5\n", "bad.toml:2"),
        ("[surface.\"x0\"]\nexitance = [1.0, -1.0, 0.0]\n", "bad.toml:2"),
    ] {
        std::fs::write(&file, text).unwrap();
        let output = radiosity(directory.path(), &["solve", "scene.obj", "--lighting", "bad.toml"]);
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
        assert_eq!(stderr(&output).lines().count(), 1);
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
    assert_eq!(fly["estimated_relative_error"], Value::Null);
    let warnings = fly["warnings"].as_array().unwrap();
    assert!(
        warnings
            .iter()
            .any(|text| text.as_str().unwrap().contains("state no error")),
        "{warnings:?}"
    );
    for (more, expected) in [(["--method", "qmc"], "pairs"), (["--solver", "pcg"], "balanced")] {
        let arguments = [&["solve", "scene.obj", "--on-the-fly"][..], &more].concat();
        let refused = radiosity(directory.path(), &arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(stderr(&refused).contains(expected), "{}", stderr(&refused));
    }
}

/// What is not known of form factors is not stated of the light.
#[test]
fn errors_that_are_not_known_are_not_stated() {
    let directory = with_scene("room-box");
    let directory = directory.path();
    std::fs::write(directory.join("lamp.toml"), "[surface.room_z1]\nexitance = 2.0\n").unwrap();
    for (file, is_known) in [("F.npz", true), ("F.npy", false), ("F.mtx", false)] {
        let (code, _) = document(
            directory,
            &["form-factors", "scene.obj", "--subdivide", "2", "-o", file],
        );
        assert_eq!(code, 0, "{file}");
        let solve = ["solve", "scene.obj", "--form-factors", file];
        for (more, written) in [(&[] as &[&str], "B.vtu"), (&["--lighting", "lamp.toml"], "B-lamp.vtu")] {
            let (code, result) = document(directory, &[&solve[..], more, &["-o", "B.vtu"]].concat());
            assert_eq!(code, 0, "{file}: {result}");
            let text = std::fs::read_to_string(directory.join(written)).unwrap();
            assert_eq!(text.contains("Name=\"error\""), is_known, "{file} {written}");
            assert_eq!(
                result["estimated_relative_error"].is_number(),
                is_known,
                "{file}: {result}"
            );
        }
    }
}

/// What a coarser mesh would change is told where there is one.
#[test]
fn the_mesh_tells_of_its_own_error() {
    let directory = with_scene("room-box");
    let solved = |n: &str| document(directory.path(), &["solve", "scene.obj", "--subdivide", n]);
    let (code, result) = solved("4");
    assert_eq!(code, 0, "{result}");
    let told = &result["mesh_error"];
    assert_eq!(
        told["n_patches"].as_u64().unwrap() * 4,
        result["n_patches"].as_u64().unwrap()
    );
    for name in ["surface_mean_max", "patches_rms"] {
        let error = told[name].as_f64().unwrap();
        assert!(error > 1e-3 && error < 0.5, "{name}: {error}");
    }
    assert!(
        result["surfaces"]
            .as_array()
            .unwrap()
            .iter()
            .any(|s| s["name"] == told["surface"])
    );
    assert_eq!(solved("1").1["mesh_error"], Value::Null);

    // Each of several lightings has its own, which is that of the lighting alone.
    for (file, text) in [
        ("double.toml", "[surface.room_z1]\nexitance = 2.0\n"),
        (
            "side.toml",
            "[surface.room_z1]\nexitance = 0.0\n[surface.room_x0]\nexitance = 1.0\n",
        ),
    ] {
        std::fs::write(directory.path().join(file), text).unwrap();
    }
    let common = ["solve", "scene.obj", "--subdivide", "4"];
    let lit = |files: &[&str]| {
        let flags = files.iter().flat_map(|file| ["--lighting", file]);
        let (code, several) = document(directory.path(), &common.into_iter().chain(flags).collect::<Vec<_>>());
        assert_eq!(code, 0, "{several}");
        let each = several["lightings"].as_array().unwrap().iter();
        each.map(|one| one["mesh_error"]["surface_mean_max"].as_f64().unwrap())
            .collect::<Vec<_>>()
    };
    let both = lit(&["double.toml", "side.toml"]);
    let alone = [lit(&["double.toml"])[0], lit(&["side.toml"])[0]];
    let expected = told["surface_mean_max"].as_f64().unwrap();
    for (found, expected) in [(both[0], alone[0]), (both[1], alone[1]), (alone[0], expected)] {
        // It is solved for to two digits.
        assert!((found / expected - 1.0).abs() < 0.05, "{both:?} {alone:?} {expected}");
    }
    assert!((both[0] / both[1] - 1.0).abs() > 0.1, "{both:?}");
}

/// A room of 4 m × 4 m × 3 m with a lamp of 10 W, `side` m wide, under its ceiling.
fn with_lamp(side: f64) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let exitance = 10.0 / (side * side);
    let materials = format!("newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0\nKe {exitance}\n");
    std::fs::write(directory.path().join("scene.mtl"), materials).unwrap();
    let corners = [[0, 0], [4, 0], [4, 4], [0, 4]];
    let of_room = [0, 3]
        .into_iter()
        .flat_map(|z| corners.map(|[x, y]| format!("v {x} {y} {z}\n")));
    let of_lamp = [
        [1.0, 1.0],
        [1.0, 1.0 + side],
        [1.0 + side, 1.0 + side],
        [1.0 + side, 1.0],
    ];
    let of_lamp = of_lamp.map(|[x, y]| format!("v {x} {y} 2.5\n"));
    let walls = ["1 2 3 4", "8 7 6 5", "5 6 2 1", "6 7 3 2", "7 8 4 3", "8 5 1 4"];
    let walls = (0..)
        .zip(walls)
        .map(|(k, wall): (u32, _)| format!("o room{k}\nf {wall}\n"));
    let vertices: String = of_room.chain(of_lamp).collect();
    let walls: String = walls.collect();
    let text = format!("mtllib scene.mtl\n{vertices}usemtl grey\n{walls}usemtl lamp\no lamp\nf 9 10 11 12\n");
    std::fs::write(directory.path().join("scene.obj"), text).unwrap();
    directory
}

/// Nearly all of the norm of B is the own light of a small, bright lamp: neither the mesh's error nor the solver's may be told relative to that.
#[test]
fn a_small_lamp_is_no_measure_of_what_it_lights() {
    let solve = |side: f64, more: &[&str]| {
        let directory = with_lamp(side);
        let arguments = ["solve", "scene.obj", "--subdivide", "4", "--json"];
        let output = radiosity(directory.path(), &[&arguments[..], more].concat());
        assert!(output.status.success(), "{output:?}");
        let result: Value = serde_json::from_slice(&output.stdout).unwrap();
        (result, stderr(&output))
    };
    let (large, quiet) = solve(0.1, &[]);
    assert_eq!(quiet, "");
    let (small, loud) = solve(1e-4, &[]);
    for name in ["surface_mean_max", "patches_rms"] {
        let [of_large, of_small] = [&large, &small].map(|result| result["mesh_error"][name].as_f64().unwrap());
        assert!(
            of_small > 1e-2 && (of_small / of_large - 1.0).abs() < 0.2,
            "{name}: {of_small} {of_large}"
        );
    }

    let proposed = loud.trim().rsplit_once("--tolerance ").unwrap().1;
    let reference = solve(1e-4, &["--tolerance", "1e-15", "--solver", "direct"]).0;
    let (better, silent) = solve(1e-4, &["--tolerance", proposed]);
    assert_eq!(silent, "");
    let off = |result: &Value, reference: &Value| {
        let pairs = result["surfaces"]
            .as_array()
            .unwrap()
            .iter()
            .zip(reference["surfaces"].as_array().unwrap());
        let of_walls = pairs.filter(|(own, _)| own["name"] != "lamp");
        let relative = of_walls.map(|(own, right)| {
            let [own, right] = [own, right].map(|surface| surface["radiosity"][0].as_f64().unwrap());
            (own / right - 1.0).abs()
        });
        relative.fold(0.0, f64::max)
    };
    assert!(
        off(&small, &reference) > 1e-3 && off(&better, &reference) < 1e-4,
        "{} {}",
        off(&small, &reference),
        off(&better, &reference)
    );

    // What the lamp sends out is within the tolerance before the first pass, and all else is dark then.
    let (dark, loud) = solve(1e-6, &[]);
    assert_eq!(dark["n_passes"], 0);
    // Another line says that a lamp of 1 µm is not known from coordinates that end there.
    let proposed = loud
        .lines()
        .find_map(|line| line.rsplit_once("give --tolerance "))
        .unwrap()
        .1;
    let reference = solve(1e-6, &["--tolerance", "1e-15", "--solver", "direct"]).0;
    let lit = solve(1e-6, &["--tolerance", proposed]).0;
    assert!(off(&lit, &reference) < 1e-3, "{}", off(&lit, &reference));
    assert!(solve(1e-12, &[]).1.contains("make the emitters larger"));
}

/// The error that is stated is the same whatever is written, of a solution that has not converged too, and that of no lighting is above that of all.
#[test]
fn every_solution_states_its_error() {
    let directory = with_scene("room-box");
    let stated = |more: &[&str], expected: i32| {
        let common = [
            "solve",
            "scene.obj",
            "--subdivide",
            "2",
            "--method",
            "sr",
            "--rays",
            "500",
        ];
        let (code, result) = document(directory.path(), &[&common[..], more].concat());
        assert_eq!(code, expected, "{more:?}: {result}");
        result["estimated_relative_error"].as_f64().unwrap()
    };
    for (more, code) in [(&[] as &[&str], 0), (&["--max-passes", "1", "--solver", "jacobi"], 3)] {
        let bare = stated(more, code);
        for file in ["B.csv", "B.npz", "B.vtu"] {
            let with_file = stated(&[more, &["-o", file]].concat(), code);
            assert_eq!(with_file.to_bits(), bare.to_bits(), "{file}");
        }
    }
    for (name, power) in [("one", "1.0"), ("red", "[9.0, 1.0, 0.0]")] {
        let text = format!("[surface.box_x1]\nexitance = {power}\n");
        std::fs::write(directory.path().join(format!("{name}.toml")), text).unwrap();
    }
    let arguments = [
        "solve",
        "scene.obj",
        "--subdivide",
        "2",
        "--lighting",
        "one.toml",
        "--lighting",
        "red.toml",
        "--explain",
    ];
    let (code, result) = document(directory.path(), &arguments);
    assert_eq!(code, 0, "{result}");
    let lightings = result["lightings"].as_array().unwrap();
    for lighting in lightings {
        assert_eq!(lighting["stop_reason"], "converged");
        for name in [
            "residual_l2",
            "residual_max_power",
            "error_bound",
            "estimated_relative_error",
        ] {
            let (own, all) = (lighting[name].as_f64().unwrap(), result[name].as_f64().unwrap());
            assert!(own >= 0.0 && own <= all, "{name}: {own} {all}");
        }
    }
    let decisions = result["decisions"].as_array().unwrap();
    let channels = decisions.iter().find(|d| d["subject"] == "channels").unwrap();
    assert_eq!(
        channels["choice"], "4",
        "one of the grey lighting, three of the red one"
    );
    let text = String::from_utf8(radiosity(directory.path(), &arguments).stdout).unwrap();
    assert_eq!(text.matches("with form-factor errors about").count(), 2, "{text}");
}

#[test]
fn messages_name_the_file_and_the_flag_at_fault() {
    let directory = with_scene("cube");
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    write("dim.toml", "[surface.x0]\nexitance = 0.5\n");
    let white: String = ["x0", "x1", "y0", "y1", "z0", "z1"]
        .map(|name| format!("[surface.{name}]\nreflectance = 1.0\nexitance = 1.0\n"))
        .concat();
    write("white.toml", &white);
    write("frames.toml", "[[frame]]\nname = \"a\"\nlighting = \"white.toml\"\n");
    for arguments in [
        &[
            "solve",
            "scene.obj",
            "--lighting",
            "dim.toml",
            "--lighting",
            "white.toml",
        ] as &[&str],
        &[
            "render",
            "scene.obj",
            "--subdivide",
            "1",
            "--frames",
            "frames.toml",
            "-o",
            "f.exr",
        ],
    ] {
        let (code, result) = document(directory.path(), arguments);
        assert_eq!((code, &result["error"]["file"]), (1, &"white.toml".into()), "{result}");
        let message = result["error"]["message"].as_str().unwrap();
        assert!(
            message.starts_with("white.toml: no finite solution") && message.contains("lower a `reflectance`"),
            "{message}"
        );
    }
    let directory = with_scene("room-box");
    for command in ["solve", "render"] {
        let arguments = [
            command,
            "scene.obj",
            "--method",
            "sr",
            "--form-factor-tolerance",
            "1e-3",
            "-o",
            "f.exr",
        ];
        let n = if command == "solve" { 6 } else { 8 };
        let output = radiosity(directory.path(), &arguments[..n]);
        assert_eq!(output.status.code(), Some(2));
        assert!(
            stderr(&output).contains("`--form-factor-tolerance`"),
            "{}",
            stderr(&output)
        );
    }
    let output = radiosity(
        directory.path(),
        &["form-factors", "scene.obj", "--method", "sr", "--tolerance", "1e-3"],
    );
    assert!(stderr(&output).contains("`--tolerance`"), "{}", stderr(&output));
}

/// Form factors above their tolerance are told of again where they are used.
#[test]
fn form_factors_that_spent_their_budget_are_told_of() {
    let directory = with_scene("room-box");
    let write = [
        "form-factors",
        "scene.obj",
        "--subdivide",
        "2",
        "--budget",
        "1",
        "-o",
        "F.npz",
    ];
    assert_eq!(radiosity(directory.path(), &write).status.code(), Some(3));
    let output = radiosity(directory.path(), &["solve", "scene.obj", "--form-factors", "F.npz"]);
    let told = stderr(&output);
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(
        told.contains("F.npz: these form factors reached their budget") && told.contains("--budget"),
        "{told}"
    );
}

/// In a room this bright the residual in f64 may be 0 where it is above the tolerance: what one lighting is said to be must not rest on that.
#[test]
fn no_lighting_is_said_to_be_solved_that_is_not() {
    let directory = with_scene("cube");
    let mut n_stagnated = 0;
    for absorbed in ["4.37e-12", "2.04e-12", "1.96e-12", "1e-2"] {
        let reflectance = 1.0 - absorbed.parse::<f64>().unwrap();
        let materials = ["wall", "light"].map(|name| format!("[material.{name}]\nreflectance = {reflectance}\n"));
        std::fs::write(directory.path().join("bright.toml"), materials.concat()).unwrap();
        for solver in ["pcg", "multigrid", "gmres"] {
            let arguments = ["solve", "scene.obj", "--solver", solver, "--lighting", "bright.toml"];
            let (code, result) = document(directory.path(), &arguments);
            let lighting = &result["lightings"][0];
            for name in ["stop_reason", "residual_l2", "residual_max_power", "error_bound"] {
                assert_eq!(lighting[name], result[name], "{absorbed} {solver} {name}");
            }
            n_stagnated += usize::from(lighting["stop_reason"] == "stagnated");
            assert_eq!(code == 0, lighting["stop_reason"] == "converged", "{absorbed} {solver}");
        }
    }
    assert!(
        n_stagnated >= 3,
        "rooms that are too bright to be solved in f64: {n_stagnated}"
    );
}

/// Where the noise of the form factors counts as much as all light does, no error can be stated, and the run has not done what it should.
#[test]
fn form_factors_too_noisy_for_the_reflectances_are_no_success() {
    let directory = with_scene("cube");
    let write = |name: &str, reflectance: f64| {
        let of_surface = |surface| format!("[surface.{surface}]\nreflectance = {reflectance}\nexitance = 1.0\n");
        let text = ["x0", "x1", "y0", "y1", "z0", "z1"].map(of_surface).concat();
        std::fs::write(directory.path().join(name), text).unwrap();
    };
    write("white.toml", 0.999);
    write("grey.toml", 0.5);
    let common = [
        "solve",
        "scene.obj",
        "--subdivide",
        "2",
        "--method",
        "sr",
        "--rays",
        "500",
    ];
    let solve = |more: &[&str]| document(directory.path(), &[&common[..], more].concat());
    for solver in ["gmres", "pcg"] {
        let (code, grey) = solve(&["--solver", solver, "--lighting", "grey.toml"]);
        assert_eq!(code, 0, "{grey}");
        assert!(grey["estimated_relative_error"].as_f64().unwrap() < 0.2, "{grey}");
        let both = [
            "--solver",
            solver,
            "--lighting",
            "grey.toml",
            "--lighting",
            "white.toml",
        ];
        let (code, result) = solve(&both);
        assert_eq!(
            (code, &result["stop_reason"]),
            (3, &Value::from("converged")),
            "{result}"
        );
        let stated = |value: &Value| value["estimated_relative_error"].clone();
        let lightings = &result["lightings"];
        assert_eq!([&result, &lightings[1]].map(stated), [Value::Null, Value::Null]);
        assert_eq!(stated(&lightings[0]), stated(&grey));
        let warnings = result["warnings"].as_array().unwrap();
        let fitting = warnings
            .iter()
            .filter(|text| text.as_str().unwrap().contains("too inexact"));
        assert_eq!(fitting.count(), 1, "{warnings:?}");
        let output = radiosity(directory.path(), &[&common[..], &both].concat());
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains("form-factor errors unknown"), "{text}");
    }
}

/// No number between the light and what is said of it leaves the range where these do not.
#[test]
fn the_means_of_the_brightest_light_are_numbers() {
    let directory = with_scene("cube");
    let text = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    let enlarged = text.lines().map(|line| {
        let numbers = line
            .strip_prefix("v ")
            .map(|rest| rest.split_whitespace().map(|x| format!(" {x}e6")));
        numbers.map_or(line.to_owned(), |numbers| format!("v{}", numbers.collect::<String>())) + "\n"
    });
    std::fs::write(directory.path().join("large.obj"), enlarged.collect::<String>()).unwrap();
    std::fs::write(
        directory.path().join("lamp.toml"),
        "[surface.x0]\nexitance = 1e290\n[surface.x1]\nreflectance = 0.5\n",
    )
    .unwrap();
    let (code, result) = document(
        directory.path(),
        &["solve", "large.obj", "--lighting", "lamp.toml", "--subdivide", "3"],
    );
    assert_eq!(code, 0, "{result}");
    let mean = |surface: usize| numbers(&result["lightings"][0]["surfaces"][surface]["radiosity"])[0];
    assert!((mean(0) / 1e290 - 1.0).abs() < 1e-12, "{:e}", mean(0));
    // Opposite sides of a cube see a fifth of each other.
    assert!((mean(1) / 1e289 - 1.0).abs() < 0.1, "{:e}", mean(1));
}
