//! The shaft between two convex polygons: the convex hull in which all segments between them run.

use std::borrow::Cow;
use std::cell::OnceCell;

use glam::DVec3;

use crate::geometry::clip::{clip_contour, clip_to_half_space};
use crate::geometry::polygon;

/// A plane; heights over it are n · x − level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    /// The unit normal.
    pub(crate) normal: DVec3,
    /// n · x on the plane, in m.
    pub(crate) level: f64,
}

impl Plane {
    /// Returns the plane of a polygon, its front up; the normal is zero where the polygon has no area.
    pub(crate) fn of(corners: &[DVec3]) -> Self {
        let normal = polygon::area_vector(corners).normalize_or_zero();
        Self {
            normal,
            level: normal.dot(corners[0]),
        }
    }

    pub(crate) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.level
    }
}

/// The convex hull of two convex planar polygons that face each other.
///
/// What of each polygon lies behind the other's plane is cut off first, because light does not go there. The hull is the set of all
/// points on segments between the two, so that a face that does not meet its interior cannot block any light between them.
///
/// Lengths below 1e-10 of the diameter of both polygons (and 16 ulps of the largest coordinate) count as zero beside the hull: a face that reaches less deep into it from there does not meet its interior.
/// Walls that share an edge with one of the polygons thus stay outside in spite of rounding. What is neglected is a
/// blocker's border of that width: for patches of size s at the distance D it changes F by less than about 1e-10 s/D.
/// In front of either polygon only what rounding to 16 ulps explains counts as zero, as far as it turns the polygon's plane: a thin gap may part two faces, one of which hides all from the other.
/// Where the corners themselves were rounded, `slack` is added to both ([`Scene::slack`](crate::scene::Scene::slack)).
#[derive(Debug)]
pub(crate) struct Shaft<'a> {
    ends: [Cow<'a, [DVec3]>; 2],
    planes: [Plane; 2],
    sides: OnceCell<Vec<Side>>,
    low: DVec3,
    high: DVec3,
    tolerance: f64,
    /// 16 ulps of the largest coordinate.
    rounding: f64,
    polygons: [&'a [DVec3]; 2],
    leans: OnceCell<[Lean; 2]>,
    /// The part of the tolerance that is due to rounded corners.
    slack: f64,
}

/// A plane with both ends on its upper side.
#[derive(Clone, Copy, Debug)]
struct Side {
    plane: Plane,
    /// True if it is the plane of an end, where nothing is a mere border.
    is_end: bool,
}

/// The tolerance of a shaft in units of its diameter.
const RELATIVE_TOLERANCE: f64 = 1e-10;

/// A height counts as seen from this part of the distance and the size of a polygon on: from about where two patches count as facing each other.
const SEEN: f64 = 2e-14;

/// Normals of one plane differ by less: ends that touch each other's plane may cross it by a tolerance.
const SAME_PLANE: f64 = 1e-8;

/// Three corners are on one line, and make no plane, up to this square of a sine. Above it rounding may still turn the plane about that line; both ends must then be on one side of it all the same.
const ON_LINE: f64 = 1e-24;

/// Beyond a polygon, so many times its width off, its plane is asked no more what rounding has made of it.
const MOST_LEAN: f64 = 100.0;

/// How the plane of a polygon leans where the polygon's corners are rounded: as much more as the polygon is narrow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lean {
    middle: DVec3,
    reach: f64,
    /// The area by the greatest length.
    width: f64,
}

impl Lean {
    pub(crate) fn of(corners: &[DVec3]) -> Self {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        let reach = corners.iter().map(|v| v.distance(middle)).fold(0.0, f64::max);
        Self {
            middle,
            reach,
            width: polygon::area_vector(corners).length() / (2.0 * reach),
        }
    }

    fn distance(&self, point: DVec3) -> f64 {
        self.middle.distance(point)
    }

    /// Returns how far off the plane a point may seem that lies in it, where corners are off by `slack`.
    pub(crate) fn height(&self, slack: f64, point: DVec3) -> f64 {
        slack * (1.0 + (self.distance(point) / self.width).min(MOST_LEAN))
    }
}

impl<'a> Shaft<'a> {
    /// Returns the shaft, or `None` if no point of one polygon's front sees the other's front. What reaches into it by less than `slack`, m, counts as touching.
    pub(crate) fn new(p: &'a [DVec3], q: &'a [DVec3], slack: f64) -> Option<Self> {
        let planes = [Plane::of(p), Plane::of(q)];
        let (all_low, all_high) = bounds(p.iter().chain(q));
        let largest = all_low.abs().max(all_high.abs()).max_element();
        let rounding = 16.0 * f64::EPSILON * largest;
        let diameter = (all_high - all_low).length();
        let tolerance = RELATIVE_TOLERANCE * diameter + rounding;
        // Face to face, they see all of each other through the narrowest gap.
        let least = if planes[0].normal.distance_squared(-planes[1].normal) < SAME_PLANE * SAME_PLANE {
            SEEN * diameter + rounding
        } else {
            tolerance
        };
        let ends = [in_front(p, &planes[1], least)?, in_front(q, &planes[0], least)?];
        let (low, high) = bounds(ends[0].iter().chain(ends[1].iter()));
        Some(Self {
            ends,
            planes,
            sides: OnceCell::new(),
            low,
            high,
            tolerance: tolerance + slack,
            rounding,
            polygons: [p, q],
            leans: OnceCell::new(),
            slack,
        })
    }

    /// Tells whether a box may meet the hull's interior. May err on the side of true.
    pub(crate) fn may_meet_box(&self, low: DVec3, high: DVec3) -> bool {
        if self.low.cmpgt(high).any() || self.high.cmplt(low).any() {
            return false;
        }
        let (middle, reach) = (low.midpoint(high), (high - low) * 0.5);
        let highest = |plane: &Plane| plane.height(middle) + plane.normal.abs().dot(reach);
        self.planes.iter().all(|plane| highest(plane) > self.rounding)
            && self
                .sides()
                .iter()
                .all(|side| highest(&side.plane) > self.tolerance_of(side))
    }

    /// Tells whether a convex polygon meets the hull's interior. May err on the side of true.
    pub(crate) fn meets(&self, corners: &[DVec3]) -> bool {
        self.meets_beyond(corners, self.slack)
    }

    /// Tells whether a convex polygon that does not meet the hull's interior would meet it if corners were not rounded.
    pub(crate) fn is_touched_by(&self, corners: &[DVec3]) -> bool {
        self.slack > 0.0 && self.meets_beyond(corners, 0.0)
    }

    /// Returns how far a face may reach in from a side, rounded corners aside.
    fn tolerance_of(&self, side: &Side) -> f64 {
        if side.is_end {
            self.rounding
        } else {
            self.tolerance - self.slack
        }
    }

    /// Tells whether a convex polygon meets the hull's interior deeper than rounding explains, and by `slack` more.
    fn meets_beyond(&self, corners: &[DVec3], slack: f64) -> bool {
        let reaches = |plane: &Plane, tolerance: f64| corners.iter().any(|&v| plane.height(v) > tolerance + slack);
        let is_beside = |side: &Side| !reaches(&side.plane, self.tolerance_of(side));
        if !self.planes.iter().all(|plane| reaches(plane, self.rounding)) || self.sides().iter().any(is_beside) {
            return false;
        }
        // No single plane parts them: cut the polygon down to what is inside.
        let mut inside = corners.to_vec();
        let mut part = Vec::with_capacity(2 * corners.len() + 4);
        let of_ends = self.planes.iter().map(|plane| (plane, self.rounding));
        let of_sides = self.sides().iter().map(|side| (&side.plane, self.tolerance_of(side)));
        for (plane, tolerance) in of_ends.chain(of_sides) {
            let height = |v: DVec3| plane.height(v) - tolerance - slack;
            if inside.iter().any(|&v| height(v) < 0.0) {
                part.clear();
                clip_contour(inside.len(), |k| inside[k], height, |v| part.push(v));
                std::mem::swap(&mut inside, &mut part);
            }
            if inside.is_empty() {
                return false;
            }
        }
        // The nearer it is to an end, the less has rounding to do with its height.
        let leans = self.leans.get_or_init(|| self.polygons.map(Lean::of));
        self.planes.iter().zip(leans).all(|(plane, lean)| {
            let mut heights = inside.iter().map(|&v| (v, plane.height(v) - slack));
            heights.any(|(v, height)| {
                height
                    > lean
                        .height(self.rounding, v)
                        .max(SEEN * (lean.reach + lean.distance(v)))
            })
        })
    }

    /// Tells whether one convex polygon stops all light: whether every segment between the two ends crosses it.
    pub(crate) fn is_closed_by(&self, corners: &[DVec3], plane: &Plane) -> bool {
        let tolerance_squared = self.tolerance * self.tolerance;
        self.section_lies_in(plane, |point| {
            (0..corners.len()).all(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                let inward = plane.normal.cross(b - a);
                let height = inward.dot(point - a);
                height >= 0.0 || height * height <= tolerance_squared * inward.length_squared()
            })
        })
    }

    /// Tells whether every segment between the two ends goes through the inside of a convex solid.
    ///
    /// Looks at one section of the shaft, through `middle` and across the line between the ends' centres; errs on the side of false.
    pub(crate) fn is_closed_by_solid(&self, middle: DVec3, planes: &[Plane]) -> bool {
        let [from, to] = self
            .ends
            .each_ref()
            .map(|end| end.iter().sum::<DVec3>() / end.len() as f64);
        let normal = (to - from).normalize_or_zero();
        let across = Plane {
            normal,
            level: normal.dot(middle),
        };
        self.section_lies_in(&across, |point| {
            planes.iter().all(|plane| plane.height(point) < -self.tolerance)
        })
    }

    /// Tells whether a plane parts the two ends, and its section with the hull lies in a convex set.
    ///
    /// The section is the convex hull of the points in which the segments between corners cross the plane.
    fn section_lies_in(&self, plane: &Plane, contains: impl Fn(DVec3) -> bool) -> bool {
        let on_side = |k: usize, sign: f64| {
            let mut heights = self.ends[k].iter().map(|&v| plane.height(v) * sign);
            heights.all(|height| height >= -self.tolerance)
        };
        if !(on_side(0, 1.0) && on_side(1, -1.0) || on_side(0, -1.0) && on_side(1, 1.0)) {
            return false;
        }
        self.ends[0].iter().all(|&a| {
            let height_a = plane.height(a);
            self.ends[1].iter().all(|&b| {
                let drop = height_a - plane.height(b);
                drop.abs() > 2.0 * self.tolerance && contains(a + (b - a) * (height_a / drop))
            })
        })
    }

    /// Tells whether a plane is that of an end but for a tolerance: an end that stands on the plane of the other has that plane for a side.
    fn is_plane_of_an_end(&self, plane: &Plane) -> bool {
        let mut ends = self.planes.iter();
        ends.any(|end| end.normal.distance_squared(plane.normal) < SAME_PLANE * SAME_PLANE)
    }

    /// Returns the planes through an edge of one end and a corner of the other that have all of both on their upper side.
    ///
    /// Seen along an edge, its own end lies to one side in one line, and the other end above that line: the corner that is
    /// farthest round from the one side gives the only such plane besides that of the end itself.
    fn sides(&self) -> &[Side] {
        self.sides.get_or_init(|| {
            let mut sides = Vec::with_capacity(self.ends[0].len() + self.ends[1].len());
            for k in 0..2 {
                let (near, far, up) = (&self.ends[k], &self.ends[1 - k], self.planes[k].normal);
                let mut a = near[near.len() - 1];
                for &b in near.iter() {
                    let (start, edge) = (a, b - a);
                    a = b;
                    let (inward, scale_squared) = (up.cross(edge), edge.length_squared());
                    let scale = scale_squared.sqrt();
                    let plane_to = |c: DVec3| {
                        let normal = edge.cross(c - start);
                        // A plane through three corners nearly on a line says nothing.
                        (normal.length_squared() > ON_LINE * scale_squared * (c - start).length_squared())
                            .then(|| normal.normalize())
                            .and_then(|normal| {
                                self.turned_inwards(Plane {
                                    normal,
                                    level: normal.dot(start),
                                })
                            })
                    };
                    let mut farthest: Option<(DVec3, f64, f64)> = None;
                    for &c in far.iter() {
                        let across = c - start;
                        let (x, y) = (inward.dot(across), up.dot(across) * scale);
                        let is_off = x * x + y * y > ON_LINE * scale_squared * across.length_squared();
                        if is_off && farthest.is_none_or(|(_, u, v)| u * y > v * x) {
                            farthest = Some((c, x, y));
                        }
                    }
                    let found = farthest.and_then(|(c, ..)| plane_to(c));
                    // Rounding may have chosen a corner that is too near to the edge to tell.
                    let side = found.or_else(|| far.iter().find_map(|&c| plane_to(c)));
                    sides.extend(side.map(|plane| Side {
                        plane,
                        is_end: self.is_plane_of_an_end(&plane),
                    }));
                }
            }
            sides
        })
    }

    /// Returns the plane with both ends on its upper side, if they are on one side.
    fn turned_inwards(&self, plane: Plane) -> Option<Plane> {
        let slack = 0.5 * self.tolerance;
        let (mut below, mut above) = (false, false);
        for end in &self.ends {
            for &v in end.iter() {
                let height = plane.height(v);
                below |= height < -slack;
                above |= height > slack;
            }
        }
        if above == below {
            return None;
        }
        Some(if above {
            plane
        } else {
            Plane {
                normal: -plane.normal,
                level: -plane.level,
            }
        })
    }
}

fn bounds<'v>(corners: impl Iterator<Item = &'v DVec3>) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    corners.fold(none, |(low, high), &v| (low.min(v), high.max(v)))
}

/// Returns the part of a polygon in front of a plane; `None` if there is none.
fn in_front<'a>(corners: &'a [DVec3], plane: &Plane, tolerance: f64) -> Option<Cow<'a, [DVec3]>> {
    let (mut above, mut below) = (false, false);
    for &v in corners {
        let height = plane.height(v);
        above |= height > tolerance;
        below |= height < -tolerance;
    }
    match (above, below) {
        (false, _) => None,
        (true, false) => Some(Cow::Borrowed(corners)),
        (true, true) => Some(Cow::Owned(clip_to_half_space(
            corners,
            plane.normal * plane.level,
            plane.normal,
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(c: DVec3, a: DVec3, b: DVec3) -> Vec<DVec3> {
        vec![c, c + a, c + a + b, c + b]
    }

    fn facing_squares() -> [Vec<DVec3>; 2] {
        [
            rectangle(DVec3::ZERO, DVec3::X, DVec3::Y),
            rectangle(DVec3::Z, DVec3::Y, DVec3::X),
        ]
    }

    #[test]
    fn polygons_that_do_not_face_each_other_have_no_shaft() {
        let [p, q] = facing_squares();
        assert!(Shaft::new(&p, &q, 0.0).is_some());
        let turned: Vec<DVec3> = q.iter().rev().copied().collect();
        assert!(Shaft::new(&p, &turned, 0.0).is_none() && Shaft::new(&turned, &p, 0.0).is_none());
        let beside = rectangle(DVec3::X, DVec3::X, DVec3::Y);
        assert!(Shaft::new(&p, &beside, 0.0).is_none());
    }

    #[test]
    fn faces_that_only_touch_the_hull_do_not_meet_it() {
        let [p, q] = facing_squares();
        let shaft = Shaft::new(&p, &q, 0.0).expect("they face each other");
        let wall = rectangle(DVec3::ZERO, DVec3::Y, DVec3::Z);
        let floor = rectangle(DVec3::new(-5.0, -5.0, 0.0), DVec3::X * 10.0, DVec3::Y * 10.0);
        let moved = |face: &[DVec3], by: DVec3| face.iter().map(|&v| v + by).collect::<Vec<_>>();
        for shift in [-1e-11, 0.0, 1e-11] {
            assert!(!shaft.meets(&moved(&wall, DVec3::X * shift)), "{shift}");
        }
        // A border that narrow hides nothing to speak of, but a sheet before the whole polygon hides all.
        for (shift, meets) in [
            (-1e-11, false),
            (0.0, false),
            (1e-15, false),
            (1e-13, true),
            (1e-11, true),
        ] {
            assert_eq!(shaft.meets(&moved(&floor, DVec3::Z * shift)), meets, "{shift}");
        }
        assert!(shaft.meets(&rectangle(DVec3::X * 1e-6, DVec3::Y, DVec3::Z)));
        // A corner that reaches in between all the planes' tests needs the cut: this triangle passes by an edge of the hull.
        let passing = [
            DVec3::new(1.3, 0.5, 0.5),
            DVec3::new(0.5, 1.3, 0.4),
            DVec3::new(1.3, 1.3, 0.6),
        ];
        assert!(shaft.meets(&passing));
        let outside = passing.map(|v| v + DVec3::new(0.15, 0.15, 0.0));
        assert!(!shaft.meets(&outside));
    }

    #[test]
    fn a_shaft_is_closed_by_a_face_that_covers_its_section() {
        let [p, q] = facing_squares();
        let shaft = Shaft::new(&p, &q, 0.0).expect("they face each other");
        let closed_by = |face: &[DVec3]| shaft.is_closed_by(face, &Plane::of(face));
        let section = rectangle(DVec3::Z * 0.5, DVec3::X, DVec3::Y);
        assert!(closed_by(&section));
        assert!(closed_by(&section.iter().rev().copied().collect::<Vec<_>>()));
        assert!(!closed_by(&rectangle(DVec3::Z * 0.5, DVec3::X * 0.999, DVec3::Y)));
        let slanted = rectangle(DVec3::new(-1.0, -1.0, 0.2), DVec3::new(3.0, 0.0, 0.5), DVec3::Y * 3.0);
        assert!(closed_by(&slanted));
    }

    #[test]
    fn only_what_faces_the_other_counts() {
        // The upper half of a wall that starts below the floor.
        let [p, _] = facing_squares();
        let wall = rectangle(DVec3::new(2.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::Y);
        let shaft = Shaft::new(&p, &wall, 0.0).expect("the upper half sees the floor");
        assert!(!shaft.meets(&rectangle(DVec3::new(1.5, 0.0, -0.5), DVec3::X * 0.1, DVec3::Y)));
        assert!(shaft.meets(&rectangle(DVec3::new(1.5, 0.0, 0.1), DVec3::X * 0.1, DVec3::Y)));
    }
}
