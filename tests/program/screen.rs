//! The text of a run fits one screen unless an explanation is requested.

use std::path::Path;

use crate::{radiosity, stderr, with_scene};

/// The lines of a terminal.
const SCREEN: usize = 24;

/// Returns the text of a run, results and warnings together.
fn printed(directory: &Path, arguments: &[&str]) -> String {
    let output = radiosity(directory, arguments);
    let warnings = stderr(&output);
    assert!(
        warnings.contains("warning: ") || warnings.is_empty(),
        "{arguments:?}: {warnings}"
    );
    String::from_utf8(output.stdout).unwrap() + &warnings
}

#[test]
fn a_scene_of_eight_surfaces_fits_one_screen() {
    // Each surface beyond the eighth adds its line.
    for (name, n_beyond) in [("cube", 0), ("cornell-box", 0), ("room-box", 4)] {
        let directory = with_scene(name);
        let boundary = "[[surface]]\nname = \"*\"\nemissivity = 0.9\ntemperature_k = 300.0\n";
        std::fs::write(directory.path().join("boundary.toml"), boundary).unwrap();
        let commands: [(&str, &[&str]); 3] = [
            ("form-factors", &[]),
            ("solve", &[]),
            ("heat", &["--boundary", "boundary.toml"]),
        ];
        for (command, flags) in commands {
            // The other two methods have more to warn of, and rays to count.
            for method in [&["exact"][..], &["pdm"], &["sr", "--rays", "100"]] {
                let arguments = [&[command, "scene.obj", "-o", "out.vtu"], flags, &["--method"], method].concat();
                let text = printed(directory.path(), &arguments);
                assert!(
                    text.lines().count() <= SCREEN + n_beyond,
                    "{name}, {arguments:?}:\n{text}"
                );
                assert!(text.contains("row sums ") && text.contains("wrote out.vtu"), "{text}");
                let explained = printed(directory.path(), &[&arguments[..], &["--explain"]].concat());
                let detail = "\nmatrix ";
                assert!(
                    !text.contains(detail) && explained.contains(detail),
                    "{text}\n{explained}"
                );
            }
        }
    }
}
