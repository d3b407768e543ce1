//! Patches that contact edges cross.

use glam::DVec3;

use super::contact_edges::ContactEdges;
use super::patch::PatchId;
use super::patches::Mesh;
use super::pieces::{Corner, Pieces};

/// A patch that contact edges cross: light that arrives on one side of them leaves on the other, a light leak.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossedPatch {
    /// The patch.
    pub patch: PatchId,
    /// Its pieces between the contact edges and the lines that extend them: triangles and convex quads, counter-clockwise, in m.
    pub pieces: Vec<Vec<DVec3>>,
}

impl ContactEdges<'_> {
    /// Returns the patches of a mesh of the scene that contact edges cross, in pieces between these.
    ///
    /// No patch of a mesh that is [cut](super::MeshOptions::cut_at_walls) is crossed, unless faces have moved since.
    #[must_use]
    pub fn crossed_patches(&self, mesh: &Mesh) -> Vec<CrossedPatch> {
        if mesh.patches.is_empty() || self.pieces().is_empty() {
            return Vec::new();
        }
        let crossed = mesh.patches.iter().enumerate().filter_map(|(i, patch)| {
            let here = self.found().on_face(patch.face.0)?;
            let id = PatchId::from_index(i);
            let outline = mesh.polygon(id);
            let near = here.near(&outline);
            let pieces = Pieces::cut(&outline, &near)?;
            let place = |piece: &Vec<Corner>| piece.iter().map(|corner| corner.place).collect();
            Some(CrossedPatch {
                patch: id,
                pieces: pieces.outlines.iter().map(place).collect(),
            })
        });
        crossed.collect()
    }
}
