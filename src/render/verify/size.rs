//! The size of a scene, and its distance from the origin.

use glam::DVec3;

use crate::geometry::polygon;

/// The relative rounding of coordinates in f64 and of values computed from a few of them.
const ROUNDING: f64 = 1e-14;

/// The size of a scene, independent of its position.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    /// The largest distance from the middle of the bounding box along an axis, in m: rays in f32 start and end in a frame there.
    pub(super) extent: f64,
    /// The distance beyond that to which the box reaches from the origin, in m.
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

    /// Returns the greatest movement of a point by rounding in f64 because the scene is far from the origin, in m; 0 near it.
    pub(super) fn rounding(&self) -> f64 {
        ROUNDING * self.beyond
    }

    /// Returns the change, by that rounding, of a form factor of a point whose distance from the emitter is the scene's size.
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
