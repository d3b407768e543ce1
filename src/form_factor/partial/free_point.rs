//! The view factors from a free point to all patches of a mesh, by exact clipping.

use std::ops::ControlFlow;

use glam::DVec3;

use super::plates::Plate;
use super::view_cells::{Scratch, View};
use crate::geometry::box_pairs::BoxTree;
use crate::geometry::polygon;
use crate::mesh::{Mesh, PatchId};
use crate::scene::Scene;
use crate::visibility::occluders::{OccluderId, OccluderIndex};

/// The part of the scene's size within which faces and patches count as in one plane.
const IN_PLANE: f64 = 1e-12;

/// A part of a patch that a point sees, from the front or from behind; its corners run counter-clockwise as seen from the point.
pub(crate) struct SeenPart<'a> {
    pub(crate) patch: usize,
    pub(crate) is_back: bool,
    pub(crate) corners: &'a [DVec3],
    /// An upper bound of the length of its border as the point sees it, rad.
    pub(crate) border: f64,
    /// The distance of its border, m.
    pub(crate) distance: f64,
}

/// The position of a point relative to the faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// In the open.
    Free,
    /// On a face, to rounding.
    OnFace,
}

/// The faces and patches of a scene, for views from points.
pub(crate) struct PointViews {
    pub(super) faces: Vec<Plate>,
    tree_of_faces: BoxTree,
    pub(super) patches: Vec<Plate>,
    /// The faces in the plane of each patch whose fronts are on the side of its back.
    pub(super) covers: Vec<Vec<usize>>,
    /// The faces, flat neighbours joined.
    pub(super) occluders: Vec<Plate>,
    /// The closed convex solid that each occluder is a side of.
    pub(super) solid_of: Vec<Option<usize>>,
    pub(super) index: OccluderIndex,
    /// The patches that each occluder is cut into.
    pub(super) patches_of: Vec<Vec<usize>>,
    /// The distance up to which a point counts as in a plane, m.
    tolerance: f64,
}

impl PointViews {
    pub(crate) fn new(scene: &Scene, mesh: &Mesh) -> Self {
        let (low, high) = scene.box_where_faces_meet();
        let largest = low.abs().max(high.abs()).max_element();
        let tolerance = scene
            .slack()
            .max(IN_PLANE * low.distance(high))
            .max(16.0 * f64::EPSILON * largest);
        let faces: Vec<Plate> = scene.face_ids().map(|face| Plate::new(scene.polygon(face))).collect();
        let patches: Vec<Plate> = (0..mesh.n_patches())
            .map(|i| Plate::new(mesh.polygon(PatchId::from_index(i))))
            .collect();
        let index = OccluderIndex::new(scene);
        let ids = || (0..index.n_occluders()).map(|k| OccluderId(u32::try_from(k).unwrap_or(u32::MAX)));
        let occluders: Vec<Plate> = ids().map(|id| Plate::new(index.corners(id).to_vec())).collect();
        let mut of_face = vec![None; faces.len()];
        for (k, id) in ids().enumerate() {
            for face in index.faces(id) {
                of_face[face.0 as usize] = Some(k);
            }
        }
        let mut patches_of = vec![Vec::new(); occluders.len()];
        for (i, patch) in mesh.patches.iter().enumerate() {
            if let Some(own) = of_face[patch.face.0 as usize] {
                patches_of[own].push(i);
            }
        }
        let tree_of_faces = BoxTree::new(faces.iter().map(Plate::around).collect());
        Self {
            covers: covers(&patches, &faces, &tree_of_faces, tolerance),
            solid_of: ids().map(|id| index.solid_of(id)).collect(),
            patches_of,
            tree_of_faces,
            faces,
            patches,
            occluders,
            index,
            tolerance,
        }
    }

    /// Returns the greatest possible error of a corner, m.
    pub(crate) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Returns the position of a point relative to the faces.
    pub(crate) fn place(&self, point: DVec3) -> Place {
        let mut is_on_face = false;
        self.tree_of_faces
            .overlapping(widened((point, point), self.tolerance), &mut |k| {
                let face = &self.faces[k as usize];
                is_on_face |= face.height(point).abs() <= self.tolerance
                    && polygon::distance(point, &face.corners) <= self.tolerance;
            });
        if is_on_face { Place::OnFace } else { Place::Free }
    }

    /// Returns whether light from a unit direction reaches a point past all faces, and whether that is certain: any border it passes is farther away than corners may be off.
    pub(crate) fn is_lit(&self, point: DVec3, direction: DVec3) -> (bool, bool) {
        // The depth inside the face at which light meets its plane, m; below 0 outside.
        let depth = |face: &Plate| {
            let (height, slope) = (face.height(point), face.normal.dot(direction));
            let t = -height / slope;
            if !(t > 0.0 && t.is_finite()) {
                return f64::NEG_INFINITY;
            }
            let hit = point + t * direction;
            let next = face.corners.iter().cycle().skip(1);
            let edges = face.corners.iter().zip(next);
            let inside = edges.map(|(&a, &b)| face.normal.dot((b - a).cross(hit - a)) / b.distance(a));
            inside.fold(f64::INFINITY, f64::min)
        };
        // A face that light passes at a distance affects neither answer.
        let mut deepest = f64::NEG_INFINITY;
        let is_near = |around| is_met(widened(around, 2.0 * self.tolerance), point, direction);
        // The search visits all.
        let _: ControlFlow<()> = self.tree_of_faces.meeting(&is_near, &mut |k| {
            deepest = deepest.max(depth(&self.faces[k as usize]));
            ControlFlow::Continue(())
        });
        (deepest < 0.0, deepest.abs() > self.tolerance)
    }

    /// Calls `visit` with every part of a patch that a point sees, and returns the distance of the nearest face that hides a part of anything, m.
    ///
    /// With a `normal`, only parts in front of it are visited.
    /// The directions are divided into cells, see [`view_cells`](super::view_cells); there each patch is cut by the pyramid over every face that may hide a part of it, beyond the plane of that face. Flat neighbours are
    /// one face, and the far sides of a convex solid are left out. Of two patches back to back the front is seen. Accuracy: a few ulps at each cut.
    /// Work: about O(n + m log m) for n patches, of which m are seen.
    pub(crate) fn visit(
        &self,
        (point, normal): (DVec3, Option<DVec3>),
        scratch: &mut Scratch,
        visit: impl FnMut(&SeenPart<'_>),
    ) -> f64 {
        View::look(self, (point, normal), scratch, visit)
    }

    /// Returns whether an occluder hides no part of a plate because none is beyond it, or all of the plate is in its plane.
    pub(super) fn is_before(&self, plate: &Plate, occluder: &Plate, point: DVec3) -> bool {
        let sign = occluder.height(point).signum();
        let heights = || plate.corners.iter().map(|&v| occluder.height(v));
        heights().all(|h| h * sign >= 0.0) || heights().all(|h| h.abs() <= self.tolerance)
    }
}

/// Returns for each patch the faces in its plane whose fronts are on the side of its back.
fn covers(patches: &[Plate], faces: &[Plate], tree: &BoxTree, tolerance: f64) -> Vec<Vec<usize>> {
    let of_patch = |patch: &Plate| {
        let mut found = Vec::new();
        tree.overlapping(widened(patch.around(), tolerance), &mut |k| {
            let face = &faces[k as usize];
            let is_in_plane = || patch.corners.iter().all(|&v| face.height(v).abs() <= tolerance);
            if face.normal.dot(patch.normal) < 0.0 && is_in_plane() {
                found.push(k as usize);
            }
        });
        found.sort_unstable();
        found
    };
    patches.iter().map(of_patch).collect()
}

/// Returns a box that is larger on all sides.
fn widened((low, high): (DVec3, DVec3), by: f64) -> (DVec3, DVec3) {
    (low - by, high + by)
}

/// Returns whether a half-line meets a box.
fn is_met((low, high): (DVec3, DVec3), start: DVec3, direction: DVec3) -> bool {
    let (from, to) = ((low - start) / direction, (high - start) / direction);
    // `f64::max` and `f64::min` pass over the 0 / 0 of a half-line within a side.
    let near = (0..3).fold(0.0, |near: f64, k| near.max(from[k].min(to[k])));
    let far = (0..3).fold(f64::INFINITY, |far: f64, k| far.min(from[k].max(to[k])));
    near <= far
}
