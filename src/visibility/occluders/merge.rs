//! Joins flat neighbours into larger convex polygons: fewer edges are less work for shadows.

use foldhash::{HashMap, HashMapExt as _};
use glam::DVec3;

use super::super::plane::{Plane, rounding};
use crate::geometry::polygon;
use crate::scene::Scene;

/// The greatest difference of normals of one plane.
const ANGLE_TOLERANCE: f64 = 1e-12;

/// The greatest height of a joined polygon's corners over its plane, in units of what a shaft takes for rounding.
const FLAT: f64 = 0.5;

/// The greatest difference of normals where corners were rounded; small faces lean the most.
const ROUNDED_ANGLE: f64 = 1e-3;

type Edge = (u32, u32);

fn edge(a: u32, b: u32) -> Edge {
    (a.min(b), a.max(b))
}

/// Returns the faces of a scene as vertex loops, coincident ones once, and flat neighbours with a convex union joined.
///
/// Faces occlude from both sides, so that the two faces of a sheet count as one; the fronts of all faces joined into one loop look the same way. The
/// second part of each item lists the faces of the loop. Faces without an area are left out. Corners of flat neighbours are off their plane by at most `off`, m, as rounding moves them.
pub(super) fn convex_polygons(scene: &Scene, off: f64) -> Vec<(Vec<u32>, Vec<u32>)> {
    let mut merger = Merger {
        vertices: &scene.vertices,
        off,
        loops: Vec::new(),
        by_edge: HashMap::with_capacity(scene.faces.len() * 3 / 2),
    };
    let mut known: HashMap<[u32; 4], usize> = HashMap::with_capacity(scene.faces.len());
    for face in scene.face_ids() {
        let corners = scene.faces[face.0 as usize].corners;
        let area_vector = polygon::area_vector(&scene.positions(&scene.faces[face.0 as usize]));
        if area_vector.length_squared() <= 0.0 {
            continue;
        }
        // A triangle has no fourth vertex, and no vertex is the last number.
        let mut key = [u32::MAX; 4];
        key[..corners.as_slice().len()].copy_from_slice(corners.as_slice());
        key.sort_unstable();
        if let Some(&twin) = known.get(&key) {
            merger.loops[twin].faces.push(face.0);
        } else {
            known.insert(key, merger.loops.len());
            merger.push(corners.as_slice().to_vec(), area_vector.normalize(), face.0);
        }
    }
    for k in 0..merger.loops.len() {
        while merger.join_a_neighbour(k) {}
    }
    let scene_vertices = merger.vertices;
    let alive = merger.loops.into_iter().filter(|l| !l.corners.is_empty());
    alive
        .map(|l| (without_straight_corners(scene_vertices, &l), l.faces))
        .collect()
}

struct Loop {
    /// Empty once the loop is joined to another.
    corners: Vec<u32>,
    normal: DVec3,
    faces: Vec<u32>,
}

struct Merger<'a> {
    vertices: &'a [DVec3],
    off: f64,
    loops: Vec<Loop>,
    by_edge: HashMap<Edge, Owners>,
}

/// The loops along an edge.
#[derive(Clone, Copy)]
enum Owners {
    One(usize),
    Two([usize; 2]),
    More,
}

impl Owners {
    fn and(self, index: usize) -> Self {
        match self {
            Self::One(first) => Self::Two([first, index]),
            Self::Two(_) | Self::More => Self::More,
        }
    }
}

impl Merger<'_> {
    fn push(&mut self, corners: Vec<u32>, normal: DVec3, face: u32) {
        let index = self.loops.len();
        for (k, &a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            let owners = self.by_edge.entry(edge(a, b));
            owners
                .and_modify(|owners| *owners = owners.and(index))
                .or_insert(Owners::One(index));
        }
        self.loops.push(Loop {
            corners,
            normal,
            faces: vec![face],
        });
    }

    /// Joins one flat neighbour with a convex union to loop `k`; false if there is none.
    fn join_a_neighbour(&mut self, k: usize) -> bool {
        let corners = &self.loops[k].corners;
        let mut last_refused = None;
        for i in 0..corners.len() {
            let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
            let Some(&Owners::Two([x, y])) = self.by_edge.get(&edge(a, b)) else {
                continue; // a border, or an edge at which more than two faces meet
            };
            let other = if x == k { y } else { x };
            let leaning = if self.off > 0.0 { ROUNDED_ANGLE } else { ANGLE_TOLERANCE };
            // A finely cut wall has long loops: a neighbour along many edges is tested once, and one that leaves a concave corner only there.
            if other == k
                || last_refused == Some(other)
                || (self.loops[k].normal - self.loops[other].normal).length() > leaning
            {
                continue;
            }
            last_refused = Some(other);
            if self.is_concave_beside(k, i, other) {
                continue;
            }
            if let Some(union) = self.union(k, other) {
                self.replace(k, other, union);
                return true;
            }
        }
        false
    }

    /// Returns whether the union of two loops turns the wrong way at an end of the run of edges that they share about edge `i` of loop `k`.
    fn is_concave_beside(&self, k: usize, i: usize, other: usize) -> bool {
        let (first, second) = (&self.loops[k].corners, &self.loops[other].corners);
        let (n, m) = (first.len(), second.len());
        let b = first[(i + 1) % n];
        let Some(j) = (0..m).find(|&j| second[j] == b && second[(j + 1) % m] == first[i]) else {
            return false;
        };
        // Edge i + s of the first is edge j - s of the second, wound the other way.
        let is_shared = |s: usize, t: usize| {
            first[(i + s + 1) % n] == second[(j + t) % m] && first[(i + s) % n] == second[(j + t + 1) % m]
        };
        let most = n.min(m);
        let Some(after) = (1..most).find(|&s| !is_shared(s, m - s)) else {
            return false;
        };
        let Some(before) = (1..most).find(|&s| !is_shared(n - s, s)) else {
            return false;
        };
        let at = |corners: &[u32], corner: usize| self.vertices[corners[corner % corners.len()] as usize];
        let normal = self.loops[k].normal;
        // The last common corners, each between a corner of the one loop and one of the other.
        let is_concave = |from: DVec3, corner: DVec3, to: DVec3| !turns_in(normal, corner - from, to - corner);
        is_concave(
            at(second, j + m - after),
            at(first, i + after),
            at(first, i + after + 1),
        ) || is_concave(
            at(first, i + n - before),
            at(first, i + n + 1 - before),
            at(second, j + before + 1),
        )
    }

    /// Returns the loop around two loops that share one run of edges, if it is convex.
    fn union(&self, k: usize, other: usize) -> Option<Vec<u32>> {
        let (first, second) = (&self.loops[k].corners, &self.loops[other].corners);
        let (n, m) = (first.len(), second.len());
        let shared = |i: usize| {
            let (a, b) = (first[i % n], first[(i + 1) % n]);
            (0..m).any(|j| second[j] == b && second[(j + 1) % m] == a)
        };
        // Turn the first loop so that it begins behind the shared run.
        let start = (0..n).find(|&i| !shared(i) && shared(i + n - 1))?;
        let own: Vec<u32> = (0..n)
            .take_while(|&i| !shared(start + i))
            .map(|i| first[(start + i) % n])
            .collect();
        let n_shared = n - own.len();
        if (0..n).filter(|&i| shared(i)).count() != n_shared {
            return None; // several runs: the union has a hole
        }
        let (run_begin, run_end) = (first[(start + own.len()) % n], first[start]);
        let at = second.iter().position(|&v| v == run_begin)?;
        let mut union = own;
        for j in 0..m {
            let v = second[(at + j) % m];
            if v == run_end {
                break;
            }
            union.push(v);
        }
        let mut distinct = union.clone();
        distinct.sort_unstable();
        distinct.dedup();
        (distinct.len() == union.len() && self.is_convex(&union, self.loops[k].normal)).then_some(union)
    }

    fn is_convex(&self, corners: &[u32], normal: DVec3) -> bool {
        let v = |i: usize| self.vertices[corners[i % corners.len()] as usize];
        (0..corners.len()).all(|i| turns_in(normal, v(i + 1) - v(i), v(i + 2) - v(i + 1))) && self.is_flat(corners)
    }

    /// Returns whether corners lie in one plane.
    ///
    /// A joined polygon stands before all of its faces where it leaves their planes by more than a shaft takes for rounding, and would hide them.
    fn is_flat(&self, corners: &[u32]) -> bool {
        let positions: Vec<DVec3> = corners.iter().map(|&k| self.vertices[k as usize]).collect();
        let [low, high] = Plane::of(&positions).heights(&positions);
        high - low <= FLAT * rounding(&positions) + self.off
    }

    fn replace(&mut self, k: usize, other: usize, union: Vec<u32>) {
        let absorbed = std::mem::take(&mut self.loops[other].corners);
        let faces = std::mem::take(&mut self.loops[other].faces);
        for (i, &a) in absorbed.iter().enumerate() {
            let owners = self.by_edge.get_mut(&edge(a, absorbed[(i + 1) % absorbed.len()]));
            match owners {
                Some(Owners::One(owner)) if *owner == other => *owner = k,
                Some(Owners::Two(both)) => both
                    .iter_mut()
                    .filter(|owner| **owner == other)
                    .for_each(|owner| *owner = k),
                _ => {}
            }
        }
        self.loops[k].corners = union;
        self.loops[k].faces.extend(faces);
    }
}

/// Returns whether a loop turns to its inner side between two edges, or runs straight on.
fn turns_in(normal: DVec3, before: DVec3, after: DVec3) -> bool {
    let scale = before.length() * after.length();
    let turn = normal.dot(before.cross(after));
    turn >= -ANGLE_TOLERANCE * scale && (before.dot(after) > 0.0 || turn > ANGLE_TOLERANCE * scale)
}

/// Returns the corners of a loop at which it turns.
fn without_straight_corners(vertices: &[DVec3], l: &Loop) -> Vec<u32> {
    let n = l.corners.len();
    let v = |i: usize| vertices[l.corners[i % n] as usize];
    let turning = (0..n).filter(|&i| {
        let (before, after) = (v(i) - v(i + n - 1), v(i + 1) - v(i));
        l.normal.dot(before.cross(after)) > ANGLE_TOLERANCE * before.length() * after.length()
    });
    let kept: Vec<u32> = turning.map(|i| l.corners[i]).collect();
    // A loop must keep its area in spite of rounding.
    let area = |corners: &[u32]| {
        let points: Vec<DVec3> = corners.iter().map(|&k| vertices[k as usize]).collect();
        polygon::area_vector(&points).length()
    };
    if kept.len() >= 3 && (area(&kept) - area(&l.corners)).abs() <= ANGLE_TOLERANCE * area(&l.corners) {
        kept
    } else {
        l.corners.clone()
    }
}
