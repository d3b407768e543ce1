//! Repairs of form factors: reciprocity, row sums, and the choice of a repair.

mod balance;
mod closure;
mod need;
mod pooled;

pub use balance::BalanceReport;
pub use need::{Need, RepairKind, Sampling};
