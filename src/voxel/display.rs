//! Interpolation of values from voxels to the scene's own surfaces.

use super::discretize::VoxelScene;
use super::grid::Voxel;
use crate::matrix::operator::Block;
use crate::mesh::Mesh;
use crate::threads;

/// The distance, in voxels, at which a surfel no longer counts; each point of a plane is within half of it of several surfels.
const REACH: f64 = 2.0;

/// The cosine of the angle between normals below which a surfel does not count for a patch.
const ALIKE: f64 = 0.7;

/// The greatest distance, in voxels, of the nearest surfel for patches without a surfel in reach.
const FAR: i32 = 6;

/// Returns values of surfels, such as irradiances, at the centroids of patches.
///
/// Each is the mean over the surfels of the same surface within two voxels whose normals are like the patch's, weighted by area and a hat
/// function of the distance, max(0, 1 − d/2): a constant stays that constant; second order inside a flat surface. A patch without any gets
/// the mean of those at the least distance, of any surface, up to 6 voxels away, and 0 beyond. Surfels that closed surfaces separate from the air in front of the patch do not count.
///
/// Shapes: \[n_surfels, c\] to \[n_patches, c\].
///
/// # Panics
/// If `values` has not one row per surfel.
#[must_use]
#[track_caller]
pub fn onto_patches(voxels: &VoxelScene, faces: &[crate::scene::Face], mesh: &Mesh, values: &Block) -> Block {
    assert_eq!(values.n_rows(), voxels.n_surfels(), "one row per surfel");
    let n_channels = values.n_channels();
    let of_patch = |patch: &crate::mesh::Patch| {
        let at = voxels.grid.to_lattice(patch.centroid);
        let home = voxels.grid.voxel_at(patch.centroid);
        let mut mean = Mean::new(n_channels);
        let is_beyond = |surfel: usize| voxels.is_parted_from(surfel, patch.centroid, patch.normal);
        each_surfel_within(voxels, home, 2, |surfel, voxel| {
            let same = faces[voxels.surfels[surfel].face.0 as usize].surface == patch.surface;
            if same && !is_beyond(surfel) && voxels.normal(surfel).unit.dot(patch.normal) > ALIKE {
                let distance = at.distance(glam::DVec3::from_array(voxel.map(f64::from)));
                let weight = (1.0 - distance / REACH).max(0.0) * voxels.surfels[surfel].area;
                mean.add(weight, values.row(surfel));
            }
        });
        let mut reach = 1;
        while mean.weight <= 0.0 && reach <= FAR {
            each_surfel_within(voxels, home, reach, |surfel, _| {
                if !is_beyond(surfel) && voxels.normal(surfel).unit.dot(patch.normal) > ALIKE {
                    mean.add(voxels.surfels[surfel].area, values.row(surfel));
                }
            });
            reach += 1;
        }
        mean.into_values()
    };
    let rows: Vec<f64> = threads::collect_flat(mesh.n_patches(), |i| of_patch(&mesh.patches[i]));
    Block::from_values(rows, n_channels)
}

struct Mean {
    weight: f64,
    sums: Vec<f64>,
}

impl Mean {
    fn new(n_channels: usize) -> Self {
        Self {
            weight: 0.0,
            sums: vec![0.0; n_channels],
        }
    }

    fn add(&mut self, weight: f64, values: &[f64]) {
        self.weight += weight;
        for (sum, value) in self.sums.iter_mut().zip(values) {
            *sum += weight * value;
        }
    }

    fn into_values(mut self) -> Vec<f64> {
        if self.weight > 0.0 {
            self.sums.iter_mut().for_each(|sum| *sum /= self.weight);
        }
        self.sums
    }
}

fn each_surfel_within(voxels: &VoxelScene, home: Voxel, reach: i32, mut work: impl FnMut(usize, Voxel)) {
    for k in -reach..=reach {
        for j in -reach..=reach {
            for i in -reach..=reach {
                let voxel = [home[0] + i, home[1] + j, home[2] + k];
                if let Some(rank) = voxels.octree.rank(voxel) {
                    voxels.surfels_of(rank).for_each(|surfel| work(surfel, voxel));
                }
            }
        }
    }
}
