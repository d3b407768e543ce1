//! The plane of a polygon, with heights and tolerances that are local to it.

use glam::DVec3;

use crate::geometry::polygon;

/// Heights and lengths below this share of those around them are zero.
pub(super) const FLAT: f64 = 1e-12;

/// The plane of a polygon.
///
/// A point counts as in the plane within a share of its distance from the polygon and of the polygon's size, and within 16 ulps of both coordinates: other polygons,
/// which may be far off and large, do not matter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flat {
    /// The unit normal.
    pub(super) normal: DVec3,
    origin: DVec3,
    size: f64,
    /// 16 ulps of the largest coordinate.
    rounding: f64,
}

impl Flat {
    pub(super) fn of(corners: &[DVec3]) -> Self {
        let normal = polygon::area_vector(corners).normalize_or_zero();
        Self::with_normal(corners, normal)
    }

    pub(super) fn with_normal(corners: &[DVec3], normal: DVec3) -> Self {
        let origin = corners.first().copied().unwrap_or_default();
        let most = |f: &dyn Fn(DVec3) -> f64| corners.iter().map(|&v| f(v)).fold(0.0, f64::max);
        Self {
            normal,
            origin,
            size: most(&|v| (v - origin).abs().element_sum()),
            rounding: most(&ulps),
        }
    }

    /// Returns how far a point lies in front of the plane.
    pub(super) fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p - self.origin)
    }

    /// Returns the height up to which a point counts as in the plane, as a `share` of lengths.
    pub(super) fn tolerance(&self, p: DVec3, share: f64) -> f64 {
        share * (self.size + (p - self.origin).abs().element_sum()) + self.rounding + ulps(p)
    }

    /// Returns the height of a point; 0 where the point counts as in the plane.
    pub(super) fn snapped_height(&self, p: DVec3, share: f64) -> f64 {
        let height = self.height(p);
        if height.abs() <= self.tolerance(p, share) {
            0.0
        } else {
            height
        }
    }

    /// Returns the height of one point above another, given the heights of both.
    ///
    /// Where the difference would lose digits, as for two points beside each other and far from the plane, it is computed from the points.
    pub(super) fn rise(&self, (p, h_p): (DVec3, f64), (q, h_q): (DVec3, f64)) -> f64 {
        let plain = h_p - h_q;
        if plain.abs() >= 1e-3 * h_p.max(h_q) {
            plain
        } else {
            self.normal.dot(p - q)
        }
    }
}

/// Returns 16 ulps of the largest coordinate of a point.
fn ulps(p: DVec3) -> f64 {
    16.0 * f64::EPSILON * p.abs().max_element()
}

/// Returns the point where the line through two points meets a plane, times `rise`, the height of p above q: h_p q − h_q p.
///
/// It starts from the lower of the two points, so that the digits of a point beside the plane are kept, however far off the other is.
pub(super) fn crossing((p, h_p): (DVec3, f64), (q, h_q): (DVec3, f64), rise: f64) -> DVec3 {
    if h_q <= h_p {
        q * rise + (q - p) * h_q
    } else {
        p * rise + (q - p) * h_p
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_meet_a_plane_where_they_do_at_every_distance() {
        let plane = Flat::with_normal(&[DVec3::ZERO, DVec3::X, DVec3::Y], DVec3::Z);
        let far_plane = |d: f64| {
            Flat::with_normal(
                &[DVec3::Z * d, d * (DVec3::Y + DVec3::Z), d * (DVec3::X + DVec3::Z)],
                -DVec3::Z,
            )
        };
        for k in 0..13 {
            let d = 10.0_f64.powi(k);
            // From (0.3, 0.1) on the plane through (0.4, 0.3, 0.7) on to the height d.
            let (foot, through) = (DVec3::new(0.3, 0.1, 0.0), DVec3::new(0.4, 0.3, 0.7));
            let top = foot + (through - foot) * (d / 0.7);
            let [p, q] = [top, through].map(|v| (v, plane.height(v)));
            for [p, q] in [[p, q], [q, p]] {
                let rise = plane.rise(p, q);
                assert!((crossing(p, q, rise) / rise - foot).length() < 1e-15 * 10.0, "{d}");
            }
            // The same line, met from both points near the first plane with one far off.
            let far = far_plane(d + 10.0);
            let [p, q] = [foot, through].map(|v| (v, far.height(v)));
            let rise = far.rise(p, q);
            let expected = foot + (through - foot) * ((d + 10.0) / 0.7);
            let off = (crossing(p, q, rise) / rise).distance(expected);
            assert!(off < 1e-14 * expected.length(), "{d} {off}");
        }
    }
}
