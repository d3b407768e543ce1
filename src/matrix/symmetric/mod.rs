//! Symmetric matrices: the upper triangle in square tiles, each applied together with its transpose.

mod pass;
mod tiles;

#[cfg(all(test, unix))]
pub(super) use tiles::row_of_tiles;
pub(super) use tiles::{from_blocks, from_rows, row_factors};
