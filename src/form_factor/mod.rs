//! Form factors F_ij: the fraction of the light leaving patch i that reaches patch j.
//!
//! F_ij = 1/A_i ∫_{A_i} ∫_{A_j} V cos θ_i cos θ_j / (π r²) dA_j dA_i, dimensionless, in \[0, 1\].
//!
//! Each method is one file behind [`FormFactorMethod`]; [`compute`] runs a method over all rows in parallel.

pub mod partial;
mod sg;
mod shooting;
mod sr;

pub use sg::GaussShooting;
pub use sr::RandomShooting;

use std::ops::Range;

use rayon::prelude::*;

use crate::matrix::{FormFactors, MatrixError, RowTile, StorageChoice};
use crate::mesh::Mesh;
use crate::progress::Progress;
use crate::visibility::Visibility;

/// What every method works on.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The patches.
    pub mesh: &'a Mesh,
    /// Who sees whom.
    pub visibility: &'a dyn Visibility,
}

/// A way to compute form factors, row by row.
pub trait FormFactorMethod: Sync {
    /// Returns the name on the command line.
    fn name(&self) -> &'static str;

    /// Returns the number of rays that the method traces for each patch, as far as that does not depend on the scene.
    fn rays_per_patch(&self) -> u64;

    /// Computes the rows of the patches `rows`; the result depends on nothing but the input and the method's settings.
    fn row_tile(&self, input: Input<'_>, rows: Range<usize>) -> RowTile;
}

/// The number of rows that are computed as one piece of parallel work.
const ROWS_PER_TILE: usize = 16;

/// Computes all form factors of a mesh.
///
/// Tiles of rows are computed in parallel and stored in order: equal settings give equal bytes at any number of threads.
///
/// # Errors
/// [`MatrixError`] if there is no patch, or a value does not fit the precision of the storage.
pub fn compute(
    method: &dyn FormFactorMethod,
    input: Input<'_>,
    storage: StorageChoice,
    progress: &dyn Progress,
) -> Result<FormFactors, MatrixError> {
    let n = input.mesh.n_patches();
    progress.begin("form factors", n as u64);
    let tiles: Vec<RowTile> = (0..n.div_ceil(ROWS_PER_TILE))
        .into_par_iter()
        .map(|tile| {
            let rows = tile * ROWS_PER_TILE..n.min((tile + 1) * ROWS_PER_TILE);
            let n_rows = rows.len() as u64;
            let result = method.row_tile(input, rows);
            progress.advance(n_rows);
            result
        })
        .collect();
    FormFactors::from_tiles(input.mesh.areas(), tiles, storage)
}
