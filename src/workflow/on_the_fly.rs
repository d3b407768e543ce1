//! Light by form factors that are recomputed in every pass.

use super::solve::{Parts, solve_system};
use super::{
    Context, DirectDaylight, FormFactorRequest, Known, Model, SolutionStudy, SolveRequest, Storage, TotalError,
    Unsuited, Warning, WorkflowError,
};
use crate::audit::Given;
use crate::form_factor::registry::METHODS;
use crate::form_factor::{Input, OnTheFly};
use crate::matrix::operator::{Block, LinearOperator};
use crate::solver::{SharedPasses, Solution};

impl Model {
    /// Solves without storing form factors; with `indirect`, one more pass returns F (B − E), the irradiance without direct light from the emitters.
    ///
    /// # Errors
    /// [`Unsuited`] for a solver that needs balanced form factors and for a method of pairs, and those of [`solve_system`](Self::solve_system).
    pub fn solve_on_the_fly(
        &mut self,
        request: &FormFactorRequest,
        solve: &SolveRequest,
        indirect: bool,
        cx: &mut Context,
    ) -> Result<(SolutionStudy, Option<Block>), WorkflowError> {
        let (solution, indirect) = self.unstored(request, solve, indirect, cx)?;
        let study = SolutionStudy {
            error: TotalError::of(self, None, &solution, cx),
            solution,
            carried: None,
            mesh_error: None,
            direct: DirectDaylight::default(),
        };
        Ok((study, indirect))
    }

    fn unstored(
        &mut self,
        request: &FormFactorRequest,
        solve: &SolveRequest,
        indirect: bool,
        cx: &mut Context,
    ) -> Result<(Solution, Option<Block>), WorkflowError> {
        let entry = solve.entry(cx)?;
        let unsuited = |unsuited| Err(WorkflowError::Unsuited(unsuited));
        if entry.needs_reciprocity() {
            return unsuited(Unsuited::UnstoredReciprocity { solver: entry.name });
        }
        if cx.memory.storage != Storage::Auto || cx.memory.precision.is_some() {
            return unsuited(Unsuited::UnstoredStorage);
        }
        if request.time_limit.is_some() {
            return unsuited(Unsuited::UnstoredTimeLimit);
        }
        let method = request.chosen(cx)?.method;
        cx.settings.on_the_fly = Some(true);
        // Without a checkpoint, no other key compares the ranks.
        let key = format!("{} {:?}", self.mesh.geometry_hash(), cx.settings.record());
        cx.expect_same("mesh or settings", key.as_bytes())?;
        // There are no tallies, as every pass counts its own rays.
        let closed_rows = self.enclosed(&[], request.closure, cx)?.rows;
        let (reflectance, exitance) = self.materials();
        let Self {
            scene,
            file,
            plan,
            mesh,
            visibility,
            ..
        } = self;
        let input = Input {
            unoccluded: plan.convex_and_empty,
            scene,
            mesh,
            visibility,
        };
        let Some(operator) = OnTheFly::new(&*method, input) else {
            let by_rows = METHODS.iter().filter(|m| m.by_rows());
            return unsuited(Unsuited::UnstoredPairs {
                method: request.method.clone(),
                others: by_rows.map(|m| m.name).collect::<Vec<_>>().join(", "),
            });
        };
        plan.left_out
            .push("storing form factors: every pass computes them again".into());
        let known = Known {
            given: Given {
                gain: None,
                costly: true,
            },
            backs: None,
            closed_rows: Some(&closed_rows),
            signed: false,
            aim: None,
        };
        let parts = Parts {
            scene,
            file,
            mesh,
            plan,
        };
        let solution = solve_system(parts, &operator, solve, (&reflectance, &exitance), known, cx)?;
        cx.warn(Warning::NoErrorOnTheFly);
        let shared = SharedPasses::new(&operator, &*cx.ranks);
        let indirect = indirect.then(|| cx.time("solve", || indirect_irradiance(&shared, &exitance, &solution)));
        Ok((solution, indirect))
    }
}

/// Returns F (B − E), the irradiance without direct light from the emitters, W·m⁻², \[n, c\].
#[must_use]
pub fn indirect_irradiance(factors: &dyn LinearOperator, exitance: &Block, solution: &Solution) -> Block {
    let reflected = solution.reflected(exitance);
    let mut irradiance = Block::zeros(reflected.n_rows(), reflected.n_channels());
    factors.apply(&reflected, &mut irradiance);
    irradiance
}
