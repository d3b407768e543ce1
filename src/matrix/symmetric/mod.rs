//! Symmetric matrices: the upper triangle in square tiles, each applied together with its transpose.

mod build;
mod pass;
mod tiles;

#[cfg(all(test, unix))]
pub(super) use build::row_of_tiles;
pub(super) use build::{from_blocks, from_parts, from_rows};
pub(super) use tiles::row_factors;
