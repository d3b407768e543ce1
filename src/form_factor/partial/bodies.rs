//! Convex solids as occluders: from a point, the region behind a solid's silhouette is hidden.

use glam::DVec3;

use super::flat::Flat;
use super::receiver::Receiver;
use super::shadow::{EDGE_ON, HalfSpace, Place};
use crate::visibility::occluders::{Body, Occluder};

/// The fewest sides of a solid that is treated by its silhouette; one with fewer is as many polygons, as each side has few discontinuity lines. A box in triangles shows six.
const MIN_SIDES: usize = 7;

/// Returns the solids that are treated by their silhouettes: those of which many sides are among some occluders.
pub(super) fn of<'a>(occluders: &[Occluder<'a>]) -> Vec<Body<'a>> {
    let mut found: Vec<(Body<'a>, usize)> = Vec::new();
    for body in occluders.iter().filter_map(|side| side.body) {
        match found.iter_mut().rev().find(|known| known.0 == body) {
            Some(known) => known.1 += 1,
            None => found.push((body, 1)),
        }
    }
    found.retain(|(body, n_sides)| *n_sides >= MIN_SIDES && !body.0.ridges().is_empty());
    found.into_iter().map(|(body, _)| body).collect()
}

/// A side of a solid, whose front may or may not face a point of the receiver.
#[derive(Clone, Debug)]
struct Facet {
    side: usize,
    plane: Flat,
    /// From a corner of it to the middle of the target.
    to_target: DVec3,
    target: Place,
}

/// An edge that may be part of the silhouette.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) from: DVec3,
    to: DVec3,
    along: DVec3,
    /// The sum of its components without their signs.
    length: f64,
    /// From its beginning to the middle of the target.
    to_target: DVec3,
    pub(super) sides: [usize; 2],
}

impl Edge {
    /// Makes an edge that runs counter-clockwise around the first of two sides.
    pub(super) fn new([from, to]: [DVec3; 2], sides: [usize; 2], middle: DVec3) -> Self {
        Self {
            from,
            to,
            along: to - from,
            length: (to - from).abs().element_sum(),
            to_target: middle - from,
            sides,
        }
    }

    /// Returns the half-spaces of the triangle that the edge spans with a direction, seen from a point: that of the edge last.
    pub(super) fn triangle(&self, point: DVec3, of_first: bool, way: DVec3) -> [HalfSpace; 3] {
        let sign = if of_first { 1.0 } else { -1.0 };
        // From neighbouring edges the plane through their common end is the same to the last bit.
        let spoke = |end: DVec3, sign: f64| {
            let r = end - point;
            let normal = way.cross(r) * sign;
            let to_target = self.from + self.to_target - end;
            let slack = 1e-15 * r.abs().element_sum() * way.abs().element_sum();
            HalfSpace::through(to_target, normal, slack)
        };
        [
            spoke(self.from, -sign),
            spoke(self.to, sign),
            self.half_space(point, of_first),
        ]
    }

    /// Returns the half-space whose plane goes through a point and the edge, on the side of the one that faces the point: the first or the second.
    pub(super) fn half_space(&self, point: DVec3, of_first: bool) -> HalfSpace {
        // Around the side that faces the point an edge runs counter-clockwise, as that of a polygon does seen from its front.
        let r = self.from - point;
        let normal = r.cross(self.along) * if of_first { -1.0 } else { 1.0 };
        let slack = 1e-15 * r.abs().element_sum() * self.length;
        HalfSpace::through(self.to_target, normal, slack)
    }
}

/// A closed convex solid between a receiver and a target, outside of which both lie.
///
/// From a point x outside it hides the convex space between the planes through x and the edges where a front that faces x meets one that does not, behind all of these fronts.
#[derive(Clone, Debug)]
pub(super) struct Silhouette {
    /// The sides that face some points of the receiver, and others not.
    turning: Vec<Facet>,
    /// The sides that face all of it and whose plane cuts the target.
    cutting: Vec<Facet>,
    /// The edges that are not between two sides that face all of the receiver, or none of it.
    edges: Vec<Edge>,
    /// For each side, whether it faces the point; values that hold for all points are set once.
    faces: Vec<bool>,
    any_faces: bool,
}

impl Silhouette {
    /// Prepares a solid for a target, whose `middle` is near all of it; `None` if the solid hides no part of the target from the receiver.
    pub(super) fn new(body: Body<'_>, receiver: &Receiver, target: &[DVec3], middle: DVec3) -> Option<Self> {
        let solid = body.0;
        let mut ends: Vec<Option<[DVec3; 2]>> = vec![None; solid.planes().len()];
        for ridge in solid.ridges() {
            for side in ridge.sides {
                ends[side].get_or_insert(ridge.ends);
            }
        }
        let range = |points: &[DVec3], plane: &Flat| {
            let heights = points.iter().map(|&v| plane.snapped_height(v, EDGE_ON));
            heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
        };
        let mut silhouette = Self {
            turning: Vec::new(),
            cutting: Vec::new(),
            edges: Vec::new(),
            faces: vec![false; ends.len()],
            any_faces: false,
        };
        let mut turns = vec![false; ends.len()];
        for (side, (plane, ends)) in solid.planes().iter().zip(&ends).enumerate() {
            // A side without edges is a point, as at a pole whose corners were joined.
            let Some(ends) = ends else { continue };
            let plane = Flat::with_normal(ends, plane.normal);
            let (low, high) = range(&receiver.corners, &plane);
            if high <= 0.0 {
                continue;
            }
            let target = match range(target, &plane) {
                (low, _) if low >= 0.0 => Place::Front,
                (_, high) if high <= 0.0 => Place::Back,
                _ => Place::Both,
            };
            let always = low > 0.0;
            if always && target == Place::Front {
                return None;
            }
            silhouette.faces[side] = always;
            silhouette.any_faces |= always;
            turns[side] = !always;
            let facet = Facet {
                side,
                plane,
                to_target: middle - ends[0],
                target,
            };
            if !always {
                silhouette.turning.push(facet);
            } else if target == Place::Both {
                silhouette.cutting.push(facet);
            }
        }
        let faces = &silhouette.faces;
        let may_be_seen = |[a, b]: [usize; 2]| turns[a] || turns[b] || faces[a] != faces[b];
        let ridges = solid.ridges().iter().filter(|ridge| may_be_seen(ridge.sides));
        silhouette.edges = ridges.map(|ridge| Edge::new(ridge.ends, ridge.sides, middle)).collect();
        Some(silhouette)
    }

    /// Sets the half-spaces whose intersection is the region that the solid hides from a point; false if it hides nothing.
    pub(super) fn half_spaces(&mut self, point: DVec3, half_spaces: &mut Vec<HalfSpace>) -> bool {
        let mut any_faces = self.any_faces;
        for facet in &self.turning {
            let faces = facet.plane.snapped_height(point, EDGE_ON) > 0.0;
            self.faces[facet.side] = faces;
            any_faces |= faces;
            if faces && facet.target == Place::Front {
                return false;
            }
        }
        if !any_faces {
            return false;
        }
        half_spaces.clear();
        for edge in &self.edges {
            let [first, second] = edge.sides.map(|side| self.faces[side]);
            if first != second {
                half_spaces.push(edge.half_space(point, first));
            }
        }
        let turned = self.turning.iter().filter(|facet| self.faces[facet.side]);
        let cutting = turned.filter(|facet| facet.target == Place::Both).chain(&self.cutting);
        half_spaces.extend(cutting.map(|facet| HalfSpace {
            normal: -facet.plane.normal,
            offset: -facet.plane.normal.dot(facet.to_target),
            slack: [0.0; 2],
        }));
        true
    }
}

/// The corners of a solid, and its least width, in m.
#[derive(Clone, Debug)]
pub(super) struct Extent {
    corners: Vec<DVec3>,
    pub(super) width: f64,
}

impl Extent {
    /// Makes the extent of a solid, with its corners in the receiver's frame from its origin.
    pub(super) fn of(body: Body<'_>, receiver: &Receiver) -> Self {
        let solid = body.0;
        let depth = |height: f64| (-height).max(0.0);
        let depths = solid.planes().iter().map(|plane| depth(plane.height(solid.middle())));
        Self {
            width: 2.0 * depths.fold(f64::INFINITY, f64::min),
            corners: solid.corners().iter().map(|&v| receiver.seen_from_origin(v)).collect(),
        }
    }

    /// Returns whether a plane separates the solid from the convex hull of a cell and a target, so that it hides nothing between them. False where that is uncertain.
    pub(super) fn is_beside(&self, cell: &[DVec3; 3], target: &[DVec3]) -> bool {
        let parts = |a: DVec3, b: DVec3, c: DVec3| {
            let normal = (b - a).cross(c - a);
            let rounding = 1e-14 * normal.abs().element_sum() * (b - a).abs().max((c - a).abs()).element_sum();
            let heights = cell.iter().chain(target).map(|&v| normal.dot(v - a));
            let (low, high) = heights.fold((0.0_f64, 0.0_f64), |(l, h), x| (l.min(x), h.max(x)));
            let beyond = |sign: f64| self.corners.iter().all(|&v| sign * normal.dot(v - a) > 0.0);
            (high <= rounding && beyond(1.0)) || (low >= -rounding && beyond(-1.0))
        };
        let through = |polygon: &[DVec3], others: &[DVec3]| {
            let next = polygon.iter().cycle().skip(1);
            polygon
                .iter()
                .zip(next)
                .any(|(&a, &b)| others.iter().any(|&c| parts(a, b, c)))
        };
        through(cell, target) || through(target, cell)
    }
}
