//! Files for other programs: View3D's text, meshes with colours, VTK without strings, exitances of patches; completions and manual pages.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use crate::{document, numbers, radiosity, stderr, with_scene};

#[track_caller]
fn run(directory: &Path, line: &str) -> Value {
    let (code, result) = document(directory, &line.split(' ').collect::<Vec<_>>());
    assert_eq!(code, 0, "{line}: {result}");
    result
}

fn text(directory: &Path, name: &str) -> String {
    std::fs::read_to_string(directory.join(name)).unwrap()
}

#[test]
fn view3d_files_have_its_layout() {
    for (scene, encl) in [("cube", 1), ("corridor", 0)] {
        let directory = with_scene(scene);
        let found = run(directory.path(), "form-factors scene.obj --subdivide 2 -o F.vf");
        let file = text(directory.path(), "F.vf");
        let lines: Vec<&str> = file.lines().collect();
        let n = found["n_surfaces"].as_u64().unwrap();
        assert_eq!(lines.len() as u64, n + 3);
        assert_eq!(lines[0].len(), 30, "a head of fixed width");
        let head: Vec<&str> = lines[0].split_whitespace().collect();
        let expected = format!("View3D 3.3 0 {encl} 0 {n}");
        assert_eq!(head.join(" "), expected, "{scene}");
        let numbers_of = |line: &str| -> Vec<f64> { line.split(' ').map(|word| word.parse().unwrap()).collect() };
        let areas = numbers_of(lines[1]);
        for (area, surface) in areas.iter().zip(found["surfaces"].as_array().unwrap()) {
            let known = surface["area_m2"].as_f64().unwrap();
            assert!((area - known).abs() <= 5e-6 * known, "{area} {known}");
        }
        for (line, row) in lines[2..].iter().zip(found["surface_form_factor"].as_array().unwrap()) {
            assert!(
                line.split(' ')
                    .all(|word| word.split_once('.').is_some_and(|(_, places)| places.len() == 6))
            );
            for (value, known) in numbers_of(line).iter().zip(numbers(row)) {
                assert!((value - known).abs() <= 0.5e-6 + 1e-12, "{value} {known}");
            }
        }
        let last = lines.last().unwrap();
        assert!(last.split(' ').all(|word| word.len() == 5), "{last}");
        assert_eq!(numbers_of(last).len() as u64, n);
    }
}

/// A vertex has the mean of the patches around it, and white is the greatest of them; even light is white everywhere.
#[test]
fn meshes_have_the_colours_of_a_quantity() {
    let directory = with_scene("cube");
    let materials = directory.path().join("bright.toml");
    std::fs::write(&materials, "[surface.\"*\"]\nreflectance = 0.5\nexitance = 1.0\n").unwrap();
    for line in [
        "solve scene.obj --subdivide 2 --materials bright.toml -o even",
        "form-factors scene.obj --subdivide 2 --surface z0 -o F",
    ] {
        for ending in ["ply", "obj"] {
            run(directory.path(), &format!("{line}.{ending}"));
        }
    }
    let ply = text(directory.path(), "even.ply");
    let (head, body) = ply.split_once("end_header\n").unwrap();
    assert!(
        head.contains("comment radiosity in W/m2; colours are sRGB, white is 2.0"),
        "{head}"
    );
    let count = |element: &str| -> usize {
        let line = head.lines().find_map(|line| line.strip_prefix(element)).unwrap();
        line.trim().parse().unwrap()
    };
    let (n_vertices, n_faces) = (count("element vertex"), count("element face"));
    assert_eq!((n_faces, body.lines().count()), (24, n_vertices + n_faces));
    for line in body.lines().take(n_vertices) {
        let words: Vec<&str> = line.split(' ').collect();
        assert_eq!(words[3..6], ["255", "255", "255"], "{line}");
        assert!((words[6].parse::<f64>().unwrap() - 2.0).abs() < 1e-5);
    }
    let obj = text(directory.path(), "even.obj");
    assert_eq!(obj.lines().filter(|line| line.starts_with("v ")).count(), n_vertices);
    assert_eq!(obj.lines().filter(|line| line.starts_with("f ")).count(), n_faces);
    assert!(
        obj.lines()
            .filter(|line| line.starts_with("v "))
            .all(|line| line.ends_with(" 1.000000 1.000000 1.000000"))
    );
    // The mesh is a scene again, with the same surfaces.
    for name in ["even.obj", "even.ply", "F.obj", "F.ply"] {
        let again = run(directory.path(), &format!("form-factors {name}"));
        assert_eq!(
            (again["n_patches"].as_u64(), again["n_surfaces"].as_u64()),
            (Some(24), Some(6)),
            "{name}"
        );
    }
    // No patch of z0 sees z0, and all others do.
    let ply = text(directory.path(), "F.ply");
    let (head, body) = ply.split_once("end_header\n").unwrap();
    assert!(head.contains("property double form_factor_to_z0"), "{head}");
    let n_dark = body
        .lines()
        .take(n_vertices)
        .filter(|line| line.ends_with(" 0 0 0 0.0"))
        .count();
    assert_eq!(n_dark, n_vertices / 6);
    let (code, refused) = document(
        directory.path(),
        &["form-factors", "scene.obj", "--surface", "z0", "-o", "F.csv"],
    );
    assert_eq!((code, refused["error"]["kind"].as_str()), (2, Some("usage")));
}

/// Texts stand as numbers of their bytes: readers that know no arrays of strings read the file.
#[test]
fn vtk_files_hold_no_strings() {
    let directory = with_scene("corridor");
    run(directory.path(), "form-factors scene.obj --subdivide 2 -o F.vtu");
    run(directory.path(), "solve scene.obj --subdivide 2 -o B.vtu");
    run(directory.path(), "voxel scene.obj --voxels 8 --radius 2 -o V.vtu");
    for name in ["F.vtu", "B.vtu", "V.vtu"] {
        let file = text(directory.path(), name);
        assert!(!file.contains("type=\"String\""), "{name}");
        let array = |name: &str| {
            let (_, rest) = file.split_once(&format!("Name=\"{name}\" NumberOfTuples=\"")).unwrap();
            let (count, rest) = rest.split_once('"').unwrap();
            let (_, rest) = rest.split_once('>').unwrap();
            let (numbers, _) = rest.split_once('<').unwrap();
            let bytes: Vec<u8> = numbers.split_whitespace().map(|byte| byte.parse().unwrap()).collect();
            assert_eq!(bytes.len(), count.parse::<usize>().unwrap(), "{name}");
            String::from_utf8(bytes).unwrap()
        };
        let names: Vec<String> = array("surface_name")
            .split_terminator('\0')
            .map(str::to_owned)
            .collect();
        assert_eq!(names, ["A", "B", "partition", "partition_back"], "{name}");
        let description = array("description");
        let parsed: Value = serde_json::from_str(description.trim_end_matches('\0')).unwrap();
        assert!(parsed["format"].as_str().unwrap().starts_with("radiosity"), "{name}");
    }
    // VTK_HEXAHEDRON, which all readers know.
    let voxels = text(directory.path(), "V.vtu");
    let (_, types) = voxels.split_once("Name=\"types\"").unwrap();
    let (types, _) = types.split_once('>').unwrap().1.split_once('<').unwrap();
    assert!(types.split_whitespace().count() > 0 && types.split_whitespace().all(|kind| kind == "12"));
    for name in ["F.vtu", "B.vtu"] {
        assert!(text(directory.path(), name).contains("Name=\"sky_factor\""), "{name}");
    }
}

/// Writes an array of f64 as NumPy does.
fn write_array(path: &Path, shape: &str, values: &[f64]) {
    let mut head = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}");
    while !(head.len() + 11).is_multiple_of(64) {
        head.push(' ');
    }
    head.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(head.len()).unwrap().to_le_bytes());
    bytes.extend(head.bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    std::fs::write(path, bytes).unwrap();
}

/// Lightings of patches by themselves and all together differ by what the tolerance leaves.
#[test]
fn exitances_of_patches_are_solved_together() {
    let directory = with_scene("cube");
    let at = directory.path();
    let (n, k) = (24, 3);
    let light = |patch: usize, lighting: usize| ((7 * patch + 5 * lighting) % 11) as f64;
    let all: Vec<f64> = (0..n).flat_map(|i| (0..k).map(move |c| light(i, c))).collect();
    write_array(&at.join("all.npy"), "(24, 3)", &all);
    let solve = |name: &str| {
        let line = format!("solve scene.obj --subdivide 2 --tolerance 1e-12 --exitance {name}.npy -o {name}.csv");
        let found = run(at, &line);
        let means = found["surfaces"]
            .as_array()
            .unwrap()
            .iter()
            .map(|surface| numbers(&surface["radiosity"]));
        (means.collect::<Vec<_>>(), text(at, &format!("{name}.csv")))
    };
    let (together, table) = solve("all");
    assert!(table.contains("radiosity_R,radiosity_G,radiosity_B"));
    for lighting in 0..k {
        let own: Vec<f64> = (0..n).map(|i| light(i, lighting)).collect();
        write_array(&at.join("one.npy"), "(24, 1)", &own);
        let (alone, table) = solve("one");
        assert!(table.contains("radiosity_grey"));
        for (a, b) in together.iter().zip(&alone) {
            assert!((a[lighting] - b[0]).abs() <= 1e-10 * b[0], "{a:?} {b:?}");
        }
        write_array(&at.join("flat.npy"), "(24,)", &own);
        assert_eq!(solve("flat").0, alone);
    }
    let two: Vec<f64> = all.iter().chain(&all).copied().collect();
    write_array(&at.join("coloured.npy"), "(24, 2, 3)", &two);
    let (coloured, table) = solve("coloured");
    assert_eq!(coloured[0].len(), 6);
    assert!(table.contains("radiosity_0,radiosity_1,radiosity_2,radiosity_3,radiosity_4,radiosity_5,"));
}

#[test]
fn wrong_exitances_are_refused_in_one_line() {
    let directory = with_scene("cube");
    let at = directory.path();
    for (shape, values, reason) in [
        ("(5, 1)", vec![1.0; 5], "its shape is [5, 1]; expected (6, k)"),
        ("(6, 2, 2)", vec![1.0; 24], "its shape is [6, 2, 2]"),
        ("(6, 0)", vec![], "its shape is [6, 0]"),
        ("(6, 1)", vec![1.0; 5], "in 40 bytes"),
        (
            "(6, 1)",
            vec![1.0, 1.0, -1.0, 1.0, 1.0, 1.0],
            "-1.0 of patch 2 is neither 0 nor from",
        ),
        ("(6, 1)", vec![1e301; 6], "1e301 of patch 0 is neither 0 nor from"),
        ("(6, 1)", vec![f64::NAN; 6], "NaN of patch 0"),
    ] {
        write_array(&at.join("E.npy"), shape, &values);
        let output = radiosity(at, &["solve", "scene.obj", "--exitance", "E.npy"]);
        let told = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{told}");
        assert!(
            told.starts_with("radiosity: E.npy: ") && told.contains(reason),
            "{shape}: {told}"
        );
        assert_eq!(told.trim_end().lines().count(), 1, "{told}");
    }
    std::fs::write(at.join("E.npy"), "no array").unwrap();
    let (code, refused) = document(at, &["solve", "scene.obj", "--exitance", "E.npy"]);
    assert_eq!((code, refused["error"]["kind"].as_str()), (1, Some("bad_array")));
    let (code, _) = document(
        at,
        &["solve", "scene.obj", "--exitance", "E.npy", "--lighting", "E.npy"],
    );
    assert_eq!(code, 2);
}

#[test]
fn shells_complete_every_command() {
    let directory = with_scene("cube");
    for shell in ["bash", "zsh", "fish"] {
        let output = radiosity(directory.path(), &["completions", shell]);
        assert!(output.status.success());
        let script = String::from_utf8(output.stdout).unwrap();
        for word in ["form-factors", "exchange-factors", "exitance", "gauss-seidel"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert_eq!(
        radiosity(directory.path(), &["completions", "dos"]).status.code(),
        Some(2)
    );
}

#[test]
fn every_command_has_a_manual_page() {
    let directory = with_scene("cube");
    let output = radiosity(directory.path(), &["man", "pages/man1"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let help = radiosity(directory.path(), &["--help"]);
    let help = String::from_utf8(help.stdout).unwrap();
    let (_, listed) = help.split_once("Commands:").unwrap();
    let names = listed.lines().skip(1).take_while(|line| line.starts_with("  "));
    let names = names.filter_map(|line| {
        line.strip_prefix("  ")?
            .split_whitespace()
            .next()
            .filter(|_| !line.starts_with("   "))
    });
    let mut expected = String::from("radiosity.1\n");
    for name in names.filter(|name| *name != "help") {
        writeln!(expected, "radiosity-{name}.1").unwrap();
        let page = text(directory.path(), &format!("pages/man1/radiosity-{name}.1"));
        assert!(page.contains(".SH SYNOPSIS") && page.contains("OPTIONS"), "{name}");
    }
    assert!(expected.lines().count() > 12, "{expected}");
    assert!(text(directory.path(), "pages/man1/radiosity.1").contains("form\\-factors"));
}
