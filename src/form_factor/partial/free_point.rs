//! The view factors from a free point to all patches of a mesh, by exact clipping.

use glam::DVec3;

use super::shadow::{Fragments, HalfSpace, subtract};
use crate::geometry::clip::clip_to_half_space;
use crate::geometry::polygon;
use crate::mesh::{Mesh, PatchId};
use crate::scene::Scene;

/// Faces and patches within this part of the size of the scene of one plane lie in it.
const IN_PLANE: f64 = 1e-12;

/// A convex planar polygon.
struct Plate {
    corners: Vec<DVec3>,
    normal: DVec3,
    middle: DVec3,
    radius: f64,
}

impl Plate {
    fn new(corners: Vec<DVec3>) -> Self {
        let normal = polygon::area_vector(&corners).normalize_or_zero();
        let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
        Self {
            radius: corners.iter().map(|v| v.distance(middle)).fold(0.0, f64::max),
            normal,
            middle,
            corners,
        }
    }

    /// From a point of the plane: far from the origin n · x has fewer digits than a difference of points.
    fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point - self.corners[0])
    }
}

/// The directions in which a plate may be seen from a point: a cone.
#[derive(Clone, Copy)]
struct Cone {
    axis: DVec3,
    distance: f64,
    radius: f64,
    sine: f64,
    cosine: f64,
}

impl Cone {
    fn new(plate: &Plate, point: DVec3) -> Self {
        let towards = plate.middle - point;
        let distance = towards.length();
        let sine = (plate.radius / distance).min(1.0);
        Self {
            axis: towards / distance,
            distance,
            radius: plate.radius,
            sine,
            cosine: (1.0 - sine * sine).sqrt(),
        }
    }

    /// Tells whether a plate of this cone may hide a part of one of another.
    fn may_hide(&self, other: &Self) -> bool {
        if self.distance - self.radius > other.distance + other.radius {
            return false;
        }
        let is_around = self.sine >= 1.0 || other.sine >= 1.0;
        let sum_is_obtuse = self.cosine * other.cosine < self.sine * other.sine;
        is_around
            || sum_is_obtuse
            || self.axis.dot(other.axis) >= self.cosine * other.cosine - self.sine * other.sine - 1e-12
    }
}

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
    patches: Vec<Plate>,
    /// The face of each patch.
    face_of: Vec<usize>,
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

impl PointViews {
    pub(crate) fn new(scene: &Scene, mesh: &Mesh) -> Self {
        let (low, high) = scene.bounding_box();
        let largest = low.abs().max(high.abs()).max_element();
        Self {
            faces: scene.face_ids().map(|face| Plate::new(scene.polygon(face))).collect(),
            patches: (0..mesh.n_patches())
                .map(|i| Plate::new(mesh.polygon(PatchId::from_index(i))))
                .collect(),
            face_of: mesh.patches.iter().map(|patch| patch.face.0 as usize).collect(),
            tolerance: scene
                .slack()
                .max(IN_PLANE * low.distance(high))
                .max(16.0 * f64::EPSILON * largest),
        }
    }

    /// Returns how far off a corner may be, m.
    pub(crate) fn tolerance(&self) -> f64 {
        self.tolerance
    }

    /// Tells where a point is.
    pub(crate) fn place(&self, point: DVec3) -> Place {
        let touches = |face: &Plate| {
            face.height(point).abs() <= self.tolerance && polygon::distance(point, &face.corners) <= self.tolerance
        };
        if self.faces.iter().any(touches) {
            Place::OnFace
        } else {
            Place::Free
        }
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
        let deepest = self.faces.iter().map(depth).fold(f64::NEG_INFINITY, f64::max);
        (deepest < 0.0, deepest.abs() > self.tolerance)
    }

    /// Calls `visit` with every part of a patch that a point sees; with a `normal`, of what is in front of it. Returns the distance of the nearest face that hides anything, m.
    ///
    /// Each patch is cut by the pyramid over every face that may hide it, beyond the plane of that face. Of two patches back to back the front is seen. Accuracy: a few ulps at each cut.
    /// Work: the patches times the faces, most of which a comparison of cones leaves out.
    pub(crate) fn visit(&self, point: DVec3, normal: Option<DVec3>, mut visit: impl FnMut(&SeenPart<'_>)) -> f64 {
        let cones: Vec<Cone> = self.faces.iter().map(|face| Cone::new(face, point)).collect();
        let mut buffers = Buffers::default();
        let mut nearest = f64::INFINITY;
        for (patch, plate) in self.patches.iter().enumerate() {
            let height = plate.height(point);
            if height.abs() <= f64::EPSILON * plate.middle.distance(point) {
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
            let cone = Cone::new(plate, point);
            buffers.fragments.clear();
            buffers.fragments.push(&corners);
            for (k, face) in self.faces.iter().enumerate() {
                if k == self.face_of[patch] || !cones[k].may_hide(&cone) {
                    continue;
                }
                if self.hide(face, point, (plate, is_back), &mut buffers) {
                    nearest = nearest.min(polygon::distance(point, &face.corners));
                }
                if buffers.fragments.iter().next().is_none() {
                    break;
                }
            }
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

    /// Cuts what a face hides from the fragments of a patch; tells whether that may be anything.
    fn hide(&self, face: &Plate, point: DVec3, (patch, is_back): (&Plate, bool), buffers: &mut Buffers) -> bool {
        let height = face.height(point);
        if height.abs() <= f64::EPSILON * face.middle.distance(point) {
            return false;
        }
        let heights = || patch.corners.iter().map(|&v| face.height(v));
        let is_coplanar = heights().all(|h| h.abs() <= self.tolerance);
        // Of coincident faces the front that faces the point is seen.
        if is_coplanar && !(is_back && height > 0.0) {
            return false;
        }
        let sign = height.signum();
        if !is_coplanar && heights().all(|h| h * sign >= 0.0) {
            return false;
        }
        buffers.half_spaces.clear();
        let next = face.corners.iter().cycle().skip(1);
        for (&a, &b) in face.corners.iter().zip(next) {
            let (a, b) = (a - point, b - point);
            // Seen from the front the corners run counter-clockwise, and a × b points outwards.
            let slack = 1e-15 * a.abs().element_sum() * (b - a).abs().element_sum();
            buffers.half_spaces.push(HalfSpace {
                normal: a.cross(b) * -sign,
                offset: 0.0,
                slack: [0.0, slack],
            });
        }
        if !is_coplanar {
            let beyond = face.normal * -sign;
            buffers.half_spaces.push(HalfSpace {
                normal: beyond,
                offset: -beyond.dot(face.corners[0] - point),
                slack: [0.0; 2],
            });
        }
        let Buffers {
            fragments,
            next,
            rest,
            piece,
            half_spaces,
        } = buffers;
        next.clear();
        let mut is_cut = false;
        for fragment in fragments.iter() {
            is_cut |= subtract(fragment, half_spaces, next, rest, piece);
        }
        std::mem::swap(fragments, next);
        is_cut
    }
}
