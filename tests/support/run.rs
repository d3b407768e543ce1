//! One run of the program, as its users and their scripts run it.

#[path = "schema.rs"]
pub(crate) mod schema;

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// The program's path.
pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_radiosity");

/// Returns a command that will run the program in a directory.
pub(crate) fn command(directory: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(PROGRAM);
    command.current_dir(directory).args(arguments);
    command
}

/// Runs the program to its end.
#[track_caller]
pub(crate) fn radiosity(directory: &Path, arguments: &[&str]) -> Output {
    command(directory, arguments).output().unwrap()
}

/// Runs with `--json` and returns the exit code and the document, which has to be as the JSON Schema says.
#[track_caller]
pub(crate) fn document(directory: &Path, arguments: &[&str]) -> (i32, Value) {
    let output = radiosity(directory, &[arguments, &["--json"]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    let value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    schema::check(&value).unwrap_or_else(|error| panic!("{arguments:?}: {error}"));
    (output.status.code().unwrap(), value)
}

#[track_caller]
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}
