//! Which rows of the form factors of a watertight scene sum to 1.

use super::Input;
use crate::geometry::box_pairs::overlapping_pairs;
use crate::mesh::PatchId;
use crate::scene::topology;
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// Patches nearer to another piece than this share of the scene's size count as touching it: less than f32 resolves.
const TOUCHING: f64 = 1e-7;

/// Tells of each patch of a watertight scene whether all of its light arrives at fronts, so that its row sums to 1, \[n\].
///
/// Where pieces of surface touch or pierce one another, part of them lies inside of another piece and sees its backs alone, such as the floor under a box
/// and the bottom of the box. A patch counts if its bounding box is clear of those of the patches of all other pieces, so that all of it lies on one side
/// of them, and a ray from its middle meets a front first. The others' rows sum to something from 0 to 1.
///
/// Work: O(n log n), and a ray for each patch; none of it where the scene is one piece.
#[must_use]
pub fn closed_rows(input: Input<'_>) -> Vec<bool> {
    let (scene, mesh) = (input.scene, input.mesh);
    let n = mesh.n_patches();
    let piece_of_face = topology::closed_pieces(scene);
    if piece_of_face.contains(&None) {
        return vec![false; n];
    }
    if piece_of_face.iter().all(|&piece| piece == Some(0)) {
        return vec![true; n];
    }
    let (least, greatest) = scene.bounding_box();
    let margin = 0.5 * TOUCHING * least.abs().max(greatest.abs()).max_element();
    let ids = || (0_u32..).take(n).map(PatchId);
    let boxes = ids().map(|patch| {
        let corners = mesh.polygon(patch);
        let (low, high) = corners
            .iter()
            .fold((corners[0], corners[0]), |(low, high), &v| (low.min(v), high.max(v)));
        (low - margin, high + margin)
    });
    let piece = |patch: u32| piece_of_face[mesh.patches[patch as usize].face.0 as usize];
    let mut closed = vec![true; n];
    overlapping_pairs(boxes.collect(), |a, b| {
        if piece(a) != piece(b) {
            closed[a as usize] = false;
            closed[b as usize] = false;
        }
    });
    let mut rays = RayBatch::default();
    for patch in &mesh.patches {
        let lift = patch.normal * input.visibility.offset() - input.visibility.frame_origin();
        rays.push_ray(patch.centroid + lift, patch.normal);
    }
    let mut hits = HitBatch::default();
    input.visibility.closest_hits(&rays, Coherence::Incoherent, &mut hits);
    for (k, row) in closed.iter_mut().enumerate() {
        *row &= hits.face(k).is_some_and(|hit| !hit.back);
    }
    closed
}
