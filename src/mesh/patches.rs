//! The patches of a scene, and values between them.

use glam::DVec3;

use super::grid::FaceGrid;
use super::patch::{Patch, PatchId, PatchPoint};
use super::seams::{Seams, mean_value_weights};
use crate::matrix::operator::Block;
use crate::scene::FaceId;

/// All patches of a scene, contiguous per face and in the order of the faces.
///
/// Only neighbouring patches of the same plane share vertices, and not where a contact edge runs between them: a value interpolated from them has no
/// crack inside a flat surface, stays sharp at a crease, and does not leak from one enclosure into another. Two flat faces that share an edge are cut in the same
/// positions along it, whatever the [`Subdivision`](super::Subdivision); where a long edge lies beside shorter ones (a T-junction), as beside faces that [end at contact edges](super::MeshOptions::cut_at_walls),
/// [interpolation](Self::interpolate) uses the vertices of both sides.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// The patches: the unknowns.
    pub patches: Vec<Patch>,
    /// Positions of the vertices, in m; a position has several vertices where planes meet.
    pub vertices: Vec<DVec3>,
    pub(super) grids: Vec<FaceGrid>,
    pub(super) seams: Seams,
}

impl Mesh {
    /// Returns n, the number of patches.
    #[must_use]
    pub fn n_patches(&self) -> usize {
        self.patches.len()
    }

    /// Returns the greatest distance from a face's plane of the contact edges at which it is cut, in m; `None` for a face that is not cut.
    ///
    /// The corners of its patches are no more accurate than that, nor than those of the faces that stand on it.
    pub(crate) fn misfit(&self, face: FaceId) -> Option<f64> {
        self.grids[face.0 as usize].misfit()
    }

    /// Returns the number of faces cut at contact edges: see [`MeshOptions::cut_at_walls`](super::MeshOptions::cut_at_walls).
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

    /// Returns, for every vertex, the mean of `per_patch` over the patches on whose border it lies, weighted by area.
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
        mean_value_weights(&positions, point, |k, weight| visit(outline[k] as usize, weight));
    }
}
