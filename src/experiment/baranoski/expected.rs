//! The expected values of shooting in the cube: exact means, and exact covariances of the counts.

use std::num::NonZeroUsize;

use glam::DVec3;

use super::PairFactors;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::geometry::rectangle::rectangle_exchange_area;
use crate::geometry::sampling::{PointStream, Sequence};
use crate::mesh::{Mesh, PatchId};
use crate::threads;

/// The start of rays on a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Start {
    /// Independent random points.
    Random,
    /// A grid of q × q Gauss points.
    Gauss(NonZeroUsize),
}

/// The distribution of the form factors F_IJ with I < J of one run, and of their sums by face.
///
/// A run is a sum of independent counts. The rays of one stratum k (a patch, or a Gauss point of a patch) hit face J with probability p_kJ, and
/// F_IJ = Σ_k w_k (rays of k that hit J) / m_k, so that E F_IJ = Σ w_k p_kJ and
/// cov(F_IJ, F_IK) = Σ w_k² (δ_JK p_kJ − p_kJ p_kK) / m_k. The p_kJ are closed forms: of two rectangles, or of a point and a rectangle.
/// With tens of thousands of rays a face the counts are normal for all purposes here.
pub(super) struct Expected {
    /// The means E F_IJ, for I < J.
    pub(super) mean: PairFactors,
    /// For each face I the covariance of F_IJ, F_IK over J, K > I.
    covariance: [[[f64; 6]; 6]; 6],
}

struct Stratum {
    weight: f64,
    rays: f64,
    hits: [f64; 6],
}

impl Expected {
    /// Returns the distribution for the cube `mesh`, whose patches belong to the faces `face_of_patch`; `faces` are the whole faces' corners.
    pub(super) fn new(mesh: &Mesh, face_of_patch: &[usize], faces: &[Vec<DVec3>; 6], start: Start, rays: u64) -> Self {
        let n_patches_of_face = mesh.n_patches() as f64 / 6.0;
        let of_patch = |i: usize| -> Vec<Stratum> {
            let corners = mesh.polygon(PatchId::from_index(i));
            let (area, normal) = (mesh.patches[i].area, mesh.patches[i].normal);
            match start {
                Start::Random => {
                    let hit = |j: usize| rectangle_exchange_area(&corners, &faces[j]).unwrap_or(f64::NAN) / area;
                    vec![Stratum {
                        weight: 1.0 / n_patches_of_face,
                        rays: rays as f64,
                        hits: std::array::from_fn(hit),
                    }]
                }
                Start::Gauss(q) => {
                    let points = GaussProduct::new(q).on_polygon(&corners);
                    let rays_of_point = rays.div_ceil(points.len() as u64) as f64;
                    let stratum = |p: &WeightedPoint| Stratum {
                        weight: p.weight / n_patches_of_face,
                        rays: rays_of_point,
                        hits: std::array::from_fn(|j| point_form_factor(p.position, normal, &faces[j])),
                    };
                    points.iter().map(stratum).collect()
                }
            }
        };
        let strata_of_patches: Vec<Vec<Stratum>> = threads::collect(mesh.n_patches(), of_patch);
        let mut expected = Self {
            mean: [[0.0; 6]; 6],
            covariance: [[[0.0; 6]; 6]; 6],
        };
        for (i, strata) in strata_of_patches.iter().enumerate() {
            let face = face_of_patch[i];
            for stratum in strata {
                let hits = &stratum.hits;
                for j in face + 1..6 {
                    expected.mean[face][j] += stratum.weight * hits[j];
                    for k in face + 1..6 {
                        let same = if j == k { hits[j] } else { 0.0 };
                        expected.covariance[face][j][k] +=
                            stratum.weight.powi(2) * (same - hits[j] * hits[k]) / stratum.rays;
                    }
                }
            }
        }
        expected
    }

    /// Returns the standard deviation of F_IJ, I < J.
    pub(super) fn factor_sd(&self, i: usize, j: usize) -> f64 {
        self.covariance[i][j][j].max(0.0).sqrt()
    }

    /// Returns the mean of the sum of a face: Σ_{J<I} F_JI + Σ_{J>I} F_IJ.
    pub(super) fn sum_mean(&self, face: usize) -> f64 {
        super::face_sums(&self.mean)[face]
    }

    /// Returns the standard deviation of the sum of a face; 0 for the first, all of whose rays hit the others.
    pub(super) fn sum_sd(&self, face: usize) -> f64 {
        let of_others: f64 = (0..face).map(|i| self.covariance[i][face][face]).sum();
        let own: f64 = self.covariance[face].iter().flatten().sum();
        // The variance of face 1 is exactly 0; its covariances cancel only to rounding.
        let variance = of_others + own;
        if face == 0 { 0.0 } else { variance.max(0.0).sqrt() }
    }

    /// Draws sums of the faces with this distribution and returns 100 Σ |1 − sum| of each, ascending.
    pub(super) fn error_draws(&self, n_draws: usize) -> Vec<f64> {
        let roots: Vec<[[f64; 6]; 6]> = self.covariance.iter().map(square_root).collect();
        let mut normal = normal_numbers();
        let mut draws: Vec<f64> = (0..n_draws)
            .map(|_| {
                let mut factors = self.mean;
                for (row, root) in factors.iter_mut().zip(&roots) {
                    let z: [f64; 6] = std::array::from_fn(|_| normal.next().unwrap_or(0.0));
                    for (value, weights) in row.iter_mut().zip(root) {
                        *value += weights.iter().zip(z).map(|(w, z)| w * z).sum::<f64>();
                    }
                }
                super::error_percent(&super::face_sums(&factors))
            })
            .collect();
        draws.sort_by(f64::total_cmp);
        draws
    }
}

/// Returns the lower triangular L with L Lᵀ = C for a positive semidefinite C (Cholesky); columns of no variance are 0.
fn square_root(c: &[[f64; 6]; 6]) -> [[f64; 6]; 6] {
    let mut root = [[0.0; 6]; 6];
    for k in 0..6 {
        let pivot = c[k][k] - root[k].iter().map(|v| v * v).sum::<f64>();
        // A variance of 0 is left as rounding, by which the code must not divide.
        if pivot <= 1e-12 * c[k][k] {
            continue;
        }
        root[k][k] = pivot.sqrt();
        for i in k + 1..6 {
            let done: f64 = (0..k).map(|l| root[i][l] * root[k][l]).sum();
            root[i][k] = (c[i][k] - done) / root[k][k];
        }
    }
    root
}

/// Returns standard normal numbers by the transform of Box and Muller, from a fixed stream.
fn normal_numbers() -> impl Iterator<Item = f64> {
    let mut uniform = PointStream::new(Sequence::Random, 0, 0);
    let pair = |u: f64, v: f64| {
        let (radius, angle) = ((-2.0 * u.ln()).sqrt(), std::f64::consts::TAU * v);
        [radius * angle.sin(), radius * angle.cos()]
    };
    std::iter::repeat_with(move || uniform.next_point())
        .flat_map(move |[a, b, c, d]| [pair(c, d), pair(a, b)])
        .flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::statistics::Spread;

    #[test]
    fn a_square_root_squares_back_even_without_full_rank() {
        let mut c = [[0.0; 6]; 6];
        // A matrix of rank 2: a aᵀ + b bᵀ.
        let (a, b) = ([0.0, 1.0, 2.0, 0.5, 0.0, -1.0], [0.0, 0.3, -1.0, 2.0, 0.0, 1.0]);
        for i in 0..6 {
            for j in 0..6 {
                c[i][j] = a[i] * a[j] + b[i] * b[j];
            }
        }
        let root = square_root(&c);
        for i in 0..6 {
            for j in 0..6 {
                let product: f64 = (0..6).map(|k| root[i][k] * root[j][k]).sum();
                assert!((product - c[i][j]).abs() < 1e-12, "{i}, {j}: {product}, {}", c[i][j]);
            }
        }
    }

    #[test]
    fn normal_numbers_are_normal() {
        let values: Vec<f64> = normal_numbers().take(40_000).collect();
        let spread = Spread::of(&values);
        assert!(
            spread.mean.abs() < 4.0 / 200.0 && (spread.sd - 1.0).abs() < 4.0 / 283.0,
            "{spread:?}"
        );
        let beyond = values.iter().filter(|v| v.abs() > 1.959_964).count();
        assert!((beyond as f64 - 2000.0).abs() < 4.0 * 43.6, "{beyond}");
    }
}
