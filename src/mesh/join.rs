//! The vertices that patches share: separate where contact edges run between them, joined where they meet side by side.

use std::collections::BTreeSet;

use foldhash::{HashMap, HashMapExt as _, HashSet, HashSetExt as _};
use glam::DVec3;
use rayon::prelude::*;

use super::contact_edges::ContactEdges;
use super::patch::{Patch, PatchId};
use super::patches::Mesh;
use super::seams::{SLACK, Seams};
use crate::disjoint_sets::DisjointSets;
use crate::geometry::box_pairs::collected_pairs;
use crate::scene::Corners;
use crate::threads;

/// The greatest difference of unit normals of parallel planes, as for faces that share an edge.
const BEND: f64 = 1e-9;

/// Gives patches of one plane separate vertices where a contact edge runs between them.
pub(super) fn part(mesh: &mut Mesh, contact_edges: &ContactEdges<'_>) {
    // Faces that are patches, none of which continues another.
    if mesh.n_patches() == contact_edges.scene.faces.len() && contact_edges.flat_joints().is_empty() {
        return;
    }
    let found = contact_edges.found();
    if found.parted.is_empty() {
        return;
    }
    let all = mesh.patches.iter().enumerate();
    let patches: Vec<(usize, &Patch)> = all.filter(|patch| found.parted.contains(&patch.1.face.0)).collect();
    let mut patch_beside: HashMap<(u32, u32), usize> = HashMap::new();
    for (patch, of_patch) in &patches {
        patch_beside.extend(edges(of_patch.corners).map(|edge| (edge, *patch)));
    }
    let neighbour = |(from, to): (u32, u32)| patch_beside.get(&(to, from)).copied();
    let place = |vertex: u32| mesh.vertices[vertex as usize];
    let mut parted: HashSet<(u32, u32)> = HashSet::new();
    for &(patch, of_patch) in &patches {
        for (from, to) in edges(of_patch.corners) {
            let Some(other) = neighbour((from, to)).filter(|&other| patch < other) else {
                continue;
            };
            let faces = [of_patch.face.0, mesh.patches[other].face.0];
            if found.stand_between(faces, place(from), place(to)) {
                parted.extend([(from, to), (to, from)]);
            }
        }
    }
    if parted.is_empty() {
        return;
    }
    // Patches keep a common vertex where a way around it leads from one to the other: at the end of a contact edge.
    let ends: HashSet<u32> = parted.iter().map(|edge| edge.0).collect();
    let mut around: HashMap<u32, Vec<usize>> = HashMap::new();
    for (patch, of_patch) in patches {
        for &corner in of_patch.corners.as_slice() {
            if ends.contains(&corner) {
                around.entry(corner).or_default().push(patch);
            }
        }
    }
    let mut new_corners: Vec<(usize, u32, u32)> = Vec::new();
    let mut new_vertices: Vec<DVec3> = Vec::new();
    let mut ends: Vec<u32> = ends.into_iter().collect();
    ends.sort_unstable();
    for vertex in ends {
        let here = &around[&vertex];
        let mut together = DisjointSets::new(here.len());
        for (k, &patch) in here.iter().enumerate() {
            for edge in edges(mesh.patches[patch].corners) {
                let is_own = edge.0 == vertex || edge.1 == vertex;
                let beside = neighbour(edge).filter(|_| is_own && !parted.contains(&edge));
                if let Some(other) = beside.and_then(|other| here.iter().position(|&one| one == other)) {
                    together.join(k, other);
                }
            }
        }
        // The first keeps the old vertex: a set is named by its least member.
        let mut own: HashMap<usize, u32> = HashMap::new();
        own.insert(0, vertex);
        for (k, &patch) in here.iter().enumerate() {
            let corner = *own.entry(together.find(k)).or_insert_with(|| {
                new_vertices.push(place(vertex));
                PatchId::from_index(mesh.vertices.len() + new_vertices.len() - 1).0
            });
            if corner != vertex {
                new_corners.push((patch, vertex, corner));
            }
        }
    }
    for (patch, old, new) in new_corners {
        let corners: &mut [u32] = match &mut mesh.patches[patch].corners {
            Corners::Triangle(corners) => corners,
            Corners::Quad(corners) => corners,
        };
        corners
            .iter_mut()
            .filter(|corner| **corner == old)
            .for_each(|corner| *corner = new);
    }
    mesh.vertices.extend(new_vertices);
}

/// Returns the edges of a patch, counter-clockwise.
fn edges(corners: Corners) -> impl Iterator<Item = (u32, u32)> {
    let n = corners.as_slice().len();
    (0..n).map(move |k| {
        let corners = corners.as_slice();
        (corners[k], corners[(k + 1) % n])
    })
}

/// A patch's edge that no other patch shares.
#[derive(Clone, Copy)]
struct Edge {
    patch: usize,
    from: u32,
    to: u32,
}

/// Returns the seams of a mesh.
pub(super) fn find_seams(mesh: &Mesh, contact_edges: &ContactEdges<'_>) -> Seams {
    let edges = free_edges(mesh);
    let place = |vertex: u32| mesh.vertices[vertex as usize];
    let boxes = threads::collect_from(&edges, |edge| {
        let (a, b) = (place(edge.from), place(edge.to));
        let slack = DVec3::splat(SLACK * a.distance(b));
        (a.min(b) - slack, a.max(b) + slack)
    });
    let mut sets: Option<DisjointSets> = None;
    // For the edge of a patch, by its first vertex: hanging vertices and their distances along it.
    let mut hanging: HashMap<(usize, u32), Vec<(f64, u32)>> = HashMap::new();
    let in_one_plane = collected_pairs(boxes, |i, j, found: &mut Vec<[Edge; 2]>| {
        let pair = [edges[i as usize], edges[j as usize]];
        let normals = pair.map(|edge| mesh.patches[edge.patch].normal);
        if (normals[0] - normals[1]).length() <= BEND && pair[0].patch != pair[1].patch {
            found.push(pair);
        }
    });
    for pair in in_one_plane {
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
    }
    let mut seams = Seams::default();
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
    for patch in hanging.keys().map(|&(patch, _)| patch).collect::<BTreeSet<_>>() {
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

/// Returns the edges that no neighbour in the plane shares, of the patches that are not the only ones with their normal.
fn free_edges(mesh: &Mesh) -> Vec<Edge> {
    let is_alone = only_ones_of_their_normal(mesh);
    let mut by_ends: Vec<([u32; 2], Edge)> = Vec::new();
    for (patch, of_patch) in mesh.patches.iter().enumerate().filter(|&(patch, _)| !is_alone[patch]) {
        let of_edge = |(from, to): (u32, u32)| ([from.min(to), from.max(to)], Edge { patch, from, to });
        by_ends.extend(edges(of_patch.corners).map(of_edge));
    }
    // By ends, then in the order of the patches.
    by_ends.par_sort_by_key(|edge| edge.0);
    let mut free: Vec<Edge> = Vec::new();
    for between in by_ends.chunk_by(|a, b| a.0 == b.0) {
        // The last edge in each direction without a partner so far.
        let mut unmet = [None; 2];
        for &(_, edge) in between {
            let way = usize::from(edge.from < edge.to);
            if unmet[1 - way].take().is_none() {
                unmet[way] = Some(edge);
            }
        }
        free.extend(unmet.into_iter().flatten());
    }
    free.par_sort_unstable_by_key(|edge| (edge.patch, edge.from, edge.to));
    free
}

/// Returns for each patch whether no other has nearly its normal: then it continues none, as most triangles of a curved surface.
fn only_ones_of_their_normal(mesh: &Mesh) -> Vec<bool> {
    let mut by_x: Vec<(f64, usize)> = mesh.patches.iter().map(|patch| patch.normal.x).zip(0..).collect();
    by_x.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut is_alone = vec![true; by_x.len()];
    for pair in by_x.windows(2) {
        if (pair[1].0 - pair[0].0).abs() <= BEND {
            for &(_, patch) in pair {
                is_alone[patch] = false;
            }
        }
    }
    is_alone
}
