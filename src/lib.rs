//! Light in diffuse scenes, as exactly as numbers allow.

pub mod geometry;
pub mod matrix;
pub mod mesh;
pub mod progress;
pub mod render;
pub mod scene;
pub mod solver;
pub mod visibility;
