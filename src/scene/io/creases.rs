//! Divides faces of files without surface names into connected pieces between creases.

use glam::DVec3;
use rayon::prelude::*;

use super::polygons::Polygons;
use crate::disjoint_sets::DisjointSets;
use crate::geometry::polygon;

/// The number of faces at one edge beyond which none are joined over it: no proper surface has such an edge.
const MAX_AT_EDGE: usize = 64;

/// Assigns surfaces to all faces: pieces that are connected over edges where normals differ by no more than an angle, in degrees.
///
/// A piece of one face is `faceN`, one of more is `partN`, with N its first face, counted from 1. Faces without an area join nothing. `first` is the first vertex at the place of each.
/// Work: O(n log n) for n corners.
pub(super) fn part(polygons: &mut Polygons, first: &[u32], crease_angle: f64) {
    let least_cosine = crease_angle.to_radians().cos();
    let mut normals = Vec::with_capacity(polygons.faces.len());
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(polygons.corners.len());
    for (face, (_, corners)) in (0_u32..).zip(polygons.outlines()) {
        let outline: Vec<DVec3> = corners.iter().map(|&v| polygons.vertices[v as usize]).collect();
        let normal = if outline.len() < 3 {
            None
        } else {
            polygon::area_vector(&outline).try_normalize()
        };
        normals.push(normal);
        if normal.is_some() {
            let n = corners.len();
            edges.extend((0..n).map(|k| {
                let [a, b] = [corners[k], corners[(k + 1) % n]].map(|v| first[v as usize]);
                ([a.min(b), a.max(b)], face)
            }));
        }
    }
    edges.par_sort_unstable();
    let mut pieces = DisjointSets::new(normals.len());
    for at_edge in edges.chunk_by(|a, b| a.0 == b.0) {
        if at_edge.len() > MAX_AT_EDGE || at_edge[0].0[0] == at_edge[0].0[1] {
            continue;
        }
        for (k, &(_, one)) in at_edge.iter().enumerate() {
            for &(_, other) in &at_edge[k + 1..] {
                let is_smooth = match (normals[one as usize], normals[other as usize]) {
                    // The margin keeps rounding of the cosine from making creases in a plane.
                    (Some(a), Some(b)) => a.dot(b) >= least_cosine - 1e-12,
                    _ => false,
                };
                if is_smooth {
                    pieces.join(one as usize, other as usize);
                }
            }
        }
    }
    drop(edges);
    name(polygons, &mut pieces, &normals);
}

fn name(polygons: &mut Polygons, pieces: &mut DisjointSets, normals: &[Option<DVec3>]) {
    let mut n_faces = vec![0_u32; normals.len()];
    for face in 0..normals.len() {
        n_faces[pieces.find(face)] += 1;
    }
    let mut group_of = vec![0; normals.len()];
    for face in 0..normals.len() {
        let piece = pieces.find(face);
        if piece == face {
            // The first face of a piece stands for it.
            group_of[face] = u32::try_from(polygons.groups.len()).unwrap_or(u32::MAX);
            let kind = if n_faces[face] == 1 { "face" } else { "part" };
            polygons.groups.push(format!("{kind}{}", face + 1));
        }
        polygons.faces[face].group = group_of[piece];
    }
}
