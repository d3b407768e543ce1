//! Where walls stand on the faces of a plane: values on either side have nothing to do with each other.

use std::cell::OnceCell;
use std::collections::{BTreeMap, HashMap, HashSet};

use glam::DVec3;

use super::pieces::Pieces;
use super::planes::{DisjointSets, FaceEdge, flat_joints};
use super::{Mesh, Patch, PatchId};
use crate::geometry::box_pairs::{BoxTree, overlapping_pairs};
use crate::scene::{Corners, FaceId, Scene};

/// Lines nearer than this part of the scene's size are one: far more than rounding, far less than a patch.
const SLACK: f64 = 1e-9;

/// Walls that end so many units of the coordinates' last place above a face stand on it where faces are to end at walls, and so do those that end [nearer than this part](NEAR) of the scene's size, but
/// not from [this part](FAR) on: a cut that is not needed does no harm.
const PLACES: f64 = 4.0;
const NEAR: f64 = 1e-6;
const FAR: f64 = 1e-3;

/// A line along which a face meets the plane of another one, on whose front it stands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    pub(super) from: DVec3,
    pub(super) to: DVec3,
}

/// What stands on the faces of a scene, found when it is first asked for: whole faces of many planes, as a ground in triangles has, do not ask.
pub(super) struct Walls<'a> {
    scene: &'a Scene,
    /// Whether faces are to end at walls, so that those count that end a little above a face.
    ends_faces: bool,
    found: OnceCell<Feet>,
}

impl<'a> Walls<'a> {
    /// Takes a scene, and whether its faces are to end at walls.
    pub(super) fn of(scene: &'a Scene, ends_faces: bool) -> Self {
        Self {
            scene,
            ends_faces,
            found: OnceCell::new(),
        }
    }

    /// Returns the faces that walls stand on, not along their border alone, in pieces that end there.
    pub(super) fn pieces(&self) -> BTreeMap<FaceId, Pieces> {
        let feet = self.feet();
        let cut = feet.on_face.iter().filter_map(|(&face, here)| {
            let outline = self.scene.polygon(FaceId(face));
            Some((FaceId(face), Pieces::cut(&outline, &here.feet, feet.slack)?))
        });
        cut.collect()
    }

    fn feet(&self) -> &Feet {
        self.found.get_or_init(|| Feet::find(self.scene, self.ends_faces))
    }

    /// Tells whether walls on one of the faces or both stand along a line: along the middle half of it at least, without a gap.
    pub(super) fn stand_between(&self, faces: [u32; 2], from: DVec3, to: DVec3) -> bool {
        self.feet().stand_between(faces, from, to)
    }
}

/// The feet on one face, to find those near a line: a ground has many, and many patches.
#[derive(Clone, Debug)]
struct FaceFeet {
    feet: Vec<Foot>,
    boxes: BoxTree,
}

/// The feet of walls by the face that they stand on.
#[derive(Clone, Debug, Default)]
struct Feet {
    on_face: HashMap<u32, FaceFeet>,
    /// The faces that have a wall elsewhere than along a border that no face of the plane continues.
    parted: HashSet<u32>,
    slack: f64,
}

impl Feet {
    /// Finds what stands on the faces of a scene, within [`Scene::slack`] or, where faces are to end there, within a few units of its last place. Work: O(n log n) for n faces, and the pairs of faces that touch.
    fn find(scene: &Scene, ends_faces: bool) -> Self {
        if scene.faces.is_empty() {
            return Self::default();
        }
        let (low, high) = scene.bounding_box();
        let size = (high - low).length();
        let slack = scene.slack().max(SLACK * size);
        let slack = if ends_faces {
            slack.max((PLACES * scene.last_place()).clamp(NEAR * size, FAR * size))
        } else {
            slack
        };
        let outlines: Vec<Vec<DVec3>> = scene.face_ids().map(|face| scene.polygon(face)).collect();
        let normals: Vec<DVec3> = scene
            .face_ids()
            .map(|face| scene.area_vector(face).normalize_or_zero())
            .collect();
        let boxes = scene.faces.iter().map(|face| {
            let (least, greatest) = scene.positions(face).bounding_box();
            (least - slack, greatest + slack)
        });
        let mut on_face: HashMap<u32, Vec<Foot>> = HashMap::new();
        overlapping_pairs(boxes.collect(), |a, b| {
            for (ground, wall) in [(a, b), (b, a)] {
                let plane = (outlines[ground as usize][0], normals[ground as usize]);
                if let Some(foot) = foot(plane, &outlines[wall as usize], slack) {
                    on_face.entry(ground).or_default().push(foot);
                }
            }
        });
        let on_face = on_face.into_iter();
        let mut feet = Self {
            on_face: on_face.map(|(face, feet)| (face, FaceFeet::new(feet))).collect(),
            parted: HashSet::new(),
            slack,
        };
        let beside: HashMap<FaceEdge, FaceId> = flat_joints(scene)
            .into_iter()
            .flat_map(|(one, other)| [(one, other.0), (other, one.0)])
            .collect();
        for (&face, here) in &feet.on_face {
            let outline = &outlines[face as usize];
            for foot in &here.feet {
                let border = (0..outline.len()).find(|&k| {
                    let edge = Foot {
                        from: outline[k],
                        to: outline[(k + 1) % outline.len()],
                    };
                    [foot.from, foot.to].iter().all(|&end| edge.line_distance(end) <= slack)
                });
                match border.map(|k| beside.get(&(FaceId(face), k))) {
                    None => feet.parted.extend([face]),
                    Some(Some(other)) => feet.parted.extend([face, other.0]),
                    Some(None) => {}
                }
            }
        }
        feet
    }

    /// Tells whether walls on one of the faces or both stand along a line: along the middle half of it at least, without a gap.
    fn stand_between(&self, faces: [u32; 2], from: DVec3, to: DVec3) -> bool {
        let middle = [from.lerp(to, 0.25), from.lerp(to, 0.75)];
        let near = (
            middle[0].min(middle[1]) - self.slack,
            middle[0].max(middle[1]) + self.slack,
        );
        let mut is_one = false;
        // Where walls of several faces stand, as distances from the middle half's start.
        let mut parts: Vec<[f64; 2]> = Vec::new();
        for here in faces.iter().filter_map(|face| self.on_face.get(face)) {
            here.boxes.overlapping(near, &mut |k| {
                let foot = &here.feet[k as usize];
                is_one |= middle.iter().all(|&end| foot.distance(end) <= self.slack);
                if !is_one {
                    parts.extend(foot.part_along(middle, self.slack));
                }
            });
        }
        is_one || self.cover(parts, middle[0].distance(middle[1]))
    }

    /// Tells whether parts of a line cover it from 0 to its length; those that were meant to touch do.
    fn cover(&self, mut parts: Vec<[f64; 2]>, length: f64) -> bool {
        parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let without_gap = parts.iter().try_fold(0.0_f64, |reached, &[start, end]| {
            (start <= reached + self.slack).then_some(reached.max(end))
        });
        !parts.is_empty() && without_gap.is_some_and(|reached| reached >= length - self.slack)
    }
}

impl FaceFeet {
    fn new(feet: Vec<Foot>) -> Self {
        let boxes = feet.iter().map(|foot| (foot.from.min(foot.to), foot.from.max(foot.to)));
        Self {
            boxes: BoxTree::new(boxes.collect()),
            feet,
        }
    }
}

impl Foot {
    fn line_distance(&self, point: DVec3) -> f64 {
        (point - self.from).reject_from(self.to - self.from).length()
    }

    fn distance(&self, point: DVec3) -> f64 {
        let along = self.to - self.from;
        let t = ((point - self.from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        point.distance(self.from + t * along)
    }

    /// Returns from where to where on a line, in m from its start, the foot stands, if all of it that is beside the line lies on it.
    fn part_along(&self, [start, end]: [DVec3; 2], slack: f64) -> Option<[f64; 2]> {
        let length = start.distance(end);
        let unit = (end - start).try_normalize()?;
        let [a, b] = [self.from, self.to].map(|point| unit.dot(point - start));
        let part = [a.min(b).max(0.0), a.max(b).min(length)];
        let lies_on = |t: &f64| self.distance(start + t * unit) <= slack;
        (part[0] <= part[1] && part.iter().all(lies_on)).then_some(part)
    }
}

/// Returns where a convex polygon that reaches in front of a plane, given by a point and its normal, meets the plane, if that is a line.
fn foot((origin, normal): (DVec3, DVec3), wall: &[DVec3], slack: f64) -> Option<Foot> {
    let height = |k: usize| normal.dot(wall[k % wall.len()] - origin);
    if !(0..wall.len()).any(|k| height(k) > slack) {
        return None;
    }
    let mut points = Vec::new();
    for k in 0..wall.len() {
        let (h, next) = (height(k), height(k + 1));
        if h.abs() <= slack {
            points.push(wall[k]);
        } else if next.abs() > slack && (h < 0.0) != (next < 0.0) {
            points.push(wall[k].lerp(wall[(k + 1) % wall.len()], h / (h - next)));
        }
    }
    let [from, to] = points[..] else { return None };
    (from.distance(to) > slack).then_some(Foot { from, to })
}

/// Gives patches of one plane vertices of their own where a wall stands between them.
pub(super) fn part(mesh: &mut Mesh, walls: &Walls<'_>) {
    // Faces that are patches, none of which continues another.
    if mesh.n_patches() == walls.scene.faces.len() && flat_joints(walls.scene).is_empty() {
        return;
    }
    let feet = walls.feet();
    if feet.parted.is_empty() {
        return;
    }
    let all = mesh.patches.iter().enumerate();
    let patches: Vec<(usize, &Patch)> = all.filter(|patch| feet.parted.contains(&patch.1.face.0)).collect();
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
            if feet.stand_between(faces, place(from), place(to)) {
                parted.extend([(from, to), (to, from)]);
            }
        }
    }
    if parted.is_empty() {
        return;
    }
    // Patches stay together at a vertex where a way from one to the other leads around it: at the end of a wall.
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
        // The first keeps the old one: a set is known by its least member.
        let mut own: HashMap<usize, u32> = HashMap::from([(0, vertex)]);
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
