//! Light in diffuse scenes, as exactly as numbers allow.

// pub mod cli;
pub mod embree;
pub mod form_factor;
pub mod geometry;
pub mod matrix;
pub mod mesh;
pub mod notation;
// pub mod plan;
pub mod progress;
pub mod references;
pub mod render;
pub mod report;
pub mod scene;
pub mod solver;
pub mod visibility;
