//! Patches that lie flat on another face, such as the bottom of a block on a ground.

use super::candidates::{Outline, Sheets};
use crate::form_factor::Input;
use crate::mesh::PatchId;
use crate::scene::topology::Pieces;
use crate::threads;

/// Returns for each patch the share of its area that lies on a face, \[n\].
///
/// A patch of a closed piece and a face of an open one, of opposite winding and in one plane, lie on each other: the block stands on the ground.
/// Between two faces of open pieces nothing tells this from the two sides of a sheet, each of which sees its own side of the world; a face of a closed piece has its own inside, whose backs the other sees.
///
/// Work: O(n log n).
pub(in crate::form_factor) fn shares_on_faces(input: Input<'_>) -> Vec<f64> {
    let scene = input.scene;
    let n = input.mesh.n_patches();
    let pieces = Pieces::of(scene);
    let is_closed: Vec<bool> = scene.face_ids().map(|face| pieces.closed(face).is_some()).collect();
    let is_mixed = is_closed.contains(&true) && is_closed.contains(&false);
    if input.unoccluded || !is_mixed {
        return vec![0.0; n];
    }
    let outlines: Vec<Outline> = scene.face_ids().map(|face| Outline::new(scene.polygon(face))).collect();
    let sheets = Sheets::new(scene, &outlines);
    threads::collect(n, |i| {
        if is_closed[input.mesh.patches[i].face.0 as usize] {
            sheets.share_on(input.mesh.polygon(PatchId::from_index(i)), |other| !is_closed[other])
        } else {
            0.0
        }
    })
}
