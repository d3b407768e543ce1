//! `radiosity voxel` as its users meet it.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use crate::program::{command, limited, names, radiosity, with_scene};

/// Runs `voxel scene.obj` with `--json` and returns the exit code and the document.
fn document(directory: &Path, arguments: &[&str]) -> (i32, Value) {
    crate::program::document(directory, &[&["voxel", "scene.obj"], arguments].concat())
}

fn without_times(mut document: Value) -> Value {
    for varying in ["stages", "total_s", "memory_peak_bytes", "link_bytes"] {
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
        ["n_voxels", "n_surfels", "n_links", "link_bytes"].map(|name| result[name].as_u64().unwrap());
    assert!(n_voxels <= n_surfels && n_links > 100 * n_surfels && link_byte < 3 * n_links);
    assert_eq!(
        (&result["n_escaped"], &result["n_leaks"]),
        (&Value::from(0), &Value::from(0))
    );
    // Half a diagonal of a voxel, and in corners up to 1.5.
    let hausdorff = result["hausdorff_distance_voxel"].as_f64().unwrap();
    assert!((0.5..=1.5 + 1e-9).contains(&hausdorff), "{hausdorff}");
    assert_eq!(result["n_directions"], 354);
    assert!(result["octree_bytes"].as_u64().unwrap() > 0);
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
    assert!(
        recomputed["n_backs"].is_null() && recomputed["n_escaped"].is_null(),
        "never counted: {recomputed}"
    );
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
fn light_that_is_still_under_way_is_told() {
    let directory = with_scene("room-box");
    let warns = |passes: &str| {
        let output = radiosity(
            directory.path(),
            &[
                "voxel",
                "scene.obj",
                "--voxels",
                "21",
                "--radius",
                "6",
                "--passes",
                passes,
            ],
        );
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr)
            .unwrap()
            .contains("unshot light is left")
    };
    // Each propagation adds about half of what the one before did.
    assert_eq!(["1", "2", "12"].map(warns), [true, true, false]);
}

#[test]
fn auto_says_what_it_took() {
    let directory = with_scene("room-box");
    let arguments = ["--voxels", "12", "--radius", "3", "--solver", "auto", "--explain"];
    let (code, result) = document(directory.path(), &arguments);
    assert_eq!((code, &result["settings"]["solver"]), (0, &"auto".into()));
    let solver = result["solver"].as_str().unwrap();
    assert!(
        solver != "auto" && result["why"].as_str().unwrap().len() > 20,
        "{result}"
    );
    let text = radiosity(directory.path(), &[&["voxel", "scene.obj"], &arguments[..]].concat()).stdout;
    let text = String::from_utf8(text).unwrap();
    assert!(text.contains(&format!("\nsolver: {solver} (")), "{text}");
    assert!(
        text.contains(&format!("\n{solver}: converged after ")) && text.contains("error bound"),
        "{text}"
    );
}

/// Who names a file for links gets one, or is told why not.
#[test]
fn a_link_file_is_no_idle_wish() {
    let directory = with_scene("cube");
    let size = [
        "voxel",
        "scene.obj",
        "--voxels",
        "8",
        "--radius",
        "2",
        "--link-file",
        "own.links",
    ];
    for links in ["memory", "recompute"] {
        let output = radiosity(directory.path(), &[&size[..], &["--links", links]].concat());
        assert_eq!(output.status.code(), Some(2), "{links}");
        let told = crate::program::stderr(&output);
        assert!(told.contains("--link-file") && told.contains("--links disk"), "{told}");
        assert!(!directory.path().join("own.links").exists());
    }
    assert!(radiosity(directory.path(), &size).status.success());
    assert!(directory.path().join("own.links").exists());
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
fn patches_that_nothing_needs_are_left_out_and_said_to_be() {
    let directory = with_scene("cube");
    let run = |more: &[&str]| {
        let size = ["--voxels", "8", "--radius", "3", "--passes", "1"];
        let (code, result) = document(directory.path(), &[&size[..], more].concat());
        assert_eq!(code, 0, "{more:?}");
        result["left_out"].to_string().contains("cutting faces into patches")
    };
    for flags in [&["--subdivide", "2"][..], &["--max-edge", "0.5"], &["--no-cut"]] {
        assert!(run(flags), "{flags:?}");
        assert!(run(&[flags, &["-o", "b.vtu"]].concat()), "{flags:?}");
        assert!(
            !run(&[flags, &["-o", "a.exr", "--width", "8", "--height", "8"]].concat()),
            "{flags:?}"
        );
    }
    assert!(!run(&[]));
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

/// The lamp is 2 m wide, a voxel 0.3 m: as many whole voxels as it takes shine too little.
#[test]
fn small_lamps_send_their_own_power() {
    // `radiosity solve` with exact form factors to 1e-4: the mean over the floor, W/m².
    const FLOOR: f64 = 2.758;
    let directory = with_scene("sphere-room-r1");
    let error = |more: &[&str]| {
        let size = ["--voxels", "20", "--radius", "15", "--passes", "30"];
        let (code, result) = document(directory.path(), &[&size, more].concat());
        assert_eq!(code, 0);
        let surfaces = result["surfaces"].as_array().unwrap();
        let floor = surfaces.iter().find(|s| s["name"] == "z0").unwrap();
        floor["radiosity"][0].as_f64().unwrap() / FLOOR - 1.0
    };
    let (scaled, plain) = (error(&[]), error(&["--plain-emission"]));
    // Of first order in the voxel's side: a thirtieth is what other surfaces have at 20 voxels too.
    assert!(scaled.abs() < 0.035 && plain < -0.1, "{scaled} {plain}");
}

#[test]
fn cells_are_counted_and_told() {
    let directory = with_scene("cornell-box");
    let size = ["--voxels", "40", "--radius", "6", "--passes", "8"];
    let with = |more: &[&str]| document(directory.path(), &[&size[..], more].concat()).1;
    let (voxels, cells) = (with(&[]), with(&["--adaptive", "1"]));
    let n_cells = cells["n_cells"].as_u64().unwrap();
    assert!(2 * n_cells < voxels["n_surfels"].as_u64().unwrap(), "{n_cells}");
    let by_level: u64 = cells["n_cells_by_level"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_u64().unwrap())
        .sum();
    assert_eq!(by_level, n_cells);
    assert!(cells["n_links"].as_u64() < voxels["n_links"].as_u64());
    let area = |document: &Value| document["surfaces"][0]["area_m2"].as_f64().unwrap();
    assert_eq!(area(&cells).to_bits(), area(&voxels).to_bits());
    let output = radiosity(
        directory.path(),
        &["voxel", "scene.obj", "--adaptive", "0.1", "--links", "disk"],
    );
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn walls_that_are_too_near_are_named() {
    let directory = tempfile::tempdir().unwrap();
    let plate = |z: f64| format!("v 0 0 {z}\nv 1 0 {z}\nv 1 1 {z}\nv 0 1 {z}\n");
    let obj = format!(
        "mtllib m.mtl\nusemtl m\n{}{}o low\nf 1 2 3 4\no high\nf 8 7 6 5\n",
        plate(0.0),
        plate(0.1)
    );
    std::fs::write(directory.path().join("m.mtl"), "newmtl m\nKd 0.5 0.5 0.5\nKe 1 1 1\n").unwrap();
    std::fs::write(directory.path().join("scene.obj"), obj).unwrap();
    let output = radiosity(
        directory.path(),
        &["voxel", "scene.obj", "--voxels", "11", "--radius", "4"],
    );
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{message}");
    assert!(
        message.contains("low and high") && message.contains("--voxels"),
        "{message}"
    );
    let (_, told) = document(directory.path(), &["--voxels", "11", "--radius", "4", "--quiet"]);
    assert_eq!(told["thin_gaps"][0]["surfaces"], serde_json::json!(["low", "high"]));
}

/// By voxels and by cells, from memory and from the disk: no light in a sealed room whose walls are sheets or thinner than a voxel.
/// A plate and its shadow, far from a lamp: the lamp makes voxels as large as it is far off.
#[test]
fn what_is_smaller_than_a_voxel_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let scene = |far: f64| {
        let mut text = String::from("mtllib m.mtl\n");
        for (name, material, z, down) in [
            ("floor", "grey", 0.0, false),
            ("plate", "grey", 0.5, true),
            ("lamp", "lamp", far, true),
        ] {
            for (x, y) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let side = if name == "lamp" { far } else { 1.0 };
                writeln!(text, "v {} {} {z}", x * side, y * side).unwrap();
            }
            let outline = if down { "-1 -2 -3 -4" } else { "-4 -3 -2 -1" };
            writeln!(text, "o {name}\nusemtl {material}\nf {outline}").unwrap();
        }
        std::fs::write(directory.path().join("scene.obj"), text).unwrap();
        let materials = "newmtl grey\nKd 0.5 0.5 0.5\nnewmtl lamp\nKd 0 0 0\nKe 1 1 1\n";
        std::fs::write(directory.path().join("m.mtl"), materials).unwrap();
        document(directory.path(), &["--voxels", "40", "--radius", "6"]).1
    };
    let warned = |result: &Value| {
        let warnings = result["warnings"].as_array().unwrap();
        warnings
            .iter()
            .filter(|w| w.as_str().unwrap().contains("smaller than two voxels"))
            .count()
    };
    let near = scene(4.0);
    assert_eq!((&near["n_small_surfaces"], warned(&near)), (&Value::from(0), 0));
    for far in [1e2, 1e4, 1e7] {
        let result = scene(far);
        assert_eq!(
            (&result["n_small_surfaces"], warned(&result)),
            (&Value::from(2), 1),
            "{far}"
        );
    }
}

#[test]
fn a_sealed_room_stays_dark() {
    use crate::sealed_room::SealedRoom;
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("m.mtl"), SealedRoom::mtl()).unwrap();
    for (thickness, on_floor) in [(0.0, false), (0.05, true)] {
        let room = SealedRoom {
            thickness,
            on_floor,
            turned: glam::DMat3::from_rotation_z(if on_floor { 0.3 } else { 0.0 }),
            ..SealedRoom::default()
        };
        std::fs::write(directory.path().join("scene.obj"), room.obj()).unwrap();
        let size = ["--voxels", "30", "--radius", "5"];
        for more in [
            &["--passes", "8"][..],
            &["--solver", "gmres"],
            &["--passes", "8", "--links", "recompute"],
            &["--passes", "8", "--adaptive", "0.2"],
        ] {
            let (code, result) = document(directory.path(), &[&size[..], more].concat());
            assert_eq!(code, 0, "{more:?}");
            let of = |name: &str| {
                let mut surfaces = result["surfaces"].as_array().unwrap().iter();
                surfaces.find(|s| s["name"] == name).unwrap()["radiosity"][0]
                    .as_f64()
                    .unwrap()
            };
            // A solver leaves its tolerance of 1e-6 of the light everywhere; passes leave nothing.
            let most = if more.contains(&"--solver") { 1e-6 } else { 0.0 };
            assert!((0.0..=most).contains(&of("shell_in")), "{more:?}: {:e}", of("shell_in"));
            assert!(of("shell_out") > 1.0 && of("outer") > 1.0, "{more:?}");
            assert_eq!(
                (&result["n_thin_walls"], &result["leak_power_w"]),
                (&1.into(), &0.0.into())
            );
            assert!((result["thin_wall_min_m"].as_f64().unwrap() - thickness).abs() < 1e-9);
            assert_eq!(
                result["thin_walls"][0]["surfaces"],
                serde_json::json!(["shell_out", "shell_in"])
            );
            let checks = result["audit"]["checks"].as_array().unwrap();
            assert!(
                checks
                    .iter()
                    .any(|check| check["law"] == "sides" && check["passed"] == true)
            );
        }
    }
}

/// A limit on the size of files stands for a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_no_links_behind() {
    let directory = with_scene("room-box");
    let with_room = |kilobytes: u32| {
        // Without the signal, a write beyond the limit fails as one on a full disk does.
        let arguments = [
            "voxel",
            "scene.obj",
            "--voxels",
            "31",
            "--radius",
            "6",
            "--links",
            "disk",
            "--passes",
            "2",
        ];
        limited(
            directory.path(),
            &format!("trap '' XFSZ; ulimit -f {kilobytes}; exec"),
            &arguments,
        )
        .output()
        .unwrap()
    };
    let output = with_room(64);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(
        message.contains("scene.links") && message.lines().count() == 1,
        "{message}"
    );
    let names = || names(directory.path());
    assert!(names().iter().all(|name| !name.contains("links")), "{:?}", names());
    // With room, the same command leaves the links, and nothing else.
    assert_eq!(with_room(1 << 20).status.code(), Some(0));
    assert!(names().contains(&"scene.links".to_owned()) && !names().contains(&"scene.links.part".to_owned()));
}

#[test]
fn a_killed_run_is_taken_up_again() {
    let directory = with_scene("room-box");
    let arguments = [
        "voxel",
        "scene.obj",
        "--voxels",
        "120",
        "--radius",
        "4",
        "--links",
        "disk",
        "--passes",
        "1",
    ];
    assert_eq!(radiosity(directory.path(), &arguments).status.code(), Some(0));
    let links = directory.path().join("scene.links");
    let whole = std::fs::read(&links).unwrap();
    std::fs::remove_file(&links).unwrap();
    let mut child = command(directory.path(), &arguments)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap();
    let part = directory.path().join("scene.links.part");
    // As soon as there are records; a run that is done before is no harm.
    while child.try_wait().unwrap().is_none() && std::fs::metadata(&part).map_or(0, |m| m.len()) < 100 {
        std::thread::yield_now();
    }
    let _ = child.kill();
    child.wait().unwrap();
    assert!(part.exists() || links.exists());
    assert_eq!(radiosity(directory.path(), &arguments).status.code(), Some(0));
    assert!(std::fs::read(&links).unwrap() == whole && !part.exists());
}
