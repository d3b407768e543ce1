//! Finds the coincident patches on the two sides of a sheet.

use glam::DVec3;

use crate::mesh::{Mesh, PatchId};

/// A direction along which hardly any two centroids of an ordinary scene have the same height.
const ASKEW: DVec3 = DVec3::new(0.512_7, 0.618_1, 0.595_9);

/// The relative difference of the areas of coincident patches, beside the error of corners.
const ALIKE: f64 = 1e-6;

/// Returns for each of the `fronts` the coincident one of the `backs` that faces the other way, or `None`.
///
/// Corners that differ by less than `tolerance`, m, are one.
/// Work: O(n log n), unless many patches are level along one skew direction.
pub(super) fn opposites(mesh: &Mesh, fronts: &[usize], backs: &[usize], tolerance: f64) -> Vec<Option<usize>> {
    let level = |patch: usize| ASKEW.dot(mesh.patches[patch].centroid);
    let mut sorted: Vec<(f64, usize)> = backs.iter().map(|&back| (level(back), back)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    // The vector ASKEW has a length of about 1.
    let within = 2.0 * tolerance;
    let partner = |&front: &usize| {
        let own = level(front);
        let first = sorted.partition_point(|(other, _)| *other < own - within);
        let near = sorted[first..].iter().take_while(|(other, _)| *other <= own + within);
        let mut near = near.map(|&(_, back)| back);
        near.find(|&back| coincide(mesh, front, back, tolerance))
    };
    fronts.iter().map(partner).collect()
}

fn coincide(mesh: &Mesh, front: usize, back: usize, tolerance: f64) -> bool {
    let [a, b] = [front, back].map(|patch| &mesh.patches[patch]);
    let [own, other] = [front, back].map(|patch| mesh.polygon(PatchId::from_index(patch)));
    let allowed = ALIKE * a.area + tolerance * a.area.sqrt();
    let is_corner = |v: &DVec3| other.iter().any(|w| v.distance(*w) <= tolerance);
    a.normal.dot(b.normal) < 0.0 && (a.area - b.area).abs() <= allowed && own.iter().all(is_corner)
}
