//! Failures: hostile and mutated files, too little memory, a full disk, signals and kills.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod formats;
mod full_disk;
mod hostile;
mod interruption;
mod memory;
mod mutated;
#[path = "../support/program.rs"]
mod program;
