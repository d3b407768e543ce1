//! Matrices on a disk: tiles of 64 by 64 places in a scratch file, read back with positioned reads.
//!
//! The file has no name from the start, so nothing is left of it when the process ends, however that happens. What says where each
//! tile lies, how long it is, and which checksum it has, stays in memory: 32 bytes for up to 4096 entries. Of a row of tiles the
//! numbers come first and the standard errors after them, so that a pass reads numbers alone.

mod bands;
mod error;
mod grid;
#[cfg(all(test, unix))]
mod tests;
mod tile_file;

pub(super) use bands::Band;
pub use error::DiskError;
pub(super) use grid::{General, for_each_block, from_rows, visit_nothing_known};
pub(super) use tile_file::{Part, TileFile};

use std::path::Path;

/// Where on a disk a matrix is kept, and how much memory may be spent on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scratch<'a> {
    /// The directory in which the scratch file is made. It should lie on a disk: a directory that the system keeps in memory saves none.
    pub directory: &'a Path,
    /// The memory that computed rows may take while they wait to be written. Threads that read take up to 64 rows each beside it.
    pub memory_byte: u64,
}

/// Where numbers are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place<'a> {
    /// In memory.
    Memory {
        /// The memory that computed rows may take while they wait to be stored.
        waiting_byte: u64,
    },
    /// In a scratch file.
    Disk(Scratch<'a>),
}

impl Default for Place<'_> {
    /// In memory, with 256 MB for rows that wait: so many that threads seldom wait for one another, and little beside a large matrix.
    fn default() -> Self {
        Self::Memory {
            waiting_byte: 256_000_000,
        }
    }
}

impl Place<'_> {
    /// Returns true if the numbers go to a scratch file.
    #[must_use]
    pub fn is_on_disk(self) -> bool {
        matches!(self, Self::Disk(_))
    }

    /// Returns the memory that computed rows may take while they wait to be stored.
    pub(crate) fn waiting_byte(self) -> u64 {
        match self {
            Self::Memory { waiting_byte } => waiting_byte,
            Self::Disk(scratch) => scratch.memory_byte,
        }
    }
}
