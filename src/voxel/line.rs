//! Discrete lines: 6-connected walks from a voxel along an integer direction.
//!
//! A line from x along v visits the voxels that the half-line x + t v, t ≥ 0, passes through. It crosses from the k-th to the (k + 1)-th voxel along axis
//! a at t = (2 k + 1) / (2 |v_a|). Crossings are taken one at a time, in the order of t and, where several coincide, of the axes x, y, z: hence 6-connected.
//! All arithmetic is on integers, and the order is exact.
//!
//! Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), section 4.1. Departures: the paper leaves the choice of the line open.

use super::grid::{Voxel, to_u32};
use super::octree::Octree;

/// The time of a crossing that never comes, in units of [`Direction::step`]: above all others.
const NEVER: u64 = 1 << 40;

/// A direction, prepared for walks.
#[derive(Clone, Copy, Debug)]
pub struct Direction {
    /// v.
    vector: [i32; 3],
    /// |v_x|, |v_y|, |v_z|.
    size: [u32; 3],
    /// v · v.
    norm_squared: i64,
    /// Bit a is set where v_a is negative.
    octant: usize,
    /// The time between crossings of axis a, in halves, times the product of all |v_b| that are not zero: an integer.
    step: [u64; 3],
    /// ⌈2³² / (2 |v_a|)⌉: a division by 2 |v_a| is a multiplication by this and a shift, exact below 2³² / (2 |v_a|).
    reciprocal: [u64; 3],
}

impl Direction {
    /// Prepares the direction `vector`.
    ///
    /// # Panics
    /// If all components are zero, or one is above [`MAX_RADIUS`](super::sphere::MAX_RADIUS) in size.
    #[must_use]
    #[track_caller]
    pub fn new(vector: [i32; 3]) -> Self {
        let size = vector.map(i32::unsigned_abs);
        assert!(size != [0; 3], "a direction points somewhere");
        assert!(
            size.iter().all(|&c| c <= super::sphere::MAX_RADIUS),
            "components of directions are small"
        );
        let wide = size.map(u64::from);
        let product: u64 = wide.iter().filter(|&&c| c > 0).product();
        Self {
            vector,
            size,
            norm_squared: vector.iter().map(|&c| i64::from(c) * i64::from(c)).sum(),
            octant: (0..3).filter(|&a| vector[a] < 0).map(|a| 1 << a).sum(),
            step: wide.map(|c| product.checked_div(c).unwrap_or(NEVER)),
            reciprocal: wide.map(|c| (1_u64 << 32).div_ceil((2 * c).max(1))),
        }
    }

    /// Returns v.
    #[must_use]
    pub fn vector(&self) -> [i32; 3] {
        self.vector
    }

    /// Returns v · v.
    #[must_use]
    pub fn norm_squared(&self) -> i64 {
        self.norm_squared
    }

    /// Returns the time between crossings of each axis, in halves, in a unit that makes it an integer.
    pub(super) fn step(&self) -> [u64; 3] {
        self.step
    }

    /// Returns the octant: bit a is set where v_a is negative.
    #[must_use]
    pub fn octant(&self) -> usize {
        self.octant
    }

    /// Returns the axis along which a line leaves the voxel that it reached after `counts` crossings of each axis.
    #[must_use]
    pub fn next_axis(&self, counts: [u32; 3]) -> usize {
        let t: [u64; 3] = std::array::from_fn(|a| u64::from(2 * counts[a] + 1) * self.step[a]);
        first(t)
    }

    /// Returns the axis along which a line entered the voxel that it reached after `counts` crossings of each axis.
    ///
    /// The crossings up to `at_least` were counted before it began; `None` where it begins.
    pub(super) fn last_axis(&self, counts: [u32; 3], at_least: [u32; 3]) -> Option<usize> {
        let is_crossed = |&a: &usize| counts[a] > at_least[a];
        // Of equal times the last axis: the first one was crossed before it.
        let time = |&a: &usize| (u64::from(2 * counts[a] - 1) * self.step[a], a);
        (0..3).filter(is_crossed).max_by_key(time)
    }

    /// Returns the voxel `counts` crossings away from `origin`.
    #[must_use]
    pub fn voxel(&self, origin: Voxel, counts: [u32; 3]) -> Voxel {
        std::array::from_fn(|a| {
            let count = counts[a].cast_signed();
            origin[a] + if self.octant >> a & 1 == 1 { -count } else { count }
        })
    }

    /// Returns the number of crossings of each axis that have happened once that of axis `a` with number `k` (from 0) has.
    pub(super) fn counts_after(&self, a: usize, k: u32) -> [u32; 3] {
        std::array::from_fn(|b| if b == a { k + 1 } else { self.count_before(b, a, k) })
    }

    /// Returns the number of crossings of axis b before crossing k of axis a.
    ///
    /// These are the crossings m with (2 m + 1) / |v_b| below (2 k + 1) / |v_a|, or equal to it if b comes before a.
    #[inline]
    fn count_before(&self, b: usize, a: usize, k: u32) -> u32 {
        // (2 m + 1) |v_a| ≤ (2 k + 1) |v_b| − [b after a], hence ⌊(that + |v_a|) / (2 |v_a|)⌋ of them.
        let bound = (2 * k + 1) * self.size[b] + self.size[a] - u32::from(b > a);
        ((u64::from(bound) * self.reciprocal[a]) >> 32) as u32
    }
}

/// Returns the axis whose crossing comes first; of equal ones the first axis.
#[inline]
pub(super) fn first([x, y, z]: [u64; 3]) -> usize {
    if x <= y {
        if x <= z { 0 } else { 2 }
    } else if y <= z {
        1
    } else {
        2
    }
}

/// A voxel of a line from which a walk continues, by its number of crossings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// The crossings of each axis so far.
    pub(super) counts: [u32; 3],
    /// The least number of crossings of each axis that counts: 1 along an axis where the walk runs one voxel ahead until the line has caught up.
    pub(super) at_least: [u32; 3],
}

/// Returns the rank of the first surface voxel of a line from `origin` along `direction`, from `place` on, that one included.
///
/// `None` if the line leaves the lattice. Empty cubes are crossed in one step each: the result is that of a voxel-by-voxel walk, with less work.
#[inline]
pub(super) fn first_surface(octree: &Octree, origin: Voxel, direction: &Direction, place: Place) -> Option<u32> {
    let padded = octree.padded_size();
    let n_bricks = octree.n_bricks();
    let cubes = octree.empty_cubes(direction.octant);
    let ahead = &AHEAD[direction.octant];
    // Coordinates that grow along the line; bit and brick are mirrored back where the lattice is read.
    let mut start = [0_u32; 3];
    let mut flip = [0_u32; 3];
    let mut flip_bit = 0;
    for a in 0..3 {
        let c = origin[a].cast_unsigned();
        if direction.octant >> a & 1 == 1 {
            start[a] = padded[a] - 1 - c;
            flip[a] = to_u32(n_bricks[a]) - 1;
            flip_bit |= 3 << (2 * a);
        } else {
            start[a] = c;
        }
    }
    let mirrored = |b: u32, a: usize| if direction.octant >> a & 1 == 1 { flip[a] - b } else { b };
    let mut counts = place.counts;
    loop {
        let at = [start[0] + counts[0], start[1] + counts[1], start[2] + counts[2]];
        if at[0] >= padded[0] || at[1] >= padded[1] || at[2] >= padded[2] {
            return None;
        }
        let b = at.map(|c| c >> 2);
        let index = |[x, y, z]: [u32; 3]| (z as usize * n_bricks[1] + y as usize) * n_bricks[0] + x as usize;
        let side = u32::from(cubes[index(b)]);
        if side == 0 {
            let brick = octree.brick_at(index([mirrored(b[0], 0), mirrored(b[1], 1), mirrored(b[2], 2)]));
            let mask = octree.mask(brick);
            let [x, y, z] = at.map(|c| c as usize & 3);
            // Most bricks have surface only behind the line or beside it: such a brick counts as empty.
            if mask & ahead[0][x] & ahead[1][y] & ahead[2][z] != 0 {
                if let Some(bit) = walk_brick(mask, at, flip_bit, direction, &mut counts) {
                    return octree.rank_in_brick(brick, bit);
                }
                continue;
            }
        }
        // The last crossing numbers inside the cube, and the first crossing out of it.
        let last: [u32; 3] = std::array::from_fn(|axis| 4 * (b[axis] + side.max(1)) - 1 - start[axis]);
        let a = direction.next_axis(last);
        let after = direction.counts_after(a, last[a]);
        counts = std::array::from_fn(|axis| after[axis].max(place.at_least[axis]));
    }
}

/// Follows a line through a brick from its voxel `at`, in coordinates that grow along the line.
///
/// Returns the bit of the first surface voxel, or `None` and in `counts` the crossings of the first voxel beyond the brick.
#[inline]
fn walk_brick(mask: u64, at: [u32; 3], flip_bit: u32, direction: &Direction, counts: &mut [u32; 3]) -> Option<u32> {
    let [mut tx, mut ty, mut tz]: [u64; 3] = std::array::from_fn(|a| u64::from(2 * counts[a] + 1) * direction.step[a]);
    let [dx, dy, dz] = direction.step.map(|step| 2 * step);
    let local = at.map(|c| c & 3);
    // Two bits for each coordinate and one above them, which is set when the line leaves the brick.
    let mut here = local[0] | local[1] << 3 | local[2] << 6;
    loop {
        let bit = (here & 3 | here >> 1 & 0b1100 | here >> 2 & 0b11_0000) ^ flip_bit;
        if mask >> bit & 1 == 1 {
            return Some(bit);
        }
        // Sums instead of branches, as the next axis is unpredictable. Of equal times that of the first axis, as in `first`.
        let is_x = tx <= ty && tx <= tz;
        let is_y = !is_x && ty <= tz;
        let is_z = !(is_x | is_y);
        tx += if is_x { dx } else { 0 };
        ty += if is_y { dy } else { 0 };
        tz += if is_z { dz } else { 0 };
        here += u32::from(is_x) | u32::from(is_y) << 3 | u32::from(is_z) << 6;
        if here & 0b100_100_100 != 0 {
            break;
        }
    }
    for (a, count) in counts.iter_mut().enumerate() {
        *count += (here >> (3 * a) & 7) - local[a];
    }
    None
}

/// By octant, axis and coordinate along the line: the bits of a brick's mask with that coordinate or a greater one.
pub(super) static AHEAD: [[[u64; 4]; 3]; 8] = bits_ahead();

const fn bits_ahead() -> [[[u64; 4]; 3]; 8] {
    let mut table = [[[0; 4]; 3]; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut axis = 0;
        while axis < 3 {
            let mut bit = 0;
            while bit < 64 {
                let coordinate = bit >> (2 * axis) & 3;
                let along = if octant >> axis & 1 == 1 {
                    3 - coordinate
                } else {
                    coordinate
                };
                let mut from = 0;
                while from <= along {
                    table[octant][axis][from] |= 1 << bit;
                    from += 1;
                }
                bit += 1;
            }
            axis += 1;
        }
        octant += 1;
    }
    table
}

/// Returns the rank of the first surface voxel of a line, voxel by voxel: the slow definition of [`first_surface`].
#[cfg(test)]
pub(super) fn first_surface_by_voxels(
    octree: &Octree,
    origin: Voxel,
    direction: &Direction,
    place: Place,
) -> Option<u32> {
    let mut counts = place.counts;
    loop {
        let voxel = direction.voxel(origin, counts);
        if (0..3).any(|a| voxel[a] < 0 || voxel[a].cast_unsigned() >= octree.padded_size()[a]) {
            return None;
        }
        if let Some(rank) = octree.rank(voxel) {
            return Some(rank);
        }
        counts[direction.next_axis(counts)] += 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// All voxels of a line's beginning, from the definition: crossings (2 k + 1) / (2 |v_a|) sorted as fractions.
    fn by_sorting(vector: [i32; 3], n: usize) -> Vec<Voxel> {
        let mut crossings: Vec<(i64, i64, usize)> = Vec::new();
        for (a, &component) in vector.iter().enumerate() {
            let c = i64::from(component.abs());
            if c > 0 {
                crossings.extend((0..300).map(|k| (2 * k + 1, c, a)));
            }
        }
        crossings.sort_by(|p, q| (p.0 * q.1).cmp(&(q.0 * p.1)).then(p.2.cmp(&q.2)));
        let mut voxel = [0; 3];
        let mut line = vec![voxel];
        for &(_, _, a) in crossings.iter().take(n) {
            voxel[a] += vector[a].signum();
            line.push(voxel);
        }
        line
    }

    fn vectors() -> impl Strategy<Value = [i32; 3]> {
        let small = prop::array::uniform3(-9..=9_i32);
        let large = prop::array::uniform3(-255..=255_i32);
        prop_oneof![small, large].prop_filter("a direction points somewhere", |v| *v != [0; 3])
    }

    proptest! {
        #[test]
        fn steps_follow_the_definition(vector in vectors()) {
            let direction = Direction::new(vector);
            let mut counts = [0; 3];
            let mut last = None;
            for expected in by_sorting(vector, 200) {
                prop_assert_eq!(direction.voxel([0; 3], counts), expected);
                prop_assert_eq!(direction.last_axis(counts, [0; 3]), last);
                let axis = direction.next_axis(counts);
                counts[axis] += 1;
                last = Some(axis);
            }
        }

        #[test]
        fn jumps_land_on_the_line(vector in vectors(), k in 0..4000_u32) {
            let direction = Direction::new(vector);
            for a in (0..3).filter(|&a| vector[a] != 0) {
                let after = direction.counts_after(a, k);
                for b in (0..3).filter(|&b| b != a) {
                    // By the definition, in exact fractions: crossings of b before that of a.
                    let before = |m: &i64| {
                        let left = (2 * m + 1) * i64::from(vector[a].abs());
                        let right = (2 * i64::from(k) + 1) * i64::from(vector[b].abs());
                        left < right || (left == right && b < a)
                    };
                    let expected = i64::from(after[b]);
                    prop_assert!(expected == 0 || before(&(expected - 1)));
                    prop_assert!(!before(&expected));
                }
            }
        }

        #[test]
        fn leaves_and_voxels_give_the_same_walk(
            vector in vectors(),
            size in prop::array::uniform3(1..70_i32),
            seeds in prop::collection::vec(prop::array::uniform3(0.0..1.0_f64), 0..40),
            from in prop::array::uniform3(0.0..1.0_f64),
            lift in 0..4_usize,
        ) {
            #[expect(clippy::cast_possible_truncation, reason = "a fraction of a small number")]
            let voxel = |f: [f64; 3]| std::array::from_fn(|a| (f[a] * f64::from(size[a])) as i32);
            let voxels: Vec<Voxel> = seeds.iter().map(|&f| voxel(f)).collect();
            let tree = Octree::build(size, &voxels).octree;
            let direction = Direction::new(vector);
            let mut at_least = [0; 3];
            if lift < 3 && vector[lift] != 0 {
                at_least[lift] = 1;
            }
            let place = Place { counts: at_least, at_least };
            let slow = first_surface_by_voxels(&tree, voxel(from), &direction, place);
            prop_assert_eq!(first_surface(&tree, voxel(from), &direction, place), slow);
        }
    }
}
