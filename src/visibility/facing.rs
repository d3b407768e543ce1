//! Faces with inverted normals: their winding is clockwise as seen from the faces around them.

use glam::DVec3;

use super::{Coherence, HitBatch, RayBatch, Visibility};
use crate::geometry::polygon;
use crate::geometry::sampling::{Frame, PointStream, Sequence, UniformOnPolygon, cosine_direction};
use crate::scene::topology::{edge_runs, edges};
use crate::scene::{FaceId, Scene, SurfaceId};

/// The greatest number of faces that are searched one by one; more are searched by surface.
const BY_FACE: usize = 2048;

/// Rays for all faces or surfaces together, and the least and the most for each.
const RAYS: usize = 1 << 17;
const MIN_RAYS: usize = 64;
const MAX_RAYS: usize = 1024;

/// The fewest rays that must meet a back face before it counts as seen: a single one may slip through the joint between two faces.
const SEEN: u32 = 2;

/// The most pairs of faces that are tested for facing each other, and the most segments that are traced between such pairs.
const PAIRS: usize = 20_000_000;
const SEGMENTS: usize = 4096;

/// The height above a plane that counts as in it, relative to the size of the scene.
const FLAT: f64 = 1e-12;

/// The signs of inverted normals.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Turned {
    /// The surface.
    pub surface: SurfaceId,
    /// The number of its faces with inverted normals; all of its faces in a scene of very many faces.
    pub n_faces: usize,
    /// The line of the first one.
    pub line: u32,
}

/// The faces that see nothing, or only back faces.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Facing {
    /// True if no face sees another, although not all lie in one plane.
    pub none_sees: bool,
    /// True if light is emitted, and no face that emits sees another.
    pub no_emitter_sees: bool,
    /// Faces that see no other face and whose back is seen, by surface; empty where no face sees another.
    pub turned: Vec<Turned>,
    /// Surfaces that are concave from behind alone: their faces see no other and are not seen, but their backs see each other.
    ///
    /// Surfaces around a solid are not among them.
    pub inside_out: Vec<SurfaceId>,
    /// The number of faces that see only the backs of others (for a scene of very many: all faces of such surfaces).
    pub n_see_only_backs: usize,
}

/// Finds faces that see no other although others see their back, as those of an enclosure's wall with inverted normals do.
///
/// Rays leave every face on its front, cosine-distributed. A face counts as inverted if none of its rays meets the front of a face, no ray from elsewhere meets its own front, and at
/// least two meet its back. The outer side of a wall or of a box does not count: it sees nothing, but nothing sees its back. A face that continues one that sees does not count either, as the roof of the
/// highest house of a town, whose back the ground sees within the walls. [`none_sees`](Facing::none_sees) is true only
/// if segments between faces that face each other find none either, so that small faces far apart do see each other.
///
/// Accuracy: a face that sees others in less than a thousandth of its hemisphere (a fiftieth, in scenes of thousands of faces) may count as one that sees nothing.
/// Work: 2¹⁷ rays, or 64 for each surface if these are more.
#[must_use]
pub fn look(scene: &Scene, visibility: &dyn Visibility) -> Facing {
    if scene.faces.len() < 2 || is_flat(scene) {
        return Facing::default();
    }
    let groups = Groups::of(scene);
    let found = trace(scene, visibility, &groups);
    let emits = |face: FaceId| {
        let material = scene.faces[face.0 as usize].material;
        scene.materials[material.0 as usize].exitance.iter().any(|&e| e > 0.0)
    };
    let mut emitter_sees = scene
        .face_ids()
        .any(|face| emits(face) && found.sees[groups.of_face(face)]);
    let mut any_sees = found.sees.contains(&true);
    if !any_sees {
        any_sees = reaches(scene, visibility, &scene.face_ids().collect::<Vec<_>>());
    }
    if !any_sees {
        return Facing {
            none_sees: true,
            no_emitter_sees: scene.is_emitting(),
            n_see_only_backs: found.n_see_only_backs(scene, &groups),
            ..Facing::default()
        };
    }
    if !emitter_sees && scene.is_emitting() {
        let emitters: Vec<FaceId> = scene.face_ids().filter(|&face| emits(face)).collect();
        emitter_sees = reaches(scene, visibility, &emitters);
    }
    let mut turned: Vec<Turned> = Vec::new();
    let mut place = vec![None; scene.surfaces.len()];
    for id in turned_faces(scene, &groups, &found) {
        let face = &scene.faces[id.0 as usize];
        let k = *place[face.surface.0 as usize].get_or_insert_with(|| {
            turned.push(Turned {
                surface: face.surface,
                n_faces: 0,
                line: face.line,
            });
            turned.len() - 1
        });
        turned[k].n_faces += 1;
    }
    Facing {
        none_sees: false,
        no_emitter_sees: scene.is_emitting() && !emitter_sees,
        turned,
        inside_out: inside_out(scene, visibility, &groups, &found),
        n_see_only_backs: found.n_see_only_backs(scene, &groups),
    }
}

/// Returns the surfaces whose faces see nothing and are not seen, while rays from their backs meet their own backs more often than all others.
///
/// From a surface around a solid, rays from a back stay inside, or meet the backs of the solid's other sides.
fn inside_out(scene: &Scene, visibility: &dyn Visibility, groups: &Groups, found: &Found) -> Vec<SurfaceId> {
    let mut of_surfaces: Vec<Vec<FaceId>> = vec![Vec::new(); scene.surfaces.len()];
    for (id, face) in scene.face_ids().zip(&scene.faces) {
        of_surfaces[face.surface.0 as usize].push(id);
    }
    let is_apart = |face: &FaceId| {
        let group = groups.of_face(*face);
        !found.sees[group] && !found.front_is_seen[group]
    };
    let n_rays = (RAYS / scene.surfaces.len()).clamp(MIN_RAYS, MAX_RAYS);
    let mut hits = HitBatch::default();
    let mut result = Vec::new();
    for (surface, faces) in (0..).map(SurfaceId).zip(&of_surfaces) {
        if faces.len() < 2 || !faces.iter().all(is_apart) {
            continue;
        }
        let mut rays = RayBatch::default();
        push_rays(scene, visibility, faces, n_rays, true, surface.0.into(), &mut rays);
        visibility.closest_hits(&rays, Coherence::Incoherent, &mut hits);
        let (mut n_own, mut n_others, mut n_escaped) = (0, 0, 0);
        for hit in (0..rays.len()).map(|k| hits.face(k)) {
            match hit {
                None => n_escaped += 1,
                Some(hit) if !hit.back => {}
                Some(hit) if scene.faces[hit.face.0 as usize].surface == surface => n_own += 1,
                Some(_) => n_others += 1,
            }
        }
        // A few rays slip through the joints of a surface around a solid.
        if n_own >= SEEN && n_own > n_others && 100 * n_escaped > rays.len() {
            result.push(surface);
        }
    }
    result
}

/// Returns the faces that see nothing, are seen from behind, and are not wound like a neighbour that sees.
fn turned_faces(scene: &Scene, groups: &Groups, found: &Found) -> Vec<FaceId> {
    let sees = |face: FaceId| {
        let group = groups.of_face(face);
        found.sees[group] || found.front_is_seen[group]
    };
    let is_suspect = |&face: &FaceId| !sees(face) && found.back_hits[groups.of_face(face)] >= SEEN;
    let suspects: Vec<FaceId> = scene.face_ids().filter(is_suspect).collect();
    if suspects.is_empty() {
        return suspects;
    }
    let runs = edge_runs(scene);
    // Faces that are wound alike run along the edge between them in opposite senses.
    let continues_one_that_sees = |&face: &FaceId| {
        let is_alone = edges(scene, face).all(|edge| runs[&edge].1);
        let mut beside = edges(scene, face).filter_map(|(a, b)| runs.get(&(b, a)));
        is_alone && beside.any(|&(other, is_only)| is_only && sees(FaceId(other)))
    };
    suspects
        .into_iter()
        .filter(|face| !continues_one_that_sees(face))
        .collect()
}

/// Returns whether all faces lie in one plane: then none would see another if some were turned.
fn is_flat(scene: &Scene) -> bool {
    let first = scene.polygon(FaceId(0));
    let normal = polygon::area_vector(&first).normalize_or_zero();
    let (low, high) = scene.bounding_box();
    let slack = 1e-6 * low.distance(high);
    scene
        .faces
        .iter()
        .flat_map(|face| face.corners.as_slice().to_vec())
        .all(|v| normal.dot(scene.vertices[v as usize] - first[0]).abs() <= slack)
}

/// A unit of the search: a face, or a surface where there are very many faces.
struct Groups {
    of_face: Option<Vec<u32>>,
    n: usize,
}

impl Groups {
    fn of(scene: &Scene) -> Self {
        if scene.faces.len() <= BY_FACE {
            return Self {
                of_face: None,
                n: scene.faces.len(),
            };
        }
        Self {
            of_face: Some(scene.faces.iter().map(|face| face.surface.0).collect()),
            n: scene.surfaces.len(),
        }
    }

    fn of_face(&self, face: FaceId) -> usize {
        self.of_face.as_ref().map_or(face.0, |of| of[face.0 as usize]) as usize
    }
}

struct Found {
    /// Whether a ray from the group met the front of a face.
    sees: Vec<bool>,
    /// The number of rays from the group that met back faces.
    backs_seen: Vec<u32>,
    front_is_seen: Vec<bool>,
    back_hits: Vec<u32>,
}

impl Found {
    /// Counts the faces that see only the backs of others.
    fn n_see_only_backs(&self, scene: &Scene, groups: &Groups) -> usize {
        let sees_only_backs = |face: &FaceId| {
            let group = groups.of_face(*face);
            !self.sees[group] && self.backs_seen[group] >= SEEN
        };
        scene.face_ids().filter(sees_only_backs).count()
    }
}

fn trace(scene: &Scene, visibility: &dyn Visibility, groups: &Groups) -> Found {
    let mut found = Found {
        sees: vec![false; groups.n],
        backs_seen: vec![0; groups.n],
        front_is_seen: vec![false; groups.n],
        back_hits: vec![0; groups.n],
    };
    let n_rays = (RAYS / groups.n).clamp(MIN_RAYS, MAX_RAYS);
    let mut members: Vec<Vec<FaceId>> = vec![Vec::new(); groups.n];
    for face in scene.face_ids() {
        members[groups.of_face(face)].push(face);
    }
    let (mut rays, mut hits) = (RayBatch::default(), HitBatch::default());
    for (group, faces) in members.iter().enumerate() {
        rays.clear();
        push_rays(scene, visibility, faces, n_rays, false, group as u64, &mut rays);
        visibility.closest_hits(&rays, Coherence::Incoherent, &mut hits);
        for hit in (0..rays.len()).filter_map(|k| hits.face(k)) {
            let seen = groups.of_face(hit.face);
            if hit.back {
                found.back_hits[seen] += 1;
                found.backs_seen[group] += 1;
            } else {
                found.sees[group] = true;
                found.front_is_seen[seen] = true;
            }
        }
    }
    found
}

/// Adds about `n_rays` cosine-distributed rays from the fronts of faces, or from their backs, to each face in proportion to its area.
fn push_rays(
    scene: &Scene,
    visibility: &dyn Visibility,
    faces: &[FaceId],
    n_rays: usize,
    from_backs: bool,
    stream: u64,
    rays: &mut RayBatch,
) {
    let mut points = PointStream::new(Sequence::Sobol, 0, stream);
    let areas: Vec<f64> = faces.iter().map(|&face| scene.area_vector(face).length()).collect();
    let per_ray = areas.iter().sum::<f64>() / n_rays as f64;
    let mut next = 0.5 * per_ray;
    let mut passed = 0.0;
    for (&face, area) in faces.iter().zip(&areas) {
        passed += area;
        if next >= passed {
            continue;
        }
        let corners = scene.polygon(face);
        let front = polygon::area_vector(&corners).normalize_or_zero();
        let normal = if from_backs { -front } else { front };
        let (frame, place) = (Frame::from_normal(normal), UniformOnPolygon::new(&corners));
        let start = normal * visibility.offset() - visibility.frame_origin();
        while next < passed {
            let [u, v, s, t] = points.next_point();
            rays.push_ray(place.point(u, v) + start, frame.to_world(cosine_direction(s, t)));
            next += per_ray;
        }
    }
}

/// Returns whether one of the faces sees any other face of the scene, by segments between their middles.
fn reaches(scene: &Scene, visibility: &dyn Visibility, from: &[FaceId]) -> bool {
    // A face that is above the plane of another by rounding alone does not see it.
    let (low, high) = scene.box_where_faces_meet();
    let least = scene.slack().max(FLAT * low.distance(high));
    let in_front = |of: &[DVec3], normal: DVec3, other: &[DVec3]| other.iter().any(|&v| normal.dot(v - of[0]) > least);
    let polygons: Vec<(Vec<DVec3>, DVec3)> = scene
        .face_ids()
        .map(|face| {
            let corners = scene.polygon(face);
            let normal = polygon::area_vector(&corners).normalize_or_zero();
            (corners, normal)
        })
        .collect();
    let (offset, origin) = (visibility.offset(), visibility.frame_origin());
    let middle = |(corners, normal): &(Vec<DVec3>, DVec3)| polygon::centroid(corners) + offset * *normal - origin;
    let mut rays = RayBatch::default();
    let mut left = PAIRS;
    'pairs: for face in from {
        let here = &polygons[face.0 as usize];
        for there in &polygons {
            if left == 0 || rays.len() == SEGMENTS {
                break 'pairs;
            }
            left -= 1;
            if in_front(&here.0, here.1, &there.0) && in_front(&there.0, there.1, &here.0) {
                rays.push_segment(middle(here), middle(there));
            }
        }
    }
    let mut blocked = Vec::new();
    visibility.occluded(&rays, Coherence::Incoherent, &mut blocked);
    blocked.contains(&false)
}
