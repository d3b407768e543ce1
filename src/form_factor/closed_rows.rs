//! Which rows of form factors sum to 1 by the shape of the scene.

use glam::DVec3;

use super::Input;
use crate::geometry::box_pairs::overlapping_pairs;
use crate::mesh::PatchId;
use crate::scene::topology;

/// Tells of each patch whether all of its light arrives at fronts, so that its row sums to 1, \[n\]: of none in a scene that has an open piece of surface.
///
/// Its front is to lie in a region that closed pieces bound, as their winding numbers around it tell, and where no patch has its back: a room, but not
/// the open space around it, nor one with a block in it that is wound inwards. Where pieces touch or pierce one another, part of them lies inside of another piece and sees its
/// backs alone, such as the floor under a box and the bottom of the box: a patch counts only if its bounding box is clear of those of the patches of all other pieces, so that
/// all of it lies on one side of them. The others' rows sum to something from 0 to 1.
///
/// Work: O(n log n).
#[must_use]
pub fn closed_rows(input: Input<'_>) -> Vec<bool> {
    let (scene, mesh) = (input.scene, input.mesh);
    let n = mesh.n_patches();
    let piece_of_face = topology::closed_pieces(scene);
    if piece_of_face.contains(&None) {
        return vec![false; n];
    }
    let middles: Vec<_> = mesh.patches.iter().map(|patch| (patch.face, patch.centroid)).collect();
    let mut closed = topology::see_fronts_alone(&topology::sides(scene, &piece_of_face, &middles));
    let margin = DVec3::splat(0.5 * topology::touching(scene));
    let ids = || (0_u32..).take(n).map(PatchId);
    let boxes = ids().map(|patch| {
        let corners = mesh.polygon(patch);
        let (low, high) = corners
            .iter()
            .fold((corners[0], corners[0]), |(low, high), &v| (low.min(v), high.max(v)));
        (low - margin, high + margin)
    });
    let piece = |patch: u32| piece_of_face[mesh.patches[patch as usize].face.0 as usize];
    overlapping_pairs(boxes.collect(), |a, b| {
        if piece(a) != piece(b) {
            closed[a as usize] = false;
            closed[b as usize] = false;
        }
    });
    closed
}
