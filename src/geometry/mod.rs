//! Polygons, closed forms, quadrature rules and sampling: mathematics without scenes.

pub(crate) mod box_pairs;
pub mod clip;
mod double_double;
pub(crate) mod gauss_legendre;
pub mod point_form_factor;
pub mod polygon;
pub mod polygon_form_factor;
pub mod quadrature;
pub mod rectangle;
pub mod sampling;

pub use glam::DVec3;
