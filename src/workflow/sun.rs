//! Light of the sun on the patches of a scene.

use super::{Context, FormFactorStudy, Model, SolutionStudy, SolveRequest, WorkflowError};
use crate::heat::{Sun, Sunlit};
use crate::matrix::operator::{Block, LinearOperator};

/// The sun as channels see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunRequest {
    /// Its direction and size.
    pub sun: Sun,
    /// The irradiance of a plane that faces it, W·m⁻², in three channels.
    pub irradiance: [f64; 3],
}

impl SunRequest {
    /// Tells whether all channels are the same.
    #[must_use]
    pub fn is_grey(&self) -> bool {
        self.irradiance
            .iter()
            .all(|value| value.to_bits() == self.irradiance[0].to_bits())
    }
}

impl Model {
    /// Solves for the light of the scene's own materials in sunlight, and states its error.
    ///
    /// B = E + ρ (D + F B), with D straight from the sun. The irradiance of the solution includes D; its energy counts ρ D as emitted.
    ///
    /// # Errors
    /// As [`solve_system`](Self::solve_system).
    pub fn solve_in_sun(
        &mut self,
        study: &FormFactorStudy,
        request: &SolveRequest,
        sun: &SunRequest,
        cx: &mut Context,
    ) -> Result<SolutionStudy, WorkflowError> {
        if !sun.is_grey() {
            self.plan.revise_channels(sun.irradiance.len());
            self.plan.n_channels = sun.irradiance.len();
            self.plan
                .revise("channels", sun.irradiance.len().to_string(), "the sun has a colour");
        }
        let (reflectance, exitance) = self.materials();
        let strengths = &sun.irradiance[..reflectance.n_channels()];
        let sunlit = cx.time("sun", || Sunlit::new(self.input(), &sun.sun, strengths));
        let reflected = |light: &Block| {
            let products = reflectance.values().iter().zip(light.values()).map(|(rho, d)| rho * d);
            Block::from_values(products.collect(), reflectance.n_channels())
        };
        let (mut lit, error) = (reflected(&sunlit.irradiance), reflected(&sunlit.error));
        lit.values_mut()
            .iter_mut()
            .zip(exitance.values())
            .for_each(|(d, e)| *d += e);
        let system = (&study.factors as &dyn LinearOperator, study.factors.areas().to_vec());
        let materials = (reflectance.clone(), lit.clone());
        let solution = self.solve_system(system, request, materials, study.known(), cx)?;
        let mut found = self.judged_with(study, (&reflectance, &lit), Some(&error), solution, cx)?;
        let irradiance = found.solution.irradiance.values_mut().iter_mut();
        irradiance.zip(sunlit.irradiance.values()).for_each(|(h, d)| *h += d);
        found.sunlit = Some(sunlit);
        Ok(found)
    }
}
