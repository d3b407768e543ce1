//! What was done, how well, how long it took, and what was left out; and the files that carry results to other programs.

pub mod csv;
pub mod curves;
mod description;
mod error;
pub mod form_factors;
mod frame;
mod log_axis;
mod machine;
mod matrix_csv;
mod matrix_exr;
mod memory;
mod mtx;
mod npy;
mod npz;
pub mod page;
pub mod plot;
mod raster;
mod read;
pub mod solution;
mod stages;
mod table;
pub mod voxels;
mod vtu;

pub use description::Description;
pub use error::ReportError;
pub use machine::{Machine, load_average};
pub use memory::{memory_available_byte, memory_peak_byte, memory_used_byte};
pub use raster::{RasterError, png_from_svg};
pub use stages::StageTimes;
pub use table::Table;
