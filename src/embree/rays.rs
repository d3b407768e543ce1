//! Batched queries: one call into C for all rays of a batch.

use crate::visibility::{Coherence, HitBatch, RayBatch};

use super::ffi;
use super::scene::CommittedScene;

const _: () = assert!(
    ffi::RADIOSITY_MISS == HitBatch::MISS,
    "both sides of the bindings mean the same by a miss"
);

impl CommittedScene {
    /// Finds the first face along each ray, as [`Visibility::closest_hits`](crate::visibility::Visibility::closest_hits) does, but reports either of two coincident faces.
    ///
    /// A ray with a coordinate that is not finite hits nothing. After a miss, `t` is the ray's end, `u` and `v` are 0.
    /// Equal batches give equal answers. Which of two faces wins on their common edge may depend on the ray's neighbours
    /// in the batch: work that must not depend on the number of threads is cut into batches by its size alone.
    ///
    /// # Panics
    ///
    /// If the arrays of `rays` differ in length.
    #[track_caller]
    pub fn closest_hits(&self, rays: &RayBatch, coherence: Coherence, hits: &mut HitBatch) {
        let n = rays.len();
        hits.face_and_side.resize(n, HitBatch::MISS);
        for values in [&mut hits.t, &mut hits.u, &mut hits.v] {
            values.resize(n, 0.0);
        }
        let from = arrays(rays);
        let to = ffi::radiosity_hits {
            face_and_side: hits.face_and_side.as_mut_ptr(),
            t: hits.t.as_mut_ptr(),
            u: hits.u.as_mut_ptr(),
            v: hits.v.as_mut_ptr(),
        };
        // SAFETY: the scene lives; `from` points at n floats in each array, checked by `arrays`, and `to` at room for n
        // values each, made by `resize` above.
        unsafe {
            ffi::radiosity_closest_hits(
                self.handle().as_ptr(),
                &raw const from,
                is_coherent(coherence),
                &raw const to,
            );
        }
    }

    /// Returns for each ray whether any face lies between its origin and its end.
    ///
    /// A ray with a coordinate that is not finite is not occluded.
    ///
    /// # Panics
    ///
    /// If the arrays of `rays` differ in length.
    #[track_caller]
    pub fn occluded(&self, rays: &RayBatch, coherence: Coherence, blocked: &mut Vec<bool>) {
        blocked.resize(rays.len(), false);
        let from = arrays(rays);
        // SAFETY: as above; the C side writes n values of C's bool, which is Rust's.
        unsafe {
            ffi::radiosity_occluded(
                self.handle().as_ptr(),
                &raw const from,
                is_coherent(coherence),
                blocked.as_mut_ptr(),
            );
        }
    }
}

fn is_coherent(coherence: Coherence) -> bool {
    coherence == Coherence::Coherent
}

#[track_caller]
fn arrays(rays: &RayBatch) -> ffi::radiosity_rays {
    let n = rays.len();
    for axis in 0..3 {
        assert_eq!(rays.origin[axis].len(), n, "origins and ends of rays differ in number");
        assert_eq!(
            rays.direction[axis].len(),
            n,
            "directions and ends of rays differ in number"
        );
    }
    ffi::radiosity_rays {
        origin: rays.origin.each_ref().map(Vec::as_ptr),
        direction: rays.direction.each_ref().map(Vec::as_ptr),
        t_far: rays.t_far.as_ptr(),
        n,
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::embree::{Device, SceneBuilder};

    /// Triangles and quads, each in its own plane, that face up and down by turns: n × n of them over the unit square.
    fn scales(n: u16, device: &Device, packet_width: u32) -> CommittedScene {
        let mut vertices = Vec::new();
        let mut corners = Vec::new();
        for cell in 0..n * n {
            let (x, y) = (f32::from(cell % n), f32::from(cell / n));
            let slope = f32::from(cell % 7) / 10.0;
            let first = u32::try_from(vertices.len()).unwrap();
            for (dx, dy) in [(0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9)] {
                vertices.push([(x + dx) / f32::from(n), (y + dy) / f32::from(n), slope * (dx - dy)]);
            }
            corners.push([0, 1, 2, 3].map(|k| first + if cell % 2 == 0 { k } else { 3 - k }));
        }
        let mut builder = SceneBuilder::new(vertices).unwrap();
        for (face, &[a, b, c, d]) in (0..).zip(&corners) {
            if face % 3 == 0 {
                builder.triangle([a, b, c], face).unwrap();
            } else {
                builder.quad([a, b, c, d], face).unwrap();
            }
        }
        builder.commit_for_packets(device, packet_width).unwrap()
    }

    /// Rays from a grid of points above the unit square; every seventh is a segment that ends too early.
    fn grid_of_rays(n: u16) -> RayBatch {
        let mut rays = RayBatch::default();
        for k in 0..n * n {
            let [x, y] = [k % n, k / n].map(|i| (f64::from(i) + 0.5) / f64::from(n));
            let origin = DVec3::new(0.5, 0.5, if k % 2 == 0 { 3.0 } else { -3.0 });
            let target = DVec3::new(x, y, 0.0);
            if k % 7 == 0 {
                rays.push_segment(origin, origin.lerp(target, 0.75));
            } else {
                rays.push_ray(origin, target - origin);
            }
        }
        rays
    }

    #[test]
    fn packets_of_all_widths_and_single_rays_give_the_same_answers() {
        let device = Device::new().unwrap();
        // 199² rays fill no packet to the end.
        let rays = grid_of_rays(199);
        let answers = |packet_width: u32| {
            let scene = scales(30, &device, packet_width);
            let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
            scene.closest_hits(&rays, Coherence::Coherent, &mut hits);
            scene.occluded(&rays, Coherence::Coherent, &mut blocked);
            (hits, blocked)
        };
        let (alone, alone_blocked) = answers(1);
        let n_backs = (0..rays.len())
            .filter_map(|k| alone.face(k))
            .filter(|hit| hit.back)
            .count();
        let n_hits = (0..rays.len()).filter_map(|k| alone.face(k)).count();
        assert!(n_hits > 10_000 && n_hits < 30_000 && n_backs > n_hits / 4 && n_backs < n_hits * 3 / 4);
        for packet_width in [4, 8, 16] {
            let (hits, blocked) = answers(packet_width);
            assert_eq!(hits.face_and_side, alone.face_and_side, "packets of {packet_width}");
            assert_eq!(blocked, alone_blocked, "packets of {packet_width}");
            for (values, expected) in [(&hits.t, &alone.t), (&hits.u, &alone.u), (&hits.v, &alone.v)] {
                // The t of a miss is infinite, and must be in both.
                let differ = values.iter().zip(expected).filter(|(a, b)| a.to_bits() != b.to_bits());
                for (a, b) in differ {
                    assert!((a - b).abs() < 1e-5, "packets of {packet_width}: {a}, alone: {b}");
                }
            }
        }
    }
}
