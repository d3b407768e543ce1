//! Rays from one patch, counted by where they end.

use glam::DVec3;

use super::Input;
use crate::geometry::sampling::{Frame, PointStream, Sequence, UniformOnPolygon, cosine_direction};
use crate::mesh::PatchId;
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// The fate of the rays of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Probe {
    pub(super) n_rays: u64,
    /// Rays that hit nothing.
    pub(super) n_escaped: u64,
    /// Rays that hit a back face.
    pub(super) n_absorbed: u64,
    /// The point where the first ray that hit nothing leaves the box around the scene, m.
    pub(super) exit: DVec3,
}

/// The seed of all points, so that another run finds the same.
const SEED: u64 = 0x5eed;

impl Probe {
    /// Returns the buffers of [`shoot`](Self::shoot).
    pub(super) fn buffers() -> (RayBatch, HitBatch) {
        (RayBatch::default(), HitBatch::default())
    }

    /// Shoots rays from points spread over patch `i`, cosine-distributed.
    pub(super) fn shoot(input: Input<'_>, i: usize, n_rays: usize, (rays, hits): &mut (RayBatch, HitBatch)) -> Self {
        let visibility = input.visibility;
        let normal = input.mesh.patches[i].normal;
        let place = UniformOnPolygon::new(&input.mesh.polygon(PatchId::from_index(i)));
        let frame = Frame::from_normal(normal);
        let start = normal * visibility.offset() - visibility.frame_origin();
        let mut points = PointStream::new(Sequence::Sobol, SEED, i as u64);
        rays.clear();
        for _ in 0..n_rays {
            let [u, v, s, t] = points.next_point();
            rays.push_ray(place.point(u, v) + start, frame.to_world(cosine_direction(s, t)));
        }
        visibility.closest_hits_from(input.mesh.patches[i].face, rays, Coherence::Incoherent, hits);
        let mut probe = Self {
            n_rays: n_rays as u64,
            n_escaped: 0,
            n_absorbed: 0,
            exit: input.mesh.patches[i].centroid,
        };
        for k in 0..n_rays {
            match hits.face(k) {
                None => {
                    if probe.n_escaped == 0 {
                        let of_ray = |axes: &[Vec<f32>; 3]| DVec3::from(axes.each_ref().map(|x| f64::from(x[k])));
                        let origin = of_ray(&rays.origin) + visibility.frame_origin();
                        probe.exit = leaves(input.scene.bounding_box(), origin, of_ray(&rays.direction));
                    }
                    probe.n_escaped += 1;
                }
                Some(hit) => probe.n_absorbed += u64::from(hit.back),
            }
        }
        probe
    }
}

/// Returns the point where a ray from inside a box leaves it.
fn leaves((low, high): (DVec3, DVec3), origin: DVec3, direction: DVec3) -> DVec3 {
    let sides = [low, high].map(|side| (side - origin) / direction);
    let along = sides[0].max(sides[1]).to_array().into_iter();
    let t = along
        .filter(|t| t.is_finite() && *t >= 0.0)
        .fold(f64::INFINITY, f64::min);
    if t.is_finite() { origin + t * direction } else { origin }
}
