//! Matrices on a disk: tiles of 64 by 64 places in a scratch file, read back with positioned reads.
//!
//! The file has no name from the start, so that it is gone when the process ends for any reason. The position,
//! length and checksum of each tile stay in memory: 32 bytes for up to 4096 entries. In a row of tiles the
//! numbers come first and the standard errors after them, so that a pass reads numbers alone.

mod grid;
#[cfg(all(test, unix))]
mod tests;
mod tile_file;

pub(super) use grid::fill;
pub(super) use tile_file::{Band, Part, TileFile, visit_nothing_known};
