//! The rooms, their reference solutions, and the distance of other solutions from these.

use crate::experiment::ExperimentError;
use crate::experiment::solved::solved;
use crate::form_factor::{FormFactorMethod, Input};
use crate::matrix::StorageChoice;
use crate::matrix::operator::Block;
use crate::mesh::hierarchy::Coarsening;
use crate::mesh::{Hierarchy, Mesh, Prolongation, Subdivision};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::solver::{RadiositySystem, Tolerance};
use crate::visibility::embree::EmbreeVisibility;
use crate::workflow::materials;

/// The steps from sampling points to measuring patches: 2³ points along an edge.
const STEPS_TO_MEASURE: usize = 3;

/// A scene, with the settings of its measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The name of the built-in scene.
    pub scene: &'static str,
    /// Its level, if it has levels.
    pub level: Option<u32>,
    /// The number of measuring patches along each edge of a face: a power of two.
    pub per_edge: u32,
    /// The number of propagations after which the voxels' own iteration is converged to 1e-4 or better.
    pub n_passes: usize,
    /// The tolerance of `exact` for the reference.
    pub tolerance: f64,
    /// The errors measured at 10, 20 and 40 voxels with R = 30.
    pub expected_errors: [f64; 3],
    /// The range of the order in h, from 40 voxels on.
    pub order: [f64; 2],
}

/// The rooms.
///
/// The order is first, as a voxel locates its surface to half a voxel. The outline of the Cornell box's light, 9 × 7 voxels at 40, is rounded to whole ones, as are the tilted faces of its blocks: the
/// order is lower there. Propagations: the cube reflects nothing; elsewhere the mean reflectance to the power of twice the passes, as in place each counts about double, is below 1e-4.
#[rustfmt::skip]
pub(super) const CASES: [Case; 4] = [
    Case { scene: "cube", level: None, per_edge: 8, n_passes: 1, tolerance: 1e-6, expected_errors: [7.19e-2, 3.46e-2, 1.86e-2], order: [0.7, 1.3] },
    Case { scene: "lewis-room", level: Some(2), per_edge: 2, n_passes: 16, tolerance: 1e-6, expected_errors: [1.07e-1, 4.03e-2, 2.27e-2], order: [0.7, 1.4] },
    Case { scene: "cornell-box", level: None, per_edge: 2, n_passes: 12, tolerance: 1e-4, expected_errors: [1.40e-1, 7.23e-2, 6.15e-2], order: [0.3, 1.2] },
    Case { scene: "sphere-room-r1", level: None, per_edge: 1, n_passes: 20, tolerance: 1e-3, expected_errors: [8.63e-2, 3.89e-2, 2.33e-2], order: [0.7, 1.4] },
];

/// The patch solution of a scene.
pub struct PatchReference {
    /// The scene.
    pub scene: Scene,
    /// The points at which other solutions are sampled, as patches.
    pub sampling: Mesh,
    /// The steps from the sampling patches to ever coarser ones.
    levels: Vec<Coarsening>,
    visibility: EmbreeVisibility,
    unoccluded: bool,
    n_channels: usize,
    /// The areas of the measuring patches, m².
    areas: Vec<f64>,
    /// The irradiance H on the measuring patches, W·m⁻².
    irradiance: Block,
    /// The number of patches of the reference.
    pub n_patches: usize,
    /// The relative change of the reference from measuring patches to those half as wide, which bounds its error if that at least halves.
    pub change: f64,
}

impl PatchReference {
    /// Solves a case with exact form factors.
    ///
    /// # Errors
    /// [`ExperimentError`] if the scene, its form factors or the system are refused.
    pub fn solve(case: &Case, progress: &dyn Progress) -> Result<Self, ExperimentError> {
        let scene = crate::scene::builtin::build(case.scene, case.level)?.scene;
        let sampling = Mesh::new(&scene, Subdivision::Uniform(case.per_edge << STEPS_TO_MEASURE))?;
        let levels = Hierarchy::of_mesh(&sampling).levels().to_vec();
        let visibility = EmbreeVisibility::new(&scene)?;
        let mut reference = Self {
            n_channels: scene.n_channels_needed(),
            // These are two empty convex rooms.
            unoccluded: matches!(case.scene, "cube" | "lewis-room"),
            areas: Mesh::new(&scene, Subdivision::Uniform(case.per_edge))?.areas(),
            irradiance: Block::zeros(0, 1),
            n_patches: 0,
            change: 0.0,
            scene,
            sampling,
            levels,
            visibility,
        };
        let exact = crate::form_factor::ExactMethod {
            tolerance: case.tolerance,
            ..crate::form_factor::ExactMethod::default()
        };
        progress.begin(&format!("reference of {}", case.scene), 2);
        let coarse = reference.solve_patches(&exact, case.per_edge)?;
        progress.advance(1);
        let fine = reference.solve_patches(&exact, 2 * case.per_edge)?;
        progress.advance(1);
        reference.n_patches = fine.n_rows();
        reference.irradiance = reference.to_measuring(fine, case, 2 * case.per_edge);
        reference.change = reference.error(&reference.to_measuring(coarse, case, case.per_edge));
        Ok(reference)
    }

    /// Returns H of the patches that cut every edge into `per_edge` parts.
    ///
    /// # Errors
    /// [`ExperimentError`] if the form factors or the system are refused.
    pub fn solve_patches(&self, method: &dyn FormFactorMethod, per_edge: u32) -> Result<Block, ExperimentError> {
        let mesh = Mesh::new(&self.scene, Subdivision::Uniform(per_edge))?;
        let input = Input {
            scene: &self.scene,
            mesh: &mesh,
            visibility: &self.visibility,
            unoccluded: self.unoccluded,
        };
        let computed = method
            .compute(input, StorageChoice::default(), &crate::progress::Silent)
            .map_err(ExperimentError::FormFactors)?;
        let (reflectance, exitance) = materials(&self.scene, &mesh, self.n_channels);
        let system = RadiositySystem::new(&computed.factors, mesh.areas(), reflectance, exitance)?;
        let solution = solved(&system, "auto", Tolerance::ResidualL2(1e-8))?;
        Ok(solution.irradiance)
    }

    /// Returns values of patches that cut every edge into `per_edge` parts on the measuring patches: averaged, or those of each coarse patch.
    ///
    /// # Panics
    /// If `per_edge` is neither that of the sampling or the measuring patches, nor between or above these by powers of two.
    #[must_use]
    #[track_caller]
    pub fn to_measuring(&self, mut values: Block, case: &Case, per_edge: u32) -> Block {
        let finest = case.per_edge << STEPS_TO_MEASURE;
        assert!(
            finest.is_multiple_of(per_edge) && (finest / per_edge).is_power_of_two(),
            "halves of halves"
        );
        let at = (finest / per_edge).ilog2() as usize;
        let by_channel = |block: &Block, step: &dyn Fn(&[f64]) -> Vec<f64>| {
            let channels = (0..block.n_channels()).map(|c| step(&block.channel(c)));
            Block::from_channels(&channels.collect::<Vec<_>>())
        };
        for level in &self.levels[at.min(STEPS_TO_MEASURE)..STEPS_TO_MEASURE] {
            values = by_channel(&values, &|fine| level.restricted(fine));
        }
        for level in self.levels[STEPS_TO_MEASURE..at.max(STEPS_TO_MEASURE)].iter().rev() {
            values = by_channel(&values, &|coarse| level.prolonged(Prolongation::Injection, coarse));
        }
        values
    }

    /// Returns ‖x − H‖ / ‖H‖ over measuring patches and channels.
    ///
    /// # Panics
    /// If `values` has not one row per measuring patch.
    #[must_use]
    #[track_caller]
    pub fn error(&self, values: &Block) -> f64 {
        self.distance(values, &self.irradiance)
    }

    /// Returns ‖x − y‖ / ‖H‖ over measuring patches and channels.
    ///
    /// # Panics
    /// If `x` and `y` have not one row per measuring patch.
    #[must_use]
    #[track_caller]
    pub fn distance(&self, x: &Block, y: &Block) -> f64 {
        let n = self.areas.len();
        assert!(x.n_rows() == n && y.n_rows() == n, "one row per measuring patch");
        let (mut off, mut all) = (0.0, 0.0);
        for (i, area) in self.areas.iter().enumerate() {
            for ((a, b), h) in x.row(i).iter().zip(y.row(i)).zip(self.irradiance.row(i)) {
                off += area * (a - b).powi(2);
                all += area * h.powi(2);
            }
        }
        (off / all).sqrt()
    }

    /// Returns the number of channels that the scene needs.
    #[must_use]
    pub fn n_channels(&self) -> usize {
        self.n_channels
    }

    /// Returns the number of measuring patches.
    #[must_use]
    pub fn n_measuring(&self) -> usize {
        self.areas.len()
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn coarse_patches_are_unions_of_fine_ones_in_the_mesh_s_own_order() {
        // These scenes have quads and triangles.
        for (name, per_edge) in [("cornell-box", 2), ("sphere-room-r1", 1)] {
            let scene = crate::scene::builtin::build(name, None).unwrap().scene;
            let finest = Mesh::new(&scene, Subdivision::Uniform(per_edge << STEPS_TO_MEASURE)).unwrap();
            let levels = Hierarchy::of_mesh(&finest).levels().to_vec();
            let mut centroids: Vec<glam::DVec3> = finest.patches.iter().map(|p| p.centroid).collect();
            for (k, level) in levels.iter().enumerate().take(STEPS_TO_MEASURE) {
                let mut coarse = vec![glam::DVec3::ZERO; level.n_coarse()];
                for (i, (&parent, share)) in level.parents().iter().zip(level.shares()).enumerate() {
                    coarse[parent as usize] += *share * centroids[i];
                }
                let mesh = Mesh::new(&scene, Subdivision::Uniform(per_edge << (STEPS_TO_MEASURE - 1 - k))).unwrap();
                assert_eq!(mesh.n_patches(), coarse.len());
                for (patch, centroid) in mesh.patches.iter().zip(&coarse) {
                    // The tolerance covers rounding in rooms of some metres.
                    assert!(patch.centroid.distance(*centroid) < 1e-12, "{name} {k}");
                }
                centroids = coarse;
            }
        }
    }
}
