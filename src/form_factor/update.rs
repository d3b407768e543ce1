//! Form factors after a change of the scene, from those before it.

use glam::DVec3;

use crate::geometry::polygon;
use crate::matrix::FormFactors;
use crate::scene::{FaceId, Scene};
use crate::visibility::shaft::Shaft;

/// The faces of a scene that moved, with their positions before and after.
///
/// The exchange area of two patches depends on their corners and on the faces between them. It is the same as before if neither patch is on a face
/// that moved, and no such face, where it was or where it is, reaches into the convex hull of the two patches: all segments between them run there.
#[derive(Clone, Debug)]
pub struct Change {
    /// For every face, whether it moved.
    moved: Vec<bool>,
    /// Faces in one place, surface by surface.
    groups: Vec<Group>,
}

/// Faces that lie close together.
#[derive(Clone, Debug)]
struct Group {
    low: DVec3,
    high: DVec3,
    polygons: Vec<Vec<DVec3>>,
}

impl Change {
    /// Compares two scenes with the same faces in the same order; a face moved if a corner differs in any bit.
    ///
    /// # Panics
    /// If the numbers of faces, of the corners of a face, or the surfaces of the faces differ.
    #[must_use]
    #[track_caller]
    pub fn between(before: &Scene, after: &Scene) -> Self {
        assert_eq!(before.faces.len(), after.faces.len(), "the same faces");
        let mut change = Self {
            moved: Vec::with_capacity(before.faces.len()),
            groups: Vec::new(),
        };
        // Where the faces of each surface were, and where they are.
        let mut groups = std::collections::BTreeMap::new();
        for face in before.face_ids() {
            let index = face.0 as usize;
            let surface = before.faces[index].surface;
            assert_eq!(surface, after.faces[index].surface, "the same surfaces");
            let polygons = [before, after].map(|scene| scene.polygon(face));
            let [was, is] = &polygons;
            assert_eq!(was.len(), is.len(), "the same corners");
            let moved = was != is;
            change.moved.push(moved);
            if moved {
                for (place, polygon) in polygons.into_iter().enumerate() {
                    let group: &mut Vec<Vec<DVec3>> = groups.entry((surface, place)).or_default();
                    group.push(polygon);
                }
            }
        }
        change.groups = groups.into_values().map(Group::new).collect();
        change
    }

    /// Returns whether nothing moved.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.groups.is_empty()
    }

    /// Returns the number of faces that moved.
    #[must_use]
    pub fn n_faces(&self) -> usize {
        self.moved.iter().filter(|moved| **moved).count()
    }

    /// Returns whether a face moved.
    pub(super) fn moves(&self, face: FaceId) -> bool {
        self.moved[face.0 as usize]
    }

    /// Returns whether anything that moved reaches, or reached, in between two convex polygons, which stayed; it may return true where that is uncertain.
    ///
    /// A result for two polygons holds for all their parts. Tolerance: that of [`OccluderIndex`](crate::visibility::occluders::OccluderIndex).
    pub(super) fn may_come_between(&self, p: &[DVec3], q: &[DVec3]) -> bool {
        let Some(shaft) = Shaft::new(p, q, 0.0) else {
            return false;
        };
        self.groups.iter().any(|group| {
            shaft.may_meet_box(group.low, group.high) && group.polygons.iter().any(|polygon| shaft.meets(polygon))
        })
    }
}

impl Group {
    fn new(polygons: Vec<Vec<DVec3>>) -> Self {
        let (low, high) = polygon::bounds(polygons.iter().flatten());
        Self { low, high, polygons }
    }
}

/// The results from before a change.
#[derive(Clone, Copy, Debug)]
pub struct Before<'a> {
    /// The form factors by the same method with the same settings before the move, without repairs.
    pub factors: &'a FormFactors,
    /// Whether they are within their tolerance: if not, pairs that are taken over are tested again for errors above it.
    pub tolerance_met: bool,
    /// The change since then.
    pub change: &'a Change,
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::{Motion, Names, Pose, builtin};

    #[test]
    fn a_box_comes_between_walls_but_not_into_a_corner() {
        let scene = builtin::build("room-box", None).unwrap().scene;
        let (low, high) = scene.bounding_box();
        let is_inside = |v: &DVec3| v.cmpgt(low).all() && v.cmplt(high).all();
        let mut names: Vec<String> = Vec::new();
        for face in scene.face_ids() {
            if scene.polygon(face).iter().all(is_inside) {
                let surface = scene.faces[face.0 as usize].surface;
                names.push(scene.surfaces[surface.0 as usize].name.clone());
            }
        }
        assert!(!names.is_empty());
        let mut pose = Pose::default();
        let up = Motion {
            surface: Names::Many(names),
            rotate: None,
            axis: None,
            about: None,
            translate: Some([0.0, 0.0, 0.05 * (high - low).z]),
        };
        pose.push(&scene, &up).unwrap();
        let change = Change::between(&scene, &scene.posed(&pose).unwrap());
        assert!(!change.is_none() && change.n_faces() == 6);
        assert!(Change::between(&scene, &scene).is_none());
        let walls: Vec<Vec<DVec3>> = scene
            .face_ids()
            .filter(|&face| !change.moves(face))
            .map(|face| scene.polygon(face))
            .collect();
        assert!(change.may_come_between(&walls[0], &walls[1]));
        // A small square of the floor, and one of a wall beside it.
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * 1e-3);
        let floor = [low, low + x, low + x + y, low + y];
        let wall = [low, low + y, low + y + z, low + z];
        assert!(Shaft::new(&floor, &wall, 0.0).is_some() && !change.may_come_between(&floor, &wall));
    }
}
