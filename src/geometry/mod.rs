//! Polygons, closed forms, quadrature rules and sampling: mathematics that knows nothing of scenes.

pub mod polygon;

pub use glam::DVec3;
