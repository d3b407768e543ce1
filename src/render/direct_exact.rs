//! Exact form factors from points to the visible parts of emitters.

use std::collections::HashMap;

use glam::DVec3;

use super::direct_point::DirectPoint;
use crate::form_factor::partial::VisibleFactor;
use crate::geometry::point_form_factor::point_form_factor;
use crate::mesh::{Mesh, PatchId};
use crate::scene::Scene;
use crate::visibility::occluders::{OccluderIndex, PairVisibility};

/// The input for finding the visible parts of an emitter.
pub(super) struct ClearParts<'a> {
    mesh: &'a Mesh,
    index: OccluderIndex,
}

impl<'a> ClearParts<'a> {
    pub(super) fn new(scene: &Scene, mesh: &'a Mesh) -> Self {
        Self {
            mesh,
            index: OccluderIndex::new(scene),
        }
    }

    fn look(&self, patch: PatchId, emitter: &[DVec3]) -> Seen {
        let region = self.mesh.polygon(patch);
        match self.index.classify(&region, emitter) {
            PairVisibility::None => Seen::Not,
            PairVisibility::Full => Seen::Whole,
            PairVisibility::Partial(between) => {
                let occluders = self.index.occluders(&region, emitter, &between);
                let normal = self.mesh.patches[patch.0 as usize].normal;
                Seen::Behind(Box::new(VisibleFactor::new(&region, normal, emitter, &occluders)))
            }
        }
    }
}

/// The visible part of one emitter from the points of one patch.
enum Seen {
    Not,
    Whole,
    Behind(Box<VisibleFactor>),
}

/// The pairs of a patch and an emitter that one thread has classified.
///
/// A point within the rounding of a ray's f32 coordinates (1e-7 of a face) of its patch's border may be taken for a neighbour's.
#[derive(Default)]
pub(super) struct SeenByPatch {
    seen: HashMap<(PatchId, u32), Seen>,
}

impl SeenByPatch {
    /// Returns F from a point to the visible part of an emitter, given by its number and its corners.
    pub(super) fn form_factor(&mut self, clear: &ClearParts<'_>, at: &DirectPoint, emitter: (u32, &[DVec3])) -> f64 {
        let (number, corners) = emitter;
        let seen = self
            .seen
            .entry((at.patch, number))
            .or_insert_with(|| clear.look(at.patch, corners));
        match seen {
            Seen::Not => 0.0,
            Seen::Whole => point_form_factor(at.point, at.normal, corners),
            Seen::Behind(visible) => visible.at(at.point),
        }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::geometry::clip::clip_to_half_space;
    use crate::mesh::Subdivision;
    use crate::scene::FaceId;

    /// Returns the part of a lamp that a plate hides from a point, by planes through the point.
    fn hidden_part(point: DVec3, plate: &[DVec3; 4], lamp: &[DVec3]) -> Vec<DVec3> {
        let middle = plate.iter().sum::<DVec3>() / 4.0;
        let mut part = lamp.to_vec();
        for k in 0..4 {
            let across = (plate[k] - point).cross(plate[(k + 1) % 4] - point);
            let side = across.dot(middle - point).signum();
            part = clip_to_half_space(&part, point, across * side);
        }
        part
    }

    /// Tests a plate over a floor with lamps of one solid angle at ever greater distances: points in its penumbra see the same part of each.
    #[test]
    fn a_near_plate_keeps_its_shadow_before_a_far_lamp() {
        for (turn, to) in [
            (DQuat::IDENTITY, DVec3::new(0.3, 0.2, 1.0)),
            (
                DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 1.9),
                DVec3::new(-0.5, 0.4, 0.8),
            ),
            (
                DQuat::from_euler(glam::EulerRot::XYZ, 2.1, 0.3, -0.8),
                DVec3::new(0.1, -0.9, 0.6),
            ),
        ] {
            let to = to.normalize();
            let (across, up) = to.any_orthonormal_pair();
            let square = |middle: DVec3, a: DVec3, b: DVec3| {
                [middle - a - b, middle + a - b, middle + a + b, middle - a + b]
                    .map(|v| turn * v + DVec3::new(0.3, -0.7, 0.2))
            };
            let floor = square(DVec3::ZERO, 0.5 * DVec3::X, 0.5 * DVec3::Y);
            let plate = square(0.4 * to, 0.13 * across, 0.11 * (up + 0.3 * to));
            let back = [plate[3], plate[2], plate[1], plate[0]];
            let mut parts_of_nearest: Vec<f64> = Vec::new();
            for exponent in 1..=9 {
                let distance = 10.0_f64.powi(exponent);
                // The front of the lamp faces the floor.
                let lamp = square(distance * to, 0.2 * distance * up, 0.3 * distance * across);
                let scene = Scene::of_quads(&[floor, plate, back, lamp]);
                let mesh = Mesh::new(&scene, Subdivision::Uniform(1)).unwrap();
                let clear = ClearParts::new(&scene, &mesh);
                let mut seen = SeenByPatch::default();
                let (normal, mut parts) = (mesh.patches[0].normal, Vec::new());
                for k in 0..81_u32 {
                    let at = |step: u32| 0.05 + 0.1125 * f64::from(step);
                    let point = floor[0].lerp(floor[1], at(k % 9)) + at(k / 9) * (floor[3] - floor[0]);
                    let here = DirectPoint {
                        face: FaceId(0),
                        patch: PatchId(0),
                        point,
                        normal,
                        stream: 0,
                    };
                    let whole = point_form_factor(point, normal, &lamp);
                    let exact = whole - point_form_factor(point, normal, &hidden_part(point, &plate, &lamp));
                    let found = seen.form_factor(&clear, &here, (3, &lamp));
                    assert!(
                        (found - exact).abs() <= 1e-7 * whole,
                        "{distance:e} {k}: {found} {exact} of {whole}"
                    );
                    parts.push(found / whole);
                }
                let n_in_penumbra = parts.iter().filter(|part| (0.02..0.98).contains(*part)).count();
                assert!(n_in_penumbra > 10, "{distance:e}: {n_in_penumbra}");
                // From 1e3 on only the size of the floor causes parallax.
                if exponent == 3 {
                    parts_of_nearest = parts;
                } else if exponent > 3 {
                    let off = parts.iter().zip(&parts_of_nearest).map(|(a, b)| (a - b).abs());
                    assert!(off.fold(0.0, f64::max) < 0.02, "{distance:e}");
                }
            }
        }
    }
}
