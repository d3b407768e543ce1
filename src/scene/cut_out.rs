//! Cuts faces that are drawn on larger ones of their plane, as doors and windows on a wall, out of these.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use glam::DVec3;

use super::builder::without_repeats;
use super::overlap::{self, MAX_OVERLAPS, Overlap};
use super::split::{Outline, split};
use super::{Corners, Face, FaceId, MAX_FACES, Scene};
use crate::geometry::polygon;
use crate::scene::topology::edges;

mod piece;
mod rank;

use piece::{Piece, Plane, convex_faces};
use rank::Ranks;

/// The parts that were cut out of the faces of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct CutOut {
    /// The line of the first face that was cut out of a larger one.
    pub(super) line: u32,
    /// The number of faces that were cut out of larger ones.
    pub(super) count: usize,
    /// The area that larger faces lost, in m².
    pub(super) area: f64,
    /// The greatest distance of a corner from the plane of a larger face whose pieces end there, in m; 0 within the rounding.
    pub(super) moved: f64,
    /// The first line, and the number, of faces that lost all of their area.
    pub(super) covered: Option<(u32, usize)>,
}

/// A reason why overlapping faces stay as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refused {
    /// All of a face, or of a flat part of a surface, coincides with all of another; the one of the greater line comes first.
    Coincident([FaceId; 2]),
    /// There are more faces, or more vertices, than can be numbered.
    TooMany(&'static str),
}

/// Cuts faces that overlap with one winding in one plane, so that all area counts once; returns `None` if there are none.
///
/// Of two such faces, the one of the smaller flat part keeps the common area; of equal parts, the later. A flat part consists of the faces of one surface and one material that are connected by edges:
/// a triangulated wall is compared with a door as a whole. The rest of a face becomes triangles and quads in its place, with its surface, material and line.
///
/// Accuracy: the areas add up to a few ulps. Edges that are closer than [`Scene::slack`] become one, so in files with rounded coordinates areas change by up to the rounding.
/// Work: O(n log n) for n faces, and O(k log k) for k faces cut out of one.
///
/// # Errors
/// [`Refused`].
pub(super) fn cut_out(scene: &mut Scene) -> Result<Option<CutOut>, Refused> {
    let overlaps = overlap::all(scene);
    let Some(first) = overlaps.first() else {
        return Ok(None);
    };
    if overlaps.len() == MAX_OVERLAPS {
        return Err(Refused::Coincident(first.faces));
    }
    let tolerance = tolerance(scene);
    let ranks = Ranks::new(scene, &overlaps, tolerance)?;
    let planes = planes(scene, &overlaps, tolerance);
    let mut report = counted(scene, &overlaps, &ranks);
    let mut left_of = HashMap::new();
    let mut vertices = Vertices::of(scene, tolerance);
    for (face, cutters) in cutters(scene, &overlaps, &ranks, &planes) {
        let cutters: Vec<Vec<DVec3>> = cutters.iter().map(|&cutter| scene.polygon(cutter)).collect();
        let corners = scene.polygon(face);
        let plane = &planes[&face];
        report.moved = report.moved.max(plane.distance(&corners, &cutters));
        let pieces = plane.subtract(Piece::new(&corners), &cutters);
        let outlines: Vec<Vec<DVec3>> = pieces.iter().flat_map(|piece| convex_faces(piece.corners())).collect();
        let faces = vertices.faces(scene, scene.faces[face.0 as usize], &outlines)?;
        let area = |outline: &[DVec3]| polygon::area_vector(outline).length();
        let left = faces.iter().map(|left| area(&scene.positions(left)));
        report.area += area(&corners) - left.sum::<f64>();
        if faces.is_empty() {
            let (_, n) = report.covered.get_or_insert((scene.faces[face.0 as usize].line, 0));
            *n += 1;
        }
        left_of.insert(face, faces);
    }
    let old = std::mem::take(&mut scene.faces);
    for (id, face) in (0..).map(FaceId).zip(old) {
        match left_of.get(&id) {
            Some(left) => scene.faces.extend(left),
            None => scene.faces.push(face),
        }
    }
    if scene.faces.len() >= MAX_FACES as usize {
        return Err(Refused::TooMany("faces"));
    }
    // Overlaps that rounding keeps from being cut are refused rather than counted twice.
    match overlap::find(scene) {
        Some(faces) => Err(Refused::Coincident(faces)),
        None => Ok(Some(report)),
    }
}

/// Returns the distance, in m, below which points and lines are one.
fn tolerance(scene: &Scene) -> f64 {
    scene.slack().max(scene.apart(ULPS))
}

/// The distance, in ulps of f64, of lines that were meant to be one, where short edges are extended across a wall.
const ULPS: f64 = 512.0;

/// Returns a report with the number of faces that are cut out of others, without areas.
fn counted(scene: &Scene, overlaps: &[Overlap], ranks: &Ranks) -> CutOut {
    let place = |overlap: &Overlap| {
        let [winner, _] = ranks.ordered(overlap.faces);
        let line = scene.faces[winner.0 as usize].line;
        // Faces of one outline count as one; those without a line count one by one.
        (line, if line == 0 { winner.0 } else { 0 })
    };
    let places: BTreeSet<(u32, u32)> = overlaps.iter().map(place).collect();
    CutOut {
        line: places.first().map_or(0, |(line, _)| *line),
        count: places.len(),
        ..CutOut::default()
    }
}

/// Returns the faces that are cut, each with those that are cut out of it.
fn cutters(
    scene: &Scene,
    overlaps: &[Overlap],
    ranks: &Ranks,
    planes: &HashMap<FaceId, Plane>,
) -> BTreeMap<FaceId, BTreeSet<FaceId>> {
    let mut cutters: BTreeMap<FaceId, BTreeSet<FaceId>> = BTreeMap::new();
    // For each face, the larger faces that contain it as a whole.
    let mut around: HashMap<FaceId, Vec<FaceId>> = HashMap::new();
    for overlap in overlaps {
        let [winner, loser] = ranks.ordered(overlap.faces);
        cutters.entry(loser).or_default().insert(winner);
        if planes[&loser].contains(&scene.polygon(loser), &scene.polygon(winner)) {
            around.entry(winner).or_default().push(loser);
        }
    }
    for of_face in cutters.values_mut() {
        // A pane in a door is cut out of the door, and needs no cuts in the wall.
        let all = of_face.clone();
        let is_inner = |cutter: &FaceId| {
            around
                .get(cutter)
                .is_some_and(|of| of.iter().any(|other| all.contains(other)))
        };
        of_face.retain(|cutter| !is_inner(cutter));
    }
    cutters
}

/// Returns the plane of every face that overlaps another.
///
/// All faces that overlap one another share a plane, so that two lines cross in the same point in each of these faces.
fn planes(scene: &Scene, overlaps: &[Overlap], tolerance: f64) -> HashMap<FaceId, Plane> {
    let faces: BTreeSet<FaceId> = overlaps.iter().flat_map(|overlap| overlap.faces).collect();
    let groups = Groups::new(faces.iter().copied(), overlaps.iter().map(|overlap| overlap.faces));
    let mut largest: HashMap<FaceId, DVec3> = HashMap::new();
    for &face in &faces {
        let vector = scene.area_vector(face);
        let of_group = largest.entry(groups.of_face(face)).or_insert(vector);
        if vector.length_squared() > of_group.length_squared() {
            *of_group = vector;
        }
    }
    let plane = |face| Plane::new(largest[&groups.of_face(face)].normalize_or_zero(), tolerance);
    faces.iter().map(|&face| (face, plane(face))).collect()
}

/// Faces in groups, each named by its first face.
struct Groups(HashMap<FaceId, FaceId>);

impl Groups {
    /// Joins faces by pairs of them.
    fn new(faces: impl Iterator<Item = FaceId>, pairs: impl Iterator<Item = [FaceId; 2]>) -> Self {
        let mut groups = Self(faces.map(|face| (face, face)).collect());
        for pair in pairs {
            let [a, b] = pair.map(|face| groups.root(face));
            groups.0.insert(a.max(b), a.min(b));
        }
        let mut all: Vec<FaceId> = groups.0.keys().copied().collect();
        all.sort_unstable();
        for face in all {
            groups.root(face);
        }
        groups
    }

    /// Returns the current name of the group, and shortens the path to it.
    fn root(&mut self, face: FaceId) -> FaceId {
        let mut root = face;
        while self.0[&root] != root {
            root = self.0[&root];
        }
        let mut next = face;
        while next != root {
            next = self.0.insert(next, root).unwrap_or(root);
        }
        root
    }

    /// Returns the first face of the group of a face.
    fn of_face(&self, face: FaceId) -> FaceId {
        self.0[&face]
    }
}

/// The vertices of a scene by their positions.
struct Vertices {
    ids: HashMap<[u64; 3], u32>,
    /// The vertices in cubes of four times the tolerance: all points within the tolerance of a point lie in at most two of them along each axis.
    cells: HashMap<[i64; 3], Vec<DVec3>>,
    tolerance: f64,
}

impl Vertices {
    fn of(scene: &Scene, tolerance: f64) -> Self {
        let mut vertices = Self {
            ids: HashMap::with_capacity(scene.vertices.len()),
            cells: HashMap::with_capacity(scene.vertices.len()),
            tolerance,
        };
        for (id, &v) in (0..).zip(&scene.vertices) {
            vertices.insert(v, id);
        }
        vertices
    }

    fn insert(&mut self, position: DVec3, id: u32) {
        self.ids.insert(key(position), id);
        self.cells.entry(self.cell(position)).or_default().push(position);
    }

    fn cell(&self, position: DVec3) -> [i64; 3] {
        #[expect(clippy::cast_possible_truncation, reason = "coordinates are at most 2^53 tolerances")]
        let index = |x: f64| (x / (4.0 * self.tolerance)).floor() as i64;
        position.to_array().map(index)
    }

    /// Returns the vertex within the tolerance of a position, or the position itself.
    ///
    /// Pieces that meet in a point compute it from different lines.
    fn joined(&self, position: DVec3) -> DVec3 {
        if self.ids.contains_key(&key(position)) {
            return position;
        }
        let corner = |k: u32| {
            let side = |bit: u32| {
                if (k >> bit) & 1 == 0 {
                    -self.tolerance
                } else {
                    self.tolerance
                }
            };
            self.cell(position + DVec3::new(side(0), side(1), side(2)))
        };
        let cells: BTreeSet<[i64; 3]> = (0..8).map(corner).collect();
        let around = cells.iter().filter_map(|cell| self.cells.get(cell)).flatten();
        let nearest = around.min_by(|a, b| a.distance_squared(position).total_cmp(&b.distance_squared(position)));
        let near = nearest.filter(|v| v.distance(position) <= self.tolerance);
        near.copied().unwrap_or(position)
    }

    /// Returns an outline with its corners joined to existing vertices and to one another within the tolerance; empty if the outline is no wider than that.
    fn joined_outline(&self, corners: &[DVec3]) -> Vec<DVec3> {
        let mut outline: Vec<DVec3> = Vec::with_capacity(corners.len());
        for &corner in corners {
            let corner = self.joined(corner);
            let known = outline.iter().find(|known| known.distance(corner) <= self.tolerance);
            outline.push(known.copied().unwrap_or(corner));
        }
        without_repeats(&mut outline);
        let length: f64 = (0..outline.len())
            .map(|k| outline[k].distance(outline[(k + 1) % outline.len()]))
            .sum();
        if 2.0 * polygon::area_vector(&outline).length() <= self.tolerance * length {
            outline.clear();
        }
        outline
    }

    fn id(&mut self, scene: &mut Scene, position: DVec3) -> Result<u32, Refused> {
        if let Some(&known) = self.ids.get(&key(position)) {
            return Ok(known);
        }
        let new = u32::try_from(scene.vertices.len()).ok().filter(|&id| id < MAX_FACES);
        let new = new.ok_or(Refused::TooMany("vertices"))?;
        scene.vertices.push(position + 0.0);
        self.insert(position + 0.0, new);
        Ok(new)
    }

    /// Returns the faces made of outlines, otherwise like `face`; outlines without area are left out.
    fn faces(&mut self, scene: &mut Scene, face: Face, outlines: &[Vec<DVec3>]) -> Result<Vec<Face>, Refused> {
        let mut faces = Vec::new();
        for outline in outlines {
            let outline = self.joined_outline(outline);
            let Outline::Faces(parts) = split(&outline) else {
                continue;
            };
            let ids = outline
                .iter()
                .map(|&v| self.id(scene, v))
                .collect::<Result<Vec<_>, _>>()?;
            let id = |k: u32| ids[k as usize];
            faces.extend(parts.into_iter().map(|part| Face {
                corners: match part {
                    Corners::Triangle(corners) => Corners::Triangle(corners.map(id)),
                    Corners::Quad(corners) => Corners::Quad(corners.map(id)),
                },
                ..face
            }));
        }
        Ok(faces)
    }
}

/// Returns the bits of a position, with −0 as 0: equal positions are the same vertex.
pub(super) fn key(position: DVec3) -> [u64; 3] {
    (position + 0.0).to_array().map(f64::to_bits)
}

#[cfg(test)]
mod tests;
