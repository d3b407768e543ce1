//! What was meant to touch before its coordinates were rounded.
//!
//! Polygons with an edge in common, which rounding has parted by a millionth of their size, see each other differently within that of the edge, and so do a floor and what shines through the slit under a
//! wall. An integral to a tolerance resolves such things with millions of evaluations and knows no more of the scene than before: here they touch.

use std::borrow::Cow;

use glam::DVec3;

use super::{LEAST_SLACKS, Plane};

/// Planes whose normals are nearer than this square of a sine have no line in common that is known well enough.
const PARALLEL: f64 = 1e-3;

/// Returns two convex polygons of which one has corners within `slack`, m, of the other's plane, as flat ones with these corners on the line that the planes share; `None` if neither has.
///
/// No corner moves by more than a few times `slack`.
pub(super) fn meeting(p: &[DVec3], q: &[DVec3], slack: f64) -> Option<[Vec<DVec3>; 2]> {
    let ends = [p, q];
    let [one, other] = ends.map(through_middle);
    let along = one.normal.dot(other.normal);
    let sine = 1.0 - along * along;
    if slack <= 0.0 || sine < PARALLEL {
        return None;
    }
    let planes = [one, other];
    let touches = |k: usize, corner: DVec3| planes[1 - k].height(corner).abs() <= slack;
    if !(0..2).any(|k| ends[k].iter().any(|&corner| touches(k, corner))) {
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
    Some([flat(0), flat(1)])
}

/// Returns the plane of a polygon that rounding may have bent, through the mean of its corners.
fn through_middle(corners: &[DVec3]) -> Plane {
    let plane = Plane::of(corners);
    let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
    Plane {
        level: plane.normal.dot(middle),
        ..plane
    }
}

/// Returns the corners of a blocker, those that are within `slack`, m, of the plane of a patch on whose front it stands moved behind that by as much: nothing shines through under it.
pub(super) fn standing_on<'a>(patches: [&[DVec3]; 2], blocker: &'a [DVec3], slack: f64) -> Cow<'a, [DVec3]> {
    let mut corners = Cow::Borrowed(blocker);
    if slack <= 0.0 {
        return corners;
    }
    for plane in patches.map(through_middle) {
        let stands = blocker
            .iter()
            .any(|&corner| plane.height(corner) > LEAST_SLACKS * slack);
        let touches = |corner: &DVec3| plane.height(*corner).abs() <= slack;
        if stands && blocker.iter().any(touches) {
            for corner in corners.to_mut().iter_mut().filter(|corner| touches(corner)) {
                *corner -= (plane.height(*corner) + slack) * plane.normal;
            }
        }
    }
    corners
}
