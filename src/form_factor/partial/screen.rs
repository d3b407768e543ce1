//! Occluders before a line of sight.

use std::cmp::Ordering;

use glam::DVec3;

use super::flat::{FLAT, Flat};
use crate::visibility::plane::{Lean, rounding};

/// An occluder as something that may stop a line of sight.
pub(super) struct Screen {
    /// Each corner with the unit vector that points inwards from the edge that begins there.
    corners: Vec<(DVec3, DVec3)>,
    pub(super) plane: Flat,
    /// How far corners are off the plane, in m: rounded coordinates bend a quad.
    bend: f64,
    /// 16 ulps of the largest coordinate, in m, by which the plane leans.
    rounding: f64,
    lean: Lean,
}

impl Screen {
    pub(super) fn new(corners: &[DVec3], plane: Flat) -> Self {
        Self {
            corners: inward_normals(corners, plane.normal)
                .map(|(corner, inward)| (corner, inward.normalize_or_zero()))
                .collect(),
            bend: corners.iter().map(|&v| plane.height(v).abs()).fold(0.0, f64::max),
            plane,
            rounding: rounding(corners),
            lean: Lean::of(corners),
        }
    }

    /// Returns 1 for a point in front of the screen, −1 behind it, and 0 where rounding or the bend decides.
    pub(super) fn side(&self, point: DVec3) -> i32 {
        let height = self.plane.snapped_height(point, FLAT);
        let uncertain = self.lean.height(self.bend, point);
        if height.abs() <= uncertain.max(self.lean.height_by_rounding(self.rounding, point)) {
            0
        } else {
            height.total_cmp(&0.0) as i32
        }
    }

    /// Returns where the segment from x through v to y crosses the screen, deeper inside than a tolerance: before v or behind it.
    pub(super) fn place_on(&self, x: DVec3, v: DVec3, y: DVec3) -> Option<Ordering> {
        let [height_x, height_y] = [x, y].map(|p| self.plane.snapped_height(p, FLAT));
        if height_x * height_y >= 0.0 {
            return None;
        }
        // From the nearer end, whose digits count.
        let (near, crossing) = if height_x.abs() <= height_y.abs() {
            (x, x + (y - x) * (height_x / (height_x - height_y)))
        } else {
            (y, y + (x - y) * (height_y / (height_y - height_x)))
        };
        // Along a line that grazes the plane an error of a height moves the crossing the farther, the flatter the line is.
        let slant = (y - x).length() / (height_x - height_y).abs();
        let of_heights = self.plane.tolerance(near, FLAT) + self.plane.tolerance(crossing, FLAT) + self.bend;
        let along = slant * of_heights;
        let is_inside = |&(corner, inward): &(DVec3, DVec3)| inward.dot(crossing - corner) > along;
        if !self.corners.iter().all(is_inside) {
            return None;
        }
        let beyond = (crossing - v).dot(y - x);
        let along = along.max(self.plane.tolerance(v, FLAT));
        (beyond.abs() > along * (y - x).length()).then_some(beyond.total_cmp(&0.0))
    }

    /// Returns whether the vertex is a corner of the screen, or the edge one of its edges.
    pub(super) fn touches(&self, vertex: DVec3, edge: [DVec3; 2]) -> bool {
        let has = |p: DVec3| self.corners.iter().any(|&(corner, _)| corner == p);
        has(vertex) || edge.iter().all(|&end| has(end))
    }
}

/// Iterates over the corners of a polygon, each with a vector that points inwards from the edge that begins there.
pub(super) fn inward_normals(corners: &[DVec3], normal: DVec3) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(move |(&a, &b)| (a, normal.cross(b - a)))
}
