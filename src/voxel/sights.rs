//! The first hits of the surfels of one brick: the results of [`VoxelScene::sight`], traced in line packets.

use std::ops::Range;

use super::bundle::Bundle;
use super::discretize::VoxelScene;
use super::line::Direction;
use super::links::is_in_front;
use super::octree;
use super::sight::{Sight, Start, start_from_axis};

impl VoxelScene {
    /// Returns the surfels from `surfels.start` on whose voxels lie in one brick of 4 × 4 × 4, as far as they are in `surfels`.
    pub(super) fn of_one_brick(&self, surfels: Range<usize>) -> Range<usize> {
        let brick = |s: usize| self.surfels[s].voxel.map(|c| c >> 2);
        let (start, end) = (surfels.start, surfels.end);
        let n = (start..end).take_while(|&s| brick(s) == brick(start)).count();
        start..start + n
    }

    /// Returns the first hit of each of the surfels along each of the directions, [`Self::sight`]; `None` where the direction is not in front of the surfel.
    ///
    /// Shape: one row for each surfel, one column for each direction. Lines that begin in the same brick are traced together, which takes a fraction of the time of single lines.
    ///
    /// # Panics
    /// If there is no such surfel.
    #[must_use]
    #[track_caller]
    pub fn sights(&self, surfels: Range<usize>, directions: &[Direction]) -> Vec<Option<Sight>> {
        assert!(
            surfels.end <= self.n_surfels(),
            "surfels {surfels:?} of {}",
            self.n_surfels()
        );
        let mut sights = vec![None; surfels.len() * directions.len()];
        let mut rest = surfels.clone();
        while !rest.is_empty() {
            let of_brick = self.of_one_brick(rest.clone());
            let rows =
                (of_brick.start - surfels.start) * directions.len()..(of_brick.end - surfels.start) * directions.len();
            Watch::new(self, of_brick.clone()).look(directions, &mut sights[rows]);
            rest.start = of_brick.end;
        }
        sights
    }
}

/// The fewest surfels that are traced as a bundle; for fewer, it costs more than their lines.
const WORTH_A_BUNDLE: usize = 3;

/// The surfels of a brick whose hits are traced.
pub(super) struct Watch<'a> {
    scene: &'a VoxelScene,
    surfels: Range<usize>,
    brick: [u32; 3],
    /// Groups of surfels with one normal.
    groups: Vec<Group>,
}

/// Surfels with one normal.
struct Group {
    normal: u32,
    /// The surfels that begin alike in all directions: bits of their voxels; empty for a slope or near a thin wall.
    alike: u64,
    /// The number of the surfel, among those of the brick, of each bit of `alike`.
    surfel_of: [u16; 64],
    /// The other surfels.
    single: Vec<u16>,
}

impl<'a> Watch<'a> {
    /// Prepares the surfels `surfels`, all of one brick.
    pub(super) fn new(scene: &'a VoxelScene, surfels: Range<usize>) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        for (k, surfel) in (0..).zip(surfels.clone()) {
            let x = &scene.surfels[surfel];
            let normal = scene.normal(surfel);
            let at = groups.iter().position(|g| g.normal == x.normal).unwrap_or_else(|| {
                groups.push(Group {
                    normal: x.normal,
                    alike: 0,
                    surfel_of: [0; 64],
                    single: Vec::new(),
                });
                groups.len() - 1
            });
            let group = &mut groups[at];
            let bit = octree::bit(x.voxel().map(i32::cast_unsigned));
            let begins_alike = normal.is_axis_aligned() && !x.faces_any() && !scene.is_thin(surfel);
            if !begins_alike || group.alike >> bit & 1 == 1 {
                group.single.push(k);
            } else {
                group.alike |= 1 << bit;
                group.surfel_of[bit as usize] = k;
            }
        }
        let first = scene.surfels[surfels.start].voxel();
        Self {
            scene,
            surfels,
            brick: first.map(|c| c.cast_unsigned() >> 2),
            groups,
        }
    }

    /// Fills `sights`, one row for each surfel and one column for each direction.
    pub(super) fn look(&self, directions: &[Direction], sights: &mut [Option<Sight>]) {
        let n = directions.len();
        if self.surfels.len() < WORTH_A_BUNDLE {
            for (surfel, row) in self.surfels.clone().zip(sights.chunks_mut(n)) {
                let normal = self.scene.normal(surfel);
                for (seen, direction) in row.iter_mut().zip(directions) {
                    if is_in_front(normal, direction.vector()) {
                        *seen = Some(self.scene.sight(surfel, direction));
                    }
                }
            }
            return;
        }
        for (d, direction) in directions.iter().enumerate() {
            let mut slope = Late::new();
            for group in &self.groups {
                let normal = &self.scene.normals[group.normal as usize];
                if !is_in_front(normal, direction.vector()) {
                    continue;
                }
                let mut see = |k: u16, sight: Sight| sights[usize::from(k) * n + d] = Some(sight);
                if !normal.is_axis_aligned() {
                    for &k in &group.single {
                        if let Some(seen) = self.begin(k, direction, &mut slope) {
                            see(k, seen);
                        }
                    }
                    continue;
                }
                let mut lines = group.alike;
                let mut surfel_of = group.surfel_of;
                let mut thin = Late::new();
                for &k in &group.single {
                    let surfel = self.surfels.start + usize::from(k);
                    let bit = self.bit(k);
                    if self.scene.is_thin(surfel) {
                        if let Some(seen) = self.begin(k, direction, &mut thin) {
                            see(k, seen);
                        }
                    } else if let Some(seen) = self.scene.seen_in_own_voxel(surfel, direction) {
                        see(k, seen);
                    } else if lines >> bit & 1 == 0 {
                        lines |= 1 << bit;
                        surfel_of[bit as usize] = k;
                    } else {
                        see(k, self.scene.sight(surfel, direction));
                    }
                }
                let at_least = start_from_axis(normal).at_least;
                let bundle = Bundle::together(lines, start_from_axis(normal));
                self.walk(bundle, direction, at_least, |bit, sight| {
                    see(surfel_of[bit as usize], sight);
                });
                self.walk(thin.bundle, direction, thin.at_least, |bit, sight| {
                    see(thin.surfel_of[bit as usize], sight);
                });
            }
            self.walk(slope.bundle, direction, slope.at_least, |bit, sight| {
                sights[usize::from(slope.surfel_of[bit as usize]) * n + d] = Some(sight);
            });
        }
    }

    /// Begins the line of the `k`-th surfel and adds it to `late`, or returns its hit.
    fn begin(&self, k: u16, direction: &Direction, late: &mut Late) -> Option<Sight> {
        let surfel = self.surfels.start + usize::from(k);
        match self.scene.start(surfel, direction) {
            Start::Own(seen) => Some(seen),
            Start::Seen(rank, side) => Some(self.scene.front(rank, direction, || side)),
            Start::Free(place) if late.bundle.add(self.bit(k), place) => {
                late.surfel_of[self.bit(k) as usize] = k;
                late.at_least = place.at_least;
                None
            }
            Start::Free(place) => Some(self.scene.sight_from(surfel, direction, place)),
        }
    }

    /// Returns the bit of the voxel of the `k`-th surfel.
    fn bit(&self, k: u16) -> u32 {
        let surfel = &self.scene.surfels[self.surfels.start + usize::from(k)];
        octree::bit(surfel.voxel().map(i32::cast_unsigned))
    }

    /// Traces a bundle, and calls `sees` with each line and its hit.
    #[inline]
    fn walk(&self, bundle: Bundle, direction: &Direction, at_least: [u32; 3], mut sees: impl FnMut(u32, Sight)) {
        let mut left = bundle.lines();
        bundle.walk(&self.scene.octree, self.brick, direction, |bit, rank, leaving| {
            let way = || {
                let local = [bit & 3, bit >> 2 & 3, bit >> 4];
                let origin = std::array::from_fn(|a| (4 * self.brick[a] + local[a]).cast_signed());
                self.scene.way_through(rank, origin, direction, at_least)
            };
            if self.scene.lets_pass(rank, direction, leaving, way) {
                return false;
            }
            left &= !(1 << bit);
            sees(bit, self.scene.front(rank, direction, || way().0));
            true
        });
        while left != 0 {
            sees(left.trailing_zeros(), Sight::Escaped);
            left &= left - 1;
        }
    }
}

/// Lines that begin one by one and are traced together.
struct Late {
    bundle: Bundle,
    at_least: [u32; 3],
    /// The number of the surfel of each line, among those of the brick.
    surfel_of: [u16; 64],
}

impl Late {
    fn new() -> Self {
        Self {
            bundle: Bundle::new(),
            at_least: [0; 3],
            surfel_of: [0; 64],
        }
    }
}
