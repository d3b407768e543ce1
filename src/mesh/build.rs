//! From a scene to its mesh, and from one pose to another.

use std::collections::HashMap;

use super::contact_edges::ContactEdges;
use super::join::{find_seams, part};
use super::patch::PatchId;
use super::patches::Mesh;
use super::subdivide::{MeshError, MeshOptions, count, subdivide};
use crate::scene::{Corners, Pose, Scene};

impl Mesh {
    /// Cuts the faces of `scene` into patches, by a [`Subdivision`](super::Subdivision) or more [options](MeshOptions).
    ///
    /// # Errors
    /// [`MeshError`] if the subdivision is not a positive number, or makes more patches than 32-bit ids can name.
    pub fn new(scene: &Scene, options: impl Into<MeshOptions>) -> Result<Self, MeshError> {
        Self::at_contact_edges(&ContactEdges::of(scene), options)
    }

    /// Cuts the faces of a scene whose contact edges are at hand into patches, as [`new`](Self::new) does.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn at_contact_edges(
        contact_edges: &ContactEdges<'_>,
        options: impl Into<MeshOptions>,
    ) -> Result<Self, MeshError> {
        let mut mesh = subdivide(options.into(), contact_edges)?;
        mesh.join(contact_edges);
        Ok(mesh)
    }

    /// Parts vertices where contact edges run between patches, and finds where patches meet that do not share all vertices.
    fn join(&mut self, contact_edges: &ContactEdges<'_>) {
        part(self, contact_edges);
        self.seams = find_seams(self, contact_edges);
    }

    /// Returns how many patches [`at_contact_edges`](Self::at_contact_edges) makes, without making them.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn count(contact_edges: &ContactEdges<'_>, options: impl Into<MeshOptions>) -> Result<u64, MeshError> {
        count(options.into(), contact_edges)
    }

    /// Returns the patches with their surfaces in a pose, of which `scene` is what the mesh's scene becomes: the same patches in the same order, wherever they go.
    ///
    /// Patches that do not move keep their corners to the last bit, and all keep their areas: a rigid motion does. Vertices are shared as before, but
    /// between what moves and what does not. Faces stay cut where contact edges [crossed them](MeshOptions::cut_at_walls) before, and are
    /// not cut where these come to: [`ContactEdges::crossed_patches`] finds those.
    #[must_use]
    pub fn posed(&self, pose: &Pose, scene: &Scene) -> Self {
        let mut posed = Self {
            vertices: Vec::with_capacity(self.vertices.len()),
            ..self.clone()
        };
        // Vertices of neighbours that move alike stay one vertex.
        let mut new_vertex: HashMap<(u32, [u64; 3]), u32> = HashMap::new();
        for patch in &mut posed.patches {
            let mut place = |corners: &mut [u32]| {
                for corner in corners {
                    let position = pose.point(patch.surface, self.vertices[*corner as usize]);
                    let key = (*corner, position.to_array().map(f64::to_bits));
                    *corner = *new_vertex.entry(key).or_insert_with(|| {
                        posed.vertices.push(position);
                        PatchId::from_index(posed.vertices.len() - 1).0
                    });
                }
            };
            match &mut patch.corners {
                Corners::Triangle(corners) => place(corners),
                Corners::Quad(corners) => place(corners),
            }
            if pose.moves(patch.surface) {
                patch.normal = pose.direction(patch.surface, patch.normal);
                patch.centroid = pose.point(patch.surface, patch.centroid);
            }
        }
        posed.join(&ContactEdges::of(scene));
        posed
    }
}
