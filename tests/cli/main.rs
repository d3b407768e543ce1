//! The program as its users and their scripts meet it: exit codes, messages, documents, files.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::shadow_unrelated,
    reason = "each run of a test has its own output, code and result"
)]

mod form_factors;
mod input;
mod pictures;
mod solve;

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

fn radiosity(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_radiosity"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap()
}

/// Runs with `--json` and returns the exit code and the document.
fn document(directory: &Path, arguments: &[&str]) -> (i32, Value) {
    let output = radiosity(directory, &[arguments, &["--json"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    (output.status.code().unwrap(), value)
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A directory with a built-in scene as `scene.obj`.
fn with_scene(name: &str) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let output = radiosity(directory.path(), &["scene", name, "-o", "scene.obj"]);
    assert!(output.status.success(), "{}", stderr(&output));
    directory
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}
