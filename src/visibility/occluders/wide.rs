//! Occluders between one polygon and everything in a box: found once, and narrowed down as the box shrinks.

use std::ops::{Deref, Range};

use glam::DVec3;

use super::super::plane::{Lean, MAX_LEAN, Plane, rounding};
use super::super::shaft::MIN_HEIGHT;
use super::{Between, Entry, OccluderId, OccluderIndex, PairVisibility, noise};

/// A node of the tree of occluders, or an occluder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Candidate {
    Node(usize),
    Polygon(OccluderId),
}

/// An occluder that alone hides a polygon from others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Closer {
    /// A polygon.
    Polygon(OccluderId),
    /// A convex solid, by its number.
    Solid(u32),
}

/// Measures of a polygon that searches use repeatedly.
#[derive(Clone, Debug)]
pub(crate) struct Measures {
    plane: Plane,
    low: DVec3,
    high: DVec3,
    /// The greatest distance of a corner from the middle.
    reach: f64,
    /// 16 ulps of the largest coordinate.
    rounding: f64,
}

/// A convex polygon with its measures, for searches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Outlook<'a> {
    pub(crate) corners: &'a [DVec3],
    pub(crate) measures: &'a Measures,
}

impl Deref for Outlook<'_> {
    type Target = Measures;

    fn deref(&self) -> &Measures {
        self.measures
    }
}

/// The height over a plane, in units of the polygon's rounding, that may be 0: a quarter of the height that a shaft neglects at its sides.
const IN_PLANE: f64 = 0.25;

/// The least distance of an occluder between a polygon and a box from either, as a part of the polygon's size.
///
/// It is also at least so many times the distance by which rounding moves a corner.
const OFF: f64 = 1e-9;
const OFF_SLACKS: f64 = 400.0;

impl Measures {
    pub(crate) fn of(corners: &[DVec3]) -> Self {
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = corners.iter().fold(none, |(low, high), &v| (low.min(v), high.max(v)));
        Self {
            plane: Plane::of(corners),
            low,
            high,
            reach: Lean::of(corners).reach(),
            rounding: rounding(corners),
        }
    }
}

impl Outlook<'_> {
    /// Returns the height over the polygon's plane up to which points count as in it, where the smaller of two polygons has this reach.
    fn least_height(&self, smaller_reach: f64) -> f64 {
        self.rounding.min(MIN_HEIGHT * smaller_reach)
    }

    /// Returns whether a polygon rises over this one's plane, as the first test of a shaft does.
    fn is_risen_over_by(&self, corners: &[DVec3], smaller_reach: f64) -> bool {
        let level = self.least_height(smaller_reach);
        corners.iter().any(|&v| self.plane.height(v) > level)
    }

    /// Returns whether this polygon and another lie so high over each other's planes that light certainly passes between them without occluders.
    pub(crate) fn faces_clearly(&self, other: &Self) -> bool {
        let is_over = |plane: &Self, polygon: &Self| {
            let most = plane.reach + polygon.reach;
            polygon
                .corners
                .iter()
                .any(|&v| plane.plane.height(v) > 4.0 * MIN_HEIGHT * (most + plane.corners[0].distance(v)))
        };
        is_over(self, other) && is_over(other, self)
    }

    /// Returns whether another polygon is too far off this one's plane to be the other side of a sheet, however either leans.
    fn is_parted_from(&self, other: &Self, slack: f64) -> bool {
        let most = slack * (2.0 + MAX_LEAN);
        other.corners.iter().any(|&v| self.plane.height(v).abs() > most)
    }
}

/// The planes around a polygon's box and another box: the convex hull of both but for the corners.
struct Around {
    low: DVec3,
    high: DVec3,
    /// Normal and level of each: n · x of the hull is at most the level.
    sides: [(DVec3, f64); 6],
    n_sides: usize,
    /// The box of the others.
    to: (DVec3, DVec3),
}

impl Around {
    /// Source: Haines and Wallace 1991, section 3: along each axis, the lines that touch both rectangles from the same side. Departures: none.
    fn new(from: &Outlook<'_>, to: (DVec3, DVec3)) -> Self {
        let mut around = Self {
            low: from.low.min(to.0),
            high: from.high.max(to.1),
            sides: [(DVec3::ZERO, 0.0); 6],
            n_sides: 0,
            to,
        };
        // The rounding of a level.
        let ulps = 8.0 * f64::EPSILON * around.low.abs().max(around.high.abs()).max_element();
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            for (up_a, up_b) in [(true, true), (true, false), (false, true), (false, false)] {
                let corner = |low: DVec3, high: DVec3| {
                    [if up_a { high[a] } else { low[a] }, if up_b { high[b] } else { low[b] }]
                };
                let ([p, q], [r, s]) = (corner(from.low, from.high), corner(to.0, to.1));
                let [along_a, along_b] = [r - p, s - q];
                // The outward one of the two normals, if either is.
                let sign = |up: bool| if up { 1.0 } else { -1.0 };
                let normal = [along_b.abs() * sign(up_a), along_a.abs() * sign(up_b)];
                if along_a * sign(up_a) * along_b * sign(up_b) >= 0.0 {
                    continue;
                }
                let mut n = DVec3::ZERO;
                (n[a], n[b]) = (normal[0], normal[1]);
                let level = n[a] * p + n[b] * q + ulps * (n[a].abs() + n[b].abs());
                if around.n_sides < around.sides.len() {
                    around.sides[around.n_sides] = (n, level);
                    around.n_sides += 1;
                }
            }
        }
        around
    }

    fn meets(&self, low: DVec3, high: DVec3) -> bool {
        if self.low.cmpgt(high).any() || self.high.cmplt(low).any() {
            return false;
        }
        let lowest = |n: DVec3| (n * low).min(n * high).element_sum();
        self.sides[..self.n_sides].iter().all(|&(n, level)| lowest(n) <= level)
    }

    fn diagonal(&self) -> f64 {
        self.to.0.distance(self.to.1)
    }
}

impl OccluderIndex {
    /// Returns the list that [`narrow`](Self::narrow) begins with.
    pub(crate) fn all_candidates(&self) -> Vec<Candidate> {
        self.tree.root().into_iter().map(Candidate::Node).collect()
    }

    /// Adds to `list` the candidates of its range `among` that may occlude anything in a box from a polygon.
    ///
    /// It leaves out only those that [`between`](Self::between) would leave out for every polygon in the box. Nodes that are large beside the box are opened; all are where `in_full`.
    pub(crate) fn narrow(
        &self,
        from: &Outlook<'_>,
        to: (DVec3, DVec3),
        in_full: bool,
        among: Range<usize>,
        list: &mut Vec<Candidate>,
    ) {
        let around = Around::new(from, to);
        let largest = if in_full { 0.0 } else { around.diagonal() };
        let mut stack = [0; 64];
        for k in among {
            let mut depth = 0;
            match list[k] {
                Candidate::Polygon(id) => {
                    if self.may_occlude(id, from, &around) {
                        list.push(Candidate::Polygon(id));
                    }
                }
                Candidate::Node(node) => {
                    stack[0] = node;
                    depth = 1;
                }
            }
            while depth > 0 {
                depth -= 1;
                let index = stack[depth];
                let (low, high) = self.tree.around(index);
                if !around.meets(low, high) || !self.rises_over(from, low, high) {
                    continue;
                }
                if let Some([first, second]) = self.tree.halves(index) {
                    if low.distance(high) < largest {
                        list.push(Candidate::Node(index));
                        continue;
                    }
                    (stack[depth], stack[depth + 1]) = (second, first);
                    depth += 2;
                    continue;
                }
                for &polygon in self.tree.boxes_below(index) {
                    let id = OccluderId(polygon);
                    if self.may_occlude(id, from, &around) {
                        list.push(Candidate::Polygon(id));
                    }
                }
            }
        }
    }

    /// Returns whether a box reaches over a polygon's plane.
    fn rises_over(&self, from: &Outlook<'_>, low: DVec3, high: DVec3) -> bool {
        let (middle, reach) = (low.midpoint(high), (high - low) * 0.5);
        from.plane.height(middle) + from.plane.normal.abs().dot(reach) > from.least_height(self.least_reach)
    }

    fn may_occlude(&self, id: OccluderId, from: &Outlook<'_>, around: &Around) -> bool {
        let entry = &self.entries[id.0 as usize];
        if !around.meets(entry.low, entry.high) || !from.is_risen_over_by(&entry.corners, self.least_reach) {
            return false;
        }
        // An occluder with both on one side does not reach in between.
        let [low, high] = entry.plane.heights(from.corners);
        let (middle, reach) = (around.to.0.midpoint(around.to.1), (around.to.1 - around.to.0) * 0.5);
        let (height, off) = (entry.plane.height(middle), entry.plane.normal.abs().dot(reach));
        let flat = IN_PLANE * from.least_height(self.least_reach);
        let [least, greatest] = [entry.heights[0] + flat, entry.heights[1] - flat];
        !(low >= greatest && height - off >= greatest || high <= least && height + off <= least)
    }

    /// Finds the occluders between two polygons, `among` all candidates, none of which is a node, and returns the one that hides all, if any.
    ///
    /// `closer` is tested first. The result is that of [`between`](Self::between).
    pub(crate) fn between_candidates(
        &self,
        from: &Outlook<'_>,
        to: &Outlook<'_>,
        among: &[Candidate],
        closer: Option<Closer>,
        scratch: &mut Vec<OccluderId>,
    ) -> (Between, Option<Closer>) {
        let smaller_reach = from.reach.min(to.reach);
        let (low, high) = (from.low.min(to.low), from.high.max(to.high));
        let reaches_in = |entry: &Entry| {
            if low.cmpgt(entry.high).any()
                || high.cmplt(entry.low).any()
                || !from.is_risen_over_by(&entry.corners, smaller_reach)
                || !to.is_risen_over_by(&entry.corners, smaller_reach)
            {
                return false;
            }
            let ([l, h], [m, g]) = (entry.plane.heights(from.corners), entry.plane.heights(to.corners));
            let flat = IN_PLANE * from.rounding.min(to.rounding);
            let [least, greatest] = [entry.heights[0] + flat, entry.heights[1] - flat];
            !(l >= greatest && m >= greatest || h <= least && g <= least)
        };
        scratch.clear();
        for candidate in among {
            if let Candidate::Polygon(id) = *candidate
                && reaches_in(&self.entries[id.0 as usize])
            {
                scratch.push(id);
                let is_closer = match closer {
                    Some(Closer::Polygon(known)) => known == id,
                    Some(Closer::Solid(solid)) => self.entries[id.0 as usize].solid == Some(solid),
                    None => false,
                };
                if is_closer {
                    let last = scratch.len() - 1;
                    scratch.swap(0, last);
                }
            }
        }
        let may_be_sheet = !from.is_parted_from(to, self.slack.max(noise([from.corners, to.corners])));
        if scratch.is_empty() {
            let is_sheet = may_be_sheet && self.are_sides_of_a_sheet(from.corners, to.corners);
            let visibility = if is_sheet {
                PairVisibility::None
            } else {
                PairVisibility::Full
            };
            return (Between::certain(visibility), None);
        }
        let ends = [from.corners, to.corners];
        if may_be_sheet {
            self.classify_with(ends[0], ends[1], self.slack, super::each_of(scratch))
        } else {
            self.classify_no_sheet(ends[0], ends[1], self.slack, super::each_of(scratch))
        }
    }

    /// Returns whether one polygon or solid hides everything in a box from a polygon. Errs on the side of false.
    pub(crate) fn hides_box(&self, closer: Closer, from: &Outlook<'_>, to: (DVec3, DVec3)) -> bool {
        let off = (OFF * from.reach).max(OFF_SLACKS * self.slack).max(from.rounding);
        match closer {
            Closer::Polygon(id) => {
                let entry = &self.entries[id.0 as usize];
                let off = off.max(entry.heights[1]).max(-entry.heights[0]);
                let margin = off.max(OFF * entry.low.distance(entry.high));
                let edges: &[DVec3] = &entry.corners;
                let n = edges.len();
                section(&entry.plane, from, to, off, |point| {
                    (0..n).all(|k| {
                        let (a, b) = (edges[k], edges[(k + 1) % n]);
                        let inward = entry.plane.normal.cross(b - a);
                        let depth = inward.dot(point - a);
                        depth > 0.0 && depth * depth > margin * margin * inward.length_squared()
                    })
                })
            }
            Closer::Solid(solid) => {
                let solid = &self.solids[solid as usize];
                let middle = from.corners.iter().sum::<DVec3>() / from.corners.len() as f64;
                let across = Plane {
                    normal: (to.0.midpoint(to.1) - middle).normalize_or_zero(),
                    point: solid.middle(),
                };
                section(&across, from, to, off, |point| solid.holds(point, off))
                    && solid.excludes(from.corners, self.slack)
            }
        }
    }
}

/// Returns whether a plane separates a polygon and a box by more than `off` on either side, and its section lies in a convex set.
///
/// All segments between the two must cross the plane where `contains` is true, which is tested at their corners.
fn section(plane: &Plane, from: &Outlook<'_>, to: (DVec3, DVec3), off: f64, contains: impl Fn(DVec3) -> bool) -> bool {
    let (middle, reach) = (to.0.midpoint(to.1), (to.1 - to.0) * 0.5);
    let (height, extent) = (plane.height(middle), plane.normal.abs().dot(reach));
    let [low, high] = plane.heights(from.corners);
    let is_parted = low > off && height + extent < -off || high < -off && height - extent > off;
    is_parted
        && (0..8).all(|corner| {
            let is_upper = |axis: usize| corner >> axis & 1 == 1;
            let b = DVec3::from_array(std::array::from_fn(|axis| {
                if is_upper(axis) { to.1[axis] } else { to.0[axis] }
            }));
            let height_b = plane.height(b);
            from.corners.iter().all(|&a| {
                let height_a = plane.height(a);
                contains(a + (b - a) * (height_a / (height_a - height_b)))
            })
        })
}
