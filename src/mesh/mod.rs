//! Patches: the faces of a scene, subdivided, with the vertices that carry interpolated values.

mod grid;
mod hash;
pub mod hierarchy;
mod patch;
mod planes;
mod subdivide;

pub use hierarchy::{Hierarchy, Prolongation};
pub use patch::{Patch, PatchId, PatchPoint};
pub use subdivide::{MeshError, Subdivision};

use glam::DVec3;

use crate::matrix::operator::Block;
use crate::scene::{FaceId, Scene};
use grid::FaceGrid;

/// All patches of a scene, contiguous per face and in the order of the faces.
///
/// Vertices are shared between neighbouring patches of the same plane only: a value interpolated from them has no
/// crack inside a flat surface and stays sharp at a crease. Two flat faces that share an edge are cut in the same
/// places along it, whatever the [`Subdivision`].
#[derive(Clone, Debug)]
pub struct Mesh {
    /// The patches: the unknowns.
    pub patches: Vec<Patch>,
    /// Positions of the vertices, in m. A position stands more than once where planes meet.
    pub vertices: Vec<DVec3>,
    grids: Vec<FaceGrid>,
}

impl Mesh {
    /// Cuts the faces of `scene` into patches.
    ///
    /// # Errors
    /// [`MeshError`] if the subdivision is not a positive number, or makes more patches than 32-bit ids can name.
    pub fn new(scene: &Scene, subdivision: Subdivision) -> Result<Self, MeshError> {
        subdivide::subdivide(scene, subdivision)
    }

    /// Returns n, the number of patches.
    #[must_use]
    pub fn n_patches(&self) -> usize {
        self.patches.len()
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

    /// Returns, for every vertex, the mean of `per_patch` over the patches that share it, weighted by area.
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
            for &vertex in patch.corners.as_slice() {
                areas[vertex as usize] += patch.area;
                for (sum, value) in sums.row_mut(vertex as usize).iter_mut().zip(per_patch.row(i)) {
                    *sum += patch.area * value;
                }
            }
        }
        for (vertex, area) in areas.iter().enumerate() {
            sums.row_mut(vertex).iter_mut().for_each(|sum| *sum /= area);
        }
        sums
    }
}

#[cfg(test)]
mod tests;
