//! The program, run as its users and their scripts run it.

#![allow(dead_code, reason = "each test binary uses another part")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// The program's path.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_radiosity");

/// Returns a command that will run the program in a directory.
pub(crate) fn command(directory: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(directory).args(arguments);
    command
}

/// Returns a command that will run the program at the end of a line of shell, which sets its limits and ends in `exec`.
pub(crate) fn limited(directory: &Path, shell: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new("bash");
    command.current_dir(directory);
    command.args(["-c", &format!("{shell} \"$0\" \"$@\""), PROGRAM]);
    command.args(arguments);
    command
}

/// Runs the program to its end.
#[track_caller]
pub(crate) fn radiosity(directory: &Path, arguments: &[&str]) -> Output {
    command(directory, arguments).output().unwrap()
}

/// Runs with `--json` and returns the exit code and the document.
#[track_caller]
pub(crate) fn document(directory: &Path, arguments: &[&str]) -> (i32, Value) {
    let output = radiosity(directory, &[arguments, &["--json"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    (output.status.code().unwrap(), value)
}

/// Runs what must succeed, and returns what it printed.
#[track_caller]
pub(crate) fn succeed(directory: &Path, arguments: &[&str]) -> Vec<u8> {
    let output = radiosity(directory, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    output.stdout
}

#[track_caller]
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A directory with a built-in scene as `scene.obj`.
pub(crate) fn with_scene(name: &str) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    succeed(directory.path(), &["scene", name, "-o", "scene.obj"]);
    directory
}

/// Returns the names in a directory, in order.
pub(crate) fn names(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
