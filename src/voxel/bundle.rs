//! The discrete lines of one direction from the voxels of one brick, traced together.
//!
//! Lines of one direction are translates of one another: after k crossings all are equally far from their starts. After k crossings, the voxels of the lines of a brick of
//! 4 × 4 × 4 are therefore those of the brick, moved as a whole: 64 bits for the lines that still run, and 64 bits for the voxels of the moved brick
//! that are surface, cut out of the masks of the eight bricks that it overlaps. One "and" finds all lines that end there.
//!
//! Lines whose first crossing is counted in advance ([`Place::at_least`]) are translates of those with the same one. A line that begins later than others joins
//! them when they have come as far.
//!
//! A line meets the same surfels as by [`first_surface`](super::line::first_surface), at any grouping of lines.

use std::cmp::Ordering;

use super::line::{AHEAD, Direction, Place, first};
use super::octree::{self, Octree};

/// Voxels of a brick.
const N_VOXELS: usize = 64;

/// Lines of one direction that are traced together; a line is identified by the bit of its voxel in the mask of its brick.
#[derive(Clone, Debug)]
pub(super) struct Bundle {
    /// The start of the first lines.
    first: [u32; 3],
    at_least: [u32; 3],
    /// Lines that begin at `first`.
    running: u64,
    /// Lines that begin later.
    waiting: u64,
    /// The number of crossings after which a line begins.
    begins: [u32; N_VOXELS],
    /// Lines that are leaving the surface in which they begin, and have not met a free voxel.
    leaving: u64,
}

impl Bundle {
    /// Returns a bundle without lines.
    pub(super) fn new() -> Self {
        Self {
            first: [0; 3],
            at_least: [0; 3],
            running: 0,
            waiting: 0,
            begins: [0; N_VOXELS],
            leaving: 0,
        }
    }

    /// Returns a bundle of the lines with the bits `lines`, which all begin at `place`, where they may still have to leave a surface.
    pub(super) fn together(lines: u64, place: Place) -> Self {
        Self {
            first: place.counts,
            at_least: place.at_least,
            running: lines,
            leaving: lines,
            ..Self::new()
        }
    }

    /// Returns the bits of the lines.
    pub(super) fn lines(&self) -> u64 {
        self.running | self.waiting
    }

    /// Adds the line with bit `bit`; returns false if there is one from that voxel, or one with another first crossing.
    pub(super) fn add(&mut self, bit: u32, place: Place) -> bool {
        let line = 1 << bit;
        if self.lines() == 0 {
            (self.first, self.at_least) = (place.counts, place.at_least);
        }
        if self.lines() & line != 0 || self.at_least != place.at_least {
            return false;
        }
        let begin = crossings(place.counts);
        self.begins[bit as usize] = begin;
        match begin.cmp(&crossings(self.first)) {
            Ordering::Less => {
                // The lines that were to run first wait from here on; all of them are identified by their own numbers of crossings.
                self.waiting |= self.running;
                self.running = line;
                self.first = place.counts;
            }
            Ordering::Equal => self.running |= line,
            Ordering::Greater => self.waiting |= line,
        }
        true
    }

    /// Traces the lines from the brick with the coordinates `brick`.
    ///
    /// Where a line meets a surface voxel, `meets` is called with its bit, the voxel's rank and whether the line is still leaving the surface in which it begins; it returns whether the line ends there.
    /// The other lines leave the lattice.
    #[inline]
    pub(super) fn walk(
        self,
        octree: &Octree,
        brick: [u32; 3],
        direction: &Direction,
        mut meets: impl FnMut(u32, u32, bool) -> bool,
    ) {
        if self.lines() == 0 {
            return;
        }
        let octant = direction.octant();
        let (padded, n_bricks) = (octree.padded_size(), octree.n_bricks());
        let cubes = octree.empty_cubes(octant);
        let ahead = &AHEAD[octant];
        let Self {
            mut running,
            mut waiting,
            mut leaving,
            ..
        } = self;
        // The brick's first voxel, in coordinates that grow along the line.
        let start: [u32; 3] = std::array::from_fn(|a| {
            let first = 4 * brick[a];
            if octant >> a & 1 == 1 {
                padded[a] - 4 - first
            } else {
                first
            }
        });
        let mut counts = self.first;
        let mut next = self.next_to_begin(waiting);
        let mut extent = Extent::of(running | waiting, octant);
        loop {
            let at: [u32; 3] = std::array::from_fn(|a| start[a] + counts[a]);
            let low: [u32; 3] = std::array::from_fn(|a| at[a] + extent.low[a]);
            let high: [u32; 3] = std::array::from_fn(|a| at[a] + extent.high[a]);
            if (0..3).any(|a| low[a] >= padded[a]) {
                return;
            }
            let place = low.map(|c| (c >> 2) as usize);
            let side = u32::from(cubes[(place[2] * n_bricks[1] + place[1]) * n_bricks[0] + place[0]]);
            let cube_end = low.map(|c| (c & !3) + 4 * side);
            let mut block = Block::EMPTY;
            let free_until = if (0..3).all(|a| high[a] < cube_end[a]) {
                Some(cube_end)
            } else {
                block = Block::new(octree, at, octant);
                let relative = std::array::from_fn(|a| low[a] - (at[a] & !3));
                block
                    .is_free_from(relative, ahead, octant)
                    .then(|| at.map(|c| (c & !3) + 8))
            };
            if let Some(end) = free_until {
                // The last numbers of crossings with all lines inside, and the first crossing out of it.
                let last: [u32; 3] = std::array::from_fn(|a| end[a] - 1 - extent.high[a] - start[a]);
                let axis = direction.next_axis(last);
                let after = direction.counts_after(axis, last[axis]);
                counts = std::array::from_fn(|a| after[a].max(self.at_least[a]));
                leaving = 0;
                if crossings(counts) >= next {
                    self.begin(crossings(counts), &mut running, &mut waiting);
                    next = self.next_to_begin(waiting);
                }
                continue;
            }
            let mut t: [u64; 3] = std::array::from_fn(|a| u64::from(2 * counts[a] + 1) * direction.step()[a]);
            let mut offset = at.map(|c| c & 3);
            let lines = running | waiting;
            loop {
                let window = block.window(offset, octant);
                let mut met = running & window;
                let free = leaving & !window;
                leaving &= !free;
                while met != 0 {
                    let bit = met.trailing_zeros();
                    let line = 1_u64 << bit;
                    met &= met - 1;
                    let rank = block.rank(octree, bit, offset, octant);
                    if meets(bit, rank, leaving & line != 0) {
                        running &= !line;
                    }
                }
                if running | waiting == 0 {
                    return;
                }
                let axis = first(t);
                t[axis] += 2 * direction.step()[axis];
                counts[axis] += 1;
                offset[axis] += 1;
                if crossings(counts) >= next {
                    self.begin(crossings(counts), &mut running, &mut waiting);
                    next = self.next_to_begin(waiting);
                }
                if offset[axis] == 4 {
                    break;
                }
            }
            if running | waiting != lines {
                extent = Extent::of(running | waiting, octant);
            }
        }
    }

    /// Starts the lines that begin after `n` crossings.
    fn begin(&self, n: u32, running: &mut u64, waiting: &mut u64) {
        let mut left = *waiting;
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            if self.begins[bit as usize] <= n {
                *running |= 1 << bit;
                *waiting &= !(1 << bit);
            }
        }
    }

    /// Returns the number of crossings after which the next of the waiting lines begins.
    fn next_to_begin(&self, waiting: u64) -> u32 {
        let mut left = waiting;
        let mut next = u32::MAX;
        while left != 0 {
            next = next.min(self.begins[left.trailing_zeros() as usize]);
            left &= left - 1;
        }
        next
    }
}

fn crossings(counts: [u32; 3]) -> u32 {
    counts[0] + counts[1] + counts[2]
}

/// The least and the greatest coordinates of some lines' voxels inside their brick, growing along the lines.
#[derive(Clone, Copy)]
struct Extent {
    low: [u32; 3],
    high: [u32; 3],
}

impl Extent {
    fn of(lines: u64, octant: usize) -> Self {
        let ahead = &AHEAD[octant];
        let reach = |a: usize, c: usize| lines & ahead[a][c] != 0;
        let low = |a: usize| (1..4).filter(|&c| lines & !ahead[a][c] == 0).count();
        let high = |a: usize| (1..4).filter(|&c| reach(a, c)).count();
        #[expect(clippy::cast_possible_truncation, reason = "at most 3")]
        Self {
            low: std::array::from_fn(|a| low(a) as u32),
            high: std::array::from_fn(|a| high(a) as u32),
        }
    }
}

/// The masks of 2 × 2 × 2 bricks, in the lattice's order of axes: bit a of an index is the position along axis a.
struct Block {
    masks: [u64; 8],
    bricks: [u32; 8],
}

impl Block {
    const EMPTY: Self = Self {
        masks: [0; 8],
        bricks: [0; 8],
    };

    /// Returns the bricks from that with the voxel `at` on, in coordinates that grow along the octant; bricks beyond the lattice are empty.
    #[inline]
    fn new(octree: &Octree, at: [u32; 3], octant: usize) -> Self {
        let n_bricks = octree.n_bricks();
        let mut block = Self::EMPTY;
        // Positions along each axis, times its stride; `None` beyond the lattice.
        let stride = [1, n_bricks[0], n_bricks[0] * n_bricks[1]];
        let places: [[Option<usize>; 2]; 3] = std::array::from_fn(|a| {
            [0, 1].map(|k| {
                let along = (at[a] >> 2) as usize + k;
                let place = if octant >> a & 1 == 1 {
                    n_bricks[a].wrapping_sub(1).wrapping_sub(along)
                } else {
                    along
                };
                (along < n_bricks[a]).then(|| place * stride[a])
            })
        });
        for k in 0..8 {
            if let (Some(x), Some(y), Some(z)) = (places[0][k & 1], places[1][k >> 1 & 1], places[2][k >> 2]) {
                let brick = octree.brick_at(x + y + z);
                if brick != octree::EMPTY {
                    block.bricks[k ^ octant] = brick;
                    block.masks[k ^ octant] = octree.mask(brick);
                }
            }
        }
        block
    }

    /// Returns whether no surface voxel has coordinates, growing along the octant from the block's first, of `from` or more.
    #[inline]
    fn is_free_from(&self, from: [u32; 3], ahead: &[[u64; 4]; 3], octant: usize) -> bool {
        let of_axis: [[u64; 2]; 3] = std::array::from_fn(|a| {
            let from = from[a] as usize;
            if from < 4 {
                [ahead[a][from], u64::MAX]
            } else {
                [0, ahead[a][from - 4]]
            }
        });
        (0..8).all(|k| self.masks[k ^ octant] & of_axis[0][k & 1] & of_axis[1][k >> 1 & 1] & of_axis[2][k >> 2] == 0)
    }

    /// Returns the mask of the brick's voxels after it has moved by `offset`, below 4, from the block's first corner along the octant.
    #[inline]
    fn window(&self, offset: [u32; 3], octant: usize) -> u64 {
        let [x, y, z] = in_lattice(offset, octant);
        let m = &self.masks;
        let along_z = |k: usize| m[k].unbounded_shr(16 * z) | m[k | 4].unbounded_shl(64 - 16 * z);
        let keep_y = KEEP_Y[y as usize];
        let along_y =
            |k: usize| along_z(k).unbounded_shr(4 * y) & keep_y | along_z(k | 2).unbounded_shl(16 - 4 * y) & !keep_y;
        let keep_x = KEEP_X[x as usize];
        along_y(0).unbounded_shr(x) & keep_x | along_y(1).unbounded_shl(4 - x) & !keep_x
    }

    /// Returns the rank of the surface voxel of the line with bit `bit`.
    #[inline]
    fn rank(&self, octree: &Octree, bit: u32, offset: [u32; 3], octant: usize) -> u32 {
        let [x, y, z] = in_lattice(offset, octant);
        let voxel = [(bit & 3) + x, (bit >> 2 & 3) + y, (bit >> 4) + z];
        let k = voxel[0] >> 2 | (voxel[1] >> 2) << 1 | (voxel[2] >> 2) << 2;
        let inside = octree::bit(voxel);
        octree
            .rank_in_brick(self.bricks[k as usize], inside)
            .expect("a line has met a surface voxel")
    }
}

/// Returns the distance of the brick from the block's first corner in the coordinates of the lattice, 0 to 4.
#[inline]
fn in_lattice(offset: [u32; 3], octant: usize) -> [u32; 3] {
    std::array::from_fn(|a| if octant >> a & 1 == 1 { 4 - offset[a] } else { offset[a] })
}

/// By offset: the bits of the window that come from the lower brick along x.
static KEEP_X: [u64; 5] = [
    u64::MAX,
    0x7777_7777_7777_7777,
    0x3333_3333_3333_3333,
    0x1111_1111_1111_1111,
    0,
];

/// Likewise along y.
static KEEP_Y: [u64; 5] = [
    u64::MAX,
    0x0fff_0fff_0fff_0fff,
    0x00ff_00ff_00ff_00ff,
    0x000f_000f_000f_000f,
    0,
];

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::grid::Voxel;
    use super::super::line::first_surface_by_voxels;
    use super::*;

    proptest! {
        #[test]
        fn bundles_meet_what_single_lines_meet(
            vector in prop::array::uniform3(-9..=9_i32).prop_filter("a direction points somewhere", |v| *v != [0; 3]),
            size in prop::array::uniform3(1..60_i32),
            seeds in prop::collection::vec(prop::array::uniform3(0.0..1.0_f64), 0..60),
            from in prop::array::uniform3(0.0..1.0_f64),
            lines in any::<u64>(),
            lift in 0..4_usize,
            late in prop::array::uniform8(0..9_u32),
        ) {
            #[expect(clippy::cast_possible_truncation, reason = "a fraction of a small number")]
            let voxel = |f: [f64; 3]| -> Voxel { std::array::from_fn(|a| (f[a] * f64::from(size[a])) as i32) };
            let voxels: Vec<Voxel> = seeds.iter().map(|&f| voxel(f)).collect();
            let tree = Octree::build(size, &voxels).octree;
            let direction = Direction::new(vector);
            let brick = voxel(from).map(|c| c.cast_unsigned() >> 2);
            // All lines at once with a crossing ahead, or each after some crossings of its own.
            let mut at_least = [0; 3];
            let is_ahead = lift < 3 && vector[lift] != 0;
            if is_ahead {
                at_least[lift] = 1;
            }
            let place_of = |bit: u32| {
                let mut counts = at_least;
                for _ in 0..if is_ahead { 0 } else { late[bit as usize % 8] } {
                    counts[direction.next_axis(counts)] += 1;
                }
                Place { counts, at_least }
            };
            let mut bundle = Bundle::new();
            if is_ahead {
                bundle = Bundle::together(lines, place_of(0));
            } else {
                for bit in (0..64).filter(|bit| lines >> bit & 1 == 1) {
                    prop_assert!(bundle.add(bit, place_of(bit)));
                    prop_assert!(!bundle.add(bit, place_of(bit)));
                }
            }
            prop_assert_eq!(bundle.lines(), lines);
            let mut met = [None; 64];
            bundle.walk(&tree, brick, &direction, |bit, rank, _| {
                met[bit as usize] = Some(rank);
                true
            });
            for bit in 0..64 {
                let local = [bit & 3, bit >> 2 & 3, bit >> 4];
                let origin = std::array::from_fn(|a| (4 * brick[a] + local[a]).cast_signed());
                let expected = (lines >> bit & 1 == 1)
                    .then(|| first_surface_by_voxels(&tree, origin, &direction, place_of(bit)))
                    .flatten();
                prop_assert_eq!(met[bit as usize], expected, "bit {}", bit);
            }
        }
    }
}
