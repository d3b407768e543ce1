//! How much memory the form factors of a scene take, in each layout.

use serde::Serialize;

use super::{ExperimentError, Reference, ReferenceLevel};
use crate::form_factor::{FormFactorMethod, Input, RandomShooting};
use crate::geometry::sampling::Sequence;
use crate::matrix::{FormFactors, Layout, Precision, RowTally, RowTile, StorageChoice, Weighting};
use crate::progress::Progress;

/// The size of a matrix of form factors, without standard errors, in f64.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StorageFigures {
    /// N, the number of patches.
    pub n_patches: usize,
    /// N², the number of entries ([`LEWIS_1992`](crate::references::LEWIS_1992), table 1).
    pub n_entries: u64,
    /// The share of entries that are not zero.
    pub density: f64,
    /// Memory in use with every entry stored.
    pub dense_byte: u64,
    /// Memory in use with the exchange areas on and above the diagonal stored in squares, each as full or as sparse as suits it: half of the others for large N.
    pub symmetric_byte: u64,
    /// Memory in use with the non-zero entries stored by row, each with its column.
    pub sparse_byte: u64,
    /// The rays of each patch of the run whose entries were counted, or `None` if they were the reference's own.
    pub rays: Option<u64>,
}

/// Rays of each patch where the reference is between surfaces only, so that patches must be looked at by themselves.
const RAYS: u64 = 16384;

/// Stores the form factors of a scene in each layout and returns what that takes.
///
/// The entries are those of the reference, or those of a run of `sr` where the reference knows whole surfaces only; such a run misses
/// pairs that its rays do not find.
///
/// # Errors
/// [`ExperimentError`] if the run fails.
pub fn storage_figures(
    input: Input<'_>,
    reference: &Reference,
    progress: &dyn Progress,
) -> Result<StorageFigures, ExperimentError> {
    let n = input.mesh.n_patches();
    let (values, rays) = match reference.level {
        ReferenceLevel::Patches => (reference.values.clone(), None),
        ReferenceLevel::Surfaces => {
            let method = RandomShooting {
                rays: RAYS,
                sequence: Sequence::Sobol,
                seed: u64::MAX,
            };
            let computed = method
                .compute(input, StorageChoice::default(), progress)
                .map_err(ExperimentError::Reference)?;
            let mut values = vec![0.0; n * n];
            for i in 0..n {
                computed
                    .factors
                    .for_each_in_row(i, |j, value, _| values[i * n + j] = value);
            }
            (values, Some(RAYS))
        }
    };
    let stored = |layout| -> Result<FormFactors, ExperimentError> {
        let tile = |first: usize| {
            let mut tile = RowTile::new(first);
            for row in values[first * n..].chunks(n).take(ROWS) {
                let entries = (0..).zip(row).filter(|(_, value)| **value != 0.0);
                let entries: Vec<(u32, f64, f64)> = entries.map(|(j, value)| (j, *value, 0.0)).collect();
                tile.push_row(&entries, RowTally::default());
            }
            tile
        };
        let precision = Precision::F64;
        let tiles = (0..n).step_by(ROWS).map(tile);
        Ok(FormFactors::from_tiles(
            input.mesh.areas(),
            tiles,
            StorageChoice {
                layout,
                precision,
                ..StorageChoice::default()
            },
        )?)
    };
    let (dense, sparse) = (stored(Layout::Dense)?, stored(Layout::Sparse)?);
    let symmetric = dense.symmetrised(Weighting::default())?;
    let n_entries = (n as u64) * (n as u64);
    Ok(StorageFigures {
        n_patches: n,
        n_entries,
        density: sparse.density(),
        dense_byte: dense.stored_byte() as u64,
        symmetric_byte: symmetric.stored_byte() as u64,
        sparse_byte: sparse.stored_byte() as u64,
        rays,
    })
}

/// Rows that are stored as one tile.
const ROWS: usize = 32;
