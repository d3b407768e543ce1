//! The bare C loop of `bare.c`, which the build script links to benchmarks.
#![expect(unsafe_code, reason = "C is called")]

use std::ptr::NonNull;

use radiosity::visibility::RayBatch;

#[repr(C)]
struct CScene {
    _opaque: [u8; 0],
}

unsafe extern "C" {
    fn bare_scene_new(
        vertices: *const f32,
        n_vertices: usize,
        triangles: *const u32,
        n_triangles: usize,
    ) -> *mut CScene;
    fn bare_scene_free(scene: *mut CScene);
    fn bare_trace(
        scene: *mut CScene,
        origin: *const *const f32,
        direction: *const *const f32,
        n: usize,
        coherent: bool,
        counts: *mut u32,
    );
}

/// A scene of triangles.
pub(crate) struct BareScene {
    handle: NonNull<CScene>,
    n_triangles: usize,
}

// SAFETY: a committed scene is only read, and Embree allows queries from many threads.
unsafe impl Sync for BareScene {}

impl BareScene {
    pub(crate) fn new(vertices: &[[f32; 3]], triangles: &[[u32; 3]]) -> Self {
        assert!(triangles.as_flattened().iter().all(|&v| (v as usize) < vertices.len()));
        // SAFETY: the arrays have the stated lengths, and every corner exists.
        let handle = unsafe {
            bare_scene_new(
                vertices.as_flattened().as_ptr(),
                vertices.len(),
                triangles.as_flattened().as_ptr(),
                triangles.len(),
            )
        };
        Self {
            handle: NonNull::new(handle).expect("Embree builds the scene"),
            n_triangles: triangles.len(),
        }
    }

    /// Traces a batch of rays without an end, and counts the hits of each triangle.
    pub(crate) fn trace(&self, rays: &RayBatch, coherent: bool, counts: &mut [u32]) {
        let n = rays.len();
        assert!(n.is_multiple_of(16) && counts.len() >= self.n_triangles);
        assert!(
            rays.origin
                .iter()
                .chain(&rays.direction)
                .all(|values| values.len() == n)
        );
        let origin = rays.origin.each_ref().map(Vec::as_ptr);
        let direction = rays.direction.each_ref().map(Vec::as_ptr);
        // SAFETY: the scene is valid, there are three arrays of n numbers each, and a count for each triangle.
        unsafe {
            bare_trace(
                self.handle.as_ptr(),
                origin.as_ptr(),
                direction.as_ptr(),
                n,
                coherent,
                counts.as_mut_ptr(),
            );
        }
    }
}

impl Drop for BareScene {
    fn drop(&mut self) {
        // SAFETY: the handle is released once.
        unsafe { bare_scene_free(self.handle.as_ptr()) }
    }
}
