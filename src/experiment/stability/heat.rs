//! Heat that depends on small differences: emissivities near 0, very hot beside very cold surfaces, heats that nearly cancel.
//!
//! A case is a closed cube with a condition on each side. Every solver computes its heat as `radiosity heat` does, and is judged by the irradiance of each patch: its error relative to the larger of
//! itself and the patch's own emissive power must be within the stated error by form factors and solver, and rounding.

use std::time::Instant;

use super::cases::Expected;
use super::oracle::Oracle;
use super::{Cell, ROUNDING, Verdict};
use crate::experiment::ExperimentError;
use crate::heat::{Boundary, Condition, SurfaceBoundary, emissive_power};
use crate::matrix::Need;
use crate::matrix::operator::{Block, LinearOperator};
use crate::mesh::Subdivision;
use crate::scene::builtin;
use crate::solver::RadiositySystem;
use crate::solver::registry::SolverEntry;
use crate::workflow::{
    Context, FormFactorRequest, FormFactorStudy, HeatStudy, Model, SolveRequest, TotalError, Use, WorkflowError,
};

/// The patches along an edge of the cube: 96 in all.
const EDGE: u32 = 4;

/// The sides of the cube: an emissivity and a condition each, the floor and the ceiling last.
type Sides = [(f64, Condition); 6];

/// One enclosure.
pub(super) struct HeatCase {
    pub(super) name: &'static str,
    pub(super) about: &'static str,
    pub(super) expected: Expected,
    sides: Sides,
}

/// The cube with its form factors.
pub(super) struct Enclosure {
    model: Model,
    factors: FormFactorStudy,
    cx: Context,
}

const ADIABATIC: Condition = Condition::Supplied(0.0);

/// Returns the enclosures.
pub(super) fn all() -> Vec<HeatCase> {
    let (given, supplied) = (Condition::Temperature, Condition::Supplied);
    let walls = |wall: (f64, Condition), floor, ceiling| [wall, wall, wall, wall, floor, ceiling];
    let case = |name, about, sides| HeatCase {
        name,
        about,
        expected: Expected::Solution,
        sides,
    };
    let refused = |own: HeatCase| HeatCase {
        expected: Expected::Refusal,
        ..own
    };
    let dim = 1e-6;
    let mirrors = walls((dim, ADIABATIC), (dim, given(300.0)), (dim, given(400.0)));
    let mut beside = walls((1.0, ADIABATIC), (1e-3, given(300.0)), (1.0, given(400.0)));
    beside[0] = (1e-3, ADIABATIC);
    beside[2] = (1e-3, given(500.0));
    let cold_and_hot = walls((0.5, ADIABATIC), (0.5, given(3.0)), (0.5, given(3000.0)));
    let mut hot_corner = walls((0.9, given(3.0)), (0.9, given(3.0)), (0.9, given(3000.0)));
    hot_corner[1] = (1e-3, supplied(1e-3));
    let mut balanced = walls(
        (0.5, ADIABATIC),
        (0.8, supplied(1e3)),
        (0.8, supplied(-1e3 * (1.0 - 1e-9))),
    );
    balanced[0] = (0.5, given(600.0));
    let nowhere = walls(
        (0.5, ADIABATIC),
        (0.8, supplied(1e3)),
        (0.8, supplied(-1e3 * (1.0 - 1e-9))),
    );
    let too_much = walls((0.5, given(3.0)), (0.8, supplied(1e3)), (0.8, supplied(-1e3)));
    vec![
        case(
            "emissivity 1e-6",
            "300 and 400 K, adiabatic walls, ε = 1e-6 everywhere",
            mirrors,
        ),
        case(
            "emissivity 1e-3 beside 1",
            "300, 400 and 500 K, adiabatic walls",
            beside,
        ),
        case("3 K beside 3,000 K", "adiabatic walls between", cold_and_hot),
        case(
            "3 K around 3,000 K",
            "a wall of ε = 1e-3 is supplied with 1e-3 W/m²",
            hot_corner,
        ),
        case(
            "heats that nearly cancel",
            "±1 kW/m², off by 1e-9, one wall at 600 K",
            balanced,
        ),
        refused(case(
            "heats that nearly cancel, no temperature",
            "±1 kW/m², off by 1e-9",
            nowhere,
        )),
        refused(case("more heat taken than arrives", "±1 kW/m², walls at 3 K", too_much)),
    ]
}

impl Enclosure {
    pub(super) fn new() -> Result<Self, ExperimentError> {
        let scene = builtin::build("cube", None)?.scene;
        let mut cx = Context::default();
        let mut model = Model::new(scene, "cube", Subdivision::Uniform(EDGE).into(), Use::Light, &mut cx)?;
        let factors = model.form_factors(&FormFactorRequest::default(), Need::Symmetry, &mut cx)?;
        Ok(Self { model, factors, cx })
    }

    pub(super) fn n_patches(&self) -> usize {
        self.model.mesh.n_patches()
    }

    /// Runs a solver.
    pub(super) fn cell(&mut self, case: &HeatCase, entry: &SolverEntry) -> Cell {
        let request = SolveRequest {
            solver: entry.name.to_owned(),
            ..SolveRequest::default()
        };
        let begun = Instant::now();
        let found = self.model.heat(&self.factors, &case.boundary(), &request, &mut self.cx);
        let time_s = begun.elapsed().as_secs_f64();
        let study = match found {
            Ok(study) => study,
            Err(error) => return Cell::refused(case.name, entry, error.to_string()),
        };
        let mut errors = None;
        let cell = Cell::solved(case.name, entry, &study.thermal, time_s, || {
            if !study.is_exact() || study.error == TotalError::TooGreat {
                return (Verdict::Refused, "its errors are stated to be too great".to_owned());
            }
            match self.judged(case, &study) {
                Ok(own) => {
                    errors = Some(own);
                    (Verdict::Right, "converged".to_owned())
                }
                Err(lie) => (Verdict::Wrong, lie),
            }
        });
        Cell {
            error: errors.map(|(error, _)| error),
            error_bound: errors.map(|(_, bound)| bound),
            ..cell
        }
    }

    /// Returns the greatest error of an irradiance and the greatest stated one, or the violation.
    fn judged(&self, case: &HeatCase, study: &HeatStudy) -> Result<(f64, f64), String> {
        if case.expected == Expected::Refusal {
            return Err("converged, where nothing means anything".to_owned());
        }
        let exact = self.exact(case).map_err(|error| error.to_string())?;
        let band = &study.heat.thermal;
        // The rounding of a patch's radiosity is repeated with every reflection of its light.
        let least = case.sides.iter().map(|side| side.0).fold(1.0, f64::min);
        let (mut worst, mut bound) = (0.0_f64, 0.0_f64);
        for (i, patch) in self.model.mesh.patches.iter().enumerate() {
            let (emissivity, condition) = case.sides[patch.surface.0 as usize];
            let power = match condition {
                Condition::Temperature(kelvin) => emissive_power(kelvin),
                Condition::Supplied(flux) => exact[i] + flux / emissivity,
                Condition::Node(_) | Condition::OtherSide(_) => 0.0,
            };
            let whole = power.max(exact[i]);
            let error = (band.irradiance[i] - exact[i]).abs() / whole;
            let stated = band.own_errors[1][i] / whole;
            if error.is_nan() || error > stated + ROUNDING / least {
                return Err(format!(
                    "the irradiance of patch {i} is off by {error:.1e}, above {stated:.1e}"
                ));
            }
            worst = worst.max(error);
            bound = bound.max(stated);
        }
        Ok((worst, bound))
    }

    /// Returns the irradiance of each patch to full precision, W·m⁻².
    fn exact(&self, case: &HeatCase) -> Result<Vec<f64>, WorkflowError> {
        let of_patches = self
            .model
            .mesh
            .patches
            .iter()
            .map(|patch| case.sides[patch.surface.0 as usize]);
        let (rho, exitance): (Vec<f64>, Vec<f64>) = of_patches
            .map(|(emissivity, condition)| match condition {
                Condition::Temperature(kelvin) => (1.0 - emissivity, emissivity * emissive_power(kelvin)),
                Condition::Supplied(flux) => (1.0, flux),
                Condition::Node(_) | Condition::OtherSide(_) => (1.0, 0.0),
            })
            .unzip();
        let (rho, exitance) = (Block::from_values(rho, 1), Block::from_values(exitance, 1));
        let factors = &self.factors.factors;
        let system = RadiositySystem::with_signed_exitance(factors, factors.areas().to_vec(), rho, exitance)?;
        let radiosity = Oracle::new(&system, false).radiosity;
        let mut irradiance = Block::zeros(radiosity.n_rows(), 1);
        factors.apply(&radiosity, &mut irradiance);
        Ok(irradiance.values().to_vec())
    }
}

impl HeatCase {
    fn boundary(&self) -> Boundary {
        let of_side = |&(emissivity, condition): &(f64, Condition)| {
            Some(SurfaceBoundary {
                emissivity,
                absorptance: emissivity,
                condition,
            })
        };
        Boundary {
            file: self.name.into(),
            surroundings_k: 0.0,
            sun: None,
            sky: None,
            surfaces: self.sides.iter().map(of_side).collect(),
            patch_values: Vec::new(),
            lines: Vec::new(),
            nodes: Vec::new(),
        }
    }
}
