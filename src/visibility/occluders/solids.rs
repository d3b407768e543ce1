//! Closed convex solids among the faces of a scene: of these, a point outside need look at the near side only.

use std::collections::HashMap;

use glam::DVec3;

use super::super::plane::{Lean, Plane, rounding};
use super::super::shaft::Shaft;
use crate::scene::topology::Pieces;
use crate::scene::{FaceId, Scene};

/// No solid has fewer polygons than a tetrahedron.
const MIN_POLYGONS: usize = 4;

/// A solid with more polygons is not looked at for convexity, which takes polygons × corners: its shadows then only cost more.
const MAX_POLYGONS: usize = 2000;

/// A closed convex solid whose faces look outwards.
#[derive(Clone, Debug)]
pub(super) struct Solid {
    planes: Vec<Plane>,
    /// Of the sides, in the order of their planes.
    leans: Vec<Lean>,
    /// A point inside.
    middle: DVec3,
    /// 16 ulps of the largest coordinate.
    rounding: f64,
}

impl Solid {
    /// Tells whether the inside of a polygon lies strictly outside of the solid: whether it is in front of one of the solid's planes, and not in it.
    ///
    /// A polygon in the plane of a side may lie behind that side, which then hides nothing from it: it counts as outside only if another plane tells.
    /// What lies within `slack`, m, and rounding of a plane counts as in it.
    pub(super) fn excludes(&self, corners: &[DVec3], slack: f64) -> bool {
        let tolerance = slack + rounding(corners).max(self.rounding);
        self.planes.iter().zip(&self.leans).any(|(plane, lean)| {
            let heights = || corners.iter().map(|&v| (plane.height(v), lean.height(tolerance, v)));
            heights().all(|(h, _)| h >= -tolerance) && heights().any(|(h, rounded)| h > rounded)
        })
    }
}

impl Solid {
    /// Returns a point inside.
    pub(super) fn middle(&self) -> DVec3 {
        self.middle
    }

    /// Tells whether a point lies inside, deeper than `off`, m, and rounding.
    pub(super) fn holds(&self, point: DVec3, off: f64) -> bool {
        let off = off + self.rounding;
        self.planes.iter().all(|plane| plane.height(point) < -off)
    }

    /// Tells whether the solid alone stops all light between two polygons. Errs on the side of false.
    pub(super) fn closes(&self, shaft: &Shaft<'_>, p: &[DVec3], q: &[DVec3], slack: f64) -> bool {
        // From inside of the solid to its inside nothing is in the way.
        shaft.is_closed_by_solid(self.middle, &self.planes, self.rounding)
            && (self.excludes(p, slack) || self.excludes(q, slack))
    }
}

/// Returns the closed convex solids, and for each polygon (a list of faces with its corners) the solid that it is a side of.
///
/// Corners may stand out from the planes of other sides by `slack`, m, as rounding moves them.
pub(super) fn find(
    scene: &Scene,
    connected: &Pieces,
    polygons: &[(Vec<DVec3>, Vec<FaceId>)],
    slack: f64,
) -> (Vec<Solid>, Vec<Option<u32>>) {
    let piece_of_face: Vec<Option<u32>> = scene.face_ids().map(|face| connected.closed_by_itself(face)).collect();
    let mut polygons_of_piece: HashMap<u32, Vec<usize>> = HashMap::new();
    for (k, (_, faces)) in polygons.iter().enumerate() {
        // A polygon that stands for two coincident faces is no side of a solid: light may come from either.
        let mut pieces = faces.iter().map(|face| piece_of_face[face.0 as usize]);
        if let Some(Some(first)) = pieces.next()
            && pieces.all(|piece| piece == Some(first))
        {
            polygons_of_piece.entry(first).or_default().push(k);
        }
    }
    let mut n_faces: HashMap<u32, usize> = HashMap::new();
    for piece in piece_of_face.iter().flatten() {
        *n_faces.entry(*piece).or_default() += 1;
    }
    let mut pieces: Vec<(u32, Vec<usize>)> = polygons_of_piece.into_iter().collect();
    pieces.sort_unstable();
    let (mut solids, mut solid_of_polygon) = (Vec::new(), vec![None; polygons.len()]);
    for (piece, sides) in pieces {
        let covered: usize = sides.iter().map(|&k| polygons[k].1.len()).sum();
        // A sheet of one polygon is closed too: each of its edges is run along once in each sense. It has no inside.
        if sides.len() < MIN_POLYGONS || sides.len() > MAX_POLYGONS || covered != n_faces[&piece] {
            continue;
        }
        let planes: Vec<Plane> = sides.iter().map(|&k| Plane::of(&polygons[k].0)).collect();
        let corners = || sides.iter().flat_map(|&k| polygons[k].0.iter().copied());
        let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = corners().fold(all, |(l, h), v| (l.min(v), h.max(v)));
        let rounding = rounding(&[low, high]);
        let slack = slack + 1e-12 * (high - low).length() + rounding;
        if planes.iter().all(|plane| corners().all(|v| plane.height(v) <= slack)) {
            let index = u32::try_from(solids.len()).ok();
            for &k in &sides {
                solid_of_polygon[k] = index;
            }
            solids.push(Solid {
                planes,
                leans: sides.iter().map(|&k| Lean::of(&polygons[k].0)).collect(),
                middle: low.midpoint(high),
                rounding,
            });
        }
    }
    (solids, solid_of_polygon)
}
