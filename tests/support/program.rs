//! Runs of the program by users and their scripts: within limits, on built-in scenes, with checks of the remaining files.

#[path = "run.rs"]
mod run;

use std::path::Path;
use std::process::Command;

use tempfile::TempDir;

pub(crate) use run::*;

/// Returns a command that will run the program at the end of a line of shell, which sets its limits and ends in `exec`.
pub(crate) fn limited(directory: &Path, shell: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new("bash");
    command.current_dir(directory);
    command.args(["-c", &format!("{shell} \"$0\" \"$@\""), PROGRAM]);
    command.args(arguments);
    command
}

/// Runs what must succeed, and returns what it printed.
#[track_caller]
pub(crate) fn succeed(directory: &Path, arguments: &[&str]) -> Vec<u8> {
    let output = radiosity(directory, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
    output.stdout
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
