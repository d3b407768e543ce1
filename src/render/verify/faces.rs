//! The first face that a ray hits, in f64.

use std::sync::OnceLock;

use glam::DVec3;

use super::answer::Material;
use super::clear_view::Plate;
use super::points::Reference;
use super::region::{Region, contains};
use super::size::Size;
use crate::scene::SurfaceId;

/// The shift of a ray, relative to the scene's size, that shows whether rounding to f32 (6e-8) may change the face that it meets.
const SHIFT: f64 = 1e-6;

/// The least cosine between a ray and a normal at which the position on the face is certain, and computed in f64 by the renderer as well.
const MIN_COSINE: f64 = 0.01;

/// The surface and the plane of a face.
pub(super) struct Owner {
    pub(super) surface: SurfaceId,
    pub(super) material: Material,
    /// Equal for faces of one surface in one plane.
    pub(super) plane: u32,
}

/// All faces of an image's scene.
pub(super) struct Faces<'a> {
    reference: &'a Reference<'a>,
    pub(super) owners: Vec<Owner>,
    /// The emitters seen from each face's points, computed on first use.
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
    /// True if adjacent rays meet the same face, rather than another of its plane.
    pub(super) alone: bool,
}

/// The hit of a ray, unless rounding leaves it in doubt.
#[derive(Clone, Copy, Debug)]
pub(super) enum Seen {
    Nothing,
    /// The face, or the position on it, depends on rounding.
    Unsure,
    Face(Hit),
}

impl<'a> Faces<'a> {
    pub(super) fn new(reference: &'a Reference<'a>, eye: DVec3) -> Self {
        let plates = &reference.plates;
        let size = Size::of(plates.iter().flat_map(|plate| &plate.corners).chain([&eye]));
        let mut owners: Vec<Owner> = Vec::with_capacity(plates.len());
        // The first face of each plane.
        let mut planes: Vec<usize> = Vec::new();
        for (id, record) in (0..).zip(&reference.attributes.surfaces) {
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

    /// Returns the greatest movement of the hit point by rounding in f64, in m.
    pub(super) fn slack(&self, hit: &Hit) -> f64 {
        (1e-12 * self.size.extent + self.size.rounding()) / hit.cosine
    }

    pub(super) fn region(&self, face: usize) -> &Region<'a> {
        self.regions[face].get_or_init(|| {
            let own = &self.reference.plates[face..=face];
            self.reference.region(&own[0].corners, own[0].normal, own)
        })
    }

    /// Returns the faces that rays inside a pyramid may meet; the rays along its edges are given in order, around `middle`.
    pub(super) fn inside(&self, eye: DVec3, edges: [DVec3; 4], middle: DVec3) -> Vec<usize> {
        let sides: [DVec3; 4] = std::array::from_fn(|k| {
            let side = edges[k].cross(edges[(k + 1) % 4]).normalize_or_zero();
            side * side.dot(middle).signum()
        });
        // Adjacent rays are shifted at their origins, and by another shift for every unit of their length.
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
        let plates = self.reference.plates.iter().enumerate();
        plates.filter(|(_, plate)| !misses(plate)).map(|(k, _)| k).collect()
    }

    /// Returns the hit of a ray of unit direction among the candidates.
    ///
    /// It is certain if four adjacent rays meet the same side of the same plane, or all meet nothing: no face that is wider than the shift can then begin or end between them.
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

    /// Returns the first face along a ray; of two coincident ones, that with its front towards the origin.
    fn closest(&self, candidates: &[usize], origin: DVec3, direction: DVec3) -> Option<Hit> {
        let tie = 1e-9 * self.size.extent + self.size.rounding();
        let mut best: Option<Hit> = None;
        for &face in candidates {
            let Plate { corners, normal } = &self.reference.plates[face];
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
