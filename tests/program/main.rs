//! The program for users and their scripts: exit codes, messages, documents, files.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(
    clippy::shadow_unrelated,
    reason = "each run of a test has its own output, code and result"
)]

mod at_walls;
#[path = "../support/cases.rs"]
mod cases;
mod exchange;
mod experiments;
mod files_out;
mod form_factors;
mod heat;
mod input;
mod manual;
mod messages;
mod pages;
mod pictures;
#[path = "../support/program.rs"]
mod program;
mod ranks;
mod schema;
mod screen;
#[path = "../support/sealed_room.rs"]
mod sealed_room;
mod solve;
mod sun_path;
mod threads;
mod voxel;

use program::{document, radiosity, stderr, with_scene};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}
