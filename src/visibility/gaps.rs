//! Gaps between faces that are too narrow for the offset of the rays.

use glam::DVec3;

use super::flat_polygon::FlatPolygon;
use super::frame::Frame;
use crate::geometry::box_pairs::overlapping_pairs;
use crate::scene::{FaceId, Scene};

/// The number of offsets below which a gap is narrow: a ray that starts one offset off a face has then crossed a tenth of the gap.
pub const NARROW: f64 = 10.0;

/// The distance up to which faces count as touching, in multiples of the rounding of coordinates.
const TOUCHING: f64 = 10.0;

/// Two faces that face each other across a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// The faces, in the order of the file.
    pub faces: [FaceId; 2],
    /// Their least distance, in m; more than 0.
    pub width: f64,
}

/// Returns the narrowest gap of a scene if it is less than [`NARROW`] offsets wide, or `None`.
///
/// A gap lies between two faces that face each other (the angle between their normals is more than 120°) without touching:
/// rays from one to the other start and end an offset off the faces, and miss a part of the view if the gap is not
/// much wider than that. Faces that touch taper towards each other anyway and do not count. `offset` is
/// [`Visibility::offset`](super::Visibility::offset), in m.
///
/// Accuracy: rounding. Time: O(n log n) for n faces of similar size.
#[must_use]
pub fn narrowest_gap(scene: &Scene, offset: f64) -> Option<Gap> {
    let frame = Frame::of(scene);
    let polygons = frame.polygons(scene);
    let limit = NARROW * offset;
    // Faces that touch for rays may well have a gap: rays have coordinates in f32 only.
    let rounding = 16.0 * f64::EPSILON * scene.greatest_where_faces_meet();
    let touching = frame.coincident().min(TOUCHING * (scene.slack() + rounding));
    let mut narrowest: Option<(f64, [u32; 2])> = None;
    overlapping_pairs(
        polygons.iter().map(|polygon| polygon.bounds(limit)).collect(),
        |a, b| {
            let pair = [a.min(b), a.max(b)];
            let [p, q] = pair.map(|face| &polygons[face as usize]);
            if p.normal.dot(q.normal) > -0.5 || !(in_front(p, q) && in_front(q, p)) {
                return;
            }
            let width = distance(p, q);
            let closer = |&(least, of): &(f64, [u32; 2])| width.total_cmp(&least).then(pair.cmp(&of)).is_lt();
            if width > touching && width < limit && narrowest.as_ref().is_none_or(closer) {
                narrowest = Some((width, pair));
            }
        },
    );
    narrowest.map(|(width, pair)| Gap {
        faces: pair.map(FaceId),
        width,
    })
}

fn in_front(of: &FlatPolygon, other: &FlatPolygon) -> bool {
    other.corners.iter().any(|&v| of.height(v) > 0.0)
}

/// Returns the least distance of two convex faces that do not pierce each other.
fn distance(p: &FlatPolygon, q: &FlatPolygon) -> f64 {
    let from_corners = |of: &FlatPolygon, to: &FlatPolygon| {
        let over = of.corners.iter().filter(|&&v| to.depth(v) >= 0.0);
        over.map(|&v| to.height(v).abs()).fold(f64::INFINITY, f64::min)
    };
    let mut least = from_corners(p, q).min(from_corners(q, p));
    for a in sides(p) {
        for b in sides(q) {
            least = least.min(between_segments(a, b));
        }
    }
    least
}

fn sides(polygon: &FlatPolygon) -> impl Iterator<Item = [DVec3; 2]> + '_ {
    let next = polygon.corners.iter().cycle().skip(1);
    polygon.corners.iter().zip(next).map(|(&a, &b)| [a, b])
}

/// Returns the least distance of two segments.
///
/// Source: Ericson, "Real-Time Collision Detection", 2005, section 5.1.9. Departures: none.
fn between_segments([a0, a1]: [DVec3; 2], [b0, b1]: [DVec3; 2]) -> f64 {
    let (along_a, along_b, between) = (a1 - a0, b1 - b0, a0 - b0);
    let (a, e) = (along_a.length_squared(), along_b.length_squared());
    let (f, c, b) = (along_b.dot(between), along_a.dot(between), along_a.dot(along_b));
    let on = |numerator: f64, denominator: f64| {
        if denominator > 0.0 {
            (numerator / denominator).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let mut s = on(b * f - c * e, a * e - b * b);
    let t = on(b * s + f, e);
    s = on(b * t - c, a);
    (a0 + s * along_a).distance(b0 + t * along_b)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::builtin;

    #[test]
    fn segments_cross_run_alongside_and_point_at_each_other() {
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
        let crossing = between_segments([-x, x], [z - y, z + y]);
        let alongside = between_segments([DVec3::ZERO, x], [2.0 * y + 0.5 * x, 2.0 * y + 3.0 * x]);
        let apart = between_segments([DVec3::ZERO, x], [4.0 * x + 4.0 * y, 9.0 * x + 4.0 * y]);
        let points = between_segments([x, x], [y, y]);
        for (found, expected) in [
            (crossing, 1.0),
            (alongside, 2.0),
            (apart, 5.0),
            (points, 2.0_f64.sqrt()),
        ] {
            assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        }
    }

    #[test]
    fn distances_are_those_of_corners_over_faces_and_of_crossing_edges() {
        let square = |turn: f64, z: f64, down: bool| {
            let corner = |k: i32| {
                let angle = turn + f64::from(if down { -k } else { k }) * std::f64::consts::FRAC_PI_2;
                DVec3::new(angle.cos(), angle.sin(), z)
            };
            FlatPolygon::new((0..4).map(corner).collect())
        };
        let floor = square(0.3, 0.0, false);
        // Each corner lies outside of the other square, so only edges come near.
        let turned = square(0.3 + std::f64::consts::FRAC_PI_4, 0.25, true);
        assert!((distance(&floor, &turned) - 0.25).abs() < 1e-15);
        let mut small = turned.clone();
        small
            .corners
            .iter_mut()
            .for_each(|v| *v = DVec3::new(v.x * 0.1, v.y * 0.1, v.z));
        assert!((distance(&floor, &small) - 0.25).abs() < 1e-15);
    }

    #[test]
    fn a_room_has_no_narrow_gap_and_a_box_that_floats_too_low_has_one() {
        for name in ["cube", "cornell-box", "room-box", "corridor"] {
            let scene = builtin::build(name, None).unwrap().scene;
            assert_eq!(narrowest_gap(&scene, 3e-6), None, "{name}");
        }
        // The floor and the bottom of a box, brought within 2e-5 m of each other.
        let mut scene = builtin::build("room-box", None).unwrap().scene;
        let floor = scene.bounding_box().0.z;
        let (low, high) = scene.bounding_box();
        let inner = |v: DVec3| (v.cmpgt(low) & v.cmplt(high)).all();
        let bottom = scene
            .vertices
            .iter()
            .filter(|&&v| inner(v))
            .map(|v| v.z)
            .fold(f64::INFINITY, f64::min);
        for v in scene.vertices.iter_mut().filter(|v| inner(**v)) {
            v.z += floor + 2e-5 - bottom;
        }
        let gap = narrowest_gap(&scene, 3e-6).unwrap();
        assert!((gap.width - 2e-5).abs() < 1e-15, "{}", gap.width);
        let normals = gap.faces.map(|face| scene.area_vector(face).normalize());
        assert!(normals[0].dot(normals[1]) < -0.999 && normals[0].z.abs() > 0.999);
        for v in scene.vertices.iter_mut().filter(|v| inner(**v)) {
            v.z -= 2e-5 - 1e-9;
        }
        let width = narrowest_gap(&scene, 3e-6).unwrap().width;
        assert!((width - 1e-9).abs() < 1e-14, "narrower than f32 tells: {width}");
        for v in scene.vertices.iter_mut().filter(|v| inner(**v)) {
            v.z += 2e-5 - 1e-9;
        }
        assert_eq!(
            narrowest_gap(&scene, 1.9e-6),
            None,
            "an offset that the gap is wide enough for"
        );
    }
}
