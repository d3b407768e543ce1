//! Closed convex solids among the faces of a scene: a point outside need test the near sides only.

use std::collections::HashMap;

use glam::DVec3;

use super::super::plane::{Lean, Plane, rounding};
use super::super::shaft::Shaft;
use crate::scene::topology::Pieces;
use crate::scene::{FaceId, Scene};

/// The fewest polygons of a solid, those of a tetrahedron.
const MIN_POLYGONS: usize = 4;

/// The most polygons of a solid that is tested for convexity, which takes polygons × corners; shadows of larger ones only cost more.
const MAX_POLYGONS: usize = 2000;

/// An edge of a solid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ridge {
    /// The ends, in the order in which they run counter-clockwise around the first side.
    pub(crate) ends: [DVec3; 2],
    /// The indices of the sides that it lies between.
    pub(crate) sides: [usize; 2],
}

/// A closed convex solid whose faces look outwards; a side on which it stands on other faces may be missing.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    planes: Vec<Plane>,
    /// The corners, each once.
    corners: Vec<DVec3>,
    /// The edges; empty unless each is an edge of two sides.
    ridges: Vec<Ridge>,
    /// The leans of the sides, in the order of their planes.
    leans: Vec<Lean>,
    /// A point inside.
    middle: DVec3,
    /// 16 ulps of the largest coordinate.
    rounding: f64,
}

impl Solid {
    /// Returns whether the inside of a polygon lies strictly outside of the solid.
    ///
    /// It does if it is in front of one of the solid's planes, or if its own plane holds no side of the solid and has all of it on one side.
    ///
    /// A polygon in the plane of a side may lie behind that side, which then hides nothing from it: it counts as outside only by another plane.
    /// A point within `slack`, m, and rounding of a plane counts as in it.
    pub(super) fn excludes(&self, corners: &[DVec3], slack: f64) -> bool {
        let tolerance = slack + rounding(corners).max(self.rounding);
        self.is_before_a_side(corners, tolerance, tolerance) || self.is_on_one_side(corners, tolerance)
    }

    /// Returns whether [`excludes`](Self::excludes) holds and no strip of the polygon, however narrow, lies inside.
    pub(super) fn excludes_all_of(&self, corners: &[DVec3], slack: f64) -> bool {
        let rounding = rounding(corners).max(self.rounding);
        self.is_before_a_side(corners, slack + rounding, rounding) || self.is_on_one_side(corners, slack + rounding)
    }

    fn is_on_one_side(&self, polygon: &[DVec3], tolerance: f64) -> bool {
        let (plane, lean) = (Plane::of(polygon), Lean::of(polygon));
        let (mut n_before, mut n_behind, mut n_within) = (0, 0, 0);
        for &v in &self.corners {
            let (height, rounded) = (plane.height(v), lean.height(tolerance, v));
            if height > rounded {
                n_before += 1;
            } else if height < -rounded {
                n_behind += 1;
            } else {
                n_within += 1;
            }
        }
        // A corner or an edge that stands on the polygon covers nothing of it.
        n_within <= 2 && (n_before == 0 || n_behind == 0)
    }

    /// Returns whether a polygon is in front of a side, and no more than `depth`, m, behind its plane anywhere.
    fn is_before_a_side(&self, corners: &[DVec3], tolerance: f64, depth: f64) -> bool {
        self.planes.iter().zip(&self.leans).any(|(plane, lean)| {
            let heights = || corners.iter().map(|&v| (plane.height(v), lean.height(tolerance, v)));
            heights().all(|(h, _)| h >= -depth) && heights().any(|(h, rounded)| h > rounded)
        })
    }
}

impl Solid {
    pub(crate) fn planes(&self) -> &[Plane] {
        &self.planes
    }

    pub(crate) fn corners(&self) -> &[DVec3] {
        &self.corners
    }

    pub(crate) fn ridges(&self) -> &[Ridge] {
        &self.ridges
    }

    /// Returns a point inside.
    pub(crate) fn middle(&self) -> DVec3 {
        self.middle
    }

    /// Returns whether a point lies inside, deeper than `off`, m, and rounding.
    pub(super) fn holds(&self, point: DVec3, off: f64) -> bool {
        let off = off + self.rounding;
        self.planes.iter().all(|plane| plane.height(point) < -off)
    }

    /// Returns whether the solid alone stops all light between two polygons. Errs on the side of false.
    pub(super) fn closes(&self, shaft: &Shaft<'_>, p: &[DVec3], q: &[DVec3], slack: f64) -> bool {
        // Between two inner points of the solid nothing is in the way.
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
    let piece_of_face: Vec<Option<u32>> = scene.face_ids().map(|face| connected.closed(face)).collect();
    let mut caps_of_piece: HashMap<u32, Vec<&[DVec3]>> = HashMap::new();
    for (piece, corners) in connected.caps() {
        caps_of_piece.entry(*piece).or_default().push(corners);
    }
    let mut polygons_of_piece: HashMap<u32, Vec<usize>> = HashMap::new();
    for (k, (_, faces)) in polygons.iter().enumerate() {
        // A polygon made of two coincident faces is no side of a solid: light may come from either.
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
        let caps = caps_of_piece.get(&piece).map_or(&[][..], Vec::as_slice);
        let outlines: Vec<&[DVec3]> = sides
            .iter()
            .map(|&k| polygons[k].0.as_slice())
            .chain(caps.iter().copied())
            .collect();
        // A sheet of one polygon is closed too, as each of its edges is used once in each direction, but it has no inside.
        if outlines.len() < MIN_POLYGONS || outlines.len() > MAX_POLYGONS || covered != n_faces[&piece] {
            continue;
        }
        let planes: Vec<Plane> = outlines.iter().map(|corners| Plane::of(corners)).collect();
        let corners = || outlines.iter().copied().flatten().copied();
        let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = corners().fold(all, |(l, h), v| (l.min(v), h.max(v)));
        let rounding = rounding(&[low, high]);
        let slack = slack + 1e-12 * (high - low).length() + rounding;
        if planes.iter().all(|plane| corners().all(|v| plane.height(v) <= slack)) {
            let index = u32::try_from(solids.len()).ok();
            let of_solid = Corners::of(&outlines, slack);
            for &k in &sides {
                solid_of_polygon[k] = index;
            }
            solids.push(Solid {
                planes,
                ridges: ridges(&outlines, &of_solid.first_of).unwrap_or_default(),
                corners: of_solid.firsts.into_iter().map(|(corner, _)| corner).collect(),
                leans: outlines.iter().copied().map(Lean::of).collect(),
                middle: low.midpoint(high),
                rounding,
            });
        }
    }
    (solids, solid_of_polygon)
}

/// The corners of a closed surface: those within `off`, m, of each other are one.
struct Corners {
    /// The first corner of each group.
    firsts: Vec<(DVec3, usize)>,
    /// For all corners, side by side, the index of their group's first corner.
    first_of: Vec<usize>,
}

impl Corners {
    fn of(sides: &[&[DVec3]], off: f64) -> Self {
        let mut corners: Vec<(DVec3, usize)> = sides.iter().copied().flatten().copied().zip(0..).collect();
        corners.sort_unstable_by(|a, b| a.0.x.total_cmp(&b.0.x).then(a.1.cmp(&b.1)));
        let (mut firsts, mut first_of) = (Vec::<(DVec3, usize)>::new(), vec![0; corners.len()]);
        for (corner, k) in corners {
            let mut near = firsts.iter().rev().take_while(|first| corner.x - first.0.x <= off);
            first_of[k] = if let Some(first) = near.find(|first| first.0.distance(corner) <= off) {
                first.1
            } else {
                firsts.push((corner, k));
                k
            };
        }
        Self { firsts, first_of }
    }
}

/// Returns the edges of a closed surface; `None` if an edge does not belong to two sides, as at a corner in the middle of another side's edge.
fn ridges(sides: &[&[DVec3]], first_of: &[usize]) -> Option<Vec<Ridge>> {
    let (mut ridges, mut open, mut begin) = (Vec::new(), HashMap::new(), 0);
    for (side, corners) in sides.iter().enumerate() {
        for (k, &from) in corners.iter().enumerate() {
            let next = (k + 1) % corners.len();
            let [a, b] = [k, next].map(|k| first_of[begin + k]);
            if a == b {
                continue;
            }
            if let Some(other) = open.remove(&[b, a]) {
                ridges.push(Ridge {
                    ends: [corners[next], from],
                    sides: [other, side],
                });
            } else if open.insert([a, b], side).is_some() {
                return None;
            }
        }
        begin += corners.len();
    }
    open.is_empty().then_some(ridges)
}
