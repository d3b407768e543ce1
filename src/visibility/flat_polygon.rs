//! A convex face for ray queries in f64.

use glam::DVec3;

use crate::geometry::polygon;

/// A flat convex face with its unit normal.
#[derive(Clone, Debug)]
pub(super) struct FlatPolygon {
    /// Three or four corners, counter-clockwise seen from the front.
    pub(super) corners: Vec<DVec3>,
    /// The unit normal; zero for a face without area.
    pub(super) normal: DVec3,
}

impl FlatPolygon {
    pub(super) fn new(corners: Vec<DVec3>) -> Self {
        let normal = polygon::area_vector(&corners).normalize_or_zero();
        Self { corners, normal }
    }

    /// Returns the least and the greatest corner of the box around the face, widened by half of `margin`, so that boxes of faces less than `margin` apart overlap.
    pub(super) fn bounds(&self, margin: f64) -> (DVec3, DVec3) {
        let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let corners = self.corners.iter();
        let (low, high) = corners.fold(all, |(low, high), &v| (low.min(v), high.max(v)));
        (low - margin * 0.5, high + margin * 0.5)
    }

    /// Iterates over the edges: a corner, and the unit normal that points into the face within its plane.
    pub(super) fn edges(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        let next = self.corners.iter().cycle().skip(1);
        self.corners
            .iter()
            .zip(next)
            .map(|(&a, &b)| (a, self.normal.cross(b - a).normalize_or_zero()))
    }

    /// Returns the distance of a point in the plane from the nearest edge's line: positive inside, negative outside.
    pub(super) fn depth(&self, point: DVec3) -> f64 {
        self.edges()
            .map(|(a, inward)| inward.dot(point - a))
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns the signed distance of a point from the plane: positive in front.
    pub(super) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }

    /// Returns the local coordinates of a point in the plane, as [`Visibility::closest_hits`](super::Visibility::closest_hits) defines them.
    pub(super) fn local_coordinates(&self, point: DVec3) -> (f64, f64) {
        let c = &self.corners;
        let &[v0, v1, v2, v3] = c.as_slice() else {
            return affine_coordinates(c[0], c[1], c[2], point).unwrap_or((0.0, 0.0));
        };
        match affine_coordinates(v0, v1, v3, point) {
            Some((u, v)) if u + v <= 1.0 => (u, v),
            _ => affine_coordinates(v2, v3, v1, point).map_or((0.0, 0.0), |(u, v)| (1.0 - u, 1.0 - v)),
        }
    }

    /// Returns the point with these local coordinates.
    pub(super) fn point_at(&self, u: f64, v: f64) -> DVec3 {
        let c = &self.corners;
        match *c.as_slice() {
            [_, v1, v2, v3] if u + v > 1.0 => v2 + (1.0 - u) * (v3 - v2) + (1.0 - v) * (v1 - v2),
            [v0, v1, .., last] => v0 + u * (v1 - v0) + v * (last - v0),
            _ => c[0],
        }
    }
}

/// Solves point = a + u (b − a) + v (c − a) in the plane of a, b, c; `None` if they lie on a line.
fn affine_coordinates(a: DVec3, b: DVec3, c: DVec3, point: DVec3) -> Option<(f64, f64)> {
    let (e, f, p) = (b - a, c - a, point - a);
    let normal = e.cross(f);
    let scale = normal.length_squared();
    (scale > 0.0).then(|| (p.cross(f).dot(normal) / scale, e.cross(p).dot(normal) / scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn skew_quad() -> FlatPolygon {
        let axes = (DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.0, 1.0, 0.0));
        let corners = [(0.0, 0.0), (2.0, 0.2), (1.5, 1.5), (-0.3, 1.0)];
        FlatPolygon::new(corners.iter().map(|&(x, y)| x * axes.0 + y * axes.1).collect())
    }

    #[test]
    fn local_coordinates_and_points_are_inverse_on_triangles_and_on_both_halves_of_quads() {
        let quad = skew_quad();
        let triangle = FlatPolygon::new(quad.corners[..3].to_vec());
        for (u, v) in [(0.1, 0.2), (0.5, 0.5), (0.2, 0.75), (0.9, 0.9), (0.3, 0.8)] {
            let (u_back, v_back) = quad.local_coordinates(quad.point_at(u, v));
            assert!(
                (u_back - u).abs() < 1e-14 && (v_back - v).abs() < 1e-14,
                "{u} {v}: {u_back} {v_back}"
            );
        }
        let (u, v) = triangle.local_coordinates(triangle.point_at(0.25, 0.5));
        assert!((u - 0.25).abs() < 1e-15 && (v - 0.5).abs() < 1e-15);
    }

    #[test]
    fn corners_of_a_quad_have_the_coordinates_of_the_unit_square() {
        let quad = skew_quad();
        for (corner, (u, v)) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].into_iter().enumerate() {
            assert!(quad.point_at(u, v).distance(quad.corners[corner]) < 1e-15);
        }
    }

    #[test]
    fn depth_is_the_distance_to_the_nearest_edge_with_its_sign() {
        let square = FlatPolygon::new(vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y]);
        assert!((square.depth(DVec3::new(0.5, 0.125, 0.0)) - 0.125).abs() < 1e-15);
        assert!((square.depth(DVec3::new(1.25, 0.5, 0.0)) + 0.25).abs() < 1e-15);
        assert!((square.height(DVec3::new(0.5, 0.5, -3.0)) + 3.0).abs() < 1e-15);
    }
}
