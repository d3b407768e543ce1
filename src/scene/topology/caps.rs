//! Finds blocks without a bottom that stand on other faces: these are as good as closed, as no light passes below them.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::pieces::Pieces;
use crate::geometry::box_pairs::BoxTree;
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::scene::{FaceId, Positions, Scene};

/// The fraction of a cap's area that may seem uncovered by rounding.
const UNCOVERED: f64 = 1e-12;

/// Returns the caps of open pieces whose border lies in planes of other faces that cover the opening: the piece, and the corners of the closing face.
///
/// A piece is included only if all of its border is closed in this way. `tolerance`: the greatest distance of corners from those planes, m.
/// Work: O(n log n) and the faces around each border.
pub(super) fn caps(scene: &Scene, pieces: &Pieces, tolerance: f64) -> Vec<(u32, Vec<DVec3>)> {
    let mut rims: BTreeMap<u32, Vec<[u32; 2]>> = BTreeMap::new();
    for &(piece, ends) in pieces.rims() {
        rims.entry(piece).or_default().push(ends);
    }
    if rims.is_empty() {
        return Vec::new();
    }
    let outlines: Vec<Positions> = scene.faces.iter().map(|face| scene.positions(face)).collect();
    let boxes = outlines.iter().map(|corners| super::bounding_box(corners));
    let tree = BoxTree::new(boxes.collect());
    let is_covered = |piece: u32, cap: &[DVec3]| {
        let normal = polygon::area_vector(cap);
        let (area, unit) = (normal.length(), normal.normalize_or_zero());
        let is_level = |corners: &[DVec3]| corners.iter().all(|&v| unit.dot(v - cap[0]).abs() <= tolerance);
        if area <= 0.0 || !is_level(cap) {
            return false;
        }
        let (low, high) = super::bounding_box(cap);
        // Faces that face up and down may lie on each other: either kind alone has to cover the cap.
        let mut covered = [0.0; 2];
        tree.overlapping((low - tolerance, high + tolerance), &mut |face| {
            let corners = &outlines[face as usize];
            if pieces.of_face(FaceId(face)) == piece || !is_level(corners) {
                return;
            }
            let side = polygon::area_vector(corners);
            let mut part = cap.to_vec();
            for (k, &from) in corners.iter().enumerate() {
                let inwards = side.cross(corners[(k + 1) % corners.len()] - from);
                part = clip_to_half_space(&part, from, inwards);
            }
            if part.len() > 2 {
                covered[usize::from(side.dot(unit) > 0.0)] += polygon::area_vector(&part).length();
            }
        });
        let least = area * (1.0 - UNCOVERED) - tolerance * polygon::perimeter(cap);
        covered.into_iter().any(|covered| covered >= least)
    };
    let of_piece = |(piece, edges): (u32, Vec<[u32; 2]>)| -> Option<Vec<(u32, Vec<DVec3>)>> {
        let caps = loops(&edges)?.into_iter().map(|mut corners| {
            // The missing face runs along the border in the other sense.
            corners.reverse();
            let cap: Vec<DVec3> = corners.iter().map(|&v| scene.vertices[v as usize]).collect();
            is_covered(piece, &cap).then_some((piece, cap))
        });
        caps.collect()
    };
    rims.into_iter().filter_map(of_piece).flatten().collect()
}

/// Joins edges to closed loops; `None` unless exactly one edge leaves each vertex.
fn loops(edges: &[[u32; 2]]) -> Option<Vec<Vec<u32>>> {
    let next: BTreeMap<u32, u32> = edges.iter().map(|&[from, to]| (from, to)).collect();
    if next.len() < edges.len() {
        return None;
    }
    let mut left: BTreeSet<u32> = next.keys().copied().collect();
    let mut loops = Vec::new();
    while let Some(first) = left.pop_first() {
        let mut corners = vec![first];
        let mut at = *next.get(&first)?;
        while at != first {
            if !left.remove(&at) {
                return None;
            }
            corners.push(at);
            at = *next.get(&at)?;
        }
        loops.push(corners);
    }
    Some(loops)
}
