//! What documents and people are told of a solution, and the exit code that it deserves.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::exit_code::ExitCode;
use super::surfaces::surfaces_with_radiosity;
use super::{cell, merge, name_width};
use crate::printable::{counted, printable};
use crate::solver::{Solution, StopReason};
use crate::workflow::{FormFactorStudy, MeshError, Model, TotalError};

/// What stands in the place of a solver's name where none was needed.
pub(super) const NO_SOLVER: &str = "none";

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
