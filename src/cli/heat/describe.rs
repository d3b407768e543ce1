//! The text that the program prints about heat.

use std::fmt::Write as _;

use crate::cli::args::HeatArgs;
use crate::cli::run::Run;
use crate::cli::solution::{describe_mesh_error, solver_line};
use crate::cli::{cell, printable_names};
use crate::printable::counted;
use crate::workflow::{FormFactorStudy, HeatStudy, Model};

/// Describes temperatures and fluxes of surfaces, and the balance of the scene.
pub(super) fn describe(
    text: &mut String,
    run: &Run,
    args: &HeatArgs,
    model: &Model,
    factors: &FormFactorStudy,
    study: &HeatStudy,
) {
    let surfaces = &study.heat.surfaces;
    let n_surfaces = counted(surfaces.len(), "surface");
    let _ = writeln!(text, "{} patches on {n_surfaces}", model.mesh.n_patches());
    run.describe_form_factors(text, factors);
    let _ = writeln!(
        text,
        "{}",
        solver_line(&args.solver.solver, &study.thermal, study.error)
    );
    if let Some(mesh_error) = &study.mesh_error {
        describe_mesh_error(text, mesh_error);
    }
    let (names, width) = printable_names(surfaces.iter().map(|surface| surface.name.as_str()));
    let _ = writeln!(
        text,
        "\n{:width$} {:>12} {:>12} {:>12} {:>12} {:>12} {:>8}",
        "surface", "T, K", "error", "net, W/m²", "error", "net, W", "sunlit"
    );
    for (name, own) in names.iter().zip(surfaces) {
        let numbers = [
            own.temperature_k,
            own.temperature_k_error,
            own.net_flux_w_m2,
            own.net_flux_w_m2_error,
            own.net_heat_w,
        ];
        let lit = own
            .sunlit_fraction
            .map_or_else(|| "-".to_owned(), |lit| format!("{lit:.4}"));
        let _ = writeln!(text, "{name:width$} {} {lit:>8}", numbers.map(cell).join(" "));
    }
    let balance = &study.heat.balance;
    let _ = writeln!(
        text,
        "\nsupplied {:.6e} W, sun {:.6e} W, sky {:.6e} W, from surroundings {:.6e} W, escaped {:.6e} W, absorbed by backs {:.6e} W; balance {:.1e} +- {:.1e} W",
        balance.supplied_w,
        balance.sun_w,
        balance.sky_w,
        balance.from_surroundings_w,
        balance.escaped_w,
        balance.absorbed_by_backs_w,
        balance.energy_balance_w,
        balance.energy_balance_w_error
    );
}
