//! Patches: the faces of a scene, subdivided, with the vertices that carry interpolated values.

mod contact_edges;
mod grid;
mod hash;
pub mod hierarchy;
mod patch;
mod pieces;
mod planes;
mod seams;
mod subdivide;

pub use contact_edges::{ContactEdges, CrossedPatch};
pub use hierarchy::{Hierarchy, Prolongation};
pub use patch::{Patch, PatchId, PatchPoint};
pub use subdivide::{MeshError, MeshOptions, Subdivision};

use std::collections::HashMap;

use glam::DVec3;

use crate::matrix::operator::Block;
use crate::scene::{Corners, FaceId, Pose, Scene};
use grid::FaceGrid;
use seams::Seams;
pub(crate) use seams::mean_value_weights;

/// All patches of a scene, contiguous per face and in the order of the faces.
///
/// Vertices are shared between neighbouring patches of the same plane only, and not where a contact edge runs between them: a value interpolated from them has no
/// crack inside a flat surface, stays sharp at a crease, and does not leak from one room into another. Two flat faces that share an edge are cut in the same
/// places along it, whatever the [`Subdivision`]; where a long edge lies beside shorter ones (a T-junction), as beside faces that [end at contact edges](MeshOptions::cut_at_walls),
/// [interpolation](Self::interpolate) sees the vertices of both sides.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// The patches: the unknowns.
    pub patches: Vec<Patch>,
    /// Positions of the vertices, in m. A position stands more than once where planes meet.
    pub vertices: Vec<DVec3>,
    grids: Vec<FaceGrid>,
    seams: Seams,
}

impl Mesh {
    /// Cuts the faces of `scene` into patches, by a [`Subdivision`] or more [options](MeshOptions).
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
        let mut mesh = subdivide::subdivide(options.into(), contact_edges)?;
        mesh.join(contact_edges);
        Ok(mesh)
    }

    /// Parts vertices where contact edges run between patches, and finds where patches meet that do not share all vertices.
    fn join(&mut self, contact_edges: &ContactEdges<'_>) {
        contact_edges::part(self, contact_edges);
        self.seams = Seams::find(self, contact_edges);
    }

    /// Returns how many patches [`at_contact_edges`](Self::at_contact_edges) makes, without making them.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn count(contact_edges: &ContactEdges<'_>, options: impl Into<MeshOptions>) -> Result<u64, MeshError> {
        subdivide::count(options.into(), contact_edges)
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

    /// Returns n, the number of patches.
    #[must_use]
    pub fn n_patches(&self) -> usize {
        self.patches.len()
    }

    /// Returns how far the contact edges at which a face is cut are off its plane, in m, or `None` of a face that is not cut: the corners of its patches are known no better than that, nor than those of the
    /// faces that stand on it.
    pub(crate) fn misfit(&self, face: FaceId) -> Option<f64> {
        self.grids[face.0 as usize].misfit()
    }

    /// Returns how many faces are cut at contact edges: see [`MeshOptions::cut_at_walls`].
    #[must_use]
    pub fn n_cut_faces(&self) -> usize {
        self.grids.iter().filter(|grid| grid.misfit().is_some()).count()
    }

    /// Returns the areas A_i in m², in patch order.
    #[must_use]
    pub fn areas(&self) -> Vec<f64> {
        self.patches.iter().map(|p| p.area).collect()
    }

    /// Returns the corner positions of a patch.
    #[must_use]
    pub fn polygon(&self, patch: PatchId) -> Vec<DVec3> {
        let corners = &self.patches[patch.0 as usize].corners;
        corners.as_slice().iter().map(|&v| self.vertices[v as usize]).collect()
    }

    /// Returns the patch at local coordinates (u, v) of a face, as ray queries report them
    /// (see [`Visibility::closest_hits`](crate::visibility::Visibility::closest_hits)).
    #[must_use]
    pub fn patch_at(&self, face: FaceId, u: f64, v: f64) -> PatchId {
        self.grids[face.0 as usize].patch_at(u, v)
    }

    /// Returns the patch at local coordinates (u, v) of a face, and the weights of its corners there.
    ///
    /// The weights are barycentric in a triangle and bilinear in a quad; they are in \[0, 1\] and sum to 1.
    #[must_use]
    pub fn locate(&self, face: FaceId, u: f64, v: f64) -> PatchPoint {
        self.grids[face.0 as usize].locate(u, v)
    }

    /// Returns, for every vertex, the mean of `per_patch` over the patches that it lies on the border of, weighted by area.
    ///
    /// Shapes: \[n_patches, c\] to \[n_vertices, c\]. A constant stays that constant to rounding, and no value leaves the
    /// range of its patches. Second order in the patch size inside a flat surface, first order along its border.
    ///
    /// # Panics
    /// If `per_patch` does not have one row per patch.
    #[must_use]
    #[track_caller]
    pub fn vertex_values(&self, per_patch: &Block) -> Block {
        assert_eq!(per_patch.n_rows(), self.n_patches(), "one row per patch");
        let n_channels = per_patch.n_channels();
        let mut sums = Block::zeros(self.vertices.len(), n_channels);
        let mut areas = vec![0.0; self.vertices.len()];
        for (i, patch) in self.patches.iter().enumerate() {
            let id = PatchId::from_index(i).0;
            let corners = patch.corners;
            let own = self.seams.outlines.get(&id).map_or(corners.as_slice(), Vec::as_slice);
            for &vertex in own {
                let vertex = self.seams.of(vertex) as usize;
                areas[vertex] += patch.area;
                for (sum, value) in sums.row_mut(vertex).iter_mut().zip(per_patch.row(i)) {
                    *sum += patch.area * value;
                }
            }
        }
        for (vertex, area) in areas.iter().enumerate() {
            if *area > 0.0 {
                sums.row_mut(vertex).iter_mut().for_each(|sum| *sum /= area);
            }
        }
        for (&vertex, &other) in &self.seams.same {
            let value = sums.row(other as usize).to_vec();
            sums.row_mut(vertex as usize).copy_from_slice(&value);
        }
        sums
    }

    /// Calls `visit(vertex, weight)` for the [vertex values](Self::vertex_values) that make up the value at a point of a patch; the weights are in \[0, 1\] and sum to 1.
    ///
    /// The weights of the corners, and where vertices of neighbours hang on the patch's edges, mean value coordinates of its outline: continuous over all patches of
    /// a plane that meet along a line, to rounding, and linear along their edges.
    pub fn interpolate(&self, at: &PatchPoint, mut visit: impl FnMut(usize, f64)) {
        let corners = self.patches[at.patch.0 as usize].corners;
        let weighted = || corners.as_slice().iter().zip(at.weights);
        let Some(outline) = self.seams.outlines.get(&at.patch.0) else {
            weighted().for_each(|(&vertex, weight)| visit(vertex as usize, weight));
            return;
        };
        let place = |vertex: u32| self.vertices[vertex as usize];
        let point = weighted().map(|(&vertex, weight)| weight * place(vertex)).sum();
        let positions: Vec<DVec3> = outline.iter().map(|&vertex| place(vertex)).collect();
        seams::mean_value_weights(&positions, point, |k, weight| visit(outline[k] as usize, weight));
    }
}

#[cfg(test)]
mod tests;
