//! Where patches of one plane meet along a line without sharing all vertices on it: T-junctions.
//!
//! Faces that share an edge are cut alike, and their patches share vertices. Where a long edge runs beside several short ones, or patches have moved side by
//! side, they do not, and values interpolated on either side would differ: a seam. Here the vertices that hang on a patch's edge become corners of its outline for
//! interpolation, and vertices in one place become one. Then both sides are linear between the same points with the same values.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::contact_edges::ContactEdges;
use super::{Mesh, PatchId};
use crate::disjoint_sets::DisjointSets;
use crate::geometry::box_pairs::overlapping_pairs;

/// Points nearer than this part of the longer of two edges are one, and so are lines: far more than rounding, far less than a patch.
const SLACK: f64 = 1e-9;

/// Planes whose unit normals differ by less than this are parallel, as for faces that share an edge.
const BEND: f64 = 1e-9;

/// What interpolation knows of T-junctions; empty for most meshes.
#[derive(Clone, Debug, Default)]
pub(super) struct Seams {
    /// The vertex that stands for each of those that others lie on.
    pub(super) same: HashMap<u32, u32>,
    /// The outlines of patches with more vertices than corners, counter-clockwise.
    pub(super) outlines: BTreeMap<u32, Vec<u32>>,
}

/// A patch's edge that no other patch shares.
#[derive(Clone, Copy)]
struct Edge {
    patch: usize,
    from: u32,
    to: u32,
}

impl Seams {
    pub(super) fn find(mesh: &Mesh, contact_edges: &ContactEdges<'_>) -> Self {
        let edges = free_edges(mesh);
        let place = |vertex: u32| mesh.vertices[vertex as usize];
        let boxes = edges.iter().map(|edge| {
            let (a, b) = (place(edge.from), place(edge.to));
            let slack = DVec3::splat(SLACK * a.distance(b));
            (a.min(b) - slack, a.max(b) + slack)
        });
        let mut sets: Option<DisjointSets> = None;
        // On the edge of a patch, by its first vertex: hanging vertices and how far along they are.
        let mut hanging: HashMap<(usize, u32), Vec<(f64, u32)>> = HashMap::new();
        overlapping_pairs(boxes.collect(), |i, j| {
            let pair = [edges[i as usize], edges[j as usize]];
            let normals = pair.map(|edge| mesh.patches[edge.patch].normal);
            if (normals[0] - normals[1]).length() > BEND || pair[0].patch == pair[1].patch {
                return;
            }
            for [one, other] in [pair, [pair[1], pair[0]]] {
                let (start, along) = (place(one.from), place(one.to) - place(one.from));
                let (length, other_length) = (along.length(), place(other.from).distance(place(other.to)));
                let slack = SLACK * length.max(other_length);
                let unit = along / length;
                let sideways = |vertex: u32| (place(vertex) - start).reject_from_normalized(unit).length();
                // The neighbour on the same side of a plane runs the other way.
                let runs_back = (place(other.to) - place(other.from)).dot(unit) < 0.0;
                if !runs_back || sideways(other.from) > slack || sideways(other.to) > slack {
                    continue;
                }
                let faces = [one, other].map(|edge| mesh.patches[edge.patch].face.0);
                let common = [other.to, other.from].map(|vertex| unit.dot(place(vertex) - start).clamp(0.0, length));
                let [first, last] = common.map(|t| start + t * unit);
                if contact_edges.stand_between(faces, first, last) {
                    continue;
                }
                for vertex in [other.from, other.to] {
                    let t = unit.dot(place(vertex) - start);
                    if t.abs() <= slack || (t - length).abs() <= slack {
                        let own = if t.abs() <= slack { one.from } else { one.to };
                        let sets = sets.get_or_insert_with(|| DisjointSets::new(mesh.vertices.len()));
                        sets.join(own as usize, vertex as usize);
                    } else if t > 0.0 && t < length {
                        hanging
                            .entry((one.patch, one.from))
                            .or_default()
                            .push((t / length, vertex));
                    }
                }
            }
        });
        let mut seams = Self::default();
        let mut sets = match sets {
            Some(sets) => sets,
            None if hanging.is_empty() => return seams,
            None => DisjointSets::new(mesh.vertices.len()),
        };
        for vertex in 0..mesh.vertices.len() {
            let stands_for = sets.find(vertex);
            if stands_for != vertex {
                seams
                    .same
                    .insert(PatchId::from_index(vertex).0, PatchId::from_index(stands_for).0);
            }
        }
        for patch in hanging
            .keys()
            .map(|&(patch, _)| patch)
            .collect::<std::collections::BTreeSet<_>>()
        {
            let mut outline = Vec::new();
            for &corner in mesh.patches[patch].corners.as_slice() {
                outline.push(seams.of(corner));
                if let Some(mut between) = hanging.remove(&(patch, corner)) {
                    between.sort_by(|a, b| a.0.total_cmp(&b.0));
                    outline.extend(between.into_iter().map(|(_, vertex)| seams.of(vertex)));
                }
            }
            outline.dedup();
            seams.outlines.insert(PatchId::from_index(patch).0, outline);
        }
        seams
    }

    /// Returns the vertex that stands for a vertex.
    pub(super) fn of(&self, vertex: u32) -> u32 {
        self.same.get(&vertex).copied().unwrap_or(vertex)
    }
}

/// Returns the edges that no neighbour in the plane shares.
fn free_edges(mesh: &Mesh) -> Vec<Edge> {
    let mut by_ends: HashMap<(u32, u32), Edge> = HashMap::new();
    for (patch, of_patch) in mesh.patches.iter().enumerate() {
        let corners = of_patch.corners.as_slice();
        for (k, &from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % corners.len()];
            if by_ends.remove(&(to, from)).is_none() {
                by_ends.insert((from, to), Edge { patch, from, to });
            }
        }
    }
    let mut edges: Vec<Edge> = by_ends.into_values().collect();
    edges.sort_unstable_by_key(|edge| (edge.patch, edge.from, edge.to));
    edges
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
    // tan(α/2) = sin α / (1 + cos α) = (1 − cos α) / sin α: without a difference of what is nearly equal, as it would be near an edge, where α nears π.
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
