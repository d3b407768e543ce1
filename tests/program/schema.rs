//! The JSON Schema in `docs/schema.json` against the documents of every command.

use serde_json::{Value, json};

use super::program::schema::{SCHEMA, check};
use super::{document, with_scene};

/// Calls `look` with every key of the documents that a schema describes.
fn for_each_key(schema: &Value, look: &mut impl FnMut(&str, &Value)) {
    match schema {
        Value::Object(members) => {
            let properties = members.get("properties").and_then(Value::as_object);
            for (key, own) in properties.into_iter().flatten() {
                look(key, own);
            }
            members.values().for_each(|member| for_each_key(member, look));
        }
        Value::Array(items) => items.iter().for_each(|item| for_each_key(item, look)),
        _ => {}
    }
}

#[test]
fn every_key_says_what_it_is_and_numbers_of_bytes_end_in_bytes() {
    let mut n_keys = 0;
    for_each_key(&SCHEMA, &mut |key, own| {
        n_keys += 1;
        assert!(!key.ends_with("_byte"), "{key}");
        let is_fixed = own.get("const").is_some();
        assert!(is_fixed || own.get("description").is_some(), "{key} has no description");
    });
    assert!(n_keys > 300, "{n_keys}");
}

const FRAMES: &str = "[[frame]]\nname = \"a\"\n[[frame]]\nname = \"b\"\n\
    [[frame.move]]\nsurface = \"tall_block\"\ntranslate = [0.01, 0.0, 0.0]\n";

/// Every command on a small scene, each once for every kind of document; `document` holds them against the schema.
#[test]
fn documents_are_as_the_schema_says() {
    let directory = with_scene("cornell-box");
    let place = directory.path();
    std::fs::write(place.join("frames.toml"), FRAMES).unwrap();
    std::fs::write(place.join("dim.toml"), "[surface.light]\nexitance = 2.0\n").unwrap();
    let fast = ["--method", "sr", "--rays", "64"];
    let small = ["--width", "8", "--height", "6"];
    let picture = [&fast[..], &small[..], &["--max-edge", "0.3"]].concat();
    let cases: [(&[&str], &[&str]); 19] = [
        (&["scene", "cube", "-o", "cube.obj"], &[]),
        (&["form-factors", "scene.obj", "-o", "F.npz"], &fast),
        (&["form-factors", "scene.obj", "--explain"], &[]),
        (
            &["form-factors", "scene.obj", "--no-cut", "--balance", "closure"],
            &fast,
        ),
        (&["solve", "scene.obj", "--form-factors", "F.npz", "-o", "B.csv"], &[]),
        (
            &["solve", "scene.obj", "--solver", "overshooting", "--max-passes", "3"],
            &fast,
        ),
        (
            &[
                "solve",
                "scene.obj",
                "--on-the-fly",
                "--solver",
                "gmres",
                "--restart",
                "4",
            ],
            &fast,
        ),
        (&["solve", "scene.obj", "--lighting", "dim.toml", "-o", "L.npz"], &fast),
        (&["render", "scene.obj", "-o", "a.exr"], &picture),
        (
            &[
                "render",
                "scene.obj",
                "-o",
                "g.exr",
                "--final-gather",
                "--gather-rays",
                "16",
            ],
            &picture,
        ),
        (
            &["render", "scene.obj", "-o", "f.exr", "--frames", "frames.toml"],
            &picture,
        ),
        (&["field", "scene.obj", "--surface", "light", "-o", "field.exr"], &small),
        (&["voxel", "scene.obj", "--voxels", "12", "--radius", "4"], &[]),
        (
            &[
                "voxel",
                "scene.obj",
                "--voxels",
                "12",
                "--radius",
                "4",
                "--solver",
                "auto",
            ],
            &[],
        ),
        (
            &[
                "voxel",
                "scene.obj",
                "--voxels",
                "12",
                "--radius",
                "4",
                "--adaptive",
                "0.2",
            ],
            &["-o", "v.vtu"],
        ),
        (&["verify", "field.exr"], &[]),
        (&["reproduce", "lewis", "--tables", "1", "-o", "lewis"], &[]),
        (&["solve", "missing.obj"], &[]),
        (&["solve", "scene.obj", "--tolerance", "2"], &[]),
    ];
    for (arguments, more) in cases {
        let (code, result) = document(place, &[arguments, more].concat());
        assert_eq!(
            result["error"].is_null(),
            code != 1 && code != 2,
            "{arguments:?}: {code}"
        );
    }
}

/// A change that makes a document wrong.
type Change = fn(&mut Value);

fn remove(object: &mut Value, key: &str) {
    assert!(object.as_object_mut().unwrap().remove(key).is_some(), "{key}");
}

#[test]
fn the_check_refuses_what_the_schema_does_not_say() {
    let directory = with_scene("cube");
    let (_, right) = document(directory.path(), &["solve", "scene.obj", "--explain"]);
    let changes: [(&str, Change); 9] = [
        ("a key too many", |d| d["more"] = json!(1)),
        ("a key too many inside", |d| d["surfaces"][0]["more"] = json!(1)),
        ("a key too few", |d| remove(d, "energy")),
        ("a key too few inside", |d| remove(&mut d["audit"], "passed")),
        ("text for a number", |d| d["n_patches"] = json!("6")),
        ("a fraction for a count", |d| d["n_patches"] = json!(6.5)),
        ("another version", |d| d["schema_version"] = json!(1)),
        ("an unknown reason", |d| d["stop_reason"] = json!("tired")),
        ("null for a number", |d| d["history"][0]["pass"] = Value::Null),
    ];
    assert_eq!(check(&right), Ok(()));
    for (what, change) in changes {
        let mut wrong = right.clone();
        change(&mut wrong);
        assert!(check(&wrong).is_err(), "{what} passes");
    }
}
