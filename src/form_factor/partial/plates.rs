//! Convex planar polygons, with balls around them.

use glam::DVec3;

use crate::geometry::polygon;

/// A convex planar polygon.
pub(super) struct Plate {
    pub(super) corners: Vec<DVec3>,
    pub(super) normal: DVec3,
    pub(super) ball: Ball,
}

/// A ball around something.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) middle: DVec3,
    pub(super) radius: f64,
}

impl Plate {
    /// Returns the box around it.
    pub(super) fn around(&self) -> (DVec3, DVec3) {
        let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let corners = self.corners.iter();
        corners.fold(all, |(low, high), &v| (low.min(v), high.max(v)))
    }

    pub(super) fn new(corners: Vec<DVec3>) -> Self {
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        Self {
            normal: polygon::area_vector(&corners).normalize_or_zero(),
            ball: Ball {
                radius: corners.iter().map(|v| v.distance(middle)).fold(0.0, f64::max),
                middle,
            },
            corners,
        }
    }

    /// Returns the height of a point, measured from a point of the plane: far from the origin n · x has fewer digits than a difference of points.
    pub(super) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }
}
