//! Form factors: stored, checked, repaired and applied.
//!
//! A method emits [`RowTile`]s, [`FormFactors`] keeps them, and a solver sees a [`LinearOperator`](operator::LinearOperator). Nothing outside of
//! this module may assume that all of F lies in one piece of memory.

mod aligned;
mod balance;
mod blocks;
mod both;
mod checks;
mod closure;
mod coefficients;
mod components;
mod dense;
mod disk;
mod error;
mod exchange;
mod expand;
mod gather;
mod lanes;
mod listed;
mod need;
mod open;
pub mod operator;
mod panels;
mod pass;
mod places;
mod planes;
mod pooled;
mod prefetch;
mod product;
mod regroup;
mod shared;
mod sparse;
mod square;
mod store;
mod surfaces;
mod symmetric;
mod tile;
mod transpose;

pub use balance::{BalanceReport, Weighting};
pub use checks::{Checks, Closed, MinMax, RowTargets};
pub use disk::{DiskError, Place, Scratch};
pub use error::MatrixError;
pub use need::{Need, RepairKind, Sampling};
pub use surfaces::{SurfaceFormFactors, SurfaceRow, SurfaceRows};
pub use tile::{Entry, RayWeights, RowTally, RowTile};

use std::sync::Arc;

pub(crate) use coefficients::{Coefficients, ROWS_AT_ONCE, products};
pub(crate) use components::connected;
use disk::General;
pub(crate) use lanes::weighted_products;
use open::Open;
pub(crate) use open::UpperBounds;
use regroup::Regrouped;
use store::Store;
use symmetric::Symmetric;

/// How a matrix is laid out in memory: tile by tile, where a tile is a range of rows, or 64 by 64 places of a symmetric matrix,
/// of which only the upper triangle is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

/// How many digits of each form factor are kept. Sums are f64 in either case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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

/// Layout, precision and place of stored form factors. Standard errors, where there are any, are stored in f32 beside them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StorageChoice<'a> {
    /// Dense, sparse, or whichever suits each tile.
    pub layout: Layout,
    /// f32 or f64.
    pub precision: Precision,
    /// In memory or on a disk.
    pub place: Place<'a>,
}

/// The form factors F_ij of n patches, the standard errors of their estimates, and the tallies of the rays that they come from.
///
/// F_ij is the fraction of the light leaving patch i that reaches patch j. Stored as tiles of rows, each dense or sparse.
/// A matrix made by [`from_exchange_tiles`](Self::from_exchange_tiles), [`symmetrised`](Self::symmetrised) or
/// [`balanced`](Self::balanced) stores the upper triangle of the exchange areas A_i F_ij instead, divided by the largest area: they
/// are symmetric to the last bit in any [`Precision`], take half the memory, and every tile is applied together with its transpose.
/// A clone shares the tiles.
///
/// With [`Place::Disk`] the entries lie in a scratch file, which goes when the last clone does, and everything else works as before: a pass
/// reads the file once, what goes row by row keeps 64 rows a thread. Where the file cannot be read, or is not what was written, numbers are
/// NaN from then on, and [`failure`](Self::failure) tells why.
#[doc(alias = "view factor")]
#[derive(Clone, Debug)]
pub struct FormFactors {
    areas: Vec<f64>,
    entries: Entries,
    tallies: Vec<RowTally>,
    layout: Layout,
    precision: Precision,
    /// What rays leave open of entries that are not stored; `None` if these are 0 for certain.
    open: Option<Open>,
}

#[derive(Clone, Debug)]
enum Entries {
    /// F_ij, by rows.
    Rows {
        tiles: Vec<Arc<dyn Store>>,
        /// The first row of each tile, ascending.
        first_rows: Vec<usize>,
    },
    /// s_ij = A_i F_ij / max A.
    Symmetric {
        exchange: Arc<dyn Symmetric>,
        /// f_i = max A / A_i: F_ij = f_i s_ij.
        row_factors: Vec<f64>,
    },
    /// F_ij, on a disk.
    Disk(Arc<dyn General>),
}

impl FormFactors {
    /// Stores the form factors that a method emitted.
    ///
    /// `areas` in m², one per patch; `tiles` in order and complete. Every tile is stored as it comes.
    ///
    /// # Errors
    /// [`MatrixError`] if there is no patch, an area is not positive and finite, the tiles are not the rows 0 to n − 1 in order,
    /// a column names no patch, a value is not finite (in the precision asked for), or a standard error is negative.
    pub fn from_tiles(
        areas: Vec<f64>,
        tiles: impl IntoIterator<Item = RowTile>,
        storage: StorageChoice<'_>,
    ) -> Result<Self, MatrixError> {
        let n = areas.len();
        expect_areas(&areas)?;
        if let Place::Disk(scratch) = storage.place {
            return Self::to_disk(areas, tiles, storage, scratch);
        }
        let (mut stored, mut first_rows, mut tallies) = (Vec::new(), Vec::new(), Vec::with_capacity(n));
        for tile in tiles {
            if tile.n_rows() == 0 {
                continue;
            }
            if tile.first_row() != tallies.len() {
                let (expected, found) = (tallies.len(), tile.first_row());
                return Err(MatrixError::TileOrder { expected, found });
            }
            first_rows.push(tile.first_row());
            stored.push(store::store(&tile, n, storage)?);
            tallies.extend_from_slice(tile.tallies());
        }
        if tallies.len() != n {
            let (expected, found) = (n, tallies.len());
            return Err(MatrixError::RowCount { expected, found });
        }
        Ok(Self {
            areas,
            entries: Entries::Rows {
                tiles: stored,
                first_rows,
            },
            tallies,
            layout: storage.layout,
            precision: storage.precision,
            open: None,
        })
    }

    fn to_disk(
        areas: Vec<f64>,
        tiles: impl IntoIterator<Item = RowTile>,
        storage: StorageChoice<'_>,
        scratch: Scratch<'_>,
    ) -> Result<Self, MatrixError> {
        let n = areas.len();
        let mut rows = Regrouped::new(tiles.into_iter());
        let mut tallies = Vec::with_capacity(n);
        let blocks = symmetric::block_rows(n).map(|range| {
            let mut block = RowTile::new(range.start);
            for _ in range {
                let (tile, k) = rows.next_row(n)?;
                block.push_row(tile.row(k), tile.tallies()[k]);
                tallies.push(tile.tallies()[k]);
            }
            Ok::<_, MatrixError>(block)
        });
        let entries = Entries::Disk(disk::from_rows(n, storage, scratch, blocks)?);
        rows.expect_end(n)?;
        Ok(Self {
            areas,
            entries,
            tallies,
            layout: storage.layout,
            precision: storage.precision,
            open: None,
        })
    }

    /// Stores form factors that are symmetric as exchange areas, from those on and above the diagonal.
    ///
    /// `upper` yields tiles of [`UPPER_ROWS`] rows (the last may have fewer) with entries F_ij, j ≥ i; `E` is its error.
    pub(crate) fn from_upper_rows<E: From<MatrixError> + Send>(
        areas: Vec<f64>,
        tallies: Vec<RowTally>,
        upper: impl Iterator<Item = Result<RowTile, E>>,
        storage: StorageChoice<'_>,
    ) -> Result<Self, E> {
        expect_areas(&areas)?;
        let factors = row_factors(&areas);
        let scaled = upper.map(|tile| {
            let tile: RowTile = tile?;
            let mut exchange = RowTile::new(tile.first_row());
            let mut entries = Vec::new();
            for k in 0..tile.n_rows() {
                let factor = factors[tile.first_row() + k];
                entries.clear();
                entries.extend(
                    tile.row(k)
                        .iter()
                        .map(|&(j, value, error)| (j, value / factor, error / factor)),
                );
                exchange.push_row(&entries, RowTally::default());
            }
            Ok::<_, E>(exchange)
        });
        let exchange = symmetric::from_rows(areas.len(), storage, scaled)?;
        Ok(Self::from_symmetric(areas, exchange, tallies, storage))
    }

    /// Puts symmetric form factors together from exchange areas divided by the largest area.
    fn from_symmetric(
        areas: Vec<f64>,
        exchange: Arc<dyn Symmetric>,
        tallies: Vec<RowTally>,
        storage: StorageChoice<'_>,
    ) -> Self {
        let row_factors = row_factors(&areas);
        Self {
            areas,
            entries: Entries::Symmetric { exchange, row_factors },
            tallies,
            layout: storage.layout,
            precision: storage.precision,
            open: None,
        }
    }

    /// Returns n, the number of patches.
    #[must_use]
    pub fn n_rows(&self) -> usize {
        self.areas.len()
    }

    /// Returns the areas A_i, m².
    #[must_use]
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// Returns the tallies of the rays, one per row; after a repair they are still those of the rows before it.
    #[must_use]
    pub fn tallies(&self) -> &[RowTally] {
        &self.tallies
    }

    /// Returns layout, precision and place of what is stored.
    #[must_use]
    pub fn storage(&self) -> StorageChoice<'_> {
        let place = match &self.entries {
            Entries::Rows { .. } => Place::default(),
            Entries::Symmetric { exchange, .. } => exchange.place(),
            Entries::Disk(general) => general.place(),
        };
        StorageChoice {
            layout: self.layout,
            precision: self.precision,
            place,
        }
    }

    /// Returns what went wrong first when the entries were read from a disk, or `None`: then all numbers that were returned are right.
    #[must_use]
    pub fn failure(&self) -> Option<&DiskError> {
        match &self.entries {
            Entries::Rows { .. } => None,
            Entries::Symmetric { exchange, .. } => exchange.failure(),
            Entries::Disk(general) => general.failure(),
        }
    }

    /// Returns `value`, unless entries that it may rest on could not be read.
    pub(crate) fn if_readable<R>(&self, value: R) -> Result<R, DiskError> {
        self.failure().map_or(Ok(value), |error| Err(error.clone()))
    }

    /// Returns true if the exchange areas are stored, and so are symmetric to the last bit.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        matches!(self.entries, Entries::Symmetric { .. })
    }

    /// Returns F_ij.
    ///
    /// # Panics
    /// If i or j is not less than n.
    #[must_use]
    #[track_caller]
    pub fn get(&self, i: usize, j: usize) -> f64 {
        self.stored(i, j).map_or(0.0, |entry| entry.0)
    }

    /// Returns the standard error of F_ij; 0 where it is exact or unknown.
    ///
    /// An entry that none of a row's N rays hit is off by up to 1.5 / N, or by the factor without occluders where that is less; 0 states that the
    /// patches do not face each other, or are proved to be hidden.
    /// Accuracy: rounded to f32 where it is stored.
    ///
    /// # Panics
    /// If i or j is not less than n.
    #[must_use]
    #[track_caller]
    pub fn std_error(&self, i: usize, j: usize) -> f64 {
        self.stored(i, j).map_or_else(|| self.open_entry(i, j), |entry| entry.1)
    }

    #[track_caller]
    fn stored(&self, i: usize, j: usize) -> Option<(f64, f64)> {
        assert!(i < self.n_rows() && j < self.n_rows(), "a place inside the matrix");
        let mut found = None;
        let factor = self.row_factor(i);
        self.for_each_stored(i, j..j + 1, &mut |_, value, std_error| {
            found = Some((factor * value, factor * std_error));
        });
        found
    }

    /// Calls `visit(j, F_ij, standard error)` in ascending order of j for all entries of row i that are stored: where one of the two is not zero, but for those that
    /// no ray hit, which [`open_error`](Self::open_error) counts together and [`for_each_error_in_row`](Self::for_each_error_in_row) visits too.
    ///
    /// # Panics
    /// If i is not less than n.
    #[track_caller]
    pub fn for_each_in_row(&self, i: usize, mut visit: impl FnMut(usize, f64, f64)) {
        let factor = self.row_factor(i);
        let visit_scaled = &mut |j, value, std_error| visit(j, factor * value, factor * std_error);
        self.for_each_stored(i, 0..self.n_rows(), visit_scaled);
    }

    /// Returns Σ_j F_ij.
    ///
    /// # Panics
    /// If i is not less than n.
    #[must_use]
    #[track_caller]
    pub fn row_sum(&self, i: usize) -> f64 {
        let mut sum = 0.0;
        self.for_each_in_row(i, |_, value, _| sum += value);
        sum
    }

    /// Returns Σ_j F_ij of every row.
    #[must_use]
    pub fn row_sums(&self) -> Vec<f64> {
        (0..self.n_rows()).map(|i| self.row_sum(i)).collect()
    }

    /// Returns the share of entries that are not zero.
    #[must_use]
    pub fn density(&self) -> f64 {
        let n_nonzero = match &self.entries {
            Entries::Rows { tiles, .. } => tiles.iter().map(|tile| tile.n_nonzero()).sum(),
            Entries::Symmetric { exchange, .. } => exchange.n_nonzero(),
            Entries::Disk(general) => general.n_nonzero(),
        };
        n_nonzero as f64 / (self.n_rows() as f64).powi(2)
    }

    /// Returns the bytes that entries and standard errors take, in memory or on the disk.
    #[must_use]
    pub fn stored_byte(&self) -> usize {
        match &self.entries {
            Entries::Rows { tiles, .. } => tiles.iter().map(|tile| tile.stored_byte()).sum(),
            Entries::Symmetric { exchange, .. } => exchange.stored_byte(),
            Entries::Disk(general) => general.stored_byte(),
        }
    }

    fn row_factor(&self, i: usize) -> f64 {
        match &self.entries {
            Entries::Rows { .. } | Entries::Disk(_) => 1.0,
            Entries::Symmetric { row_factors, .. } => row_factors[i],
        }
    }

    /// Visits what is stored in the columns `columns` of row i, without the row's factor.
    #[track_caller]
    fn for_each_stored(&self, i: usize, columns: std::ops::Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        match &self.entries {
            Entries::Rows { tiles, first_rows } => {
                let (tile, row) = locate(tiles, first_rows, i);
                tile.for_each(row, columns, visit);
            }
            Entries::Symmetric { exchange, .. } => exchange.for_each(i, columns, visit),
            Entries::Disk(general) => general.for_each(i, columns, visit),
        }
    }
}

/// Returns the tile of row i, and the number of the row in it.
#[track_caller]
fn locate<'a>(tiles: &'a [Arc<dyn Store>], first_rows: &[usize], i: usize) -> (&'a dyn Store, usize) {
    let tile = first_rows.partition_point(|&first| first <= i) - 1;
    (&*tiles[tile], i - first_rows[tile])
}

fn expect_areas(areas: &[f64]) -> Result<(), MatrixError> {
    let n_rows = areas.len();
    if n_rows == 0 {
        return Err(MatrixError::Empty);
    }
    if u32::try_from(n_rows).is_err() {
        return Err(MatrixError::TooManyRows { n_rows });
    }
    match areas.iter().position(|a| !(a.is_finite() && *a > 0.0)) {
        Some(row) => Err(MatrixError::Area { row, area: areas[row] }),
        None => Ok(()),
    }
}

/// Returns f_i = max A / A_i.
fn row_factors(areas: &[f64]) -> Vec<f64> {
    let area_max = areas.iter().copied().fold(0.0, f64::max);
    areas.iter().map(|a| area_max / a).collect()
}

/// The rows of a tile of symmetric form factors.
pub(crate) const UPPER_ROWS: usize = square::SIDE;

/// Returns how many roundings a term of F x takes part in at most, n being the number of patches: see the [`LinearOperator`] of [`FormFactors`].
pub(crate) fn roundings(n: usize) -> f64 {
    let n = n as f64;
    (16.0 * n.sqrt()).max(n / 8.0).min(n) + 70.0
}
