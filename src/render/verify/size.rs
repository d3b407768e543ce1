//! How large a scene is, and how far from the origin.

use glam::DVec3;

use crate::geometry::polygon;

/// Rounding of coordinates in f64 and of what is computed from a few of them, relative to the largest.
const ROUNDING: f64 = 1e-14;

/// The size of a scene, wherever it stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    /// The largest distance from the middle of the bounding box along an axis, in m: rays in f32 start and end in a frame there.
    pub(super) extent: f64,
    /// How far the box reaches from the origin beyond that, in m.
    beyond: f64,
}

impl Size {
    pub(super) fn of<'a>(points: impl Iterator<Item = &'a DVec3>) -> Self {
        let (low, high) = polygon::bounds(points);
        if low.x > high.x {
            return Self {
                extent: 0.0,
                beyond: 0.0,
            };
        }
        let extent = 0.5 * (high - low).max_element();
        let reach = low.abs().max(high.abs()).max_element();
        Self {
            extent,
            beyond: (reach - 2.0 * extent).max(0.0),
        }
    }

    /// Returns how far rounding of coordinates in f64 may move a point because the scene is far from the origin, in m; 0 near it.
    pub(super) fn rounding(&self) -> f64 {
        ROUNDING * self.beyond
    }

    /// Returns how far it may change a form factor of a point that lies as far from the emitter as the scene is large.
    pub(super) fn relative_rounding(&self) -> f64 {
        if self.extent > 0.0 {
            self.rounding() / self.extent
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_is_as_large_elsewhere() {
        let corners = [DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0)];
        let size = |shift: DVec3| Size::of(corners.map(|v| v + shift).iter());
        let near = size(DVec3::ZERO);
        let far = size(DVec3::new(5e5, 4.6e6, 0.0));
        assert!((near.extent - 2.5).abs() < 1e-15 && (far.extent - 2.5).abs() < 1e-15);
        assert!(near.rounding() <= 0.0);
        // An f64 at 4.6e6 is rounded by 5e-10 at most.
        assert!(far.rounding() > 5e-10 && far.rounding() < 1e-7);
    }
}
