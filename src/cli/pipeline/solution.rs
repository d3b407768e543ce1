//! Solutions of the radiosity system.

use std::ops::ControlFlow;
use std::sync::Arc;

use serde_json::{Value, json};

use super::{Computed, Prepared, Run};
use crate::audit::{self, Given};
use crate::cli::args::SolverArgs;
use crate::cli::failure::Failure;
use crate::form_factor::Fraction;
use crate::matrix::operator::{Block, LinearOperator};
use crate::matrix::{Need, Precision};
use crate::mesh::{Hierarchy, Mesh};
use crate::plan::Plan;
use crate::progress::Progress;
use crate::scene::SurfaceId;
use crate::solver::registry::SolverEntry;
use crate::solver::{
    self, RadiositySystem, Solution, SolveOptions, SolverError, SolverSettings, StopReason, Tolerance, relative_errors,
};

/// The relative change of radiosities by the rounding of form factors from which it is told: far above what every solution is off for its tolerance.
const ROUNDING_TOLD_FROM: f64 = 1e-4;

/// The bound on the error, relative to the light that is reflected, from which it is told, and what it is to be with the tolerance that is proposed then.
const MOST_OF_REFLECTED: f64 = 1e-3;
const WANTED_OF_REFLECTED: f64 = 1e-4;

/// The least tolerance that is proposed: below it, rounding keeps solvers from meeting it.
const LEAST_TOLERANCE: f64 = 1e-15;

/// Stops a solver on a signal or at the deadline.
pub(in crate::cli) fn go_on(progress: &dyn Progress) -> ControlFlow<()> {
    if progress.is_cancelled() || progress.is_late() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

impl Computed {
    /// Returns what is known of them beside their values.
    pub(in crate::cli) fn known(&self) -> Known<'_> {
        Known {
            given: Given {
                gain: Some(&self.gain),
                costly: false,
            },
            backs: Some(&self.sky.back),
            closed_rows: Some(&self.closed_rows),
        }
    }
}

/// What is known of form factors beside their values.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) struct Known<'a> {
    /// To those who audit a solution.
    pub(in crate::cli) given: Given<'a>,
    /// The fraction of the light of each patch that black backs take, \[n\].
    pub(in crate::cli) backs: Option<&'a [Fraction]>,
    /// The rows that are known to sum to 1, \[n\].
    pub(in crate::cli) closed_rows: Option<&'a [bool]>,
}

impl Run {
    /// Returns the solver that is asked for; settings that it has no use for are a usage error.
    pub(in crate::cli) fn solver_entry(&self, args: &SolverArgs) -> Result<&'static SolverEntry, Failure> {
        let entry = solver::registry::by_name(&args.solver)?;
        entry.checked(&self.solver_settings(args, entry))?;
        Ok(entry)
    }

    /// Returns what the solver, as it is set, needs of form factors.
    pub(in crate::cli) fn need(&self, args: &SolverArgs) -> Result<Need, Failure> {
        let entry = self.solver_entry(args)?;
        let gains = entry.gains_by_reciprocity(&self.solver_settings(args, entry));
        Ok(if gains && entry.name != "auto" {
            Need::Symmetry
        } else {
            Need::Light { gains }
        })
    }

    /// Returns the settings that the flags give a solver.
    fn solver_settings(&self, args: &SolverArgs, entry: &SolverEntry) -> SolverSettings {
        SolverSettings {
            omega: args.omega,
            bounds: args.bounds.map(Into::into),
            steps_per_pass: args.steps_per_pass,
            display: args.display_ambient,
            restart: args.restart,
            deflation: args.deflation.map(Into::into),
            depth: args.depth,
            // The flag is the storage's too; solvers that need no memory to speak of pass over it.
            memory_limit_byte: self
                .storage
                .args
                .memory
                .memory_limit
                .filter(|_| entry.settings.contains(&solver::registry::Setting::MemoryLimit)),
            ..SolverSettings::default()
        }
    }

    /// Solves the radiosity system of a scene.
    pub(in crate::cli) fn solve(
        &mut self,
        prepared: &mut Prepared,
        computed: &Computed,
        args: &SolverArgs,
    ) -> Result<Solution, Failure> {
        let (reflectance, exitance) = prepared.materials();
        let areas = computed.factors.areas().to_vec();
        self.solve_system(
            (&mut prepared.plan, &prepared.mesh),
            (&computed.factors, areas),
            args,
            (reflectance, exitance),
            computed.known(),
        )
    }

    /// Estimates the error of a solution from the errors of its form factors, W·m⁻², \[n, c\]: `None` where these are not known, and where light too bright or too dim has no
    /// estimate, which is no reason to keep the light itself back. `reflectance`, `exitance`: ρ, E.
    pub(in crate::cli) fn carried_error(
        &mut self,
        computed: &Computed,
        (reflectance, exitance): (&Block, &Block),
        solution: &Solution,
    ) -> Result<Option<Block>, Failure> {
        let is_rounded = computed.factors.storage().precision == Precision::F32;
        if !computed.errors_known && !is_rounded {
            return Ok(None);
        }
        let carried = self.times.time("error", || {
            solver::carried_error(&computed.factors, reflectance, exitance, solution)
        });
        match carried {
            Ok(error) if computed.errors_known => Ok(Some(error)),
            Ok(of_rounding) => Ok(self.unless_rounded_away(computed, of_rounding, solution)),
            Err(error @ SolverError::Disk(_)) => Err(error.into()),
            Err(_) => Ok(None),
        }
    }

    /// Warns where the rounding of form factors to f32, all that is known of their errors, counts; returns the error where nothing is known of the solution for that.
    fn unless_rounded_away(&mut self, computed: &Computed, error: Block, solution: &Solution) -> Option<Block> {
        let relative = relative_errors(computed.factors.areas(), &error, &solution.radiosity);
        if !relative.iter().all(|share| share.is_finite()) {
            return Some(error);
        }
        let relative = relative.into_iter().fold(0.0, f64::max);
        if relative > ROUNDING_TOLD_FROM {
            self.warn_once(&format!(
                "kept in f32, the form factors are rounded, which may change the radiosities by {relative:.1e} of themselves: use `--precision f64`"
            ));
        }
        None
    }

    /// Says of a system without a finite solution which surface of which file it is about, and what helps; `surface` is that of an unknown.
    pub(in crate::cli) fn refused(&self, error: SolverError, surface: impl Fn(usize) -> Option<SurfaceId>) -> Failure {
        let SolverError::NoFiniteSolution {
            patch,
            n_patches,
            channel,
            ..
        } = error
        else {
            return error.into();
        };
        let (file, reflectance) = match self.lighting_files.get(channel) {
            Some(Some(lighting)) => (lighting, "reflectance"),
            _ => (&self.scene_file, "Kd"),
        };
        let name = surface(patch).and_then(|id| self.surface_names.get(id.0 as usize));
        let place = name.map_or_else(|| format!("patch {patch}"), |name| format!("`{name}`"));
        let message = format!(
            "{}: no finite solution: {place} and what exchanges light with it ({n_patches} patches in all) emit, reflect everything, and let \
             nothing out; lower a `{reflectance}` below 1 there, or open the scene",
            file.display()
        );
        Failure {
            message,
            ..Failure::from(error).in_file(file)
        }
    }

    /// Solves for given form factors and areas, reflectances and exitances of the patches.
    pub(in crate::cli) fn solve_system(
        &mut self,
        (plan, mesh): (&mut Plan, &Mesh),
        (factors, areas): (&dyn LinearOperator, Vec<f64>),
        args: &SolverArgs,
        (reflectance, exitance): (Block, Block),
        known: Known<'_>,
    ) -> Result<Solution, Failure> {
        let entry = self.solver_entry(args)?;
        let hierarchy = entry.uses_hierarchy().then(|| {
            let hierarchy = self.times.time("levels", || Hierarchy::of_mesh(mesh));
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
            ..self.solver_settings(args, entry)
        })?;
        self.set("solver", entry.name);
        self.set("tolerance", args.tolerance);
        self.set("max_passes", args.max_passes);
        self.set("start", json!(args.start));
        let refused = |run: &Self, error: SolverError| {
            let surface = |patch: usize| mesh.patches.get(patch).map(|patch| patch.surface);
            run.refused(error, surface)
        };
        let materials = (reflectance.clone(), exitance.clone());
        let system = RadiositySystem::new(factors, areas, reflectance, exitance)
            .and_then(|system| match known.closed_rows {
                Some(rows) => system.with_closed_rows(rows),
                None => Ok(system),
            })
            .map_err(|error| refused(self, error))?;
        let options = SolveOptions {
            tolerance: Tolerance::ResidualL2(args.tolerance),
            max_passes: args.max_passes,
            start: args.start.into(),
            ..SolveOptions::default()
        };
        for (name, value) in [
            ("omega", args.omega.map(Value::from)),
            ("bounds", args.bounds.map(|bounds| json!(bounds))),
            ("restart", args.restart.map(|n| Value::from(n.get()))),
            ("depth", args.depth.map(|n| Value::from(n.get()))),
            ("deflation", args.deflation.map(|deflation| json!(deflation))),
            ("steps_per_pass", args.steps_per_pass.map(|n| Value::from(n.get()))),
            ("display_ambient", args.display_ambient.then_some(Value::Bool(true))),
        ] {
            if let Some(value) = value {
                self.set(name, value);
            }
        }
        let solved = self.times.time("solve", || {
            solver.solve(&system, &options, &mut |_| go_on(&self.progress))
        });
        let mut solution = solved.map_err(|error| refused(self, error))?;
        if solution.stop_reason == StopReason::Interrupted {
            self.go_on()?;
        }
        let of_reflected = solution.error_bound_of_reflected(&system);
        if solution.stop_reason == StopReason::Converged
            && let Some(bound) = of_reflected.filter(|bound| *bound > MOST_OF_REFLECTED)
        {
            let tolerance = 10_f64.powf((solution.residual_l2 * WANTED_OF_REFLECTED / bound).log10().floor());
            let remedy = if tolerance >= LEAST_TOLERANCE {
                format!("give --tolerance {tolerance:e}")
            } else {
                "make the lamps larger and dimmer, of the same power".to_owned()
            };
            self.warn(&format!(
                "the lamps' own light has nearly all of what the tolerance is relative to: the bound on the error is {bound:.1e} of the light that is reflected; {remedy}"
            ));
        }
        let audit = self
            .times
            .time("audit", || audit::solution(&system, &solution, known.given))?;
        self.audited(audit);
        self.judge_leaking_power((&materials.0, &materials.1), &solution.radiosity);
        if args.display_ambient {
            solution = solution.displayed(&system)?;
        }
        if let Some(backs) = known.backs {
            let backs: Vec<f64> = backs.iter().map(|back| back.value).collect();
            solution.tell_backs_apart(system.areas(), &backs);
        }
        if let Some(choice) = &solution.choice {
            plan.decide("solver", choice.solver, choice.why.to_string());
        }
        let is_negative = solution.radiosity.values().iter().any(|b| *b < 0.0);
        if solution.stop_reason == StopReason::Diverged && solution.residual_l2 <= args.tolerance && is_negative {
            let row_sum_max = system.row_sums().iter().copied().fold(0.0, f64::max);
            self.warn(&format!(
                "the equations have no solution of light: what meets them, at a relative residual of {:.3e}, is negative in places, as form factors whose rows sum to up to {row_sum_max:.6} make light",
                solution.residual_l2
            ));
        } else if solution.stop_reason != StopReason::Converged {
            self.warn(&format!(
                "the solver stopped without converging ({}) at a relative residual of {:.3e}",
                solution.stop_reason, solution.residual_l2
            ));
        }
        Ok(solution)
    }
}
