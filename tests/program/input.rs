//! Bad input and bad usage.

use std::fmt::Write as _;

use crate::{document, radiosity, stderr, with_scene};

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
        // The name of a built-in scene, where a file is wanted: the message tells how to write it.
        ("cube", "`radiosity scene cube -o cube.obj`"),
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
        &["solve", "scene.obj", "--tolerance", "5e-324"],
        &["solve", "scene.obj", "--tolerance", "1"],
        &["solve", "scene.obj", "--tolerance", "NaN"],
        &["paint", "scene.obj"],
        &["form-factors"],
        &["form-factors", "scene.obj", "--subdivide", "0"],
        &["form-factors", "scene.obj", "--max-edge", "0"],
        &["form-factors", "scene.obj", "--max-edge", "-1"],
        &["render", "scene.obj", "-o", "x.exr", "--fov", "0"],
        &["render", "scene.obj", "-o", "x.exr", "--fov", "180"],
        &["scene", "nope", "-o", "x.obj"],
        &["scene", "cube", "--level", "2", "-o", "x.obj"],
        &["voxel", "scene.obj", "--solver", "pcg"],
        &[
            "voxel",
            "scene.obj",
            "--solver",
            "direct",
            "--links",
            "recompute",
            "--voxels",
            "4",
            "--radius",
            "1",
        ],
    ] {
        let output = radiosity(directory.path(), arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let message = stderr(&output);
        assert!(
            message.starts_with("radiosity: ") && message.lines().count() == 1,
            "{message}"
        );
        let (code, result) = document(directory.path(), arguments);
        assert_eq!(code, 2, "{arguments:?}");
        let told = result["error"]["message"].as_str().unwrap();
        assert_eq!(message, format!("radiosity: {told}\n"));
    }
    // What clap spreads over several lines is all there.
    for (arguments, words) in [
        (
            &["form-factors"] as &[&str],
            &["required arguments were not provided: <SCENE>"] as &[&str],
        ),
        (&["render"], &["not provided: --output <IMAGE.exr>, <SCENE>"]),
        (
            &["solve", "scene.obj", "--method", "hyper"],
            &["'hyper'", "--method <NAME>", "[possible values: ", "hemicube", "exact"],
        ),
        (&["solve", "scene.obj", "--metod", "sr"], &["'--metod'", "'--method'"]),
        (&["solv", "scene.obj"], &["'solv'", "'solve'"]),
        (
            &["voxel", "scene.obj", "--solver", "pcg"],
            &["'pcg'", "gmres", "jacobi"],
        ),
        (
            &["solve", "scene.obj", "--subdivide", "2", "--max-edge", "1"],
            &["--subdivide <N>", "--max-edge <L>"],
        ),
        (&["solve", "scene.obj", "--tolerance", "-1"], &["'-1'", "--tolerance"]),
        (
            &["form-factors", "scene.obj", "--tolerance", "-1.5e-3"],
            &["'-1.5e-3'", "--tolerance"],
        ),
    ] {
        let (_, result) = document(directory.path(), arguments);
        let told = result["error"]["message"].as_str().unwrap();
        assert!(words.iter().all(|word| told.contains(word)), "{told}");
    }
    let (code, result) = document(directory.path(), &["solve", "scene.obj", "--method", "hyper"]);
    assert_eq!(code, 2);
    assert_eq!(result["error"]["kind"], "usage");
}

/// What is doubtful is told on stderr and in the document; with `--quiet` in the document alone.
#[test]
fn faces_that_look_the_wrong_way_are_told() {
    let directory = with_scene("room-box");
    let obj = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    let mut lines: Vec<String> = obj.lines().map(str::to_owned).collect();
    let wall = lines.iter().position(|line| line.starts_with("f ")).unwrap();
    let corners: Vec<&str> = obj.lines().nth(wall).unwrap()[2..].split(' ').rev().collect();
    lines[wall] = format!("f {}", corners.join(" "));
    std::fs::write(directory.path().join("scene.obj"), lines.join("\n")).unwrap();
    let expected = format!(
        "scene.obj:{}: `room_x0`: the face sees no other, and others see the back: the normal is probably inverted; reverse the face, or the whole surface with --flip=room_x0",
        wall + 1
    );
    for arguments in [
        &["form-factors", "scene.obj"] as &[&str],
        &["solve", "scene.obj"],
        &["voxel", "scene.obj", "--voxels", "8", "--radius", "2"],
    ] {
        let output = radiosity(directory.path(), arguments);
        assert!(
            stderr(&output).contains(&format!("radiosity: warning: {expected}\n")),
            "{}",
            stderr(&output)
        );
        let (_, result) = document(directory.path(), &[arguments, &["--quiet"]].concat());
        let told = result["warnings"].as_array().unwrap();
        assert!(told.contains(&expected.as_str().into()), "{told:?}");
    }
}

/// Who wants form factors alone is not asked for lamps and paints.
#[test]
fn bare_geometry_is_enough_for_form_factors() {
    let directory = tempfile::tempdir().unwrap();
    let plates = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 0 1 1\nv 1 1 1\nv 1 0 1\nf 1 2 3 4\nf 5 6 7 8\n";
    std::fs::write(directory.path().join("p.obj"), plates).unwrap();
    let output = radiosity(directory.path(), &["form-factors", "p.obj"]);
    assert_eq!(stderr(&output), "");
    let solved = stderr(&radiosity(directory.path(), &["solve", "p.obj"]));
    assert!(
        solved.contains("no face emits light") && solved.contains("reflect 0.5"),
        "{solved}"
    );
    // What is wrong with the geometry counts for both.
    std::fs::write(directory.path().join("p.obj"), plates.replace("1 1 1\n", "1 1 1.1\n")).unwrap();
    let bent = stderr(&radiosity(directory.path(), &["form-factors", "p.obj"]));
    assert!(
        bent.contains("p.obj:10: a face is not flat") && bent.lines().count() == 1,
        "{bent}"
    );
}

/// Rays of scenes beyond what products of coordinates in f32 can hold are traced at a scale.
#[test]
fn sizes_beyond_planets_and_below_atoms_are_no_error() {
    let directory = tempfile::tempdir().unwrap();
    for size in ["1e12", "1e-12"] {
        let text = format!("v 0 0 0\nv {size} 0 0\nv 0 {size} 0\nf 1 2 3\n");
        std::fs::write(directory.path().join("sized.obj"), text).unwrap();
        let (code, result) = document(directory.path(), &["form-factors", "sized.obj"]);
        assert_eq!((code, &result["error"]), (0, &serde_json::Value::Null), "{size}");
    }
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

#[test]
fn joined_vertices_are_the_cause_of_the_errors_that_they_make() {
    let directory = tempfile::tempdir().unwrap();
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0.001\nv 0.1 0 1\nv 0.9 0.1 0\nf 1 2 3\nf 4 5 6\n";
    std::fs::write(directory.path().join("a.obj"), text).unwrap();
    let output = radiosity(
        directory.path(),
        &["form-factors", "a.obj", "--merge-tolerance", "0.01"],
    );
    let message = stderr(&output);
    let doubt = message.lines().find(|line| line.contains("above the tolerance"));
    let doubt = doubt.unwrap_or_else(|| panic!("{message}"));
    assert!(
        doubt.contains("joined over up to 1.0e-3 m") && doubt.contains("--merge-tolerance"),
        "{doubt}"
    );
    assert!(!doubt.contains("digits"), "{doubt}");
}

/// No output takes the place of a file that the same command reads or keeps its work in: what was there stays, and nothing is written.
#[test]
fn an_output_is_no_other_file_of_its_command() {
    let directory = with_scene("cube");
    let run = |arguments: &[&str]| {
        let output = radiosity(directory.path(), arguments);
        (output.status.code(), stderr(&output))
    };
    let (code, told) = run(&["form-factors", "scene.obj", "-o", "F.npz", "--checkpoint", "./F.npz"]);
    assert_eq!(code, Some(2), "{told}");
    assert!(
        told.contains("F.npz: the output and the checkpoint are one file"),
        "{told}"
    );
    assert!(!directory.path().join("F.npz").exists());
    assert_eq!(run(&["form-factors", "scene.obj", "-o", "F.npz"]).0, Some(0));
    let before = std::fs::read(directory.path().join("F.npz")).unwrap();
    let (code, told) = run(&["solve", "scene.obj", "--form-factors", "F.npz", "-o", "./F.npz"]);
    assert_eq!(code, Some(2), "{told}");
    assert!(told.contains("the output and the form factors are one file"), "{told}");
    assert_eq!(std::fs::read(directory.path().join("F.npz")).unwrap(), before);

    // Nor one that it writes beside the output, or in its place.
    let path = |name: &str| directory.path().join(name);
    for name in ["F-lamp.npz", "kept.png", "own.toml"] {
        std::fs::copy(path("F.npz"), path(name)).unwrap();
    }
    std::fs::write(path("lamp.toml"), "[surface.x0]\nexitance = 2.0\n").unwrap();
    std::fs::write(path("frames.toml"), "[[frame]]\nname = \"a\"\n").unwrap();
    let scene = std::fs::read_to_string(path("scene.obj")).unwrap();
    std::fs::write(path("scene.obj"), scene + "mtllib library.png\n").unwrap();
    std::fs::write(path("library.png"), "").unwrap();
    for (arguments, words) in [
        (
            "render scene.obj -o z.exr --checkpoint z.png",
            "z.png: the preview of the output and the checkpoint",
        ),
        (
            "form-factors scene.obj -o G.npy --checkpoint G.npy.json",
            "G.npy.json: the description beside the output and the checkpoint",
        ),
        (
            "solve scene.obj --form-factors F-lamp.npz --lighting lamp.toml -o F.npz",
            "F-lamp.npz: the output for the lighting `lamp` and the form factors",
        ),
        (
            "solve scene.obj --lighting lamp.toml -o B.csv --checkpoint B-lamp.csv",
            "B-lamp.csv: the output for the lighting `lamp` and the checkpoint",
        ),
        (
            "render scene.obj --frames frames.toml -o z.exr --checkpoint ./z-a.png",
            "z-a.png: the preview of the picture of frame `a` and the checkpoint",
        ),
        (
            "voxel scene.obj --voxels 8 --radius 2 --links disk --link-file same.exr -o same.exr",
            "same.exr: the output and the link file",
        ),
        (
            "voxel scene.obj --voxels 8 --radius 2 --link-file same.png -o same.exr",
            "same.png: the preview of the output and the link file",
        ),
        (
            "render scene.obj --width 8 -o library.exr",
            "library.png: the preview of the output and a material library of the scene",
        ),
        (
            "field scene.obj --surface x0 --camera kept.png -o kept.exr",
            "kept.png: the preview of the output and the camera",
        ),
    ] {
        let there = crate::program::names(directory.path());
        let (code, told) = run(&arguments.split(' ').collect::<Vec<_>>());
        assert_eq!(code, Some(2), "{arguments}: {told}");
        assert!(
            told.contains(words) && told.contains(" are one file"),
            "{arguments}: {told}"
        );
        assert_eq!(crate::program::names(directory.path()), there, "{arguments}");
    }
    for name in ["F-lamp.npz", "kept.png"] {
        assert_eq!(std::fs::read(path(name)).unwrap(), before, "{name}");
    }
}

/// A white, lit room is refused however its form factors are had, though another room beside it loses light.
#[test]
fn a_white_room_beside_another_has_no_solution() {
    let directory = with_scene("cube");
    let read = |name: &str| std::fs::read_to_string(directory.path().join(name)).unwrap();
    let (scene, library) = (read("scene.obj"), read("scene.mtl"));
    let mut both = scene.clone();
    let n_vertices = scene.lines().filter(|line| line.starts_with("v ")).count();
    for line in scene.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let at: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
                writeln!(both, "v {} {} {}", at[0] + 5.0, at[1], at[2]).unwrap();
            }
            Some("f") => {
                let corners = words.map(|word| (word.parse::<usize>().unwrap() + n_vertices).to_string());
                writeln!(both, "f {}", corners.collect::<Vec<_>>().join(" ")).unwrap();
            }
            Some("o") => writeln!(both, "o white_{}", words.next().unwrap()).unwrap(),
            Some("usemtl") => both += "usemtl white\n",
            _ => {}
        }
    }
    std::fs::write(directory.path().join("two.obj"), both).unwrap();
    let white = format!("{library}\nnewmtl white\nKd 1 1 1\nKe 1 1 1\n");
    std::fs::write(directory.path().join("scene.mtl"), white).unwrap();
    for how in [&["--method", "sr"] as &[&str], &["--method", "sr", "--on-the-fly"]] {
        let arguments = [&["solve", "two.obj", "--rays", "300"], how].concat();
        let output = radiosity(directory.path(), &arguments);
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(told.contains("no finite solution"), "{told}");
    }
}

/// The system would end the program without a word.
#[cfg(unix)]
#[test]
fn a_file_beyond_the_limit_of_sizes_is_an_error_that_leaves_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = ["scene", "living-room", "-o", "x.obj"];
    let output = crate::program::limited(directory.path(), "ulimit -f 8; exec", &arguments)
        .output()
        .unwrap();
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{:?} {message}", output.status);
    assert!(
        message.contains("x.") && message.trim().lines().count() == 1,
        "{message}"
    );
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 0);
}

#[test]
fn messages_are_sentences_about_what_was_given() {
    let directory = with_scene("cube");
    let one = ["--eye", "0.5,0.5,0.5", "--look-at", "0.5,0.5,0.5"];
    let arguments = [&["field", "scene.obj", "--surface", "x0", "-o", "f.exr"][..], &one].concat();
    let output = radiosity(directory.path(), &arguments);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("two points"), "{}", stderr(&output));

    // Names of a file do not command a terminal.
    let scene = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    std::fs::write(directory.path().join("e.obj"), scene.replace(" x1", " x\u{1b}[31m")).unwrap();
    let field = ["field", "e.obj", "--surface", "x0", "-o", "f.exr", "--width", "4"];
    for command in [&field[..], &["voxel", "e.obj", "--voxels", "4", "--radius", "3"]] {
        let output = radiosity(directory.path(), command);
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(text.contains("x\u{fffd}[31m") && !text.contains('\u{1b}'), "{text}");
    }
}
