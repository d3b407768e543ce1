//! Whether two polygons lie in one plane, but for the rounding of their corners.

use glam::DVec3;

use super::super::plane::{Lean, Plane, rounding};
use crate::geometry::polygon::is_along_axis;

/// The distance of two polygons that were meant to lie in one plane and whose corners were computed in different ways, as a part of the smaller one's size.
const COMPUTED: f64 = 1e-10;

/// Returns the distance by which computation, with cancellation, may have parted two polygons.
///
/// Levels tell it from a gap that was meant, however narrow: computation does not leave planes parallel.
pub(super) fn noise(polygons: [&[DVec3]; 2]) -> f64 {
    let [p, q] = polygons.map(rounding);
    let size = |corners: &[DVec3]| {
        corners
            .iter()
            .map(|v| v.distance_squared(corners[0]))
            .fold(0.0, f64::max)
    };
    let smaller = polygons.map(size).into_iter().fold(f64::INFINITY, f64::min).sqrt();
    p.max(q).max(COMPUTED * smaller)
}

/// The share of the greatest height below which heights may differ across a gap that was meant, between parallel plates.
const PARALLEL: f64 = 1e-3;

/// The height, in slacks of a file's digits (a unit of the last one), below which a gap between inclined planes was not meant.
///
/// Heights are multiples of one number there, and those of a triangle are often equal.
const UNIT: f64 = 0.5;

/// The size in slacks below which a polygon may be rounding.
pub(super) const MIN_SLACKS: f64 = 100.0;

/// The relative position of two polygons whose corners are rounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Levels {
    /// In different planes, or too small to decide.
    Apart,
    /// In one plane but for the rounding of corners: if they face each other, they are the two sides of a sheet that rounding has parted.
    Touching,
    /// In parallel planes, as near as rounding might have brought them, although rounding would not have left them parallel.
    Gap,
}

impl Levels {
    pub(super) fn of(p: &[DVec3], q: &[DVec3], slack: f64) -> Self {
        let is_small = is_small(p, slack) || is_small(q, slack);
        if is_small || !is_level(p, q, slack) || !is_level(q, p, slack) {
            return Self::Apart;
        }
        let least_gap = |plane: &Plane| {
            let is_of_digits = slack > noise([p, q]) && !is_along_axis(plane.normal);
            if is_of_digits { UNIT * slack } else { 0.0 }
        };
        let noise = rounding(p).max(rounding(q));
        let are_parallel = |of: &[DVec3], over: &[DVec3]| {
            let plane = Plane::of(over);
            let noise = noise.max(least_gap(&plane));
            let heights = of.iter().map(|&v| plane.height(v).abs());
            let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            high > noise && high - low <= PARALLEL * high
        };
        if are_parallel(p, q) || are_parallel(q, p) {
            Self::Gap
        } else {
            Self::Touching
        }
    }
}

/// The greatest difference of normals of patches of one plane: the form factor between them is at most a quarter of its square.
const ONE_PLANE: f64 = 2e-6;

/// Returns whether two polygons that seem to face each other are two sides of a sheet, or parts of one plane.
///
/// Coordinates rounded by up to `slack`, m, have then parted them.
pub(crate) fn are_sides_of_a_sheet(p: &[DVec3], q: &[DVec3], slack: f64) -> bool {
    let [one, other] = [p, q].map(|corners| Plane::of(corners).normal);
    let is_sheet = one.dot(other) < 0.0 || one.distance(other) < ONE_PLANE;
    is_sheet && Levels::of(p, q, slack) == Levels::Touching
}

/// Returns whether a polygon is no farther from the plane of another one than rounding explains.
///
/// Rounding explains the slack near the other polygon, and beyond that more in proportion to the distance over the other's width, because the plane of a narrow polygon leans.
fn is_level(p: &[DVec3], q: &[DVec3], slack: f64) -> bool {
    let (plane, lean) = (Plane::of(q), Lean::of(q));
    p.iter().all(|&v| plane.height(v).abs() <= lean.height(slack, v))
}

/// Returns whether a polygon is so small that rounding may have turned it any way.
fn is_small(corners: &[DVec3], slack: f64) -> bool {
    corners.iter().all(|v| v.distance(corners[0]) < MIN_SLACKS * slack)
}
