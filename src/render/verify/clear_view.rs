//! A proof, in f64, that no occluder is between a point and a polygon.

use glam::DVec3;

use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;

/// A planar polygon with its unit normal.
#[derive(Clone, Debug)]
pub(super) struct Plate {
    pub(super) corners: Vec<DVec3>,
    pub(super) normal: DVec3,
}

impl Plate {
    pub(super) fn new(corners: Vec<DVec3>) -> Self {
        let normal = polygon::area_vector(&corners).normalize_or_zero();
        Self { corners, normal }
    }

    /// Returns whether this is the same face.
    pub(super) fn is(&self, other: &Self) -> bool {
        self.corners == other.corners
    }

    /// Returns the distance of a point of its plane inside of its edges, in m; less than 0 outside.
    pub(super) fn depth(&self, point: DVec3) -> f64 {
        let of_edge = |k: usize| {
            let edge = self.corners[(k + 1) % self.corners.len()] - self.corners[k];
            let height = self.normal.dot(edge.cross(point - self.corners[k]));
            // Two equal corners have no edge.
            if edge == DVec3::ZERO {
                f64::INFINITY
            } else {
                height / edge.length()
            }
        };
        (0..self.corners.len()).map(of_edge).fold(f64::INFINITY, f64::min)
    }
}

/// Returns whether no point lies above a plane by more than the slack.
fn none_above(points: &[DVec3], origin: DVec3, normal: DVec3, slack: f64) -> bool {
    points.iter().all(|&v| normal.dot(v - origin) <= slack)
}

/// Returns true if the occluder is sure to hide no part of the emitter from any point of a flat region with the given normal.
///
/// It lies behind the region's plane, or behind the emitter's, or region and emitter lie on one side of it. Parts that protrude by less
/// than `slack` are ignored. False means that the occluder may or may not hide a part.
pub(super) fn misses_region(occluder: &Plate, region: &[DVec3], normal: DVec3, emitter: &Plate, slack: f64) -> bool {
    let same_side = |sign: f64| {
        let (origin, away) = (occluder.corners[0], occluder.normal * -sign);
        none_above(region, origin, away, slack) && none_above(&emitter.corners, origin, away, slack)
    };
    none_above(&occluder.corners, region[0], normal, slack)
        || none_above(&occluder.corners, emitter.corners[0], emitter.normal, slack)
        || same_side(1.0)
        || same_side(-1.0)
}

/// Returns true if none of the convex occluders hides any part of the emitter that lies above the point's horizon.
///
/// For each one a separating plane is sought between it and the pyramid of point and emitter: those of [`misses_region`], the pyramid's sides,
/// and the planes of the point and one of the occluder's edges. These suffice except for occluders that cross the horizon or the emitter's plane.
pub(super) fn is_clear<'a>(
    point: DVec3,
    normal: DVec3,
    emitter: &Plate,
    occluders: impl IntoIterator<Item = &'a Plate>,
    slack: f64,
) -> bool {
    let base = clip_to_half_space(&emitter.corners, point, normal);
    occluders.into_iter().all(|occluder| {
        misses_region(occluder, &[point], normal, emitter, slack)
            || side_separates(point, &base, &occluder.corners, slack)
            || side_separates(point, &occluder.corners, &base, slack)
    })
}

/// Returns true if the plane of the point and one edge of `owner` separates `owner` from `other`.
fn side_separates(point: DVec3, owner: &[DVec3], other: &[DVec3], slack: f64) -> bool {
    (0..owner.len()).any(|k| {
        let side = (owner[k] - point)
            .cross(owner[(k + 1) % owner.len()] - point)
            .normalize_or_zero();
        side != DVec3::ZERO
            && [side, -side]
                .iter()
                .any(|&side| none_above(owner, point, side, slack) && none_above(other, point, -side, slack))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLACK: f64 = 1e-12;

    /// Returns a square of half side h around c, facing down.
    fn down(c: DVec3, h: f64) -> Plate {
        let corner = |x: f64, y: f64| c + DVec3::new(x * h, y * h, 0.0);
        Plate::new(vec![
            corner(-1.0, -1.0),
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
            corner(1.0, -1.0),
        ])
    }

    fn clear(point: DVec3, occluder: &Plate) -> bool {
        let lamp = down(DVec3::Z * 2.0, 0.5);
        assert!(lamp.normal.z < -0.999);
        is_clear(point, DVec3::Z, &lamp, [occluder], SLACK)
    }

    #[test]
    fn the_shadow_of_a_plate_is_found_and_its_surroundings_are_cleared() {
        // At half height a plate of half side h shades the floor up to 2 h + 0.5 from the middle, penumbra included.
        let plate = down(DVec3::Z, 0.3);
        for (x, lit) in [(0.0, false), (0.5, false), (1.099, false), (1.101, true), (5.0, true)] {
            assert_eq!(clear(DVec3::new(x, 0.0, 0.0), &plate), lit, "{x}");
            assert_eq!(clear(DVec3::new(0.3, -x, 0.0), &plate), lit, "{x}");
        }
        // A corner of the pyramid against a corner of the plate, where no side of the pyramid separates.
        let turned = Plate::new(
            [(0.0, -1.0), (-1.0, 0.0), (0.0, 1.0), (1.0, 0.0)]
                .map(|(x, y)| DVec3::new(x, y, 1.0) * DVec3::new(0.3, 0.3, 1.0))
                .to_vec(),
        );
        // Its shadow's edge, with the penumbra, is the sum of a square and a diamond: |x| + |y| ≤ 0.5 + 0.5 + 0.6 at the diamond's sides.
        assert!(!clear(DVec3::new(0.79, 0.79, 0.0), &turned));
        assert!(clear(DVec3::new(0.81, 0.81, 0.0), &turned));
    }

    #[test]
    fn plates_elsewhere_do_not_block() {
        let origin = DVec3::ZERO;
        assert!(clear(origin, &down(DVec3::Z * 2.5, 9.0)), "behind the lamp");
        assert!(clear(origin, &down(DVec3::Z * 2.0, 9.0)), "in the lamp's plane");
        assert!(clear(origin, &down(DVec3::ZERO, 9.0)), "in the floor's plane");
        assert!(clear(origin, &down(DVec3::Z * -1.0, 9.0)), "below the floor");
        assert!(!clear(origin, &down(DVec3::Z * 1e-6, 9.0)), "a sheet on the floor");
        // A wall through the pyramid, crossing both planes.
        let wall = |x: f64| {
            let corner = |y: f64, z: f64| DVec3::new(x, y, z);
            Plate::new(vec![
                corner(-9.0, -9.0),
                corner(9.0, -9.0),
                corner(9.0, 9.0),
                corner(-9.0, 9.0),
            ])
        };
        assert!(!clear(origin, &wall(0.1)));
        assert!(clear(origin, &wall(0.5)), "it touches the lamp's edge");
        assert!(clear(origin, &wall(-3.0)));
    }

    #[test]
    fn a_region_is_cleared_as_a_whole_or_not_at_all() {
        let lamp = down(DVec3::Z * 2.0, 0.5);
        let region = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let misses = |occluder: &Plate| misses_region(occluder, &region, DVec3::Z, &lamp, SLACK);
        assert!(misses(&down(DVec3::ZERO, 1.0)));
        assert!(!misses(&down(DVec3::Z, 0.1)));
        let wall = Plate::new(vec![
            DVec3::X * 2.0,
            DVec3::new(2.0, 1.0, 0.0),
            DVec3::new(2.0, 0.0, 3.0),
        ]);
        assert!(misses(&wall));
    }
}
