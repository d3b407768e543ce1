//! Embree's answers against the f64 oracle, against embree4-rs, and against what must hold in closed scenes.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod against_oracle;
mod closed_scenes;
mod embree4_rs_reference;
mod robustness;
mod scenes;
mod sheets;
