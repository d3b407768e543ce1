//! Finds on which side of the closed pieces of a scene its faces lie, and whose backs are visible from there.

use std::collections::{BTreeMap, HashSet};

use glam::{DMat3, DVec3};

use super::{Pieces, bounding_box, joint, smallest_face};
use crate::geometry::box_pairs::overlapping_pairs;
use crate::geometry::clip::clip_contour;
use crate::geometry::polygon;
use crate::scene::{FaceId, Scene};

/// A part of space: the closed pieces around it with their winding numbers, −1 for one that faces inwards; empty in the open.
type Region = Vec<(u32, i32)>;

/// The regions in front of a face and behind it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Sides {
    pub(super) front: Region,
    pub(super) back: Region,
    /// The pieces of other faces that touch the point, so that its side of them is unknown; ascending.
    pub(super) touching: Vec<u32>,
}

/// A face, `None` for a cap, and its piece.
type Owner = (Option<FaceId>, u32);

/// The corners of a face, and its unit normal.
type Outline = (Vec<DVec3>, DVec3);

/// The direction of the rays that find winding numbers: oblique to all usual axes and diagonals.
const ASKEW: DVec3 = DVec3::new(0.417_022, 0.300_114, 0.857_913);

/// Finds the regions on both sides of faces at points on them; the two regions of a face of an open piece are the same.
///
/// A ray from the point crosses a piece from back to front as often as from front to back, up to its winding number around the point. Edges are shared to the
/// last bit ([`Pieces::outline`]), so that a ray through one crosses exactly one of its faces.
/// Work: O(n log n) and the number of crossings.
pub(super) fn sides(scene: &Scene, pieces: &Pieces, points: &[(FaceId, DVec3)]) -> Vec<Sides> {
    let (low, high) = scene.bounding_box();
    let middle = low.midpoint(high);
    let along = ASKEW.normalize();
    let across = along.any_orthonormal_vector();
    let frame = DMat3::from_cols(across, along.cross(across), along).transpose();
    let slack = touching(scene);
    // A cap is no face: it stands for those of another piece that it may be off by as much.
    let slack_of_cap = slack + joint(scene);
    let of_faces = scene
        .face_ids()
        .filter_map(|face| Some((Some(face), pieces.closed(face)?, pieces.outline(scene, face))));
    let of_caps = pieces
        .caps()
        .iter()
        .map(|(piece, corners)| (None, *piece, corners.clone()));
    let (faces, outlines): (Vec<Owner>, Vec<Outline>) = of_faces
        .chain(of_caps)
        .map(|(face, piece, mut corners)| {
            for v in &mut corners {
                *v = frame * (*v - middle);
            }
            let normal = polygon::area_vector(&corners).normalize_or_zero();
            ((face, piece), (corners, normal))
        })
        .unzip();
    let at: Vec<DVec3> = points.iter().map(|&(_, point)| frame * (point - middle)).collect();
    // In a projection along the rays, which become points.
    let around = outlines.iter().map(|(corners, _)| bounding_box(corners));
    let boxes = around.chain(at.iter().map(|&v| (v, v)));
    let boxes = boxes
        .map(|(least, most)| (least.with_z(0.0), most.with_z(0.0)))
        .collect();
    let mut crossings: Vec<(Region, Vec<u32>)> = vec![(Region::new(), Vec::new()); points.len()];
    overlapping_pairs(boxes, |a, b| {
        let (face, point) = (a.min(b) as usize, a.max(b) as usize);
        if face >= faces.len() || point < faces.len() {
            return;
        }
        let point = point - faces.len();
        let (own, here) = (points[point].0, at[point]);
        let (found, touching) = &mut crossings[point];
        let (corners, normal) = &outlines[face];
        let turns = turns_around(corners, here);
        let (face, piece) = faces[face];
        if turns == 0 || face == Some(own) {
            return;
        }
        let height = normal.dot(corners[0] - here);
        let is_ahead = if height.abs() > if face.is_some() { slack } else { slack_of_cap } {
            height * normal.z > 0.0
        } else {
            let own_normal = frame * scene.area_vector(own);
            if Some(piece) != pieces.closed(own) || own_normal.dot(*normal) > 0.0 {
                touching.push(piece);
                return;
            }
            // The other face of a sheet lies behind the one with the point.
            own_normal.z < 0.0
        };
        if is_ahead {
            found.push((piece, turns));
        }
    });
    crossings
        .into_iter()
        .zip(points)
        .map(|((mut front, mut touching), &(own, _))| {
            touching.sort_unstable();
            touching.dedup();
            let mut back = front.clone();
            if let Some(piece) = pieces.closed(own) {
                // The ray leaves from the front of the face; if it goes to the back, it also crosses the face.
                let own_turn = i32::from(along.dot(scene.area_vector(own)) < 0.0);
                front.push((piece, -own_turn));
                back.push((piece, 1 - own_turn));
            }
            Sides {
                front: summed(front),
                back: summed(back),
                touching,
            }
        })
        .collect()
}

/// Returns the distance, in m, within which pieces count as touching: below the resolution of f32 in a scene of this size, and below a thousandth of its smallest face.
pub(super) fn touching(scene: &Scene) -> f64 {
    let (low, high) = scene.box_where_faces_meet();
    (1e-7 * low.distance(high)).min(1e-3 * smallest_face(scene))
        + 8.0 * f64::EPSILON * low.abs().max(high.abs()).max_element()
}

/// Adds up the winding numbers of each piece.
fn summed(crossings: Region) -> Region {
    let mut sums: BTreeMap<u32, i32> = BTreeMap::new();
    for (piece, turns) in crossings {
        *sums.entry(piece).or_default() += turns;
    }
    sums.into_iter().filter(|(_, turns)| *turns != 0).collect()
}

/// Returns how often an outline turns around the line through a point along z, counter-clockwise.
///
/// An edge is evaluated from its lower end in either direction, so that the terms of two faces along it cancel to the last bit.
fn turns_around(corners: &[DVec3], point: DVec3) -> i32 {
    let mut from = corners[corners.len() - 1];
    let mut turns = 0;
    for &to in corners {
        let (a, b) = (from.truncate(), to.truncate());
        let rises = b.y > a.y;
        let (lower, upper) = if rises { (a, b) } else { (b, a) };
        let p = point.truncate();
        if lower.y <= p.y && p.y < upper.y && (upper - lower).perp_dot(p - lower) > 0.0 {
            turns += if rises { 1 } else { -1 };
        }
        from = to;
    }
    turns
}

/// The space on one side of a flat part of a face, as far as it is known.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct View {
    /// The region at the middle of the part.
    region: Region,
    /// The pieces that touch the middle of the part, or reach it from this side, so that their winding numbers may vary over it; ascending.
    unsure: Vec<u32>,
}

impl View {
    /// Returns whether the space is certainly inside a piece that faces inwards, so that no light leaves it for the open.
    pub(crate) fn is_enclosed(&self) -> bool {
        self.region
            .iter()
            .any(|(piece, turns)| *turns < 0 && !self.unsure.contains(piece))
    }

    /// Returns whether faces of a piece reach the part from this side.
    pub(crate) fn is_reached_by(&self, piece: u32) -> bool {
        self.unsure.contains(&piece)
    }

    /// Returns whether the winding numbers of all pieces may be the same somewhere in two views.
    ///
    /// If not, a face of some piece occludes any two points of the views from each other.
    pub(crate) fn may_meet(&self, other: &Self) -> bool {
        let (here, there) = (&self.region, &other.region);
        let turns = |region: &Region, piece: u32| {
            region
                .iter()
                .find(|around| around.0 == piece)
                .map_or(0, |around| around.1)
        };
        let mut pieces = here.iter().chain(there).map(|around| around.0);
        pieces.all(|piece| {
            let is_same = turns(here, piece) == turns(there, piece);
            is_same || self.unsure.contains(&piece) || other.unsure.contains(&piece)
        })
    }
}

/// The regions around a flat part of a face.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// The region in front of it.
    pub(crate) front: View,
    /// The region behind it.
    pub(crate) back: View,
}

/// Finds the regions around flat convex parts of faces.
///
/// Faces that reach a part from its front or its back, beyond its border, make the winding numbers of their pieces uncertain on that side. Faces in its own plane do not, as the faces that bound the
/// space there reach it too. Work: O(n log n), and the number of faces whose boxes overlap those of parts.
pub(crate) fn places(scene: &Scene, pieces: &Pieces, parts: &[(FaceId, Vec<DVec3>)]) -> Vec<Place> {
    let middles: Vec<(FaceId, DVec3)> = parts
        .iter()
        .map(|(face, part)| (*face, polygon::centroid(part)))
        .collect();
    let mut places: Vec<Place> = sides(scene, pieces, &middles)
        .into_iter()
        .map(|sides| Place {
            front: View {
                region: sides.front,
                unsure: sides.touching.clone(),
            },
            back: View {
                region: sides.back,
                unsure: sides.touching,
            },
        })
        .collect();
    let tolerance = joint(scene);
    let outlines: Vec<Vec<DVec3>> = scene.face_ids().map(|face| scene.polygon(face)).collect();
    let boxes = outlines
        .iter()
        .chain(parts.iter().map(|(_, part)| part))
        .map(|corners| {
            let (low, high) = bounding_box(corners);
            (low - tolerance, high + tolerance)
        });
    let n = outlines.len();
    overlapping_pairs(boxes.collect(), |a, b| {
        let (face, part) = (a.min(b) as usize, a.max(b) as usize);
        if face >= n || part < n {
            return;
        }
        let piece = pieces.of_face(FaceId(super::index(face)));
        if pieces.is_sheet(piece) {
            // The winding number of a sheet is 0 outside its plane.
            return;
        }
        let place = &mut places[part - n];
        let reached = reached(&parts[part - n].1, &outlines[face], tolerance);
        for (is_reached, view) in reached.into_iter().zip([&mut place.front, &mut place.back]) {
            if is_reached && let Err(k) = view.unsure.binary_search(&piece) {
                view.unsure.insert(k, piece);
            }
        }
    });
    places
}

/// Returns whether a polygon reaches the interior of a flat convex part from its front, and from its back.
fn reached(part: &[DVec3], other: &[DVec3], tolerance: f64) -> [bool; 2] {
    let (origin, normal) = (part[0], polygon::area_vector(part).normalize_or_zero());
    let heights = other.iter().map(|&v| normal.dot(v - origin));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let is_beyond = [high > tolerance, low < -tolerance];
    if low > tolerance || high < -tolerance || is_beyond == [false; 2] {
        return [false; 2];
    }
    let clip = |corners: &[DVec3], height: &dyn Fn(DVec3) -> f64| {
        let mut left = Vec::with_capacity(corners.len() + 1);
        clip_contour(corners.len(), |k| corners[k], height, |v| left.push(v));
        left
    };
    let mut near = clip(other, &|v| tolerance - normal.dot(v - origin));
    near = clip(&near, &|v| tolerance + normal.dot(v - origin));
    for (k, &from) in part.iter().enumerate() {
        let inwards = normal.cross(part[(k + 1) % part.len()] - from).normalize_or_zero();
        near = clip(&near, &|v| inwards.dot(v - from) - 2.0 * tolerance);
    }
    is_beyond.map(|is_beyond| is_beyond && !near.is_empty())
}

/// The backs of all faces of a scene, grouped by their regions.
#[derive(Clone, Debug)]
pub(crate) struct Backs {
    /// Backs whose winding numbers are certain.
    sure: HashSet<View>,
    /// The others.
    unsure: Vec<View>,
}

impl Backs {
    /// Gathers the backs of faces.
    pub(crate) fn of(faces: &[Place]) -> Self {
        let is_sure = |view: &View| view.unsure.is_empty();
        let (sure, unsure): (HashSet<View>, HashSet<View>) =
            faces.iter().map(|place| place.back.clone()).partition(is_sure);
        Self {
            sure,
            unsure: unsure.into_iter().collect(),
        }
    }

    /// Returns whether faces occlude all backs from a view.
    pub(crate) fn are_hidden_from(&self, view: &View) -> bool {
        let may_be_sure = if view.unsure.is_empty() {
            self.sure.contains(view)
        } else {
            self.sure.iter().any(|back| back.may_meet(view))
        };
        !may_be_sure && !self.unsure.iter().any(|back| back.may_meet(view))
    }
}
