//! Polygons, closed forms, quadrature rules and sampling: mathematics that knows nothing of scenes.

pub mod polygon;
pub mod quadrature;
pub mod sampling;

pub use glam::DVec3;
