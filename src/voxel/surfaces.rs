//! Means over the surfels of each surface.

use super::VoxelScene;
use crate::matrix::operator::Block;
use crate::scene::Scene;

/// The mean of a quantity over the surfels of one surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfelMean {
    /// Σ A over its surfels, m².
    pub area: f64,
    /// The number of its surfels.
    pub n_surfels: u64,
    /// Σ A x / Σ A of each channel, in the unit of x; 0 without surfels.
    pub value: Vec<f64>,
}

impl VoxelScene {
    /// Returns the area mean of `per_surfel` over the surfels of each surface of the scene that the voxels are of.
    ///
    /// # Panics
    /// If `per_surfel` has not one row for every surfel.
    #[must_use]
    #[track_caller]
    pub fn surface_means(&self, scene: &Scene, per_surfel: &Block) -> Vec<SurfelMean> {
        assert_eq!(per_surfel.n_rows(), self.n_surfels(), "one row per surfel");
        let nothing = SurfelMean {
            area: 0.0,
            n_surfels: 0,
            value: vec![0.0; per_surfel.n_channels()],
        };
        let mut means = vec![nothing; scene.surfaces.len()];
        for (i, surfel) in self.surfels.iter().enumerate() {
            let mean = &mut means[scene.faces[surfel.face.0 as usize].surface.0 as usize];
            mean.area += surfel.area;
            mean.n_surfels += 1;
            for (sum, value) in mean.value.iter_mut().zip(per_surfel.row(i)) {
                *sum += surfel.area * value;
            }
        }
        for mean in means.iter_mut().filter(|mean| mean.area > 0.0) {
            for channel in &mut mean.value {
                *channel /= mean.area;
            }
        }
        means
    }
}
