//! Solves for the light of an image, as far as the image needs it.

use super::{Context, Daylight, FormFactorRequest, FormFactorStudy, Model, SolutionStudy, SolveRequest, WorkflowError};
use crate::matrix::operator::Block;
use crate::render::{DirectMethod, Outdoors, RenderInput};

/// The name in place of a solver's where nothing reflects.
pub const NO_SOLVER: &str = "none";

/// The light that an image is made from.
#[derive(Debug)]
pub struct ImageLight {
    /// The name of the requested solver, or [`NO_SOLVER`].
    pub solver: String,
    /// The solution.
    pub study: SolutionStudy,
    /// The form factors, if they are stored.
    pub factors: Option<FormFactorStudy>,
    /// F (B − E), and the direct light of the sky, W·m⁻², \[n, c\], if a direct pass adds the rest.
    pub indirect_irradiance: Option<Block>,
    /// Sun and sky.
    pub outdoors: Outdoors,
}

impl ImageLight {
    /// Returns the input of a renderer.
    #[must_use]
    pub fn input<'a>(&'a self, model: &'a Model) -> RenderInput<'a> {
        RenderInput {
            scene: &model.scene,
            mesh: &model.mesh,
            visibility: &model.visibility,
            radiosity: &self.study.solution.radiosity,
            irradiance: &self.study.solution.irradiance,
            indirect_irradiance: self.indirect_irradiance.as_ref(),
            error: self.study.carried.as_ref(),
            outdoors: self.outdoors,
        }
    }
}

impl Model {
    /// Solves for the light of an image with a `direct` pass, in `daylight`.
    ///
    /// Nothing is solved if that pass finds all light. `on_the_fly` stores no form factors and accepts no daylight.
    ///
    /// # Errors
    /// Those of [`form_factors`](Self::form_factors), [`solve`](Self::solve) and [`solve_on_the_fly`](Self::solve_on_the_fly).
    pub fn light_for_image(
        &mut self,
        (method, solver): (&FormFactorRequest, &SolveRequest),
        (direct, daylight): (DirectMethod, &Daylight),
        on_the_fly: bool,
        cx: &mut Context,
    ) -> Result<ImageLight, WorkflowError> {
        let with_direct = direct != DirectMethod::Off;
        if with_direct {
            self.warn_of_narrow_gaps(cx);
        }
        let light = if with_direct && !daylight.shines() && !self.scene.is_reflecting() {
            let (study, dark) = self.without_reflection(cx);
            ImageLight {
                solver: NO_SOLVER.to_owned(),
                study,
                factors: None,
                indirect_irradiance: Some(dark),
                outdoors: Outdoors::default(),
            }
        } else if on_the_fly && !daylight.shines() {
            let (study, indirect_irradiance) = self.solve_on_the_fly(method, solver, with_direct, cx)?;
            let reason = "the error layer: it is carried from stored form factors";
            self.plan.left_out.push(reason.into());
            ImageLight {
                solver: solver.solver.clone(),
                study,
                factors: None,
                indirect_irradiance,
                outdoors: Outdoors::default(),
            }
        } else {
            self.stored_light((method, solver), (with_direct, daylight), cx)?
        };
        if !with_direct {
            let reason = "direct light at each pixel: the patches' light is interpolated";
            self.plan.left_out.push(reason.into());
        }
        Ok(light)
    }

    fn stored_light(
        &mut self,
        (method, solver): (&FormFactorRequest, &SolveRequest),
        (with_direct, daylight): (bool, &Daylight),
        cx: &mut Context,
    ) -> Result<ImageLight, WorkflowError> {
        let need = solver.need(cx)?;
        let (factors, study);
        if daylight.shines() {
            factors = self.form_factors(method, need, cx)?;
            study = self.solve_in_daylight(&factors, solver, daylight, cx)?;
        } else {
            factors = self.form_factors_for_light(method, need, cx)?;
            study = self.solve(&factors, solver, cx)?;
        }
        let indirect_irradiance = with_direct.then(|| {
            cx.time("solve", || {
                let (_, exitance) = self.materials();
                study
                    .direct
                    .indirect_irradiance(&factors.factors, &exitance, &study.solution)
            })
        });
        factors.factors.if_readable(())?;
        Ok(ImageLight {
            solver: solver.solver.clone(),
            study,
            factors: Some(factors),
            indirect_irradiance,
            outdoors: daylight.outdoors(),
        })
    }
}
