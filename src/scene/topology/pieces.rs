//! The connected pieces of a scene's surface, and which of them are closed.
//!
//! A piece is closed if its boundary vanishes: faces run along every edge, or every part of one in T-junctions, as often in one sense as in the other. Closed pieces
//! have a winding number around every point, which is constant wherever no face of the piece is crossed.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec3;
use rayon::prelude::*;

use super::caps::caps;
use super::edges;
use crate::disjoint_sets::DisjointSets;
use crate::geometry::box_pairs::{BoxTree, overlapping_pairs};
use crate::geometry::polygon;
use crate::scene::{FaceId, Scene};

/// The connected pieces of a scene's surface.
#[derive(Clone, Debug)]
pub(crate) struct Pieces {
    /// The piece of each face, numbered from 0 in the order of their first faces.
    of_face: Vec<u32>,
    is_closed: Vec<bool>,
    /// The corners of faces whose edges match those of others only in part, or within rounding, with the corners of the others inserted, to the last bit.
    outlines: HashMap<u32, Vec<DVec3>>,
    /// The edges, or parts of edges, along which open pieces end, in the sense of their faces: the piece, and the vertices at both ends.
    rims: Vec<(u32, [u32; 2])>,
    /// The caps of pieces that stand on others: see [`caps`].
    caps: Vec<(u32, Vec<DVec3>)>,
    is_capped: Vec<bool>,
    /// Whether closed pieces have no inside, as all of their faces lie in one plane.
    is_flat: Vec<bool>,
    /// See [`Pieces::misfit`].
    misfit: f64,
}

impl Pieces {
    /// Finds the pieces of a scene.
    ///
    /// Edges of two faces that run along each other in opposite senses join them, by their vertices or, where these differ, by their positions: vertices within the rounding
    /// of the coordinates ([`joint`]), or 1e-8 of the smallest face around them, are one, and vertices on an edge divide it. Where more faces meet, a piece is closed if its own faces cancel there.
    /// Of the rest, faces that end in the open or at a side where nothing continues them are set aside, the smallest first, until the others cancel.
    ///
    /// Work: O(n log n).
    pub(crate) fn of(scene: &Scene) -> Self {
        let mut sets = DisjointSets::new(scene.faces.len());
        let open = join_neighbours(scene, &mut sets);
        let parted = Parted::new(scene, &open);
        let mut joints = parted.joints();
        for joint in &joints {
            if let [(a, of_a), (b, of_b)] = *joint.runs
                && of_a + of_b == 0
            {
                sets.join(a as usize, b as usize);
            }
        }
        for joint in &mut joints {
            joint.by_set(&mut sets);
        }
        joints.retain(|joint| !joint.runs.is_empty());
        let is_open = open_sets(scene, &joints, &mut sets);
        for joint in &joints {
            let mut closed = joint.runs.iter().filter(|run| !is_open[run.0 as usize]);
            if let Some(first) = closed.next() {
                for run in closed {
                    sets.join(first.0 as usize, run.0 as usize);
                }
            }
        }
        let mut number: HashMap<usize, u32> = HashMap::new();
        let mut is_closed = Vec::new();
        let of_face: Vec<u32> = (0..scene.faces.len())
            .map(|face| {
                let set = sets.find(face);
                *number.entry(set).or_insert_with(|| {
                    is_closed.push(!is_open[set]);
                    super::index(is_closed.len() - 1)
                })
            })
            .collect();
        let rims = joints.iter().flat_map(|joint| {
            let ends = joint.ends;
            let of_open = joint.runs.iter().filter(|run| is_open[run.0 as usize]);
            of_open.map(move |&(set, n)| (set, if n > 0 { ends } else { [ends[1], ends[0]] }))
        });
        let rims = rims.map(|(set, ends)| (of_face[set as usize], ends)).collect();
        let n = is_closed.len();
        let mut pieces = Self {
            outlines: parted.outlines(scene),
            misfit: parted.misfit,
            is_flat: flat_ones(scene, &of_face, n),
            of_face,
            is_closed,
            rims,
            caps: Vec::new(),
            is_capped: vec![false; n],
        };
        let caps = caps(scene, &pieces, joint(scene));
        for (piece, _) in &caps {
            pieces.is_capped[*piece as usize] = true;
        }
        pieces.rims.retain(|rim| !pieces.is_capped[rim.0 as usize]);
        pieces.caps = caps;
        pieces
    }

    /// Returns the piece of a face.
    pub(crate) fn of_face(&self, face: FaceId) -> u32 {
        self.of_face[face.0 as usize]
    }

    /// Returns the piece of a face if it is closed, by itself or by the faces on which it stands.
    pub(crate) fn closed(&self, face: FaceId) -> Option<u32> {
        let piece = self.of_face(face);
        (self.is_closed[piece as usize] || self.is_capped[piece as usize]).then_some(piece)
    }

    /// Returns the caps that close pieces which stand on others: the piece, and the corners of the missing face.
    pub(crate) fn caps(&self) -> &[(u32, Vec<DVec3>)] {
        &self.caps
    }

    /// Returns whether a piece is closed and has no inside, like the two sides of a sheet.
    pub(crate) fn is_sheet(&self, piece: u32) -> bool {
        self.is_closed[piece as usize] && self.is_flat[piece as usize]
    }

    /// Returns the greatest width, in m, of slits between faces that were taken to meet; 0 where the rounding of the coordinates explains all of them.
    pub(crate) fn misfit(&self) -> f64 {
        self.misfit
    }

    /// Returns the number of pieces.
    pub(crate) fn len(&self) -> usize {
        self.is_closed.len()
    }

    /// Returns the corners of a face such that common edges of closed pieces are equal to the last bit.
    pub(crate) fn outline(&self, scene: &Scene, face: FaceId) -> Vec<DVec3> {
        let parted = self.outlines.get(&face.0).cloned();
        parted.unwrap_or_else(|| scene.polygon(face))
    }

    /// Returns the parts of edges along which open pieces end, in the sense of their faces: the numbers of the pieces, and the vertices at the ends.
    pub(crate) fn rims(&self) -> &[(u32, [u32; 2])] {
        &self.rims
    }
}

/// Joins faces along edges that exactly two of them share in opposite senses; returns the other edges in the order of their faces, with their ends.
fn join_neighbours(scene: &Scene, sets: &mut DisjointSets) -> Vec<(u32, [u32; 2])> {
    let mut runs: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(4 * scene.faces.len());
    for face in scene.face_ids() {
        let of_edge = |(k, (a, b)): (u8, (u32, u32))| ([a.min(b), a.max(b)], face.0, k);
        runs.extend((0..).zip(edges(scene, face)).map(of_edge));
    }
    runs.par_sort_unstable();
    let ends = |face: u32, k: u8| {
        let corners = scene.faces[face as usize].corners;
        let v = corners.as_slice();
        [v[usize::from(k)], v[(usize::from(k) + 1) % v.len()]]
    };
    let mut open: Vec<(u32, u8)> = Vec::new();
    for along in runs.chunk_by(|a, b| a.0 == b.0) {
        match *along {
            // The only edge of a face without length is its own neighbour.
            [([a, b], ..)] if a == b => {}
            [(_, one, k), (_, other, l)] if ends(one, k) != ends(other, l) => {
                sets.join(one as usize, other as usize);
            }
            _ => open.extend(along.iter().map(|&(_, face, k)| (face, k))),
        }
    }
    open.sort_unstable();
    open.into_iter().map(|(face, k)| (face, ends(face, k))).collect()
}

/// Returns for each piece whether it lies in one plane.
fn flat_ones(scene: &Scene, of_face: &[u32], n: usize) -> Vec<bool> {
    // Rounding turns the plane of a large face the least, and moves what lies beside it by some times its tolerance.
    let tolerance = 4.0 * joint(scene);
    let mut largest = vec![(DVec3::ZERO, DVec3::ZERO); n];
    for (face, &piece) in scene.face_ids().zip(of_face) {
        let (of_piece, own) = (&mut largest[piece as usize], scene.area_vector(face));
        if own.length_squared() > of_piece.1.length_squared() {
            *of_piece = (scene.polygon(face)[0], own);
        }
    }
    let mut is_flat = vec![true; n];
    for (face, &piece) in scene.face_ids().zip(of_face) {
        let (origin, vector) = largest[piece as usize];
        let normal = vector.normalize_or_zero();
        let corners = scene.positions(&scene.faces[face.0 as usize]);
        is_flat[piece as usize] &= corners.iter().all(|&v| normal.dot(v - origin).abs() <= tolerance);
    }
    is_flat
}

/// Returns the distance, in m, within which vertices are one, and within which a vertex lies on an edge.
///
/// It covers the rounding of the coordinates, for any orientation of the faces, and some ulps.
pub(crate) fn joint(scene: &Scene) -> f64 {
    scene.slack().max(scene.apart(ULPS))
}

/// The ulps by which the position of a vertex may be off.
const ULPS: f64 = 64.0;

/// The gap, in units of the smaller face's size, up to which faces meet.
///
/// Coordinates that a program computed, with cancellation, and wrote in full are off by more than their last digit.
const COMPUTED: f64 = 1e-8;

/// A part of an edge between two vertices, with the faces, or sets of faces, that run along it.
///
/// Each has the number of runs in the sense of `ends`, less those in the other.
struct Joint {
    ends: [u32; 2],
    runs: Vec<(u32, i32)>,
}

impl Joint {
    /// Adds up the runs of each set, and removes sets that cancel.
    fn by_set(&mut self, sets: &mut DisjointSets) {
        let mut sums: BTreeMap<u32, i32> = BTreeMap::new();
        for &(face, sense) in &self.runs {
            *sums.entry(super::index(sets.find(face as usize))).or_default() += sense;
        }
        self.runs = sums.into_iter().filter(|run| run.1 != 0).collect();
    }
}

/// Edges that no single other edge matches, divided at each other's vertices.
struct Parted {
    edges: Vec<(u32, [u32; 2], Vec<u32>)>,
    /// Vertices that are replaced by another one.
    welded: HashMap<u32, u32>,
    /// The greatest distance, in m, of vertices that count as one, and of a vertex from an edge that it divides, among those above the rounding of the coordinates.
    misfit: f64,
}

impl Parted {
    fn new(scene: &Scene, open: &[(u32, [u32; 2])]) -> Self {
        let rounding = joint(scene);
        let of_face = |face: u32| {
            let (low, high) = super::bounding_box(&scene.positions(&scene.faces[face as usize]));
            rounding.max(COMPUTED * low.distance(high))
        };
        // The tolerance of a vertex, by the smallest face around it.
        let mut tolerances: BTreeMap<u32, f64> = BTreeMap::new();
        for &(face, ends) in open {
            let own = of_face(face);
            for v in ends {
                let least = tolerances.entry(v).or_insert(own);
                *least = least.min(own);
            }
        }
        let mut misfit = 0.0_f64;
        let mut vertices: Vec<u32> = tolerances.keys().copied().collect();
        let at = |v: u32| scene.vertices[v as usize];
        let around = |v: &u32| (at(*v) - 0.5 * tolerances[v], at(*v) + 0.5 * tolerances[v]);
        let mut sets = DisjointSets::new(vertices.len());
        // The faces around each set of vertices: two vertices of one face never become one, however small it is.
        let mut around_set: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); vertices.len()];
        for (face, ends) in open {
            for k in ends.iter().filter_map(|v| vertices.binary_search(v).ok()) {
                around_set[k].insert(*face);
            }
        }
        overlapping_pairs(vertices.iter().map(around).collect(), |a, b| {
            let [one, other] = [a, b].map(|k| sets.find(k as usize));
            let [v, w] = [a, b].map(|k| vertices[k as usize]);
            let distance = at(v).distance(at(w));
            let is_near = distance <= tolerances[&v].min(tolerances[&w]);
            if is_near && one != other && around_set[one].is_disjoint(&around_set[other]) {
                let both = [one, other].map(|set| std::mem::take(&mut around_set[set]));
                sets.join(one, other);
                around_set[one.min(other)] = both.into_iter().flatten().collect();
                if distance > rounding {
                    misfit = misfit.max(distance);
                }
            }
        });
        let mut welded = HashMap::new();
        for (k, &v) in vertices.iter().enumerate() {
            let one = vertices[sets.find(k)];
            if one != v {
                welded.insert(v, one);
            }
        }
        vertices.retain(|v| !welded.contains_key(v));
        let tree = BoxTree::new(vertices.iter().map(|&v| (at(v), at(v))).collect());
        let one = |v: u32| welded.get(&v).copied().unwrap_or(v);
        let edges = open.iter().map(|&(face, ends)| {
            let ends = ends.map(one);
            let [from, to] = ends.map(at);
            let along = (to - from).normalize_or_zero();
            let mut on_it: Vec<(f64, u32)> = Vec::new();
            let tolerance = of_face(face);
            let near = (from.min(to) - tolerance, from.max(to) + tolerance);
            tree.overlapping(near, &mut |k| {
                let v = vertices[k as usize];
                let r = at(v) - from;
                let place = along.dot(r);
                let is_between = place > 0.0 && place < from.distance(to) && !ends.contains(&v);
                let aside = (r - place * along).length();
                if is_between && aside <= tolerance.min(tolerances[&v]) {
                    on_it.push((place, v));
                    if aside > rounding {
                        misfit = misfit.max(aside);
                    }
                }
            });
            on_it.sort_by(|a, b| a.0.total_cmp(&b.0));
            (face, ends, on_it.into_iter().map(|(_, v)| v).collect())
        });
        let edges = edges.collect();
        Self { edges, welded, misfit }
    }

    /// Returns the parts of all edges, with the faces that run along each.
    fn joints(&self) -> Vec<Joint> {
        let mut runs: BTreeMap<[u32; 2], Vec<(u32, i32)>> = BTreeMap::new();
        for (face, [from, to], between) in &self.edges {
            let stops: Vec<u32> = [*from]
                .into_iter()
                .chain(between.iter().copied())
                .chain([*to])
                .collect();
            for part in stops.windows(2).filter(|part| part[0] != part[1]) {
                let ends = [part[0].min(part[1]), part[0].max(part[1])];
                let sense = if part[0] < part[1] { 1 } else { -1 };
                runs.entry(ends).or_default().push((*face, sense));
            }
        }
        runs.into_iter().map(|(ends, runs)| Joint { ends, runs }).collect()
    }

    /// Returns the outlines of faces that have other corners than in the scene.
    fn outlines(&self, scene: &Scene) -> HashMap<u32, Vec<DVec3>> {
        let between: HashMap<(u32, [u32; 2]), &Vec<u32>> = self
            .edges
            .iter()
            .filter(|edge| !edge.2.is_empty())
            .map(|(face, ends, between)| ((*face, *ends), between))
            .collect();
        let one = |v: u32| self.welded.get(&v).copied().unwrap_or(v);
        let outline = |face: FaceId| {
            let own: Vec<[u32; 2]> = edges(scene, face).map(|(a, b)| [a, b]).collect();
            let meant: Vec<u32> = own
                .iter()
                .flat_map(|ends| {
                    let ends = ends.map(one);
                    let on_it = between
                        .get(&(face.0, ends))
                        .into_iter()
                        .flat_map(|on_it| on_it.iter().copied());
                    [ends[0]].into_iter().chain(on_it)
                })
                .collect();
            let is_same = own.iter().map(|ends| ends[0]).eq(meant.iter().copied());
            (!is_same).then(|| (face.0, meant.iter().map(|&v| scene.vertices[v as usize]).collect()))
        };
        if between.is_empty() && self.welded.is_empty() {
            return HashMap::new();
        }
        scene.face_ids().filter_map(outline).collect()
    }
}

/// The number of sets that are set aside one by one; after that, all that do not cancel are.
const MAX_ROUNDS: usize = 1000;

/// Returns for each set, by its first face, whether it is part of no closed surface.
fn open_sets(scene: &Scene, joints: &[Joint], sets: &mut DisjointSets) -> Vec<bool> {
    let mut is_open = vec![false; scene.faces.len()];
    let mut joints_of: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, joint) in joints.iter().enumerate() {
        for run in &joint.runs {
            joints_of.entry(run.0).or_default().push(k);
        }
    }
    if joints.is_empty() {
        return is_open;
    }
    let mut areas: HashMap<u32, f64> = HashMap::new();
    for face in scene.face_ids() {
        *areas.entry(super::index(sets.find(face.0 as usize))).or_default() +=
            polygon::area_vector(&scene.positions(&scene.faces[face.0 as usize])).length();
    }
    let mut smallest_first: Vec<u32> = joints_of.keys().copied().collect();
    smallest_first.sort_by(|a, b| areas[a].total_cmp(&areas[b]));
    let mut to_look_at: Vec<usize> = (0..joints.len()).collect();
    for round in 0.. {
        // Runs of one sense alone can never cancel.
        while let Some(k) = to_look_at.pop() {
            let left: Vec<(u32, i32)> = joints[k]
                .runs
                .iter()
                .copied()
                .filter(|run| !is_open[run.0 as usize])
                .collect();
            if left.iter().all(|run| run.1 > 0) || left.iter().all(|run| run.1 < 0) {
                for (set, _) in left {
                    is_open[set as usize] = true;
                    to_look_at.extend(&joints_of[&set]);
                }
            }
        }
        let sum = |k: usize| {
            let left = joints[k].runs.iter().filter(|run| !is_open[run.0 as usize]);
            left.map(|run| run.1).sum::<i32>()
        };
        let own = |set: u32, k: usize| joints[k].runs.iter().find(|run| run.0 == set).map_or(0, |run| run.1);
        let is_too_much = |set: u32| joints_of[&set].iter().all(|&k| sum(k) * own(set, k) > 0);
        let is_unbalanced = |set: u32| joints_of[&set].iter().any(|&k| sum(k) != 0);
        let left = || smallest_first.iter().copied().filter(|&set| !is_open[set as usize]);
        let Some(next) = left()
            .find(|&set| is_too_much(set))
            .or_else(|| left().find(|&set| is_unbalanced(set)))
        else {
            break;
        };
        let also: Vec<u32> = if round < MAX_ROUNDS {
            vec![next]
        } else {
            left().filter(|&set| is_unbalanced(set)).collect()
        };
        for set in also {
            is_open[set as usize] = true;
            to_look_at.extend(&joints_of[&set]);
        }
    }
    is_open
}
