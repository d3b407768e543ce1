//! The plane of a polygon, and the angle by which it may lean where corners are rounded.

use glam::DVec3;

use crate::geometry::polygon;

/// The distance from a polygon, in its widths, beyond which the effect of rounding on its plane is not extrapolated.
pub(crate) const MAX_LEAN: f64 = 100.0;

/// A plane; heights over it are n · (x − p).
///
/// p is a point of its polygon, which keeps the digits of x − p far from the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    /// The unit normal.
    pub(crate) normal: DVec3,
    /// A point on the plane.
    pub(crate) point: DVec3,
}

impl Plane {
    /// Returns the plane of a polygon, its front up; the normal is zero where the polygon has no area.
    pub(crate) fn of(corners: &[DVec3]) -> Self {
        Self {
            normal: polygon::area_vector(corners).normalize_or_zero(),
            point: corners[0],
        }
    }

    pub(crate) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.point)
    }

    /// Returns the least and the greatest height of some points.
    pub(crate) fn heights(&self, points: &[DVec3]) -> [f64; 2] {
        let heights = points.iter().map(|&v| self.height(v));
        heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| {
            [low.min(h), high.max(h)]
        })
    }
}

/// The lean of a polygon's plane where its corners are rounded: the narrower the polygon, the more.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lean {
    pub(super) middle: DVec3,
    pub(super) reach: f64,
    /// The area by the greatest length.
    pub(super) width: f64,
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

    /// Returns the greatest distance of a corner from the middle.
    pub(crate) fn reach(&self) -> f64 {
        self.reach
    }

    /// Returns the distance of a point from the middle.
    pub(super) fn distance(&self, point: DVec3) -> f64 {
        self.middle.distance(point)
    }

    /// Returns the sine of the angle by which the plane may lean where corners are off by `off`, m.
    pub(crate) fn sine(&self, off: f64) -> f64 {
        off / self.width
    }

    /// Returns the apparent height of a point of the plane where corners are off by ulps.
    ///
    /// Heights are measured from a corner: from there the plane of a sliver leans by more than the height within its own width.
    pub(crate) fn height_by_rounding(&self, rounding: f64, point: DVec3) -> f64 {
        rounding * (1.0 + (self.reach + self.distance(point)) / self.width)
    }

    /// Returns the apparent height of a point of the plane where corners are off by `slack`.
    pub(crate) fn height(&self, slack: f64, point: DVec3) -> f64 {
        slack * (1.0 + (self.distance(point) / self.width).min(MAX_LEAN))
    }
}

/// Returns 16 ulps of the largest coordinate.
pub(crate) fn rounding(corners: &[DVec3]) -> f64 {
    16.0 * f64::EPSILON * corners.iter().fold(0.0, |m, &v| largest(v).max(m))
}

/// Returns the largest coordinate of a point.
pub(super) fn largest(v: DVec3) -> f64 {
    v.abs().max_element()
}
