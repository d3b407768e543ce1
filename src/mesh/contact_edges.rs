//! Contact edges, where faces stand on others or pierce them: light is discontinuous across them (D0 discontinuities).

use std::cell::OnceCell;
use std::collections::BTreeMap;

use foldhash::{HashMap, HashMapExt as _, HashSet, HashSetExt as _};
use glam::DVec3;
use rayon::prelude::*;

use super::contact_edge::ContactEdge;
use super::pieces::Pieces;
use super::planes::{FaceEdge, flat_joints, flat_joints_by};
use crate::disjoint_sets::DisjointSets;
use crate::geometry::box_pairs::{BoxTree, collected_pairs, overlap};
use crate::geometry::polygon;
use crate::scene::{FaceId, Positions, Scene};
use crate::threads;

/// The part of the smaller face's size within which a face that ends near another stands on it; a cut that is not needed does no harm.
const NEAR: f64 = 1e-6;

/// The same in units of the file's last decimal place, up to this part of the smaller face's size.
const PLACES: f64 = 4.0;
const FAR: f64 = 2e-3;

/// The fraction of the smaller face's size up to which a face that ends above another also cuts it.
///
/// Light passes below such a face, but a patch across the gap would leak far more. The size is that of all faces which continue them in their planes.
const ALMOST: f64 = 1e-3;

/// The greatest difference of unit normals of faces that continue each other: one plane, in rounded coordinates.
const BEND: f64 = 1e-4;

/// The greatest height of a hanging face above another, as a part of its own height and size.
const OF_HEIGHT: f64 = 0.25;

/// The rounding of a coordinate, and of heights and meeting points from coordinates.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// The contact edges of a scene: they are found once, when they are first used.
///
/// A contact edge is where a face that rises in front of another meets that one's plane: the bottom of a wall on a floor, or the line in which it passes through it. Its two sides see different light.
/// Faces meet if they were meant to: up to the rounding of the scene's file, and up to a millionth of the smaller one's size. Where a face ends up to a thousandth of that size in front of another, the contact edge is
/// below it: patches end there, and light still passes through the slit.
///
/// Work: O(n log n) for n faces, and the pairs of faces whose boxes overlap. Source: [`BAUM_1991`](crate::references::BAUM_1991). Departures: none.
#[derive(Debug)]
pub struct ContactEdges<'a> {
    pub(super) scene: &'a Scene,
    joints: OnceCell<Vec<(FaceEdge, FaceEdge)>>,
    found: OnceCell<Found>,
    pieces: OnceCell<BTreeMap<FaceId, Pieces>>,
}

impl<'a> ContactEdges<'a> {
    /// Wraps a scene, whose contact edges are found when they are first used.
    #[must_use]
    pub fn of(scene: &'a Scene) -> Self {
        Self {
            scene,
            joints: OnceCell::new(),
            found: OnceCell::new(),
            pieces: OnceCell::new(),
        }
    }

    /// Returns the number of faces that contact edges cross elsewhere than along their borders.
    #[must_use]
    pub fn n_crossed_faces(&self) -> usize {
        self.pieces().len()
    }

    /// Returns the faces that contact edges cross, in pieces between these.
    pub(super) fn pieces(&self) -> &BTreeMap<FaceId, Pieces> {
        self.pieces.get_or_init(|| {
            let found = self.found();
            let scene = self.scene;
            let cut = found.of_faces(|face, here| {
                let outline = scene.positions(&scene.faces[face as usize]);
                Some((FaceId(face), Pieces::cut(&outline, here.edges)?))
            });
            cut.into_iter().collect()
        })
    }

    pub(super) fn found(&self) -> &Found {
        self.found.get_or_init(|| Found::of(self.scene, self.flat_joints()))
    }

    /// Returns the edges along which two faces of one plane continue each other.
    pub(super) fn flat_joints(&self) -> &[(FaceEdge, FaceEdge)] {
        self.joints.get_or_init(|| flat_joints(self.scene))
    }

    /// Returns whether faces on one or both of two faces stand along a line: at least along its middle half, without a gap.
    pub(super) fn stand_between(&self, faces: [u32; 2], from: DVec3, to: DVec3) -> bool {
        self.found().stand_between(faces, from, to)
    }
}

/// The contact edges on one face, to find those near a line: a ground has many of both.
#[derive(Clone, Copy, Debug)]
pub(super) struct OnFace<'a> {
    edges: &'a [ContactEdge],
    /// The boxes of many edges.
    boxes: Option<&'a BoxTree>,
}

/// The contact edges by the face that they lie on.
#[derive(Clone, Debug, Default)]
pub(super) struct Found {
    /// Those on face k are `edges[first[k]..first[k + 1]]`.
    first: Vec<u32>,
    edges: Vec<ContactEdge>,
    /// The boxes of faces with many.
    boxes: HashMap<u32, BoxTree>,
    /// The faces that have a contact edge elsewhere than along a border that no face of the plane continues.
    pub(super) parted: HashSet<u32>,
}

impl Found {
    /// Finds the contact edges of a scene.
    fn of(scene: &Scene, joints: &[(FaceEdge, FaceEdge)]) -> Self {
        let [touching, hanging] = Self::pairs(scene);
        let mut on_faces = Self::new(scene.faces.len(), &touching, &hanging);
        drop((touching, hanging));
        on_faces.parted = parted(joints, scene, &on_faces);
        on_faces
    }

    /// Returns the contact edges of all pairs of faces, with the face on which each lies: those of touching, then those of hanging faces.
    fn pairs(scene: &Scene) -> [Vec<(u32, ContactEdge)>; 2] {
        let outlines: Vec<Positions> = threads::collect_from(&scene.faces, |face| scene.positions(face));
        let normals: Vec<DVec3> =
            threads::collect_from(&outlines, |outline| polygon::area_vector(outline).normalize_or_zero());
        let reaches = reaches(scene, &outlines);
        let found = |is_hanging: bool| {
            let boxes = threads::collect(outlines.len(), |face| {
                let ((least, greatest), reach) = (bounding_box(&outlines[face]), &reaches[face]);
                let around = if is_hanging { reach.hanging } else { reach.touching };
                (least - around, greatest + around)
            });
            collected_pairs(boxes, |a, b, edges: &mut Vec<(u32, ContactEdge)>| {
                let reach = reaches[a as usize].min(reaches[b as usize]);
                for (ground, wall) in [(a, b), (b, a)] {
                    let [ground_corners, wall_corners] = [ground, wall].map(|face| &outlines[face as usize]);
                    let plane = Plane {
                        origin: ground_corners[0],
                        normal: normals[ground as usize],
                    };
                    let edge = if is_hanging {
                        plane.edge_below(ground_corners, wall_corners, reach)
                    } else {
                        let ends = Plane::line_of(wall_corners, &plane.heights(wall_corners), reach.touching);
                        ends.map(|ends| plane.contact_edge(ends, reach))
                    };
                    edges.extend(edge.map(|edge| (ground, edge)));
                }
            })
        };
        // One after the other, to save memory: each is work for all threads.
        [false, true].map(found)
    }

    /// Returns the contact edges on a face; `None` if there are none.
    pub(super) fn on_face(&self, face: u32) -> Option<OnFace<'_>> {
        let [begin, end] = [face, face + 1].map(|k| self.first[k as usize] as usize);
        (begin < end).then(|| OnFace {
            edges: &self.edges[begin..end],
            boxes: self.boxes.get(&face),
        })
    }

    /// Returns the results of `work` for the faces with contact edges, in order.
    fn of_faces<R: Send, I: IntoIterator<Item = R>>(&self, work: impl Fn(u32, OnFace<'_>) -> I + Sync) -> Vec<R> {
        let n = self.first.len().saturating_sub(1);
        let of_face = |face: usize| {
            let face = u32::try_from(face).expect("faces are counted in 32 bits");
            let found = self.on_face(face).map(|here| work(face, here));
            found.into_iter().flatten()
        };
        threads::collect_flat(n, of_face)
    }

    /// Stores the edges with the faces on which they lie. Hanging ones come last: pieces depend on the order.
    fn new(n_faces: usize, touching: &[(u32, ContactEdge)], hanging: &[(u32, ContactEdge)]) -> Self {
        let all = || touching.iter().chain(hanging);
        let mut first = vec![0_u32; n_faces + 1];
        for (face, _) in all() {
            first[*face as usize + 1] += 1;
        }
        for face in 0..n_faces {
            first[face + 1] += first[face];
        }
        let mut next = first.clone();
        let mut order = vec![0_u32; touching.len() + hanging.len()];
        for (k, (face, _)) in (0..).zip(all()) {
            order[next[*face as usize] as usize] = k;
            next[*face as usize] += 1;
        }
        let edge = |&k: &u32| {
            let k = k as usize;
            touching.get(k).unwrap_or_else(|| &hanging[k - touching.len()]).1
        };
        let edges: Vec<ContactEdge> = threads::collect_from(&order, edge);
        let mut boxes = HashMap::new();
        for (face, range) in (0..).zip(first.windows(2)) {
            let here = &edges[range[0] as usize..range[1] as usize];
            if here.len() > FEW {
                boxes.insert(face, BoxTree::new(here.iter().map(box_around).collect()));
            }
        }
        Self {
            first,
            edges,
            boxes,
            parted: HashSet::new(),
        }
    }

    /// Returns whether faces on one or both of two faces stand along a line: at least along its middle half, without a gap.
    pub(super) fn stand_between(&self, faces: [u32; 2], from: DVec3, to: DVec3) -> bool {
        let middle = [from.lerp(to, 0.25), from.lerp(to, 0.75)];
        let mut is_one = false;
        // The ranges where faces stand, as distances from the middle half's start.
        let mut parts: Vec<[f64; 2]> = Vec::new();
        let mut tolerance = 0.0_f64;
        for here in faces.iter().filter_map(|&face| self.on_face(face)) {
            for edge in here.near(&middle) {
                is_one |= middle.iter().all(|&end| edge.distance(end) <= edge.tolerance);
                if !is_one && let Some(part) = edge.part_along(middle) {
                    parts.push(part);
                    tolerance = tolerance.max(edge.tolerance);
                }
            }
        }
        is_one || cover(parts, middle[0].distance(middle[1]), tolerance)
    }
}

/// The distances up to which a face meets others of its size or more, in m.
#[derive(Clone, Copy, Debug)]
struct Reach {
    /// It touches them.
    touching: f64,
    /// It hangs over them.
    hanging: f64,
}

impl Reach {
    fn min(self, other: Self) -> Self {
        Self {
            touching: self.touching.min(other.touching),
            hanging: self.hanging.min(other.hanging),
        }
    }
}

/// Returns the distances up to which each face meets others.
fn reaches(scene: &Scene, outlines: &[Positions]) -> Vec<Reach> {
    let (slack, of_places) = (scene.slack(), PLACES * scene.last_place());
    let rounding = ROUNDING * scene.greatest_where_faces_meet();
    let sizes_in_plane = sizes_in_plane(scene, outlines);
    let of_face = |(outline, size_in_plane): (&Positions, f64)| {
        let size = size_of(bounding_box(outline));
        Reach {
            touching: of_places.clamp(NEAR * size, FAR * size).max(slack).max(rounding),
            hanging: (ALMOST * size_in_plane).min(OF_HEIGHT * size),
        }
    };
    outlines.iter().zip(sizes_in_plane).map(of_face).collect()
}

/// Returns the size of each face together with those that continue it in its plane: walls may be drawn in small faces, each with vertices of its own.
fn sizes_in_plane(scene: &Scene, outlines: &[Positions]) -> Vec<f64> {
    // 0 and -0 are equal, but their bits differ.
    let bits = |v: &DVec3| (*v + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut places: Vec<([u64; 3], u32)> = (0..).zip(&scene.vertices).map(|(k, v)| (bits(v), k)).collect();
    places.par_sort_unstable();
    let mut first: Vec<u32> = vec![0; places.len()];
    for at_one in places.chunk_by(|a, b| a.0 == b.0) {
        for &(_, k) in at_one {
            first[k as usize] = at_one[0].1;
        }
    }
    drop(places);
    let mut sets = DisjointSets::new(outlines.len());
    for (one, other) in flat_joints_by(scene, |vertex| first[vertex as usize], BEND) {
        sets.join(one.0.0 as usize, other.0.0 as usize);
    }
    let mut boxes: Vec<(DVec3, DVec3)> = outlines.iter().map(|outline| bounding_box(outline)).collect();
    for face in 0..outlines.len() {
        let (own, whole) = (boxes[face], &mut boxes[sets.find(face)]);
        *whole = (whole.0.min(own.0), whole.1.max(own.1));
    }
    (0..outlines.len())
        .map(|face| size_of(boxes[sets.find(face)]))
        .collect()
}

fn size_of((least, greatest): (DVec3, DVec3)) -> f64 {
    (greatest - least).length()
}

fn bounding_box(outline: &[DVec3]) -> (DVec3, DVec3) {
    let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let grown = |(least, greatest): (DVec3, DVec3), &corner: &DVec3| (least.min(corner), greatest.max(corner));
    outline.iter().fold(empty, grown)
}

/// Returns the faces that have a contact edge elsewhere than along a border that no face of the plane continues.
fn parted(joints: &[(FaceEdge, FaceEdge)], scene: &Scene, found: &Found) -> HashSet<u32> {
    let beside: HashMap<FaceEdge, FaceId> = joints
        .iter()
        .flat_map(|&(one, other)| [(one, other.0), (other, one.0)])
        .collect();
    let found = found.of_faces(|face, here| {
        let outline = scene.positions(&scene.faces[face as usize]);
        let mut parted = Vec::new();
        for edge in here.edges {
            let border = (0..outline.len()).find(|&k| {
                let (start, end) = (outline[k], outline[(k + 1) % outline.len()]);
                let is_near = |point: DVec3| (point - start).reject_from(end - start).length() <= edge.tolerance;
                is_near(edge.from) && is_near(edge.to)
            });
            match border.map(|k| beside.get(&(FaceId(face), k))) {
                None => parted.push(face),
                Some(Some(other)) => parted.extend([face, other.0]),
                Some(None) => {}
            }
        }
        parted
    });
    found.into_iter().collect()
}

/// Returns whether parts of a line cover it from 0 to its length, up to the tolerance of faces that were meant to touch.
fn cover(mut parts: Vec<[f64; 2]>, length: f64, tolerance: f64) -> bool {
    parts.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let without_gap = parts.iter().try_fold(0.0_f64, |reached, &[start, end]| {
        (start <= reached + tolerance).then_some(reached.max(end))
    });
    !parts.is_empty() && without_gap.is_some_and(|reached| reached >= length - tolerance)
}

/// The number of contact edges up to which they are tested one by one.
const FEW: usize = 8;

impl OnFace<'_> {
    /// Returns the contact edges whose boxes overlap that of some points, in their order.
    pub(super) fn near(&self, points: &[DVec3]) -> Vec<ContactEdge> {
        let around = bounding_box(points);
        let Some(boxes) = self.boxes else {
            let near = self.edges.iter().filter(|edge| overlap(box_around(edge), around));
            return near.copied().collect();
        };
        let mut near = Vec::new();
        boxes.overlapping(around, &mut |k| near.push(k));
        near.sort_unstable();
        near.into_iter().map(|k| self.edges[k as usize]).collect()
    }
}

/// Returns the box around a contact edge and the points that count as on it.
fn box_around(edge: &ContactEdge) -> (DVec3, DVec3) {
    let (least, greatest) = bounding_box(&[edge.from, edge.to]);
    (least - edge.tolerance, greatest + edge.tolerance)
}

/// A plane, in front of which its normal points.
#[derive(Clone, Copy, Debug)]
struct Plane {
    origin: DVec3,
    normal: DVec3,
}

impl Plane {
    fn height(self, point: DVec3) -> f64 {
        self.normal.dot(point - self.origin)
    }

    /// Returns the heights of the corners of a face; 0 for a fourth corner that it lacks.
    fn heights(self, wall: &[DVec3]) -> [f64; 4] {
        std::array::from_fn(|k| wall.get(k).map_or(0.0, |&corner| self.height(corner)))
    }

    /// Returns the ends of the line in which a face that reaches in front of the plane meets it, if it does; corners within a tolerance are on the plane.
    fn line_of(wall: &[DVec3], heights: &[f64; 4], tolerance: f64) -> Option<[DVec3; 2]> {
        let heights = &heights[..wall.len()];
        if !heights.iter().any(|&h| h > tolerance) {
            return None;
        }
        let (mut points, mut n) = ([DVec3::ZERO; 4], 0);
        for (k, &h) in heights.iter().enumerate() {
            let (after, next) = (wall[(k + 1) % wall.len()], heights[(k + 1) % wall.len()]);
            if h.abs() <= tolerance {
                points[n] = wall[k];
            } else if next.abs() > tolerance && (h < 0.0) != (next < 0.0) {
                points[n] = wall[k].lerp(after, h / (h - next));
            } else {
                continue;
            }
            n += 1;
        }
        let points = &points[..n];
        if let [from, to] = *points {
            return (from.distance(to) > tolerance).then_some([from, to]);
        }
        // A corner on a straight edge is a third point.
        let farthest = |other: DVec3| {
            let by_distance = |a: &DVec3, b: &DVec3| other.distance(*a).total_cmp(&other.distance(*b));
            points.iter().copied().max_by(by_distance)
        };
        let to = farthest(*points.first()?)?;
        let from = farthest(to)?;
        (from.distance(to) > tolerance).then_some([from, to])
    }

    /// Returns whether more than a length of a segment lies in a convex polygon in the plane, or along its border.
    fn holds(self, ground: &[DVec3], [from, to]: [DVec3; 2], length: f64) -> bool {
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for (k, &corner) in ground.iter().enumerate() {
            let along = ground[(k + 1) % ground.len()] - corner;
            let inwards = self.normal.cross(along).normalize_or_zero();
            let [h, g] = [from, to].map(|end| inwards.dot(end - corner) + 0.5 * length);
            if h < 0.0 && g < 0.0 {
                return false;
            }
            if h < 0.0 {
                first = first.max(h / (h - g));
            } else if g < 0.0 {
                last = last.min(h / (h - g));
            }
        }
        (last - first) * from.distance(to) > 2.0 * length
    }

    fn contact_edge(self, [from, to]: [DVec3; 2], reach: Reach) -> ContactEdge {
        ContactEdge {
            from,
            to,
            tolerance: reach.touching,
            misfit: self.height(from).abs().max(self.height(to).abs()),
        }
    }

    /// Returns the line below which a convex polygon hangs over the ground in the plane, if it is longer than that in which it meets the plane.
    fn edge_below(self, ground: &[DVec3], wall: &[DVec3], reach: Reach) -> Option<ContactEdge> {
        let heights = self.heights(wall);
        let of_wall = heights[..wall.len()].iter();
        let (low, high) = of_wall.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &h| {
            (low.min(h), high.max(h))
        });
        let near = reach.hanging.min(OF_HEIGHT * (high - low));
        if near <= reach.touching {
            return None;
        }
        let hanging = Self::line_of(wall, &heights, near)?;
        let length = |[from, to]: [DVec3; 2]| from.distance(to);
        let touching = Self::line_of(wall, &heights, reach.touching).map_or(0.0, length);
        if length(hanging) <= touching + 2.0 * near || !self.holds(ground, hanging, near) {
            return None;
        }
        let ends = hanging.map(|end| end - self.height(end) * self.normal);
        Some(self.contact_edge(ends, reach))
    }
}
