//! The shaft between two convex polygons: the convex hull in which all segments between them run.

use std::borrow::Cow;
use std::cell::{OnceCell, RefCell};

use glam::DVec3;

use super::plane::{Lean, Plane, largest, rounding};
use crate::geometry::clip::{clip_contour, clip_to_half_space};

/// A plane through an edge of one end of a shaft and a corner of the other, with the shaft above it but for a neglected border.
#[derive(Clone, Copy, Debug)]
struct Side {
    plane: Plane,
    /// The height over the plane up to which points are neglected, in m.
    raised: f64,
}

/// The convex hull of two convex planar polygons that face each other.
///
/// The part of each polygon behind the other's plane is cut off first, because light does not go there. The hull is the set of all
/// points on segments between the two, so that a face outside its interior cannot block any light between them.
///
/// A face counts as outside if it reaches into the hull by less than 1e-10 of the hull's width *there*, or by less than the effect there of 16 ulps of the coordinates of the three corners
/// that a side of the hull goes through. Walls that share an edge with one of the polygons thus stay outside in spite of rounding. The neglected part is an
/// occluder's border of that width, some 1e-10 of F. Neither grows with the distance of the other polygon: the width beside a small patch is that patch's, however far off
/// or large the other is, and a far corner's rounding moves a side only as much as the side is near to it.
/// In front of either polygon only the effect of rounding to 16 ulps, as far as it turns the polygon's plane, counts as zero: a thin gap may separate two faces, one of which hides all from the other.
/// Where the corners themselves were rounded, `slack` is added to both ([`Scene::slack`](crate::scene::Scene::slack)).
#[derive(Debug)]
pub(crate) struct Shaft<'a> {
    ends: [End<'a>; 2],
    /// The side through each edge of both, computed when first needed: the first few separate most polygons from the shaft.
    sides: OnceCell<Box<[OnceCell<Option<Side>>]>>,
    low: DVec3,
    high: DVec3,
    /// The lean of the smaller end.
    smaller: Lean,
    /// The overlap below which rounded corners are the cause.
    slack: f64,
}

/// One of the two polygons.
#[derive(Debug)]
struct End<'a> {
    /// The part in front of the other's plane.
    part: Cow<'a, [DVec3]>,
    plane: Plane,
    /// 16 ulps of the largest coordinate.
    rounding: f64,
    /// The height over its plane up to which points count as in it.
    least_height: f64,
    lean: Lean,
    /// The width and the rounding up to which they add to the neglected border: of the larger end, those that are seen from the smaller one.
    most: [f64; 2],
}

thread_local! {
    /// The rest of a polygon while it is cut: a test of an occluder uses no memory of its own.
    static CUT: RefCell<[Vec<DVec3>; 2]> = const { RefCell::new([Vec::new(), Vec::new()]) };
}

/// The width of a shaft's neglected border in units of its own width.
const RELATIVE_TOLERANCE: f64 = 1e-10;

/// The greatest change of the neglected border by the distance between both ends; where it would change more, it is the lesser of both everywhere.
const STEEPEST: f64 = 1e-7;

/// The part of the distance and the size of a polygon from which on a height is seen: from about where two patches count as facing each other.
const SEEN: f64 = 2e-14;

/// The part of the smaller polygon's size, and of the distance from it, above which a height is real, whatever the coordinates of the larger.
pub(crate) const MIN_HEIGHT: f64 = 1e-9;

/// The greatest difference of normals of one plane: ends that touch each other's plane may cross it by a tolerance.
const SAME_PLANE: f64 = 1e-8;

/// The squared sine up to which three corners are on one line, and make no plane.
///
/// Above it rounding may still turn the plane about that line; both ends must then be on one side of it all the same.
const ON_LINE: f64 = 1e-24;

impl<'a> Shaft<'a> {
    /// Returns the shaft, or `None` if no point of one polygon's front sees the other's front. A face that reaches into it by less than `slack`, m, counts as touching.
    pub(crate) fn new(p: &'a [DVec3], q: &'a [DVec3], slack: f64) -> Option<Self> {
        let leans = [p, q].map(Lean::of);
        let [small, large] = if leans[0].reach <= leans[1].reach {
            [0, 1]
        } else {
            [1, 0]
        };
        let smaller = leans[small];
        let mut ends = [(p, leans[0]), (q, leans[1])].map(|(polygon, lean)| End {
            part: Cow::Borrowed(polygon),
            plane: Plane::of(polygon),
            rounding: rounding(polygon),
            least_height: rounding(polygon).min(MIN_HEIGHT * smaller.reach),
            lean,
            most: [f64::INFINITY; 2],
        });
        ends[large].most = ends[large].as_seen_from(&ends[small]);
        let parts = [in_front(p, &ends[1], &smaller)?, in_front(q, &ends[0], &smaller)?];
        for (end, part) in ends.iter_mut().zip(parts) {
            end.part = part;
        }
        let (low, high) = bounds(ends[0].part.iter().chain(ends[1].part.iter()));
        Some(Self {
            ends,
            sides: OnceCell::new(),
            low,
            high,
            smaller,
            slack,
        })
    }

    /// Returns whether a box and the box around the hull have no point in common. For a sliver's hull, whose sides rounding turns, only this is certain.
    pub(crate) fn is_apart_from(&self, low: DVec3, high: DVec3) -> bool {
        self.low.cmpgt(high).any() || self.high.cmplt(low).any()
    }

    /// Returns whether a box may meet the hull's interior. May err on the side of true.
    pub(crate) fn may_meet_box(&self, low: DVec3, high: DVec3) -> bool {
        if self.is_apart_from(low, high) {
            return false;
        }
        let (middle, reach) = (low.midpoint(high), (high - low) * 0.5);
        let highest = |plane: &Plane| plane.height(middle) + plane.normal.abs().dot(reach);
        self.ends.iter().all(|end| highest(&end.plane) > end.least_height)
            && self.sides().all(|side| highest(&side.plane) > side.raised)
    }

    /// Returns whether a convex polygon meets the hull's interior. May err on the side of true.
    pub(crate) fn meets(&self, corners: &[DVec3]) -> bool {
        self.meets_beyond(corners, self.slack)
    }

    /// Returns whether a convex polygon that does not meet the hull's interior would meet it if corners were not rounded.
    pub(crate) fn is_touched_by(&self, corners: &[DVec3]) -> bool {
        self.slack > 0.0 && self.meets_beyond(corners, 0.0)
    }

    /// Returns whether a convex polygon meets the hull's interior deeper than rounding explains, and by `slack` more.
    fn meets_beyond(&self, corners: &[DVec3], slack: f64) -> bool {
        let of_ends = || self.ends.iter().map(|end| (&end.plane, end.least_height + slack));
        let of_sides = || self.sides().map(|side| (&side.plane, side.raised + slack));
        let reaches = |(plane, level): (&Plane, f64)| corners.iter().any(|&v| plane.height(v) > level);
        if !of_ends().all(reaches) || !of_sides().all(reaches) {
            return false;
        }
        // No single plane separates them: cut the polygon down to its part inside.
        CUT.with_borrow_mut(|[inside, part]| {
            inside.clear();
            inside.extend_from_slice(corners);
            for (plane, level) in of_ends().chain(of_sides()) {
                let height = |v: DVec3| plane.height(v) - level;
                if inside.iter().any(|&v| height(v) < 0.0) {
                    part.clear();
                    clip_contour(inside.len(), |k| inside[k], height, |v| part.push(v));
                    std::mem::swap(inside, part);
                }
                if inside.is_empty() {
                    return false;
                }
            }
            // The nearer it is to an end, the less does rounding affect its height.
            self.ends.iter().all(|end| {
                let mut heights = inside.iter().map(|&v| (v, end.plane.height(v) - slack));
                heights.any(|(v, height)| height > end.least_height_at(v, &self.smaller))
            })
        })
    }

    /// Returns the part of a segment within the hull, or less than `off`, m, outside; `None` if there is none.
    ///
    /// The part is its begin and end in units of the segment.
    pub(crate) fn part_within(&self, a: DVec3, b: DVec3, off: f64) -> Option<[f64; 2]> {
        let [mut first, mut last] = [0.0_f64, 1.0_f64];
        let of_ends = self.ends.iter().map(|end| (&end.plane, 0.0));
        for (plane, level) in of_ends.chain(self.sides().map(|side| (&side.plane, side.raised))) {
            let [at_a, at_b] = [a, b].map(|v| plane.height(v) - level + off);
            if at_a < 0.0 && at_b < 0.0 {
                return None;
            }
            if at_a < 0.0 {
                first = first.max(at_a / (at_a - at_b));
            } else if at_b < 0.0 {
                last = last.min(at_a / (at_a - at_b));
            }
        }
        (first < last).then_some([first, last])
    }

    /// Returns whether one convex polygon stops all light, but for light that passes within `slack`, m: whether every segment between the two ends crosses it.
    pub(crate) fn is_closed_by(&self, corners: &[DVec3], plane: &Plane, slack: f64) -> bool {
        self.section_lies_in(plane, rounding(corners), slack, |point, tolerance| {
            (0..corners.len()).all(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
                let inward = plane.normal.cross(b - a);
                let height = inward.dot(point - a);
                height >= 0.0 || height * height <= tolerance * tolerance * inward.length_squared()
            })
        })
    }

    /// Returns whether every segment between the two ends passes through the inside of a convex solid, whose corners are accurate to `rounding`, m.
    ///
    /// It tests one section of the shaft, through `middle` and across the line between the ends' centres; errs on the side of false.
    pub(crate) fn is_closed_by_solid(&self, middle: DVec3, planes: &[Plane], rounding: f64) -> bool {
        let [from, to] = self
            .ends
            .each_ref()
            .map(|end| end.part.iter().sum::<DVec3>() / end.part.len() as f64);
        let normal = (to - from).normalize_or_zero();
        let across = Plane { normal, point: middle };
        self.section_lies_in(&across, rounding, self.slack, |point, tolerance| {
            planes.iter().all(|plane| plane.height(point) < -tolerance)
        })
    }

    /// Returns whether a plane separates the two ends, and its section with the hull lies in a convex set.
    ///
    /// The section is the convex hull of the points in which the segments between corners cross the plane, which is accurate to `rounding`, m, at its polygon.
    /// `contains` gets each point with the neglected width there: 1e-10 of the shaft's width, `slack`, m, and rounding, each by the distances from both ends.
    fn section_lies_in(&self, plane: &Plane, rounding: f64, slack: f64, contains: impl Fn(DVec3, f64) -> bool) -> bool {
        let tolerances = self.ends.each_ref().map(|end| {
            let width = match &end.part {
                Cow::Borrowed(_) => end.lean.width,
                Cow::Owned(part) => Lean::of(part).width,
            };
            end.border(width) + slack
        });
        let [near, far] = tolerances.map(|tolerance| tolerance + rounding);
        let on_side = |k: usize, sign: f64, tolerance: f64| {
            let mut heights = self.ends[k].part.iter().map(|&v| plane.height(v) * sign);
            heights.all(|height| height >= -tolerance)
        };
        let parts = |sign: f64| on_side(0, sign, near) && on_side(1, -sign, far);
        if !(parts(1.0) || parts(-1.0)) {
            return false;
        }
        self.ends[0].part.iter().all(|&a| {
            let height_a = plane.height(a);
            self.ends[1].part.iter().all(|&b| {
                let height_b = plane.height(b);
                let drop = height_a - height_b;
                if drop.abs() <= near + far {
                    return false;
                }
                // From the end that is nearer to the plane, to keep digits.
                let shares = [-height_b / drop, height_a / drop];
                let point = if shares[1] <= 0.5 {
                    a + (b - a) * shares[1]
                } else {
                    b + (a - b) * shares[0]
                };
                let [own, other] = shares.map(|share| share.clamp(0.0, 1.0));
                contains(point, tolerances[0] * own + tolerances[1] * other + rounding)
            })
        })
    }

    /// Returns whether a side with such a normal is the plane of an end, within a tolerance.
    ///
    /// An end that stands on the plane of the other has that plane for a side.
    fn is_plane_of_an_end(&self, normal: DVec3) -> bool {
        let mut ends = self.ends.iter();
        ends.any(|end| end.plane.normal.distance_squared(normal) < SAME_PLANE * SAME_PLANE)
    }

    /// Returns the planes through an edge of one end and a corner of the other with all of both on their upper side, each raised by its neglected border.
    fn sides(&self) -> impl Iterator<Item = &Side> {
        let cells = self.sides.get_or_init(|| {
            let n_edges = self.ends.iter().map(|end| end.part.len()).sum();
            std::iter::repeat_with(OnceCell::new).take(n_edges).collect()
        });
        let sides = cells.iter().enumerate();
        sides.filter_map(|(edge, cell)| cell.get_or_init(|| self.side_at(edge)).as_ref())
    }

    /// Returns the side through an edge, counted through both ends.
    ///
    /// Seen along an edge, its own end lies to one side in one line, and the other end above that line: the corner that is
    /// farthest round from the one side gives the only such plane besides that of the end itself.
    fn side_at(&self, number: usize) -> Option<Side> {
        let n_first = self.ends[0].part.len();
        let (k, place) = if number < n_first {
            (0, number)
        } else {
            (1, number - n_first)
        };
        let (near, far, up) = (&self.ends[k].part, &self.ends[1 - k].part, self.ends[k].plane.normal);
        let start = near[(place + near.len() - 1) % near.len()];
        let edge = near[place] - start;
        let (inward, scale_squared) = (up.cross(edge), edge.length_squared());
        let scale = scale_squared.sqrt();
        let mut farthest: Option<(DVec3, f64, f64)> = None;
        for &c in far.iter() {
            let across = c - start;
            let (x, y) = (inward.dot(across), up.dot(across) * scale);
            let is_off = x * x + y * y > ON_LINE * scale_squared * across.length_squared();
            if is_off && farthest.is_none_or(|(_, u, v)| u * y > v * x) {
                farthest = Some((c, x, y));
            }
        }
        let found = farthest.and_then(|(c, ..)| self.side(k, start, edge, c));
        // Rounding may have chosen a corner that is too near to the edge.
        found.or_else(|| far.iter().find_map(|&c| self.side(k, start, edge, c)))
    }

    /// Returns the plane through an edge of end `k` and a corner `c` of the other, raised, if both ends are on one side of it.
    ///
    /// The neglected part changes from the edge to the far side of the other end in proportion, so that the raised plane leans a little.
    fn side(&self, k: usize, start: DVec3, edge: DVec3, c: DVec3) -> Option<Side> {
        let normal = edge.cross(c - start);
        // A plane through three corners nearly on a line is undefined.
        if normal.length_squared() <= ON_LINE * edge.length_squared() * (c - start).length_squared() {
            return None;
        }
        let normal = normal.normalize();
        // Heights from the point with the smaller coordinates, so that they keep their digits where one end is far off.
        let from_edge = largest(start) <= largest(c);
        let origin = if from_edge { start } else { c };
        // In proportion to the distance from the edge, within the range of the ends: a corner beside the edge does not determine the border beyond it.
        let across = normal.cross(edge).normalize();
        let distance = |v: DVec3| across.dot(v - start);
        let (mut below, mut above, mut reach) = (false, false, 0.0);
        let mut borders = [0.0; 2];
        for (border, end) in borders.iter_mut().zip([k, 1 - k]) {
            let end = &self.ends[end];
            let (mut low, mut high) = (0.0, 0.0);
            // That of the other end alone remains.
            reach = 0.0;
            // Without f64::min and f64::max, which spend time on NaN.
            for &v in end.part.iter() {
                let (height, far) = (normal.dot(v - origin), distance(v).abs());
                low = if height < low { height } else { low };
                high = if height > high { height } else { high };
                reach = if far > reach { far } else { reach };
            }
            let width = high.max(-low);
            *border = end.border(width);
            let off = 0.5 * (end.border_of(width, end.rounding) + self.slack);
            below |= low < -off;
            above |= high > off;
        }
        if below == above {
            return None;
        }
        let normal = if above { normal } else { -normal };
        if self.is_plane_of_an_end(normal) {
            // No part is a mere border there.
            borders = [k, 1 - k].map(|end| self.ends[end].border(0.0));
        }
        if (borders[1] - borders[0]).abs() > STEEPEST * reach {
            borders = [borders[0].min(borders[1]); 2];
        }
        let [at_edge, at_corner] = borders;
        let slope = (at_corner - at_edge) / reach;
        let to_corner = distance(c);
        let leaning = normal - across * (slope * to_corner.signum());
        let raised = if from_edge {
            at_edge
        } else {
            at_edge + slope * to_corner.abs()
        };
        Some(Side {
            plane: Plane {
                normal: leaning,
                point: origin,
            },
            raised,
        })
    }
}

impl End<'_> {
    /// Returns the most that this end adds to the neglected border as a width, and as rounding, where the other end is smaller.
    fn as_seen_from(&self, smaller: &Self) -> [f64; 2] {
        let (low, high) = bounds(self.part.iter());
        let middle = smaller.lean.middle;
        let apart = (low - middle).max(middle - high).max(DVec3::ZERO);
        let near = smaller.lean.reach + apart.length();
        [near, smaller.rounding.max(MIN_HEIGHT * near)]
    }

    /// Returns the width of the neglected border where the hull has this width.
    ///
    /// The larger end counts as far as the smaller one sees it: a border beside it that is 1e-10 of a ground that reaches to the horizon would hide all that stands before a wall on that ground.
    fn border(&self, width: f64) -> f64 {
        self.border_of(width, self.rounding.min(self.most[1]))
    }

    fn border_of(&self, width: f64, rounding: f64) -> f64 {
        RELATIVE_TOLERANCE * width.min(self.most[0]) + rounding
    }

    /// Returns the height over the end's plane below which a point may lie in it, given the smaller of the two ends.
    fn least_height_at(&self, point: DVec3, smaller: &Lean) -> f64 {
        let rounded = self.lean.height_by_rounding(self.rounding, point);
        rounded
            .max(SEEN * (self.lean.reach + self.lean.distance(point)))
            .min(MIN_HEIGHT * (smaller.reach + smaller.distance(point)))
    }
}

fn bounds<'v>(corners: impl Iterator<Item = &'v DVec3>) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    corners.fold(none, |(low, high), &v| (low.min(v), high.max(v)))
}

/// Returns the part of a polygon in front of an end's plane; `None` if there is none.
fn in_front<'a>(polygon: &'a [DVec3], of: &End<'_>, smaller: &Lean) -> Option<Cow<'a, [DVec3]>> {
    let (mut above, mut below) = (false, false);
    for &v in polygon {
        let height = of.plane.height(v);
        let tolerance = of.least_height_at(v, smaller);
        above |= height > tolerance;
        below |= height < -tolerance;
    }
    match (above, below) {
        (false, _) => None,
        (true, false) => Some(Cow::Borrowed(polygon)),
        (true, true) => Some(Cow::Owned(clip_to_half_space(polygon, of.plane.point, of.plane.normal))),
    }
}

#[cfg(test)]
mod tests;
