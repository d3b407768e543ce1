//! `radiosity solve`.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::args::SolveArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::form_factors::{DEFAULT_RAYS, checks_to_json, describe_checks};
use super::lightings::{Lightings, with_suffix};
use super::mesh_error::MeshError;
use super::pipeline::{Computed, Fineness, Prepared, Run, repair};
use super::stated::Stated;
use super::storage::Storage;
use super::{Outcome, cell, lightings, merge, name_width, reuse};
use crate::form_factor::ExactMethod;
use crate::matrix::Sampling;
use crate::mesh::Subdivision;
use crate::printable::{counted, printable};
use crate::report::form_factors::{FormFactorFile, files_of};
use crate::report::solution::{Format, SolutionReport};
use crate::solver::{Solution, StopReason};

/// What stands in the place of a solver's name where none was needed.
pub(super) const NO_SOLVER: &str = "none";

pub(super) fn run(args: &SolveArgs) -> Result<Outcome, Failure> {
    let mut run = Run::new("solve", &args.common);
    let result = work(args, &mut run);
    run.ended(result)
}

fn work(args: &SolveArgs, run: &mut Run) -> Result<Outcome, Failure> {
    if let Some(path) = &args.output {
        Format::of(path)?;
    }
    files(args)?.check()?;
    let file = args.form_factors.as_deref().map(FormFactorFile::open).transpose()?;
    let mesh_args = file
        .as_ref()
        .map_or(Ok(args.mesh), |file| reuse::mesh_args(file, args.mesh))?;
    run.storage = Storage {
        args: args.storage.clone(),
        part: 0,
        output: args.output.clone(),
        tolerance: Some(args.solver.tolerance),
        ..Storage::default()
    };
    run.has_lightings = !args.lighting.is_empty();
    let mut prepared = run.prepare(&args.scene, mesh_args, args.storage.memory.memory_limit, |_| {
        Subdivision::Uniform(1)
    })?;
    // Before the work: a mistake in them is found at once, and their reflectances count in how form factors are stored.
    let loaded = Lightings::load(args, &prepared.scene)?;
    run.storage.reflectance_max = loaded.reflectance_max();
    loaded.warn_of_darkness(run, &prepared.scene, &args.lighting);
    if args.on_the_fly {
        let request = super::on_the_fly::Request {
            method: &args.method,
            fineness: fineness(args),
            solver: &args.solver,
            indirect: false,
        };
        let (solution, _) = super::on_the_fly::solve(run, &mut prepared, &request)?;
        return finish(args, run, &prepared, None, &solution);
    }
    let need = run.need(&args.solver)?;
    let computed = match &file {
        None => run.form_factors(&mut prepared, &args.method, fineness(args), need)?,
        Some(file) => {
            let need = run.or_symmetry(args.method.balance, need)?;
            let promised = reuse::promised(file);
            let sequence = file.description().settings.get("sequence");
            let sampling = if file.description().symmetric {
                Sampling::of_pairs(promised.noisy_pairs)
            } else {
                Sampling::of_rows(sequence.is_some(), sequence.is_some_and(|name| name == "sobol"))
            };
            let kind = repair(args.method.balance, need, sampling);
            let result = reuse::form_factors(run, &mut prepared, file, &args.scene, kind)?;
            run.repaired(&mut prepared, result, &args.method, need, promised)?
        }
    };
    if !args.lighting.is_empty() {
        return lightings::run(&loaded, run, prepared, &computed, args);
    }
    let solution = run.solve(&mut prepared, &computed, &args.solver)?;
    finish(args, run, &prepared, Some(&computed), &solution)
}

fn files(args: &SolveArgs) -> Result<FileSet, Failure> {
    let mut files = FileSet::default();
    match &args.output {
        Some(path) if args.lighting.is_empty() => {
            files.writes("the output", path);
        }
        Some(path) => {
            for name in lightings::names(&args.lighting)? {
                files.writes(
                    format!("the output for the lighting `{name}`"),
                    &with_suffix(path, &name),
                );
            }
        }
        None => {}
    }
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene);
    for file in args.form_factors.iter().flat_map(|path| files_of(path)) {
        files.reads("the form factors", Some(&file));
    }
    for file in &args.lighting {
        files.reads("a lighting", Some(file));
    }
    Ok(files)
}

fn fineness(args: &SolveArgs) -> Fineness {
    Fineness {
        default_rays: DEFAULT_RAYS,
        tolerance: args.form_factor_tolerance,
        default_tolerance: ExactMethod::DEFAULT_TOLERANCE,
        tolerance_flag: "--form-factor-tolerance",
    }
}

/// Writes and describes a solution; without `computed` there are no stored form factors to tell of.
fn finish(
    args: &SolveArgs,
    run: &mut Run,
    prepared: &Prepared,
    computed: Option<&Computed>,
    solution: &Solution,
) -> Result<Outcome, Failure> {
    let (reflectance, exitance) = prepared.materials();
    let (error, mesh_error) = match computed {
        Some(computed) => (run.carried_error(computed, (&reflectance, &exitance), solution)?, {
            let coarse = run.coarsened(prepared, computed, &reflectance, solution)?;
            run.mesh_error(prepared, coarse.as_ref(), (&exitance, solution))
        }),
        None => (None, None),
    };
    if let Some(path) = &args.output {
        let row_sums = computed.map(|computed| computed.factors.row_sums());
        let report = SolutionReport {
            scene: &prepared.scene,
            mesh: &prepared.mesh,
            reflectance: &reflectance,
            exitance: &exitance,
            solution,
            error: error.as_ref(),
            row_sums: row_sums.as_deref(),
            settings: &run.settings,
        };
        run.times.time("write", || report.write(path))?;
    }
    let stated = run.stated(prepared, error.as_ref(), solution);
    run.progress.finish();
    let mut result = to_json(prepared, &args.solver.solver, solution, stated);
    result["form_factors"] = computed.map_or(Value::Null, checks_to_json);
    result["mesh_error"] = json!(mesh_error);
    let document = run.document_of(prepared, result);
    let mut text = run.explanation(prepared);
    let _ = writeln!(
        text,
        "{} patches on {}",
        prepared.mesh.n_patches(),
        counted(prepared.scene.surfaces.len(), "surface")
    );
    if let Some(computed) = computed {
        describe_checks(&mut text, computed);
    }
    let solver = &args.solver.solver;
    describe(&mut text, prepared, (solver, mesh_error.as_ref()), solution, stated);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    if let Some(path) = &args.output {
        let _ = writeln!(text, "wrote {}", path.display());
    }
    Ok(Outcome {
        text,
        document,
        code: run.judged(code(solution, computed, stated), args.audit.strict),
    })
}

/// Returns the exit code that a solution, the form factors that it is from, and what they say of its error deserve.
pub(super) fn code(solution: &Solution, computed: Option<&Computed>, stated: Stated) -> ExitCode {
    if solution.stop_reason == StopReason::Converged && stated != Stated::TooGreat {
        computed.map_or(ExitCode::Done, |computed| computed.code)
    } else {
        ExitCode::NotConverged
    }
}

/// Returns what documents say about a solution; `stated` is the relative error that solver and form factors together state.
pub(super) fn to_json(prepared: &Prepared, solver: &str, solution: &Solution, stated: Stated) -> Value {
    let selections = &solution.selections;
    let mut document = json!({
        "n_steps": (!selections.is_empty()).then(|| selections.iter().sum::<u64>()),
        "n_patches": prepared.mesh.n_patches(),
        "n_channels": solution.radiosity.n_channels(),
        "solver": chosen(solver, solution),
        "why": solution.choice.as_ref().map(|choice| &choice.why),
        "n_passes": solution.n_passes,
        "setup_work": solution.setup_work,
        "setup_s": solution.setup_s,
        "history": solution.history,
        "energy": solution.energy,
        "surfaces": prepared.surfaces_with_radiosity(solution),
    });
    merge(&mut document, quality_to_json(solution, stated));
    document
}

/// Returns how good a solution is: what stands beside each that documents tell of.
pub(super) fn quality_to_json(solution: &Solution, stated: Stated) -> Value {
    json!({
        "stop_reason": solution.stop_reason,
        "residual_max_power": solution.residual_max_power,
        "residual_l2": solution.residual_l2,
        "error_bound": solution.error_bound,
        "estimated_relative_error": stated.relative(),
    })
}

/// Returns the name of the solver that did the work: the one that `auto` chose, or the one that was asked for.
pub(super) fn chosen<'a>(asked: &'a str, solution: &Solution) -> &'a str {
    solution.choice.as_ref().map_or(asked, |choice| choice.solver)
}

/// Returns the line that says which solver did the work, and how well.
pub(super) fn solver_line(asked: &str, solution: &Solution, stated: Stated) -> String {
    let bound = solution
        .error_bound
        .map_or("unknown".to_owned(), |bound| format!("{bound:.1e}"));
    let with_factors = match stated {
        Stated::Relative(error) => format!(", with the form factors' own errors about {error:.1e}, the mesh's aside"),
        Stated::TooGreat => ", with the form factors' own errors unknown: they are not exact enough".to_owned(),
        Stated::Untold => String::new(),
    };
    format!(
        "{}: {} after {}, relative residual {:.1e}, bound on the relative error {bound}{with_factors}",
        chosen(asked, solution),
        solution.stop_reason,
        counted(solution.n_passes, "pass"),
        solution.residual_l2
    )
}

/// Describes a solution: how it was reached, and the mean radiosity of each surface; `stated` is the relative error that solver and form factors together state.
pub(super) fn describe(
    text: &mut String,
    prepared: &Prepared,
    (solver, mesh_error): (&str, Option<&MeshError>),
    solution: &Solution,
    stated: Stated,
) {
    if solver == NO_SOLVER {
        let _ = writeln!(
            text,
            "nothing reflects: the radiosity is the exitance, and no form factor is needed"
        );
    } else {
        let _ = writeln!(text, "{}", solver_line(solver, solution, stated));
    }
    if let Some(mesh_error) = mesh_error {
        mesh_error.describe(text);
    }
    let _ = writeln!(text, "\nmean radiosity by surface, W/m²");
    let surfaces = prepared.surface_means(&solution.radiosity);
    let names: Vec<String> = prepared.scene.surfaces.iter().map(|s| printable(&s.name)).collect();
    let width = name_width(names.iter().map(String::as_str));
    for (name, mean) in names.iter().zip(&surfaces) {
        let _ = write!(text, "{name:width$}");
        for value in mean {
            let _ = write!(text, " {}", cell(*value));
        }
        let _ = writeln!(text);
    }
    let _ = writeln!(text);
}
