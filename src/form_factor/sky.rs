//! How much of the light of each patch escapes, as far as that is known.

use rayon::prelude::*;

use crate::matrix::FormFactors;
use crate::mesh::Mesh;
use crate::scene::{Scene, topology};

/// Returns of each patch the fraction of its light that escapes, \[n\]; `None` where nobody knows.
///
/// Rays that leave a patch are counted: the fraction is that of those that hit nothing. Without rays it is 0 in a watertight scene, and 1 − Σ_j F_ij, or 0 if that is negative, where
/// the patch cannot see any back (see [`may_see_backs`](topology::may_see_backs)), up to the error of the row. Elsewhere what is missing from a row may have met a back, which is
/// black, and so is not known to have escaped.
///
/// Work: a pass over the rows without rays, and at worst the square of the number of faces.
///
/// # Panics
/// If the mesh has not one patch for every row, or is not that of the scene.
#[must_use]
#[track_caller]
pub fn sky_factors(scene: &Scene, mesh: &Mesh, factors: &FormFactors) -> Vec<Option<f64>> {
    let tallies = factors.tallies();
    assert_eq!(mesh.n_patches(), tallies.len(), "one patch per row");
    let all_counted = tallies.iter().all(|tally| tally.escaped().is_some());
    let is_watertight = !all_counted && topology::is_watertight(scene);
    let sees_backs = if all_counted || is_watertight {
        Vec::new()
    } else {
        topology::may_see_backs(scene)
    };
    let without_rays = |i: usize| {
        if is_watertight {
            return Some(0.0);
        }
        let face = mesh.patches[i].face.0 as usize;
        (!sees_backs[face]).then(|| (1.0 - factors.row_sum(i)).max(0.0))
    };
    let rows = tallies.par_iter().enumerate();
    rows.map(|(i, tally)| tally.escaped().or_else(|| without_rays(i)))
        .collect()
}

/// Returns the area means of such fractions over each surface, \[n_surfaces\]; `None` where one of its patches has none, 0 of a surface without patches.
#[must_use]
pub fn sky_of_surfaces(sky: &[Option<f64>], mesh: &Mesh, n_surfaces: usize) -> Vec<Option<f64>> {
    let mut areas = vec![0.0; n_surfaces];
    for patch in &mesh.patches {
        areas[patch.surface.0 as usize] += patch.area;
    }
    let mut means = vec![Some(0.0); n_surfaces];
    for (patch, of_patch) in mesh.patches.iter().zip(sky) {
        let k = patch.surface.0 as usize;
        means[k] = means[k]
            .zip(*of_patch)
            .map(|(sum, own)| sum + patch.area / areas[k] * own);
    }
    means
}
