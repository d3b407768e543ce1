//! The first face that a ray hits, in f64.

use std::sync::OnceLock;

use glam::DVec3;

use super::answer::Material;
use super::clear_view::Plate;
use super::points::Reference;
use super::region::{Region, contains};
use super::size::Size;
use crate::scene::SurfaceId;

/// How far, relative to the scene's size, a ray is moved to find out whether rounding to f32 (6e-8) may turn it to another face.
const SHIFT: f64 = 1e-6;

/// The least cosine between a ray and a normal at which the place on the face is sure, and found in f64 by the renderer as well.
const MIN_COSINE: f64 = 0.01;

/// A face and what it belongs to.
struct Owner {
    surface: SurfaceId,
    material: Material,
    /// Equal for faces of one surface in one plane.
    plane: u32,
}

/// All faces of an image's scene.
pub(super) struct Faces<'a> {
    reference: &'a Reference<'a>,
    owners: Vec<Owner>,
    /// The view from each face's points, found when it is first wanted.
    regions: Vec<OnceLock<Region<'a>>>,
    size: Size,
}

/// The hit of a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hit {
    pub(super) face: usize,
    pub(super) front: bool,
    pub(super) point: DVec3,
    t: f64,
    pub(super) cosine: f64,
    /// Whether rays beside this one meet the same face, not another of its plane.
    pub(super) alone: bool,
}

/// The hit of a ray, as far as rounding leaves no doubt.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seen {
    Nothing,
    /// Which face, or where on it, depends on rounding.
    Unsure,
    Face(Hit),
}

impl<'a> Faces<'a> {
    pub(super) fn new(reference: &'a Reference<'a>, eye: DVec3) -> Self {
        let plates = reference.plates();
        let size = Size::of(plates.iter().flat_map(|plate| &plate.corners).chain([&eye]));
        let mut owners: Vec<Owner> = Vec::with_capacity(plates.len());
        // The first face of each plane.
        let mut planes: Vec<usize> = Vec::new();
        for (id, record) in (0..).zip(&reference.attributes().surfaces) {
            let first_plane = planes.len();
            for polygon in &record.polygons {
                let own = &plates[owners.len()];
                let known = planes[first_plane..]
                    .iter()
                    .position(|&k| is_one_plane(&plates[k], own, 1e-9 * size.extent + size.rounding()));
                let plane = first_plane + known.unwrap_or(planes.len() - first_plane);
                if plane == planes.len() {
                    planes.push(owners.len());
                }
                owners.push(Owner {
                    surface: SurfaceId(id),
                    material: (polygon.exitance, polygon.reflectance),
                    plane: u32::try_from(plane).unwrap_or(u32::MAX),
                });
            }
        }
        let regions = plates.iter().map(|_| OnceLock::new()).collect();
        Self {
            reference,
            owners,
            regions,
            size,
        }
    }

    pub(super) fn surface(&self, face: usize) -> SurfaceId {
        self.owners[face].surface
    }

    pub(super) fn plane(&self, face: usize) -> u32 {
        self.owners[face].plane
    }

    pub(super) fn material(&self, face: usize) -> Material {
        self.owners[face].material
    }

    /// Returns how far rounding in f64 may move the point where a ray meets a face, in m.
    pub(super) fn slack(&self, hit: &Hit) -> f64 {
        (1e-12 * self.size.extent + self.size.rounding()) / hit.cosine
    }

    pub(super) fn region(&self, face: usize) -> &Region<'a> {
        self.regions[face].get_or_init(|| {
            let own = &self.reference.plates()[face..=face];
            self.reference.region(&own[0].corners, own[0].normal, own)
        })
    }

    /// Returns the faces that some ray inside a pyramid may meet; the rays along its edges are given in order, around `middle`.
    pub(super) fn inside(&self, eye: DVec3, edges: [DVec3; 4], middle: DVec3) -> Vec<usize> {
        let sides: [DVec3; 4] = std::array::from_fn(|k| {
            let side = edges[k].cross(edges[(k + 1) % 4]).normalize_or_zero();
            side * side.dot(middle).signum()
        });
        // Rays beside those inside are moved by one shift where they start, and by another for every unit of their length.
        let slack = 16.0 * SHIFT * self.size.extent;
        let misses = |plate: &Plate| {
            let reach = |side: &DVec3| {
                plate
                    .corners
                    .iter()
                    .map(|&v| side.dot(v - eye))
                    .fold(f64::MIN, f64::max)
            };
            sides.iter().any(|side| reach(side) < -slack)
        };
        let plates = self.reference.plates().iter().enumerate();
        plates.filter(|(_, plate)| !misses(plate)).map(|(k, _)| k).collect()
    }

    /// Returns what a ray of unit direction sees among the candidates.
    ///
    /// It is sure if four rays beside it see the same plane's same side, or all nothing: in between no face that is wider than the shift can begin or end.
    pub(super) fn look(&self, candidates: &[usize], origin: DVec3, direction: DVec3) -> Seen {
        let mut first = self.closest(candidates, origin, direction);
        let (a, b) = direction.any_orthonormal_pair();
        for (x, y) in [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)] {
            let aside = (a * x + b * y) * SHIFT;
            let second = self.closest(candidates, origin + aside * self.size.extent, direction + aside);
            let agrees = match (&mut first, &second) {
                (None, None) => true,
                (Some(one), Some(other)) => {
                    one.alone &= one.face == other.face;
                    let (owner, beside) = (&self.owners[one.face], &self.owners[other.face]);
                    owner.plane == beside.plane && owner.material == beside.material && one.front == other.front
                }
                _ => false,
            };
            if !agrees {
                return Seen::Unsure;
            }
        }
        match first {
            None => Seen::Nothing,
            Some(hit) if hit.cosine < MIN_COSINE => Seen::Unsure,
            Some(hit) => Seen::Face(hit),
        }
    }

    /// Returns the first face along a ray; of two coincident ones that which turns its front to it.
    fn closest(&self, candidates: &[usize], origin: DVec3, direction: DVec3) -> Option<Hit> {
        let tie = 1e-9 * self.size.extent + self.size.rounding();
        let mut best: Option<Hit> = None;
        for &face in candidates {
            let Plate { corners, normal } = &self.reference.plates()[face];
            let along = normal.dot(direction);
            let t = normal.dot(corners[0] - origin) / along;
            let (front, point) = (along < 0.0, origin + direction * t);
            // A ray within the plane has no finite t.
            let is_nearer = t.is_finite()
                && t > 0.0
                && best.is_none_or(|best| t < best.t - tie || (t < best.t + tie && front && !best.front));
            if is_nearer && contains(corners, point, *normal) {
                best = Some(Hit {
                    face,
                    front,
                    point,
                    t,
                    cosine: along.abs(),
                    alone: true,
                });
            }
        }
        best
    }
}

fn is_one_plane(a: &Plate, b: &Plate, slack: f64) -> bool {
    (a.normal - b.normal).length() <= 1e-9 && a.normal.dot(b.corners[0] - a.corners[0]).abs() <= slack
}
