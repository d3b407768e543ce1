//! Which back faces may be seen from which patches.

use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::OnceLock;

use glam::{DVec2, DVec3};

use crate::form_factor::Input;
use crate::geometry::box_pairs::BoxTree;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::mesh::PatchId;
use crate::scene::topology::{Backs, Pieces, Place, View, bounding_box, joint, places};
use crate::scene::{FaceId, Scene};
use crate::threads;

/// The patches that may see back faces.
pub(super) struct Candidates {
    /// By the faces of the patches.
    pub(super) views: Vec<Seeing>,
    /// The parts of each examined back face that no other face of a sheet covers from behind, wound as they are seen.
    parts: Vec<OnceLock<Vec<Vec<DVec3>>>>,
}

/// Patches of one face that may see backs.
pub(super) struct Seeing {
    pub(super) patches: Vec<usize>,
    /// The faces whose backs they may see, ascending; `None` if these have too many parts to be listed.
    pub(super) backs: Option<Vec<usize>>,
}

impl Candidates {
    /// Finds the patches that may see back faces, and these faces.
    ///
    /// A patch may see the back of a face that it lies behind, unless closed pieces or a common piece hide it.
    /// `max_pairs` pairs of patches and parts of back faces are listed, the same number for each patch; none where it is 0.
    /// Memory: O(n + `max_pairs`). Work: O(n log n) and the pairs listed, where the patches that see no back face lie around the others.
    pub(super) fn of(input: Input<'_>, wanted: &[bool], max_pairs: usize) -> Self {
        let scene = input.scene;
        let parts = scene.face_ids().map(|_| OnceLock::new()).collect();
        let mut found = Self {
            views: Vec::new(),
            parts,
        };
        let pieces = Pieces::of(scene);
        let outlines: Vec<Outline> = scene.face_ids().map(|face| Outline::new(scene.polygon(face))).collect();
        let faces: Vec<_> = scene
            .face_ids()
            .map(|face| (face, outlines[face.0 as usize].corners.clone()))
            .collect();
        let of_faces = places(scene, &pieces, &faces);
        let hides_own = hiding_own(scene, &pieces, &of_faces);
        if hides_own == [true] {
            // A terrain, mostly: its own are the only back faces.
            return found;
        }
        let of_patches = places_of_patches(input, &pieces);
        let backs = Backs::of(&of_faces);
        let is_open = |&i: &usize| wanted[i] && !backs.are_hidden_from(&of_patches[i].front);
        let open: Vec<usize> = (0..of_patches.len()).filter(is_open).collect();
        if open.is_empty() {
            return found;
        }
        let face_of = |i: usize| input.mesh.patches[i].face;
        let sheets = Sheets::new(scene, &outlines);
        let search = Search {
            hides_own,
            sheets: &sheets,
            pieces,
            of_faces: &of_faces,
            parts: &found.parts,
        };
        let of_one_face: Vec<&[usize]> = open.chunk_by(|&i, &j| face_of(i) == face_of(j)).collect();
        let listed = |patches: &[usize], max_parts: usize| {
            let mut fronts: Vec<&View> = Vec::new();
            for &i in patches {
                let front = &of_patches[i].front;
                if !fronts.contains(&front) {
                    fronts.push(front);
                }
            }
            search.backs_seen(face_of(patches[0]), &fronts, max_parts)
        };
        let seeing: Vec<&[usize]> = threads::collect_flat(of_one_face.len(), |k| {
            let patches = of_one_face[k];
            listed(patches, 0).is_none().then_some(patches)
        });
        let n_patches: usize = seeing.iter().map(|patches| patches.len()).sum();
        let max_parts = max_pairs / n_patches.max(1);
        let view = |patches: &&[usize]| Seeing {
            patches: patches.to_vec(),
            backs: if max_parts > 0 {
                listed(patches, max_parts)
            } else {
                None
            },
        };
        found.views = threads::collect_from(&seeing, view);
        found
    }

    /// Returns the parts of the back faces that patches may see, wound as they are seen; `None` if these are too many.
    pub(super) fn parts<'a>(&'a self, view: &'a Seeing) -> Option<impl Iterator<Item = &'a [DVec3]>> {
        let backs = view.backs.as_ref()?;
        let parts = backs.iter().filter_map(|&back| self.parts[back].get()).flatten();
        Some(parts.map(Vec::as_slice))
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

/// The faces among which back faces are searched.
struct Search<'a> {
    pieces: Pieces,
    sheets: &'a Sheets<'a>,
    of_faces: &'a [Place],
    /// The pieces whose fronts see none of their own backs.
    hides_own: Vec<bool>,
    /// See [`Candidates`].
    parts: &'a [OnceLock<Vec<Vec<DVec3>>>],
}

impl Search<'_> {
    /// Returns the faces whose backs may be seen from parts of a face with such views; `None` if these have more than `max_parts` parts.
    fn backs_seen(&self, front: FaceId, views: &[&View], max_parts: usize) -> Option<Vec<usize>> {
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
        let mut n_parts = 0;
        let is_all = tree.meeting(&may_be_above, &mut |back| {
            if back == front.0 || is_hidden_by_own(back) || !faces(back) || !may_be_met(back) {
                return ControlFlow::Continue(());
            }
            let back = back as usize;
            let n_own = self.parts[back].get_or_init(|| self.sheets.uncovered(back)).len();
            n_parts += n_own;
            if n_parts > max_parts {
                return ControlFlow::Break(());
            }
            if n_own > 0 {
                seen.push(back);
            }
            ControlFlow::Continue(())
        });
        seen.sort_unstable();
        is_all.is_continue().then_some(seen)
    }
}

/// Returns for each piece whether its fronts see none of its own back faces.
///
/// That holds if no face of it pierces another, and every edge of its border lies in a plane with all of the scene on one side. Closed pieces have no border.
///
/// Such a piece divides the convex hull of the scene in two, one part in front of it and one behind: its border lies on that hull, and every segment between two points of the scene stays inside.
/// A piece whose border is too long to test counts as one that sees its own back faces.
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
    let on_hull: Vec<bool> = threads::collect_from(rims, |(_, ends)| {
        is_on_hull(ends.map(|v| scene.vertices[v as usize]), &used, tolerance)
    });
    for ((piece, _), is_on_it) in rims.iter().zip(on_hull) {
        hides_own[*piece as usize] &= is_on_it;
    }
    hides_own
}

/// Returns whether a plane through an edge has all points on one side of it, or in it.
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
        self.outside_of(reversed, |other| {
            let cover = &self.outlines[other];
            other != back
                && cover.normal.dot(own.normal) < -0.5
                && cover.corners.iter().all(|&v| own.height(v).abs() <= self.tolerance)
        })
    }

    /// Returns the share of a patch's area that lies on faces of opposite winding among those that `may_cover` picks.
    pub(super) fn share_on(&self, patch: Vec<DVec3>, may_cover: impl Fn(usize) -> bool) -> f64 {
        let vector = polygon::area_vector(&patch);
        let corners = patch.clone();
        let rest = self.outside_of(patch, |other| {
            let cover = &self.outlines[other];
            cover.normal.dot(vector) < 0.0
                && may_cover(other)
                && corners.iter().all(|&v| cover.height(v).abs() <= self.tolerance)
        });
        let left: f64 = rest.iter().map(|part| polygon::area_vector(part).length()).sum();
        (1.0 - left / vector.length()).clamp(0.0, 1.0)
    }

    /// Returns the parts of a convex polygon outside of the faces in its plane that `covers` picks.
    fn outside_of(&self, polygon: Vec<DVec3>, covers: impl Fn(usize) -> bool) -> Vec<Vec<DVec3>> {
        let bounds = bounding_box(&polygon);
        let mut parts = vec![polygon];
        self.tree.overlapping(bounds, &mut |other| {
            if covers(other as usize) {
                let cover = &self.outlines[other as usize];
                parts = parts.iter().flat_map(|part| self.without(part, cover)).collect();
            }
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

    /// Returns whether a polygon is wider than a strip that rounding explains.
    fn is_wide(&self, corners: &[DVec3]) -> bool {
        if corners.len() < 3 {
            return false;
        }
        polygon::area_vector(corners).length() > self.tolerance * polygon::perimeter(corners)
    }
}

/// Finds where the patches lie among closed pieces of surface.
pub(in crate::form_factor) fn places_of_patches(input: Input<'_>, pieces: &Pieces) -> Vec<Place> {
    let patches = input.mesh.patches.iter().enumerate();
    let parts: Vec<_> = patches
        .map(|(i, patch)| (patch.face, input.mesh.polygon(PatchId::from_index(i))))
        .collect();
    places(input.scene, pieces, &parts)
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::mesh::{Mesh, MeshOptions, Subdivision};
    use crate::scene::load;
    use crate::visibility::brute_force::BruteForce;

    /// Hills over an L, n squares of two triangles along the longer sides: their border is on no hull.
    fn hills(n: usize) -> Scene {
        let mut text = String::new();
        for x in 0..=n {
            for y in 0..=n {
                let [u, v] = [x, y].map(|k| 10.0 * k as f64 / n as f64);
                let z = 0.6 * (2.1 * u).sin() * (1.7 * v).cos() + 0.3 * (5.0 * u + 3.0 * v).sin();
                let _ = writeln!(text, "v {u} {v} {z}");
            }
        }
        for x in 0..n {
            for y in (0..n).filter(|&y| x < n / 2 || y < n / 2) {
                let [a, b] = [x, x + 1].map(|x| x * (n + 1) + y + 1);
                let _ = writeln!(text, "f {a} {b} {}\nf {a} {} {}", b + 1, b + 1, a + 1);
            }
        }
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("hills.obj");
        std::fs::write(&path, text).expect("a file");
        load(&path).expect("a scene").scene
    }

    fn candidates(scene: &Scene, max_pairs: usize) -> Candidates {
        let mesh = Mesh::new(scene, MeshOptions::from(Subdivision::Uniform(1))).expect("a mesh");
        let visibility = BruteForce::new(scene);
        let input = Input {
            scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded: false,
        };
        Candidates::of(input, &vec![true; mesh.n_patches()], max_pairs)
    }

    fn n_pairs(found: &Candidates) -> usize {
        let listed = found.views.iter();
        listed
            .filter_map(|view| Some(view.patches.len() * found.parts(view)?.count()))
            .sum()
    }

    #[test]
    fn no_more_pairs_are_listed_than_are_looked_at() {
        for n in [8, 16, 32] {
            let scene = hills(n);
            let all = candidates(&scene, usize::MAX);
            let patches = |found: &Candidates| -> Vec<Vec<usize>> {
                found.views.iter().map(|view| view.patches.clone()).collect()
            };
            let n_all = n_pairs(&all);
            let n_faces = scene.faces.len();
            assert!(n_all > n_faces * n_faces / 20, "{n}: {n_all}, as many as faces squared");
            for max_pairs in [0, n_faces, 20 * n_faces] {
                let some = candidates(&scene, max_pairs);
                assert_eq!(patches(&some), patches(&all), "{n}");
                assert!(n_pairs(&some) <= max_pairs, "{n}: {} of {max_pairs}", n_pairs(&some));
                let n_open: usize = some.views.iter().map(|view| view.patches.len()).sum();
                for (one, other) in some.views.iter().zip(&all.views) {
                    let n_parts = all.parts(other).map(Iterator::count);
                    let is_listed = max_pairs > 0 && n_parts.is_some_and(|parts| parts <= max_pairs / n_open);
                    let expected = other.backs.as_ref().filter(|_| is_listed);
                    assert_eq!(one.backs.as_ref(), expected, "{n} {max_pairs}");
                }
                // Where none is listed, the first that is found decides: few are looked at.
                if max_pairs == 0 {
                    let looked_at = some.parts.iter().filter(|parts| parts.get().is_some()).count();
                    assert!(looked_at <= n_open, "{n}: {looked_at} of {n_open}");
                }
            }
        }
    }
}
