//! Heat: boundary conditions, solar and thermal band, temperatures and net fluxes with their errors.

use super::solve::Known;
use super::{Context, FormFactorStudy, MeshError, Model, SolveRequest, TotalError, Warning, WorkflowError};
use crate::heat::{
    Band, Boundary, DirectLight, Enclosure, Heat, HeatError, Network, Outside, Sky, Solution as HeatSolution, Solved,
    above_horizon, emissive_power, solar_system, sunlight, thermal_exitance,
};
use crate::matrix::connected;
use crate::matrix::operator::{Block, LinearOperator};
use crate::solver::{Coarsened, Solution, StopReason};

/// The residual that solvers are to reach where they can: temperatures follow from light that is nearly even at low emissivities, and from little of it beside hot surfaces.
const AIM: f64 = 1e-12;

/// The error of a surface's irradiance, relative to the larger of that and its own emissive power, from which it is warned of.
pub const MAX_HEAT_ERROR: f64 = 1e-2;

/// The part of all heat from which backs are warned of.
const TO_BACKS: f64 = 1e-12;

/// The heat of a scene, and how it was found.
#[derive(Debug)]
pub struct HeatStudy {
    /// Temperatures, fluxes and their errors.
    pub heat: Heat,
    /// The solution of the solar band; `None` without sun and sky.
    pub solar: Option<Solution>,
    /// The solution of the thermal band.
    pub thermal: Solution,
    /// The total error by solver and form factors.
    pub error: TotalError,
    /// The change by a coarser mesh in the thermal band; `None` where that is not known.
    pub mesh_error: Option<MeshError>,
}

impl HeatStudy {
    /// Tells whether temperatures are as exact as errors are told of: see [`MAX_HEAT_ERROR`].
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.heat.relative_error <= MAX_HEAT_ERROR
    }
}

/// One band to be solved.
struct BandSystem<'a> {
    operator: &'a dyn LinearOperator,
    reflectance: Block,
    exitance: Block,
    emitted_error: Vec<f64>,
    outside: Outside,
    is_thermal: bool,
}

/// A band that is solved.
struct BandStudy {
    band: Band,
    solution: Solution,
    error: TotalError,
    mesh_error: Option<MeshError>,
}

impl Model {
    /// Finds the temperatures and net fluxes of a scene with its boundary conditions.
    ///
    /// # Errors
    /// [`WorkflowError::Heat`] of conditions that do not fit the scene or determine no temperature; those of [`solve_system`](Self::solve_system).
    pub fn heat(
        &mut self,
        study: &FormFactorStudy,
        boundary: &Boundary,
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<HeatStudy, WorkflowError> {
        let refused = |error: HeatError| WorkflowError::Heat {
            file: boundary.file.clone(),
            error,
        };
        let network = Network::new(&self.scene, &self.mesh, boundary).map_err(refused)?;
        let enclosure = study.enclosure();
        let direct = self.direct_light(&enclosure, boundary, cx);
        let solar = self.solar_band(study, (&network, &direct), request, cx)?;
        let solar_light = solar
            .as_ref()
            .map_or_else(|| Band::dark(network.n_patches()), |solar| solar.band.clone());
        let absorbed = network.absorbed(&solar_light);
        let absorbed = absorbed.each_ref().map(Vec::as_slice);
        let coupled = network.coupled(&study.factors);
        let operator: &dyn LinearOperator = match &coupled {
            Some(coupled) => coupled,
            None => &study.factors,
        };
        let row_sums = enclosure.received(&vec![1.0; network.n_patches()]);
        let components = operator
            .components()
            .unwrap_or_else(|| connected(&study.factors, &study.factors));
        let lets_out = |i: usize| enclosure.lets_out(i, row_sums[i]);
        network
            .expect_determined(&self.scene, &self.mesh, &components, absorbed[0], lets_out)
            .map_err(refused)?;
        let outside = enclosure.surroundings(emissive_power(boundary.surroundings_k));
        let [exitance, emitted_error] = thermal_exitance(&network, &outside, absorbed);
        let system = BandSystem {
            operator,
            reflectance: network.reflectance(),
            exitance: Block::from_values(exitance, 1),
            emitted_error,
            outside,
            is_thermal: true,
        };
        let thermal = self.band(study, system, |x| network.reflect(x), request, cx)?;
        let solution = HeatSolution {
            scene: &self.scene,
            mesh: &self.mesh,
            boundary,
            network: &network,
            enclosure,
            direct: &direct,
            solar: solar_light,
            thermal: thermal.band,
        };
        let heat = solution.heat().map_err(refused)?;
        study.factors.if_readable(())?;
        let mut found = HeatStudy {
            heat,
            solar: None,
            thermal: thermal.solution,
            error: thermal.error,
            mesh_error: thermal.mesh_error,
        };
        if let Some(solar) = solar {
            found.error = found.error.or_worse(solar.error);
            found.solar = Some(solar.solution);
        }
        found.warn(cx);
        Ok(found)
    }

    /// Finds what arrives straight from sun and sky.
    fn direct_light(&self, enclosure: &Enclosure<'_>, boundary: &Boundary, cx: &Context) -> DirectLight {
        let n = self.mesh.n_patches();
        let input = self.input();
        let sun = boundary.sun.map(|sun| cx.time("sun", || sunlight(input, &sun)));
        let sky = match &boundary.sky {
            None => [vec![0.0; n], vec![0.0; n]],
            Some(sky) => self.sky_light(enclosure, sky, cx),
        };
        DirectLight { sun, sky }
    }

    /// Returns the irradiance straight from a sky, and its error, W·m⁻², \[n\] each.
    pub(super) fn sky_light(&self, enclosure: &Enclosure<'_>, sky: &Sky, cx: &Context) -> [Vec<f64>; 2] {
        let n = self.mesh.n_patches();
        let row_sums = enclosure.received(&vec![1.0; n]);
        let sees_nothing =
            |i: usize| row_sums[i] <= 0.0 && enclosure.backs[i].value + enclosure.backs[i].error() <= 0.0;
        let sees_nothing: Vec<bool> = (0..n).map(sees_nothing).collect();
        let above = cx.time("sky", || above_horizon(self.input(), sky, enclosure.sky, &sees_nothing));
        [
            above.iter().map(|own| sky.irradiance() * own.value).collect(),
            above.iter().map(|own| sky.irradiance() * own.error()).collect(),
        ]
    }

    /// Solves the solar band; `None` where nothing arrives.
    fn solar_band(
        &mut self,
        study: &FormFactorStudy,
        (network, direct): (&Network, &DirectLight),
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<Option<BandStudy>, WorkflowError> {
        let [irradiance, error] = direct.irradiance();
        if irradiance.iter().zip(&error).all(|(h, e)| h + e <= 0.0) {
            return Ok(None);
        }
        let (reflectance, exitance) = solar_system(network, &irradiance);
        let rho = reflectance.clone();
        let system = BandSystem {
            operator: &study.factors,
            reflectance,
            exitance,
            emitted_error: vec![0.0; error.len()],
            outside: Outside {
                irradiance,
                error,
                radiosity: 0.0,
            },
            is_thermal: false,
        };
        let reflect = |x: &mut [f64]| x.iter_mut().zip(rho.values()).for_each(|(x, rho)| *x *= rho);
        self.band(study, system, reflect, request, cx).map(Some)
    }

    /// Solves one band and states its errors; `reflect`: x ← R x.
    fn band(
        &mut self,
        study: &FormFactorStudy,
        system: BandSystem<'_>,
        reflect: impl Fn(&mut [f64]),
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<BandStudy, WorkflowError> {
        let BandSystem {
            operator,
            reflectance,
            exitance,
            emitted_error,
            outside,
            is_thermal,
        } = system;
        let enclosure = study.enclosure();
        let known = Known {
            signed: is_thermal,
            aim: Some(AIM),
            ..study.known()
        };
        let areas = study.factors.areas().to_vec();
        let materials = (reflectance.clone(), exitance.clone());
        let solution = self.solve_system((operator, areas), request, materials, known, cx)?;
        let residual = solution.residual(&reflectance, &exitance);
        let solved = Solved {
            enclosure,
            operator,
            reflectance: &reflectance,
            outside: &outside,
            emitted_error: &emitted_error,
            residual: residual.values(),
            converged: solution.stop_reason == StopReason::Converged,
        };
        let mut band = cx.time("error", || solved.band(solution.radiosity.values(), reflect))?;
        if !study.errors_known {
            band.radiosity_error.fill(f64::INFINITY);
            band.irradiance_error.fill(f64::INFINITY);
        }
        let error = study
            .errors_known
            .then(|| Block::from_values(band.radiosity_error.clone(), 1));
        let coarse = self.coarsened_by(operator, study, &reflectance, &solution, cx)?;
        band.mesh_change = coarse.as_ref().map(|coarse| mesh_change(&enclosure, coarse));
        let mesh_error = is_thermal
            .then(|| self.mesh_error(coarse.as_ref(), (&exitance, &solution), cx))
            .flatten();
        Ok(BandStudy {
            band,
            error: TotalError::of(self, error.as_ref(), &solution, cx),
            mesh_error,
            solution,
        })
    }
}

/// Returns what a coarser mesh would change in the irradiance of each patch, W·m⁻²: F (d − (B − B̄)), with B̄ + d the radiosity of the coarser patch.
fn mesh_change(enclosure: &Enclosure<'_>, coarse: &Coarsened) -> Vec<f64> {
    let change = coarse.change.values().iter().zip(coarse.spread.values());
    enclosure.received(&change.map(|(d, spread)| d - spread).collect::<Vec<_>>())
}

impl FormFactorStudy {
    pub(super) fn enclosure(&self) -> Enclosure<'_> {
        Enclosure {
            factors: &self.factors,
            sky: &self.sky.sky,
            backs: &self.sky.back,
            closed_rows: &self.closed_rows,
            gain: &self.gain,
        }
    }
}

impl HeatStudy {
    fn warn(&self, cx: &Context) {
        let balance = &self.heat.balance;
        let moved = balance.escaped_w + balance.supplied_w.abs() + balance.sun_w + balance.sky_w;
        if balance.absorbed_by_backs_w > TO_BACKS * moved {
            cx.warn(Warning::HeatToBacks {
                power_w: balance.absorbed_by_backs_w,
            });
        }
        if self.heat.thermal.mesh_change.is_none() {
            cx.warn_once(Warning::NoMeshError);
        }
        // Where nothing is known at all, or the solver gave up, another warning says so.
        let converged = self.thermal.stop_reason == StopReason::Converged;
        if converged && !self.is_exact() && self.heat.relative_error.is_finite() {
            cx.warn(Warning::InexactHeat {
                relative: self.heat.relative_error,
            });
        }
    }
}
