//! The runs.

use std::num::NonZeroUsize;

use glam::DVec3;

use super::expected::{Expected, Start};
use super::{LEAST_SEEDS, PairFactors};
use crate::experiment::ExperimentError;
use crate::form_factor::{FormFactorMethod, GaussShooting, Input, RandomShooting};
use crate::geometry::polygon;
use crate::geometry::quadrature::{GaussProduct, WeightedPoint};
use crate::geometry::sampling::Sequence;
use crate::matrix::StorageChoice;
use crate::mesh::{Mesh, PatchId, Subdivision};
use crate::progress::{Progress, Silent};
use crate::scene::{FaceId, Scene, builtin};
use crate::visibility::embree::EmbreeVisibility;

/// The surface of the built-in cube (x0, x1, y0, y1, z0, z1) that is the paper's face 1, 2, … 6. Opposite faces are 1 and 6, 2 and 3, 4 and 5.
const SURFACE_OF_FACE: [u32; 6] = [4, 0, 1, 2, 3, 5];

/// The cube with n × n patches a face.
pub(super) struct Cube {
    scene: Scene,
    mesh: Mesh,
    visibility: EmbreeVisibility,
    /// The paper's face, less one, of every patch.
    face_of_patch: Vec<usize>,
    /// The corners of the paper's faces.
    faces: [Vec<DVec3>; 6],
}

/// Runs of one method with different seeds.
pub(super) struct Ensemble {
    /// The form factors of every run.
    pub(super) runs: Vec<PairFactors>,
    /// What they are samples of.
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
        if n_seeds < LEAST_SEEDS {
            return Err(ExperimentError::TooFewSeeds {
                n_seeds,
                least: LEAST_SEEDS,
            });
        }
        let surface_of_patch: Vec<u32> = self.mesh.patches.iter().map(|p| p.surface.0).collect();
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
            let input = Input {
                scene: &self.scene,
                mesh: &self.mesh,
                visibility: &self.visibility,
                unoccluded: false,
            };
            let computed = method.compute(input, StorageChoice::default(), &Silent);
            progress.advance(1);
            let computed = computed.map_err(|source| ExperimentError::Method {
                method: name,
                parameter: "rays per patch",
                value: rays,
                source,
            })?;
            let whole = computed.factors.surface_form_factors(&surface_of_patch, 6).form_factor;
            let at = |i: usize, j: usize| whole[(6 * SURFACE_OF_FACE[i] + SURFACE_OF_FACE[j]) as usize];
            Ok(std::array::from_fn(|i| std::array::from_fn(|j| at(i, j))))
        };
        let seeds = (0..n_seeds).map(|k| first_seed.wrapping_add(k));
        Ok(Ensemble {
            runs: seeds.map(run).collect::<Result<_, ExperimentError>>()?,
            expected: Expected::new(&self.mesh, &self.face_of_patch, &self.faces, start, rays),
        })
    }

    /// Returns the form factors between the faces by the plain product of 5 × 5 Gauss points on both patches of each pair:
    /// F_IJ = Σ_i∈I Σ_j∈J A_i Σ_pq w_p w_q cos θ_p cos θ_q A_j / (π r²) / A_I.
    ///
    /// The method that this stands beside is not reproducible; see the module's documentation.
    pub(super) fn gauss(&self) -> PairFactors {
        // A cube has two kinds of pairs, neighbours and opposites.
        let (neighbour, opposite) = (self.gauss_pair(0, 1), self.gauss_pair(0, 5));
        let opposite_of = [5, 2, 1, 4, 3, 0];
        std::array::from_fn(|i| {
            std::array::from_fn(|j| match j {
                _ if j == i => 0.0,
                _ if j == opposite_of[i] => opposite,
                _ => neighbour,
            })
        })
    }

    fn gauss_pair(&self, from: usize, to: usize) -> f64 {
        let rule = GaussProduct::new(NonZeroUsize::MIN.saturating_add(4));
        let points = |face: usize| -> Vec<(DVec3, f64)> {
            let of_face = |i: &usize| self.face_of_patch[*i] == face;
            let patches = (0..self.mesh.n_patches()).filter(of_face);
            let weighted = |i: usize| {
                let area = self.mesh.patches[i].area;
                let points = rule.on_polygon(&self.mesh.polygon(PatchId::from_index(i)));
                points
                    .into_iter()
                    .map(move |WeightedPoint { position, weight }| (position, weight * area))
            };
            patches.flat_map(weighted).collect()
        };
        let normal = |face: usize| polygon::area_vector(&self.faces[face]).normalize();
        let area = polygon::area_vector(&self.faces[from]).length();
        let (n, m) = (normal(from), normal(to));
        let targets = points(to);
        let kernel = |(x, w): &(DVec3, f64)| -> f64 {
            let from_point = |(y, v): &(DVec3, f64)| {
                let r = *y - *x;
                let squared = r.length_squared();
                v * n.dot(r) * -m.dot(r) / (squared * squared)
            };
            w * targets.iter().map(from_point).sum::<f64>()
        };
        points(from).iter().map(kernel).sum::<f64>() / (std::f64::consts::PI * area)
    }
}
