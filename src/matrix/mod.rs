//! Form factors: stored, checked, repaired and applied.
//!
//! A method emits [`RowTile`]s, [`FormFactors`] stores them, and a solver sees a [`LinearOperator`](operator::LinearOperator). Code outside
//! this module must not assume that all of F lies in one piece of memory.

mod backend;
mod bounds;
mod checks;
mod choice;
mod components;
mod disk;
mod error;
mod exchange;
mod form_factors;
mod kernel;
mod open;
pub mod operator;
mod product;
mod regroup;
mod repair;
mod rows;
#[cfg(test)]
mod shares;
mod square;
mod surfaces;
mod symmetric;
mod team;
mod tile;
mod together;
mod transpose;

pub use checks::{Checks, Closed, MinMax, RowTargets};
pub use choice::{Among, Layout, Place, Precision, Scratch, StorageChoice};
pub use error::{DiskError, MatrixError};
pub use form_factors::FormFactors;
pub use repair::{BalanceReport, Need, RepairKind, Sampling};
pub use surfaces::{SurfaceFormFactors, SurfaceRow, SurfaceRows};
pub use team::Team;
pub use tile::{Entry, RayWeights, RowTally, RowTile};

pub(crate) use bounds::UpperBounds;
pub(crate) use components::connected;
pub(crate) use form_factors::UPPER_ROWS;
pub(crate) use kernel::coefficients::{Coefficients, ROWS_AT_ONCE, products};
pub(crate) use kernel::lanes::weighted_products;
pub(crate) use product::roundings;
pub(crate) use transpose::{ENTRIES_AT_ONCE, RowBlock};
