//! `exact`: every form factor to a tolerance, shadows included: by clipping, and by rays where these take less time.

mod batch;
mod batches;
mod compute;
mod corners;
mod faces;
mod grids;
mod lattice;
mod method;
mod patches;
mod row_tolerance;
mod sample;
mod shared;
mod split;
mod stated;
mod table;
mod tables;
mod views;
mod walk;

pub(super) use method::ENTRY;
pub use method::{BUDGET, ExactMethod};
pub use row_tolerance::{ExactRows, ROW_TOLERANCE, worst_row};
pub(super) use split::Split;
