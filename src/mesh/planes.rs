//! Faces that continue each other: flat neighbours across a shared edge.

use std::collections::HashMap;

use glam::DVec3;

use crate::scene::{FaceId, Scene};

/// One edge of one face: the face and the place of the edge's first corner.
pub(super) type FaceEdge = (FaceId, usize);

/// Planes whose unit normals differ by less than this are one.
const BEND: f64 = 1e-9;

/// Pairs of face edges along which two faces of one plane, facing the same way, continue each other.
pub(super) fn flat_joints(scene: &Scene) -> Vec<(FaceEdge, FaceEdge)> {
    flat_joints_by(scene, |vertex| vertex, BEND)
}

/// Returns such pairs where vertices are told apart by a number, and unit normals of one plane differ by less than `most`.
pub(super) fn flat_joints_by(scene: &Scene, number: impl Fn(u32) -> u32, most: f64) -> Vec<(FaceEdge, FaceEdge)> {
    let edge = |v: &[u32], k: usize| (number(v[k]), number(v[(k + 1) % v.len()]));
    // Directed edges: the neighbour on the same side of a plane runs along the edge in the opposite sense.
    let mut by_edge: HashMap<(u32, u32), Vec<FaceEdge>> = HashMap::new();
    for face in scene.face_ids() {
        let corners = scene.faces[face.0 as usize].corners;
        let v = corners.as_slice();
        for k in 0..v.len() {
            by_edge.entry(edge(v, k)).or_default().push((face, k));
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
            let (from, to) = edge(v, k);
            for &other in by_edge.get(&(to, from)).into_iter().flatten() {
                let bend = (normals[face.0 as usize] - normals[other.0.0 as usize]).length();
                if face < other.0 && bend < most {
                    joints.push(((face, k), other));
                }
            }
        }
    }
    joints
}
