//! Makes the mesh of a scene, and moves it to another pose.

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

    /// Cuts the faces of a scene whose contact edges are known into patches, as [`new`](Self::new) does.
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

    /// Separates vertices where contact edges run between patches, and finds where patches meet without sharing all vertices.
    fn join(&mut self, contact_edges: &ContactEdges<'_>) {
        part(self, contact_edges);
        self.seams = find_seams(self, contact_edges);
    }

    /// Returns the number of patches of [`at_contact_edges`](Self::at_contact_edges), without making them.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn count(contact_edges: &ContactEdges<'_>, options: impl Into<MeshOptions>) -> Result<u64, MeshError> {
        count(options.into(), contact_edges)
    }

    /// Returns the patches with their surfaces in a pose; `scene` is the mesh's scene in that pose.
    ///
    /// They are the same patches in the same order, wherever they move.
    /// Patches that do not move keep their corners to the last bit, and all keep their areas, as in a rigid motion. Vertices stay shared, but
    /// not between moving and resting patches. Faces stay cut where contact edges [crossed them](MeshOptions::cut_at_walls) in the mesh's scene, and are
    /// not cut at new contact edges: [`ContactEdges::crossed_patches`] finds those.
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
