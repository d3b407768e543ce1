//! Parts of a scene that are far away from all others and meet none: their rounding says nothing about where other faces touch.

use foldhash::{HashMap, HashMapExt as _};
use glam::DVec3;

use super::{Face, Scene, Written};
use crate::disjoint_sets::DisjointSets;
use crate::geometry::box_pairs::overlapping_pairs;
use crate::threads;

/// The ratio of the greatest |coordinates| of two parts from which on one is far away.
const FAR: f64 = 30.0;

/// The ratio of the units of two numbers up to which they count as equally exact.
const SAME: f64 = 2.0;

/// The ratio of the greatest |coordinates| of two faces up to which some ulps of one are nothing beside the other.
const F64: f64 = 1e6;

impl Scene {
    /// Returns the faces that may have been meant to touch others than their neighbours by vertices.
    ///
    /// These are all, less the parts, connected by common vertices, whose box reaches no other part's, and whose greatest |coordinate| is more than 30 times that of another part: a sun
    /// 1e7 m away in a file of 24 bits is off by 1 m, and a sensor of 1 mm beside a wall is not.
    ///
    /// Work: O(n) for n faces where none is far, or all numbers are as exact; else O(n log n).
    pub(super) fn meeting_faces(&self) -> Vec<&Face> {
        let of_faces: Vec<f64> = threads::collect_from(&self.faces, |face| greatest(self.box_of(&[face])));
        let (smallest, most) = of_faces
            .iter()
            .fold((f64::INFINITY, 0.0_f64), |(l, h), &x| (l.min(x), h.max(x)));
        // Far parts matter where numbers are less exact there than here: by their digits, or in f64.
        let is_as_exact = |written: Written| written.unit(most) <= SAME * written.unit(smallest);
        let is_even = most <= F64 * smallest && self.written.is_none_or(is_as_exact);
        if most <= FAR * smallest || is_even {
            return self.faces.iter().collect();
        }
        let parts = self.parts();
        let mut boxes: Vec<(DVec3, DVec3)> = Vec::new();
        let mut of_parts: Vec<f64> = Vec::new();
        let mut place_of: HashMap<usize, usize> = HashMap::new();
        let places: Vec<usize> = (self.faces.iter().zip(&of_faces).zip(&parts))
            .map(|((face, &greatest), &part)| {
                let place = *place_of.entry(part).or_insert_with(|| {
                    boxes.push((DVec3::INFINITY, DVec3::NEG_INFINITY));
                    of_parts.push(0.0);
                    boxes.len() - 1
                });
                of_parts[place] = of_parts[place].max(greatest);
                let (low, high) = self.positions(face).bounding_box();
                boxes[place] = (boxes[place].0.min(low), boxes[place].1.max(high));
                place
            })
            .collect();
        let least = of_parts.iter().copied().fold(f64::INFINITY, f64::min);
        let mut is_far: Vec<bool> = of_parts.iter().map(|&greatest| greatest > FAR * least).collect();
        for ((low, high), greatest) in boxes.iter_mut().zip(&of_parts) {
            let off = self.written.map_or(0.0, |written| 2.0 * written.unit(*greatest));
            (*low, *high) = (*low - off, *high + off);
        }
        overlapping_pairs(boxes, |a, b| {
            is_far[a as usize] = false;
            is_far[b as usize] = false;
        });
        self.faces
            .iter()
            .zip(places)
            .filter(|&(_, place)| !is_far[place])
            .map(|(face, _)| face)
            .collect()
    }

    /// Returns the least and the greatest corner of the box around the [faces that may meet others](Self::meeting_faces).
    pub(crate) fn box_where_faces_meet(&self) -> (DVec3, DVec3) {
        self.box_of(&self.meeting_faces())
    }

    /// Returns the greatest |coordinate| of the [faces that may meet others](Self::meeting_faces).
    pub(crate) fn greatest_where_faces_meet(&self) -> f64 {
        greatest(self.box_where_faces_meet())
    }

    /// Returns the least and the greatest corner of the box around some faces.
    pub(super) fn box_of(&self, faces: &[&Face]) -> (DVec3, DVec3) {
        let corners = faces.iter().flat_map(|face| face.corners.as_slice());
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        corners.fold(empty, |(low, high), &v| {
            let v = self.vertices[v as usize];
            (low.min(v), high.max(v))
        })
    }

    /// Returns the number of the part of each face: parts have no vertex in common.
    fn parts(&self) -> Vec<usize> {
        let mut vertex_at: HashMap<[u64; 3], usize> = HashMap::with_capacity(self.vertices.len());
        let mut sets = DisjointSets::new(self.vertices.len());
        for (k, v) in self.vertices.iter().enumerate() {
            // 0 and −0 are equal, but their bits differ.
            let place = (*v + DVec3::ZERO).to_array().map(f64::to_bits);
            sets.join(*vertex_at.entry(place).or_insert(k), k);
        }
        for face in &self.faces {
            let corners = face.corners.as_slice();
            for &corner in &corners[1..] {
                sets.join(corners[0] as usize, corner as usize);
            }
        }
        let first = |face: &Face| sets.find(face.corners.as_slice()[0] as usize);
        self.faces.iter().map(first).collect()
    }
}

/// Returns the greatest |coordinate| of a box; 0 for an empty one.
pub(super) fn greatest((low, high): (DVec3, DVec3)) -> f64 {
    if low.cmple(high).all() {
        low.abs().max(high.abs()).max_element()
    } else {
        0.0
    }
}
