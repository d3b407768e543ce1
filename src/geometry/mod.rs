//! Polygons, closed forms, quadrature rules and sampling: mathematics that knows nothing of scenes.

pub mod clip;
pub mod point_form_factor;
pub mod polygon;
pub mod rectangle;

pub use glam::DVec3;
