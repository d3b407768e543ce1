//! Scenes of triangles and quads: gathered first, then committed, and only then queried.

use std::ptr::NonNull;

use super::device::Device;
use super::error::EmbreeError;
use super::ffi;

/// The coordinate from which on Embree drops a face without a message.
const LARGEST_COORDINATE: f32 = 1.8e18;

/// A face code is 2 · face + side, and the largest code means a miss.
const LARGEST_FACE: u32 = (u32::MAX >> 1) - 1;

const _: () = assert!(2 * LARGEST_FACE + 1 < ffi::RADIOSITY_MISS);

/// Gathers the faces of a scene; [`SceneBuilder::commit`] makes it ready for queries.
#[derive(Clone, Debug)]
pub struct SceneBuilder {
    vertices: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    faces_of_triangles: Vec<u32>,
    quads: Vec<[u32; 4]>,
    faces_of_quads: Vec<u32>,
}

/// A scene that answers queries from many threads at once: [`CommittedScene::closest_hits`] and [`CommittedScene::occluded`].
#[derive(Debug)]
pub struct CommittedScene {
    handle: NonNull<ffi::radiosity_scene>,
}

// SAFETY: after the commit neither the Embree scene nor the table of faces changes, and both may be freed on any thread.
unsafe impl Send for CommittedScene {}
// SAFETY: queries only read the scene; Embree allows them from many threads at once.
unsafe impl Sync for CommittedScene {}

impl SceneBuilder {
    /// Begins a scene with the vertices that its faces share.
    ///
    /// Faces that name the same vertex share it bit for bit, which keeps their common edge tight.
    ///
    /// # Errors
    ///
    /// [`EmbreeError::VertexOutOfRange`] and [`EmbreeError::TooMany`].
    pub fn new(vertices: Vec<[f32; 3]>) -> Result<Self, EmbreeError> {
        check_count("vertices", vertices.len() as u64, u64::from(u32::MAX))?;
        // The comparison is false for NaN.
        let bad = |position: &[f32; 3]| !position.iter().all(|x| x.abs() < LARGEST_COORDINATE);
        if let Some(vertex) = vertices.iter().position(bad) {
            let position = vertices[vertex];
            return Err(EmbreeError::VertexOutOfRange { vertex, position });
        }
        Ok(Self {
            vertices,
            triangles: Vec::new(),
            faces_of_triangles: Vec::new(),
            quads: Vec::new(),
            faces_of_quads: Vec::new(),
        })
    }

    /// Adds a triangle; hits on it report `face`.
    ///
    /// # Errors
    ///
    /// [`EmbreeError::IndexOutOfRange`], and [`EmbreeError::TooMany`] for a face id from 2³¹ − 1 on.
    pub fn triangle(&mut self, corners: [u32; 3], face: u32) -> Result<(), EmbreeError> {
        self.check(&corners, face)?;
        self.triangles.push(corners);
        self.faces_of_triangles.push(face);
        Ok(())
    }

    /// Adds a planar convex quad; hits on it report `face`. Embree sees two triangles that meet in the edge from the second corner to the fourth.
    ///
    /// # Errors
    ///
    /// As [`SceneBuilder::triangle`].
    pub fn quad(&mut self, corners: [u32; 4], face: u32) -> Result<(), EmbreeError> {
        self.check(&corners, face)?;
        self.quads.push(corners);
        self.faces_of_quads.push(face);
        Ok(())
    }

    /// Builds the scene: ROBUST, with high build quality, by one thread.
    ///
    /// # Errors
    ///
    /// [`EmbreeError::OutOfMemory`], [`EmbreeError::TooMany`], or an error of Embree.
    pub fn commit(self, device: &Device) -> Result<CommittedScene, EmbreeError> {
        self.commit_for_packets(device, device.packet_width())
    }

    /// Builds the scene for queries in packets of 16, 8 or 4 rays, or one by one.
    pub(super) fn commit_for_packets(self, device: &Device, width: u32) -> Result<CommittedScene, EmbreeError> {
        let Self {
            vertices,
            triangles,
            faces_of_triangles: mut faces,
            quads,
            faces_of_quads,
        } = self;
        faces.extend(faces_of_quads);
        check_count("triangles and quads", faces.len() as u64, u64::from(LARGEST_FACE) + 1)?;
        let mesh = ffi::radiosity_mesh {
            vertices: vertices.as_flattened().as_ptr(),
            n_vertices: vertices.len(),
            triangles: triangles.as_flattened().as_ptr(),
            n_triangles: triangles.len(),
            quads: quads.as_flattened().as_ptr(),
            n_quads: quads.len(),
            faces: faces.as_ptr(),
        };
        let mut error = ffi::radiosity_error::NONE;
        // SAFETY: the device lives; `mesh` describes arrays that live through the call, which copies them; every corner is
        // below n_vertices and every face below 2³¹ − 1, checked when it was added.
        let handle =
            unsafe { ffi::radiosity_scene_new(device.handle().as_ptr(), &raw const mesh, width, &raw mut error) };
        let scene = NonNull::new(handle).map(|handle| CommittedScene { handle });
        error.check()?;
        scene.ok_or(EmbreeError::Failed {
            code: 0,
            message: "no scene".into(),
        })
    }

    fn check(&self, corners: &[u32], face: u32) -> Result<(), EmbreeError> {
        let n_vertices = self.vertices.len();
        check_count("faces", u64::from(face) + 1, u64::from(LARGEST_FACE) + 1)?;
        match corners.iter().find(|&&index| index as usize >= n_vertices) {
            Some(&index) => Err(EmbreeError::IndexOutOfRange {
                face,
                index,
                n_vertices,
            }),
            None => Ok(()),
        }
    }
}

impl CommittedScene {
    pub(super) fn handle(&self) -> NonNull<ffi::radiosity_scene> {
        self.handle
    }
}

impl Drop for CommittedScene {
    fn drop(&mut self) {
        // SAFETY: the handle came from radiosity_scene_new and is released only here.
        unsafe { ffi::radiosity_scene_free(self.handle.as_ptr()) }
    }
}

fn check_count(what: &'static str, n: u64, limit: u64) -> Result<(), EmbreeError> {
    if n > limit {
        return Err(EmbreeError::TooMany { what, n, limit });
    }
    Ok(())
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn unit_triangle() -> Vec<[f32; 3]> {
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    }

    #[test]
    fn a_corner_that_does_not_exist_is_an_error() {
        let mut builder = SceneBuilder::new(unit_triangle()).unwrap();
        let error = builder.quad([0, 1, 3, 2], 7).unwrap_err();
        assert!(matches!(
            error,
            EmbreeError::IndexOutOfRange {
                face: 7,
                index: 3,
                n_vertices: 3
            }
        ));
    }

    #[test]
    fn vertices_that_embree_would_drop_are_errors() {
        for bad in [f32::NAN, f32::INFINITY, -2.0e18] {
            let mut vertices = unit_triangle();
            vertices[1][2] = bad;
            let error = SceneBuilder::new(vertices).unwrap_err();
            assert!(
                matches!(error, EmbreeError::VertexOutOfRange { vertex: 1, .. }),
                "{error:?}"
            );
        }
    }

    #[test]
    fn the_face_whose_code_would_mean_a_miss_is_an_error() {
        let mut builder = SceneBuilder::new(unit_triangle()).unwrap();
        builder.triangle([0, 1, 2], LARGEST_FACE).unwrap();
        let error = builder.triangle([0, 1, 2], LARGEST_FACE + 1).unwrap_err();
        assert!(matches!(error, EmbreeError::TooMany { .. }), "{error:?}");
    }

    #[test]
    fn a_device_may_go_before_its_scene() {
        let device = Device::new().unwrap();
        let mut builder = SceneBuilder::new(unit_triangle()).unwrap();
        builder.triangle([0, 1, 2], 0).unwrap();
        let scene = builder.commit(&device).unwrap();
        drop(device);
        drop(scene);
    }
}
