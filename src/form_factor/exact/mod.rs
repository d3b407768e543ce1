//! `exact`: every form factor to a tolerance, shadows included: by clipping, and by rays where that would cost far more.

mod batch;
mod batches;
mod compute;
mod corners;
mod faces;
mod grids;
mod lattice;
mod method;
mod patches;
mod sample;
mod split;
mod stated;
mod table;
mod tables;
mod views;
mod walk;

pub(super) use method::ENTRY;
pub use method::{BUDGET, ExactMethod};
pub(super) use split::Split;
