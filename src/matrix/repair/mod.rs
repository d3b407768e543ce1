//! Repairs of form factors: reciprocity, row sums, and which of them which form factors need.

mod balance;
mod closure;
mod need;
mod pooled;

pub use balance::{BalanceReport, Weighting};
pub use need::{Need, RepairKind, Sampling};
