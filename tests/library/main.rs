//! The library: scenes, visibility, form factors, matrices, solvers, voxels, images, and the checks of what they compute.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod audit;
mod embree;
mod form_factor;
mod heat;
mod matrix;
mod mesh;
mod occlusion;
#[path = "../support/run.rs"]
mod program;
mod render;
mod scene;
#[path = "../support/sealed_room.rs"]
mod sealed_room;
mod solver;
mod support;
mod voxel;
mod workflow;
