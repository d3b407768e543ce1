//! `radiosity solve`.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::args::{MeshArgs, SolveArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::form_factors::{checks_to_json, describe_checks};
use super::lightings::{Lightings, with_suffix};
use super::run::Run;
use super::surfaces::surfaces_with_radiosity;
use super::{Outcome, cell, lightings, merge, name_width};
use crate::mesh::Subdivision;
use crate::printable::{counted, printable};
use crate::report::form_factors::{FormFactorFile, files_of};
use crate::report::solution::{Format, SolutionReport};
use crate::solver::{Solution, StopReason};
use crate::workflow::{self, Afterwards, Demand, FormFactorStudy, MeshError, Model, SolutionStudy, TotalError};

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
    let mesh_args = file.as_ref().map_or(Ok(args.mesh), |file| mesh_args(file, args.mesh))?;
    let demand = Demand {
        output: args.output.clone(),
        tolerance: Some(args.solver.tolerance),
        ..Demand::default()
    };
    run.expect(&args.storage, demand);
    run.has_lightings = !args.lighting.is_empty();
    let mut model = run.prepare(&args.scene, mesh_args, |_| Subdivision::Uniform(1))?;
    // Before the work: a mistake in them is found at once, and their reflectances count in how form factors are stored.
    let loaded = Lightings::load(args, &model.scene)?;
    run.cx.demand.reflectance_max = loaded.reflectance_max();
    loaded.warn_of_darkness(run, &model, &args.lighting);
    let method = run.request(&args.method, args.form_factor_tolerance, Afterwards::Light);
    let solver = args.solver.request();
    if args.on_the_fly {
        let (study, _) = model.solve_on_the_fly(&method, &solver, false, &mut run.cx)?;
        return finish(args, run, &model, None, &study);
    }
    let need = solver.need(&run.cx)?;
    let factors = match &file {
        None => model.form_factors(&method, need, &mut run.cx)?,
        Some(file) => model.form_factors_of(file, &method, need, &mut run.cx)?,
    };
    if !args.lighting.is_empty() {
        return lightings::run(&loaded, run, model, &factors, args);
    }
    let study = model.solve(&factors, &solver, &mut run.cx)?;
    finish(args, run, &model, Some(&factors), &study)
}

/// Returns the flags of the patches that a file is for; flags that ask for others are an error.
fn mesh_args(file: &FormFactorFile, given: MeshArgs) -> Result<MeshArgs, Failure> {
    let default = given.options(Subdivision::Uniform(1));
    // A flag that is left out asks for nothing.
    let is_asked = given.subdivide.is_some() || given.max_edge.is_some();
    let asked = is_asked.then_some(default.subdivision);
    let options = workflow::mesh_options(file, asked, given.no_cut, default)?;
    let (subdivide, max_edge) = match options.subdivision {
        Subdivision::Uniform(n) => (Some(n), None),
        Subdivision::MaxEdge(length) => (None, Some(length)),
    };
    Ok(MeshArgs {
        subdivide,
        max_edge,
        no_cut: !options.cut_at_walls,
        cut_at_walls: false,
    })
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

/// Writes and describes a solution; without `computed` there are no stored form factors to tell of.
fn finish(
    args: &SolveArgs,
    run: &mut Run,
    model: &Model,
    computed: Option<&FormFactorStudy>,
    study: &SolutionStudy,
) -> Result<Outcome, Failure> {
    let (reflectance, exitance) = model.materials();
    let SolutionStudy {
        solution,
        carried,
        error,
        mesh_error,
    } = study;
    if let Some(path) = &args.output {
        let row_sums = computed.map(|computed| computed.factors.row_sums());
        let report = SolutionReport {
            scene: &model.scene,
            mesh: &model.mesh,
            reflectance: &reflectance,
            exitance: &exitance,
            solution,
            error: carried.as_ref(),
            row_sums: row_sums.as_deref(),
            settings: &run.cx.settings,
        };
        run.cx.time("write", || report.write(path))?;
    }
    let stated = *error;
    run.bars.finish();
    let mut result = to_json(model, &args.solver.solver, solution, stated);
    result["form_factors"] = computed.map_or(Value::Null, checks_to_json);
    result["mesh_error"] = json!(mesh_error);
    let document = run.document_of(model, result);
    let mut text = run.explanation(model);
    let _ = writeln!(
        text,
        "{} patches on {}",
        model.mesh.n_patches(),
        counted(model.scene.surfaces.len(), "surface")
    );
    if let Some(computed) = computed {
        describe_checks(&mut text, computed);
    }
    let solver = &args.solver.solver;
    describe(&mut text, model, (solver, mesh_error.as_ref()), solution, stated);
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
pub(super) fn code(solution: &Solution, computed: Option<&FormFactorStudy>, stated: TotalError) -> ExitCode {
    if solution.stop_reason == StopReason::Converged && stated != TotalError::TooGreat {
        code_of(computed)
    } else {
        ExitCode::NotConverged
    }
}

/// Returns the exit code that form factors deserve: that of work which falls short of what was asked for.
pub(super) fn code_of(computed: Option<&FormFactorStudy>) -> ExitCode {
    match computed {
        Some(computed) if !computed.is_done() => ExitCode::NotConverged,
        _ => ExitCode::Done,
    }
}

/// Returns what documents say about a solution; `stated` is the relative error that solver and form factors together state.
pub(super) fn to_json(model: &Model, solver: &str, solution: &Solution, stated: TotalError) -> Value {
    let selections = &solution.selections;
    let mut document = json!({
        "n_steps": (!selections.is_empty()).then(|| selections.iter().sum::<u64>()),
        "n_patches": model.mesh.n_patches(),
        "n_channels": solution.radiosity.n_channels(),
        "solver": chosen(solver, solution),
        "why": solution.choice.as_ref().map(|choice| &choice.why),
        "n_passes": solution.n_passes,
        "setup_work": solution.setup_work,
        "setup_s": solution.setup_s,
        "history": solution.history,
        "energy": solution.energy,
        "surfaces": surfaces_with_radiosity(model, solution),
    });
    merge(&mut document, quality_to_json(solution, stated));
    document
}

/// Returns how good a solution is: what stands beside each that documents tell of.
pub(super) fn quality_to_json(solution: &Solution, stated: TotalError) -> Value {
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
pub(super) fn solver_line(asked: &str, solution: &Solution, stated: TotalError) -> String {
    let bound = solution
        .error_bound
        .map_or("unknown".to_owned(), |bound| format!("{bound:.1e}"));
    let with_factors = match stated {
        TotalError::Relative(error) => {
            format!(", with the form factors' own errors about {error:.1e}, the mesh's aside")
        }
        TotalError::TooGreat => ", with the form factors' own errors unknown: they are not exact enough".to_owned(),
        TotalError::Untold => String::new(),
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
    model: &Model,
    (solver, mesh_error): (&str, Option<&MeshError>),
    solution: &Solution,
    stated: TotalError,
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
        describe_mesh_error(text, mesh_error);
    }
    let _ = writeln!(text, "\nmean radiosity by surface, W/m²");
    let surfaces = model.surface_means(&solution.radiosity);
    let names: Vec<String> = model.scene.surfaces.iter().map(|s| printable(&s.name)).collect();
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

/// Adds the line that tells what a coarser mesh would change.
pub(super) fn describe_mesh_error(text: &mut String, mesh_error: &MeshError) {
    let MeshError {
        n_patches,
        surface_mean_max,
        surface,
        patches_rms,
    } = mesh_error;
    let surface = printable(surface);
    let _ = writeln!(
        text,
        "mesh: {n_patches} patches instead would change the mean radiosity of a surface by up to {surface_mean_max:.1e} of itself (`{surface}`), \
         that of a patch by {patches_rms:.1e} of what is reflected (root mean square)"
    );
}
