//! Ray queries by brute force in f64, each ray against each face: the oracle that Embree is tested against.

use glam::DVec3;

use crate::scene::Scene;

use super::flat_polygon::FlatPolygon;
use super::frame::Frame;
use super::{Coherence, HitBatch, RayBatch, Visibility, to_f32};

/// Tests each ray of a batch against each face of the scene in f64.
///
/// The rays are those of the batch, that is, rounded to f32; the faces are not rounded. Accuracy: that of f64,
/// a few 1e-16 of the largest coordinate. Cost: O(rays · faces).
/// Departures: none.
#[derive(Clone, Debug)]
pub struct BruteForce {
    frame: Frame,
    faces: Vec<FlatPolygon>,
}

/// One face on the way of a ray.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    face: usize,
    t: f64,
    /// Cosine, times the length of the direction, between ray and normal: positive from behind.
    along: f64,
    point: DVec3,
}

impl BruteForce {
    /// Stores the faces of a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let frame = Frame::of(scene);
        Self {
            frame,
            faces: frame.polygons(scene),
        }
    }

    /// Iterates over the faces that a ray meets up to its end, borders included, in the order of the faces.
    fn crossings(&self, rays: &RayBatch, k: usize) -> impl Iterator<Item = Crossing> + '_ {
        let origin = DVec3::from(rays.origin.each_ref().map(|x| f64::from(x[k])));
        let direction = DVec3::from(rays.direction.each_ref().map(|x| f64::from(x[k])));
        let t_far = f64::from(rays.t_far[k]);
        let finite = origin.is_finite() && direction.is_finite();
        self.faces
            .iter()
            .enumerate()
            .filter(move |_| finite)
            .filter_map(move |(face, polygon)| {
                let along = polygon.normal.dot(direction);
                let t = -polygon.height(origin) / along; // not finite where the ray lies in the plane
                let point = origin + t * direction;
                (t >= 0.0 && t <= t_far && point.is_finite() && polygon.depth(point) >= 0.0).then_some(Crossing {
                    face,
                    t,
                    along,
                    point,
                })
            })
    }

    /// Returns the first face along a ray. Among faces of opposite winding that coincide it is the front-facing one.
    fn first(&self, rays: &RayBatch, k: usize) -> Option<Crossing> {
        let first = self.crossings(rays, k).min_by(|a, b| a.t.total_cmp(&b.t))?;
        if first.along <= 0.0 {
            return Some(first);
        }
        let gap = self.frame.coincident();
        let front = self
            .crossings(rays, k)
            .filter(|c| c.along < 0.0 && (c.t - first.t) * first.along <= gap)
            .find(|c| super::sheets::coincide(&self.faces[first.face], &self.faces[c.face], gap));
        front.or(Some(first))
    }
}

impl Visibility for BruteForce {
    fn frame_origin(&self) -> DVec3 {
        self.frame.origin
    }

    fn offset(&self) -> f64 {
        self.frame.offset()
    }

    fn closest_hits(&self, rays: &RayBatch, _coherence: Coherence, hits: &mut HitBatch) {
        *hits = HitBatch::default();
        for k in 0..rays.len() {
            let (mut code, mut t, mut u, mut v) = (HitBatch::MISS, rays.t_far[k], 0.0, 0.0);
            if let Some(hit) = self.first(rays, k) {
                let (u64, v64) = self.faces[hit.face].local_coordinates(hit.point);
                code = face_code(hit.face, hit.along > 0.0);
                (t, u, v) = (to_f32(hit.t), to_f32(u64), to_f32(v64));
            }
            hits.face_and_side.push(code);
            hits.t.push(t);
            hits.u.push(u);
            hits.v.push(v);
        }
    }

    fn occluded(&self, rays: &RayBatch, _coherence: Coherence, blocked: &mut Vec<bool>) {
        blocked.clear();
        blocked.extend((0..rays.len()).map(|k| self.crossings(rays, k).next().is_some()));
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the number of faces is checked against u32 when a scene is built"
)]
fn face_code(face: usize, back: bool) -> u32 {
    2 * face as u32 + u32::from(back)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::scene::{Corners, Face, MaterialId, SurfaceId};

    fn scene_of(vertices: &[[f64; 3]], faces: &[&[u32]]) -> Scene {
        let corners_of = |indices: &&[u32]| match **indices {
            [a, b, c] => Corners::Triangle([a, b, c]),
            [a, b, c, d] => Corners::Quad([a, b, c, d]),
            _ => panic!("three or four corners"),
        };
        let face = |corners| Face {
            corners,
            surface: SurfaceId(0),
            material: MaterialId(0),
            line: 0,
        };
        Scene {
            vertices: vertices.iter().copied().map(DVec3::from).collect(),
            faces: faces.iter().map(|f| face(corners_of(f))).collect(),
            ..Scene::default()
        }
    }

    /// A unit square at z = 2 that looks down, and above it, at z = 3, a sheet of two triangles and a quad.
    fn square_and_sheet() -> Scene {
        let square = |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]];
        let vertices = [square(2.0), square(3.0)].concat();
        scene_of(&vertices, &[&[3, 2, 1, 0], &[4, 5, 6, 7], &[4, 6, 5], &[4, 7, 6]])
    }

    fn hits_of(visibility: &BruteForce, rays: &[([f64; 3], [f64; 3])]) -> HitBatch {
        let mut batch = RayBatch::default();
        for (origin, direction) in rays {
            batch.push_ray(
                DVec3::from(*origin) - visibility.frame_origin(),
                DVec3::from(*direction),
            );
        }
        let mut hits = HitBatch::default();
        visibility.closest_hits(&batch, Coherence::Incoherent, &mut hits);
        hits
    }

    #[test]
    fn hits_are_where_they_must_be() {
        let visibility = BruteForce::new(&square_and_sheet());
        let up = [0.0, 0.0, 0.5];
        let hits = hits_of(
            &visibility,
            &[
                ([0.25, 0.75, 0.0], up),
                ([2.0, 0.5, 0.0], up),
                ([0.5, 0.5, 2.5], [0.25, 0.0, -0.5]),
            ],
        );
        let front = hits.face(0).unwrap();
        assert!(front.face.0 == 0 && !front.back && (hits.t[0] - 4.0).abs() < 1e-6);
        // The quad begins at the corner (0, 1) and goes on to (1, 1).
        assert!((hits.u[0] - 0.25).abs() < 1e-6 && (hits.v[0] - 0.25).abs() < 1e-6);
        assert!(hits.face(1).is_none() && hits.t[1].is_infinite());
        let behind = hits.face(2).unwrap();
        assert!(behind.face.0 == 0 && behind.back && (hits.t[2] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_front_of_a_sheet_is_what_counts() {
        let visibility = BruteForce::new(&square_and_sheet());
        let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
        let hits = hits_of(
            &visibility,
            &[
                ([0.75, 0.25, 2.5], up),
                ([0.25, 0.75, 2.5], up),
                ([0.25, 0.75, 3.5], down),
            ],
        );
        let faces: Vec<_> = (0..3).map(|k| hits.face(k).unwrap()).collect();
        assert_eq!(faces.iter().map(|hit| hit.face.0).collect::<Vec<_>>(), [2, 3, 1]);
        assert!(faces.iter().all(|hit| !hit.back));
    }

    #[test]
    fn segments_end_at_t_far() {
        let visibility = BruteForce::new(&square_and_sheet());
        let mut batch = RayBatch::default();
        for z in [1.9, 2.1] {
            let (from, to) = (DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.5, 0.5, z));
            batch.push_segment(from - visibility.frame_origin(), to - visibility.frame_origin());
        }
        let mut blocked = Vec::new();
        visibility.occluded(&batch, Coherence::Coherent, &mut blocked);
        assert_eq!(blocked, [false, true]);
    }

    #[test]
    fn a_scene_without_faces_stops_nothing() {
        let visibility = BruteForce::new(&Scene::default());
        let hits = hits_of(&visibility, &[([0.0; 3], [1.0, 2.0, 3.0])]);
        assert_eq!(hits.face_and_side, [HitBatch::MISS]);
        assert!(visibility.offset().abs() < f64::MIN_POSITIVE);
    }
}
