//! The text that the program prints about a solution, and its exit code.

use std::fmt::Write as _;

use super::exit_code::ExitCode;
use super::{cell, printable_names};
use crate::printable::{counted, printable};
use crate::scene::Scene;
use crate::solver::{Solution, StopReason};
use crate::workflow::{FormFactorStudy, MeshError, Model, NO_SOLVER, SolutionStudy, TotalError};

/// Returns the exit code for a solution, its form factors, and its stated error.
pub(super) fn code(solution: &Solution, computed: Option<&FormFactorStudy>, stated: TotalError) -> ExitCode {
    if solution.stop_reason == StopReason::Converged && stated != TotalError::TooGreat {
        code_of(computed)
    } else {
        ExitCode::NotConverged
    }
}

/// Returns the exit code for form factors: not converged if they fall short of the request.
pub(super) fn code_of(computed: Option<&FormFactorStudy>) -> ExitCode {
    match computed {
        Some(computed) if !computed.is_done() => ExitCode::NotConverged,
        _ => ExitCode::Done,
    }
}

/// Returns the line about the solver and its accuracy.
pub(super) fn solver_line(asked: &str, solution: &Solution, stated: TotalError) -> String {
    let bound = solution
        .error_bound
        .map_or("unknown".to_owned(), |bound| format!("{bound:.1e}"));
    let with_factors = match stated {
        TotalError::Relative(error) => {
            format!(", with form-factor errors about {error:.1e} (mesh excluded)")
        }
        TotalError::TooGreat => ", with form-factor errors unknown: they are too inexact".to_owned(),
        TotalError::Untold => String::new(),
    };
    format!(
        "{}: {} after {}, relative residual {:.1e}, error bound {bound}{with_factors}",
        solution.solver_name(asked),
        solution.stop_reason,
        counted(solution.n_passes, "pass"),
        solution.residual_l2
    )
}

/// Describes a solution by the requested `solver`: its accuracy, and the mean radiosity of each surface.
pub(super) fn describe(text: &mut String, model: &Model, solver: &str, study: &SolutionStudy) {
    let solution = &study.solution;
    if solver == NO_SOLVER {
        let _ = writeln!(
            text,
            "no surface reflects: the radiosity is the exitance, and no form factor is needed"
        );
    } else {
        let _ = writeln!(text, "{}", solver_line(solver, solution, study.error));
    }
    if let Some(mesh_error) = &study.mesh_error {
        describe_mesh_error(text, mesh_error);
    }
    describe_means(text, &model.scene, &model.surface_means(&solution.radiosity));
    let _ = writeln!(text);
}

/// Adds the mean radiosities of the first surfaces.
pub(super) fn describe_means(text: &mut String, scene: &Scene, means: &[Vec<f64>]) {
    let _ = writeln!(text, "\nmean radiosity by surface, W/m²");
    let (names, width) = printable_names(scene.surfaces.iter().map(|surface| surface.name.as_str()));
    for (name, mean) in names.iter().zip(means) {
        let _ = write!(text, "{name:width$}");
        for value in mean {
            let _ = write!(text, " {}", cell(*value));
        }
        let _ = writeln!(text);
    }
}

/// Adds the line about the change by a coarser mesh.
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
        "mesh: with {n_patches} patches, surface means would change by up to {surface_mean_max:.1e} of themselves (`{surface}`), \
         patches by {patches_rms:.1e} of the reflected radiosity (rms)"
    );
}
