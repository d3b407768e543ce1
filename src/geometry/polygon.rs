//! Area, normal and centroid of planar polygons given by their corners.

use glam::DVec3;

/// Returns the area vector of a closed polygon: its area times its unit normal.
///
/// a = 1/2 Σ (v_k − c) × (v_{k+1} − c) with c = v_0, in m². The normal follows the right-hand rule of the
/// winding. For a non-planar polygon this is the area vector of any surface that it bounds.
/// Accuracy: a few ulps of the squared diameter; subtracting v_0 first keeps the digits of a small polygon far from the origin.
/// Departures: none.
#[must_use]
pub fn area_vector(corners: &[DVec3]) -> DVec3 {
    let Some((&c, rest)) = corners.split_first() else {
        return DVec3::ZERO;
    };
    rest.windows(2).map(|w| (w[0] - c).cross(w[1] - c)).sum::<DVec3>() * 0.5
}

/// Returns the least and the greatest corner of the box around points; without points the box is infinite and inverted.
#[must_use]
pub fn bounds<'a>(points: impl IntoIterator<Item = &'a DVec3>) -> (DVec3, DVec3) {
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let points = points.into_iter();
    points.fold(none, |(low, high), &v| (low.min(v), high.max(v)))
}

/// Returns the length of the border of a polygon, in m.
#[must_use]
pub fn perimeter(corners: &[DVec3]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| a.distance(*b)).sum()
}

/// Returns the centroid of a planar polygon with a non-zero area.
///
/// c = v_0 + Σ a_k (v_k + v_{k+1} − 2 v_0) / (3 Σ a_k), with a_k the signed areas of the fan's triangles.
#[must_use]
pub fn centroid(corners: &[DVec3]) -> DVec3 {
    let c = corners[0];
    let normal = area_vector(corners).normalize_or_zero();
    let mut total = 0.0;
    let mut moment = DVec3::ZERO;
    for w in corners[1..].windows(2) {
        let (p, q) = (w[0] - c, w[1] - c);
        let area = p.cross(q).dot(normal);
        total += area;
        moment += area * (p + q);
    }
    c + moment / (3.0 * total)
}

/// Returns the distance of a point from the nearest edge of a closed polygon, in m; edges of no length do not count.
#[must_use]
pub fn distance_from_edges(point: DVec3, corners: &[DVec3]) -> f64 {
    let n = corners.len();
    (0..n)
        .map(|k| (corners[k] - point, corners[(k + 1) % n] - corners[k]))
        .map(|(start, edge)| {
            let t = (-start.dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            (start + t * edge).length()
        })
        .fold(f64::INFINITY, f64::min) // ignores NaN, from edges of no length
}

/// Returns the distance of a point from a convex polygon, in m.
#[must_use]
pub fn distance(point: DVec3, corners: &[DVec3]) -> f64 {
    let normal = area_vector(corners).normalize_or_zero();
    let n = corners.len();
    let is_over = |k: usize| {
        (corners[(k + 1) % n] - corners[k])
            .cross(point - corners[k])
            .dot(normal)
            >= 0.0
    };
    if (0..n).all(is_over) {
        (point - corners[0]).dot(normal).abs()
    } else {
        distance_from_edges(point, corners)
    }
}

/// Returns the largest distance of a corner from the plane through the corners' mean with the polygon's own normal, in m.
#[must_use]
pub fn planarity_error(corners: &[DVec3]) -> f64 {
    let normal = area_vector(corners).normalize_or_zero();
    let mean = corners.iter().sum::<DVec3>() / corners.len() as f64;
    let highest = corners.iter().map(|&v| normal.dot(v - mean).abs()).fold(0.0, f64::max);
    match *corners {
        // The normal of a narrow quad leans by rounding. Its diagonals are no farther apart than any edge is long, and each corner is half as far from the mean plane.
        [a, b, c, d] => {
            let edges = [b - a, c - b, d - c, a - d].map(DVec3::length);
            edges.into_iter().fold(2.0 * highest, f64::min) / 2.0
        }
        _ => highest,
    }
}

/// Returns the solid angle of a polygon as the origin sees it, sr: positive from behind.
///
/// It is negative where its normal, by the right-hand rule of its corners, faces the origin.
/// tan(Ω/2) = a · (b × c) / (abc + (a · b) c + (b · c) a + (c · a) b) for each triangle of a fan. Source: A. van Oosterom, J. Strackee, "The Solid Angle of a Plane Triangle", IEEE Transactions on
/// Biomedical Engineering 30(2), 1983. Departures: none.
#[must_use]
pub fn solid_angle(corners: &[DVec3]) -> f64 {
    let Some((&a, rest)) = corners.split_first() else {
        return 0.0;
    };
    let triangle = |pair: &[DVec3]| {
        let (b, c) = (pair[0], pair[1]);
        let [x, y, z] = [a, b, c].map(DVec3::length);
        2.0 * a
            .dot(b.cross(c))
            .atan2(x * y * z + a.dot(b) * z + b.dot(c) * x + c.dot(a) * y)
    };
    rest.windows(2).map(triangle).sum()
}

/// Returns whether a vector has at most one component that is not 0.
pub(crate) fn is_along_axis(vector: DVec3) -> bool {
    vector.to_array().iter().filter(|x| x.abs() > 0.0).count() < 2
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn a_side_of_a_cube_is_a_sixth_of_the_sphere() {
        let mut side = [
            DVec3::new(-1.0, -1.0, 1.0),
            DVec3::new(1.0, -1.0, 1.0),
            DVec3::new(1.0, 1.0, 1.0),
            DVec3::new(-1.0, 1.0, 1.0),
        ];
        assert!((solid_angle(&side) - 4.0 * PI / 6.0).abs() < 1e-14);
        side.reverse();
        assert!((solid_angle(&side) + 4.0 * PI / 6.0).abs() < 1e-14);
        assert!(solid_angle(&side[..2]).abs() < 1e-300 && solid_angle(&[]).abs() < 1e-300);
    }
}
