//! The polygon that is integrated over, and a frame in its plane.

use glam::{DVec2, DVec3};

/// A receiver with a frame in its plane.
pub(super) struct Receiver {
    /// The corners, counter-clockwise.
    pub(super) corners: Vec<DVec3>,
    /// The unit normal.
    pub(super) normal: DVec3,
    origin: DVec3,
    x: DVec3,
    y: DVec3,
}

impl Receiver {
    pub(super) fn new(corners: Vec<DVec3>, normal: DVec3) -> Self {
        let origin = corners[0];
        // Along the longest edge, so that cells of a rectangle have exact coordinates.
        let along = (0..corners.len())
            .map(|k| corners[(k + 1) % corners.len()] - corners[k])
            .fold(
                DVec3::ZERO,
                |m, e| if e.length_squared() > m.length_squared() { e } else { m },
            );
        let x = (along - normal * normal.dot(along)).normalize_or_zero();
        Self {
            corners,
            normal,
            origin,
            x,
            y: normal.cross(x),
        }
    }

    pub(super) fn to_world(&self, p: DVec2) -> DVec3 {
        self.origin + self.offset(p)
    }

    /// Returns the offset of a point of the plane from the frame's origin.
    pub(super) fn offset(&self, p: DVec2) -> DVec3 {
        self.x * p.x + self.y * p.y
    }

    /// Returns a point as seen from the frame's origin.
    pub(super) fn seen_from_origin(&self, p: DVec3) -> DVec3 {
        p - self.origin
    }

    pub(super) fn to_plane(&self, p: DVec3) -> DVec2 {
        let r = p - self.origin;
        DVec2::new(self.x.dot(r), self.y.dot(r))
    }

    /// Returns a point in the frame, its height over the plane last.
    pub(super) fn in_frame(&self, p: DVec3) -> DVec3 {
        self.to_plane(p).extend(self.normal.dot(p - self.origin))
    }
}
