//! `radiosity voxel` as its users meet it.
#![expect(
    clippy::shadow_unrelated,
    reason = "each run of a test has its own output, code and result"
)]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn radiosity(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_radiosity"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap()
}

/// Runs `voxel scene.obj` with `--json` and returns the exit code and the document.
fn document(directory: &Path, arguments: &[&str]) -> (i32, Value) {
    let output = radiosity(directory, &[&["voxel", "scene.obj", "--json"], arguments].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    (output.status.code().unwrap(), value)
}

fn with_scene(name: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    let output = radiosity(directory.path(), &["scene", name, "-o", "scene.obj"]);
    assert!(output.status.success());
    directory
}

fn without_times(mut document: Value) -> Value {
    for varying in ["stages", "total_s", "memory_peak_byte", "link_byte"] {
        document.as_object_mut().unwrap().remove(varying);
    }
    document
}

#[test]
fn the_document_says_what_was_done() {
    let directory = with_scene("room-box");
    let size = ["--voxels", "21", "--radius", "6", "--passes", "12"];
    let (code, result) = document(directory.path(), &size);
    assert_eq!(code, 0);
    assert_eq!(result["lattice"], serde_json::json!([17, 21, 13]));
    let [n_voxels, n_surfels, n_links, link_byte] =
        ["n_voxels", "n_surfels", "n_links", "link_byte"].map(|name| result[name].as_u64().unwrap());
    assert!(n_voxels <= n_surfels && n_links > 100 * n_surfels && link_byte < 3 * n_links);
    assert_eq!(
        (&result["n_escaped"], &result["n_leaks"]),
        (&Value::from(0), &Value::from(0))
    );
    assert_eq!(result["n_directions"], 354);
    assert!(result["octree_byte"].as_u64().unwrap() > 0);
    let surfaces = result["surfaces"].as_array().unwrap();
    assert_eq!(surfaces.len(), 12);
    assert_eq!(surfaces[5]["name"], "room_z1");
    // Areas are those of the faces, whatever the voxels; a sum of some hundred terms.
    assert!((surfaces[5]["area_m2"].as_f64().unwrap() - 20.0).abs() < 1e-10);
    let bright = surfaces[5]["radiosity"][0].as_f64().unwrap();
    assert!((1.0..1.3).contains(&bright), "{bright}");

    // The same on disk, again from the same file, without links, and by a solver.
    let with = |more: &[&str]| document(directory.path(), &[&size[..], more].concat());
    let (_, first) = with(&["--links", "disk"]);
    let (_, again) = with(&["--links", "disk"]);
    assert_eq!(first["surfaces"], result["surfaces"]);
    assert_eq!(without_times(first), without_times(again));
    assert!(directory.path().join("scene.links").exists());
    let (_, recomputed) = with(&["--links", "recompute"]);
    assert_eq!(recomputed["surfaces"], result["surfaces"]);
    let (code, solved) = document(
        directory.path(),
        &[
            "--voxels",
            "21",
            "--radius",
            "6",
            "--solver",
            "gauss-seidel",
            "--tolerance",
            "1e-9",
        ],
    );
    assert_eq!((code, &solved["stop_reason"]), (0, &Value::from("converged")));
    let by_solver = solved["surfaces"][5]["radiosity"][0].as_f64().unwrap();
    // Twelve passes at a reflectance of 0.5 leave less than 2⁻¹² of the light.
    assert!((by_solver - bright).abs() < 3e-4, "{by_solver} {bright}");
}

#[test]
fn pictures_and_grids_are_written() {
    let directory = with_scene("cornell-box");
    for (file, flags) in [("a.exr", vec![]), ("b.exr", vec!["--show-voxels"]), ("c.vtu", vec![])] {
        let size = ["--voxels", "24", "--radius", "5", "--passes", "4", "-o", file];
        let picture = if file.ends_with("exr") {
            vec!["--width", "40"]
        } else {
            vec![]
        };
        let (code, _) = document(directory.path(), &[&size[..], &flags, &picture].concat());
        assert_eq!(code, 0, "{file}");
        let bytes = std::fs::read(directory.path().join(file)).unwrap();
        if file.ends_with("vtu") {
            let text = String::from_utf8(bytes).unwrap();
            assert!(text.contains("Name=\"irradiance\"") && text.ends_with("</VTKFile>\n"));
            continue;
        }
        let image = exr::prelude::read_first_rgba_layer_from_file(
            directory.path().join(file),
            |size, _| vec![[0.0_f32; 3]; size.area()],
            |pixels, position, (r, g, b, _): (f32, f32, f32, f32)| pixels[position.y() * 40 + position.x()] = [r, g, b],
        )
        .unwrap();
        let pixels = image.layer_data.channel_data.pixels;
        assert_eq!(pixels.len(), 1600);
        // The box fills the picture but for a rim: red on its left half, green on its right, as seen from the front.
        let sum = |columns: std::ops::Range<usize>, c: usize| -> f32 {
            (10..30)
                .flat_map(|y| columns.clone().map(move |x| (x, y)))
                .map(|(x, y)| pixels[y * 40 + x][c])
                .sum()
        };
        assert!(sum(2..7, 0) > 2.0 * sum(2..7, 1), "{file}: the red wall");
        assert!(sum(33..38, 1) > 1.2 * sum(33..38, 0), "{file}: the green wall");
    }
}

#[test]
fn what_makes_no_sense_is_refused_in_one_line() {
    let directory = with_scene("cube");
    for (arguments, code, part) in [
        (vec!["--voxels", "3"], 2, "give 4 to 4096"),
        (vec!["--radius", "0"], 2, "give 1 to 255"),
        (vec!["-o", "B.csv"], 2, ".exr, .vtu"),
        (vec!["--show-voxels"], 2, "-o IMAGE.exr"),
        (vec!["-o", "a.exr", "--direct", "rays"], 2, "radiosity render"),
        (
            vec!["--links", "disk", "--link-file", "no/such/file"],
            1,
            "no/such/file",
        ),
        (
            vec!["--links", "disk", "--link-file", "scene.obj"],
            1,
            "name another file",
        ),
    ] {
        let small: &[&str] = if arguments.contains(&"--voxels") {
            &[]
        } else {
            &["--voxels", "8"]
        };
        let radius: &[&str] = if arguments.contains(&"--radius") {
            &[]
        } else {
            &["--radius", "3"]
        };
        let output = radiosity(
            directory.path(),
            &[&["voxel", "scene.obj"], small, radius, &arguments[..]].concat(),
        );
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
        assert!(
            message.contains(part) && message.lines().count() == 1,
            "{arguments:?}: {message}"
        );
    }
}
