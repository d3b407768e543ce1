//! Which backs may be seen from which patches.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::form_factor::Input;
use crate::form_factor::closure::places_of_patches;
use crate::geometry::box_pairs::BoxTree;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::scene::topology::{Backs, Pieces, Place, View, bounding_box, joint, places};
use crate::scene::{FaceId, Scene};

/// Patches of one face, and the backs that they may see.
pub(super) struct Candidates {
    pub(super) patches: Vec<usize>,
    /// Parts of faces that no other face of a sheet covers from behind, wound as they are seen.
    pub(super) backs: Vec<Vec<DVec3>>,
}

impl Candidates {
    /// Finds the backs that may be seen from patches: those of faces that patches lie behind, and that are not hidden by the windings of closed pieces, nor by a piece that both are part of.
    pub(super) fn of(input: Input<'_>, wanted: &[bool]) -> Vec<Self> {
        let scene = input.scene;
        let pieces = Pieces::of(scene);
        let outlines: Vec<Outline> = scene.face_ids().map(|face| Outline::new(scene.polygon(face))).collect();
        let parts: Vec<_> = scene
            .face_ids()
            .map(|face| (face, outlines[face.0 as usize].corners.clone()))
            .collect();
        let of_faces = places(scene, &pieces, &parts);
        let hides_own = hiding_own(scene, &pieces, &of_faces);
        if hides_own == [true] {
            // A terrain, mostly: there are no backs but its own.
            return Vec::new();
        }
        let of_patches = places_of_patches(input, &pieces);
        let backs = Backs::of(&of_faces);
        let mut views: Vec<(FaceId, Vec<usize>)> = Vec::new();
        for i in (0..of_patches.len()).filter(|&i| wanted[i] && !backs.are_hidden_from(&of_patches[i].front)) {
            let face = input.mesh.patches[i].face;
            match views.last_mut() {
                Some((last, patches)) if *last == face => patches.push(i),
                _ => views.push((face, vec![i])),
            }
        }
        if views.is_empty() {
            return Vec::new();
        }
        let sheets = Sheets::new(scene, &outlines);
        let search = Search {
            hides_own,
            sheets: &sheets,
            pieces,
            of_faces: &of_faces,
        };
        views
            .into_par_iter()
            .map(|(face, patches)| {
                let mut fronts: Vec<&View> = Vec::new();
                for &i in &patches {
                    let front = &of_patches[i].front;
                    if !fronts.contains(&front) {
                        fronts.push(front);
                    }
                }
                let seen = search.backs_seen(face, &fronts);
                Self {
                    patches,
                    backs: seen.into_iter().flat_map(|back| sheets.uncovered(back)).collect(),
                }
            })
            .collect()
    }
}

/// A face with its plane.
pub(in crate::form_factor) struct Outline {
    corners: Vec<DVec3>,
    normal: DVec3,
}

impl Outline {
    pub(in crate::form_factor) fn new(corners: Vec<DVec3>) -> Self {
        Self {
            normal: polygon::area_vector(&corners).normalize_or_zero(),
            corners,
        }
    }

    /// Returns how far a point is in front of the plane.
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }
}

/// What backs are searched among.
struct Search<'a> {
    pieces: Pieces,
    sheets: &'a Sheets<'a>,
    of_faces: &'a [Place],
    /// The pieces whose fronts see none of their own backs.
    hides_own: Vec<bool>,
}

impl Search<'_> {
    /// Returns the faces whose backs may be seen from parts of a face with such views.
    fn backs_seen(&self, front: FaceId, views: &[&View]) -> Vec<usize> {
        let Sheets {
            outlines,
            ref tree,
            tolerance,
        } = *self.sheets;
        let here = &outlines[front.0 as usize];
        let own = self.pieces.of_face(front);
        let is_hidden_by_own = |back: u32| self.hides_own[own as usize] && self.pieces.of_face(FaceId(back)) == own;
        let may_be_met = |back: u32| {
            let place = &self.of_faces[back as usize];
            views.iter().any(|view| view.may_meet(&place.back))
        };
        let faces = |back: u32| {
            let there = &outlines[back as usize];
            there.corners.iter().any(|&v| here.height(v) > tolerance)
                && here.corners.iter().any(|&v| there.height(v) < -tolerance)
        };
        let may_be_above = |(low, high): (DVec3, DVec3)| {
            let reach = here.normal.abs().dot(high - low) * 0.5;
            here.height(low.midpoint(high)) + reach > tolerance
        };
        let mut seen = Vec::new();
        tree.meeting(&may_be_above, &mut |back| {
            if back != front.0 && !is_hidden_by_own(back) && faces(back) && may_be_met(back) {
                seen.push(back as usize);
            }
        });
        seen.sort_unstable();
        seen
    }
}

/// Tells of each piece whether its fronts see none of its own backs: no face of it pierces another, and every edge of its border lies in a plane that has all of the scene on one side. Closed pieces have no border.
///
/// Such a piece parts the convex hull of the scene in two, one in front of it and one behind, as its border lies on that hull, which no segment between two points of the scene leaves.
/// Pieces with a border too long to look at count as ending elsewhere.
fn hiding_own(scene: &Scene, pieces: &Pieces, of_faces: &[Place]) -> Vec<bool> {
    const MAX_WORK: usize = 200_000_000;
    let mut hides_own = vec![true; pieces.len()];
    for (face, place) in scene.face_ids().zip(of_faces) {
        let piece = pieces.of_face(face);
        let is_pierced = [&place.front, &place.back]
            .map(|view| view.is_reached_by(piece))
            .contains(&true);
        hides_own[piece as usize] &= !is_pierced;
    }
    let used: Vec<DVec3> = {
        let mut used: Vec<u32> = scene
            .faces
            .iter()
            .flat_map(|face| face.corners.as_slice().to_vec())
            .collect();
        used.sort_unstable();
        used.dedup();
        used.into_iter().map(|v| scene.vertices[v as usize]).collect()
    };
    let rims = pieces.rims();
    if rims.len().saturating_mul(used.len()) > MAX_WORK {
        for (piece, _) in rims {
            hides_own[*piece as usize] = false;
        }
        return hides_own;
    }
    let tolerance = joint(scene);
    let on_hull: Vec<bool> = rims
        .par_iter()
        .map(|(_, ends)| is_on_hull(ends.map(|v| scene.vertices[v as usize]), &used, tolerance))
        .collect();
    for ((piece, _), is_on_it) in rims.iter().zip(on_hull) {
        hides_own[*piece as usize] &= is_on_it;
    }
    hides_own
}

/// Tells whether a plane through an edge has all points on one side of it, or in it.
fn is_on_hull([from, to]: [DVec3; 2], points: &[DVec3], tolerance: f64) -> bool {
    let along = (to - from).normalize_or_zero();
    let across = along.any_orthonormal_vector();
    let up = along.cross(across);
    // Seen along the edge.
    let around = || {
        let seen = points
            .iter()
            .map(|&point| DVec2::new(across.dot(point - from), up.dot(point - from)));
        seen.filter(|r| r.length() > tolerance)
    };
    let middle: DVec2 = around().map(DVec2::normalize).sum();
    let Some(first) = around().next() else {
        return true;
    };
    if middle.length() < 1e-6 {
        let side = first.normalize().perp();
        return around().all(|r| side.dot(r) <= tolerance) || around().all(|r| side.dot(r) >= -tolerance);
    }
    let (mut least, mut most) = (0.0_f64, 0.0_f64);
    for r in around() {
        let (angle, off) = (middle.angle_to(r), tolerance / r.length());
        least = least.min((angle + off).min(0.0));
        most = most.max((angle - off).max(0.0));
    }
    most - least <= PI + 1e-12
}

/// Faces that cover each other's backs: the two sides of a sheet.
pub(in crate::form_factor) struct Sheets<'a> {
    outlines: &'a [Outline],
    tree: BoxTree,
    tolerance: f64,
}

impl<'a> Sheets<'a> {
    pub(in crate::form_factor) fn new(scene: &Scene, outlines: &'a [Outline]) -> Self {
        let tolerance = joint(scene);
        let boxes = outlines.iter().map(|outline| {
            let (low, high) = bounding_box(&outline.corners);
            (low - tolerance, high + tolerance)
        });
        Self {
            tree: BoxTree::new(boxes.collect()),
            outlines,
            tolerance,
        }
    }

    /// Returns the parts of the back of a face that no face of opposite winding covers, wound as they are seen.
    pub(in crate::form_factor) fn uncovered(&self, back: usize) -> Vec<Vec<DVec3>> {
        let own = &self.outlines[back];
        let mut reversed = own.corners.clone();
        reversed.reverse();
        let mut parts = vec![reversed];
        self.tree.overlapping(bounding_box(&own.corners), &mut |other| {
            let cover = &self.outlines[other as usize];
            let is_opposite = cover.normal.dot(own.normal) < -0.5;
            if other as usize == back
                || !is_opposite
                || cover.corners.iter().any(|&v| own.height(v).abs() > self.tolerance)
            {
                return;
            }
            parts = parts.iter().flat_map(|part| self.without(part, cover)).collect();
        });
        parts
    }

    /// Returns a convex polygon without another one in its plane, as convex polygons.
    fn without(&self, part: &[DVec3], cover: &Outline) -> Vec<Vec<DVec3>> {
        let mut rest = part.to_vec();
        let mut left = Vec::new();
        for (k, &from) in cover.corners.iter().enumerate() {
            let inwards = cover.normal.cross(cover.corners[(k + 1) % cover.corners.len()] - from);
            let outside = clip_to_half_space(&rest, from, -inwards);
            if self.is_wide(&outside) {
                left.push(outside);
            }
            rest = clip_to_half_space(&rest, from, inwards);
            if !self.is_wide(&rest) {
                break;
            }
        }
        if self.is_wide(&rest) { left } else { vec![part.to_vec()] }
    }

    /// Tells whether a polygon is more than a strip that rounding explains.
    fn is_wide(&self, corners: &[DVec3]) -> bool {
        if corners.len() < 3 {
            return false;
        }
        polygon::area_vector(corners).length() > self.tolerance * polygon::perimeter(corners)
    }
}
