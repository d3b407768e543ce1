//! The memory of the form factors of a scene, in each layout.

use serde::Serialize;

use super::reference::ReferenceValues;
use super::{ExperimentError, Reference};
use crate::form_factor::{ExactMethod, FormFactorMethod, Input};
use crate::matrix::{FormFactors, Layout, MatrixError, RowTally, RowTile, StorageChoice};
use crate::progress::Progress;

/// The size of a matrix of form factors, without standard errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StorageFigures {
    /// N, the number of patches.
    pub n_patches: usize,
    /// N², the number of entries ([`LEWIS_1992`](crate::references::LEWIS_1992), table 1).
    pub n_entries: u64,
    /// The share of entries that are not zero.
    pub density: f64,
    /// The bytes of all entries.
    pub dense_bytes: u64,
    /// The bytes of the exchange areas on and above the diagonal, in squares, each as full or as sparse as suits it: half of the others for large N.
    pub symmetric_bytes: u64,
    /// The bytes of the non-zero entries, stored by row, each with its column.
    pub sparse_bytes: u64,
    /// The tolerance of the run of [`ExactMethod`] whose entries were counted, or `None` if they were the reference's own.
    pub tolerance: Option<f64>,
}

/// Stores the form factors of a scene in each layout and returns their sizes, in the precision and the place of `storage`.
///
/// The entries are those of the reference, or those of a run of [`ExactMethod`] if the reference is between surfaces only.
///
/// # Errors
/// [`ExperimentError`] if the run fails, or a disk does.
pub fn storage_figures(
    input: Input<'_>,
    reference: &Reference,
    storage: StorageChoice<'_>,
    progress: &dyn Progress,
) -> Result<StorageFigures, ExperimentError> {
    let computed;
    let (factors, tolerance) = match &reference.values {
        ReferenceValues::Patches(factors) => (factors, None),
        ReferenceValues::Surfaces(_) => {
            let exact = ExactMethod::default();
            computed = exact
                .compute(input, storage, progress)
                .map_err(ExperimentError::Reference)?;
            (&computed.factors, Some(exact.tolerance))
        }
    };
    let n = factors.n_rows();
    let stored =
        |layout| FormFactors::from_tiles(input.mesh.areas(), tiles(factors), StorageChoice { layout, ..storage });
    let sparse = stored(Layout::Sparse)?;
    let (density, sparse_bytes) = (sparse.density(), sparse.stored_byte() as u64);
    drop(sparse);
    let dense_bytes = stored(Layout::Dense)?.stored_byte() as u64;
    let symmetric = stored(Layout::Auto)?.symmetrised()?;
    factors.if_readable(()).map_err(MatrixError::from)?;
    Ok(StorageFigures {
        n_patches: n,
        n_entries: (n as u64) * (n as u64),
        density,
        dense_bytes,
        symmetric_bytes: symmetric.stored_byte() as u64,
        sparse_bytes,
        tolerance,
    })
}

/// The number of rows that are stored as one tile.
const ROWS: usize = 32;

/// Returns the entries that are not zero, without their errors.
fn tiles(factors: &FormFactors) -> impl Iterator<Item = RowTile> {
    let n = factors.n_rows();
    (0..n).step_by(ROWS).map(move |first| {
        let mut tile = RowTile::new(first);
        let mut entries = Vec::new();
        for i in first..n.min(first + ROWS) {
            entries.clear();
            factors.for_each_in_row(i, |j, value, _| {
                if value != 0.0
                    && let Ok(column) = u32::try_from(j)
                {
                    entries.push((column, value, 0.0));
                }
            });
            tile.push_row(&entries, RowTally::default());
        }
        tile
    })
}
