//! `radiosity solve --on-the-fly`: form factors that are computed again in every pass.

use super::args::SolveArgs;
use super::failure::Failure;
use super::form_factors::DEFAULT_RAYS;
use super::pipeline::{Fineness, Prepared, Run};
use crate::audit::Given;
use crate::form_factor::registry::METHODS;
use crate::form_factor::{ExactMethod, Input, OnTheFly};
use crate::solver::Solution;

pub(super) fn solve(run: &mut Run, prepared: &mut Prepared, args: &SolveArgs) -> Result<Solution, Failure> {
    if run.solver_entry(&args.solver)?.needs_reciprocity {
        return Err(Failure::usage(format!(
            "`{}` needs form factors that are balanced, and so stored: leave --on-the-fly out, or take `gmres`",
            args.solver.solver
        )));
    }
    let fineness = Fineness {
        default_rays: DEFAULT_RAYS,
        tolerance: args.form_factor_tolerance,
        default_tolerance: ExactMethod::DEFAULT_TOLERANCE,
        tolerance_name: "form_factor_tolerance",
    };
    let method = run.method(&args.method, fineness)?.method;
    run.set("on_the_fly", true);
    let input = Input {
        scene: &prepared.scene,
        unoccluded: prepared.plan.convex_and_empty,
        mesh: &prepared.mesh,
        visibility: &prepared.visibility,
    };
    let Some(operator) = OnTheFly::new(&*method, input) else {
        return Err(Failure::usage(format!(
            "`{}` computes pairs of patches, not rows: leave --on-the-fly out, or take one of {}",
            args.method.method,
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
    run.solve_system(
        (&mut prepared.plan, &prepared.mesh),
        (&operator, areas),
        &args.solver,
        (reflectance, exitance),
        Given {
            gain: None,
            costly: true,
        },
    )
}
