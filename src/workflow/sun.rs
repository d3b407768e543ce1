//! Light of sun and sky on the patches of a scene.

use super::{Context, FormFactorStudy, Model, SolutionStudy, SolveRequest, WorkflowError};
use crate::heat::{Sky, Sun, Sunlit};
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
    /// # Errors
    /// As [`solve_outdoors`](Self::solve_outdoors).
    pub fn solve_in_sun(
        &mut self,
        study: &FormFactorStudy,
        request: &SolveRequest,
        sun: &SunRequest,
        cx: &mut Context,
    ) -> Result<SolutionStudy, WorkflowError> {
        self.solve_outdoors(study, request, (Some(sun), None), cx)
    }

    /// Solves for the light of the scene's own materials under sun and sky, and states its error.
    ///
    /// B = E + ρ (D + F B), with D straight from sun and sky. The irradiance of the solution includes D; its energy counts ρ D as emitted.
    ///
    /// # Errors
    /// As [`solve_system`](Self::solve_system).
    pub fn solve_outdoors(
        &mut self,
        study: &FormFactorStudy,
        request: &SolveRequest,
        (sun, sky): (Option<&SunRequest>, Option<&Sky>),
        cx: &mut Context,
    ) -> Result<SolutionStudy, WorkflowError> {
        if let Some(coloured) = sun.filter(|sun| !sun.is_grey()) {
            let n_channels = coloured.irradiance.len();
            self.plan.revise_channels(n_channels);
            self.plan.n_channels = n_channels;
            self.plan
                .revise("channels", n_channels.to_string(), "the sun has a colour");
        }
        let (reflectance, exitance) = self.materials();
        let n_channels = reflectance.n_channels();
        let sunlit = sun.map(|sun| {
            let strengths = &sun.irradiance[..n_channels];
            cx.time("sun", || Sunlit::new(self.input(), &sun.sun, strengths))
        });
        let from_sky = sky.map(|sky| self.sky_light(&study.enclosure(), sky, cx));
        let straight = |of_sun: fn(&Sunlit) -> &Block, of_sky: usize| {
            let mut sum = Block::zeros(reflectance.n_rows(), n_channels);
            if let Some(sunlit) = &sunlit {
                sum.values_mut().copy_from_slice(of_sun(sunlit).values());
            }
            for (i, light) in from_sky.iter().flat_map(|both| both[of_sky].iter().enumerate()) {
                for value in sum.row_mut(i) {
                    *value += light;
                }
            }
            sum
        };
        let (direct, direct_error) = (straight(|lit| &lit.irradiance, 0), straight(|lit| &lit.error, 1));
        let reflected = |light: &Block| {
            let products = reflectance.values().iter().zip(light.values()).map(|(rho, d)| rho * d);
            Block::from_values(products.collect(), n_channels)
        };
        let (mut lit, error) = (reflected(&direct), reflected(&direct_error));
        lit.values_mut()
            .iter_mut()
            .zip(exitance.values())
            .for_each(|(d, e)| *d += e);
        let system = (&study.factors as &dyn LinearOperator, study.factors.areas().to_vec());
        let materials = (reflectance.clone(), lit.clone());
        let solution = self.solve_system(system, request, materials, study.known(), cx)?;
        let mut found = self.judged_with(study, (&reflectance, &lit), Some(&error), solution, cx)?;
        let irradiance = found.solution.irradiance.values_mut().iter_mut();
        irradiance.zip(direct.values()).for_each(|(h, d)| *h += d);
        found.sunlit = sunlit;
        Ok(found)
    }
}
