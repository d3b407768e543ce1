//! What was done, how well, how long it took, and what was left out.

pub mod csv;
mod log_axis;
mod machine;
pub mod plot;
mod raster;
mod stages;
mod table;

pub use machine::Machine;
pub use raster::{RasterError, png_from_svg};
pub use stages::{StageTimes, memory_peak_byte};
pub use table::Table;
