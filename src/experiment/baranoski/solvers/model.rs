//! The room with the sphere.

use serde::Serialize;

use crate::experiment::ExperimentError;
use crate::form_factor::{Input, MethodSettings, TOLERANCE, method};
use crate::matrix::operator::Block;
use crate::matrix::{FormFactors, StorageChoice};
use crate::mesh::{Mesh, Subdivision};
use crate::progress::Progress;
use crate::scene::{builtin, topology};
use crate::solver::{RadiositySystem, SolverError};
use crate::visibility::embree::EmbreeVisibility;
use crate::workflow::materials;

/// A test case: table 1 of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "SolverCase"))]
pub struct Case {
    /// Its letter.
    pub name: char,
    /// The built-in scene.
    pub scene: &'static str,
    /// Share of entries of F that are not 0, as printed, per cent.
    pub paper_density_percent: f64,
    /// ρ_avg.
    pub rho_avg: f64,
}

const fn case(name: char, scene: &'static str, paper_density_percent: f64, rho_avg: f64) -> Case {
    Case {
        name,
        scene,
        paper_density_percent,
        rho_avg,
    }
}

/// Table 1.
pub const CASES: [Case; 6] = [
    case('A', "sphere-room-r2", 53.0, 0.24),
    case('B', "sphere-room-r2", 53.0, 0.46),
    case('C', "sphere-room-r2", 53.0, 0.77),
    case('D', "sphere-room-r2", 53.0, 0.88),
    case('E', "sphere-room-r1", 70.0, 0.78),
    case('F', "sphere-room-r1", 70.0, 0.89),
];

/// The form-factor method, and its tolerance, far below any effect on a count of passes.
const METHOD: &str = "exact";
const FORM_FACTOR_TOLERANCE: f64 = 1e-6;

/// The tolerance of row sums from 1.
const BALANCE_TOLERANCE: f64 = 1e-12;
const BALANCE_PASSES: usize = 500;

/// A room of one of the two radii.
pub(super) struct Model {
    pub(super) scene: &'static str,
    pub(super) factors: FormFactors,
    /// The reflectances for a mean of 1.
    pattern: Vec<f64>,
    pub(super) exitance: Block,
}

impl Model {
    pub(super) fn new(name: &'static str, progress: &dyn Progress) -> Result<Self, ExperimentError> {
        let scene = builtin::build(name, None)?.scene;
        let mesh = Mesh::new(&scene, Subdivision::Uniform(1))?;
        let visibility = EmbreeVisibility::new(&scene)?;
        let settings = MethodSettings::default().with(&TOLERANCE, FORM_FACTOR_TOLERANCE);
        let input = Input {
            scene: &scene,
            mesh: &mesh,
            visibility: &visibility,
            unoccluded: topology::is_convex_and_empty(&scene),
        };
        let computed = method(METHOD, &settings).and_then(|m| m.compute(input, StorageChoice::default(), progress));
        let raw = computed.map_err(ExperimentError::FormFactors)?.factors;
        let targets = vec![1.0; mesh.n_patches()];
        let symmetric = raw.symmetrised()?;
        let (factors, _) = symmetric.balanced(&targets, BALANCE_TOLERANCE, BALANCE_PASSES)?;
        let (reflectance, exitance) = materials(&scene, &mesh, 1);
        let reflectances = reflectance.values();
        let areas = mesh.areas();
        let weighted: f64 = areas.iter().zip(reflectances).map(|(a, rho)| a * rho).sum();
        let mean = weighted / areas.iter().sum::<f64>();
        Ok(Self {
            scene: name,
            factors,
            pattern: reflectances.iter().map(|rho| rho / mean).collect(),
            exitance,
        })
    }

    /// Returns the reflectances for a mean of `rho_avg`.
    pub(super) fn reflectance(&self, rho_avg: f64) -> Block {
        Block::from_values(self.pattern.iter().map(|rho| rho * rho_avg).collect(), 1)
    }

    pub(super) fn system(&self, reflectance: &Block) -> Result<RadiositySystem<'_>, SolverError> {
        let areas = self.factors.areas().to_vec();
        RadiositySystem::new(&self.factors, areas, reflectance.clone(), self.exitance.clone())
    }
}
