//! Faces that touch but for the rounding of their coordinates.
//!
//! Two polygons with a common edge that rounding has parted by a millionth of their size have a different view within that distance of the edge, and so does a floor of the light that shines through the slit under a
//! wall. An integral to a tolerance resolves such views with millions of evaluations, although they are not a property of the scene as it was meant: here such faces touch.

use std::borrow::Cow;

use glam::DVec3;

use super::Plane;
use super::levels::MIN_SLACKS;

/// The squared sine between normals below which two planes have no well-defined line in common.
const PARALLEL: f64 = 1e-3;

/// The greatest move of corners that were meant to touch, in slacks.
const FARTHEST: f64 = 4.0;

/// Returns two convex polygons as they were meant, if one has corners within `slack`, m, of the other's plane.
///
/// Both become flat, with these corners on the line that the planes share. No corner moves by more than a few times `slack`.
/// `None` if neither has such corners, or if all of one are as near, so that its view may be rounding alone.
pub(super) fn meeting(p: &[DVec3], q: &[DVec3], slack: f64) -> Option<[Vec<DVec3>; 2]> {
    if slack <= 0.0 {
        return None;
    }
    let ends = [p, q];
    let [one, other] = ends.map(through_middle);
    let along = one.normal.dot(other.normal);
    let sine = 1.0 - along * along;
    if sine < PARALLEL {
        return None;
    }
    let planes = [one, other];
    let touches = |k: usize, corner: DVec3| planes[1 - k].height(corner).abs() <= slack;
    let n_touching = [0, 1].map(|k| ends[k].iter().filter(|&&corner| touches(k, corner)).count());
    if n_touching == [0, 0] || (0..2).any(|k| n_touching[k] == ends[k].len()) {
        return None;
    }
    let flat = |k: usize| {
        let meant = ends[k].iter().map(|&corner| {
            if touches(k, corner) {
                // The nearest point with no height over either plane.
                let [g, h] = planes.each_ref().map(|plane| plane.height(corner));
                corner - (g - along * h) / sine * planes[0].normal - (h - along * g) / sine * planes[1].normal
            } else {
                corner - planes[k].height(corner) * planes[k].normal
            }
        });
        meant.collect::<Vec<_>>()
    };
    let meant = [flat(0), flat(1)];
    let is_near = |k: usize| {
        ends[k]
            .iter()
            .zip(&meant[k])
            .all(|(a, b)| a.distance(*b) <= FARTHEST * slack)
    };
    (is_near(0) && is_near(1)).then_some(meant)
}

/// Returns the plane of a polygon that rounding may have bent, through the mean of its corners.
fn through_middle(corners: &[DVec3]) -> Plane {
    let plane = Plane::of(corners);
    let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
    Plane { point: middle, ..plane }
}

/// Returns the corners of an occluder that stands on a patch, moved so that no light passes under it.
///
/// The corners within `slack`, m, of the patch's plane are moved behind it by as much.
pub(crate) fn standing_on<'a>(patches: [&[DVec3]; 2], occluder: &'a [DVec3], slack: f64) -> Cow<'a, [DVec3]> {
    let mut corners = Cow::Borrowed(occluder);
    if slack <= 0.0 {
        return corners;
    }
    for plane in patches.map(through_middle) {
        let stands = occluder.iter().any(|&corner| plane.height(corner) > MIN_SLACKS * slack);
        let touches = |corner: &DVec3| plane.height(*corner).abs() <= slack;
        if stands && occluder.iter().any(touches) {
            for corner in corners.to_mut().iter_mut().filter(|corner| touches(corner)) {
                *corner -= (plane.height(*corner) + slack) * plane.normal;
            }
        }
    }
    corners
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    /// A floor and a wall along its border, with corners that are off by up to `off`.
    fn floor_and_wall(off: f64) -> [Vec<DVec3>; 2] {
        let floor = [(0.0, 0.0, 0.3), (2.0, 0.0, -1.0), (2.0, 1.0, 0.7), (0.0, 1.0, -0.2)];
        let wall = [(0.0, 0.4, 0.0), (0.0, -0.8, 2.0), (2.0, 0.1, 2.0), (2.0, 0.9, 0.0)];
        [
            floor.map(|(x, y, z)| DVec3::new(x, y, off * z)).to_vec(),
            wall.map(|(x, y, z)| DVec3::new(x, off * y, z)).to_vec(),
        ]
    }

    #[test]
    fn what_rounding_has_parted_shares_a_line_and_is_flat() {
        let [floor, wall] = floor_and_wall(1e-6);
        let meant = meeting(&floor, &wall, 2e-6).unwrap();
        let planes = meant.each_ref().map(|corners| Plane::of(corners));
        for (corners, before) in meant.iter().zip([&floor, &wall]) {
            for (k, corner) in corners.iter().enumerate() {
                assert!(corner.distance(before[k]) < 4e-6, "{corner}");
                let own = usize::from(before == &wall);
                assert!(planes[own].height(*corner).abs() < 1e-15, "{corner}");
            }
        }
        for (k, corners) in [(1, [0, 1]), (0, [0, 3])] {
            let on_line = corners.map(|corner| planes[k].height(meant[1 - k][corner]).abs());
            assert!(on_line.iter().all(|height| *height < 1e-15), "{on_line:?}");
        }
        assert_eq!(meeting(&floor, &wall, 0.0), None);
        let away = DVec3::new(0.0, -1e-3, 1e-3);
        let apart: Vec<DVec3> = wall.iter().map(|corner| *corner + away).collect();
        assert_eq!(meeting(&floor, &apart, 2e-6), None);
        let beside: Vec<DVec3> = floor
            .iter()
            .map(|corner| *corner + DVec3::new(2.0, 0.0, 1e-6))
            .collect();
        assert_eq!(meeting(&floor, &beside, 2e-6), None);
    }

    #[test]
    fn what_stands_on_a_patch_reaches_through_its_plane() {
        let [floor, wall] = floor_and_wall(1e-6);
        let plate: Vec<DVec3> = wall.iter().map(|v| 0.5 * *v + DVec3::new(0.5, 0.5, 1e-6)).collect();
        let standing = standing_on([&floor, &wall], &plate, 2e-6);
        let plane = through_middle(&floor);
        assert!([0, 3].iter().all(|&k| plane.height(standing[k]) < -1.9e-6));
        assert!([1, 2].iter().all(|&k| standing[k] == plate[k]));
        // A plate that hangs over it, lies on it, or has exact coordinates stays.
        let hanging: Vec<DVec3> = plate.iter().map(|v| *v + 1e-3 * DVec3::Z).collect();
        let lying: Vec<DVec3> = floor.iter().map(|v| 0.5 * *v + DVec3::new(0.5, 0.2, 1e-6)).collect();
        for (occluder, slack) in [(&hanging, 2e-6), (&lying, 2e-6), (&plate, 0.0)] {
            assert!(matches!(
                standing_on([&floor, &wall], occluder, slack),
                Cow::Borrowed(_)
            ));
        }
    }
}
