//! Reflectances and exitances of surfels.

use super::discretize::{SMOOTH, Surfel, VoxelScene};
use crate::matrix::operator::Block;
use crate::scene::Scene;

/// ρ and E of all surfels, in one channel or three.
#[derive(Clone, Debug, PartialEq)]
pub struct Materials {
    /// ρ.
    pub reflectance: Block,
    /// E, W/m².
    pub exitance: Block,
    /// E in the radiosity system, W/m²: Σ E A |n|_max / h² over the surfels of the voxel that look the same way.
    ///
    /// A face rarely fills its voxels, and a small emitter that is rounded up to whole voxels sends too much light. A plane with the normal n has h²/|n|_max in a
    /// voxel of the side h; a surfel of that size with this E sends as much as the true areas A. Lines see one surfel of a voxel, the first of those that look the same way, so that each of them
    /// sends for all: a lamp smaller than its voxel shines, although lines see the ceiling around it. The power of every emitter is right at any resolution, its outline is
    /// that of the voxels.
    /// Departures from Malgouyres 2002: he takes E.
    pub emission: Block,
}

impl Materials {
    /// Reads the materials of all surfels; grey scenes need one channel of the three.
    #[must_use]
    pub fn new(scene: &Scene, voxels: &VoxelScene, n_channels: usize) -> Self {
        let material = |s: &Surfel| {
            let id = scene.faces[s.face.0 as usize].material;
            &scene.materials[id.0 as usize]
        };
        let of_surfels = |values: &mut dyn Iterator<Item = [f64; 3]>| {
            let values = values.flat_map(|value| value.into_iter().take(n_channels));
            Block::from_values(values.collect(), n_channels)
        };
        let surfels = || voxels.surfels.iter();
        Self {
            reflectance: of_surfels(&mut surfels().map(|s| material(s).reflectance)),
            exitance: of_surfels(&mut surfels().map(|s| material(s).exitance)),
            emission: of_surfels(&mut voxels.emission(|s| material(s).exitance)),
        }
    }

    /// Returns B = E + ρ H.
    ///
    /// # Panics
    /// If `irradiance` has another shape.
    #[must_use]
    #[track_caller]
    pub fn radiosity(&self, irradiance: &Block) -> Block {
        assert_eq!(
            irradiance.values().len(),
            self.exitance.values().len(),
            "one irradiance a surfel and channel"
        );
        let mut radiosity = self.exitance.clone();
        let terms = self.reflectance.values().iter().zip(irradiance.values());
        for (b, (rho, h)) in radiosity.values_mut().iter_mut().zip(terms) {
            *b += rho * h;
        }
        radiosity
    }
}

impl VoxelScene {
    /// Returns the emission of the surfels, one after the other.
    fn emission<'a>(
        &'a self,
        exitance: impl Fn(&Surfel) -> [f64; 3] + Copy + 'a,
    ) -> impl Iterator<Item = [f64; 3]> + 'a {
        let normal = |s: &Surfel| self.normals[s.normal as usize].unit;
        let sent = move |k: usize, in_voxel: std::ops::Range<usize>| {
            let s = &self.surfels[k];
            // Near a thin wall, only surfels that look to the same side.
            let is_alike = |&t: &usize| {
                normal(s).dot(normal(&self.surfels[t])) > SMOOTH && (t == k || self.nodes(k) & self.nodes(t) != 0)
            };
            let alike = in_voxel.filter(is_alike).map(|t| &self.surfels[t]);
            let size = self.grid.voxel_size.powi(2) / normal(s).abs().max_element();
            alike.fold([0.0; 3], |sum, t| {
                let e = exitance(t);
                [0, 1, 2].map(|c| sum[c] + e[c] * t.area / size)
            })
        };
        self.first_surfel.windows(2).flat_map(move |ends| {
            let in_voxel = ends[0] as usize..ends[1] as usize;
            in_voxel.clone().map(move |s| sent(s, in_voxel.clone()))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builtin;

    /// The power of the lamp by lines from straight in front of it.
    fn power_seen(voxels: &VoxelScene, emission: &Block) -> f64 {
        let pixel = voxels.grid.voxel_size.powi(2);
        let firsts = voxels.first_surfel.windows(2).map(|ends| {
            // The lamps look down; of those that do so alike the first is seen.
            let down = |s: &usize| voxels.normals[voxels.surfels[*s].normal as usize].unit.z < -0.99;
            (ends[0] as usize..ends[1] as usize).find(down)
        });
        firsts.flatten().map(|s| pixel * emission.row(s)[0]).sum()
    }

    #[test]
    fn the_power_that_is_sent_does_not_depend_on_the_resolution() {
        let scene = builtin::build("sphere-room-r1", None).expect("a built-in scene").scene;
        let errors = |n: u32| {
            let voxels = VoxelScene::new(&scene, n).expect("a sound resolution");
            let materials = Materials::new(&scene, &voxels, 1);
            let error = |sent: &Block| power_seen(&voxels, sent) / 200.0 - 1.0;
            [error(&materials.emission), error(&materials.exitance)]
        };
        let errors = [5, 10, 17, 30, 64].map(errors);
        assert!(errors.iter().all(|[scaled, _]| scaled.abs() < 1e-12), "{errors:?}");
        // A lamp of 2 m in whole voxels of 1.2 to 0.09 m.
        assert!(errors.iter().any(|[_, plain]| plain.abs() > 0.05), "{errors:?}");
    }
}
