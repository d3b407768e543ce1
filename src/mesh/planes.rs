//! Faces that continue each other: flat neighbours across a shared edge.

use std::collections::HashMap;

use glam::DVec3;

use crate::scene::{FaceId, Scene};

/// One edge of one face: the face and the place of the edge's first corner.
pub(super) type FaceEdge = (FaceId, usize);

/// Pairs of face edges along which two faces of one plane, facing the same way, continue each other.
pub(super) fn flat_joints(scene: &Scene) -> Vec<(FaceEdge, FaceEdge)> {
    // Directed edges: the neighbour on the same side of a plane runs along the edge in the opposite sense.
    let mut by_edge: HashMap<(u32, u32), Vec<FaceEdge>> = HashMap::new();
    for face in scene.face_ids() {
        let corners = scene.faces[face.0 as usize].corners;
        let v = corners.as_slice();
        for k in 0..v.len() {
            by_edge.entry((v[k], v[(k + 1) % v.len()])).or_default().push((face, k));
        }
    }
    let normals: Vec<DVec3> = scene
        .face_ids()
        .map(|f| scene.area_vector(f).normalize_or_zero())
        .collect();
    let mut joints = Vec::new();
    for face in scene.face_ids() {
        let corners = scene.faces[face.0 as usize].corners;
        let v = corners.as_slice();
        for k in 0..v.len() {
            for &other in by_edge.get(&(v[(k + 1) % v.len()], v[k])).into_iter().flatten() {
                let bend = (normals[face.0 as usize] - normals[other.0.0 as usize]).length();
                if face < other.0 && bend < 1e-9 {
                    joints.push(((face, k), other));
                }
            }
        }
    }
    joints
}
