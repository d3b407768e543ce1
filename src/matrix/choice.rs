//! The storage of form factors: layout, precision and place.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::team::Team;

/// The share of non-zero entries from which a tile is stored in full, rows as well as squares.
///
/// At a half, entries alone take 0.53 of the memory and 0.6 to 0.7 of the time of a pass where they lie in runs,
/// 0.8 to 1.0 where they do not (three channels: 0.75 to 0.9 and 1.1); in a cache rows take 1.0 to 1.3 times as long, and sweeps by rows of squares take 2.0 to 2.3 times as long
/// (f32, AVX-512; `cargo bench --bench matrix -- f32 1/2`, with 1536 for a cache).
const DENSE_FROM: f64 = 0.5;

/// How a matrix is laid out in memory: tile by tile.
///
/// A tile is a range of rows, or 64 by 64 places of a symmetric matrix, of which only the upper triangle is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// Dense for tiles that are at least half non-zero, else sparse.
    #[default]
    Auto,
    /// All places: 8 bytes each in f64, 4 in f32; half of that for a symmetric matrix.
    Dense,
    /// Entries that are not zero: 8 bytes each in f64, 4 in f32. By rows, 6 more for each sixteen columns that have any, or, where these are less than six on average, 4 more for each entry.
    /// In a symmetric matrix, where half of the entries are stored, and on a disk: 2 more for each sixteen places beside one another that have any, and 16 for each strip of sixteen
    /// columns and 64 rows that has.
    Sparse,
}

impl Layout {
    /// Returns true if a tile of `n_places` with `n_entries` is stored in full.
    pub(in crate::matrix) fn is_full(self, n_entries: usize, n_places: usize) -> bool {
        match self {
            Self::Dense => true,
            Self::Sparse => false,
            Self::Auto => n_entries as f64 >= DENSE_FROM * n_places as f64,
        }
    }
}

/// How many digits of each form factor are kept. Sums are f64 in either case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// 24 bits: each form factor is rounded by at most 6e-8 of itself, radiosities by at most 6e-8 / (1 − ρ). Roundings mostly cancel: the radiosities of a closed
    /// room of 400 patches, one of them lit, change by 5e-10, 2e-9 and 5e-8 (relative, area-weighted) with ρ = 0.5, 0.99 and
    /// 0.9999, in the end like 1 / (1 − ρ). Where patches are equal they are rounded alike: in a cube of 1280 squares by 2.4e-9 / (1 − ρ), in
    /// other closed boxes by up to 3e-8 / (1 − ρ), half of the bound.
    F32,
    /// 53 bits.
    #[default]
    F64,
}

/// Layout, precision and place of stored form factors; their standard errors are stored in f32 beside them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StorageChoice<'a> {
    /// Dense, sparse, or whichever suits each tile.
    pub layout: Layout,
    /// f32 or f64.
    pub precision: Precision,
    /// In memory or on a disk.
    pub place: Place<'a>,
    /// The ranks that work on the matrix together; `None` for this process alone.
    pub ranks: Option<Among<'a>>,
}

/// The ranks that work on a matrix together.
///
/// Each works on a [range of rows](Team::new). In memory a rank stores its own rows or, of exchange areas, the tiles that these need: on K ranks at most 2 / K of those of one process. A matrix on a disk is stored whole by each rank.
/// Functions that read the whole matrix are then collective: each rank calls them in the same order.
#[derive(Clone, Copy, Debug)]
pub struct Among<'a>(pub &'a Arc<Team>);

impl PartialEq for Among<'_> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(self.0, other.0)
    }
}

impl Eq for Among<'_> {}

/// The place of a matrix on a disk, and the memory that may be spent on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scratch<'a> {
    /// The directory in which the scratch file is made. It should lie on a disk: a directory that the system keeps in memory saves none.
    pub directory: &'a Path,
    /// The memory that computed rows may take while they wait to be written. Threads that read take up to 64 rows each beside it.
    pub memory_byte: u64,
}

/// The place of the numbers.
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
    /// In memory, with 256 MB for rows that wait: enough that threads seldom wait for one another, and little beside a large matrix.
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
