//! The choice of the face that keeps the common area of two overlapping ones.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec3;

use super::{FaceId, Groups, Overlap, Refused, Scene, edges, polygon};
use crate::scene::split::PLANARITY;
use crate::scene::{MaterialId, SurfaceId};

/// The relative difference below which areas are equal and faces coincide.
const SAME: f64 = 1e-6;

/// The order in which faces that overlap keep the area in common.
pub(super) struct Ranks(HashMap<FaceId, Rank>);

/// The key of a face: the lowest keeps the common area.
///
/// It consists of the class of the area of the flat part, the place of that part from the end of the file, and the same two of the face itself.
type Rank = (usize, std::cmp::Reverse<FaceId>, usize, std::cmp::Reverse<FaceId>);

/// The area of something, in m², and the length of its outline, in m.
#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    area: f64,
    length: f64,
}

impl Extent {
    fn of(scene: &Scene, face: FaceId) -> Self {
        let corners = scene.polygon(face);
        let n = corners.len();
        Self {
            area: polygon::area_vector(&corners).length(),
            length: (0..n).map(|k| corners[k].distance(corners[(k + 1) % n])).sum(),
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            area: self.area + other.area,
            length: self.length + other.length,
        }
    }

    /// Returns the uncertainty of the area, in m².
    fn doubt(self, tolerance: f64) -> f64 {
        (SAME * self.area).max(tolerance * self.length)
    }
}

impl Ranks {
    /// Ranks the overlapping faces of a scene.
    ///
    /// # Errors
    /// [`Refused::Coincident`].
    pub(super) fn new(scene: &Scene, overlaps: &[Overlap], tolerance: f64) -> Result<Self, Refused> {
        let faces: BTreeSet<FaceId> = overlaps.iter().flat_map(|overlap| overlap.faces).collect();
        let own: HashMap<FaceId, Extent> = faces.iter().map(|&face| (face, Extent::of(scene, face))).collect();
        let (groups, part) = flat_parts(scene, &faces, tolerance);
        let of_part = |face| part[&groups.of_face(face)];
        let coincide = |common: f64, extents: [Extent; 2]| {
            let larger = extents[0].area.max(extents[1].area);
            larger - common <= extents[0].doubt(tolerance).max(extents[1].doubt(tolerance))
        };
        // The common area of two flat parts, and the first faces of it.
        let mut common: BTreeMap<[FaceId; 2], (f64, [FaceId; 2])> = BTreeMap::new();
        for overlap in overlaps {
            if coincide(overlap.area, overlap.faces.map(|face| own[&face])) {
                return Err(Refused::Coincident(overlap.faces));
            }
            let mut parts = overlap.faces.map(|face| groups.of_face(face));
            parts.sort_unstable();
            if parts[0] != parts[1] {
                common.entry(parts).or_insert((0.0, overlap.faces)).0 += overlap.area;
            }
        }
        for (parts, (area, first)) in common {
            if coincide(area, parts.map(of_part)) {
                return Err(Refused::Coincident(first));
            }
        }
        let part_class = classes(
            faces.iter().map(|&face| (groups.of_face(face), of_part(face))),
            tolerance,
        );
        let own_class = classes(faces.iter().map(|&face| (face, own[&face])), tolerance);
        let rank = |face| {
            let of_face = groups.of_face(face);
            let reverse = std::cmp::Reverse;
            (part_class[&of_face], reverse(of_face), own_class[&face], reverse(face))
        };
        Ok(Self(faces.iter().map(|&face| (face, rank(face))).collect()))
    }

    /// Returns the two faces, the one that keeps the common area first.
    pub(super) fn ordered(&self, mut faces: [FaceId; 2]) -> [FaceId; 2] {
        faces.sort_unstable_by_key(|face| self.0[face]);
        faces
    }
}

/// Returns the ranks of things by area; areas that differ by rounding have the same rank.
fn classes(things: impl Iterator<Item = (FaceId, Extent)>, tolerance: f64) -> HashMap<FaceId, usize> {
    let mut sorted: Vec<(FaceId, Extent)> = things.collect();
    sorted.sort_unstable_by(|a, b| a.1.area.total_cmp(&b.1.area).then(a.0.cmp(&b.0)));
    let (mut class, mut last) = (0, 0.0);
    let mut class_of = HashMap::new();
    for (thing, extent) in sorted {
        if extent.area - last > extent.doubt(tolerance) {
            class += 1;
        }
        last = extent.area;
        class_of.insert(thing, class);
    }
    class_of
}

/// Joins the faces of a scene that continue one another in one plane, with one surface and one material.
///
/// Returns the extents of the parts that contain one of the faces `wanted`.
fn flat_parts(scene: &Scene, wanted: &BTreeSet<FaceId>, tolerance: f64) -> (Groups, HashMap<FaceId, Extent>) {
    let kinds: BTreeSet<(SurfaceId, MaterialId)> = wanted.iter().map(|&face| kind(scene, face)).collect();
    let candidates: Vec<FaceId> = scene
        .face_ids()
        .filter(|&face| kinds.contains(&kind(scene, face)))
        .collect();
    let mut at_edge: HashMap<(u32, u32), Vec<FaceId>> = HashMap::new();
    for &face in &candidates {
        for edge in edges(scene, face) {
            at_edge.entry(edge).or_default().push(face);
        }
    }
    let beside = |&face: &FaceId| {
        let others = edges(scene, face).filter_map(|(from, to)| at_edge.get(&(to, from)));
        let pairs = others.flatten().map(move |&other| [face, other]);
        pairs.collect::<Vec<_>>()
    };
    let continues = |&[face, other]: &[FaceId; 2]| {
        face < other && kind(scene, face) == kind(scene, other) && in_one_plane(scene, face, other, tolerance)
    };
    let joined = candidates.iter().flat_map(beside).filter(continues);
    let groups = Groups::new(candidates.iter().copied(), joined);
    let parts: BTreeSet<FaceId> = wanted.iter().map(|&face| groups.of_face(face)).collect();
    let mut extents: HashMap<FaceId, Extent> = HashMap::new();
    for &face in &candidates {
        let part = groups.of_face(face);
        if parts.contains(&part) {
            let extent = extents.entry(part).or_default();
            *extent = extent.and(Extent::of(scene, face));
        }
    }
    (groups, extents)
}

fn kind(scene: &Scene, face: FaceId) -> (SurfaceId, MaterialId) {
    let face = &scene.faces[face.0 as usize];
    (face.surface, face.material)
}

/// Returns whether two faces with a common edge lie in one plane and face the same way.
fn in_one_plane(scene: &Scene, face: FaceId, other: FaceId, tolerance: f64) -> bool {
    let measured = [face, other].map(|face| {
        let corners = scene.polygon(face);
        let vector = polygon::area_vector(&corners);
        (corners, vector)
    });
    let [(corners, vector), (others, other_vector)] = &measured;
    let normals = [vector, other_vector].map(|vector| vector.normalize_or_zero());
    let areas = [vector, other_vector].map(|vector| vector.length());
    let size = corners[0].distance(corners[1]).max(others[0].distance(others[1]));
    // Outside a face the error of its plane grows with the ratio of the other face's area to its own.
    let off = |k: usize| tolerance * (1.0 + areas[1 - k] / areas[k].max(f64::MIN_POSITIVE)) + PLANARITY * size;
    let is_level =
        |k: usize, from: &[DVec3], of: &[DVec3]| of.iter().all(|&v| normals[k].dot(v - from[0]).abs() <= off(k));
    normals[0].dot(normals[1]) > 0.0 && is_level(0, corners, others) && is_level(1, others, corners)
}
