//! Cutting a planar polygon along a plane.

use glam::DVec3;

/// Emits the corners of the part of a polygon where `height` is not negative, in order.
///
/// Each polygon edge is cut at most once ([`SUTHERLAND_HODGMAN_1974`](crate::references::SUTHERLAND_HODGMAN_1974), with one plane). `corner(k)` gives the k-th of
/// `n_corners` corners and `height` must be affine. A corner may be emitted twice where the polygon only touches the
/// plane; a part that falls into pieces comes back joined by edges in the plane, whose contour integrals cancel.
/// Accuracy: a cut point is within a few ulps of the edge's length of the exact one. Departures: none.
pub fn clip_contour(
    n_corners: usize,
    corner: impl Fn(usize) -> DVec3,
    height: impl Fn(DVec3) -> f64,
    mut emit: impl FnMut(DVec3),
) {
    for k in 0..n_corners {
        let (a, b) = (corner(k), corner((k + 1) % n_corners));
        let (height_a, height_b) = (height(a), height(b));
        if height_a >= 0.0 {
            emit(a);
        }
        if (height_a >= 0.0) != (height_b >= 0.0) {
            emit(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
}

/// Returns the part of a planar polygon on the side of a plane that its normal points to; empty if there is none.
///
/// The plane goes through `point`; `normal` need not be a unit vector. See [`clip_contour`].
#[must_use]
pub fn clip_to_half_space(polygon: &[DVec3], point: DVec3, normal: DVec3) -> Vec<DVec3> {
    let mut part = Vec::with_capacity(polygon.len() + 1);
    clip_contour(
        polygon.len(),
        |k| polygon[k],
        |v| normal.dot(v - point),
        |v| part.push(v),
    );
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::polygon;

    const SQUARE: [DVec3; 4] = [
        DVec3::new(0.0, 0.0, 0.0),
        DVec3::new(2.0, 0.0, 0.0),
        DVec3::new(2.0, 2.0, 0.0),
        DVec3::new(0.0, 2.0, 0.0),
    ];

    #[test]
    fn a_cut_square_keeps_its_winding_and_the_right_area() {
        let part = clip_to_half_space(&SQUARE, DVec3::new(0.5, 0.0, 0.0), DVec3::new(3.0, 0.0, 1.0));
        assert_eq!(part.len(), 4);
        assert!((polygon::area_vector(&part) - DVec3::new(0.0, 0.0, 3.0)).length() < 1e-15);
        let corner = clip_to_half_space(&SQUARE, DVec3::new(1.0, 0.0, 0.0), DVec3::new(-1.0, -1.0, 0.0));
        assert_eq!(corner.len(), 3);
        assert!((polygon::area_vector(&corner).z - 0.5).abs() < 1e-15);
    }

    #[test]
    fn all_or_nothing_where_the_plane_misses() {
        assert_eq!(clip_to_half_space(&SQUARE, DVec3::Z * -1.0, DVec3::Z), SQUARE.to_vec());
        assert!(clip_to_half_space(&SQUARE, DVec3::Z, DVec3::Z).is_empty());
    }
}
