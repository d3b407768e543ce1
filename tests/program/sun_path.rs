//! `--sun-path` of `solve` and `heat`: documents, series and messages; sun and sky over the frames of a sequence.

use radiosity::render::exr;

use crate::{document, numbers, radiosity, stderr, with_scene};

const DAY: &str = "time,latitude,longitude,irradiance\n2026-06-21T03:00:00+02:00,47.4,8.5,0\n2026-06-21T09:00:00+02:00,47.4,8.5,700\n\
     2026-06-21T12:00:00+02:00,47.4,8.5,900\n";

fn write(directory: &std::path::Path, name: &str, text: &str) {
    std::fs::write(directory.join(name), text).unwrap();
}

/// Every time of a document is what the same command finds for it alone, and the files of a series have the times.
#[test]
fn times_are_as_if_alone_and_in_the_files() {
    let directory = with_scene("street");
    let here = directory.path();
    write(here, "day.csv", DAY);
    let conditions = "[[surface]]\nname = \"*\"\nemissivity = 0.9\nabsorptance = 0.7\nadiabatic = true\n";
    write(here, "b.toml", conditions);
    let place = [
        "--latitude",
        "47.4",
        "--longitude",
        "8.5",
        "--time",
        "2026-06-21T12:00:00+02:00",
        "--sun-irradiance",
        "900",
    ];
    for (command, key) in [
        (&["solve"][..], "radiosity"),
        (&["heat", "--boundary", "b.toml"], "temperature_k"),
    ] {
        let scene = [&command[..1], &["scene.obj"], &command[1..], &["--sky", "50"]].concat();
        let (code, result) = document(here, &[&scene[..], &["--sun-path", "day.csv", "-o", "S.npz"]].concat());
        assert_eq!((code, &result["n_steps"]), (0, &3.into()), "{result}");
        assert_eq!(
            (&result["time_unit"], &result["settings"]["sun"]["path"]),
            (&"s".into(), &"day".into())
        );
        let steps = result["steps"].as_array().unwrap();
        let times: Vec<f64> = steps.iter().map(|step| step["time"].as_f64().unwrap()).collect();
        assert_eq!(times, [0.0, 21_600.0, 32_400.0]);
        assert_eq!(
            (&steps[0]["sun_irradiance_w_m2"], &steps[2]["line"]),
            (&0.0.into(), &4.into())
        );
        let (code, alone) = document(here, &[&scene[..], &place].concat());
        assert_eq!(code, 0);
        let of_surfaces = |document: &serde_json::Value| -> Vec<f64> {
            let surfaces = document["surfaces"].as_array().unwrap();
            let values = surfaces.iter().map(|own| match own[key].as_f64() {
                Some(value) => value,
                None => numbers(&own[key])[0],
            });
            values.collect()
        };
        for (a, b) in of_surfaces(&steps[2]).into_iter().zip(of_surfaces(&alone)) {
            assert!((a - b).abs() <= 1e-6 * b, "{a} {b}");
        }
        let written = std::fs::read(here.join("S.npz")).unwrap();
        let member = |name: &str| written.windows(name.len()).any(|bytes| bytes == name.as_bytes());
        assert!(member("time.npy") && member("time_text.npy") && member("sunlit_fraction.npy"));
        let (code, _) = document(here, &[&scene[..], &["--sun-path", "day.csv", "-o", "V.vtu"]].concat());
        assert_eq!(code, 0);
        let list = std::fs::read_to_string(here.join("V.pvd")).unwrap();
        assert!(
            list.contains("<DataSet timestep=\"21600.0\" group=\"\" part=\"0\" file=\"V-0001.vtu\"/>"),
            "{list}"
        );
        let one = std::fs::read_to_string(here.join("V-0002.vtu")).unwrap();
        assert!(one.contains("Name=\"TimeValue\"") && one.contains("\n32400.0\n") && one.contains("sunlit_fraction"));
        assert!(!here.join("V-0003.vtu").exists());
    }
}

/// Mistakes are one line with file and line, and what does not go together is refused.
#[test]
fn mistakes_in_paths_are_one_line() {
    let directory = with_scene("cube");
    let here = directory.path();
    write(here, "bad.csv", "time,x,y,z,irradiance\n0,0,0,1,5\n1,0,0,0,5\n");
    write(here, "good.csv", "time,x,y,z,irradiance\n0,0,0,1,5\n");
    write(
        here,
        "place.csv",
        "time,latitude,longitude,irradiance\n2026-06-21T12:00:00Z,10,0,900\n",
    );
    let (code, result) = document(here, &["solve", "scene.obj", "--sun-path", "bad.csv"]);
    assert_eq!(
        (code, &result["error"]["kind"]),
        (1, &"bad_sun_path".into()),
        "{result}"
    );
    assert_eq!(
        (&result["error"]["line"], &result["error"]["file"]),
        (&3.into(), &"bad.csv".into())
    );
    for (flags, part) in [
        (&["--sun-path", "good.csv", "-o", "B.csv"][..], "series"),
        (
            &["--sun-path", "good.csv", "--sun", "0,0,1", "--sun-irradiance", "5"],
            "--sun",
        ),
        (&["--sun-path", "good.csv", "--sun-irradiance", "5"], "--sun-irradiance"),
        (&["--sun-path", "good.csv", "-o", "good.csv"], "good.csv"),
        // The flag is at fault, not the row.
        (
            &["--sun-path", "place.csv", "--north", "0,0,1"],
            "radiosity: --north: zero, or along up",
        ),
        (
            &["--sun-path", "good.csv", "--sun-radius", "80"],
            "radiosity: --sun-radius: 80 is outside",
        ),
        (&["--form-factors", "F.npz", "--checkpoint", "c"], "--checkpoint"),
    ] {
        let output = radiosity(here, &[&["solve", "scene.obj"], flags].concat());
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.lines().count() == 1 && message.contains(part), "{message}");
    }
}

/// Sun and sky over the frames of a sequence: each is the picture of its own, and the light is found once.
#[test]
fn frames_have_sun_and_sky() {
    let directory = with_scene("street");
    let here = directory.path();
    write(
        here,
        "f.toml",
        "[[frame]]\nname = \"a\"\n\n[[frame]]\nname = \"b\"\nlighting = \"red.toml\"\n",
    );
    write(here, "red.toml", "[surface.street]\nreflectance = [0.8, 0.2, 0.1]\n");
    for colours in ["900", "900,800,700"] {
        let common = [
            "render",
            "scene.obj",
            "--width",
            "16",
            "--subdivide",
            "1",
            "--direct",
            "exact",
            "--sun=-0.4,0.3,1",
            "--sun-irradiance",
            colours,
            "--sky",
            "100",
        ];
        let frames = [&common[..], &["--frames", "f.toml", "-o", "f.exr"]].concat();
        let (code, result) = document(here, &frames);
        assert_eq!((code, &result["n_lightings"]), (0, &2.into()), "{result}");
        let sunlit = result["frames"][1]["surfaces"][0]["sunlit_fraction"].as_f64().unwrap();
        assert!((0.0..1.0).contains(&sunlit), "{sunlit}");
        let (code, alone) = document(here, &[&common[..], &["-o", "alone.exr"]].concat());
        assert_eq!((code, &alone["settings"]["sun"]), (0, &result["settings"]["sun"]));
        let layers = |name: &str| exr::read(&here.join(name)).unwrap().0;
        let (first, single, red) = (layers("f-a.exr"), layers("alone.exr"), layers("f-b.exr"));
        for layer in ["R", "direct.G", "irradiance.B"] {
            let pairs = first.f32(layer).unwrap().iter().zip(single.f32(layer).unwrap());
            let worst = pairs.map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f32::max);
            assert!(worst < 1e-5, "{layer}: {worst}");
        }
        let mean = |layer: &str| red.f32(layer).unwrap().iter().sum::<f32>();
        assert!(mean("R") > 1.05 * mean("B") && mean("direct.R") > 0.0);
    }
}
