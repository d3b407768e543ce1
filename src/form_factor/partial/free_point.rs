//! The view factors from a free point to all patches of a mesh, by exact clipping.

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
    /// The occluder that the face of each patch is a part of; none of a face without area.
    occluder_of: Vec<Option<usize>>,
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
    /// What may hide a patch, with the depth of the patch in the cone of each.
    hiding: Vec<(f64, usize)>,
}

/// A patch as a point sees it.
struct Target<'a> {
    plate: &'a Plate,
    cone: Cone,
}

/// What hides from one point.
struct Hiders {
    cones: Vec<Cone>,
    /// False of what hides nothing that others do not: the far sides of solids.
    count: Vec<bool>,
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
        let tree = |plates: &[Plate]| BallTree::new(&plates.iter().map(|plate| plate.ball).collect::<Vec<_>>());
        let tree_of_faces = tree(&faces);
        Self {
            covers: covers(&patches, &faces, &tree_of_faces, tolerance),
            tree_of_occluders: tree(&occluders),
            occluder_of: mesh.patches.iter().map(|patch| of_face[patch.face.0 as usize]).collect(),
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
            |ball| ball.is_near(&here, self.tolerance),
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
            |ball| ball.is_met(point, direction, 2.0 * self.tolerance),
            |k| deepest = deepest.max(depth(&self.faces[k])),
        );
        (deepest < 0.0, deepest.abs() > self.tolerance)
    }

    /// Calls `visit` with every part of a patch that a point sees; with a `normal`, of what is in front of it. Returns the distance of the nearest face that hides anything, m.
    ///
    /// Each patch is cut by the pyramid over every face that may hide it, beyond the plane of that face; flat neighbours are one face, and of a convex solid the far sides are left out. What covers most
    /// of the patch comes first. Of two patches back to back the front is seen. Accuracy: a few ulps at each cut.
    /// Work: for each patch a walk through a tree of the faces.
    pub(crate) fn visit(&self, point: DVec3, normal: Option<DVec3>, mut visit: impl FnMut(&SeenPart<'_>)) -> f64 {
        let hiders = self.hiders(point);
        let mut buffers = Buffers::default();
        let mut nearest = f64::INFINITY;
        for (patch, plate) in self.patches.iter().enumerate() {
            let height = plate.height(point);
            if height.abs() <= f64::EPSILON * plate.ball.middle.distance(point) {
                continue;
            }
            let is_back = height < 0.0;
            let mut corners: Vec<DVec3> = plate.corners.iter().map(|&v| v - point).collect();
            if is_back {
                corners.reverse();
            }
            if let Some(normal) = normal {
                corners = clip_to_half_space(&corners, DVec3::ZERO, normal);
            }
            if corners.len() < 3 {
                continue;
            }
            let target = Target {
                plate,
                cone: Cone::new(&plate.ball, point),
            };
            buffers.fragments.clear();
            buffers.fragments.push(&corners);
            if is_back {
                for &k in &self.covers[patch] {
                    let cover = &self.faces[k];
                    if cut_away(cover, point, true, &mut buffers) {
                        nearest = nearest.min(polygon::distance(point, &cover.corners));
                    }
                }
            }
            nearest = nearest.min(self.hide(patch, &target, (point, &hiders), &mut buffers));
            for corners in buffers.fragments.iter() {
                visit(&SeenPart {
                    patch,
                    is_back,
                    corners,
                });
            }
        }
        nearest
    }

    /// Returns what hides from a point.
    fn hiders(&self, point: DVec3) -> Hiders {
        let is_outside = self.index.solids_without(point);
        let counts = |(k, plate): (usize, &Plate)| {
            let solid = self.index.solid_of(OccluderId(u32::try_from(k).unwrap_or(u32::MAX)));
            let is_far_side = solid.is_some_and(|solid| is_outside[solid]) && plate.height(point) < 0.0;
            !is_far_side
        };
        Hiders {
            cones: self.occluders.iter().map(|plate| Cone::new(&plate.ball, point)).collect(),
            count: self.occluders.iter().enumerate().map(counts).collect(),
        }
    }

    /// Cuts what occluders hide of a patch from its fragments; returns the distance of the nearest that hides anything, m.
    fn hide(
        &self,
        patch: usize,
        target: &Target<'_>,
        (point, hiders): (DVec3, &Hiders),
        buffers: &mut Buffers,
    ) -> f64 {
        let mut hiding = std::mem::take(&mut buffers.hiding);
        hiding.clear();
        self.tree_of_occluders.visit(
            |ball| Cone::new(ball, point).may_hide(&target.cone),
            |k| {
                let cone = &hiders.cones[k];
                if hiders.count[k] && self.occluder_of[patch] != Some(k) && cone.may_hide(&target.cone) {
                    hiding.push((cone.depth_of(&target.cone), k));
                }
            },
        );
        hiding.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut nearest = f64::INFINITY;
        for &(_, k) in &hiding {
            if buffers.fragments.is_empty() {
                break;
            }
            let occluder = &self.occluders[k];
            if self.may_hide(occluder, point, target.plate) && cut_away(occluder, point, false, buffers) {
                nearest = nearest.min(polygon::distance(point, &occluder.corners));
            }
        }
        buffers.hiding = hiding;
        nearest
    }

    /// Tells whether an occluder is in another plane than a patch, and before a part of it.
    fn may_hide(&self, occluder: &Plate, point: DVec3, patch: &Plate) -> bool {
        let sign = occluder.height(point).signum();
        let heights = || patch.corners.iter().map(|&v| occluder.height(v));
        !heights().all(|h| h.abs() <= self.tolerance) && !heights().all(|h| h * sign >= 0.0)
    }
}

/// Returns for each patch the faces in its plane whose fronts are on the side of its back.
fn covers(patches: &[Plate], faces: &[Plate], tree: &BallTree, tolerance: f64) -> Vec<Vec<usize>> {
    let of_patch = |patch: &Plate| {
        let mut found = Vec::new();
        tree.visit(
            |ball| ball.is_near(&patch.ball, tolerance),
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

/// Cuts the pyramid over a plate from fragments, beyond its plane or `in_plane` of it; tells whether it holds any part of them.
fn cut_away(plate: &Plate, point: DVec3, in_plane: bool, buffers: &mut Buffers) -> bool {
    let height = plate.height(point);
    if height.abs() <= f64::EPSILON * plate.ball.middle.distance(point) {
        return false;
    }
    let sign = height.signum();
    let Buffers {
        fragments,
        next,
        rest,
        piece,
        half_spaces,
        ..
    } = buffers;
    half_spaces.clear();
    let following = plate.corners.iter().cycle().skip(1);
    for (&a, &b) in plate.corners.iter().zip(following) {
        let (a, b) = (a - point, b - point);
        // Seen from the front the corners run counter-clockwise, and a × b points outwards.
        let slack = 1e-15 * a.abs().element_sum() * (b - a).abs().element_sum();
        half_spaces.push(HalfSpace {
            normal: a.cross(b) * -sign,
            offset: 0.0,
            slack: [0.0, slack],
        });
    }
    if !in_plane {
        let beyond = plate.normal * -sign;
        half_spaces.push(HalfSpace {
            normal: beyond,
            offset: -beyond.dot(plate.corners[0] - point),
            slack: [0.0; 2],
        });
    }
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
