//! Heat, sun and points from the command line: documents, files, flags and messages.

use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::{document, radiosity, stderr, with_scene};

const BOUNDARY: &str = "[surroundings]\ntemperature_k = 3.0\n[[surface]]\nname = \"*\"\nemissivity = 0.8\nabsorptance = 0.5\nadiabatic = true\n\
     [[surface]]\nname = \"room_z0\"\ntemperature_k = 320.0\n";

/// Returns the room with a box in it, and conditions for it.
fn room() -> TempDir {
    let directory = with_scene("room-box");
    std::fs::write(directory.path().join("b.toml"), BOUNDARY).unwrap();
    directory
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key}: {value}"))
}

/// Every number of a document has an error, the balance is 0 within its own, and adiabatic surfaces are supplied with nothing.
#[test]
fn documents_have_an_error_for_every_number() {
    let directory = room();
    let flags = [
        "heat",
        "scene.obj",
        "--boundary",
        "b.toml",
        "--subdivide",
        "2",
        "-o",
        "T.vtu",
    ];
    let (code, result) = document(directory.path(), &flags);
    assert_eq!(code, 0, "{result}");
    let balance = number(&result, "energy_balance_w");
    assert!(balance.abs() <= number(&result, "energy_balance_w_error"), "{balance}");
    for key in [
        "supplied_w",
        "sun_w",
        "sky_w",
        "from_surroundings_w",
        "escaped_w",
        "absorbed_by_backs_w",
    ] {
        assert!(number(&result, &format!("{key}_error")) >= 0.0, "{key}");
    }
    for surface in result["surfaces"].as_array().unwrap() {
        for key in [
            "temperature_k",
            "temperature_min_k",
            "temperature_max_k",
            "net_flux_w_m2",
            "net_heat_w",
            "supplied_w",
            "irradiance_w_m2",
            "absorbed_solar_w",
            "sky_factor",
        ] {
            let error = number(surface, &format!("{key}_error"));
            assert!(
                number(surface, key).is_finite() && (0.0..1e3).contains(&error),
                "{key}: {surface}"
            );
        }
        let name = surface["name"].as_str().unwrap();
        if name != "room_z0" {
            assert!(number(surface, "supplied_w").abs() <= 0.0, "{surface}");
        }
        // In a closed room all are as warm as the floor.
        let off = (number(surface, "temperature_k") - 320.0).abs();
        assert!(off <= number(surface, "temperature_k_error") + 1e-9, "{surface}");
    }
    let file = std::fs::read_to_string(directory.path().join("T.vtu")).unwrap();
    assert!(file.contains("Name=\"temperature_k\"") && file.contains("Name=\"net_flux_w_m2_error\""));
}

/// Flags of the sun take the place of the file's, and equal runs give equal bytes at any number of threads.
#[test]
fn the_sun_comes_from_flags_or_from_the_file() {
    let directory = TempDir::new().unwrap();
    let path = |name: &str| directory.path().join(name);
    std::fs::write(
        path("scene.obj"),
        "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 1 1 1\nv 2 1 1\nv 2 2 1\nv 1 2 1\no floor\nf 1 2 3 4\no plate\nf 5 6 7 8\no under\nf 8 7 6 5\n",
    )
    .unwrap();
    std::fs::write(
        path("b.toml"),
        "[sun]\ndirection = [0, 0, 2]\nirradiance_w_m2 = 500\n[[surface]]\nname = \"*\"\nemissivity = 0.9\nadiabatic = true\n",
    )
    .unwrap();
    let heat = ["heat", "scene.obj", "--boundary", "b.toml", "--subdivide", "4"];
    let sunlit = |more: &[&str]| {
        let (code, result) = document(directory.path(), &[&heat, more].concat());
        assert_eq!(code, 0, "{result}");
        (
            number(&result["surfaces"][0], "sunlit_fraction"),
            number(&result, "sun_w"),
        )
    };
    let (fraction, power) = sunlit(&[]);
    assert!(
        (fraction - 15.0 / 16.0).abs() < 1e-9 && (power - 500.0 * 16.0).abs() < 1e-6,
        "{fraction} {power}"
    );
    let (fraction, _) = sunlit(&["--sun", "1,0,0.5", "--sun-irradiance", "100"]);
    assert!(
        (fraction - 1.0).abs() < 1e-9,
        "the shadow falls beside the floor: {fraction}"
    );
    let mut files = Vec::new();
    for (threads, name) in [("1", "a.npz"), ("2", "b.npz")] {
        sunlit(&[
            "--threads",
            threads,
            "-o",
            name,
            "--sky",
            "50",
            "--sun",
            "0.3,0,1",
            "--sun-irradiance",
            "100",
            "--sun-radius",
            "2",
        ]);
        files.push(std::fs::read(path(name)).unwrap());
    }
    assert!(files[0] == files[1], "equal bytes");
    // At noon of an equinox the sun stands as high over the south as the latitude is from the pole.
    let place = ["--latitude", "40", "--longitude", "0", "--time", "2026-03-20T12:07:00Z"];
    let noon = [&["--sun-irradiance", "100"], &place[..]].concat();
    let (fraction, power) = sunlit(&noon);
    let height = power / 100.0 / (1.0 + 16.0 * fraction);
    assert!((height - 50.0_f64.to_radians().sin()).abs() < 5e-3, "{height}");
    // In `solve` the sun lights a scene without lamps.
    let solve = [
        "solve",
        "scene.obj",
        "--subdivide",
        "4",
        "--sun",
        "0,0,1",
        "--sun-irradiance",
        "90,60,30",
    ];
    let (code, result) = document(directory.path(), &solve);
    assert_eq!(code, 0, "{result}");
    let floor = &result["surfaces"][0];
    assert!((number(floor, "sunlit_fraction") - 15.0 / 16.0).abs() < 1e-9, "{floor}");
    let direct = crate::numbers(&floor["sun_irradiance"]);
    assert!((direct[1] - 60.0 * 15.0 / 16.0).abs() < 1e-9, "{floor}");
    let radiosity = crate::numbers(&floor["radiosity"]);
    assert!(
        (radiosity[0] / radiosity[2] - 3.0).abs() < 1e-6 && radiosity[0] > 0.5 * direct[0] * 0.9,
        "{floor}"
    );
}

/// A uniform sky lights what sees it: a floor below a plate by its sky factor, a wall by half, what faces down not at all. The wall is lower than the floor, which sees nothing of it.
#[test]
fn a_scene_is_solved_under_a_sky() {
    let directory = TempDir::new().unwrap();
    std::fs::write(
        directory.path().join("scene.obj"),
        "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 1 1 1\nv 2 1 1\nv 2 2 1\nv 1 2 1\nv 0 90 -3\nv 1 90 -3\nv 1 90 -2\nv 0 90 -2\n\
         o floor\nf 1 2 3 4\no plate\nf 5 6 7 8\no under\nf 8 7 6 5\no wall\nf 12 11 10 9\n",
    )
    .unwrap();
    let run = |command: &str, more: &[&str]| {
        let (code, result) = document(directory.path(), &[&[command, "scene.obj"], more].concat());
        assert_eq!(code, 0, "{result}");
        result
    };
    let factors = run("form-factors", &[]);
    let seen = factors["surface_form_factor"][0][2].as_f64().unwrap();
    let result = run("solve", &["--sky", "80,40,20"]);
    let surface = |k: usize| &result["surfaces"][k];
    for (k, fraction) in [(0, 1.0 - seen), (1, 1.0), (2, 0.0), (3, 0.5)] {
        let [light, error] = ["sky_irradiance", "sky_irradiance_error"].map(|key| crate::numbers(&surface(k)[key]));
        for (c, strength) in [80.0, 40.0, 20.0].into_iter().enumerate() {
            let off = (light[c] - strength * fraction).abs();
            assert!(
                off <= error[c] + 1e-9 * strength && error[c] <= 1e-3 * strength,
                "{}",
                surface(k)
            );
        }
    }
    // The plate sees nothing but the sky, and reflects half of its light.
    assert!(
        (crate::numbers(&surface(1)["radiosity"])[0] - 40.0).abs() < 1e-9,
        "{}",
        surface(1)
    );
    let (code, grey) = document(directory.path(), &["solve", "scene.obj", "--sky", "80"]);
    assert_eq!(
        (code, crate::numbers(&grey["surfaces"][1]["radiosity"]).len()),
        (0, 1),
        "{grey}"
    );
    assert_eq!(
        grey["settings"]["sky_irradiance"],
        serde_json::json!([80.0, 80.0, 80.0])
    );
}

/// The picture shows the temperatures in the colours of its scale, the same bytes at any number of threads; a camera of its own moves it.
#[test]
fn temperatures_are_pictured() {
    let directory = room();
    let run = |name: &str, more: &[&str]| {
        let heat = ["heat", "scene.obj", "--boundary", "b.toml", "--picture", name];
        let (code, result) = document(directory.path(), &[&heat, more].concat());
        assert_eq!(code, 0, "{result}");
        std::fs::read(directory.path().join(name)).unwrap()
    };
    let first = run("a.png", &["--threads", "1"]);
    assert!(first.starts_with(b"\x89PNG") && first == run("b.png", &["--threads", "2"]));
    assert_ne!(first, run("c.png", &["--fov", "20"]));
    let heat = ["heat", "scene.obj", "--boundary", "b.toml", "--picture", "a.exr"];
    let (code, result) = document(directory.path(), &heat);
    assert!(
        code == 2 && result.to_string().contains("give it the ending .png"),
        "{result}"
    );
}

#[test]
fn mistakes_are_one_line() {
    let directory = room();
    std::fs::write(directory.path().join("bad.toml"), BOUNDARY.replace("0.8", "1.5")).unwrap();
    std::fs::write(
        directory.path().join("none.toml"),
        "[[surface]]\nname = \"*\"\nemissivity = 0.8\nsupplied_w_m2 = 1\n",
    )
    .unwrap();
    std::fs::write(directory.path().join("tiny.toml"), BOUNDARY.replace("0.8", "1e-15")).unwrap();
    for (flags, code, words) in [
        (&["--boundary", "tiny.toml"][..], 1, "tiny.toml:5: surface `"),
        (&["--boundary", "bad.toml"], 1, "bad.toml:5:"),
        (&["--boundary", "none.toml"], 1, "none.toml:4: no temperature is given"),
        (&["--boundary", "missing.toml"], 1, "no such file"),
        (&["--boundary", "b.toml", "-o", "T.txt"], 2, "names no format"),
        (&["--boundary", "b.toml", "-o", "b.toml"], 2, "names no format"),
        (
            &["--boundary", "b.toml", "--exchange-factors", "G.txt"],
            2,
            "names no format",
        ),
        (
            &["--boundary", "b.toml", "--sun", "0,0,0", "--sun-irradiance", "1"],
            2,
            "--sun: zero",
        ),
        (&["--boundary", "b.toml", "--sun", "0,0,1"], 2, "--sun-irradiance"),
        (
            &["--boundary", "b.toml", "--latitude", "50", "--sun-irradiance", "1"],
            2,
            "--longitude",
        ),
        (
            &[
                "--boundary",
                "b.toml",
                "--latitude",
                "50",
                "--longitude",
                "10",
                "--time",
                "2026-06-21T00:00:00Z",
                "--sun-irradiance",
                "1",
            ],
            2,
            "--time: the sun is",
        ),
        (
            &["--boundary", "b.toml", "--sun", "0,0,1", "--sun-irradiance", "1,2,3"],
            2,
            "one solar band",
        ),
    ] {
        let output = radiosity(directory.path(), &[&["heat", "scene.obj"], flags].concat());
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{flags:?}: {message}");
        let last = message.lines().last().unwrap_or_default();
        assert!(last.contains(words), "{flags:?}: {message}");
    }
}

fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

/// Exchange factors as thermal network programs take them: pairs without zeros, and rows of 1 with the surroundings.
#[test]
fn exchange_factors_are_written() {
    let directory = room();
    for name in ["G.csv", "G.npz"] {
        let flags = ["heat", "scene.obj", "--boundary", "b.toml", "--exchange-factors", name];
        let (code, result) = document(directory.path(), &flags);
        assert_eq!(code, 0, "{result}");
    }
    let table = rows(&directory.path().join("G.csv"));
    assert_eq!(table[0], ["node_i", "node_j", "conductance_m2"]);
    // Twelve surfaces of a closed room, every one with every other over reflections.
    assert_eq!(table.len(), 1 + 12 * 11 / 2);
    assert!(table[1..].iter().all(|row| row[2].parse::<f64>().unwrap() > 0.0));
    assert!(
        std::fs::read(directory.path().join("G.npz"))
            .unwrap()
            .starts_with(b"PK")
    );
}

/// At the middle of a cube with one hot side, T_mrt follows from its sixth of the sphere; before a side half of the hemisphere is not it; factors sum to 1.
#[test]
fn points_see_what_is_around() {
    let directory = with_scene("cube");
    let path = |name: &str| directory.path().join(name);
    let names: Vec<String> = {
        let text = std::fs::read_to_string(path("scene.obj")).unwrap();
        let groups = text
            .lines()
            .filter_map(|line| line.strip_prefix("o ").or(line.strip_prefix("g ")));
        groups.map(|name| name.trim().to_owned()).collect()
    };
    let hot = &names[0];
    std::fs::write(
        path("b.toml"),
        format!("[[surface]]\nname = \"*\"\nemissivity = 1.0\ntemperature_k = 300.0\n[[surface]]\nname = \"{hot}\"\ntemperature_k = 500.0\n"),
    )
    .unwrap();
    std::fs::write(path("p.csv"), "x,y,z\n0.5,0.5,0.5\n0.5,0.25,0.7\n2,2,2\n0.5,0.5,0\n").unwrap();
    let flags = ["points", "scene.obj", "p.csv", "--boundary", "b.toml", "-o", "o.csv"];
    let (code, result) = document(directory.path(), &flags);
    assert_eq!(code, 0, "{result}");
    let table = rows(&path("o.csv"));
    let column = |name: &str| {
        table[0]
            .iter()
            .position(|own| own == name)
            .unwrap_or_else(|| panic!("{name}: {:?}", table[0]))
    };
    let value = |row: usize, name: &str| table[row + 1][column(name)].parse::<f64>().unwrap();
    for row in 0..4 {
        let factors = names.iter().map(|name| value(row, &format!("F_{name}")));
        let sum = factors.sum::<f64>() + value(row, "F_surroundings") + value(row, "F_backs");
        assert!((sum - 1.0).abs() < 1e-12, "{row}: {sum}");
    }
    assert!((value(0, &format!("F_{hot}")) - 1.0 / 6.0).abs() < 1e-12);
    let expected = ((500.0_f64.powi(4) + 5.0 * 300.0_f64.powi(4)) / 6.0).powf(0.25);
    let (kelvin, error) = (value(0, "t_mrt_k"), value(0, "t_mrt_k_error"));
    assert!(
        (kelvin - expected).abs() <= error + 1e-9 && error < 1e-3,
        "{kelvin} +- {error} {expected}"
    );
    let status: Vec<&str> = (1..5).map(|row| table[row][1].as_str()).collect();
    assert_eq!(status, ["free", "free", "free", "on_face"]);
    std::fs::write(path("n.csv"), "x,y,z,nx,ny,nz\n0.5,0.5,0.5,0,0,2\n0.5,0.5,x,0,0,1\n").unwrap();
    let output = radiosity(directory.path(), &["points", "scene.obj", "n.csv"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(
        stderr(&output).contains("n.csv:3: `x` in column `z`"),
        "{}",
        stderr(&output)
    );
}
