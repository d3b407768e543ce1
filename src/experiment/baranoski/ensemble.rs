//! Ensembles of runs of the paper's methods.

use std::num::NonZeroUsize;

use glam::DVec3;

use super::expected::{Expected, Start};
use super::{MIN_SEEDS, PairFactors};
use crate::experiment::ExperimentError;
use crate::form_factor::{FormFactorMethod, GaussShooting, Input, ParametricDifferential, RandomShooting};
use crate::geometry::sampling::Sequence;
use crate::matrix::{FormFactors, StorageChoice};
use crate::mesh::{Mesh, Subdivision};
use crate::progress::{Progress, Silent};
use crate::scene::{FaceId, Scene, builtin};
use crate::visibility::embree::EmbreeVisibility;

/// The surface of the built-in cube (x0, x1, y0, y1, z0, z1) for the paper's faces 1, 2, … 6.
///
/// Opposite faces are 1 and 6, 2 and 3, 4 and 5.
const SURFACE_OF_FACE: [u32; 6] = [4, 0, 1, 2, 3, 5];

/// The cube with n × n patches a face.
pub(super) struct Cube {
    scene: Scene,
    mesh: Mesh,
    visibility: EmbreeVisibility,
    /// The index of the paper's face of every patch, from 0.
    face_of_patch: Vec<usize>,
    /// The corners of the paper's faces.
    faces: [Vec<DVec3>; 6],
}

/// Runs of one method with different seeds.
pub(super) struct Ensemble {
    /// The form factors of every run.
    pub(super) runs: Vec<PairFactors>,
    /// The distribution of the runs.
    pub(super) expected: Expected,
}

impl Cube {
    pub(super) fn new(divisions: u32) -> Result<Self, ExperimentError> {
        let scene = builtin::build("cube", None)?.scene;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(divisions))?;
        let visibility = EmbreeVisibility::new(&scene)?;
        let face_of = |surface: u32| SURFACE_OF_FACE.iter().position(|&s| s == surface).unwrap_or(0);
        let face_of_patch = mesh.patches.iter().map(|p| face_of(p.surface.0)).collect();
        // Each surface of the cube is one face, in the same order.
        let faces = SURFACE_OF_FACE.map(|surface| scene.polygon(FaceId(surface)));
        Ok(Self {
            scene,
            mesh,
            visibility,
            face_of_patch,
            faces,
        })
    }

    /// Shoots `n_seeds` times.
    pub(super) fn shoot(
        &self,
        start: Start,
        rays: u64,
        first_seed: u64,
        n_seeds: u64,
        progress: &dyn Progress,
    ) -> Result<Ensemble, ExperimentError> {
        if n_seeds < MIN_SEEDS {
            return Err(ExperimentError::TooFewSeeds {
                n_seeds,
                least: MIN_SEEDS,
            });
        }
        let run = |seed: u64| {
            let sequence = Sequence::Random;
            let (method, name): (Box<dyn FormFactorMethod>, _) = match start {
                Start::Random => (Box::new(RandomShooting { rays, sequence, seed }), "SR"),
                Start::Gauss(points) => (
                    Box::new(GaussShooting {
                        points,
                        rays,
                        sequence,
                        seed,
                    }),
                    "SG",
                ),
            };
            let computed = method.compute(self.input(false), StorageChoice::default(), &Silent);
            progress.advance(1);
            let computed = computed.map_err(|source| ExperimentError::Method {
                method: name,
                parameter: "rays per patch",
                value: rays,
                source,
            })?;
            Ok(self.between_faces(&computed.factors))
        };
        let seeds = (0..n_seeds).map(|k| first_seed.wrapping_add(k));
        Ok(Ensemble {
            runs: seeds.map(run).collect::<Result<_, ExperimentError>>()?,
            expected: Expected::new(&self.mesh, &self.face_of_patch, &self.faces, start, rays),
        })
    }

    /// Returns the form factors between the faces by 5 × 5 Gauss points on both patches of each pair.
    ///
    /// The paper's method in its place is not reproducible; see the module's documentation.
    pub(super) fn gauss(&self) -> Result<PairFactors, ExperimentError> {
        let points = NonZeroUsize::MIN.saturating_add(4);
        let computed = ParametricDifferential { points }
            .compute(self.input(true), StorageChoice::default(), &Silent)
            .map_err(|source| ExperimentError::Method {
                method: "PDM",
                parameter: "points per side",
                value: 5,
                source,
            })?;
        Ok(self.between_faces(&computed.factors))
    }

    fn input(&self, unoccluded: bool) -> Input<'_> {
        Input {
            scene: &self.scene,
            mesh: &self.mesh,
            visibility: &self.visibility,
            unoccluded,
        }
    }

    /// Returns the form factors between the faces, in the paper's order.
    fn between_faces(&self, factors: &FormFactors) -> PairFactors {
        let surface_of_patch: Vec<u32> = self.mesh.patches.iter().map(|p| p.surface.0).collect();
        let whole = factors.surface_form_factors(&surface_of_patch, 6).form_factor;
        let at = |i: usize, j: usize| whole[(6 * SURFACE_OF_FACE[i] + SURFACE_OF_FACE[j]) as usize];
        std::array::from_fn(|i| std::array::from_fn(|j| at(i, j)))
    }
}
