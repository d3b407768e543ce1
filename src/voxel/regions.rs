//! The regions of air that surfaces close off from each other.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use glam::DVec3;

use super::discretize::VoxelScene;
use super::grid::{Voxel, to_u32};
use super::octree::{self, EMPTY};
use super::thin::{AT_CENTRE, Side, Sides};
use crate::disjoint_sets::DisjointSets;

/// Marks a surfel without air in front of it, or a voxel's centre outside all regions.
const UNKNOWN: u32 = u32::MAX;

/// The regions of air of a scene in which surfaces close off several from each other, as the two sides of a sealed room's walls.
///
/// A region is a set of voxels between which there are 6-paths whose steps, from centre to centre, no face crosses.
/// It is found without any line, so that light which passes from one region to another shows a leak of the lines.
#[derive(Clone, Debug)]
pub(super) struct Regions {
    bricks: Bricks,
    /// By node.
    region: Vec<u32>,
    /// By surfel: the region in front of it.
    of_surfel: Vec<u32>,
}

/// A numbering of voxels in which all of an empty brick share one number, its node; node 0 is the space beyond the lattice.
#[derive(Clone, Debug)]
struct Bricks {
    n: [usize; 3],
    /// By brick, x fastest: its first node, and whether each of its voxels has a separate one.
    first: Vec<(u32, bool)>,
    n_nodes: usize,
}

impl Bricks {
    fn new(voxels: &VoxelScene) -> Self {
        let n = voxels.octree.n_bricks();
        let mut n_nodes = 1;
        let first = (0..n.iter().product()).map(|place| {
            let is_full = voxels.octree.brick_at(place) != EMPTY;
            let first = n_nodes;
            n_nodes += if is_full { 64 } else { 1 };
            (to_u32(first), is_full)
        });
        Self {
            n,
            first: first.collect(),
            n_nodes,
        }
    }

    /// Calls `work` with each brick's coordinates, and whether its voxels have separate nodes.
    fn each(&self, mut work: impl FnMut(Voxel, bool)) {
        let [nx, ny, nz] = self
            .n
            .map(|n| i32::try_from(n).expect("a lattice has at most 1024 bricks a side"));
        let at = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        for (at, &(_, is_full)) in at.zip(&self.first) {
            work(at, is_full);
        }
    }

    fn node(&self, voxel: Voxel) -> usize {
        let v = voxel.map(i32::cast_unsigned);
        let at = v.map(|c| (c >> 2) as usize);
        if (0..3).any(|a| at[a] >= self.n[a]) {
            return 0;
        }
        let (first, is_full) = self.first[(at[2] * self.n[1] + at[1]) * self.n[0] + at[0]];
        first as usize + if is_full { octree::bit(v) as usize } else { 0 }
    }
}

impl Regions {
    /// Finds the regions; `None` if all surfels look into one.
    pub(super) fn new(voxels: &VoxelScene, sides: &Sides) -> Option<Self> {
        let bricks = Bricks::new(voxels);
        let mut sets = DisjointSets::new(bricks.n_nodes);
        let mut join = |from: Voxel, axis: usize| {
            let mut to = from;
            to[axis] += 1;
            let [a, b] = [from, to].map(|voxel| bricks.node(voxel));
            let side = 2 * u32::try_from(axis).expect("an axis");
            if a != b && is_open(voxels, sides, from, side + 1) && is_open(voxels, sides, to, side) {
                sets.join(a, b);
            }
        };
        bricks.each(|at, is_full| {
            for axis in 0..3 {
                let whole = |k: i32| is_full || k == 3;
                for k in (0..64).filter(|k| whole(k >> (2 * axis) & 3)) {
                    let local = [k & 3, k >> 2 & 3, k >> 4];
                    join(std::array::from_fn(|a| 4 * at[a] + local[a]), axis);
                }
                for k in (0..64).filter(|k| at[axis] == 0 && (k >> (2 * axis)) % 4 == 0) {
                    let local = [k & 3, k >> 2 & 3, k >> 4];
                    join(
                        std::array::from_fn(|a| 4 * at[a] + local[a] - i32::from(a == axis)),
                        axis,
                    );
                }
            }
        });
        let mut of_surfel = Vec::with_capacity(voxels.n_surfels());
        for rank in 0..to_u32(voxels.octree.n_voxels()) {
            for s in voxels.surfels_of(rank) {
                let node = voxels.looks_into(s, rank, sides);
                of_surfel.push(node.map_or(UNKNOWN, |node| to_u32(sets.find(bricks.node(node)))));
            }
        }
        let mut known = of_surfel.iter().filter(|&&region| region != UNKNOWN);
        let first = known.next()?;
        if known.all(|region| region == first) {
            return None;
        }
        let region = (0..bricks.n_nodes).map(|node| to_u32(sets.find(node))).collect();
        Some(Self {
            bricks,
            region,
            of_surfel,
        })
    }

    /// Returns the memory of the regions.
    pub(super) fn n_bytes(&self) -> usize {
        size_of::<(u32, bool)>() * self.bricks.first.len() + 4 * (self.region.len() + self.of_surfel.len())
    }

    /// Returns the region in front of a surfel, if it is known.
    pub(super) fn of_surfel(&self, surfel: usize) -> Option<u32> {
        Some(self.of_surfel[surfel]).filter(|&region| region != UNKNOWN)
    }

    /// Returns the region of a free voxel.
    pub(super) fn of_voxel(&self, voxel: Voxel) -> u32 {
        self.region[self.bricks.node(voxel)]
    }

    /// Returns whether two surfels are known to look into different regions.
    pub(super) fn part(&self, a: usize, b: usize) -> bool {
        matches!((self.of_surfel(a), self.of_surfel(b)), (Some(a), Some(b)) if a != b)
    }
}

impl VoxelScene {
    /// Returns whether surfaces close the air in front of one surfel off from that in front of another.
    pub(super) fn are_parted(&self, a: usize, b: usize) -> bool {
        self.regions.as_ref().is_some_and(|regions| regions.part(a, b))
    }

    /// Returns whether surfaces close the air in front of a surfel off from the voxel in front of a point of a surface.
    pub(super) fn is_parted_from(&self, surfel: usize, point: DVec3, normal: DVec3) -> bool {
        let Some(regions) = &self.regions else {
            return false;
        };
        let ahead = self.grid.voxel_at(point + self.grid.voxel_size * normal);
        self.octree.rank(ahead).is_none()
            && regions
                .of_surfel(surfel)
                .is_some_and(|region| region != regions.of_voxel(ahead))
    }

    /// Returns a voxel whose centre is in the air in front of a surfel, if one is known.
    fn looks_into(&self, surfel: usize, rank: u32, sides: &Sides) -> Option<Voxel> {
        let side = if self.is_thin(surfel) {
            Some(self.nodes(surfel).trailing_zeros()).filter(|&side| side <= AT_CENTRE)
        } else {
            sides.node_of(rank, self.surfels[surfel].face)
        }?;
        let mut voxel = self.surfels[surfel].voxel();
        if side < AT_CENTRE {
            voxel[side as usize / 2] += if side % 2 == 1 { 1 } else { -1 };
        }
        Some(voxel)
    }
}

/// Returns whether no face lies between a voxel's centre and that side of it.
fn is_open(voxels: &VoxelScene, sides: &Sides, voxel: Voxel, side: Side) -> bool {
    voxels
        .octree
        .rank(voxel)
        .is_none_or(|rank| sides.crossed(rank) >> side & 1 == 0)
}
