//! The stored form factors between the patches of a scene.

use std::sync::Arc;

use super::backend::{Backend, Filling};
use super::bounds::Open;
use super::choice::{Among, Layout, Place, Precision, StorageChoice};
use super::error::{DiskError, MatrixError};
use super::kernel::sizes::{SIDE, block_rows};
use super::regroup::{Regrouped, expect_next};
use super::rows::Rows;
use super::symmetric::row_factors;
use super::tile::{RowTally, RowTile};
use super::together::Together;
use super::{disk, symmetric};

/// The form factors F_ij of n patches, the standard errors of their estimates, and the tallies of their rays.
///
/// F_ij is the fraction of the light leaving patch i that reaches patch j. Stored as tiles of rows, each dense or sparse.
/// A matrix made by [`from_exchange_tiles`](Self::from_exchange_tiles), [`symmetrised`](Self::symmetrised) or
/// [`balanced`](Self::balanced) stores the upper triangle of the exchange areas A_i F_ij instead, divided by the largest area: they
/// are symmetric to the last bit in any [`Precision`], take half the memory, and every tile is applied together with its transpose.
/// A clone shares the tiles.
///
/// With [`Place::Disk`] the entries are in a scratch file, which is deleted with the last clone; all functions work as in memory: a pass
/// reads the file once, and functions that read row by row hold 64 rows a thread. Where the file cannot be read, or has changed, numbers are
/// NaN from then on, and [`failure`](Self::failure) returns the reason.
///
/// With [`StorageChoice::ranks`] several ranks work on the rows, and each stores a part in memory. A row is read on the rank that stores it; products, sums, checks and repairs are collective.
#[doc(alias = "view factor")]
#[derive(Clone, Debug)]
pub struct FormFactors {
    pub(super) areas: Vec<f64>,
    pub(super) entries: Arc<dyn Backend>,
    pub(super) tallies: Vec<RowTally>,
    layout: Layout,
    precision: Precision,
    /// The error of entries that are not stored; `None` if these are 0 for certain.
    pub(super) open: Option<Open>,
    /// The ranks that work on the rows; `None` for this process alone.
    pub(super) together: Option<Arc<Together>>,
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
        let mut filling = filling(n, storage)?;
        let mut tallies = Vec::with_capacity(n);
        let mut push = |tile: &RowTile| {
            tallies.extend_from_slice(tile.tallies());
            filling.push(tile)
        };
        if storage.place.is_on_disk() {
            let mut rows = Regrouped::new(tiles.into_iter());
            block_rows(n).try_for_each(|range| push(&rows.next_rows(range, n)?))?;
            rows.expect_end(n)?;
        } else {
            let mut n_rows = 0;
            for tile in tiles.into_iter().filter(|tile| tile.n_rows() > 0) {
                expect_next(n_rows, &tile)?;
                push(&tile)?;
                n_rows += tile.n_rows();
            }
            if n_rows != n {
                let (expected, found) = (n, n_rows);
                return Err(MatrixError::RowCount { expected, found });
            }
        }
        Ok(Self::of(areas, filling.finish(), tallies, storage))
    }

    /// Stores this rank's rows, of several ranks: `give` adds blocks of [`SIDE`] rows in order. Collective.
    pub(super) fn from_own_rows(
        areas: Vec<f64>,
        tallies: Vec<RowTally>,
        storage: StorageChoice<'_>,
        give: impl FnOnce(&mut dyn FnMut(&RowTile) -> Result<(), MatrixError>) -> Result<(), MatrixError>,
    ) -> Result<Self, MatrixError> {
        let mut rows = filling(areas.len(), storage)?;
        give(&mut |tile| rows.push(tile))?;
        Ok(Self::of(areas, rows.finish(), tallies, storage))
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
        let scaled = upper.map(|tile| tile.map(|tile| tile.divided(|i| factors[i])));
        let entries = symmetric::from_rows(&areas, storage, scaled)?;
        Ok(Self::of(areas, entries, tallies, storage))
    }

    /// Makes form factors from stored entries.
    pub(super) fn of(
        areas: Vec<f64>,
        entries: Arc<dyn Backend>,
        tallies: Vec<RowTally>,
        storage: StorageChoice<'_>,
    ) -> Self {
        Self {
            areas,
            entries,
            tallies,
            layout: storage.layout,
            precision: storage.precision,
            open: None,
            together: storage.ranks.map(|among| Arc::new(Together::new(among.0))),
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

    /// Returns the layout, precision and place of the storage.
    #[must_use]
    pub fn storage(&self) -> StorageChoice<'_> {
        StorageChoice {
            layout: self.layout,
            precision: self.precision,
            place: self.entries.place(),
            ranks: self.together.as_ref().map(|together| Among(&together.team)),
        }
    }

    /// Returns the first failure to read entries from a disk, or `None`: then all numbers that were returned are right.
    #[must_use]
    pub fn failure(&self) -> Option<&DiskError> {
        self.entries.failure().or_else(|| self.by_rows().failure())
    }

    /// Returns `value`, unless entries that it may rest on could not be read.
    pub(crate) fn if_readable<R>(&self, value: R) -> Result<R, DiskError> {
        self.failure().map_or(Ok(value), |error| Err(error.clone()))
    }

    /// Returns true if the exchange areas are stored, and so are symmetric to the last bit.
    #[must_use]
    pub fn is_symmetric(&self) -> bool {
        self.entries.row_factors().is_some()
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
    /// An entry that none of a row's N rays hit has an error of up to 1.5 / N, or of the factor without occluders where that is less; 0 means that the
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
        self.for_each_number(i, j..j + 1, &mut |_, value, std_error| {
            found = Some((factor * value, factor * std_error));
        });
        found
    }

    /// Calls `visit(j, F_ij, standard error)` in ascending order of j for all stored entries of row i, of which one of the two is not zero.
    ///
    /// Entries that no ray hit are left out: [`open_error`](Self::open_error) counts them together, and [`for_each_error_in_row`](Self::for_each_error_in_row) visits them too.
    ///
    /// # Panics
    /// If i is not less than n.
    #[track_caller]
    pub fn for_each_in_row(&self, i: usize, mut visit: impl FnMut(usize, f64, f64)) {
        let factor = self.row_factor(i);
        let visit_scaled = &mut |j, value, std_error| visit(j, factor * value, factor * std_error);
        self.for_each_number(i, 0..self.n_rows(), visit_scaled);
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
        self.numbers_of_rows(|i| [self.row_sum(i)]).into_flattened()
    }

    /// Returns the share of entries that are not zero.
    #[must_use]
    pub fn density(&self) -> f64 {
        self.entries.sizes().n_nonzero as f64 / (self.n_rows() as f64).powi(2)
    }

    /// Returns the bytes of entries and standard errors, in memory or on the disk, where one process stores all of them.
    #[must_use]
    pub fn stored_byte(&self) -> usize {
        self.entries.sizes().stored_byte
    }

    pub(super) fn row_factor(&self, i: usize) -> f64 {
        self.entries.row_factors().map_or(1.0, |factors| factors[i])
    }
}

/// Returns an n by n matrix without rows.
fn filling(n: usize, storage: StorageChoice<'_>) -> Result<Box<dyn Filling>, DiskError> {
    Ok(match storage.place {
        Place::Memory { .. } => Box::new(Rows::new(n, storage)),
        Place::Disk(scratch) => disk::fill(n, storage, scratch)?,
    })
}

pub(super) fn expect_areas(areas: &[f64]) -> Result<(), MatrixError> {
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

/// The rows of a tile of symmetric form factors.
pub(crate) const UPPER_ROWS: usize = SIDE;
