//! The view factors from a free point to all patches of a mesh, by exact clipping.

use std::cell::Cell;

use glam::DVec3;

use super::plates::{Ball, BallTree, Cone, Plate};
use super::shadow::{Fragments, HalfSpace, subtract};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::mesh::{Mesh, PatchId};
use crate::scene::Scene;
use crate::visibility::occluders::{OccluderId, OccluderIndex};

/// Faces and patches within this part of the size of the scene of one plane lie in it.
const IN_PLANE: f64 = 1e-12;

/// A part of a patch that a point sees, from the front or from behind; its corners are as seen from the point, and run counter-clockwise there.
pub(crate) struct SeenPart<'a> {
    pub(crate) patch: usize,
    pub(crate) is_back: bool,
    pub(crate) corners: &'a [DVec3],
}

/// Where a point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    /// In the open.
    Free,
    /// On a face, to rounding.
    OnFace,
}

/// The faces and patches of a scene, for views from points.
pub(crate) struct PointViews {
    faces: Vec<Plate>,
    tree_of_faces: BallTree,
    patches: Vec<Plate>,
    /// The faces in the plane of each patch whose fronts are on the side of its back.
    covers: Vec<Vec<usize>>,
    /// The faces, flat neighbours joined.
    occluders: Vec<Plate>,
    tree_of_occluders: BallTree,
    index: OccluderIndex,
    /// The patches that each occluder is cut into.
    patches_of: Vec<Vec<usize>>,
    /// What counts as in a plane, m.
    tolerance: f64,
}

/// Buffers of a view.
#[derive(Default)]
struct Buffers {
    fragments: Fragments,
    next: Fragments,
    rest: Vec<DVec3>,
    piece: Vec<DVec3>,
    half_spaces: Vec<HalfSpace>,
}

/// A polygon as a point sees it.
struct Target<'a> {
    plate: &'a Plate,
    /// As seen from the point, counter-clockwise there.
    corners: Vec<DVec3>,
    is_back: bool,
}

/// How an occluder stands to a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hiding {
    Nothing,
    /// Perhaps a part of it.
    Part,
    All,
}

/// The occluders of one point.
struct Hiders {
    point: DVec3,
    /// Of each node of the tree of occluders, and of each occluder.
    of_nodes: Vec<Cone>,
    cones: Vec<Cone>,
    /// The pyramid over each occluder, its plane last; empty of what hides nothing that others do not: the far sides of solids, and what is seen edge-on.
    half_spaces: Vec<Vec<HalfSpace>>,
}

impl PointViews {
    pub(crate) fn new(scene: &Scene, mesh: &Mesh) -> Self {
        let (low, high) = scene.bounding_box();
        let largest = low.abs().max(high.abs()).max_element();
        let tolerance = scene
            .slack()
            .max(IN_PLANE * low.distance(high))
            .max(16.0 * f64::EPSILON * largest);
        let faces: Vec<Plate> = scene.face_ids().map(|face| Plate::new(scene.polygon(face))).collect();
        let patches: Vec<Plate> = (0..mesh.n_patches())
            .map(|i| Plate::new(mesh.polygon(PatchId::from_index(i))))
            .collect();
        let index = OccluderIndex::new(scene);
        let ids = || (0..index.n_occluders()).map(|k| OccluderId(u32::try_from(k).unwrap_or(u32::MAX)));
        let occluders: Vec<Plate> = ids().map(|id| Plate::new(index.corners(id).to_vec())).collect();
        let mut of_face = vec![None; faces.len()];
        for (k, id) in ids().enumerate() {
            for face in index.faces(id) {
                of_face[face.0 as usize] = Some(k);
            }
        }
        let mut patches_of = vec![Vec::new(); occluders.len()];
        for (i, patch) in mesh.patches.iter().enumerate() {
            if let Some(own) = of_face[patch.face.0 as usize] {
                patches_of[own].push(i);
            }
        }
        let tree = |plates: &[Plate]| BallTree::new(&plates.iter().map(|plate| plate.ball).collect::<Vec<_>>());
        let tree_of_faces = tree(&faces);
        Self {
            covers: covers(&patches, &faces, &tree_of_faces, tolerance),
            tree_of_occluders: tree(&occluders),
            patches_of,
            tree_of_faces,
            faces,
            patches,
            occluders,
            index,
            tolerance,
        }
    }

    /// Returns how far off a corner may be, m.
    pub(crate) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Tells where a point is.
    pub(crate) fn place(&self, point: DVec3) -> Place {
        let here = Ball {
            middle: point,
            radius: 0.0,
        };
        let mut is_on_face = false;
        self.tree_of_faces.visit(
            |_, ball| ball.is_near(&here, self.tolerance),
            |k| {
                let face = &self.faces[k];
                is_on_face |= face.height(point).abs() <= self.tolerance
                    && polygon::distance(point, &face.corners) <= self.tolerance;
            },
        );
        if is_on_face { Place::OnFace } else { Place::Free }
    }

    /// Tells whether light from a unit direction reaches a point past all faces, and whether that is certain: whether it passes no border nearer than corners may be off.
    pub(crate) fn is_lit(&self, point: DVec3, direction: DVec3) -> (bool, bool) {
        // How far inside of the face light meets its plane, m; below 0 outside.
        let depth = |face: &Plate| {
            let (height, slope) = (face.height(point), face.normal.dot(direction));
            let t = -height / slope;
            if !(t > 0.0 && t.is_finite()) {
                return f64::NEG_INFINITY;
            }
            let hit = point + t * direction;
            let next = face.corners.iter().cycle().skip(1);
            let edges = face.corners.iter().zip(next);
            let inside = edges.map(|(&a, &b)| face.normal.dot((b - a).cross(hit - a)) / b.distance(a));
            inside.fold(f64::INFINITY, f64::min)
        };
        // A face that light passes at a distance has no say in either answer.
        let mut deepest = f64::NEG_INFINITY;
        self.tree_of_faces.visit(
            |_, ball| ball.is_met(point, direction, 2.0 * self.tolerance),
            |k| deepest = deepest.max(depth(&self.faces[k])),
        );
        (deepest < 0.0, deepest.abs() > self.tolerance)
    }

    /// Calls `visit` with every part of a patch that a point sees; with a `normal`, of what is in front of it. Returns the distance of the nearest face that hides anything, m.
    ///
    /// Each patch is cut by the pyramid over every face that may hide a part of it, beyond the plane of that face; flat neighbours are one face, and of a convex solid the far sides are left out. What one face
    /// hides as a whole is not cut at all. Of two patches back to back the front is seen. Accuracy: a few ulps at each cut.
    /// Work: for each face, flat neighbours joined, a walk through a tree of all faces; for each of its patches that is not hidden by one face alone, a cut by each that hides a part.
    pub(crate) fn visit(&self, point: DVec3, normal: Option<DVec3>, mut visit: impl FnMut(&SeenPart<'_>)) -> f64 {
        let hiders = self.hiders(point);
        let mut buffers = Buffers::default();
        let mut nearest = f64::INFINITY;
        let (mut of_whole, mut of_patch) = (Vec::new(), Vec::new());
        for (own, patches) in self.patches_of.iter().enumerate() {
            let Some(whole) = Target::new(&self.occluders[own], point, normal) else {
                continue;
            };
            of_whole.clear();
            if let Some(hider) = self.hiders_of(own, &whole, &hiders, &mut of_whole) {
                nearest = nearest.min(polygon::distance(point, &self.occluders[hider].corners));
                continue;
            }
            for &patch in patches {
                let Some(target) = Target::new(&self.patches[patch], point, normal) else {
                    continue;
                };
                buffers.fragments.clear();
                buffers.fragments.push(&target.corners);
                if target.is_back {
                    let covers = self.covers[patch].iter().map(|&k| &self.faces[k]);
                    for cover in covers.filter(|cover| cut_cover(cover, point, &mut buffers)) {
                        nearest = nearest.min(polygon::distance(point, &cover.corners));
                    }
                }
                of_patch.clear();
                of_patch.extend_from_slice(&of_whole);
                nearest = nearest.min(self.hide(&target, &hiders, &mut of_patch, &mut buffers));
                for corners in buffers.fragments.iter() {
                    visit(&SeenPart {
                        patch,
                        is_back: target.is_back,
                        corners,
                    });
                }
            }
        }
        nearest
    }

    /// Returns what hides from a point.
    fn hiders(&self, point: DVec3) -> Hiders {
        let is_outside = self.index.solids_without(point);
        let pyramid = |(k, plate): (usize, &Plate)| {
            let solid = self.index.solid_of(OccluderId(u32::try_from(k).unwrap_or(u32::MAX)));
            let is_far_side = solid.is_some_and(|solid| is_outside[solid]) && plate.height(point) < 0.0;
            let mut half_spaces = Vec::new();
            if !is_far_side {
                pyramid_over(plate, point, true, &mut half_spaces);
            }
            half_spaces
        };
        Hiders {
            point,
            of_nodes: self
                .tree_of_occluders
                .balls()
                .map(|ball| Cone::new(ball, point))
                .collect(),
            cones: self
                .occluders
                .iter()
                .map(|plate| Cone::new(&plate.ball, point))
                .collect(),
            half_spaces: self.occluders.iter().enumerate().map(pyramid).collect(),
        }
    }

    /// Sets `found` to the occluders that hide a part of another, `own`; returns one that hides all of it, if there is one.
    fn hiders_of(&self, own: usize, whole: &Target<'_>, hiders: &Hiders, found: &mut Vec<usize>) -> Option<usize> {
        let cone = &hiders.cones[own];
        let edges = whole.edges();
        let hides_all = Cell::new(None);
        self.tree_of_occluders.visit(
            |node, _| hides_all.get().is_none() && hiders.of_nodes[node].may_hide(cone),
            |k| {
                if k != own && hiders.cones[k].may_hide(cone) {
                    match self.hiding(k, whole, &edges, hiders) {
                        Hiding::Nothing => {}
                        Hiding::Part => found.push(k),
                        Hiding::All => hides_all.set(Some(k)),
                    }
                }
            },
        );
        found.sort_unstable();
        hides_all.get()
    }

    /// Cuts what the occluders `among` hide of a target from its fragments; returns the distance of the nearest that hides anything, m.
    fn hide(&self, target: &Target<'_>, hiders: &Hiders, among: &mut Vec<usize>, buffers: &mut Buffers) -> f64 {
        let distance = |k: usize| polygon::distance(hiders.point, &self.occluders[k].corners);
        let edges = target.edges();
        let mut hides_all = None;
        among.retain(|&k| match self.hiding(k, target, &edges, hiders) {
            Hiding::Nothing => false,
            Hiding::Part => true,
            Hiding::All => {
                hides_all = Some(k);
                false
            }
        });
        if let Some(k) = hides_all {
            buffers.fragments.clear();
            return distance(k);
        }
        // What covers most comes first.
        let cone = Cone::new(&target.plate.ball, hiders.point);
        let depth = |k: &usize| hiders.cones[*k].depth_of(&cone);
        among.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
        let mut nearest = f64::INFINITY;
        for &k in among.iter() {
            if buffers.fragments.is_empty() {
                break;
            }
            if buffers.cut_away(&hiders.half_spaces[k]) {
                nearest = nearest.min(distance(k));
            }
        }
        nearest
    }

    /// Tells what an occluder hides of a target, whose `edges` are the planes through its edges and the point.
    fn hiding(&self, k: usize, target: &Target<'_>, edges: &[DVec3], hiders: &Hiders) -> Hiding {
        let half_spaces = &hiders.half_spaces[k];
        if half_spaces.is_empty() {
            return Hiding::Nothing;
        }
        let reach = target.corners.iter().map(|v| v.abs().element_sum()).fold(0.0, f64::max);
        let mut is_all = true;
        for half_space in half_spaces {
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            for &v in &target.corners {
                let value = half_space.value(v);
                (low, high) = (low.min(value), high.max(value));
            }
            let slack = half_space.slack[0] + half_space.slack[1] * reach;
            if high <= slack {
                return Hiding::Nothing;
            }
            is_all &= low >= -slack;
        }
        let occluder = &self.occluders[k];
        let is_beside = |edge: &DVec3| occluder.corners.iter().all(|&v| edge.dot(v - hiders.point) >= 0.0);
        let sign = occluder.height(hiders.point).signum();
        let heights = || target.plate.corners.iter().map(|&v| occluder.height(v));
        let is_before = || heights().all(|h| h * sign >= 0.0) || heights().all(|h| h.abs() <= self.tolerance);
        match is_all {
            _ if is_before() => Hiding::Nothing,
            true => Hiding::All,
            false if edges.iter().any(is_beside) => Hiding::Nothing,
            false => Hiding::Part,
        }
    }
}

impl<'a> Target<'a> {
    /// Returns what a point sees of a plate, with a `normal` what is in front of that; `None` if it is edge-on or behind.
    fn new(plate: &'a Plate, point: DVec3, normal: Option<DVec3>) -> Option<Self> {
        let height = plate.height(point);
        if height.abs() <= f64::EPSILON * plate.ball.middle.distance(point) {
            return None;
        }
        let mut corners: Vec<DVec3> = plate.corners.iter().map(|&v| v - point).collect();
        if height < 0.0 {
            corners.reverse();
        }
        if let Some(normal) = normal {
            corners = clip_to_half_space(&corners, DVec3::ZERO, normal);
        }
        (corners.len() >= 3).then_some(Self {
            plate,
            corners,
            is_back: height < 0.0,
        })
    }

    /// Returns the outward normals of the planes through the point and each edge, of any length.
    fn edges(&self) -> Vec<DVec3> {
        let next = self.corners.iter().cycle().skip(1);
        self.corners.iter().zip(next).map(|(&a, &b)| a.cross(b)).collect()
    }
}

/// Returns for each patch the faces in its plane whose fronts are on the side of its back.
fn covers(patches: &[Plate], faces: &[Plate], tree: &BallTree, tolerance: f64) -> Vec<Vec<usize>> {
    let of_patch = |patch: &Plate| {
        let mut found = Vec::new();
        tree.visit(
            |_, ball| ball.is_near(&patch.ball, tolerance),
            |k| {
                let face = &faces[k];
                let is_in_plane = || patch.corners.iter().all(|&v| face.height(v).abs() <= tolerance);
                if face.normal.dot(patch.normal) < 0.0 && face.ball.is_near(&patch.ball, tolerance) && is_in_plane() {
                    found.push(k);
                }
            },
        );
        found.sort_unstable();
        found
    };
    patches.iter().map(of_patch).collect()
}

/// Cuts from the fragments of a back what a front in its plane covers; tells whether that is anything.
fn cut_cover(cover: &Plate, point: DVec3, buffers: &mut Buffers) -> bool {
    let mut half_spaces = std::mem::take(&mut buffers.half_spaces);
    pyramid_over(cover, point, false, &mut half_spaces);
    let is_cut = !half_spaces.is_empty() && buffers.cut_away(&half_spaces);
    buffers.half_spaces = half_spaces;
    is_cut
}

/// Sets the half-spaces of the pyramid over a plate, with or without what is `beyond` its plane; none if it is seen edge-on.
fn pyramid_over(plate: &Plate, point: DVec3, beyond: bool, half_spaces: &mut Vec<HalfSpace>) {
    half_spaces.clear();
    let height = plate.height(point);
    if height.abs() <= f64::EPSILON * plate.ball.middle.distance(point) {
        return;
    }
    let sign = height.signum();
    let next = plate.corners.iter().cycle().skip(1);
    for (&a, &b) in plate.corners.iter().zip(next) {
        let (a, b) = (a - point, b - point);
        // Seen from the front the corners run counter-clockwise, and a × b points outwards.
        let slack = 1e-15 * a.abs().element_sum() * (b - a).abs().element_sum();
        half_spaces.push(HalfSpace {
            normal: a.cross(b) * -sign,
            offset: 0.0,
            slack: [0.0, slack],
        });
    }
    if beyond {
        let normal = plate.normal * -sign;
        half_spaces.push(HalfSpace {
            normal,
            offset: -normal.dot(plate.corners[0] - point),
            slack: [0.0; 2],
        });
    }
}

impl Buffers {
    /// Cuts what lies in all half-spaces from the fragments; tells whether that is anything.
    fn cut_away(&mut self, half_spaces: &[HalfSpace]) -> bool {
        let Self {
            fragments,
            next,
            rest,
            piece,
            ..
        } = self;
        next.clear();
        let mut is_cut = false;
        for fragment in fragments.iter() {
            let before = next.len();
            if subtract(fragment, half_spaces, next, rest, piece) {
                is_cut = true;
            } else {
                // Nothing is hidden: one whole fragment, not the pieces that told so.
                next.truncate(before);
                next.push(fragment);
            }
        }
        std::mem::swap(fragments, next);
        is_cut
    }
}
