//! The form factor from single points to the visible part of a polygon.

use glam::DVec3;

use super::Occluder;
use super::receiver::Receiver;
use super::shadow::Shadows;
use crate::geometry::clip::clip_to_half_space;

/// A convex polygon as the points of a flat convex region see it behind occluders.
///
/// F(x → visible part of Q): Q is cut at the region's horizon and clipped against the shadow of every occluder as seen from x; the remaining pieces are
/// summed by Lambert's formula. Accuracy: an absolute error of some 1e-15; a remainder of Q within 1e-15 of the distances involved may count as hidden.
/// Source: [`LAMBERT_1760`](crate::references::LAMBERT_1760). Departures: the clipping.
pub struct VisibleFactor {
    shadows: Option<Shadows>,
}

impl VisibleFactor {
    /// Prepares the occluders for the points of `region`, a polygon with the unit normal `normal`.
    ///
    /// `occluders` must hold all polygons that reach in between, such as [`OccluderIndex`](crate::visibility::occluders::OccluderIndex) finds for
    /// region and target; more do no harm.
    #[must_use]
    pub fn new(region: &[DVec3], normal: DVec3, target: &[DVec3], occluders: &[Occluder<'_>]) -> Self {
        let above = region
            .first()
            .map(|&origin| clip_to_half_space(target, origin, normal))
            .unwrap_or_default();
        if above.len() < 3 {
            return Self { shadows: None };
        }
        let receiver = Receiver::new(region.to_vec(), normal);
        Self {
            shadows: Some(Shadows::new(&receiver, &above, occluders)),
        }
    }

    /// Returns the form factor from a point of the region to the part of the target that it sees, in \[0, 1\].
    #[must_use]
    pub fn at(&mut self, point: DVec3) -> f64 {
        self.shadows.as_mut().map_or(0.0, |shadows| shadows.visible(point)[0])
    }
}
