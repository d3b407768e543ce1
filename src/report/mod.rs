//! What was done, how well, how long it took, and what was left out.

pub mod csv;
mod stages;

pub use stages::{StageTimes, memory_peak_byte};
