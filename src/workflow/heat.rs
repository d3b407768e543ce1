//! Heat: boundary conditions, solar and thermal band, temperatures and net fluxes with their errors.

use super::solve::Known;
use super::{Context, FormFactorStudy, MeshError, Model, SolveRequest, TotalError, Warning, WorkflowError};
use crate::audit::Given;
use crate::heat::{
    Band, Boundary, DirectLight, Enclosure, Heat, HeatBalance, HeatError, Network, Outside, Solution as HeatSolution,
    Solved, emissive_power, solar_system, sunlight, thermal_exitance,
};
use crate::matrix::connected;
use crate::matrix::operator::{Block, LinearOperator};
use crate::scene::Scene;
use crate::solver::{Coarsened, Solution, StopReason};

/// The residual that solvers aim at, if it can be reached.
///
/// Temperatures at low emissivities follow from nearly uniform light, and beside hot surfaces from little light.
const AIM: f64 = 1e-12;

/// The error of a surface's irradiance, relative to the larger of that and its own emissive power, above which there is a warning.
pub const MAX_HEAT_ERROR: f64 = 1e-2;

/// The relative change of a surface's mean radiosity by a mesh of one patch per face, above which that mesh does not show the error of the finer one.
const MAX_CHANGE: f64 = 1e-2;

/// The share of all heat in back faces above which there is a warning.
const TO_BACKS: f64 = 1e-12;

/// The heat of a scene, with the solutions of both bands.
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
    /// The change by a coarser mesh in the thermal band; `None` where unknown.
    pub mesh_error: Option<MeshError>,
}

impl HeatStudy {
    /// Returns whether the temperatures are accurate to [`MAX_HEAT_ERROR`].
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.heat.relative_error <= MAX_HEAT_ERROR
    }
}

/// One band to be solved, for all directions of the sun side by side.
struct BandSystem<'a> {
    operator: &'a dyn LinearOperator,
    reflectance: Block,
    exitance: Block,
    /// The errors by form factors and solver, and with that of the mesh.
    emitted_error: [Block; 2],
    outside: Outside,
    is_thermal: bool,
}

/// A solved band.
struct BandStudy {
    band: Band,
    solution: Solution,
    error: TotalError,
    mesh_error: Option<MeshError>,
}

/// Makes the error of a study from that of the light of a given number.
pub(super) type Refusal<'a> = dyn Fn(usize, HeatError, &Scene) -> WorkflowError + 'a;

impl Model {
    /// Computes the temperatures and net fluxes of a scene with its boundary conditions.
    ///
    /// # Errors
    /// [`WorkflowError::Heat`] for conditions that do not fit the scene or determine no temperature; those of [`solve_system`](Self::solve_system).
    pub fn heat(
        &mut self,
        study: &FormFactorStudy,
        boundary: &Boundary,
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<HeatStudy, WorkflowError> {
        let direct = [self.direct_light(study, boundary, cx)];
        let refused = |_, error: HeatError, scene: &Scene| WorkflowError::heat(boundary, error, scene);
        let mut found = self.heat_of_each(study, boundary, &direct, (request, &refused), cx)?;
        let found = found.swap_remove(0);
        found.warn(self.scene.faces.len(), cx);
        Ok(found)
    }

    /// Computes heat as [`heat`](Self::heat) does for each of several lights from outside, all in the same passes over the form factors.
    ///
    /// `refused` makes the error of the light of a given number.
    pub(super) fn heat_of_each(
        &mut self,
        study: &FormFactorStudy,
        boundary: &Boundary,
        direct: &[DirectLight],
        (request, refused): (&SolveRequest, &Refusal<'_>),
        cx: &mut Context,
    ) -> Result<Vec<HeatStudy>, WorkflowError> {
        let network =
            Network::new(&self.scene, &self.mesh, boundary).map_err(|error| refused(0, error, &self.scene))?;
        let enclosure = study.enclosure();
        let n = network.n_patches();
        let solar = self.solar_band(study, (&network, direct), request, cx)?;
        let solar_light: Vec<Band> = match &solar {
            Some(studies) => studies.iter().map(|own| own.band.clone()).collect(),
            None => vec![Band::dark(n); direct.len()],
        };
        let absorbed: Vec<[Vec<f64>; 2]> = solar_light.iter().map(|band| network.absorbed(band)).collect();
        let coupled = network.coupled(&study.factors);
        let operator: &dyn LinearOperator = match &coupled {
            Some(coupled) => coupled,
            None => &study.factors,
        };
        let row_sums = enclosure.row_sums();
        let components = operator
            .components()
            .unwrap_or_else(|| connected(&study.factors, &study.factors));
        let lets_out = |i: usize| enclosure.lets_out(i, row_sums[i]);
        for (k, [own, _]) in absorbed.iter().enumerate() {
            network
                .expect_determined(&self.scene, &self.mesh, &components, own, lets_out)
                .map_err(|error| refused(k, error, &self.scene))?;
        }
        let outside = enclosure.surroundings(emissive_power(boundary.surroundings_k), direct.len());
        let (mut exitances, mut errors) = (Vec::new(), [Vec::new(), Vec::new()]);
        for (c, (band, own)) in solar_light.iter().zip(&absorbed).enumerate() {
            let own_error = network.absorbed_own_error(band);
            let from_outside = outside.irradiance.channel(c);
            let (exitance, emitted_error) =
                thermal_exitance(&network, from_outside, own.each_ref().map(Vec::as_slice), &own_error);
            exitances.push(exitance);
            errors
                .iter_mut()
                .zip(emitted_error)
                .for_each(|(all, found)| all.push(found));
        }
        let system = BandSystem {
            operator,
            reflectance: network.reflectance(direct.len()),
            exitance: Block::from_channels(&exitances),
            emitted_error: errors.map(|all| Block::from_channels(&all)),
            outside,
            is_thermal: true,
        };
        let thermal = self.bands(study, system, |x| network.reflect(x), request, cx)?;
        let mut solar = solar.into_iter().flatten();
        let mut all = Vec::new();
        let bands = thermal.into_iter().zip(solar_light);
        for (k, ((of_thermal, of_solar), light)) in bands.zip(direct).enumerate() {
            let solution = HeatSolution {
                scene: &self.scene,
                mesh: &self.mesh,
                boundary,
                network: &network,
                enclosure,
                direct: light,
                solar: of_solar,
                thermal: of_thermal.band,
            };
            let mut found = HeatStudy {
                heat: solution.heat().map_err(|error| refused(k, error, &self.scene))?,
                solar: None,
                thermal: of_thermal.solution,
                error: of_thermal.error,
                mesh_error: of_thermal.mesh_error,
            };
            if let Some(own) = solar.next() {
                found.error = found.error.or_worse(own.error);
                found.solar = Some(own.solution);
            }
            all.push(found);
        }
        study.factors.if_readable(())?;
        Ok(all)
    }

    /// Computes the irradiance straight from sun and sky.
    fn direct_light(&self, study: &FormFactorStudy, boundary: &Boundary, cx: &Context) -> DirectLight {
        let sun = boundary.sun.map(|sun| cx.time("sun", || sunlight(self.input(), &sun)));
        DirectLight {
            sun,
            sky: self.skylight(study, boundary, cx),
        }
    }

    /// Computes the irradiance straight from the sky and its error, W·m⁻², \[n\] each.
    pub(super) fn skylight(&self, study: &FormFactorStudy, boundary: &Boundary, cx: &Context) -> [Vec<f64>; 2] {
        let n = self.mesh.n_patches();
        let Some(sky) = &boundary.sky else {
            return [vec![0.0; n], vec![0.0; n]];
        };
        let above = self.above_horizon(study, sky, cx);
        [
            above.iter().map(|own| sky.irradiance() * own.value).collect(),
            above.iter().map(|own| sky.irradiance() * own.error()).collect(),
        ]
    }

    /// Solves the solar band; `None` without any light.
    fn solar_band(
        &mut self,
        study: &FormFactorStudy,
        (network, direct): (&Network, &[DirectLight]),
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<Option<Vec<BandStudy>>, WorkflowError> {
        let arriving: Vec<[Vec<f64>; 2]> = direct.iter().map(DirectLight::irradiance).collect();
        let block = |k: usize| Block::from_channels(&arriving.iter().map(|own| own[k].clone()).collect::<Vec<_>>());
        let [irradiance, error] = [block(0), block(1)];
        let all = irradiance.values().iter().zip(error.values());
        if all.into_iter().all(|(h, e)| h + e <= 0.0) {
            return Ok(None);
        }
        let (reflectance, exitance) = solar_system(network, &irradiance);
        let rho = reflectance.clone();
        let none = Block::zeros(error.n_rows(), error.n_channels());
        let system = BandSystem {
            operator: &study.factors,
            reflectance,
            exitance,
            emitted_error: [none.clone(), none],
            outside: Outside {
                irradiance,
                error,
                radiosity: 0.0,
            },
            is_thermal: false,
        };
        let reflect = |x: &mut Block| {
            for (own, factor) in x.values_mut().iter_mut().zip(rho.values()) {
                *own *= factor;
            }
        };
        self.bands(study, system, reflect, request, cx).map(Some)
    }

    /// Solves one band for each light from outside and estimates its errors; `reflect`: x ← R x.
    fn bands(
        &mut self,
        study: &FormFactorStudy,
        system: BandSystem<'_>,
        reflect: impl Fn(&mut Block),
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<Vec<BandStudy>, WorkflowError> {
        let BandSystem {
            operator,
            reflectance,
            exitance,
            emitted_error,
            outside,
            is_thermal,
        } = system;
        let enclosure = study.enclosure();
        let mixed = is_thermal.then(|| enclosure.gain_of(operator));
        let known = Known {
            given: Given {
                gain: Some(mixed.as_deref().unwrap_or(&study.gain)),
                costly: false,
            },
            signed: is_thermal,
            aim: Some(AIM),
            ..study.known()
        };
        let solution = self.solve_system(operator, request, (&reflectance, &exitance), known, cx)?;
        let residual = solution.residual(&reflectance, &exitance);
        let solved = Solved {
            enclosure,
            operator,
            reflectance: &reflectance,
            outside: &outside,
            emitted_error: emitted_error.each_ref(),
            residual: &residual,
            converged: solution.stop_reason == StopReason::Converged,
        };
        let bands = cx.time("error", || solved.bands(&solution.radiosity, reflect))?;
        let coarse = self.coarsened(study, operator, &reflectance, &solution, cx)?;
        let mut all = Vec::new();
        for (c, mut band) in bands.into_iter().enumerate() {
            if !study.errors_known {
                band.forget_errors();
            }
            let error = study
                .errors_known
                .then(|| Block::from_values(band.own_errors[0].clone(), 1));
            let own = solution.of_channels(c..c + 1);
            let coarse = coarse.as_ref().map(|coarse| coarse.of_channels(c..c + 1));
            band.mesh_change = coarse.as_ref().map(|coarse| mesh_change(&enclosure, coarse));
            let exitance = exitance.channels(c..c + 1);
            let mesh_error = is_thermal
                .then(|| self.mesh_error(coarse.as_ref(), (&exitance, &own), cx))
                .flatten();
            all.push(BandStudy {
                band,
                error: TotalError::of(self, error.as_ref(), &own, cx),
                mesh_error,
                solution: own,
            });
        }
        Ok(all)
    }
}

/// Returns the change of the irradiance of each patch by a coarser mesh, W·m⁻²: F (d − (B − B̄)), with B̄ + d the radiosity of the coarser patch.
fn mesh_change(enclosure: &Enclosure<'_>, coarse: &Coarsened) -> Vec<f64> {
    let change = coarse.change.zip_with(&coarse.spread, |d, spread| d - spread);
    enclosure.received(&change).values().to_vec()
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
    fn warn(&self, n_faces: usize, cx: &Context) {
        warn_of_backs(&self.heat.balance, cx);
        self.warn_of_mesh(n_faces, cx);
        warn_of_errors(self.thermal.stop_reason, self.heat.relative_error, cx);
    }

    /// Warns if the error of the mesh is unknown, or estimated from too coarse a mesh.
    pub(super) fn warn_of_mesh(&self, n_faces: usize, cx: &Context) {
        if self.heat.thermal.mesh_change.is_none() {
            cx.warn_once(Warning::NoMeshError);
        }
        if let Some(coarse) = &self.mesh_error
            && coarse.n_patches <= n_faces
            && coarse.surface_mean_max > MAX_CHANGE
        {
            let change = coarse.surface_mean_max;
            cx.warn_once(Warning::OnePatchAFace { change });
        }
    }
}

/// Warns of heat that backs absorb.
pub(super) fn warn_of_backs(balance: &HeatBalance, cx: &Context) {
    let moved = balance.escaped_w + balance.supplied_w.abs() + balance.sun_w + balance.sky_w;
    if balance.absorbed_by_backs_w > TO_BACKS * moved {
        cx.warn(Warning::HeatToBacks {
            power_w: balance.absorbed_by_backs_w,
        });
    }
}

/// Warns of irradiances with a large `relative` error; an unknown error, and a solver that did not converge, have warnings of their own.
pub(super) fn warn_of_errors(reason: StopReason, relative: f64, cx: &Context) {
    if reason == StopReason::Converged && relative > MAX_HEAT_ERROR && relative.is_finite() {
        cx.warn(Warning::InexactHeat { relative });
    }
}
