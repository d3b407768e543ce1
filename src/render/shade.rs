//! Finds the point of a surface along a ray, and its colours.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::input::RenderInput;
use super::view::Sight;
use crate::matrix::operator::Block;
use crate::mesh::{PatchId, PatchPoint};
use crate::scene::{FaceId, Material};
use crate::visibility::{HitBatch, RayBatch, Visibility};

/// The distance at which a ray for a [`Sight::Point`] starts above the surface, and ends below it, in units of the visibility's offset.
const SIGHT_OFFSETS: f64 = 4.0;

/// A visible point of the scene's surface.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct SurfacePoint {
    pub(super) face: FaceId,
    pub(super) back: bool,
    pub(super) point: DVec3,
    /// The face's own normal, also at its back.
    pub(super) normal: DVec3,
    pub(super) depth: f64,
    pub(super) patch: PatchPoint,
}

/// The colours of a point; zero at a back.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Shade {
    pub(super) irradiance: [f64; 3],
    pub(super) radiosity: [f64; 3],
    pub(super) albedo: [f64; 3],
}

/// Adds the ray of a sight to a batch.
pub(super) fn push_sight(rays: &mut RayBatch, sight: &Sight, visibility: &dyn Visibility) {
    let frame = visibility.frame_origin();
    match *sight {
        Sight::Ray { origin, direction, .. } => rays.push_ray(origin - frame, direction),
        Sight::Point {
            point,
            normal,
            clearance,
            ..
        } => {
            let reach = normal * (SIGHT_OFFSETS * visibility.offset() + 2.0 * clearance);
            rays.push_segment(point - frame + reach, point - frame - reach);
        }
    }
}

/// Values indexed by [`PatchPoint`].
enum Field<'a> {
    /// Constant over each patch.
    Flat(&'a Block),
    /// Interpolated between the corners.
    Smooth(Block),
}

/// Returns the colours of points in a scene with a solution.
pub(super) struct Shader<'a> {
    input: &'a RenderInput<'a>,
    /// Irradiance, or its indirect part where a direct pass adds the rest.
    irradiance: Field<'a>,
    /// The patches' own radiosities, if the image shows these.
    radiosity: Option<&'a Block>,
    /// The normal of each face.
    normals: Vec<DVec3>,
}

impl<'a> Shader<'a> {
    /// Prepares the colours; `irradiance` has one row per patch, and `radiosity`, if given, is shown in place of E + ρ H.
    pub(super) fn new(
        input: &'a RenderInput<'a>,
        irradiance: &'a Block,
        flat: bool,
        radiosity: Option<&'a Block>,
    ) -> Self {
        Self {
            input,
            irradiance: if flat {
                Field::Flat(irradiance)
            } else {
                Field::Smooth(input.mesh.vertex_values(irradiance))
            },
            radiosity,
            normals: input
                .scene
                .face_ids()
                .map(|face| input.scene.area_vector(face).normalize_or_zero())
                .collect(),
        }
    }

    /// Returns the point found by ray `k` of a batch made by [`push_sight`].
    pub(super) fn locate(&self, sight: &Sight, hits: &HitBatch, k: usize) -> Option<SurfacePoint> {
        let hit = hits.face(k)?;
        let face = &self.input.scene.faces[hit.face.0 as usize];
        let normal = self.normals[hit.face.0 as usize];
        let (point, depth) = match *sight {
            Sight::Ray {
                origin,
                direction,
                depth_axis,
            } => {
                // Embree finds the face; its point is computed again in f64, except at grazing rays.
                let corner = self.input.scene.vertices[face.corners.as_slice()[0] as usize];
                let t_single = f64::from(hits.t[k]);
                let t_plane = normal.dot(corner - origin) / normal.dot(direction);
                let close = (t_plane - t_single).abs() <= 1e-3 * t_single;
                let point = origin + direction * if close { t_plane } else { t_single };
                (point, depth_axis.dot(point - origin))
            }
            Sight::Point { point, surface, .. } => {
                if face.surface != surface {
                    return None;
                }
                (point, 0.0)
            }
        };
        Some(SurfacePoint {
            face: hit.face,
            back: hit.back,
            point,
            normal,
            depth,
            patch: self
                .input
                .mesh
                .locate(hit.face, f64::from(hits.u[k]), f64::from(hits.v[k])),
        })
    }

    /// Returns the colours of a point, with `direct` added to the irradiance.
    pub(super) fn shade(&self, point: &SurfacePoint, direct: [f64; 3]) -> Shade {
        if point.back {
            return Shade::default();
        }
        let material = self.material(point.face);
        let indirect = self.irradiance(&point.patch);
        let irradiance = [0, 1, 2].map(|c| indirect[c] + direct[c]);
        Shade {
            irradiance,
            radiosity: self.sent(material, point.patch.patch, || irradiance),
            albedo: material.reflectance,
        }
    }

    /// Returns the material of a face.
    pub(super) fn material(&self, face: FaceId) -> &'a Material {
        let scene = self.input.scene;
        &scene.materials[scene.faces[face.0 as usize].material.0 as usize]
    }

    /// Returns the radiosity of a point of a face's front.
    pub(super) fn radiosity(&self, face: FaceId, at: &PatchPoint) -> [f64; 3] {
        self.sent(self.material(face), at.patch, || self.irradiance(at))
    }

    fn sent(&self, material: &Material, patch: PatchId, irradiance: impl FnOnce() -> [f64; 3]) -> [f64; 3] {
        if let Some(block) = self.radiosity {
            return channels(block.row(patch.0 as usize));
        }
        let irradiance = irradiance();
        [0, 1, 2].map(|c| material.exitance[c] + material.reflectance[c] * irradiance[c])
    }

    fn irradiance(&self, at: &PatchPoint) -> [f64; 3] {
        match &self.irradiance {
            Field::Flat(block) => channels(block.row(at.patch.0 as usize)),
            Field::Smooth(block) => {
                let mut irradiance = [0.0; 3];
                self.input.mesh.interpolate(at, |vertex, weight| {
                    for (sum, value) in irradiance.iter_mut().zip(channels(block.row(vertex))) {
                        *sum += weight * value;
                    }
                });
                irradiance
            }
        }
    }
}

/// Returns the three colours of a row with three channels, or of a grey one.
pub(super) fn channels(row: &[f64]) -> [f64; 3] {
    match *row {
        [grey] => [grey; 3],
        _ => [row[0], row[1], row[2]],
    }
}
