//! The lattice of voxels in the world.

use glam::DVec3;

use super::VoxelError;
use crate::scene::Scene;

/// The greatest number of voxels along an axis: products of coordinates and directions then stay in 32 bits.
pub const MAX_VOXELS: u32 = 4096;

/// The least number of voxels along the longest axis.
pub const MIN_VOXELS: u32 = 4;

/// The distance of the scene from the lattice's first centre, in voxels.
///
/// Walls are often at whole coordinates, where every rounding error would decide anew on which side of a wall a voxel's centre is. With shifts
/// of irrational ratios, no plane of small integers passes through a centre. They are larger than the rounding of coordinates of six digits, and far below a voxel.
const SHIFT: DVec3 = DVec3::new(1e-3, std::f64::consts::SQRT_2 * 1e-3, 1.732_050_807_568_877_2e-3);

/// The integer coordinates of a voxel's centre.
pub type Voxel = [i32; 3];

/// A lattice over a scene. A voxel (i, j, k) is the cube of side h around `origin` + h (i, j, k).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// The centre of voxel (0, 0, 0), in m: the least corner of the scene, less about a thousandth of a voxel.
    pub origin: DVec3,
    /// h, the side of a voxel, in m.
    pub voxel_size: f64,
    /// The number of voxels along each axis.
    pub n_voxels: [i32; 3],
}

impl Grid {
    /// Places `n` voxels along the longest axis of a scene, with the first and the last centred on its ends.
    ///
    /// They are centred but for about a thousandth of a voxel: h = extent / (n − 1). Along the other axes the far end is anywhere in the last voxel.
    ///
    /// # Errors
    /// [`VoxelError::Resolution`] for fewer than [`MIN_VOXELS`] or more than [`MAX_VOXELS`].
    pub fn new(scene: &Scene, n: u32) -> Result<Self, VoxelError> {
        if !(MIN_VOXELS..=MAX_VOXELS).contains(&n) {
            return Err(VoxelError::Resolution { n });
        }
        let (low, high) = scene.bounding_box();
        let extent = high - low;
        let voxel_size = extent.max_element() / f64::from(n - 1);
        Ok(Self {
            origin: low - voxel_size * SHIFT,
            voxel_size,
            n_voxels: (extent / voxel_size + SHIFT).to_array().map(|x| nearest(x) + 1),
        })
    }

    /// Returns a point of the world in lattice coordinates, in which voxel centres have integers.
    #[must_use]
    pub fn to_lattice(&self, point: DVec3) -> DVec3 {
        (point - self.origin) / self.voxel_size
    }

    /// Returns the centre of a voxel, in m.
    #[must_use]
    pub fn centre(&self, voxel: Voxel) -> DVec3 {
        self.origin + self.voxel_size * DVec3::from_array(voxel.map(f64::from))
    }

    /// Returns the voxel that contains a point of the world; halves go up.
    #[must_use]
    pub fn voxel_at(&self, point: DVec3) -> Voxel {
        self.to_lattice(point).to_array().map(nearest)
    }
}

/// Returns the nearest integer, halves up: the same rule on both sides of zero, so that neighbouring faces agree.
#[expect(
    clippy::cast_possible_truncation,
    reason = "lattice coordinates are at most MAX_VOXELS"
)]
pub(super) fn nearest(x: f64) -> i32 {
    (x + 0.5).floor() as i32
}

/// Returns a number of voxels, surfels or their parts as 32 bits.
pub(super) fn to_u32(n: usize) -> u32 {
    u32::try_from(n).expect("voxels and their parts are counted in 32 bits")
}
