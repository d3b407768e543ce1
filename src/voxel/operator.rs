//! The form factors that the links stand for, as an operator that all solvers take.

use std::sync::OnceLock;

use rayon::prelude::*;

use glam::DVec3;

use super::discretize::{Normal, VoxelScene};
use super::links::{Links, ROWS_PER_CHUNK, for_each_seen, is_in_front};
use super::sphere::DiscreteSphere;
use crate::matrix::operator::{Block, LinearOperator, RowAccess};

/// Whether the weights cos θ A of a surfel's directions are made to sum to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowWeights {
    /// Divided by their sum over the hemisphere, links that escape included: a closed scene keeps its energy.
    #[default]
    Normalised,
    /// As the paper prints them: sums are off by about 1e-3 at R = 30 (Lemma 1).
    Plain,
}

/// The memory up to which weights are kept for every normal, in bytes; beyond it they are calculated again for each row.
const KEPT_WEIGHTS: usize = 1 << 29;

/// F of the discrete equation: (F B)(x) = Σ_v B(I(x, v)) cos θ(x, v) A(v) over the directions in front of x.
///
/// Rows are gathered, not reciprocal: A_i F_ij differs from A_j F_ji by the sampling of directions.
///
/// Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), equation (2). Departures: rows divided by their own sum, unless told otherwise.
pub struct LinkOperator<'a> {
    scene: &'a VoxelScene,
    sphere: &'a DiscreteSphere,
    links: &'a Links,
    row_weights: RowWeights,
    /// By normal.
    weights: Vec<OnceLock<Vec<f64>>>,
    keeps_weights: bool,
}

impl<'a> LinkOperator<'a> {
    /// Puts links and weights together; all must come from the same scene and sphere.
    #[must_use]
    pub fn new(scene: &'a VoxelScene, sphere: &'a DiscreteSphere, links: &'a Links, row_weights: RowWeights) -> Self {
        let n_bytes = scene.normals.len() * sphere.directions().len() * size_of::<f64>();
        Self {
            scene,
            sphere,
            links,
            row_weights,
            weights: scene.normals.iter().map(|_| OnceLock::new()).collect(),
            keeps_weights: n_bytes <= KEPT_WEIGHTS,
        }
    }

    /// Returns the scene.
    #[must_use]
    pub fn scene(&self) -> &'a VoxelScene {
        self.scene
    }

    /// Computes Σ_v B(I(x, v)) cos θ A for surfels from `first` on, one row of `sums` each, on all threads.
    ///
    /// Where links cannot be read the sums are not numbers, so that no solver takes them for light; see [`Links::failure`].
    pub(super) fn gather(&self, first: usize, x: &Block, sums: &mut [f64]) {
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
        pieces.into_par_iter().for_each(|(start, rows)| {
            let chunk = start / ROWS_PER_CHUNK;
            let done = self.links.with_chunk(self.scene, chunk, |chunk| {
                // A part of a chunk is still work for several threads.
                rows.par_chunks_mut(n_channels)
                    .with_min_len(8)
                    .enumerate()
                    .for_each(|(k, row)| {
                        let surfel = start + k;
                        row.fill(0.0);
                        self.gather_row(surfel, chunk.row(surfel % ROWS_PER_CHUNK), x, row);
                    });
            });
            if done.is_none() {
                rows.fill(f64::NAN);
            }
        });
    }

    /// Adds Σ_v B(I(x, v)) cos θ A to `sums`, one per channel.
    fn gather_row(&self, surfel: usize, row: &[u8], x: &Block, sums: &mut [f64]) {
        self.with_weights(surfel, |weights| match x.n_channels() {
            1 => gather_channels::<1>(row, surfel, weights, x, sums),
            3 => gather_channels::<3>(row, surfel, weights, x, sums),
            _ => for_each_seen(row, surfel, |k, seen| {
                for (sum, value) in sums.iter_mut().zip(x.row(seen)) {
                    *sum += weights[k] * value;
                }
            }),
        });
    }

    /// Calls `work` with cos θ A of the directions in front of a surfel, in their order.
    fn with_weights<T>(&self, surfel: usize, work: impl FnOnce(&[f64]) -> T) -> T {
        let normal = self.scene.surfels[surfel].normal as usize;
        let calculate = || weights_of(&self.scene.normals[normal], self.sphere, self.row_weights);
        if self.keeps_weights {
            work(self.weights[normal].get_or_init(calculate))
        } else {
            work(&calculate())
        }
    }
}

fn gather_channels<const C: usize>(row: &[u8], surfel: usize, weights: &[f64], x: &Block, sums: &mut [f64]) {
    let values = x.values().as_chunks::<C>().0;
    let mut totals = [0.0; C];
    for_each_seen(row, surfel, |k, seen| {
        let weight = weights[k];
        for (total, value) in totals.iter_mut().zip(&values[seen]) {
            *total += weight * value;
        }
    });
    for (sum, total) in sums.iter_mut().zip(totals) {
        *sum += total;
    }
}

/// Returns cos θ A of the directions in front of a surface, in the sphere's order.
fn weights_of(normal: &Normal, sphere: &DiscreteSphere, row_weights: RowWeights) -> Vec<f64> {
    let in_front = sphere.directions().iter().filter(|d| is_in_front(normal, d.vector));
    let weight = |d: &super::SphereDirection| {
        let v = DVec3::from_array(d.vector.map(f64::from));
        // A direction that only rounding puts in front has no weight.
        d.weight * (normal.unit.dot(v) / v.length()).max(0.0)
    };
    let mut weights: Vec<f64> = in_front.map(weight).collect();
    if row_weights == RowWeights::Normalised {
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
    }
    weights
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

impl RowAccess for LinkOperator<'_> {
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        let mut own = 0.0;
        self.links.with_chunk(self.scene, i / ROWS_PER_CHUNK, |chunk| {
            let row = chunk.row(i % ROWS_PER_CHUNK);
            self.gather_row(i, row, x, sum);
            // Lines begin in front of a surfel, but a curved surface may still see itself.
            self.with_weights(i, |weights| {
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
            self.with_weights(i, |weights| {
                for_each_seen(row, i, |k, seen| entries.push((seen, weights[k])))
            });
        });
        // Several directions see one surfel.
        entries.sort_by_key(|entry| entry.0);
        for same in entries.chunk_by(|a, b| a.0 == b.0) {
            visit(same[0].0, same.iter().map(|entry| entry.1).sum());
        }
    }
}
