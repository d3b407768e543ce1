//! The form factors that the links stand for, as an operator that all solvers take.

use rayon::prelude::*;

use super::discretize::VoxelScene;
use super::links::{Links, ROWS_PER_CHUNK, for_each_seen};
use super::sphere::DiscreteSphere;
use super::weights::{RowWeights, Weights};
use crate::matrix::operator::{Block, LinearOperator, RowAccess};

/// An operator whose rows can be computed range by range, for propagation in place.
pub trait Gather: LinearOperator {
    /// Computes Σ_v B(I(x, v)) cos θ A for the unknowns from `first` on, one row of `sums` each, on all threads.
    ///
    /// Where links cannot be read the sums are not numbers, so that no solver takes them for light; see [`Links::failure`].
    fn gather(&self, first: usize, x: &Block, sums: &mut [f64]);

    /// Returns the areas of the unknowns, m².
    fn areas(&self) -> Vec<f64>;

    /// Returns the number of rows that are best computed together; ranges should begin at its multiples.
    fn rows_at_once(&self) -> usize;
}

/// F of the discrete equation: (F B)(x) = Σ_v B(I(x, v)) cos θ(x, v) A(v) over the directions in front of x.
///
/// Rows are gathered, not reciprocal: A_i F_ij differs from A_j F_ji by the sampling of directions.
///
/// Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), equation (2). Departures: rows divided by their own sum, unless told otherwise.
pub struct LinkOperator<'a> {
    scene: &'a VoxelScene,
    links: &'a Links,
    weights: Weights<'a>,
}

impl<'a> LinkOperator<'a> {
    /// Puts links and weights together; all must come from the same scene and sphere.
    #[must_use]
    pub fn new(scene: &'a VoxelScene, sphere: &'a DiscreteSphere, links: &'a Links, row_weights: RowWeights) -> Self {
        Self {
            scene,
            links,
            weights: Weights::new(scene, sphere, row_weights),
        }
    }

    /// Returns the scene.
    #[must_use]
    pub fn scene(&self) -> &'a VoxelScene {
        self.scene
    }
}

/// Adds Σ_v B(I(x, v)) cos θ A of a surfel's links to `sums`, one per channel; `unknown` tells which row of `x` a surfel's radiosity is.
pub(super) fn gather_row(
    weights: &Weights<'_>,
    surfel: usize,
    row: &[u8],
    unknown: impl Fn(usize) -> usize,
    x: &Block,
    sums: &mut [f64],
) {
    weights.with(surfel, |of_link| match x.n_channels() {
        1 => gather_channels::<1>(row, surfel, of_link, unknown, x, sums),
        3 => gather_channels::<3>(row, surfel, of_link, unknown, x, sums),
        _ => for_each_seen(row, surfel, |k, seen| {
            for (sum, value) in sums.iter_mut().zip(x.row(unknown(seen))) {
                *sum += of_link[k] * value;
            }
        }),
    });
}

fn gather_channels<const C: usize>(
    row: &[u8],
    surfel: usize,
    weights: &[f64],
    unknown: impl Fn(usize) -> usize,
    x: &Block,
    sums: &mut [f64],
) {
    let values = x.values().as_chunks::<C>().0;
    let mut totals = [0.0; C];
    for_each_seen(row, surfel, |k, seen| {
        let weight = weights[k];
        for (total, value) in totals.iter_mut().zip(&values[unknown(seen)]) {
            *total += weight * value;
        }
    });
    for (sum, total) in sums.iter_mut().zip(totals) {
        *sum += total;
    }
}

impl LinearOperator for LinkOperator<'_> {
    fn n_rows(&self) -> usize {
        self.scene.n_surfels()
    }

    fn apply(&self, x: &Block, y: &mut Block) {
        self.gather(0, x, y.values_mut());
    }

    fn rows(&self) -> Option<&dyn RowAccess> {
        self.links.has_cheap_rows().then_some(self as &dyn RowAccess)
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        None
    }
}

impl Gather for LinkOperator<'_> {
    fn gather(&self, first: usize, x: &Block, sums: &mut [f64]) {
        let n_channels = x.n_channels();
        let end = first + sums.len() / n_channels;
        let mut rest = sums;
        let mut start = first;
        let mut pieces = Vec::new();
        while start < end {
            let stop = ((start / ROWS_PER_CHUNK + 1) * ROWS_PER_CHUNK).min(end);
            let (piece, more) = rest.split_at_mut((stop - start) * n_channels);
            pieces.push((start, piece));
            rest = more;
            start = stop;
        }
        pieces.into_par_iter().for_each(|(row_0, rows)| {
            let chunk = row_0 / ROWS_PER_CHUNK;
            let done = self.links.with_chunk(self.scene, chunk, |chunk| {
                // A part of a chunk is still work for several threads.
                rows.par_chunks_mut(n_channels)
                    .with_min_len(8)
                    .enumerate()
                    .for_each(|(k, row)| {
                        let surfel = row_0 + k;
                        row.fill(0.0);
                        let links = chunk.row(surfel % ROWS_PER_CHUNK);
                        gather_row(&self.weights, surfel, links, |seen| seen, x, row);
                    });
            });
            if done.is_none() {
                rows.fill(f64::NAN);
            }
        });
    }

    fn areas(&self) -> Vec<f64> {
        self.scene.areas()
    }

    fn rows_at_once(&self) -> usize {
        // Whole chunks: each is read, or found again, once a pass.
        ROWS_PER_CHUNK
    }
}

impl RowAccess for LinkOperator<'_> {
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let mut own = 0.0;
        self.links.with_chunk(self.scene, i / ROWS_PER_CHUNK, |chunk| {
            let row = chunk.row(i % ROWS_PER_CHUNK);
            gather_row(&self.weights, i, row, |seen| seen, x, sum);
            // Lines begin in front of a surfel, but a curved surface may still see itself.
            self.weights.with(i, |weights| {
                for_each_seen(row, i, |k, seen| {
                    if seen == i {
                        own += weights[k];
                    }
                });
            });
        });
        for (s, value) in sum.iter_mut().zip(x.row(i)) {
            *s -= own * value;
        }
        own
    }

    fn visit_row(&self, i: usize, visit: &mut dyn FnMut(usize, f64)) {
        let mut entries: Vec<(usize, f64)> = Vec::new();
        self.links.with_chunk(self.scene, i / ROWS_PER_CHUNK, |chunk| {
            let row = chunk.row(i % ROWS_PER_CHUNK);
            self.weights.with(i, |weights| {
                for_each_seen(row, i, |k, seen| entries.push((seen, weights[k])));
            });
        });
        // Several directions see one surfel.
        entries.sort_by_key(|entry| entry.0);
        for same in entries.chunk_by(|a, b| a.0 == b.0) {
            visit(same[0].0, same.iter().map(|entry| entry.1).sum());
        }
    }
}
