//! Connected occluders seen as one, by their outline.
//!
//! Polygons that share edges and wind alike have an outline from a point x: the edges between one that faces x and one that does not, or none. Each direction is stopped by as many of the polygons that face x as the outline goes around it.
//! If a direction c is to the left of all edges of the outline, each edge spans a triangle with c, and a direction is in as many triangles as the outline goes around it:
//! the triangles cover exactly what the polygons hide. Polygons with an edge that has c on its right, as in folds near the border, are left to themselves, and the others have an outline of their own.
//! Side by side around c, they cut a target into few pieces, where the polygons would cut it into hundreds.

use foldhash::{HashMap, HashMapExt as _};
use glam::DVec3;

use super::bodies::Edge;
use super::flat::Flat;
use super::shadow::{EDGE_ON, HalfSpace};

/// The fewest polygons of a group: fewer cut a target into few pieces.
pub(super) const MIN_SIDES: usize = 16;

/// The most times that polygons are left out of a group before all of it is.
const TRIALS: usize = 6;

/// The number of points in a row without a useful outline after which a group is given up.
const MAX_VAIN: u32 = 16;

/// A group of connected occluders, all of them between the planes of the receiver and of the target.
#[derive(Debug)]
pub(super) struct Group {
    /// The planes of the polygons.
    planes: Vec<Flat>,
    edges: Vec<Edge>,
    /// The mean of the corners, the way to c.
    middle: DVec3,
    /// True if no edge is a border: polygons that do not face a point are then behind those that do.
    is_closed: bool,
    /// For each polygon, whether it faces the point; false at the end, for what lies beyond a border.
    faces: Vec<bool>,
    /// For each polygon, whether it faces the point and is among those whose outline the triangles fill: one with an edge that has c on its right is not.
    spans: Vec<bool>,
    /// The triangles, as three half-spaces each, in the order of their angles.
    triangles: Vec<(f64, [HalfSpace; 3])>,
    /// The number of points in a row whose outline was of no use.
    n_vain: u32,
}

/// An occluder of a group that is sought.
pub(super) struct Member<'a> {
    pub(super) corners: &'a [DVec3],
    pub(super) plane: &'a Flat,
}

/// The group of an occluder, and its place among those of the group.
pub(super) type Place = (usize, usize);

impl Group {
    /// Returns the groups among some occluders, and where each of these is; `target` is a point near all of the target.
    pub(super) fn all(members: &[Option<Member<'_>>], target: DVec3) -> (Vec<Self>, Vec<Option<Place>>) {
        let mut places = vec![None; members.len()];
        let key = |v: DVec3| v.to_array().map(f64::to_bits);
        // An edge that several polygons have in one direction belongs to none of them: each then has a border there.
        let mut by_edge: HashMap<_, Option<usize>> = HashMap::new();
        for (k, member) in members.iter().enumerate() {
            for [from, to] in member.iter().flat_map(|member| edges_of(member.corners)) {
                let known = by_edge.entry([key(from), key(to)]);
                known.and_modify(|owner| *owner = None).or_insert(Some(k));
            }
        }
        let owner = |ends: [DVec3; 2]| by_edge.get(&ends.map(key)).copied().flatten();
        let across = |[from, to]: [DVec3; 2]| owner([from, to]).and_then(|_| owner([to, from]));
        let (mut groups, mut is_seen) = (Vec::new(), vec![false; members.len()]);
        for first in 0..members.len() {
            if members[first].is_none() || std::mem::replace(&mut is_seen[first], true) {
                continue;
            }
            let (mut found, mut next) = (vec![first], 0);
            while let Some(&k) = found.get(next) {
                next += 1;
                let others = members[k]
                    .iter()
                    .flat_map(|member| edges_of(member.corners))
                    .filter_map(across);
                found.extend(others.filter(|&other| !std::mem::replace(&mut is_seen[other], true)));
            }
            if found.len() < MIN_SIDES {
                continue;
            }
            for (place, &k) in found.iter().enumerate() {
                places[k] = Some((groups.len(), place));
            }
            let own: Vec<&Member<'_>> = found.iter().filter_map(|&k| members[k].as_ref()).collect();
            let (mut edges, mut is_closed) = (Vec::new(), true);
            for (place, member) in own.iter().enumerate() {
                for ends in edges_of(member.corners) {
                    let other = across(ends).and_then(|other| places[other]).map(|(_, place)| place);
                    is_closed &= other.is_some();
                    let other = other.unwrap_or(own.len());
                    if place < other {
                        edges.push(Edge::new(ends, [place, other], target));
                    }
                }
            }
            let corners = || own.iter().flat_map(|member| member.corners);
            groups.push(Self {
                planes: own.iter().map(|member| *member.plane).collect(),
                edges,
                middle: corners().sum::<DVec3>() / corners().count() as f64,
                is_closed,
                faces: vec![false; own.len() + 1],
                spans: Vec::new(),
                triangles: Vec::new(),
                n_vain: 0,
            });
        }
        (groups, places)
    }

    /// Returns the triangles that cover what the group hides from a point; none where the polygons themselves are fewer, or not to be replaced.
    pub(super) fn look_from(&mut self, point: DVec3) -> impl Iterator<Item = &[HalfSpace; 3]> {
        self.triangles.clear();
        if self.n_vain < MAX_VAIN {
            self.fill(point);
            self.n_vain = if self.triangles.is_empty() { self.n_vain + 1 } else { 0 };
        }
        self.triangles.iter().map(|(_, triangle)| triangle)
    }

    /// Fills the outline from a point with triangles.
    fn fill(&mut self, point: DVec3) {
        for (faces, plane) in self.faces.iter_mut().zip(&self.planes) {
            *faces = plane.snapped_height(point, EDGE_ON) > 0.0;
        }
        self.spans.clone_from(&self.faces);
        let way = self.middle - point;
        let across = way.any_orthogonal_vector();
        let up = way.cross(across) / way.length();
        for _ in 0..TRIALS {
            self.triangles.clear();
            let mut is_star = true;
            for edge in &self.edges {
                let [first, second] = edge.sides.map(|side| self.spans[side]);
                if first == second {
                    continue;
                }
                let triangle = edge.triangle(point, first, way);
                if triangle[2].normal.dot(way) <= 0.0 {
                    self.spans[edge.sides[usize::from(second)]] = false;
                    is_star = false;
                } else if is_star {
                    let [x, y] = [across, up].map(|axis| axis.dot(edge.from - point));
                    self.triangles.push((y.atan2(x), triangle));
                }
            }
            if is_star {
                break;
            }
            self.triangles.clear();
        }
        let n_covered = (0..self.planes.len()).filter(|&place| self.covers(place)).count();
        if self.triangles.len() > n_covered {
            self.triangles.clear();
        }
        self.triangles.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// Returns whether the triangles from the last point cover a polygon of the group.
    pub(super) fn covers(&self, place: usize) -> bool {
        !self.triangles.is_empty() && (self.spans[place] || self.is_closed && !self.faces[place])
    }
}

/// Returns the edges of a polygon, from corner to corner.
fn edges_of(corners: &[DVec3]) -> impl Iterator<Item = [DVec3; 2]> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(&from, &to)| [from, to])
}
