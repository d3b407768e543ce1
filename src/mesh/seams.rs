//! T-junctions, where patches of one plane meet along a line without sharing all vertices on it.
//!
//! Faces that share an edge are cut alike, and their patches share vertices. Where a long edge runs beside several short ones, or patches have moved side by
//! side, they do not, and values interpolated on either side would differ: a seam. Here the vertices that hang on a patch's edge become corners of its outline for
//! interpolation, and vertices in one place become one. Both sides are then linear between the same points with the same values.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

/// The part of the longer of two edges within which points are one, and lines too: far more than rounding, far less than a patch.
pub(super) const SLACK: f64 = 1e-9;

/// The T-junctions for interpolation; empty for most meshes.
#[derive(Clone, Debug, Default)]
pub(super) struct Seams {
    /// The vertex that represents each vertex in the same place as another.
    pub(super) same: HashMap<u32, u32>,
    /// The outlines of patches with more vertices than corners, counter-clockwise.
    pub(super) outlines: BTreeMap<u32, Vec<u32>>,
}

impl Seams {
    /// Returns the vertex that represents a vertex.
    pub(super) fn of(&self, vertex: u32) -> u32 {
        self.same.get(&vertex).copied().unwrap_or(vertex)
    }
}

/// Calls `visit(k, weight)` with the mean value coordinates of a point of a convex polygon, which may have straight corners.
///
/// w_k = (tan(α_{k−1}/2) + tan(α_k/2)) / |v_k − x|, divided by their sum, where α_k is the angle at x between v_k and v_{k+1}: positive inside, linear along the
/// edges, and exact for linear functions. On an edge, and within 1e-9 of the polygon's size of it, the weights are those of the edge.
///
/// Source: [`FLOATER_2003`](crate::references::FLOATER_2003), Proposition 1. Departures: the tangents from sines and cosines, the limit on edges.
pub(crate) fn mean_value_weights(outline: &[DVec3], x: DVec3, mut visit: impl FnMut(usize, f64)) {
    let n = outline.len();
    let size = outline.iter().map(|v| v.distance(outline[0])).fold(0.0, f64::max);
    for k in 0..n {
        let (a, b) = (outline[k], outline[(k + 1) % n]);
        let along = b - a;
        let t = (along.dot(x - a) / along.length_squared()).clamp(0.0, 1.0);
        if x.distance(a + t * along) <= SLACK * size {
            visit(k, 1.0 - t);
            visit((k + 1) % n, t);
            return;
        }
    }
    // tan(α/2) = sin α / (1 + cos α) = (1 − cos α) / sin α: without a difference of nearly equal numbers, as there would be near an edge, where α nears π.
    let half_tangent = |k: usize| {
        let (a, b) = (outline[k % n] - x, outline[(k + 1) % n] - x);
        let (sine, cosine, unit) = (a.cross(b).length(), a.dot(b), a.length() * b.length());
        if cosine >= 0.0 {
            sine / (unit + cosine)
        } else {
            (unit - cosine) / sine
        }
    };
    let weight = |k: usize| (half_tangent(k + n - 1) + half_tangent(k)) / outline[k].distance(x);
    let total: f64 = (0..n).map(weight).sum();
    (0..n).for_each(|k| visit(k, weight(k) / total));
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use crate::mesh::{Mesh, Subdivision};
    use crate::scene::{Scene, builtin};

    #[test]
    fn seams_are_where_vertices_of_a_plane_hang_and_nowhere_else() {
        let rectangle = |[x0, x1]: [f64; 2], [y0, y1]: [f64; 2]| {
            [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|[x, y]| glam::DVec3::new(x, y, 0.0))
        };
        let mut floor = Scene::of_quads(&[
            rectangle([0.0, 1.0], [0.0, 1.0]),
            rectangle([1.0, 2.0], [0.0, 0.35]),
            rectangle([1.0, 2.0], [0.35, 1.0]),
        ]);
        floor.surfaces.truncate(1);
        floor.faces.iter_mut().for_each(|face| face.surface.0 = 0);
        for n in 1..4 {
            let mesh = Mesh::new(&floor, Subdivision::Uniform(n)).unwrap();
            assert!(!mesh.seams.outlines.is_empty(), "{n}");
        }
        for name in ["cube", "cornell-box", "sphere-room-r1"] {
            let source = builtin::build(name, None).unwrap().scene;
            let mesh = Mesh::new(&source, Subdivision::Uniform(3)).unwrap();
            assert!(mesh.seams.outlines.is_empty() && mesh.seams.same.is_empty(), "{name}");
        }
    }
}
