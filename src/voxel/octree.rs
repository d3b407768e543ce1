//! The octree of surface voxels and of empty space.

use rayon::prelude::*;

use super::grid::{Voxel, to_u32};
use crate::threads;

/// The side of a brick, in voxels: two levels of the octree in one 64-bit mask.
const BRICK: i32 = 4;

/// The entry of a brick without surface voxels.
pub(super) const EMPTY: u32 = u32::MAX;

/// The surface voxels of a scene.
///
/// The two lowest levels of the octree are a mask of 4 × 4 × 4 voxels. The levels above them are flattened into tables over all bricks,
/// so that a leaf is found in one access instead of log W: for each of the eight octants of directions a brick has the side of the largest empty cube
/// that begins there and extends along the octant. Such a cube contains the octree's leaf or extends beyond it.
///
/// A surface voxel is identified by its *rank*: bricks in Morton order, x fastest inside a brick.
///
/// Memory: 12 bytes a brick, and 12 more for each with surface: 4.8 MB for 315 × 315 × 190 voxels.
///
/// Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), sections 2.3 and 4.1.
/// Departures: the flattening, and cubes in place of leaves; what a line meets first does not depend on them.
#[derive(Clone, Debug)]
pub struct Octree {
    /// Bricks along each axis.
    n_bricks: [usize; 3],
    /// By brick, x fastest: its index in `masks`, or [`EMPTY`].
    brick: Vec<u32>,
    masks: Vec<u64>,
    /// The rank of the first surface voxel of each mask.
    first_rank: Vec<u32>,
    n_voxels: usize,
    /// By octant, in coordinates that grow along it: the side in bricks of the largest empty cube that begins at a brick; 0 for a brick with surface.
    empty_cubes: [Vec<u8>; 8],
}

/// The result of [`Octree::build`] for a list of voxels.
pub(super) struct Built {
    pub(super) octree: Octree,
    /// The rank of each voxel of the list.
    pub(super) ranks: Vec<u32>,
}

impl Octree {
    /// Builds the octree of some voxels of a lattice; voxels may repeat.
    ///
    /// # Panics
    /// If a voxel lies outside the lattice.
    #[track_caller]
    pub(super) fn build(n_voxels: [i32; 3], voxels: &[Voxel]) -> Built {
        let n_bricks = n_voxels.map(|n| usize::try_from((n + BRICK - 1) / BRICK).expect("a lattice has voxels"));
        let mut keyed: Vec<(u64, usize)> = threads::collect(voxels.len(), |k| {
            let voxel = voxels[k];
            let inside = (0..3).all(|a| (0..n_voxels[a]).contains(&voxel[a]));
            assert!(inside, "voxel {voxel:?} lies outside the lattice of {n_voxels:?}");
            (key(voxel), k)
        });
        keyed.par_sort_unstable();
        let mut octree = Self {
            n_bricks,
            brick: vec![EMPTY; n_bricks.iter().product()],
            masks: Vec::new(),
            first_rank: Vec::new(),
            n_voxels: 0,
            empty_cubes: Default::default(),
        };
        let mut ranks = vec![0; voxels.len()];
        let mut last = None;
        for &(key, k) in &keyed {
            if last.is_none_or(|last: u64| last >> 6 != key >> 6) {
                let place = octree.place_of_brick(voxels[k].map(i32::cast_unsigned));
                octree.brick[place] = to_u32(octree.masks.len());
                octree.masks.push(0);
                octree.first_rank.push(to_u32(octree.n_voxels));
            }
            if last != Some(key) {
                if let Some(mask) = octree.masks.last_mut() {
                    *mask |= 1 << (key & 63);
                }
                octree.n_voxels += 1;
            }
            last = Some(key);
            ranks[k] = to_u32(octree.n_voxels - 1);
        }
        octree.empty_cubes = std::array::from_fn(|octant| octree.empty_cubes_of(octant));
        Built { octree, ranks }
    }

    /// Returns the number of surface voxels.
    #[must_use]
    pub fn n_voxels(&self) -> usize {
        self.n_voxels
    }

    /// Returns the memory of the octree.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        4 * self.brick.len() + 12 * self.masks.len() + self.empty_cubes.iter().map(Vec::len).sum::<usize>()
    }

    /// Returns the rank of a surface voxel; `None` for any other, inside the lattice or not.
    #[must_use]
    pub fn rank(&self, voxel: Voxel) -> Option<u32> {
        let v = voxel.map(i32::cast_unsigned);
        // A negative coordinate is a very large one here.
        let size = self.padded_size();
        if (0..3).any(|a| v[a] >= size[a]) {
            return None;
        }
        let brick = self.brick[self.place_of_brick(v)];
        if brick == EMPTY {
            return None;
        }
        self.rank_in_brick(brick, bit(v))
    }

    /// Returns the size of the lattice in voxels, whole bricks.
    pub(super) fn padded_size(&self) -> [u32; 3] {
        self.n_bricks.map(|n| 4 * to_u32(n))
    }

    /// Returns the sides of the empty cubes along an octant; bit a of `octant` is set where axis a runs backwards.
    pub(super) fn empty_cubes(&self, octant: usize) -> &[u8] {
        &self.empty_cubes[octant]
    }

    /// Returns the number of bricks along each axis.
    pub(super) fn n_bricks(&self) -> [usize; 3] {
        self.n_bricks
    }

    /// Returns the index among the masks of a brick with surface; `place` counts bricks x fastest, in the coordinates of the lattice.
    pub(super) fn brick_at(&self, place: usize) -> u32 {
        self.brick[place]
    }

    pub(super) fn mask(&self, brick: u32) -> u64 {
        self.masks[brick as usize]
    }

    /// Returns the rank of bit `bit` of a mask, if it is set.
    pub(super) fn rank_in_brick(&self, brick: u32, bit: u32) -> Option<u32> {
        let mask = self.masks[brick as usize];
        (mask >> bit & 1 == 1).then(|| {
            let below = mask & ((1 << bit) - 1);
            self.first_rank[brick as usize] + below.count_ones()
        })
    }

    fn place_of_brick(&self, v: [u32; 3]) -> usize {
        let [x, y, z] = v.map(|c| (c >> 2) as usize);
        (z * self.n_bricks[1] + y) * self.n_bricks[0] + x
    }

    /// Returns the sides of the empty cubes along an octant.
    ///
    /// A cube of side s begins at a brick if cubes of side s − 1 begin at it and at its seven neighbours along the octant.
    fn empty_cubes_of(&self, octant: usize) -> Vec<u8> {
        let [nx, ny, nz] = self.n_bricks;
        let place = |x: usize, y: usize, z: usize| (z * ny + y) * nx + x;
        let mirrored = |c: usize, axis: usize| {
            if octant >> axis & 1 == 1 {
                self.n_bricks[axis] - 1 - c
            } else {
                c
            }
        };
        let mut sides = vec![0_u8; self.brick.len()];
        for z in (0..nz).rev() {
            for y in (0..ny).rev() {
                for x in (0..nx).rev() {
                    if self.brick[place(mirrored(x, 0), mirrored(y, 1), mirrored(z, 2))] != EMPTY {
                        continue;
                    }
                    let beyond = |dx: usize, dy: usize, dz: usize| {
                        let (x, y, z) = (x + dx, y + dy, z + dz);
                        // A cube ends at the border of the lattice.
                        if x < nx && y < ny && z < nz {
                            sides[place(x, y, z)]
                        } else {
                            0
                        }
                    };
                    let least = (1..8).map(|k| beyond(k & 1, k >> 1 & 1, k >> 2)).min().unwrap_or(0);
                    sides[place(x, y, z)] = least.saturating_add(1);
                }
            }
        }
        sides
    }
}

/// Returns the bit of a voxel in the mask of its brick.
pub(super) fn bit([x, y, z]: [u32; 3]) -> u32 {
    x & 3 | (y & 3) << 2 | (z & 3) << 4
}

/// Returns the order of voxels: bricks in Morton order, x fastest inside a brick.
fn key(voxel: Voxel) -> u64 {
    let v = voxel.map(i32::cast_unsigned);
    let spread = |c: u32| (0..10).fold(0_u64, |sum, k| sum | u64::from(c >> (k + 2) & 1) << (3 * k));
    let brick = spread(v[0]) | spread(v[1]) << 1 | spread(v[2]) << 2;
    brick << 6 | u64::from(bit(v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_count_the_surface_voxels_once_each() {
        let voxels = [[5, 0, 9], [0, 0, 0], [5, 0, 9], [13, 12, 9], [1, 0, 0], [0, 1, 0]];
        let Built { octree, ranks } = Octree::build([14, 13, 10], &voxels);
        assert_eq!(octree.n_voxels(), 5);
        assert_eq!(ranks, [3, 0, 3, 4, 1, 2]);
        for (&voxel, &rank) in voxels.iter().zip(&ranks) {
            assert_eq!(octree.rank(voxel), Some(rank));
        }
        for free in [[4, 0, 9], [2, 0, 0], [-1, 0, 0], [13, 13, 9], [0, 0, 400]] {
            assert_eq!(octree.rank(free), None);
        }
    }

    #[test]
    fn empty_cubes_are_the_largest() {
        // Seven bricks in a row along x, two layers in y and z; one surface voxel in brick (5, 1, 0).
        let Built { octree, .. } = Octree::build([28, 8, 8], &[[22, 6, 2]]);
        // Along +x +y +z from brick (4, 0, 0) a cube of side 2 would hold the surface.
        assert_eq!(octree.empty_cubes(0)[..7], [2, 2, 2, 2, 1, 1, 1]);
        // Along −x, brick 6 of the lattice comes first: a cube from it holds brick 5.
        assert_eq!(octree.empty_cubes(1)[..7], [1, 1, 2, 2, 2, 2, 1]);
        // In the coordinates of −y, brick (5, 1, 0) has y = 0.
        assert_eq!(octree.empty_cubes(2)[..7], [2, 2, 2, 2, 1, 0, 1]);
    }
}
