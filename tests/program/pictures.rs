//! Pictures, fields and sequences.

use radiosity::render::{Image, Samples, ViewDescription, exr};

use crate::program::succeed;
use crate::{document, numbers, radiosity, stderr, with_scene};

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

/// A room whose faces all see outwards: the picture is black, and a check of it shows nothing.
#[test]
fn a_picture_of_backs_is_doubted_and_proves_nothing() {
    let directory = with_scene("room-box");
    let obj = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    let reversed: Vec<String> = obj
        .lines()
        .map(|line| match line.strip_prefix("f ") {
            Some(corners) => format!("f {}", corners.split(' ').rev().collect::<Vec<_>>().join(" ")),
            None => line.to_owned(),
        })
        .collect();
    std::fs::write(directory.path().join("scene.obj"), reversed.join("\n")).unwrap();
    let flags = ["--subdivide", "1", "--width", "16", "--up", "0,0,1"];
    for (eye, at, backs) in [("0.5,0.5,0.5", "0.2,0.2,1", true), ("9,9,9", "10,10,10", false)] {
        let arguments = ["render", "scene.obj", "-o", "r.exr", "--eye", eye, "--look-at", at];
        let (code, result) = document(directory.path(), &[&arguments[..], &flags].concat());
        assert_eq!(code, 0, "{result}");
        let warnings: Vec<&str> = result["warnings"]
            .as_array()
            .unwrap()
            .iter()
            .map(|w| w.as_str().unwrap())
            .collect();
        assert_eq!(warnings.len(), 2, "{warnings:?}");
        assert!(
            warnings[0].contains("no face that emits light sees another"),
            "{warnings:?}"
        );
        assert!(
            warnings[1].contains("no pixel shows the front of a face"),
            "{warnings:?}"
        );
        let (code, result) = document(directory.path(), &["verify", "r.exr"]);
        assert_eq!((code, &result["passed"]), (4, &false.into()), "{result}");
        let counts = ["n_pixels", "n_checked", "n_backs", "n_background"].map(|name| result[name].as_u64().unwrap());
        assert_eq!(counts, if backs { [0, 0, 256, 0] } else { [0, 0, 0, 256] });
        let output = radiosity(directory.path(), &["verify", "r.exr"]);
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(text.contains("no pixel could be compared"), "{text}");
    }
    // From outside, the room's fronts are there to be seen.
    let arguments = [
        "render",
        "scene.obj",
        "-o",
        "o.exr",
        "--eye",
        "9,9,9",
        "--look-at",
        "0,0,0",
    ];
    let (_, result) = document(directory.path(), &[&arguments[..], &flags].concat());
    assert_eq!(result["warnings"].as_array().unwrap().len(), 1, "{result}");
}

/// A camera found beside a scene is named, stands upright wherever it is turned, and is left by other scenes of the folder.
#[test]
fn a_camera_beside_the_scene_is_told_kept_and_turned_upright() {
    let directory = with_scene("room-box");
    let camera = directory.path().join("camera.toml");
    let text = "eye = [2.0, 0.2, 2.8]\nlook_at = [2.0, 2.5, 0.0]\nup = [0.0, 0.0, 1.0]\nvertical_fov_degree = 60.0\nwidth = 8\nheight = 6\n";
    std::fs::write(&camera, text).unwrap();
    let output = succeed(directory.path(), &["scene", "cornell-box", "-o", "other.obj"]);
    let told = String::from_utf8(output).unwrap();
    assert!(told.contains("camera.toml is there already and was left"), "{told}");
    assert_eq!(std::fs::read_to_string(&camera).unwrap(), text);

    let common = ["--surface", "room_z1", "-o", "f.exr", "--max-edge", "2"];
    let field = |more: &[&'static str]| [&["field", "scene.obj"][..], &common, more].concat();
    let told = String::from_utf8(succeed(directory.path(), &field(&[]))).unwrap();
    assert!(told.contains("camera: camera.toml\n"), "{told}");
    let turned = ["--eye", "0.2,2.5,1.5", "--look-at", "3.8,2.5,1.5", "--height", "3"];
    let (code, result) = document(directory.path(), &field(&turned));
    assert_eq!((code, &result["width"], &result["height"]), (0, &4.into(), &3.into()));
    let told = result["settings"]["camera"].as_str().unwrap();
    assert!(told.starts_with("camera.toml, changed by"), "{told}");
    let (_, attributes) = exr::read(&directory.path().join("f.exr")).unwrap();
    let ViewDescription::Perspective(record) = attributes.view else {
        panic!("a perspective view");
    };
    assert_eq!(numbers(&record["up"]), [0.0, 0.0, 1.0]);
    // A picture names no file of the machine.
    assert!(attributes.solution.get("camera").is_none());

    // Straight down there is no vertical near the camera's own up.
    let down = ["--eye", "2,2.5,2.8", "--look-at", "2,2.5,0"];
    let (code, result) = document(directory.path(), &field(&down));
    let told = result["settings"]["camera"].as_str().unwrap();
    assert!(code == 0 && told.contains("up in the image is [0, 1, 0]"), "{told}");
    let output = radiosity(directory.path(), &[&field(&down)[..], &["--up", "0,0,-3"]].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("--up is zero or parallel"),
        "{}",
        stderr(&output)
    );
    // A side that follows from the camera's proportion has the limits of all sides.
    std::fs::write(&camera, text.replace("width = 8", "width = 1")).unwrap();
    let output = radiosity(directory.path(), &field(&["--width", "3000"]));
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("3000 × 18000"), "{}", stderr(&output));
    std::fs::write(&camera, text).unwrap();

    let away = ["--eye", "99,99,99", "--look-at", "199,99,99"];
    let (_, blank) = document(directory.path(), &field(&away));
    let warnings = blank["warnings"].to_string();
    assert!(
        warnings.contains("no pixel shows the front") && warnings.contains("camera.toml"),
        "{warnings}"
    );
}

#[test]
fn an_unfolded_view_says_what_it_does_not_show() {
    let directory = with_scene("sphere-room-r1");
    let arguments = [
        "field",
        "scene.obj",
        "--surface",
        "sphere",
        "-o",
        "f.exr",
        "--camera",
        "unfolded",
    ];
    let (code, result) = document(
        directory.path(),
        &[&arguments[..], &["--width", "4", "--max-edge", "9"]].concat(),
    );
    assert_eq!(code, 0, "{result}");
    let sentence = "sphere is not planar or faces both ways: it has no tile";
    for list in ["left_out", "warnings"] {
        let texts = result[list].as_array().unwrap();
        assert!(texts.iter().any(|text| text == sentence), "{list}: {texts:?}");
    }
}

/// A picture far from the origin is as right as one near it.
#[test]
fn pictures_far_from_the_origin_are_verified() {
    let directory = with_scene("room-box");
    let near = std::fs::read_to_string(directory.path().join("scene.obj")).unwrap();
    let far: String = near
        .lines()
        .map(|line| match line.strip_prefix("v ") {
            Some(place) => {
                let v: Vec<f64> = place.split_whitespace().map(|x| x.parse().unwrap()).collect();
                format!("v {:?} {:?} {:?}\n", v[0] + 5e5, v[1] + 4.6e6, v[2])
            }
            None => format!("{line}\n"),
        })
        .collect();
    std::fs::write(directory.path().join("far.obj"), far).unwrap();
    let common = [
        "render",
        "far.obj",
        "-o",
        "far.exr",
        "--subdivide",
        "2",
        "--width",
        "32",
        "--height",
        "20",
    ];
    let camera = [
        "--eye",
        "500003.85,4600000.2,2",
        "--look-at",
        "500001.3,4600003.4,1",
        "--up",
        "0,0,1",
    ];
    for direct in ["exact", "polygons"] {
        let arguments = [&common[..], &camera, &["--samples", "1", "--direct", direct]].concat();
        succeed(directory.path(), &arguments);
        let (code, result) = document(directory.path(), &["verify", "far.exr"]);
        assert_eq!((code, &result["passed"]), (0, &true.into()), "{direct}: {result}");
        assert!(result["n_checked"].as_u64().unwrap() > 300, "{direct}: {result}");
    }
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

/// A picture of form factors that are computed again in every pass is that of stored ones, without the error that only those carry.
#[test]
fn a_picture_needs_no_stored_form_factors() {
    let directory = with_scene("cornell-box");
    let base = [
        "render",
        "scene.obj",
        "--width",
        "24",
        "--max-edge",
        "0.25",
        "--method",
        "sr",
        "--rays",
        "500",
        "--samples",
        "1",
        "--solver",
        "gmres",
        // What stored form factors tell of patches that see nothing, under the blocks, shows in the solver's way, not in where it ends.
        "--tolerance",
        "1e-12",
    ];
    let picture = |name: &str, more: &[&str]| {
        let (code, result) = document(directory.path(), &[&base[..], &["-o", name], more].concat());
        assert_eq!(code, 0, "{result}");
        let (image, _) = exr::read(&directory.path().join(name)).unwrap();
        (image, result)
    };
    let (stored, _) = picture("stored.exr", &["--balance", "off", "--precision", "f64"]);
    let (fly, result) = picture("fly.exr", &["--on-the-fly"]);
    assert!(result["form_factors"].is_null());
    assert!(
        result["left_out"]
            .to_string()
            .contains("every pass computes them again")
    );
    let names = |image: &Image| -> Vec<String> {
        let names = image.layers().iter().map(|layer| layer.name.clone());
        names.filter(|name| !name.starts_with("error.")).collect()
    };
    assert_eq!(names(&fly), names(&stored));
    assert!(stored.f32("error.R").is_some() && fly.f32("error.R").is_none());
    for name in names(&stored) {
        let (Some(expected), Some(found)) = (stored.f32(&name), fly.f32(&name)) else {
            assert_eq!(stored.u32(&name), fly.u32(&name), "{name}");
            continue;
        };
        for (a, b) in expected.iter().zip(found) {
            // The order of sums in f64 may turn the rounding to f32 around: 6e-8.
            let equal = a.to_bits() == b.to_bits() || (a - b).abs() <= 1.2e-7 * a.abs();
            assert!(equal, "{name}: {a} {b}");
        }
    }
    for (more, expected) in [
        (["--method", "exact"], "pairs"),
        (["--solver", "pcg"], "balanced"),
        (["--frames", "f.toml"], "--frames"),
    ] {
        let arguments = [&["render", "scene.obj", "-o", "x.exr", "--on-the-fly"][..], &more].concat();
        let refused = radiosity(directory.path(), &arguments);
        assert_eq!(refused.status.code(), Some(2));
        assert!(stderr(&refused).contains(expected), "{}", stderr(&refused));
    }
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

    // What a part of the surface is hidden from is compared with what the picture's own rays find.
    let half_hidden = with_scene("corridor");
    let field = ["field", "scene.obj", "--surface", "B", "-o", "f.exr", "--method", "qmc"];
    let unfolded = ["--camera", "unfolded", "--width", "16"];
    assert_eq!(document(half_hidden.path(), &[&field[..], &unfolded].concat()).0, 0);
    let verified = radiosity(half_hidden.path(), &["verify", "f.exr"]);
    let text = String::from_utf8(verified.stdout).unwrap();
    let of_wall = |name: &str| text.lines().find(|line| line.starts_with(name)).unwrap();
    assert!(
        text.contains("96 of 96 pixels compared") && text.contains("which were traced again"),
        "{text}"
    );
    for wall in ["A ", "partition_back "] {
        assert!(of_wall(wall).ends_with(" right"), "{text}");
    }

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

/// Fields through a camera: exact ones, noisy ones, half hidden ones, and wrong ones.
#[test]
fn fields_seen_by_a_camera_are_verified() {
    let eyes = [
        ("cube", "z1", "0.1,0.2,0.1", "0.9,0.8,0.6"),
        ("corridor", "B", "1.9,0.5,0.9", "0.2,3,0.3"),
    ];
    for (scene, surface, eye, at) in eyes {
        let directory = with_scene(scene);
        let base = [
            "field",
            "scene.obj",
            "--surface",
            surface,
            "-o",
            "f.exr",
            "--width",
            "32",
            "--height",
            "24",
        ];
        let base = [
            &base[..],
            &["--eye", eye, "--look-at", at, "--up", "0,0,1", "--fov", "80"],
        ]
        .concat();
        for method in [&["--method", "exact"][..], &["--method", "sr", "--rays", "256"]] {
            let (made, result) = document(directory.path(), &[&base[..], method].concat());
            assert_eq!(made, 0, "{result}");
            let (code, report) = document(directory.path(), &["verify", "f.exr"]);
            assert_eq!(
                (code, &report["passed"]),
                (0, &true.into()),
                "{scene} {method:?}: {report}"
            );
            assert!(report["n_checked"].as_u64() > Some(300), "{report}");
            assert!(report["tolerance"]["n_comparisons"].as_u64() > Some(900), "{report}");
            // 10 % too much everywhere.
            let path = directory.path().join("f.exr");
            let (mut image, attributes) = exr::read(&path).unwrap();
            let values = image.f32("Y").unwrap().iter().map(|y| 1.1 * y).collect();
            image.insert("Y", Samples::F32(values));
            exr::write(&path, &image, &attributes).unwrap();
            let wrong = radiosity(directory.path(), &["verify", "f.exr"]);
            assert_eq!(wrong.status.code(), Some(4), "{scene} {method:?}");
            let text = String::from_utf8(wrong.stdout).unwrap();
            assert!(text.contains("WRONG") && text.ends_with("failed\n"), "{text}");
        }
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
        (
            "\nframe = [[\"a\"]]\n",
            "bad.toml:2: invalid type: list, expected a table with a `name`",
        ),
        (
            "[[frame]]\nname = \"a\"\nmove = [[\"box\", 30]]\n",
            "bad.toml:3: invalid type: list, expected a table with a `surface` and its motion",
        ),
        ("[[frame]]\nname = \"a\"\nlight = \"x\"\n", "bad.toml:3"),
        (
            "\n[[frame]]\nname = \"a\"\nlighting = \"none.toml\"\n",
            "; frame `a` names it, bad.toml:2",
        ),
        (
            "[[frame]]\nname = \"b\"\ncamera = \"none.toml\"\n",
            "; frame `b` names it, bad.toml:1",
        ),
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

/// One object in several poses: each frame as if its scene had been rendered alone, and no more computed anew than needed.
#[test]
fn frames_with_a_moved_object_equal_pictures_of_the_moved_scene() {
    let directory = with_scene("room-box");
    let path = |name: &str| directory.path().join(name);
    let write = |name: &str, text: &str| std::fs::write(path(name), text).unwrap();
    let scene = std::fs::read_to_string(path("scene.obj")).unwrap();
    // The box is the surfaces that are not walls: its sides are named after it.
    let (code, listed) = document(directory.path(), &["form-factors", "scene.obj", "--subdivide", "1"]);
    assert_eq!(code, 0);
    let names: Vec<&str> = listed["surfaces"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| s["name"].as_str().unwrap())
        .collect();
    let sides: Vec<&str> = names.into_iter().filter(|name| name.starts_with("box")).collect();
    assert!(!sides.is_empty(), "{scene}");
    let surfaces = format!("{sides:?}");
    write(
        "frames.toml",
        &format!(
            "[[frame]]\nname = \"a\"\n\n[[frame]]\nname = \"b\"\n[[frame.move]]\nsurface = {surfaces}\ntranslate = [0.125, 0.0, 0.0]\n\n\
             [[frame]]\nname = \"c\"\n\n[[frame]]\nname = \"d\"\n[[frame.move]]\nsurface = {surfaces}\nrotate = 30\naxis = [0, 0, 1]\n\
             [[frame.move]]\nsurface = {surfaces}\ntranslate = [0, 0, 0.125]\n"
        ),
    );
    let common = [
        "render",
        "scene.obj",
        "--subdivide",
        "3",
        "--width",
        "16",
        "--direct",
        "exact",
        "--eye",
        "0.1,0.1,0.1",
        "--look-at",
        "0.9,0.8,0.7",
    ];
    let frames = [&common[..], &["--frames", "frames.toml", "-o", "f.exr"]].concat();
    let (code, result) = document(directory.path(), &frames);
    assert_eq!((code, &result["n_lightings"]), (0, &1.into()), "{result}");
    let poses = result["poses"].as_array().unwrap();
    assert_eq!(poses.len(), 3);
    assert_eq!(poses[0]["frames"], serde_json::json!(["a", "c"]));
    assert!(poses[0]["update"].is_null());
    for pose in &poses[1..] {
        let update = &pose["update"];
        let [kept, anew] = ["n_kept", "n_recomputed"].map(|name| update[name].as_u64().unwrap());
        assert!(update["n_moved_faces"] == 6 && kept > 0 && anew > 0, "{update}");
        assert_eq!(pose["form_factors"]["pairs"]["kept"], kept);
    }
    let order: Vec<&str> = result["frames"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["name"].as_str().unwrap())
        .collect();
    assert_eq!(order, ["a", "b", "c", "d"]);
    assert_eq!(result["frames"][1]["moves"][0]["translate"][0], 0.125);
    // The same poses, each alone.
    let layers = |name: &str| radiosity::render::exr::read(&path(name)).unwrap().0;
    assert_eq!(layers("f-a.exr").f32("R"), layers("f-c.exr").f32("R"));
    let whole = std::fs::read_to_string(path("frames.toml")).unwrap();
    for (name, place) in [("b", 2), ("d", 4)] {
        let only = whole.split("[[frame]]").nth(place).unwrap();
        write("one.toml", &format!("[[frame]]{only}"));
        let alone = [&common[..], &["--frames", "one.toml", "-o", "alone.exr"]].concat();
        let (code, result) = document(directory.path(), &alone);
        assert_eq!((code, result["poses"].as_array().unwrap().len()), (0, 1), "{result}");
        let (shared, single) = (layers(&format!("f-{name}.exr")), layers(&format!("alone-{name}.exr")));
        for layer in ["R", "direct.G", "irradiance.B"] {
            for (a, b) in shared.f32(layer).unwrap().iter().zip(single.f32(layer).unwrap()) {
                // Ten times the tolerance of the form factors, beside 1 W·m⁻² or less; the same but for pairs on the border of occluders.
                assert!((a - b).abs() <= 1e-4 * b.abs().max(1e-2), "{name} {layer}: {a} {b}");
            }
        }
        assert_ne!(shared.f32("R"), layers("f-a.exr").f32("R"), "the move shows");
    }
    for told in [&result["poses"], &result["frames"]] {
        for one in told.as_array().unwrap() {
            assert_eq!(one["stop_reason"], "converged");
            let number = |name: &str| one[name].as_f64().unwrap();
            let (bound, stated) = (number("error_bound"), number("estimated_relative_error"));
            assert!(
                number("residual_l2") <= 1e-6 && bound < 1e-4 && stated > bound / 2.0,
                "{one}"
            );
        }
    }
    assert!(
        poses
            .iter()
            .all(|pose| pose["solver"].is_string() && pose["why"].is_string())
    );
    let text = radiosity(directory.path(), &frames);
    let told = String::from_utf8(text.stdout).unwrap();
    assert_eq!(told.matches(": converged after ").count(), 3, "{told}");
    assert!(
        told.contains("6 faces moved: ") && told.contains("computed anew, the others are as before"),
        "{told}"
    );
}

/// The first pose has its solution at once, the second needs more passes than it may take.
#[test]
fn a_sequence_is_as_good_as_its_worst_pose() {
    let directory = with_scene("room-box");
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    let library = std::fs::read_to_string(directory.path().join("scene.mtl")).unwrap();
    let materials = library.lines().filter_map(|line| line.strip_prefix("newmtl "));
    let black: Vec<String> = materials
        .map(|name| format!("[material.\"{name}\"]\nreflectance = 0.0\n"))
        .collect();
    write("black.toml", &black.concat());
    write(
        "frames.toml",
        "[[frame]]\nname = \"a\"\nlighting = \"black.toml\"\n\n[[frame]]\nname = \"b\"\n[[frame.move]]\nsurface = \"box_z1\"\ntranslate = [0.0, 0.0, 0.1]\n",
    );
    let arguments = [
        "render",
        "scene.obj",
        "--subdivide",
        "2",
        "--width",
        "8",
        "--solver",
        "jacobi",
        "--max-passes",
        "2",
        "--frames",
        "frames.toml",
        "-o",
        "f.exr",
    ];
    let (code, result) = document(directory.path(), &arguments);
    assert_eq!(code, 3, "{result}");
    let poses = result["poses"].as_array().unwrap();
    let reasons = [
        &poses[0]["stop_reason"],
        &poses[1]["stop_reason"],
        &result["stop_reason"],
    ];
    assert_eq!(reasons, ["converged", "max_passes", "max_passes"]);
    for name in ["residual_l2", "error_bound", "estimated_relative_error"] {
        assert_eq!(result[name], poses[1][name], "{name}");
        assert!(
            poses[0][name].as_f64().unwrap() < poses[1][name].as_f64().unwrap(),
            "{name}"
        );
    }
    let text = String::from_utf8(radiosity(directory.path(), &arguments).stdout).unwrap();
    assert!(
        text.contains("jacobi: converged after ") && text.contains("jacobi: out of passes after "),
        "{text}"
    );
}

#[test]
fn motions_that_cannot_be_are_refused_with_their_line() {
    let directory = with_scene("room-box");
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    let (code, listed) = document(directory.path(), &["form-factors", "scene.obj", "--subdivide", "1"]);
    assert_eq!(code, 0);
    let side = listed["surfaces"][0]["name"].as_str().unwrap();
    for (moves, words) in [
        ("surface = \"sofa\"\ntranslate = [1, 0, 0]", "no surface `sofa`"),
        ("surface = []\ntranslate = [1, 0, 0]", "name one or more"),
        ("surface = \"SIDE\"", "give `rotate` or `translate`"),
        ("surface = \"SIDE\"\nrotate = 10\naxis = [0, 0, 0]", "no direction"),
        ("surface = \"SIDE\"\ntranslate = [1e16, 0, 0]", "move it less far"),
        ("surface = \"SIDE\"\nspin = 3", "spin"),
        (
            "surface = \"SIDE\"\ntranslate = [1, 0, 0, 5]",
            "bad.toml:5: invalid length 4, expected three numbers",
        ),
        ("surface = 3\nrotate = 3", "expected the name of a surface"),
    ] {
        let moves = moves.replace("SIDE", side);
        write(
            "bad.toml",
            &format!("[[frame]]\nname = \"a\"\n[[frame.move]]\n{moves}\n"),
        );
        let bad = [
            "render",
            "scene.obj",
            "--subdivide",
            "3",
            "--frames",
            "bad.toml",
            "-o",
            "f.exr",
        ];
        let output = radiosity(directory.path(), &bad);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{moves}: {message}");
        assert!(
            message.contains(words) && message.contains("bad.toml:") && message.lines().count() == 1,
            "{moves}: {message}"
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
    // Sixteen nets of one ray for each of a pixel's 4, 16 or 64 samples are the least, and are told.
    let least = ["--noise", "0.1", "--gather-rays", "1"];
    let (_, result) = document(directory.path(), &[&common[..], &least].concat());
    let (image, _) = radiosity::render::exr::read(&directory.path().join("g.exr")).unwrap();
    let samples = image.u32("samples").unwrap();
    let n_samples = image.u32("pixel_samples").unwrap();
    assert!(samples.iter().zip(n_samples).all(|(rays, n)| *rays == 16 * n));
    assert!(n_samples.contains(&4) && n_samples.contains(&64));
    let total: u64 = samples.iter().map(|&n| u64::from(n)).sum();
    assert_eq!(result["final_gather"]["n_rays"], total);
    // A noise beyond all means is told in a few digits.
    let beyond = ["--noise", "1e-300", "--gather-rays", "64"];
    let output = radiosity(directory.path(), &[&common[..], &beyond].concat());
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.contains("above the noise of 1e-300\n"), "{told}");
    // A budget spent above the tolerance.
    let few = ["--noise", "0.001", "--gather-rays", "64"];
    let (code, result) = document(directory.path(), &[&common[..], &few].concat());
    assert_eq!(code, 3);
    assert!(
        result["final_gather"]["n_above"].as_u64().unwrap() > 50,
        "{}",
        result["final_gather"]
    );
    let n_above = &result["final_gather"]["n_above"];
    let told = result["warnings"].to_string();
    assert!(
        told.contains(&format!("g.exr: {n_above} of ")) && told.contains("--gather-rays"),
        "{told}"
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
