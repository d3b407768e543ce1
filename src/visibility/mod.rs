//! Visibility: batches of rays against the faces of a scene.

pub mod brute_force;
pub mod embree;
pub mod facing;
mod flat_polygon;
mod frame;
pub mod gaps;
pub mod leaks;
pub mod occluders;
pub(crate) mod plane;
pub(crate) mod shaft;
mod sheets;

use glam::DVec3;

use crate::geometry::sampling::{Frame, PointStream, cosine_direction};
use crate::scene::FaceId;

/// Whether neighbouring rays of a batch go nearly the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Bundles: rays that share an origin or a direction, such as primary rays and patch-to-patch segments.
    Coherent,
    /// Random directions, such as cosine-distributed rays.
    Incoherent,
}

/// A batch of rays as a structure of arrays, in f32 and in the frame of one [`Visibility`] (its [`frame_origin`](Visibility::frame_origin) subtracted).
///
/// A point of a ray is o + t d with 0 ≤ t ≤ `t_far`: infinity for a ray, 1 for a segment whose direction is the difference of its ends.
#[derive(Clone, Debug, Default)]
pub struct RayBatch {
    /// Origins, one array per axis.
    pub origin: [Vec<f32>; 3],
    /// Directions, one array per axis; they need not be unit vectors.
    pub direction: [Vec<f32>; 3],
    /// The end of each ray in units of its direction.
    pub t_far: Vec<f32>,
}

/// The hits of a closest-hit query, as a structure of arrays.
#[derive(Clone, Debug, Default)]
pub struct HitBatch {
    /// Face and side; see [`HitBatch::face`]. [`HitBatch::MISS`] where nothing was hit.
    pub face_and_side: Vec<u32>,
    /// Distance in units of the direction; unspecified after a miss.
    pub t: Vec<f32>,
    /// First local coordinate of the hit (see [`Visibility::closest_hits`]).
    pub u: Vec<f32>,
    /// Second local coordinate of the hit.
    pub v: Vec<f32>,
}

/// A face seen from its front or from its back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FaceHit {
    /// The face.
    pub face: FaceId,
    /// True where the ray came from behind: a back face is black.
    pub back: bool,
}

impl HitBatch {
    /// The entry of [`HitBatch::face_and_side`] for a ray that hits nothing.
    pub const MISS: u32 = u32::MAX;

    /// Returns the face that ray `k` hits first, or `None`. Encoding: 2 · face + (1 if from behind).
    #[must_use]
    pub fn face(&self, k: usize) -> Option<FaceHit> {
        let code = self.face_and_side[k];
        (code != Self::MISS).then_some(FaceHit {
            face: FaceId(code >> 1),
            back: code & 1 == 1,
        })
    }
}

/// Answers ray queries against the faces of one scene.
pub trait Visibility: Send + Sync {
    /// Returns the point that is subtracted from world coordinates before they are rounded to f32.
    fn frame_origin(&self) -> DVec3;

    /// Returns the distance, in m, by which the ends of rays are moved along their inward normals so that a patch does not shadow itself.
    fn offset(&self) -> f64;

    /// Finds the first face along each ray; `hits` is resized to the batch.
    ///
    /// Local coordinates: on a triangle v0 v1 v2 the point is v0 + u (v1 − v0) + v (v2 − v0). On a quad v0 v1 v2 v3
    /// it is v0 + u (v1 − v0) + v (v3 − v0) where u + v ≤ 1 and v2 + (1 − u)(v3 − v2) + (1 − v)(v1 − v2) elsewhere,
    /// which for a parallelogram is the same map.
    /// Where two faces of opposite winding coincide, the one that faces the ray's origin is reported.
    fn closest_hits(&self, rays: &RayBatch, coherence: Coherence, hits: &mut HitBatch);

    /// As [`closest_hits`](Self::closest_hits) for rays that start in front of the face `own`, which none of them can meet from behind.
    ///
    /// In f32 the plane of a needle may be off by more than rays start from it. Those that seem to meet its back continue behind that place.
    fn closest_hits_from(&self, own: FaceId, rays: &RayBatch, coherence: Coherence, hits: &mut HitBatch) {
        self.closest_hits(rays, coherence, hits);
        let own_back = Some(FaceHit { face: own, back: true });
        let stopped: Vec<usize> = (0..rays.len()).filter(|&k| hits.face(k) == own_back).collect();
        if stopped.is_empty() {
            return;
        }
        let (mut rest, mut found) = (RayBatch::default(), HitBatch::default());
        for &k in &stopped {
            let [origin, direction] =
                [&rays.origin, &rays.direction].map(|of| DVec3::from_array(of.each_ref().map(|x| f64::from(x[k]))));
            let reached = f64::from(hits.t[k]) + self.offset() / direction.length();
            rest.push_ray(origin + reached * direction, direction);
        }
        self.closest_hits(&rest, Coherence::Incoherent, &mut found);
        for (k, &ray) in stopped.iter().enumerate() {
            // One that still seems to meet its own face leaves it, at least.
            hits.face_and_side[ray] = if found.face(k) == own_back {
                HitBatch::MISS
            } else {
                found.face_and_side[k]
            };
            (hits.t[ray], hits.u[ray], hits.v[ray]) = (hits.t[ray] + found.t[k], found.u[k], found.v[k]);
        }
    }

    /// Returns for each ray whether any face lies between its origin and `t_far`; `blocked` is resized to the batch.
    fn occluded(&self, rays: &RayBatch, coherence: Coherence, blocked: &mut Vec<bool>);
}

impl RayBatch {
    /// Returns the number of rays.
    #[must_use]
    pub fn len(&self) -> usize {
        self.t_far.len()
    }

    /// Returns true if there is no ray.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.t_far.is_empty()
    }

    /// Removes all rays and keeps the memory.
    pub fn clear(&mut self) {
        self.origin.iter_mut().for_each(Vec::clear);
        self.direction.iter_mut().for_each(Vec::clear);
        self.t_far.clear();
    }

    /// Adds a ray without an end. `origin` is in the frame (world minus [`Visibility::frame_origin`]), both are rounded to f32 here.
    pub fn push_ray(&mut self, origin: DVec3, direction: DVec3) {
        self.push(origin, direction, f32::INFINITY);
    }

    /// Adds rays without an end from one origin, with the density cos θ / π about the normal of `frame`.
    ///
    /// Each has the direction of the next point of `numbers`. `origin` is in the frame of the visibility.
    pub fn push_cosine_rays(&mut self, origin: DVec3, frame: &Frame, numbers: &mut PointStream, n: u32) {
        for _ in 0..n {
            let [u, v, ..] = numbers.next_point();
            self.push_ray(origin, frame.to_world(cosine_direction(u, v)));
        }
    }

    /// Adds the segment from `from` to `to`, both in the frame; the direction is computed in f64.
    pub fn push_segment(&mut self, from: DVec3, to: DVec3) {
        self.push(from, to - from, 1.0);
    }

    fn push(&mut self, origin: DVec3, direction: DVec3, t_far: f32) {
        let (o, d) = (origin.as_vec3(), direction.as_vec3());
        for axis in 0..3 {
            self.origin[axis].push(o[axis]);
            self.direction[axis].push(d[axis]);
        }
        self.t_far.push(t_far);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is what is wanted")]
fn to_f32(x: f64) -> f32 {
    x as f32
}
