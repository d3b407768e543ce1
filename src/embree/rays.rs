//! Batched queries: one call into C for all rays of a batch.

use crate::visibility::{Coherence, HitBatch, RayBatch};

use super::ffi;
use super::scene::CommittedScene;

const _: () = assert!(
    ffi::RADIOSITY_MISS == HitBatch::MISS,
    "both sides of the bindings mean the same by a miss"
);

impl CommittedScene {
    /// Finds the first face along each ray, as [`Visibility::closest_hits`](crate::visibility::Visibility::closest_hits) says, but for coincident faces: there, either may be reported.
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

    /// Tells for each ray whether any face lies between its origin and its end.
    ///
    /// A ray with a coordinate that is not finite is not blocked.
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
