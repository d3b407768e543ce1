//! Faces that continue each other: flat neighbours across a shared edge.

use glam::DVec3;
use rayon::prelude::*;

use crate::geometry::polygon;
use crate::scene::{FaceId, Scene};
use crate::threads;

/// One edge of one face: the face and the number of the edge's first corner.
pub(super) type FaceEdge = (FaceId, usize);

/// The greatest difference of unit normals of one plane.
const BEND: f64 = 1e-9;

/// Pairs of face edges along which two faces of one plane, facing the same way, continue each other.
pub(super) fn flat_joints(scene: &Scene) -> Vec<(FaceEdge, FaceEdge)> {
    flat_joints_by(scene, |vertex| vertex, BEND)
}

/// Returns such pairs where vertices are identified by a number, and unit normals of one plane differ by less than `most`.
pub(super) fn flat_joints_by(scene: &Scene, number: impl Fn(u32) -> u32, most: f64) -> Vec<(FaceEdge, FaceEdge)> {
    // All edges by their ends, whichever way they run; the neighbour on the same side of a plane runs along the edge in the opposite direction.
    let mut edges: Vec<([u32; 2], FaceEdge, bool)> = Vec::with_capacity(4 * scene.faces.len());
    for face in scene.face_ids() {
        let corners = scene.faces[face.0 as usize].corners;
        let v = corners.as_slice();
        for k in 0..v.len() {
            let (from, to) = (number(v[k]), number(v[(k + 1) % v.len()]));
            edges.push(([from.min(to), from.max(to)], (face, k), from < to));
        }
    }
    edges.par_sort_unstable();
    let normals: Vec<DVec3> = threads::collect_from(&scene.faces, |face| {
        polygon::area_vector(&scene.positions(face)).normalize_or_zero()
    });
    let mut joints = Vec::new();
    for at_edge in edges.chunk_by(|a, b| a.0 == b.0) {
        let is_point = at_edge[0].0[0] == at_edge[0].0[1];
        for (k, &(_, one, runs_up)) in at_edge.iter().enumerate() {
            for &(_, other, other_runs_up) in &at_edge[k + 1..] {
                let bend = || (normals[one.0.0 as usize] - normals[other.0.0 as usize]).length();
                if one.0 < other.0 && (is_point || runs_up != other_runs_up) && bend() < most {
                    joints.push((one, other));
                }
            }
        }
    }
    joints.sort_unstable();
    joints
}
