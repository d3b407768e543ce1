//! `radiosity solve`.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::args::SolveArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::form_factors::{self, DEFAULT_RAYS, checks_to_json, describe_checks};
use super::pipeline::{Computed, Fineness, Prepared, Run, materials_of_patches};
use super::{Outcome, output, reuse};
use crate::form_factor::ExactMethod;
use crate::mesh::Subdivision;
use crate::report::form_factors::FormFactorFile;
use crate::report::solution::{Format, SolutionReport};
use crate::solver::{Solution, StopReason};

/// What stands in the place of a solver's name where none was needed.
pub(super) const NO_SOLVER: &str = "none";

pub(super) fn run(args: &SolveArgs) -> Result<Outcome, Failure> {
    let mut run = Run::new("solve", &args.common);
    if let Some(path) = &args.output {
        Format::of(path)?;
        output::expect_possible(path)?;
    }
    let file = args.form_factors.as_deref().map(FormFactorFile::open).transpose()?;
    let mesh_args = file
        .as_ref()
        .map_or(Ok(args.mesh), |file| reuse::mesh_args(file, args.mesh))?;
    let mut prepared = run.prepare(&args.scene, mesh_args, |_| Subdivision::Uniform(1))?;
    let needs_symmetry = run.solver_entry(&args.solver)?.needs_reciprocity;
    let computed = match &file {
        None => {
            let fineness = Fineness {
                default_rays: DEFAULT_RAYS,
                tolerance: args.form_factor_tolerance,
                default_tolerance: ExactMethod::DEFAULT_TOLERANCE,
                tolerance_name: "form_factor_tolerance",
            };
            run.form_factors(&mut prepared, &args.method, fineness, needs_symmetry)?
        }
        Some(file) => {
            let result = reuse::form_factors(&mut run, &mut prepared, file, &args.scene)?;
            run.repaired(&mut prepared, result, args.method.balance, needs_symmetry)?
        }
    };
    let solution = run.solve(&mut prepared, &computed, &args.solver)?;
    if let Some(path) = &args.output {
        let (reflectance, exitance) = materials_of_patches(&prepared.scene, &prepared.mesh, prepared.plan.n_channels);
        let report = SolutionReport {
            scene: &prepared.scene,
            mesh: &prepared.mesh,
            reflectance: &reflectance,
            exitance: &exitance,
            solution: &solution,
            settings: &run.settings,
        };
        run.times.time("write", || report.write(path))?;
    }
    run.progress.finish();
    let mut result = to_json(&prepared, &args.solver.solver, &solution);
    result["form_factors"] = checks_to_json(&computed);
    let document = run.document(&prepared, result);
    let mut text = run.explanation(&prepared);
    let _ = writeln!(
        text,
        "{} patches on {} surfaces",
        prepared.mesh.n_patches(),
        prepared.scene.surfaces.len()
    );
    describe_checks(&mut text, &computed);
    describe(&mut text, &prepared, &args.solver.solver, &solution);
    run.describe_times(&mut text);
    if let Some(path) = &args.output {
        let _ = writeln!(text, "wrote {}", path.display());
    }
    Ok(Outcome {
        text,
        document,
        code: code(&solution, Some(&computed)),
    })
}

/// Returns the exit code that a solution and the form factors that it is from deserve.
pub(super) fn code(solution: &Solution, computed: Option<&Computed>) -> ExitCode {
    if solution.stop_reason == StopReason::Converged {
        computed.map_or(ExitCode::Done, form_factors::code)
    } else {
        ExitCode::NotConverged
    }
}

/// Returns what documents say about a solution.
pub(super) fn to_json(prepared: &Prepared, solver: &str, solution: &Solution) -> Value {
    let selections = &solution.selections;
    json!({
        "n_steps": (!selections.is_empty()).then(|| selections.iter().sum::<u64>()),
        "n_patches": prepared.mesh.n_patches(),
        "n_channels": solution.radiosity.n_channels(),
        "solver": solver,
        "why": null,
        "stop_reason": solution.stop_reason,
        "n_passes": solution.n_passes,
        "residual_max_power": solution.residual_max_power,
        "residual_l2": solution.residual_l2,
        "error_bound": solution.error_bound,
        "history": solution.history,
        "surfaces": prepared.surfaces_with_radiosity(solution),
    })
}

/// Describes a solution: how it was reached, and the mean radiosity of each surface.
pub(super) fn describe(text: &mut String, prepared: &Prepared, solver: &str, solution: &Solution) {
    if solver == NO_SOLVER {
        let _ = writeln!(
            text,
            "nothing reflects: the radiosity is the exitance, and no form factor is needed"
        );
    } else {
        let bound = solution
            .error_bound
            .map_or("unknown".to_owned(), |bound| format!("{bound:.1e}"));
        let _ = writeln!(
            text,
            "{solver}: {} after {} passes, relative residual {:.1e}, bound on the relative error {bound}",
            solution.stop_reason, solution.n_passes, solution.residual_l2
        );
    }
    let _ = writeln!(text, "\nmean radiosity by surface, W/m²");
    let surfaces = prepared.surface_means(&solution.radiosity);
    let names = prepared.scene.surfaces.iter().map(|s| s.name.as_str());
    let width = names.clone().map(|name| name.chars().count()).max().unwrap_or(0);
    for (name, mean) in names.zip(&surfaces) {
        let _ = write!(text, "{name:width$}");
        for value in mean {
            let _ = write!(text, " {value:>12.6}");
        }
        let _ = writeln!(text);
    }
    let _ = writeln!(text);
}
