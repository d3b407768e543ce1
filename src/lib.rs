//! Light in diffuse scenes, as exactly as numbers allow.

pub mod embree;
pub mod geometry;
pub mod matrix;
pub mod mesh;
pub mod progress;
pub mod scene;
pub mod solver;
pub mod visibility;
