//! What was done, how well, how long it took, and what was left out; and the files that carry results to other programs.

pub mod csv;
#[cfg(feature = "reports")]
pub mod curves;
mod description;
mod error;
pub mod exchange;
pub mod form_factors;
#[cfg(feature = "reports")]
mod frame;
pub mod heat;
#[cfg(feature = "reports")]
mod log_axis;
#[cfg(feature = "reports")]
mod machine;
mod matrix_csv;
mod matrix_exr;
mod memory;
mod mtx;
mod npy;
mod npz;
#[cfg(feature = "reports")]
pub mod page;
#[cfg(feature = "reports")]
mod paper;
#[cfg(feature = "reports")]
pub mod plot;
pub mod points;
mod read;
pub mod solution;
mod stages;
#[cfg(feature = "reports")]
mod table;
pub mod voxels;
mod vtu;

pub use description::Description;
pub use error::ReportError;
#[cfg(feature = "reports")]
pub use machine::{Machine, load_average};
pub use memory::{memory_available_byte, memory_peak_byte, memory_used_byte};
pub use stages::StageTimes;
#[cfg(feature = "reports")]
pub use table::Table;
