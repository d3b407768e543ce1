//! `--on-the-fly`: form factors that are computed again in every pass.

use super::args::{MethodArgs, PrecisionName, SolverArgs, StorageName};
use super::failure::Failure;
use super::pipeline::{Fineness, Known, Prepared, Run};
use super::render::indirect_irradiance;
use crate::audit::Given;
use crate::form_factor::registry::METHODS;
use crate::form_factor::{Input, OnTheFly};
use crate::matrix::operator::Block;
use crate::solver::Solution;

/// What is to be computed.
pub(super) struct Request<'a> {
    pub(super) method: &'a MethodArgs,
    pub(super) fineness: Fineness,
    pub(super) solver: &'a SolverArgs,
    /// Whether the irradiance without what comes straight from the emitters is wanted too, at one more pass.
    pub(super) indirect: bool,
}

/// Solves a scene; returns the indirect irradiance too where that is wanted.
pub(super) fn solve(
    run: &mut Run,
    prepared: &mut Prepared,
    request: &Request,
) -> Result<(Solution, Option<Block>), Failure> {
    if run.solver_entry(request.solver)?.needs_reciprocity {
        return Err(Failure::usage(format!(
            "`{}` needs form factors that are balanced, and so stored: leave --on-the-fly out, or take `gmres`",
            request.solver.solver
        )));
    }
    let kept = &run.storage.args.memory;
    if kept.storage != StorageName::Auto || kept.precision != PrecisionName::Auto {
        return Err(Failure::usage(
            "--storage and --precision are for form factors that are stored: leave them out, or --on-the-fly",
        ));
    }
    if request.method.time_limit.is_some() {
        return Err(Failure::usage(
            "--time-limit chooses how form factors are stored and computed: leave it out, or --on-the-fly",
        ));
    }
    let method = run.method(request.method, request.fineness)?.method;
    run.set("on_the_fly", true);
    // There are no tallies: every pass counts its own rays.
    let closed_rows = run.enclosed(prepared, &[], request.method.closure.closure())?.rows;
    let input = Input {
        scene: &prepared.scene,
        unoccluded: prepared.plan.convex_and_empty,
        mesh: &prepared.mesh,
        visibility: &prepared.visibility,
    };
    let Some(operator) = OnTheFly::new(&*method, input) else {
        return Err(Failure::usage(format!(
            "`{}` computes pairs of patches, not rows: leave --on-the-fly out, or take one of {}",
            request.method.method,
            METHODS
                .iter()
                .filter(|m| m.by_rows())
                .map(|m| m.name)
                .collect::<Vec<_>>()
                .join(", ")
        )));
    };
    prepared
        .plan
        .left_out
        .push("storing form factors: every pass computes them again".into());
    let (reflectance, exitance) = prepared.materials();
    let areas = prepared.mesh.areas();
    let solution = run.solve_system(
        (&mut prepared.plan, &prepared.mesh),
        (&operator, areas),
        request.solver,
        (reflectance, exitance.clone()),
        Known {
            given: Given {
                gain: None,
                costly: true,
            },
            backs: None,
            closed_rows: Some(&closed_rows),
        },
    )?;
    run.warn("form factors that are not kept state no error: how far theirs shows in the light is not known; leave --on-the-fly out to know it");
    let indirect = request.indirect.then(|| {
        run.times
            .time("solve", || indirect_irradiance(&operator, &exitance, &solution))
    });
    Ok((solution, indirect))
}
