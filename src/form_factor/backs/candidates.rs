//! Which backs may be seen from which patches.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::form_factor::Input;
use crate::form_factor::closure::places_of_patches;
use crate::geometry::box_pairs::BoxTree;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::scene::topology::{Backs, Pieces, Place, View, joint, places};
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
        let of_patches = places_of_patches(input, &pieces);
        let outlines: Vec<Outline> = scene.face_ids().map(|face| Outline::new(scene.polygon(face))).collect();
        let parts: Vec<_> = scene
            .face_ids()
            .map(|face| (face, outlines[face.0 as usize].corners.clone()))
            .collect();
        let of_faces = places(scene, &pieces, &parts);
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
            hides_own: rims_on_hull(scene, &pieces),
            boxes: Boxes::new(outlines.iter().map(|outline| bounding_box(&outline.corners)).collect()),
            tolerance: joint(scene),
            pieces,
            outlines: &outlines,
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
                let backs = seen.into_iter().flat_map(|back| sheets.uncovered(back)).collect();
                Self { patches, backs }
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

fn bounding_box(corners: &[DVec3]) -> (DVec3, DVec3) {
    let one = (corners[0], corners[0]);
    corners.iter().fold(one, |(low, high), &v| (low.min(v), high.max(v)))
}

/// What backs are searched among.
struct Search<'a> {
    pieces: Pieces,
    outlines: &'a [Outline],
    of_faces: &'a [Place],
    boxes: Boxes,
    /// The pieces that end at the outside of the scene alone, so that no way around their border leads from their fronts to their backs.
    hides_own: Vec<bool>,
    tolerance: f64,
}

impl Search<'_> {
    /// Returns the faces whose backs may be seen from parts of a face with such views.
    fn backs_seen(&self, front: FaceId, views: &[&View]) -> Vec<usize> {
        let here = &self.outlines[front.0 as usize];
        let is_hidden = |back: usize| {
            let place = &self.of_faces[back];
            let number = u32::try_from(back).unwrap_or(u32::MAX);
            let piece = self.pieces.of_face(FaceId(number));
            let is_own = piece == self.pieces.of_face(front) && self.hides_own[piece as usize];
            let is_clean = |view: &View| !view.is_reached_by(piece);
            views
                .iter()
                .all(|view| !view.may_meet(&place.back) || is_own && is_clean(view) && is_clean(&place.back))
        };
        let faces = |back: usize| {
            let there = &self.outlines[back];
            there.corners.iter().any(|&v| here.height(v) > self.tolerance)
                && here.corners.iter().any(|&v| there.height(v) < -self.tolerance)
        };
        let may_be_above = |(low, high): (DVec3, DVec3)| {
            let reach = here.normal.abs().dot(high - low) * 0.5;
            here.height(low.midpoint(high)) + reach > self.tolerance
        };
        let mut seen = self.boxes.all(may_be_above, |back| {
            back != front.0 as usize && faces(back) && !is_hidden(back)
        });
        seen.sort_unstable();
        seen
    }
}

/// Tells of each piece whether it ends at the outside of the scene alone: every edge of its border lies in a plane that has all of the scene on one side. Closed pieces end nowhere.
///
/// The border then closes on the convex hull of the scene, which no way between two of its points crosses: the piece has a winding number, like a closed one.
/// Pieces with a border too long to look at count as ending elsewhere.
fn rims_on_hull(scene: &Scene, pieces: &Pieces) -> Vec<bool> {
    const MAX_WORK: usize = 200_000_000;
    let mut is_outside = vec![true; pieces.len()];
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
            is_outside[*piece as usize] = false;
        }
        return is_outside;
    }
    let tolerance = joint(scene);
    let on_hull: Vec<bool> = rims
        .par_iter()
        .map(|(_, ends)| is_on_hull(ends.map(|v| scene.vertices[v as usize]), &used, tolerance))
        .collect();
    for ((piece, _), on_hull) in rims.iter().zip(on_hull) {
        is_outside[*piece as usize] &= on_hull;
    }
    is_outside
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
        let perimeter: f64 = (0..corners.len())
            .map(|k| corners[k].distance(corners[(k + 1) % corners.len()]))
            .sum();
        polygon::area_vector(corners).length() > self.tolerance * perimeter
    }
}

/// Items of a box, and boxes of the next one.
const PER_BOX: usize = 16;

/// Boxes around consecutive items, around consecutive boxes of these, and so on: those that belong together mostly follow one another in a file.
struct Boxes(Vec<Vec<(DVec3, DVec3)>>);

impl Boxes {
    /// Takes the boxes of the items.
    fn new(of_items: Vec<(DVec3, DVec3)>) -> Self {
        let mut levels = vec![of_items];
        while let Some(last) = levels.last()
            && last.len() > 1
        {
            let around = |boxes: &[(DVec3, DVec3)]| {
                let joined = boxes.iter().copied();
                joined.fold(boxes[0], |(low, high), (l, h)| (low.min(l), high.max(h)))
            };
            levels.push(last.chunks(PER_BOX).map(around).collect());
        }
        Self(levels)
    }

    /// Returns the items that are meant, of those in boxes that may hold one.
    fn all(&self, may: impl Fn((DVec3, DVec3)) -> bool, is: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut found = Vec::new();
        let top = self.0.len() - 1;
        let mut open: Vec<(usize, usize)> = (0..self.0[top].len()).map(|k| (top, k)).collect();
        while let Some((level, k)) = open.pop() {
            if !may(self.0[level][k]) {
                continue;
            }
            if level == 0 {
                if is(k) {
                    found.push(k);
                }
            } else {
                let first = k * PER_BOX;
                open.extend((first..self.0[level - 1].len().min(first + PER_BOX)).map(|next| (level - 1, next)));
            }
        }
        found
    }
}
