//! The emitters as seen from the points of a flat region.

use glam::DVec3;

use super::clear_view::Plate;
use crate::form_factor::partial::VisibleFactor;
use crate::geometry::point_form_factor::point_form_factor;
use crate::geometry::polygon;
use crate::visibility::occluders::{Occluder, standing_on};

/// A flat convex region that sees emitters.
pub(super) struct Region<'a> {
    pub(super) corners: Vec<DVec3>,
    pub(super) normal: DVec3,
    /// The faces that cover it.
    pub(super) faces: &'a [Plate],
    /// Per emitter, the occluders between it and any point of the region.
    pub(super) between: Vec<Between<'a>>,
    /// The greatest distance of faces that were meant to touch, in m.
    pub(super) touching: f64,
}

/// The occluders between a region and an emitter.
pub(super) struct Between<'a> {
    /// The occluders without the rounding of corners.
    pub(super) meant: Vec<&'a Plate>,
    /// The occluders with the corners as they are.
    pub(super) literal: Vec<&'a Plate>,
    /// True if region and emitter are one face, or the two sides of a sheet that rounding has parted: they do not see each other.
    pub(super) is_sheet: bool,
}

/// The parts of emitters visible from one region's points, computed on first use.
#[derive(Default)]
pub(super) struct SeenFrom {
    meant: Vec<Option<VisibleFactor>>,
    literal: Vec<Option<VisibleFactor>>,
}

impl SeenFrom {
    /// Returns emitter `k` behind its occluders without rounding; those that stand on the region or the emitter up to rounding leave no slit.
    pub(super) fn meant(&mut self, k: usize, region: &Region<'_>, emitter: &Plate) -> &mut VisibleFactor {
        let ends = [region.corners.as_slice(), &emitter.corners];
        let standing = |plate: &&Plate| standing_on(ends, &plate.corners, region.touching).into_owned();
        let occluders = || {
            let corners = region.between[k].meant.iter().map(standing);
            corners.map(|corners| occluder(corners.into())).collect()
        };
        kept(&mut self.meant, k, region, emitter, occluders)
    }

    /// Returns emitter `k` behind its occluders with the corners as they are.
    pub(super) fn literal(&mut self, k: usize, region: &Region<'_>, emitter: &Plate) -> &mut VisibleFactor {
        kept(&mut self.literal, k, region, emitter, || {
            let triangles = region.between[k].literal.iter().flat_map(|plate| flat_parts(plate));
            triangles.map(|corners| occluder(corners.into())).collect()
        })
    }
}

fn kept<'v, 'b>(
    known: &'v mut Vec<Option<VisibleFactor>>,
    k: usize,
    region: &Region<'_>,
    emitter: &Plate,
    occluders: impl FnOnce() -> Vec<Occluder<'b>>,
) -> &'v mut VisibleFactor {
    if known.len() <= k {
        known.resize_with(k + 1, || None);
    }
    known[k].get_or_insert_with(|| VisibleFactor::new(&region.corners, region.normal, &emitter.corners, &occluders()))
}

impl Region<'_> {
    /// Returns the face that contains a point of the region.
    pub(super) fn face_of(&self, point: DVec3) -> &Plate {
        let holds = |face: &&Plate| contains(&face.corners, point, self.normal);
        self.faces.iter().find(holds).unwrap_or(&self.faces[0])
    }

    /// Returns the greatest change of a point's form factor by the bend that rounding has given its face or the emitter.
    ///
    /// The normal of each part of the face lies between those of its corners, and no part is farther from its plane than its corners are.
    pub(super) fn bend(&self, point: DVec3, face: &Plate, emitter: &Plate) -> f64 {
        let seen = |at: DVec3, normal: DVec3| point_form_factor(at, normal, &emitter.corners);
        let over_horizon = |&v: &DVec3| face.normal.dot(v - point) > self.touching;
        if !emitter.corners.iter().any(over_horizon) {
            // A part that rounding lifts above the horizon may be seen from the back as well: rounding decides its side.
            let below = point - face.normal * self.touching;
            let back: Vec<DVec3> = emitter.corners.iter().rev().copied().collect();
            return seen(below, face.normal) + point_form_factor(below, face.normal, &back);
        }
        let plane = seen(point, face.normal);
        let n = face.corners.len();
        let at_corner = |k: usize| {
            let corners = [k + n - 1, k, k + 1].map(|m| face.corners[m % n]);
            polygon::area_vector(&corners).normalize_or(face.normal)
        };
        let turned = (0..n).map(at_corner).chain([self.normal]);
        let turn = turned.map(|normal| (seen(point, normal) - plane).abs());
        let height = (face.corners.iter())
            .map(|&v| self.normal.dot(v - self.corners[0]).abs())
            .fold(0.0, f64::max);
        let shifts = [
            face.normal * height,
            emitter.normal * polygon::planarity_error(&emitter.corners),
        ];
        let change = |place: DVec3| (seen(place, face.normal) - plane).abs();
        let shift = shifts.map(|shift| change(point + shift).max(change(point - shift)));
        // The contributions may add up.
        turn.fold(0.0, f64::max) + shift.iter().sum::<f64>()
    }
}

impl Region<'_> {
    /// Returns the change of a point's form factor by slits and overlaps that exist only because corners were rounded.
    ///
    /// Where the view seems to change abruptly, points within the rounding show the size of the change.
    pub(super) fn slits(&self, point: DVec3, meant: f64, literal: &mut VisibleFactor) -> f64 {
        let (along, across) = self.normal.any_orthonormal_pair();
        let places = [DVec3::ZERO, along, across, -along - across];
        let change = places.map(|shift| (literal.at(point + shift * self.touching) - meant).abs());
        change.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// Returns a face, or two triangles where it is bent: seen along its edge, the occlusion by a bent outline is undefined.
fn flat_parts(plate: &Plate) -> Vec<Vec<DVec3>> {
    match *plate.corners.as_slice() {
        [a, b, c, d] if polygon::planarity_error(&plate.corners) > 0.0 => vec![vec![a, b, c], vec![a, c, d]],
        _ => vec![plate.corners.clone()],
    }
}

/// Returns plates as occluders.
pub(super) fn as_occluders<'a>(plates: &[&'a Plate]) -> Vec<Occluder<'a>> {
    let of_plate = |plate: &&'a Plate| occluder(plate.corners.as_slice().into());
    plates.iter().map(of_plate).collect()
}

fn occluder(corners: std::borrow::Cow<'_, [DVec3]>) -> Occluder<'_> {
    Occluder {
        corners,
        one_sided: false,
        body: None,
    }
}

/// Returns true if a point of the plane is in a convex polygon or on its border.
pub(super) fn contains(corners: &[DVec3], point: DVec3, normal: DVec3) -> bool {
    (0..corners.len()).all(|k| {
        let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
        normal.dot((b - a).cross(point - a)) >= 0.0
    })
}
