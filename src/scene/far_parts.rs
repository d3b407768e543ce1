//! Parts of a scene that are far away from all others and meet none: their rounding says nothing about where other faces touch.

use foldhash::{HashMap, HashMapExt as _};
use glam::DVec3;

use super::cut_out::key;
use super::split::PLANARITY;
use super::{Face, Scene, Written};
use crate::disjoint_sets::DisjointSets;
use crate::geometry::box_pairs::overlapping_pairs;
use crate::geometry::polygon;
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
    /// These are all, less the parts, connected by common vertices, whose box reaches no other part's, whose greatest |coordinate| is more than 30 times that of another part, and whose own faces
    /// meet by vertices alone, as those of a flat or of a closed part do: a sun 1e7 m away in a file of 24 bits is off by 1 m, and a sensor of 1 mm beside a wall is not.
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
        let (parts, meet_by_vertices) = self.parts();
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
        for (&place, meets) in places.iter().zip(meet_by_vertices) {
            is_far[place] &= meets;
        }
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

    /// Returns the number of the part of each face, where parts have no vertex in common, and whether the face meets others of its part by vertices alone.
    ///
    /// It does if another one runs along each of its edges, or if all faces of the part lie in its plane.
    fn parts(&self) -> (Vec<usize>, Vec<bool>) {
        let mut vertex_at: HashMap<[u64; 3], usize> = HashMap::with_capacity(self.vertices.len());
        let first_at: Vec<usize> = (self.vertices.iter().enumerate())
            .map(|(k, &v)| *vertex_at.entry(key(v)).or_insert(k))
            .collect();
        let mut sets = DisjointSets::new(self.vertices.len());
        let corners = |face: &Face| {
            face.corners
                .as_slice()
                .iter()
                .map(|&v| first_at[v as usize])
                .collect::<Vec<_>>()
        };
        let edges = |face: &Face| {
            let corners = corners(face);
            let next = corners.clone().into_iter().cycle().skip(1);
            corners
                .into_iter()
                .zip(next)
                .map(|(a, b)| [a.min(b), a.max(b)])
                .collect::<Vec<_>>()
        };
        let mut n_faces: HashMap<[usize; 2], u32> = HashMap::new();
        for face in &self.faces {
            for [a, b] in edges(face) {
                sets.join(a, b);
                *n_faces.entry([a, b]).or_default() += 1;
            }
        }
        let parts: Vec<usize> = self.faces.iter().map(|face| sets.find(corners(face)[0])).collect();
        // The first face of each part: its first corner and unit normal.
        let mut plane_of: HashMap<usize, (DVec3, DVec3)> = HashMap::new();
        let mut is_flat: HashMap<usize, bool> = HashMap::new();
        for (face, &part) in self.faces.iter().zip(&parts) {
            let outline = self.positions(face);
            let (origin, normal) = *(plane_of.entry(part))
                .or_insert_with(|| (outline[0], polygon::area_vector(&outline).normalize_or_zero()));
            let off = self
                .written
                .map_or(0.0, |written| 2.0 * written.unit(greatest(self.box_of(&[face]))));
            let in_plane = |&v: &DVec3| normal.dot(v - origin).abs() <= off + PLANARITY * v.distance(origin);
            *is_flat.entry(part).or_insert(true) &= outline.iter().all(in_plane);
        }
        let meets = |(face, part): (&Face, &usize)| is_flat[part] || edges(face).iter().all(|edge| n_faces[edge] == 2);
        let meet = self.faces.iter().zip(&parts).map(meets).collect();
        (parts, meet)
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

#[cfg(test)]
mod tests {
    use super::super::load;

    /// Returns the slack of a file of a small turned square, and of what else it has.
    fn slack(more: &str) -> f64 {
        let near = "v 0.123457 0 0\nv 0.654321 0.31 0\nv 0.654321 0.31 0.5\nv 0.123457 0 0.5\nf 1 2 3 4\n";
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("scene.obj");
        std::fs::write(&path, format!("{near}{more}")).expect("a file");
        load(&path).expect("a scene").scene.slack()
    }

    #[test]
    fn a_far_part_counts_where_its_faces_may_meet_otherwise() {
        let near = slack("");
        // Six digits: the unit is 1e-6 m at the square, and 10 m at the far part.
        assert!(near < 1e-5, "{near:e}");
        let corners =
            "v 1.23457e+06 10 0\nv 1.34567e+06 20 0\nv 1.29876e+06 98765.1 0\nv 1.27654e+06 45678.9 87654.3\n";
        let of = |faces: &str| slack(&format!("{corners}{faces}"));
        let (flat, closed) = (of("f 5 6 7\n"), of("f 5 7 6\nf 5 6 8\nf 6 7 8\nf 7 5 8\n"));
        for slack in [flat, closed] {
            assert!(slack < 1e-5, "{slack:e}");
        }
        let open = of("f 5 6 8\nf 6 7 8\n");
        assert!(open > 1.0, "{open:e}");
    }
}
