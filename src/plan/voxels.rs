//! Estimates the memory of voxels and their links before they are made.

use super::whole;
use crate::geometry::polygon;
use crate::scene::Scene;
use crate::voxel::Grid;

/// Bytes of a surfel while a scene is cut into voxels; 110 to 145 were measured, with those of its first vectors.
const SURFEL_BYTE: f64 = 160.0;

/// Bytes of a face while gaps and distances are computed; 630 were measured.
const FACE_BYTE: f64 = 720.0;

/// Bytes of a brick of 64 voxels in the octree, and while it is built.
const BRICK_BYTE: f64 = 24.0;

/// The number of vectors of surfels for propagation, each of all channels: exitance, emission, reflectance, the light before and after, and those of the audit.
const VECTORS: f64 = 10.0;

/// The same with a solver, which stores some more.
const SOLVER_VECTORS: f64 = 25.0;

/// Bytes of a link; 1.3 to 2.0 were measured, with fewer for more directions.
const LINK_BYTE: f64 = 2.3;

/// Bytes of a surfel in a file of voxels while it is written; 180 to 230 were measured.
const WRITTEN_BYTE: f64 = 256.0;

/// The number of surfels for each thread whose links are computed together before they are written.
const SURFELS_PER_THREAD: f64 = 8.0 * 256.0;

/// The input of the estimate, once the scene is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelDemand {
    /// The number of surfels.
    pub n_surfels: usize,
    /// The number of directions of the discrete sphere.
    pub n_directions: usize,
    /// The number of channels of the light.
    pub n_channels: usize,
    /// The number of threads that work at the same time.
    pub n_threads: usize,
    /// True if a solver replaces propagation.
    pub solved: bool,
    /// True if the voxels are written to a file.
    pub written: bool,
}

impl VoxelDemand {
    /// Returns the memory of links, in bytes: an upper bound, as half of all directions are in front of a surfel.
    #[must_use]
    pub fn link_byte(&self) -> u64 {
        whole(self.n_surfels as f64 * self.links_of_one())
    }

    /// Returns the memory of links while they are written to a file, in bytes.
    #[must_use]
    pub fn link_window_byte(&self) -> u64 {
        let at_once = (SURFELS_PER_THREAD * self.n_threads as f64).min(self.n_surfels as f64);
        // The threads hold a record beside the links from which it is made.
        whole(1.5 * at_once * self.links_of_one())
    }

    /// Returns the memory of vectors of surfels and of the file of voxels, in bytes.
    #[must_use]
    pub fn vector_byte(&self) -> u64 {
        let written = if self.written { WRITTEN_BYTE } else { 0.0 };
        let n_vectors = if self.solved { SOLVER_VECTORS } else { VECTORS };
        whole(self.n_surfels as f64 * (8.0 * n_vectors * self.n_channels as f64 + written))
    }

    fn links_of_one(&self) -> f64 {
        LINK_BYTE * self.n_directions as f64 / 2.0
    }
}

/// Returns the memory for cutting a scene into voxels, in bytes: an upper bound.
///
/// A face of area A and perimeter U has at most A / h² + U / h + 1 voxels of side h, as the pixels of its main axis cover no more than A.
#[must_use]
pub fn voxel_byte(scene: &Scene, grid: &Grid) -> u64 {
    let h = grid.voxel_size;
    let surfels: f64 = scene
        .face_ids()
        .map(|face| {
            let corners = scene.polygon(face);
            let next = corners.iter().cycle().skip(1);
            let perimeter: f64 = corners.iter().zip(next).map(|(a, b)| a.distance(*b)).sum();
            polygon::area_vector(&corners).length() / (h * h) + perimeter / h + 1.0
        })
        .sum();
    let bricks: f64 = grid.n_voxels.iter().map(|&n| (f64::from(n) / 4.0).ceil()).product();
    whole(SURFEL_BYTE * surfels + FACE_BYTE * scene.faces.len() as f64 + BRICK_BYTE * bricks)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::scene::builtin;
    use crate::voxel::{DiscreteSphere, Links, SolidAngle, VoxelScene};

    #[test]
    fn surfels_and_links_take_no_more_than_was_said() {
        for name in ["cube", "room-box", "sphere-room-r1", "corridor"] {
            let scene = builtin::build(name, None).unwrap().scene;
            for n in [8, 40] {
                let voxels = VoxelScene::new(&scene, n).unwrap();
                let said = voxel_byte(&scene, &voxels.grid);
                let n_surfels = voxels.n_surfels();
                assert!(said as f64 >= SURFEL_BYTE * n_surfels as f64, "{name} {n}: {n_surfels}");
                // Faces smaller than a voxel are merged, and the perimeter dominates for narrow faces; where faces are large, the bound is tight.
                let loose = said as f64 / (SURFEL_BYTE * n_surfels as f64);
                let has_large_faces = n == 40 && ["cube", "room-box"].contains(&name);
                assert!(!has_large_faces || loose < 1.5, "{name} {n}: {loose}");
                for radius in [2, 12] {
                    let sphere = DiscreteSphere::new(radius, SolidAngle::Centre).unwrap();
                    let demand = VoxelDemand {
                        n_surfels,
                        n_directions: sphere.directions().len(),
                        n_channels: 3,
                        n_threads: 2,
                        solved: false,
                        written: false,
                    };
                    let links = Links::in_memory(&voxels, &sphere, &Silent);
                    assert!(links.n_bytes() <= demand.link_byte(), "{name} {n} {radius}");
                }
            }
        }
    }
}
