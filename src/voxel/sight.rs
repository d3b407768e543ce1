//! The first hit of a voxel in a direction: I(x, v).

use super::discretize::{Normal, VoxelScene};
use super::grid::Voxel;
use super::line::{Direction, Place, first_surface};
use super::thin::{AT_CENTRE, Side, THIN};

/// The hit at the end of a discrete line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// The front of a surfel.
    Surfel(u32),
    /// The back of a surface: black.
    Back,
    /// No hit: the line leaves the scene.
    Escaped,
}

/// The binary digits of the tolerance on a voxel's height of 1, 2⁻¹⁶, which is above the error of integer heights.
const HEIGHT_SLACK: u32 = 16;

impl VoxelScene {
    /// Returns the first hit of surfel `surfel` along `direction`, I(x, v), by integer arithmetic only.
    ///
    /// [`Self::sights`] returns the same for many surfels and directions in a fraction of the time.
    ///
    /// The starting rule. Let n be the surfel's normal, a the axis of its largest component, and the height of a voxel over x its distance from x's plane
    /// measured along a. All voxels of a plane have heights in (−1, 1) over one another.
    /// 1. Another surfel of the voxel x itself is seen if it faces the line and if the two faces rise above each other's planes, as in the corner of a room. The edge of a
    ///    table and the two sides of a sheet do not.
    /// 2. As long as the line's voxel has a height below 1, the voxel above it (along a, towards the front) at a height in \[1, 2) is tested in its place; once
    ///    the line is so high that its voxels stay above 1, its own. Where the tested voxels do not adjoin, those between them are tested too: they form a
    ///    6-path that begins in front of x, not in the surface.
    /// 3. The first surface voxel on that path ends it. Until the path has met a free voxel, surface voxels all of whose surfels face away from the
    ///    line do not count: x then touches another surface and looks away from it.
    ///
    /// So a plane never hides from itself, and a line from the inside of a 6-separating surface does not get out.
    /// Of several surfels in the voxel seen, the one counts that faces the line most. If all face away, the hit is a back, unless one does so by less than 17.5°, cos = 0.3: lines that graze
    /// a silhouette meet the voxels just behind it, because surfaces are one voxel thick, and must see the object, not darkness.
    ///
    /// Source: [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002), section 4.1, step 1 to 4; the choice of the first voxel ("a bit tricky") is ours.
    /// Near [thin walls](Self::thin_walls) the path keeps to voxels whose centres are in the air in front of x, and of a voxel's surfels only those count that look
    /// to its origin: so no line passes a closed surface, however thin.
    #[must_use]
    pub fn sight(&self, surfel: usize, direction: &Direction) -> Sight {
        match self.start(surfel, direction) {
            Start::Own(seen) => seen,
            Start::Seen(rank, side) => self.front(rank, direction, || side),
            Start::Free(place) => self.sight_from(surfel, direction, place),
        }
    }

    /// Returns the hit of the line of surfel `surfel` from `place` on.
    pub(super) fn sight_from(&self, surfel: usize, direction: &Direction, mut place: Place) -> Sight {
        let voxel = self.surfels[surfel].voxel();
        while let Some(rank) = first_surface(&self.octree, voxel, direction, place) {
            let way = || self.way_through(rank, voxel, direction, place.at_least);
            if !self.lets_pass(rank, direction, false, way) {
                return self.front(rank, direction, || way().0);
            }
            place.counts = self.counts_to(rank, voxel);
            place.counts[direction.next_axis(place.counts)] += 1;
        }
        Sight::Escaped
    }

    /// Returns the start of the line of surfel `surfel` along `direction`.
    pub(super) fn start(&self, surfel: usize, direction: &Direction) -> Start {
        if let Some(seen) = self.seen_in_own_voxel(surfel, direction) {
            return Start::Own(seen);
        }
        let x = &self.surfels[surfel];
        let normal = &self.normals[x.normal as usize];
        let up = side(normal.axis, normal.integer[normal.axis] > 0);
        if self.nodes(surfel) >> up & 1 == 0 {
            return self.start_beside(surfel, direction);
        }
        if normal.is_axis_aligned() {
            self.leave_surfaces(x.voxel(), direction, start_from_axis(normal))
        } else {
            self.start_from_slope(x.voxel(), normal, direction)
        }
    }

    /// Returns the start near a thin wall, where x does not look to the voxel above it.
    ///
    /// The line starts from its own voxel's centre or, if x does not look there, from a neighbour's towards which it goes.
    fn start_beside(&self, surfel: usize, direction: &Direction) -> Start {
        let nodes = self.nodes(surfel);
        let mut counts = [0; 3];
        if nodes >> AT_CENTRE & 1 == 0 {
            let normal = self.normal(surfel);
            let v = direction.vector();
            let towards = |&a: &usize| v[a] != 0 && nodes >> side(a, v[a] > 0) & 1 == 1;
            let out = |a: &usize| normal.integer[*a] * v[*a].signum();
            match (0..3).filter(towards).max_by_key(out) {
                Some(a) => counts[a] = 1,
                None => return Start::Own(Sight::Back),
            }
        }
        let place = Place {
            counts,
            at_least: counts,
        };
        self.leave_surfaces(self.surfels[surfel].voxel(), direction, place)
    }

    /// Returns the surfel of the voxel itself that the line sees before it begins.
    pub(super) fn seen_in_own_voxel(&self, surfel: usize, direction: &Direction) -> Option<Sight> {
        let x = &self.surfels[surfel];
        if !x.faces_any() {
            return None;
        }
        let rank = self.octree.rank(x.voxel())?;
        let range = self.surfels_of(rank);
        let faced = range.clone().filter(|&s| x.faces(s - range.start));
        self.most_facing(faced, direction).map(Sight::Surfel)
    }

    /// Returns the hit of a line in the surface voxel of a rank, which it enters from `side`.
    pub(super) fn front(&self, rank: u32, direction: &Direction, side: impl FnOnce() -> Side) -> Sight {
        let range = self.surfels_of(rank);
        // Where several surfels face the line alike, the first.
        let (mut dot, mut surfel) = (i64::MAX, range.start);
        let mut see = |s: usize, normal: u32| {
            let towards = self.normals[normal as usize].dot(direction.vector());
            if towards < dot {
                (dot, surfel) = (towards, s);
            }
        };
        if self.normal_of[range.start] & THIN == 0 {
            range.for_each(|s| see(s, self.normal_of[s]));
        } else {
            let side = side();
            range
                .filter(|&s| self.nodes(s) >> side & 1 == 1)
                .for_each(|s| see(s, self.normal_of[s] & !THIN));
        }
        if dot < 0 || dot < i64::MAX && is_grazing(dot, direction) {
            Sight::Surfel(id(surfel))
        } else {
            Sight::Back
        }
    }

    fn most_facing(&self, surfels: impl Iterator<Item = usize>, direction: &Direction) -> Option<u32> {
        let towards = |s: usize| (self.normal(s).dot(direction.vector()), s);
        let seen = surfels.map(towards).filter(|(dot, _)| *dot < 0).min();
        seen.map(|(_, s)| id(s))
    }

    /// Returns whether the line continues through the surface voxel of a rank, which it enters and leaves by the sides of `way`.
    ///
    /// It does so while it is `leaving` the surface in which it begins, if all of the voxel's surfels face away. Near thin walls it does so wherever no face is in its way
    /// and all surfels that look to its origin face away: it passes in front of them.
    pub(super) fn lets_pass(
        &self,
        rank: u32,
        direction: &Direction,
        leaving: bool,
        way: impl FnOnce() -> (Side, Side),
    ) -> bool {
        let mut range = self.surfels_of(rank);
        let first = range.start;
        let faces_away = |s: usize| self.normal(s).dot(direction.vector()) >= 0;
        if self.normal_of[first] & THIN == 0 {
            return leaving && range.all(faces_away);
        }
        let (from, to) = way();
        let crossed = self.crossed(first);
        crossed >> from & 1 == 0
            && crossed >> to & 1 == 0
            && range.all(|s| self.nodes(s) >> from & 1 == 0 || faces_away(s))
    }

    /// Returns the numbers of crossings after which a line from `origin` is in the voxel of a rank.
    fn counts_to(&self, rank: u32, origin: Voxel) -> [u32; 3] {
        let voxel = self.surfels[self.surfels_of(rank).start].voxel();
        std::array::from_fn(|a| (voxel[a] - origin[a]).unsigned_abs())
    }

    /// Returns the sides by which the line from `origin` enters and leaves the voxel of a rank, which it meets.
    pub(super) fn way_through(
        &self,
        rank: u32,
        origin: Voxel,
        direction: &Direction,
        at_least: [u32; 3],
    ) -> (Side, Side) {
        let counts = self.counts_to(rank, origin);
        let goes_up = |a: usize| direction.vector()[a] > 0;
        let next = direction.next_axis(counts);
        let entered = direction.last_axis(counts, at_least);
        (
            entered.map_or(AT_CENTRE, |a| side(a, !goes_up(a))),
            side(next, goes_up(next)),
        )
    }

    /// Follows the line until it is in a free voxel or sees a front.
    fn leave_surfaces(&self, voxel: Voxel, direction: &Direction, mut place: Place) -> Start {
        while let Some(rank) = self.octree.rank(direction.voxel(voxel, place.counts)) {
            let way = || self.way_through(rank, voxel, direction, place.at_least);
            if !self.lets_pass(rank, direction, true, way) {
                return Start::Seen(rank, way().0);
            }
            place.counts[direction.next_axis(place.counts)] += 1;
        }
        Start::Free(place)
    }

    fn start_from_slope(&self, voxel: Voxel, normal: &Normal, direction: &Direction) -> Start {
        let axis = normal.axis;
        let up = normal.integer[axis].signum();
        let unit = i64::from(normal.integer[axis].unsigned_abs());
        let one = unit - (unit >> HEIGHT_SLACK);
        // The voxels of a line stray from it by up to half of this height, up and down: once one is so far above 1, no later one falls below 1.
        let stray: i64 = normal.integer.iter().map(|n| i64::from(n.unsigned_abs())).sum();
        let clear = one + stray;
        // The height of the tested voxel above one of known height.
        let lift_at = |height: i64| {
            let missing = (one - height).max(0);
            i32::try_from((missing + unit - 1) / unit).expect("the depth of a voxel under a plane, in voxels")
        };
        let mut counts = [0; 3];
        let mut height = 0;
        let mut lift = 1;
        let mut previous = voxel;
        let mut met_free = false;
        let mut looked_at: Option<Voxel> = None;
        // Returns the surface voxel that ends the path, and the side by which the path enters it.
        let mut look = |place: Voxel| {
            let before = looked_at.replace(place);
            let rank = self.octree.rank(place);
            let from = before.map_or(AT_CENTRE, |before| side_towards(place, before));
            if let Some(before) = before
                && let Some(left) = self.octree.rank(before)
                && self.crossed(self.surfels_of(left).start) >> side_towards(before, place) & 1 == 1
            {
                return Some((left, AT_CENTRE));
            }
            match rank {
                None => {
                    met_free = true;
                    None
                }
                // The side by which the path leaves this voxel is known at the next one.
                Some(rank) => {
                    let passes = self.lets_pass(rank, direction, !met_free, || (from, AT_CENTRE));
                    (!passes).then_some((rank, from))
                }
            }
        };
        let lifted = |mut place: Voxel, by: i32| {
            place[axis] += up * by;
            place
        };
        if let Some((rank, side)) = look(lifted(voxel, lift)) {
            return Start::Seen(rank, side);
        }
        loop {
            let step = direction.next_axis(counts);
            counts[step] += 1;
            let at = direction.voxel(voxel, counts);
            height += i64::from(normal.integer[step]) * i64::from(direction.vector()[step].signum());
            let next = lift_at(height);
            // Up before going sideways, down after it: never through a height below 1. A step along the axis may leave the tested voxel in place.
            let (top, seen_last) = (lift.max(next), lifted(previous, lift));
            let rising = (lift + 1..=top).filter(|_| step != axis).map(|k| lifted(previous, k));
            let falling = (next..=top)
                .rev()
                .filter(|&k| step != axis || k == next)
                .map(|k| lifted(at, k));
            let mut path = rising.chain(falling).filter(|&v| v != seen_last);
            if let Some((rank, side)) = path.find_map(&mut look) {
                return Start::Seen(rank, side);
            }
            previous = at;
            lift = next;
            if height >= clear {
                break;
            }
            // The line may leave the lattice before the voxels above it do.
            if self.is_outside(at) && self.is_outside(lifted(at, lift)) {
                return Start::Free(Place {
                    counts,
                    at_least: [0; 3],
                });
            }
        }
        let place = Place {
            counts,
            at_least: [0; 3],
        };
        if met_free {
            Start::Free(place)
        } else {
            self.leave_surfaces(voxel, direction, place)
        }
    }

    fn is_outside(&self, voxel: Voxel) -> bool {
        (0..3).any(|a| voxel[a] < 0 || voxel[a] >= self.grid.n_voxels[a])
    }
}

/// Returns the start from a plane across an axis: the line runs one voxel ahead along it until it has caught up.
pub(super) fn start_from_axis(normal: &Normal) -> Place {
    let mut at_least = [0; 3];
    at_least[normal.axis] = 1;
    Place {
        counts: at_least,
        at_least,
    }
}

/// Returns the side of a voxel along an axis.
fn side(axis: usize, upper: bool) -> Side {
    2 * u32::try_from(axis).expect("an axis") + u32::from(upper)
}

/// Returns the side of a voxel that a neighbour of it touches.
fn side_towards(voxel: Voxel, neighbour: Voxel) -> Side {
    let axis = (0..3).find(|&a| voxel[a] != neighbour[a]);
    axis.map_or(AT_CENTRE, |a| side(a, neighbour[a] > voxel[a]))
}

/// Returns whether n · v (n in units of 2⁻³⁰) is less than 0.3 |v|.
fn is_grazing(dot: i64, direction: &Direction) -> bool {
    // The upper 14 bits of n: squares of both sides then fit into 64 bits.
    let coarse = dot >> 16;
    100 * coarse * coarse < 9 * (1 << 28) * direction.norm_squared()
}

fn id(surfel: usize) -> u32 {
    u32::try_from(surfel).expect("surfels are counted in 32 bits")
}

/// The start of a line.
pub(super) enum Start {
    /// It ends in its own voxel.
    Own(Sight),
    /// It sees a surface voxel at once, by rank, from a side of it.
    Seen(u32, Side),
    /// It continues from here.
    Free(Place),
}
