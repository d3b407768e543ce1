//! Embree's answers against the f64 oracle, against embree4-rs, and against the laws of closed scenes.

mod against_oracle;
mod closed_scenes;
mod embree4_rs_reference;
mod robustness;
pub(crate) mod scenes;
mod sheets;
