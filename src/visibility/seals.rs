//! Faces that meet in T-junctions, sealed: vertices rounded to f32 leave the edge that they were meant to lie on, and rays pass through the slit.

use std::collections::HashMap;

use glam::DVec3;

use super::frame::Frame;
use super::{HitBatch, RayBatch, to_f32};
use crate::geometry::box_pairs::BoxTree;
use crate::scene::{FaceId, Scene};

/// A vertex within this part of the largest coordinate of an edge lies on it: some units of the last place of f32.
const TOUCHING: f64 = 1.0 / (1 << 21) as f64;

/// A triangle between an edge of a face and vertices of others that lie on it: it fills the slit, and is a part of the face.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Seal {
    /// The corners, vertices of the scene.
    pub(super) corners: [u32; 3],
    face: FaceId,
    /// The number of the edge.
    edge: usize,
    /// How far along the edge the corners are, from 0 to 1.
    along: [f64; 3],
    normal: DVec3,
    is_quad: bool,
}

/// And within this part of the edge's length.
const MAX_OF_EDGE: f64 = 1e-4;

/// Returns the seals of a scene. Work: O(n log n) for n edges that belong to one face alone.
pub(super) fn find(scene: &Scene, frame: &Frame) -> Vec<Seal> {
    let edges = free_edges(scene);
    let tolerance = frame.slack.max(TOUCHING * frame.largest);
    let place = |vertex: u32| scene.vertices[vertex as usize];
    let boxes = edges.iter().map(|edge| {
        let [a, b] = edge.ends.map(place);
        (a.min(b) - tolerance, a.max(b) + tolerance)
    });
    let tree = BoxTree::new(boxes.collect());
    let mut ends: Vec<u32> = edges.iter().flat_map(|edge| edge.ends).collect();
    ends.sort_unstable();
    ends.dedup();
    let mut hanging: Vec<Vec<(f64, u32)>> = vec![Vec::new(); edges.len()];
    for vertex in ends {
        let point = place(vertex);
        tree.overlapping((point, point), &mut |k| {
            let [a, b] = edges[k as usize].ends.map(place);
            let along = b - a;
            let t = along.dot(point - a) / along.length_squared();
            let tolerance = tolerance.min(MAX_OF_EDGE * along.length());
            let is_apart = point.distance(a) > tolerance && point.distance(b) > tolerance;
            if t > 0.0 && t < 1.0 && is_apart && point.distance(a + t * along) <= tolerance {
                hanging[k as usize].push((t, vertex));
            }
        });
    }
    let with_vertices = edges.iter().zip(hanging).filter(|(_, here)| !here.is_empty());
    with_vertices.flat_map(|(edge, here)| edge.seals(scene, here)).collect()
}

/// An edge that no other face has.
struct FreeEdge {
    face: FaceId,
    edge: usize,
    ends: [u32; 2],
}

impl FreeEdge {
    /// Returns the triangles between the edge and the vertices on it.
    fn seals(&self, scene: &Scene, mut hanging: Vec<(f64, u32)>) -> Vec<Seal> {
        hanging.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut last = (0.0, self.ends[0]);
        let seal = |next: (f64, u32)| {
            let seal = Seal {
                corners: [last.1, next.1, self.ends[1]],
                face: self.face,
                edge: self.edge,
                along: [last.0, next.0, 1.0],
                normal: scene.area_vector(self.face),
                is_quad: scene.faces[self.face.0 as usize].corners.as_slice().len() == 4,
            };
            last = next;
            seal
        };
        hanging.into_iter().map(seal).collect()
    }
}

fn free_edges(scene: &Scene) -> Vec<FreeEdge> {
    let mut users: HashMap<[u32; 2], u32> = HashMap::new();
    let mut all = Vec::new();
    for face in scene.face_ids() {
        let corners = scene.faces[face.0 as usize].corners;
        let corners = corners.as_slice();
        for (edge, &from) in corners.iter().enumerate() {
            let ends = [from, corners[(edge + 1) % corners.len()]];
            *users.entry([ends[0].min(ends[1]), ends[0].max(ends[1])]).or_insert(0) += 1;
            all.push(FreeEdge { face, edge, ends });
        }
    }
    all.retain(|edge| users[&[edge.ends[0].min(edge.ends[1]), edge.ends[0].max(edge.ends[1])]] == 1);
    all
}

impl Seal {
    /// Returns the local coordinates, on the face, of those on the seal.
    fn on_face(&self, u: f64, v: f64) -> [f64; 2] {
        let [a, b, c] = self.along;
        let s = (a + u * (b - a) + v * (c - a)).clamp(0.0, 1.0);
        match (self.edge, self.is_quad) {
            (0, _) => [s, 0.0],
            (1, false) => [1.0 - s, s],
            (1, true) => [1.0, s],
            (2, true) => [1.0 - s, 1.0],
            _ => [0.0, 1.0 - s],
        }
    }
}

/// Makes hits of seals, which are numbered after the faces, hits of their faces.
pub(super) fn replace(seals: &[Seal], n_faces: usize, rays: &RayBatch, hits: &mut HitBatch) {
    if seals.is_empty() {
        return;
    }
    for k in 0..hits.face_and_side.len() {
        let Some(hit) = hits.face(k) else { continue };
        let Some(seal) = (hit.face.0 as usize).checked_sub(n_faces).map(|number| &seals[number]) else {
            continue;
        };
        let direction = DVec3::from(std::array::from_fn(|axis| f64::from(rays.direction[axis][k])));
        let is_back = direction.dot(seal.normal) > 0.0;
        hits.face_and_side[k] = 2 * seal.face.0 + u32::from(is_back);
        let [u, v] = seal.on_face(f64::from(hits.u[k]), f64::from(hits.v[k]));
        hits.u[k] = to_f32(u);
        hits.v[k] = to_f32(v);
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::{DQuat, EulerRot};

    use super::*;
    use crate::embree::Device;
    use crate::scene::{Corners, Face, Material, MaterialId, Surface, SurfaceId};
    use crate::visibility::embree::EmbreeVisibility;
    use crate::visibility::{Coherence, Visibility as _};

    /// A box of 3 m × 2 m × 1 m that is closed, turned and moved, whose long sides are cut into three quads or as many pairs of triangles, in places of their own.
    fn boxed(turn: DQuat, away: DVec3, in_triangles: bool) -> (Scene, Vec<[DVec3; 2]>) {
        let mut vertices: Vec<DVec3> = Vec::new();
        let mut faces = Vec::new();
        let mut add = |corners: [[f64; 3]; 4]| {
            let ids = corners.map(|corner| {
                let place = turn * DVec3::from(corner) + away;
                let known = vertices.iter().position(|other| *other == place);
                u32::try_from(known.unwrap_or_else(|| {
                    vertices.push(place);
                    vertices.len() - 1
                }))
                .unwrap()
            });
            let [a, b, c, d] = ids;
            if in_triangles {
                faces.extend([Corners::Triangle([a, b, c]), Corners::Triangle([a, c, d])]);
            } else {
                faces.push(Corners::Quad(ids));
            }
        };
        add([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 2.0, 1.0], [0.0, 0.0, 1.0]]);
        add([[3.0, 0.0, 0.0], [3.0, 0.0, 1.0], [3.0, 2.0, 1.0], [3.0, 2.0, 0.0]]);
        let mut seams = Vec::new();
        for (cuts, side) in [
            ([0.0, 0.7, 1.9, 3.0], 0),
            ([0.0, 1.1, 2.3, 3.0], 1),
            ([0.0, 0.3, 1.3, 3.0], 2),
            ([0.0, 0.9, 2.7, 3.0], 3),
        ] {
            let across = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]];
            let [from, to] = [across[side], across[(side + 1) % 4]];
            for pair in cuts.windows(2) {
                let [a, b] = [pair[0], pair[1]];
                add([
                    [a, from[0], from[1]],
                    [b, from[0], from[1]],
                    [b, to[0], to[1]],
                    [a, to[0], to[1]],
                ]);
            }
            seams.push([0.0, 3.0].map(|x| turn * DVec3::new(x, from[0], from[1]) + away));
        }
        let face = |corners| Face {
            corners,
            surface: SurfaceId(0),
            material: MaterialId(0),
            line: 0,
        };
        let scene = Scene {
            faces: faces.into_iter().map(face).collect(),
            vertices,
            surfaces: vec![Surface { name: "box".into() }],
            materials: vec![Material {
                name: "grey".into(),
                reflectance: [0.5; 3],
                exitance: [0.0; 3],
            }],
            written: None,
        };
        (scene, seams)
    }

    /// Rays from within a box to points of some lines.
    fn aimed(visibility: &EmbreeVisibility, middle: DVec3, seams: &[[DVec3; 2]]) -> (RayBatch, Vec<DVec3>) {
        let (mut rays, mut aims) = (RayBatch::default(), Vec::new());
        for [from, to] in seams {
            for step in 0..20_000 {
                let at = from.lerp(*to, (f64::from(step) + 0.5) / 20_000.0);
                let eye = middle + 0.3 * (at - middle).cross(DVec3::new(0.3, 0.2, 0.1)).normalize();
                rays.push_ray(eye - visibility.frame_origin(), at - eye);
                aims.push(at);
            }
        }
        (rays, aims)
    }

    /// Rays that aim at the edges along which faces meet in T-junctions all hit a face from within, near where they aim; some escape where nothing fills the slits.
    #[test]
    fn no_ray_slips_through_a_t_junction() {
        let device = Device::new().unwrap();
        let (mut n_sealed, mut n_slipped) = (0, 0);
        for room in 0..12 {
            let turn = DQuat::from_euler(EulerRot::XYZ, 0.3 + f64::from(room), 1.1 * f64::from(room), -2.0);
            let away = DVec3::new(0.3, -7.0, 0.1) * f64::from(room);
            let (scene, seams) = boxed(turn, away, room % 2 == 1);
            let middle = turn * DVec3::new(1.5, 1.0, 0.5) + away;
            let mut hits = HitBatch::default();
            let leaky = EmbreeVisibility::with_seals(&device, &scene, Vec::new()).unwrap();
            let (rays, aims) = aimed(&leaky, middle, &seams);
            leaky.closest_hits(&rays, Coherence::Incoherent, &mut hits);
            n_slipped += (0..aims.len()).filter(|&ray| hits.face(ray).is_none()).count();

            let visibility = EmbreeVisibility::on_device(&device, &scene).unwrap();
            n_sealed += find(&scene, &Frame::of(&scene)).len();
            visibility.closest_hits(&rays, Coherence::Incoherent, &mut hits);
            for (k, aim) in aims.iter().enumerate() {
                let hit = hits.face(k).unwrap_or_else(|| panic!("a ray to {aim} escapes"));
                assert!(!hit.back, "{hit:?}");
                let corners = scene.polygon(hit.face);
                let (u, v) = (f64::from(hits.u[k]), f64::from(hits.v[k]));
                let last = corners[corners.len() - 1];
                let place = corners[0] + u * (corners[1] - corners[0]) + v * (last - corners[0]);
                assert!(place.distance(*aim) < 1e-5, "{place} {aim}");
            }
        }
        assert!(n_sealed >= 12 * 8 && n_slipped > 100, "{n_sealed} {n_slipped}");
    }

    #[test]
    fn a_point_of_a_seal_is_one_of_the_edge() {
        let seal = |edge: usize, is_quad: bool| Seal {
            corners: [0, 1, 2],
            face: FaceId(0),
            edge,
            along: [0.25, 0.5, 1.0],
            normal: DVec3::Z,
            is_quad,
        };
        for (edge, is_quad, expected) in [
            (0, false, [0.5, 0.0]),
            (1, false, [0.5, 0.5]),
            (2, false, [0.0, 0.5]),
            (0, true, [0.5, 0.0]),
            (1, true, [1.0, 0.5]),
            (2, true, [0.5, 1.0]),
            (3, true, [0.0, 0.5]),
        ] {
            assert_eq!(
                seal(edge, is_quad).on_face(1.0, 0.0).map(f64::to_bits),
                expected.map(f64::to_bits),
                "{edge} {is_quad}"
            );
        }
    }
}
