//! Reports of runs, and the files that carry results to other programs.

mod coloured;
mod csv;
#[cfg(feature = "reports")]
pub mod curves;
mod description;
mod error;
pub mod exchange;
pub mod exitance;
#[cfg(feature = "reports")]
pub mod false_colour;
mod file;
pub mod form_factors;
#[cfg(feature = "reports")]
mod frame;
pub mod heat;
#[cfg(feature = "reports")]
mod log_axis;
#[cfg(feature = "reports")]
mod machine;
#[cfg(feature = "reports")]
mod mark;
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
mod patches;
#[cfg(feature = "reports")]
pub mod plot;
pub mod points;
mod read;
pub mod series;
pub(crate) mod sky;
pub mod solution;
mod stages;
pub mod sun_path;
#[cfg(feature = "reports")]
mod table;
mod text_table;
mod view3d;
pub mod voxels;
mod vtu;

use serde::Serialize;

pub use description::Description;
pub use error::ReportError;
#[cfg(feature = "cli")]
pub(crate) use file::by_ending;
#[cfg(feature = "reports")]
pub use machine::{Machine, load_average};
pub use memory::{memory_available_byte, memory_peak_byte, memory_used_byte};
pub use stages::StageTimes;
#[cfg(feature = "reports")]
pub use table::Table;
#[cfg(feature = "reports")]
pub(crate) use table::{Cell, table};

/// The version of the JSON documents of the program and of experiments; it changes when a key changes its name or its meaning.
pub const SCHEMA_VERSION: u32 = 2;

/// Returns a document as JSON text with indents, members in the order of their names.
///
/// # Panics
/// If a map of the document has keys that are not text.
#[must_use]
pub fn pretty(document: &impl Serialize) -> String {
    let value = serde_json::to_value(document).expect("keys are text");
    format!("{value:#}")
}
