//! Two-sided sheets: faces of opposite winding that coincide, wholly or in part.
//!
//! A ray that meets a sheet hits both of its faces at the same distance, and f32 decides by chance which one is
//! reported. The front-facing one counts. A hit from behind is therefore passed on to the front-facing face that coincides
//! with the hit face at that point. This needs no pairing of the faces: one side may be a quad and
//! the other two triangles, or a small face may lie on the back of a large one.

use super::flat_polygon::FlatPolygon;
use super::frame::Frame;
use crate::geometry::box_pairs::overlapping_pairs;

/// The faces that coincide with a face of opposite winding.
#[derive(Clone, Debug)]
pub(super) struct Sheets {
    /// The partners of face i are `partners[first[i]..first[i + 1]]`.
    first: Vec<usize>,
    partners: Vec<u32>,
    polygons: Vec<FlatPolygon>,
    /// The greatest distance of a hit outside a partner, in m.
    tolerance: f64,
}

impl Sheets {
    /// Finds all sheets, or returns `None` if there are none. Takes O(n log n) time for n faces of similar size.
    pub(super) fn find(frame: &Frame, polygons: Vec<FlatPolygon>) -> Option<Self> {
        let gap = frame.coincident();
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        overlapping_pairs(polygons.iter().map(|polygon| polygon.bounds(gap)).collect(), |a, b| {
            if coincide(&polygons[a as usize], &polygons[b as usize], gap) {
                pairs.extend([(a, b), (b, a)]);
            }
        });
        if pairs.is_empty() {
            return None;
        }
        pairs.sort_unstable();
        let mut first = vec![0; polygons.len() + 1];
        for &(face, _) in &pairs {
            first[face as usize + 1] += 1;
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        Some(Self {
            first,
            partners: pairs.into_iter().map(|(_, partner)| partner).collect(),
            polygons,
            // Below the offset the scene is not resolved.
            tolerance: frame.offset(),
        })
    }

    /// Returns the face that coincides with the back of `face` at the point (u, v) of it, and the point's coordinates there.
    pub(super) fn front(&self, face: u32, u: f32, v: f32) -> Option<(u32, f64, f64)> {
        let range = self.first[face as usize]..self.first[face as usize + 1];
        if range.is_empty() {
            return None;
        }
        let point = self.polygons[face as usize].point_at(f64::from(u), f64::from(v));
        let depth_in = |&partner: &u32| (self.polygons[partner as usize].depth(point), partner);
        let candidates = self.partners[range].iter().map(depth_in);
        let (depth, partner) = candidates.max_by(|a, b| a.0.total_cmp(&b.0))?;
        if depth < -self.tolerance {
            return None;
        }
        let (on_u, on_v) = self.polygons[partner as usize].local_coordinates(point);
        Some((partner, on_u.clamp(0.0, 1.0), on_v.clamp(0.0, 1.0)))
    }
}

/// Returns true if two faces of opposite winding lie in one plane, up to `gap`, and share more than an edge there.
pub(super) fn coincide(a: &FlatPolygon, b: &FlatPolygon, gap: f64) -> bool {
    let within = |plane: &FlatPolygon, of: &FlatPolygon| of.corners.iter().all(|&v| plane.height(v).abs() <= gap);
    // Two convex polygons are apart if and only if the line of an edge of one of them separates them.
    let apart = |by: &FlatPolygon, other: &FlatPolygon| {
        by.edges()
            .any(|(corner, inward)| other.corners.iter().all(|&v| inward.dot(v - corner) <= gap))
    };
    a.normal.dot(b.normal) < 0.0 && (within(a, b) || within(b, a)) && !apart(a, b) && !apart(b, a)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    const GAP: f64 = 1e-7;

    /// A rectangle in the plane z, turned out of the axes.
    fn rectangle(x: [f64; 2], y: [f64; 2], z: f64, reversed: bool) -> FlatPolygon {
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 0.7);
        let mut corners = vec![(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])];
        if reversed {
            corners.reverse();
        }
        FlatPolygon::new(corners.into_iter().map(|(a, b)| turn * DVec3::new(a, b, z)).collect())
    }

    fn frame() -> Frame {
        Frame {
            origin: DVec3::ZERO,
            largest: 1.0,
            slack: 0.0,
        }
    }

    #[test]
    fn only_opposite_faces_that_share_area_in_one_plane_coincide() {
        let square = rectangle([0.0, 1.0], [0.0, 1.0], 0.0, false);
        assert!(coincide(&square, &rectangle([0.0, 1.0], [0.0, 1.0], 0.0, true), GAP));
        assert!(
            coincide(&square, &rectangle([0.9, 1.5], [0.2, 0.4], 0.0, true), GAP),
            "a part"
        );
        assert!(
            !coincide(&square, &rectangle([0.0, 1.0], [0.0, 1.0], 0.0, false), GAP),
            "same winding"
        );
        assert!(
            !coincide(&square, &rectangle([0.0, 1.0], [0.0, 1.0], 1e-5, true), GAP),
            "a thin wall"
        );
        assert!(
            !coincide(&square, &rectangle([1.0, 2.0], [0.0, 1.0], 0.0, true), GAP),
            "an edge in common"
        );
        assert!(
            !coincide(&square, &rectangle([1.0, 2.0], [1.0, 2.0], 0.0, true), GAP),
            "a corner in common"
        );
    }

    #[test]
    fn the_back_of_a_quad_is_found_among_two_triangles_and_a_poster_only_where_it_is() {
        let quad = rectangle([0.0, 1.0], [0.0, 1.0], 0.0, false);
        let back = rectangle([0.0, 1.0], [0.0, 1.0], 0.0, true);
        let halves = [[0, 1, 2], [0, 2, 3]].map(|half| FlatPolygon::new(half.map(|k| back.corners[k]).to_vec()));
        let wall = rectangle([2.0, 4.0], [0.0, 1.0], 0.0, false);
        let poster = rectangle([2.0, 3.0], [0.0, 1.0], 0.0, true);
        let [first, second] = halves;
        let sheets = Sheets::find(&frame(), vec![quad.clone(), first, second, wall, poster]).unwrap();

        let mut seen = [0; 2];
        for (u, v) in [(0.2, 0.3), (0.3, 0.2), (0.9, 0.4), (0.4, 0.9), (0.7, 0.8)] {
            let point = quad.point_at(f64::from(u), f64::from(v));
            let (partner, pu, pv) = sheets.front(0, u, v).unwrap();
            assert!(partner == 1 || partner == 2);
            seen[partner as usize - 1] += 1;
            assert!(sheets.polygons[partner as usize].point_at(pu, pv).distance(point) < 1e-15);
            assert_eq!(sheets.front(partner, 0.25, 0.25).unwrap().0, 0);
        }
        assert!(seen[0] > 0 && seen[1] > 0);
        assert_eq!(sheets.front(3, 0.25, 0.5).unwrap().0, 4);
        assert!(sheets.front(3, 0.75, 0.5).is_none());
    }

    #[test]
    fn a_closed_box_has_no_sheets() {
        let (low, high) = ([0.0, 1.0], [0.0, 1.0]);
        let floor = rectangle(low, high, 0.0, false);
        let ceiling = rectangle(low, high, 1.0, true);
        assert!(Sheets::find(&frame(), vec![floor, ceiling]).is_none());
    }
}
