//! Solutions of the radiosity system, with their errors.

use std::ops::{ControlFlow, Range};
use std::path::Path;
use std::sync::Arc;

use super::mesh_error::MeshError;
use super::total_error::TotalError;
use super::{Context, DirectDaylight, FormFactorStudy, Model, Warning, WorkflowError};
use crate::audit::{self, Given};
use crate::form_factor::Fraction;
use crate::matrix::operator::{Block, LinearOperator};
use crate::matrix::{Need, Precision};
use crate::mesh::{Hierarchy, Mesh};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::report::solution::SolutionReport;
use crate::scene::{Scene, SurfaceId, too_bright_patch};
use crate::solver::registry::{self, SolverEntry, Symmetry};
use crate::solver::{
    self, Coarsened, DISPLAY_AMBIENT, RadiositySystem, SharedPasses, Solution, SolveOptions, SolverError,
    SolverSettings, Start, StopReason, Tolerance, relative_errors,
};

/// The least relative change of the radiosity by the rounding of form factors that is reported, far above the error that the tolerance of a solution allows.
const ROUNDING_TOLD_FROM: f64 = 1e-4;

/// The least reported bound on the error, relative to the reflected radiosity, and the bound that the proposed tolerance gives.
const MAX_OF_REFLECTED: f64 = 1e-3;
const WANTED_OF_REFLECTED: f64 = 1e-4;

/// The least proposed tolerance: rounding keeps solvers from meeting smaller ones.
const MIN_TOLERANCE: f64 = 1e-15;

/// Stops a solver after a request to stop, or after the deadline.
pub fn go_on(progress: &dyn Progress) -> ControlFlow<()> {
    if progress.is_cancelled() || progress.is_late() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

/// The request for a solution of a system.
#[derive(Clone, Debug)]
pub struct SolveRequest {
    /// The name of the solver.
    pub solver: String,
    /// Its settings, as far as they are set; levels of the mesh and the memory limit are added.
    pub settings: SolverSettings,
    /// The tolerance on sqrt(Σ A r² / Σ A E²), the worst channel.
    pub tolerance: f64,
    /// The greatest number of passes over the form factors.
    pub max_passes: usize,
    /// The first radiosities.
    pub start: Start,
}

impl SolveRequest {
    /// The default [`tolerance`](Self::tolerance).
    pub const TOLERANCE: f64 = 1e-6;

    /// The default [`max_passes`](Self::max_passes).
    pub const MAX_PASSES: usize = 1000;

    /// The range of useful tolerances: no residual below it differs from 0, and from 1 on zero radiosity would suffice.
    pub const TOLERANCES: Range<f64> = 1e-300..1.0;
}

impl Default for SolveRequest {
    /// Returns the request for the solver that suits the system, to 1e-6 in at most 1000 passes.
    fn default() -> Self {
        Self {
            solver: "auto".to_owned(),
            settings: SolverSettings::default(),
            tolerance: Self::TOLERANCE,
            max_passes: Self::MAX_PASSES,
            start: Start::default(),
        }
    }
}

/// A solution with its errors.
#[derive(Debug)]
pub struct SolutionStudy {
    /// B and H, with the report of the solver.
    pub solution: Solution,
    /// The error of each patch's radiosity by the errors of the form factors, W·m⁻², \[n, c\]; `None` where these are unknown.
    pub carried: Option<Block>,
    /// The error by solver and form factors together.
    pub error: TotalError,
    /// The change by a coarser mesh; `None` where unknown.
    pub mesh_error: Option<MeshError>,
    /// The direct light of sun and sky.
    pub direct: DirectDaylight,
}

/// Properties of form factors beside their values.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// The input of the audit of a solution.
    pub given: Given<'a>,
    /// The fraction of the light of each patch that black backs absorb, \[n\].
    pub backs: Option<&'a [Fraction]>,
    /// The rows that are known to sum to 1, \[n\].
    pub closed_rows: Option<&'a [bool]>,
    /// True if exitances may be negative, as where heat is removed.
    pub signed: bool,
    /// A tolerance below that of the request that is tried first; if it is not reached, that of the request applies.
    pub aim: Option<f64>,
}

impl FormFactorStudy {
    /// Returns the properties of the form factors beside their values.
    #[must_use]
    pub fn known(&self) -> Known<'_> {
        Known {
            given: Given {
                gain: Some(&self.gain),
                costly: false,
            },
            backs: Some(&self.sky.back),
            closed_rows: Some(&self.closed_rows),
            signed: false,
            aim: None,
        }
    }
}

impl SolveRequest {
    /// Returns the requested solver.
    ///
    /// # Errors
    /// [`WorkflowError::Solver`] for an unknown name, and for settings that it does not use.
    pub fn entry(&self, cx: &Context) -> Result<&'static SolverEntry, WorkflowError> {
        let entry = registry::by_name(&self.solver)?;
        entry.checked(&self.settings_in(cx))?;
        Ok(entry)
    }

    /// Returns the solver's requirements on form factors, with its settings.
    ///
    /// # Errors
    /// As [`entry`](Self::entry).
    pub fn need(&self, cx: &Context) -> Result<Need, WorkflowError> {
        let entry = self.entry(cx)?;
        Ok(match (entry.symmetry)(&self.settings_in(cx)) {
            Symmetry::Needed => Need::Symmetry,
            Symmetry::Helps => Need::Light { gains: true },
            Symmetry::Unused => Need::Light { gains: false },
        })
    }

    /// Returns the settings of the solver, with the memory limit of the storage.
    fn settings_in(&self, cx: &Context) -> SolverSettings {
        SolverSettings {
            memory_limit_byte: cx.memory.limit_byte,
            ..self.settings.clone()
        }
    }

    fn note_settings(&self, entry: &SolverEntry, cx: &mut Context) {
        let noted = &mut cx.settings;
        noted.solver = Some(entry.name.to_owned());
        noted.tolerance = Some(self.tolerance);
        noted.max_passes = Some(self.max_passes as u64);
        noted.start = Some(self.start);
        noted.own.extend(&self.settings.values);
    }
}

impl Model {
    /// Solves for the light of the scene's own materials, and estimates its error.
    ///
    /// # Errors
    /// As [`solve_system`](Self::solve_system).
    pub fn solve(
        &mut self,
        study: &FormFactorStudy,
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<SolutionStudy, WorkflowError> {
        let materials = self.materials();
        self.solve_with(study, (&materials.0, &materials.1), request, cx)
    }

    /// Solves for the light of other reflectances and exitances of the patches, ρ and E, W·m⁻², \[n, c\] each, and estimates its error.
    ///
    /// All channels share the same passes.
    ///
    /// # Errors
    /// As [`solve_system`](Self::solve_system).
    pub fn solve_with(
        &mut self,
        study: &FormFactorStudy,
        (reflectance, exitance): (&Block, &Block),
        request: &SolveRequest,
        cx: &mut Context,
    ) -> Result<SolutionStudy, WorkflowError> {
        let too_bright = too_bright_patch(study.factors.areas(), reflectance.values(), exitance.values());
        if let Some((patch, channel, brightest, limit)) = too_bright {
            return Err(WorkflowError::Solver(SolverError::TooBright {
                patch,
                channel,
                exitance: brightest,
                limit,
            }));
        }
        let materials = (reflectance, exitance);
        let solution = self.solve_system(&study.factors, request, materials, study.known(), cx)?;
        self.judged(study, materials, None, solution, cx)
    }

    /// Returns the light E of a scene in which nothing reflects, with an indirect irradiance of 0.
    ///
    /// No form factor is needed if the direct light is found otherwise.
    #[must_use]
    pub fn without_reflection(&mut self, cx: &Context) -> (SolutionStudy, Block) {
        let reason = "form factors and solver: nothing reflects, and the direct pass finds all light";
        self.plan.left_out.push(reason.into());
        let (_, exitance) = self.materials();
        let dark = Block::zeros(exitance.n_rows(), exitance.n_channels());
        let solution = Solution::without_reflection(exitance);
        let study = SolutionStudy {
            error: TotalError::of(self, None, &solution, cx),
            solution,
            carried: None,
            mesh_error: None,
            direct: DirectDaylight::default(),
        };
        (study, dark)
    }

    /// Estimates the error of a solution for `reflectance` and `exitance`, ρ and E; the latter may have an error of its own, W·m⁻², \[n, c\].
    ///
    /// # Errors
    /// [`WorkflowError::Matrix`] where form factors on a disk cannot be read, and [`WorkflowError::Interrupted`].
    pub(super) fn judged(
        &self,
        study: &FormFactorStudy,
        (reflectance, exitance): (&Block, &Block),
        exitance_error: Option<&Block>,
        solution: Solution,
        cx: &Context,
    ) -> Result<SolutionStudy, WorkflowError> {
        let carried = study.carried_error((reflectance, exitance), exitance_error, &solution, cx)?;
        let coarse = self.coarsened(study, &study.factors, reflectance, &solution, cx)?;
        study.factors.if_readable(())?;
        Ok(self.with_errors((exitance, solution), carried, coarse.as_ref(), cx))
    }

    /// Returns a solution for the exitance E with the error that its form factors cause, and that of the mesh by a coarser one.
    pub(super) fn with_errors(
        &self,
        (exitance, solution): (&Block, Solution),
        carried: Option<Block>,
        coarse: Option<&Coarsened>,
        cx: &Context,
    ) -> SolutionStudy {
        let mesh_error = self.mesh_error(coarse, (exitance, &solution), cx);
        SolutionStudy {
            error: TotalError::of(self, carried.as_ref(), &solution, cx),
            solution,
            carried,
            mesh_error,
            direct: DirectDaylight::default(),
        }
    }

    /// Writes a solution for `reflectance` and `exitance`, ρ and E, to a file, with the row sums of its form factors if these are stored.
    ///
    /// # Errors
    /// [`WorkflowError::Report`].
    pub fn write_solution(
        &self,
        path: &Path,
        factors: Option<&FormFactorStudy>,
        (reflectance, exitance): (&Block, &Block),
        study: &SolutionStudy,
        cx: &Context,
    ) -> Result<(), WorkflowError> {
        let row_sums = factors.map(|factors| factors.factors.row_sums());
        let report = SolutionReport {
            scene: &self.scene,
            mesh: &self.mesh,
            reflectance,
            exitance,
            solution: &study.solution,
            error: study.carried.as_ref(),
            row_sums: row_sums.as_deref(),
            sun: study.direct.sun.as_ref(),
            skylight: study.direct.sky.as_ref(),
            sky: factors.map(|factors| &factors.sky),
            settings: &cx.settings.record(),
        };
        Ok(report.write(path)?)
    }

    /// Solves for given form factors, reflectances and exitances of the patches, and audits the solution.
    ///
    /// # Errors
    /// [`WorkflowError::Solver`], [`WorkflowError::NoFiniteSolution`], [`WorkflowError::Matrix`] and [`WorkflowError::Interrupted`].
    pub fn solve_system(
        &mut self,
        factors: &dyn LinearOperator,
        request: &SolveRequest,
        materials: (&Block, &Block),
        known: Known<'_>,
        cx: &mut Context,
    ) -> Result<Solution, WorkflowError> {
        let parts = Parts {
            scene: &self.scene,
            file: &self.file,
            mesh: &self.mesh,
            plan: &mut self.plan,
        };
        solve_system(parts, factors, request, materials, known, cx)
    }
}

/// The parts of a model that a solver needs, which leaves the rest free for its form factors.
pub(super) struct Parts<'a> {
    pub(super) scene: &'a Scene,
    pub(super) file: &'a Path,
    pub(super) mesh: &'a Mesh,
    pub(super) plan: &'a mut Plan,
}

pub(super) fn solve_system(
    parts: Parts<'_>,
    factors: &dyn LinearOperator,
    request: &SolveRequest,
    (reflectance, exitance): (&Block, &Block),
    known: Known<'_>,
    cx: &mut Context,
) -> Result<Solution, WorkflowError> {
    let Parts {
        scene,
        file,
        mesh,
        plan,
    } = parts;
    let entry = request.entry(cx)?;
    let hierarchy = entry.uses_hierarchy.then(|| {
        let hierarchy = cx.time("levels", || Hierarchy::of_mesh(mesh));
        let sizes: Vec<String> = hierarchy.sizes().iter().map(ToString::to_string).collect();
        plan.decide(
            "levels",
            sizes.join(", "),
            "patches of the mesh, the finest level first",
        );
        Arc::new(hierarchy)
    });
    let solver = entry.checked(&SolverSettings {
        hierarchy,
        ..request.settings_in(cx)
    })?;
    request.note_settings(entry, cx);
    let refused = |error: SolverError, of: &Context| {
        let surface = |patch: usize| mesh.patches.get(patch).map(|patch| patch.surface);
        refused((scene, file), error, surface, of)
    };
    let build = if known.signed {
        RadiositySystem::with_signed_exitance
    } else {
        RadiositySystem::new
    };
    cx.expect_same_numbers("lighting, sun or boundary", &[reflectance, exitance])?;
    let ranks = Arc::clone(&cx.ranks);
    let shared = SharedPasses::new(factors, &*ranks);
    let factors = if ranks.size() == 1 { factors } else { &shared };
    let system = build(factors, mesh.areas(), reflectance.clone(), exitance.clone())
        .and_then(|system| match known.closed_rows {
            Some(rows) => system.with_closed_rows(rows),
            None => Ok(system),
        })
        .map_err(|error| refused(error, cx))?;
    let options = SolveOptions {
        tolerance: Tolerance::ResidualL2(known.aim.map_or(request.tolerance, |aim| aim.min(request.tolerance))),
        max_passes: request.max_passes,
        start: request.start,
        ..SolveOptions::default()
    };
    let solved = {
        let watch = cx.progress();
        cx.time("solve", || solver.solve(&system, &options, &mut |_| go_on(&watch)))
    };
    let mut solution = solved.map_err(|error| refused(error, cx))?;
    if solution.stop_reason == StopReason::Interrupted {
        cx.go_on()?;
    } else if known.aim.is_some()
        && solution.stop_reason != StopReason::Diverged
        && solution.residual_l2 <= request.tolerance
    {
        solution.accept();
    }
    // The error of heat is stated patch by patch.
    if !known.signed {
        warn_of_bright_lamps(&system, &solution, cx);
    }
    let audit = cx.time("audit", || audit::solution(&system, &solution, known.given))?;
    cx.audited(audit);
    cx.judge_leaking_power((reflectance, exitance), &solution.radiosity);
    if request.settings.values.is_on(&DISPLAY_AMBIENT) {
        solution = solution.displayed(&system)?;
    }
    if let Some(backs) = known.backs {
        let backs: Vec<f64> = backs.iter().map(|back| back.value).collect();
        solution.split_escaped_by_backs(system.areas(), &backs);
    }
    if let Some(choice) = &solution.choice {
        plan.decide("solver", choice.solver, choice.why.to_string());
    }
    warn_of_its_end(&system, &solution, request.tolerance, cx);
    Ok(solution)
}

/// Adds surface, file and remedy to the error of a system without a finite solution; `surface` returns the surface of an unknown.
pub(super) fn refused(
    (scene, file): (&Scene, &Path),
    error: SolverError,
    surface: impl Fn(usize) -> Option<SurfaceId>,
    cx: &Context,
) -> WorkflowError {
    let SolverError::NoFiniteSolution {
        patch,
        n_patches,
        channel,
        ..
    } = error
    else {
        return error.into();
    };
    let (file, reflectance) = match cx.lighting_files.get(channel) {
        Some(Some(lighting)) => (lighting.as_path(), "reflectance"),
        _ => (file, "Kd"),
    };
    let name = surface(patch).and_then(|id| scene.surfaces.get(id.0 as usize));
    WorkflowError::NoFiniteSolution {
        file: file.to_owned(),
        place: name.map_or_else(|| format!("patch {patch}"), |found| format!("`{}`", found.name)),
        n_patches,
        reflectance,
    }
}

fn warn_of_bright_lamps(system: &RadiositySystem<'_>, solution: &Solution, cx: &Context) {
    let of_reflected = solution.error_bound_of_reflected(system);
    if solution.stop_reason == StopReason::Converged
        && let Some(bound) = of_reflected.filter(|bound| *bound > MAX_OF_REFLECTED)
    {
        let tolerance = 10_f64.powf((solution.residual_l2 * WANTED_OF_REFLECTED / bound).log10().floor());
        cx.warn(Warning::LampsOutshine {
            bound,
            tolerance: (tolerance >= MIN_TOLERANCE).then_some(tolerance),
        });
    }
}

/// Warns of a solver that did not converge, or converged to negative light.
fn warn_of_its_end(system: &RadiositySystem<'_>, solution: &Solution, tolerance: f64, cx: &Context) {
    let residual = solution.residual_l2;
    let is_negative = solution.radiosity.values().iter().any(|b| *b < 0.0);
    if solution.stop_reason == StopReason::Diverged && residual <= tolerance && is_negative {
        cx.warn(Warning::NegativeLight {
            residual,
            row_sum_max: system.row_sums().iter().copied().fold(0.0, f64::max),
        });
    } else if solution.stop_reason != StopReason::Converged {
        cx.warn(Warning::NotConverged {
            reason: solution.stop_reason,
            residual,
        });
    }
}

impl FormFactorStudy {
    /// Estimates the error of a solution by the errors of its form factors, W·m⁻², \[n, c\]. `materials`: ρ and E; the latter may have an error of its own.
    ///
    /// Returns `None` where these are unknown, and where light too bright or too dim has no estimate; the light itself is still valid.
    ///
    /// # Errors
    /// [`WorkflowError::Matrix`] where form factors on a disk cannot be read.
    pub(super) fn carried_error(
        &self,
        materials: (&Block, &Block),
        exitance_error: Option<&Block>,
        solution: &Solution,
        cx: &Context,
    ) -> Result<Option<Block>, WorkflowError> {
        let is_rounded = self.factors.storage().precision == Precision::F32;
        if !self.errors_known && !is_rounded {
            return Ok(None);
        }
        let carried = cx.time("error", || {
            solver::carried_error(&self.factors, materials, exitance_error, solution)
        });
        match carried {
            Ok(error) if self.errors_known => Ok(Some(error)),
            Ok(of_rounding) => Ok(self.unless_rounded_away(of_rounding, solution, cx)),
            Err(error @ SolverError::Disk(_)) => Err(error.into()),
            Err(_) => Ok(None),
        }
    }

    /// Warns of a significant rounding of form factors to f32, which is the only known part of their errors; returns the error if it is not finite.
    fn unless_rounded_away(&self, error: Block, solution: &Solution, cx: &Context) -> Option<Block> {
        let relative = relative_errors(self.factors.areas(), &error, &solution.radiosity);
        if !relative.iter().all(|share| share.is_finite()) {
            return Some(error);
        }
        let relative = relative.into_iter().fold(0.0, f64::max);
        if relative > ROUNDING_TOLD_FROM {
            cx.warn_once(Warning::RoundedToF32 { relative });
        }
        None
    }
}
