//! Files written by other programs and other people: which are read, repaired or refused.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

use crate::program::limited;
use crate::{document, radiosity, stderr};

const ROOM: &str = "v 0 0 0\nv 5 0 0\nv 5 4 0\nv 0 4 0\nv 0 0 3\nv 5 0 3\nv 5 4 3\nv 0 4 3\n\
    o floor\nusemtl grey\nf 1 2 3 4\no ceiling\nusemtl lamp\nf 5 8 7 6\nusemtl grey\no south\nf 1 5 6 2\no east\nf 2 6 7 3\n\
    o north\nf 3 7 8 4\no west\nf 4 8 5 1\n";
const MATERIALS: &str = "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\nKe 10\n";

fn write(directory: &Path, name: &str, text: &str) {
    std::fs::write(directory.join(name), text).unwrap();
}

/// A directory with the room as `room.obj` and its library.
fn with_room() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    write(directory.path(), "room.obj", &format!("mtllib room.mtl\n{ROOM}"));
    write(directory.path(), "room.mtl", MATERIALS);
    directory
}

fn warnings(document: &Value) -> Vec<String> {
    let all = document["warnings"].as_array().unwrap();
    all.iter().map(|warning| warning.as_str().unwrap().to_owned()).collect()
}

fn areas(document: &Value) -> Vec<(String, f64)> {
    let surfaces = document["surfaces"].as_array().unwrap();
    let area = |s: &Value| (s["name"].as_str().unwrap().to_owned(), s["area_m2"].as_f64().unwrap());
    surfaces.iter().map(area).collect()
}

/// Runs a program that may wait for ever; then the exit code is 124.
fn in_time(directory: &Path, arguments: &[&str]) -> Output {
    limited(directory, "exec timeout 60", arguments).output().unwrap()
}

#[test]
fn a_door_and_a_window_that_are_drawn_on_a_wall_are_cut_out_of_it() {
    let directory = with_room();
    let drawn = "v 1 0 0\nv 1 0 2\nv 2 0 2\nv 2 0 0\no door\nusemtl grey\nf 9 10 11 12\n\
        v 3 0 1\nv 3 0 2\nv 4 0 2\nv 4 0 1\no window\nf 13 14 15 16\n";
    write(
        directory.path(),
        "drawn.obj",
        &format!("mtllib room.mtl\n{ROOM}{drawn}"),
    );
    let (code, found) = document(directory.path(), &["form-factors", "drawn.obj", "-o", "f.npz"]);
    assert_eq!(code, 0, "{found}");
    for (name, area) in areas(&found) {
        let right = match name.as_str() {
            "floor" | "ceiling" => 20.0,
            "north" => 15.0,
            "south" | "east" | "west" => 12.0,
            "door" => 2.0,
            _ => 1.0,
        };
        assert!((area - right).abs() <= 1e-12 * right, "{name}: {area}");
    }
    let expected = "drawn.obj:31: 2 faces lie on larger ones in their plane, this is the first; they are cut out of these, 3 m² in all";
    assert_eq!(warnings(&found), [expected]);
    // Together they receive what the wall does without them.
    let (_, whole) = document(directory.path(), &["form-factors", "room.obj"]);
    let factor = |found: &Value, from: usize, to: usize| found["surface_form_factor"][from][to].as_f64().unwrap();
    for from in [0, 1, 3, 4, 5] {
        let parts: f64 = [2, 6, 7].map(|to| factor(&found, from, to)).iter().sum();
        assert!((parts - factor(&whole, from, 2)).abs() < 1e-9, "{from}: {parts}");
    }
    // The same scene is cut in the same way.
    let (code, again) = document(directory.path(), &["solve", "drawn.obj", "--form-factors", "f.npz"]);
    assert_eq!(code, 0, "{again}");
    let bytes = std::fs::read(directory.path().join("f.npz")).unwrap();
    document(
        directory.path(),
        &["form-factors", "drawn.obj", "-o", "f.npz", "--threads", "1"],
    );
    assert_eq!(std::fs::read(directory.path().join("f.npz")).unwrap(), bytes);
}

#[test]
fn inverted_normals_are_reversed_on_request() {
    let directory = with_room();
    let reverse = |text: &str, of: &[&str]| -> String {
        let mut surface = "";
        let lines = text.lines().map(|line| {
            surface = line.strip_prefix("o ").unwrap_or(surface);
            match line.strip_prefix("f ") {
                Some(corners) if of.is_empty() || of.contains(&surface) => {
                    let corners: Vec<&str> = corners.split(' ').rev().collect();
                    format!("f {}\n", corners.join(" "))
                }
                _ => format!("{line}\n"),
            }
        });
        lines.collect()
    };
    let room = format!("mtllib room.mtl\n{ROOM}");
    write(directory.path(), "all.obj", &reverse(&room, &[]));
    write(directory.path(), "two.obj", &reverse(&room, &["south", "west"]));
    let factors = |arguments: &[&str]| document(directory.path(), &[&["form-factors"], arguments].concat()).1;
    let right = factors(&["room.obj"])["surface_form_factor"].clone();
    let inverted = factors(&["all.obj"]);
    assert!(
        warnings(&inverted)
            .iter()
            .any(|warning| warning.contains("no face sees another") && warning.contains("--flip")),
        "{inverted}"
    );
    let mended = factors(&["all.obj", "--flip"]);
    assert_eq!((&mended["surface_form_factor"], warnings(&mended).len()), (&right, 0));
    let two = factors(&["two.obj"]);
    for name in ["south", "west"] {
        let remedy = format!("--flip={name}");
        assert!(warnings(&two).iter().any(|warning| warning.contains(&remedy)), "{two}");
    }
    let mended = factors(&["two.obj", "--flip=south", "--flip=west"]);
    assert_eq!((&mended["surface_form_factor"], warnings(&mended).len()), (&right, 0));
    assert_eq!(mended["settings"]["flip"], serde_json::json!(["south", "west"]));
    let output = radiosity(directory.path(), &["form-factors", "two.obj", "--flip=roof"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("no surface `roof`") && stderr(&output).contains("`floor`"),
        "{}",
        stderr(&output)
    );
    let output = radiosity(directory.path(), &["scene", "cube", "-o", "c.obj", "--flip"]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
}

#[test]
fn libraries_are_found_beside_the_scene_by_their_file_names() {
    let directory = with_room();
    write(directory.path(), "my room.MTL", MATERIALS);
    write(directory.path(), "a #1.mtl", MATERIALS);
    for (named, used) in [
        ("room.mtl # the library", ""),
        ("room.mtl\t# a # b", ""),
        ("ROOM.mtl #", "room.mtl"),
        ("\"my room.MTL\" # quoted", ""),
        ("a #1.mtl", ""),
        ("a #1.mtl # comment", ""),
        ("ROOM.mtl", "room.mtl"),
        ("Room.MTL", "room.mtl"),
        ("\"room.mtl\"", ""),
        ("\"C:\\Users\\a b\\Room.mtl\"", "room.mtl"),
        ("C:\\scenes\\room.mtl", "room.mtl"),
        ("/home/other/room.mtl", "room.mtl"),
        ("../materials/room.mtl", "room.mtl"),
        ("\"my room.mtl\"", "my room.MTL"),
        ("my room.mtl", "my room.MTL"),
        ("'my room.MTL'", ""),
        ("D:\\all of it\\my room.mtl", "my room.MTL"),
    ] {
        write(directory.path(), "a.obj", &format!("mtllib {named}\n{ROOM}"));
        let (code, found) = document(directory.path(), &["solve", "a.obj"]);
        assert_eq!(code, 0, "{named}: {found}");
        let told = warnings(&found);
        assert_eq!(told.len(), usize::from(!used.is_empty()), "{named}: {told:?}");
        assert!(
            told.iter()
                .all(|warning| warning.contains(&format!("`{used}` beside the scene"))),
            "{named}: {told:?}"
        );
        let lamp = found["surfaces"][1]["radiosity"][0].as_f64().unwrap();
        assert!(lamp > 10.0, "{named}: {lamp}");
    }
    // Every command says so, whether it needs materials or not.
    for (names, told) in [
        ("mtllib\nmtllib   ", "a.obj:1: `mtllib` without a name"),
        (
            "mtllib ROOM.mtl",
            "a.obj:1: material library `ROOM.mtl` is not there; `room.mtl` beside",
        ),
        (
            "mtllib gone.mtl # lib",
            "a.obj:1: material library `gone.mtl` is not there",
        ),
    ] {
        write(directory.path(), "a.obj", &format!("{names}\n{ROOM}"));
        for command in ["solve", "form-factors"] {
            let (code, found) = document(directory.path(), &[command, "a.obj"]);
            assert_eq!(code, 0, "{command} {names}: {found}");
            let n_told = warnings(&found)
                .iter()
                .filter(|warning| warning.starts_with(told))
                .count();
            assert_eq!(n_told, 1, "{command} {names}: {:?}", warnings(&found));
        }
    }
}

/// Near the least numbers digits are lost, and the conservation checks with them.
#[test]
fn light_is_not_dimmer_than_numbers_have_digits() {
    let directory = with_room();
    let library = |exitance: &str| format!("newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\nKe {exitance}\n");
    write(directory.path(), "a.toml", "[surface.ceiling]\nexitance = 1e-320\n");
    let (code, result) = document(directory.path(), &["solve", "room.obj", "--lighting", "a.toml"]);
    assert_eq!((code, &result["error"]["line"]), (1, &2.into()), "{result}");
    for exitance in ["1e-320", "1 1e-310 0", "5e-324", "9e-301"] {
        write(directory.path(), "room.mtl", &library(exitance));
        let (code, result) = document(directory.path(), &["solve", "room.obj"]);
        assert_eq!((code, &result["error"]["line"]), (1, &5.into()), "{exitance}: {result}");
        let message = result["error"]["message"].as_str().unwrap();
        assert!(message.contains("is below 1e-300 W/m²"), "{message}");
    }
    for exitance in ["1e-300", "0"] {
        write(directory.path(), "room.mtl", &library(exitance));
        let (code, result) = document(directory.path(), &["solve", "room.obj"]);
        let broken = warnings(&result)
            .iter()
            .filter(|warning| warning.contains("BROKEN"))
            .count();
        assert!(code == 0 && broken == 0, "{exitance}: {result}");
    }
}

#[test]
fn what_a_scene_names_is_a_plain_file_and_a_scene_may_come_from_a_pipe() {
    let directory = with_room();
    let path = |name: &str| directory.path().join(name);
    for name in ["pipe.mtl", "pipe.toml"] {
        assert!(Command::new("mkfifo").arg(path(name)).status().unwrap().success());
    }
    write(directory.path(), "a.obj", &format!("mtllib pipe.mtl\n{ROOM}"));
    write(
        directory.path(),
        "list.toml",
        "[[frame]]\nname = \"a\"\nlighting = \"pipe.toml\"\n",
    );
    write(
        directory.path(),
        "views.toml",
        "[[frame]]\nname = \"a\"\ncamera = \"pipe.toml\"\n",
    );
    for (arguments, file) in [
        (&["solve", "a.obj"] as &[&str], "pipe.mtl"),
        (&["form-factors", "a.obj"], "pipe.mtl"),
        (
            &["render", "room.obj", "-o", "x.exr", "--frames", "list.toml"],
            "pipe.toml",
        ),
        (
            &["render", "room.obj", "-o", "x.exr", "--frames", "views.toml"],
            "pipe.toml",
        ),
    ] {
        let output = in_time(directory.path(), arguments);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {message}");
        assert!(
            message.contains(file) && message.contains("name a plain file"),
            "{message}"
        );
    }
    std::fs::rename(path("pipe.toml"), path("camera.toml")).unwrap();
    let output = in_time(directory.path(), &["render", "room.obj", "-o", "x.exr", "--width", "4"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(
        stderr(&output).contains("camera.toml: is a pipe"),
        "{}",
        stderr(&output)
    );
    std::fs::remove_file(path("camera.toml")).unwrap();
    let mut cat = Command::new("cat")
        .arg(path("room.obj"))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let piped = limited(
        directory.path(),
        "exec timeout 60",
        &["form-factors", "/dev/stdin", "--json"],
    )
    .stdin(cat.stdout.take().unwrap())
    .output()
    .unwrap();
    cat.wait().unwrap();
    let found: Value = serde_json::from_slice(&piped.stdout).unwrap();
    assert_eq!(areas(&found).len(), 6, "{}", stderr(&piped));
}

#[test]
fn quoted_input_is_cut_and_numbers_are_refused_by_their_flags() {
    let directory = with_room();
    let long = "x".repeat(5000);
    write(directory.path(), "long.obj", &format!("v 0 0 {long}\nf 1 1 1\n"));
    write(
        directory.path(),
        "name.obj",
        &format!("mtllib {long}\nmtllib room.mtl\nusemtl {long}\n{ROOM}"),
    );
    write(
        directory.path(),
        "long.toml",
        &format!("[surface.{long}]\nexitance = 1\n"),
    );
    for arguments in [
        &["form-factors", "long.obj"] as &[&str],
        &["solve", "name.obj"],
        &["solve", "room.obj", "--lighting", "long.toml"],
        &["solve", "room.obj", "--solver", &long],
    ] {
        let message = stderr(&radiosity(directory.path(), arguments));
        assert!(
            !message.is_empty() && message.lines().all(|line| line.len() < 600),
            "{arguments:?}: {message}"
        );
    }
    for (command, flag) in [
        ("solve", "--tolerance"),
        ("solve", "--form-factor-tolerance"),
        ("solve", "--max-passes"),
        ("solve", "--omega"),
        ("solve", "--restart"),
        ("solve", "--depth"),
        ("solve", "--subdivide"),
        ("solve", "--max-edge"),
        ("solve", "--rays"),
        ("solve", "--points"),
        ("solve", "--resolution"),
        ("solve", "--budget"),
        ("solve", "--seed"),
        ("solve", "--memory-limit"),
        ("solve", "--threads"),
        ("form-factors", "--tolerance"),
        ("render", "--width"),
        ("render", "--fov"),
        ("voxel", "--voxels"),
        ("voxel", "--radius"),
        ("voxel", "--passes"),
        ("voxel", "--adaptive"),
        ("compare", "--tolerance"),
        ("compare", "--time-limit"),
    ] {
        for value in ["-1", "-0.5e3"] {
            let mut arguments = vec![command, "room.obj", flag, value];
            if command == "render" {
                arguments.extend(["-o", "x.exr"]);
            }
            let output = radiosity(directory.path(), &arguments);
            let message = stderr(&output);
            assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
            let is_about_it = message.contains(flag) || message.contains(flag.trim_start_matches('-'));
            assert!(
                is_about_it && !message.contains("unexpected argument"),
                "{arguments:?}: {message}"
            );
        }
    }
}

#[test]
fn light_that_overflows_is_refused_with_its_line_and_value() {
    let directory = with_room();
    let dark = format!("mtllib dark.mtl\n{ROOM}");
    write(directory.path(), "dark.obj", &dark);
    write(
        directory.path(),
        "dark.mtl",
        "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\n",
    );
    let enlarged = |line: &str| match line.strip_prefix("v ") {
        Some(numbers) => format!("v {}e6\n", numbers.replace(' ', "e6 ")),
        None => format!("{line}\n"),
    };
    let far: String = ROOM.lines().map(enlarged).collect();
    write(directory.path(), "far.obj", &format!("mtllib room.mtl\n{far}"));
    let white = ROOM.replacen("usemtl grey", "usemtl white", 1);
    write(
        directory.path(),
        "white.obj",
        &format!("mtllib room.mtl\nmtllib white.mtl\n{white}"),
    );
    write(directory.path(), "white.mtl", "newmtl white\nKd 0.999999999999999\n");
    for (exitance, scene, command) in [
        ("1e308", "room.obj", "solve"),
        ("1 1.7e308 1", "room.obj", "solve"),
        ("1e308", "room.obj", "voxel"),
        ("1e308", "room.obj", "render"),
        ("1e39", "room.obj", "render"),
        ("1e299", "far.obj", "solve"),
        ("1e292", "white.obj", "solve"),
    ] {
        write(
            directory.path(),
            "room.mtl",
            &format!("newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\nKe {exitance}\n"),
        );
        write(
            directory.path(),
            "a.toml",
            &format!(
                "[surface.ceiling]\nreflectance = 0.5\nexitance = {}\n",
                exitance.split(' ').nth(1).unwrap_or(exitance)
            ),
        );
        let output = if command == "render" {
            &["-o", "x.exr", "--width", "4"] as &[&str]
        } else {
            &[]
        };
        let (code, result) = document(directory.path(), &[&[command, scene], output].concat());
        assert_eq!(
            (code, &result["error"]["line"]),
            (1, &5.into()),
            "{exitance} {command}: {result}"
        );
        let message = result["error"]["message"].as_str().unwrap();
        let value: f64 = exitance.split(' ').nth(1).unwrap_or(exitance).parse().unwrap();
        let expected = format!("room.mtl:5: exitance `Ke` {value:e} is above ");
        assert!(message.starts_with(&expected), "{message}");
        if command == "solve" && scene == "room.obj" {
            let (code, result) = document(directory.path(), &["solve", "dark.obj", "--lighting", "a.toml"]);
            assert_eq!((code, &result["error"]["line"]), (1, &3.into()), "{exitance}: {result}");
        }
    }
    // Just below, everything is a number.
    write(
        directory.path(),
        "room.mtl",
        "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\nKe 1e300\n",
    );
    let (code, result) = document(directory.path(), &["solve", "room.obj"]);
    assert_eq!(code, 0, "{result}");
    for value in result["energy"][0]
        .as_object()
        .unwrap()
        .values()
        .filter(|value| !value.is_null())
    {
        assert!(value.as_f64().unwrap().is_finite());
    }
    assert!(result["energy"][0]["emitted"].as_f64().unwrap() > 1e300, "{result}");
    write(
        directory.path(),
        "room.mtl",
        "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\nKe 1e37\n",
    );
    let (code, result) = document(
        directory.path(),
        &[
            "render",
            "room.obj",
            "-o",
            "x.exr",
            "--width",
            "4",
            "--subdivide",
            "1",
            "--strict",
        ],
    );
    assert_eq!(code, 0, "{result}");
}

#[test]
fn darkness_is_told_of_the_lighting_that_counts() {
    let directory = with_room();
    write(
        directory.path(),
        "room.mtl",
        "newmtl grey\nKd 0.5\nnewmtl lamp\nKd 0.5\n",
    );
    write(directory.path(), "lit.toml", "[surface.ceiling]\nexitance = 3\n");
    write(
        directory.path(),
        "painted.toml",
        "[surface.ceiling]\nreflectance = 0.3\n",
    );
    write(
        directory.path(),
        "lit_list.toml",
        "[[frame]]\nname = \"a\"\nlighting = \"lit.toml\"\n",
    );
    write(
        directory.path(),
        "list.toml",
        "[[frame]]\nname = \"a\"\nlighting = \"lit.toml\"\n[[frame]]\nname = \"b\"\n",
    );
    let told = |arguments: &[&str]| warnings(&document(directory.path(), arguments).1);
    let dark = "room.obj: no face emits light; give a material an exitance `Ke`";
    assert_eq!(told(&["solve", "room.obj"]), [dark]);
    assert_eq!(told(&["solve", "room.obj", "--lighting", "lit.toml"]), [""; 0]);
    assert_eq!(
        told(&[
            "solve",
            "room.obj",
            "--lighting",
            "lit.toml",
            "--lighting",
            "painted.toml"
        ]),
        ["painted.toml: no face emits light in this lighting; give a surface an `exitance`"]
    );
    let frames = |list| {
        told(&[
            "render",
            "room.obj",
            "-o",
            "x.exr",
            "--width",
            "4",
            "--subdivide",
            "1",
            "--frames",
            list,
        ])
    };
    assert!(!frames("lit_list.toml").iter().any(|warning| warning.contains("emits")));
    assert!(frames("list.toml").contains(&dark.to_owned()));
}

#[test]
fn old_and_free_form_statements_are_read_or_counted() {
    let directory = with_room();
    let right = document(directory.path(), &["form-factors", "room.obj"]).1["surface_form_factor"].clone();
    let old = format!("mtllib room.mtl\n{}", ROOM.replace("\nf ", "\nfo "));
    write(directory.path(), "old.obj", &old);
    let (code, found) = document(directory.path(), &["form-factors", "old.obj"]);
    assert_eq!(
        (code, &found["surface_form_factor"], warnings(&found).len()),
        (0, &right, 0)
    );
    let capitals = ROOM
        .replace("\nv ", "\nV ")
        .replace("v 0 0 0\nV", "V 0 0 0\nV")
        .replace("\nf ", "\nF ")
        .replace("\no ", "\nO ");
    write(
        directory.path(),
        "capitals.obj",
        &format!("MTLLIB room.mtl\n{}", capitals.replace("usemtl", "USEMTL")),
    );
    let (code, found) = document(directory.path(), &["solve", "capitals.obj"]);
    assert_eq!(code, 0, "{found}");
    assert_eq!(areas(&found).len(), 6);
    assert_eq!(
        warnings(&found),
        ["capitals.obj:1: 24 keywords in capitals, of which this is the first, read as in small letters"]
    );
    let mut more = format!("mtllib room.mtl\n{ROOM}vn 0 0 1\nvt 0 0\ns off\n");
    let first = more.lines().count() + 1;
    more += "l 1 2\np 1 2 3\nl 3 4 5\ncstype bezier\ndeg 3 3\nsurf 0 1 0 1 1 2 3 4\nparm u 0 1\nend\ncurv 0 1 1 2\nfrobnicate 1\ncall other.obj\n";
    write(directory.path(), "more.obj", &more);
    let (code, found) = document(directory.path(), &["form-factors", "more.obj"]);
    assert_eq!((code, &found["surface_form_factor"]), (0, &right));
    let mut expected = String::new();
    for (line, count, what) in [
        (0, 3, "lines or points"),
        (5, 2, "free-form curves or surfaces"),
        (10, 1, "calls of other files or programs"),
        (9, 1, "unknown keywords"),
    ] {
        let line = first + line;
        let statements = if count == 1 { "statement" } else { "statements" };
        writeln!(expected, "more.obj:{line}: {count} {statements} skipped, of which this is the first: {what} are not read; export them as faces (`f`)").unwrap();
    }
    assert_eq!(warnings(&found).join("\n") + "\n", expected);
}
