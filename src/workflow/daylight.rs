//! Light of sun and sky on the patches of a scene.

use super::{Context, FormFactorStudy, Model, SolutionStudy, SolveRequest, WorkflowError};
use crate::form_factor::Fraction;
use crate::heat::{Sky, Sun, Sunlit, above_horizon};
use crate::matrix::operator::{Block, LinearOperator};
use crate::render::{DistantSky, DistantSun, Outdoors};
use crate::solver::Solution;

/// The sun with an irradiance for each channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunRequest {
    /// Its direction and size.
    pub sun: Sun,
    /// The irradiance of a plane that faces it, W·m⁻², in three channels.
    pub irradiance: [f64; 3],
}

/// A uniform sky with an irradiance for each channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyRequest {
    /// Its direction.
    pub sky: Sky,
    /// The irradiance of an unoccluded plane that faces up, W·m⁻², in three channels.
    pub irradiance: [f64; 3],
}

/// Sun and sky, as far as they shine.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Daylight {
    /// The sun.
    pub sun: Option<SunRequest>,
    /// The sky.
    pub sky: Option<SkyRequest>,
}

/// The light that comes straight from sun and sky.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DirectDaylight {
    /// The sunlight, where the sun shines.
    pub sun: Option<Sunlit>,
    /// The irradiance straight from the sky and its error, W·m⁻², \[n, c\], where it shines.
    pub sky: Option<[Block; 2]>,
}

/// Returns whether all channels are the same.
#[must_use]
pub fn is_grey(channels: [f64; 3]) -> bool {
    channels.iter().all(|value| value.to_bits() == channels[0].to_bits())
}

impl Daylight {
    /// Returns whether sun or sky shine.
    #[must_use]
    pub fn shines(&self) -> bool {
        self.sun.is_some() || self.sky.is_some()
    }

    /// Returns whether sun and sky are the same in all channels.
    #[must_use]
    pub fn is_grey(&self) -> bool {
        self.sun.is_none_or(|sun| is_grey(sun.irradiance)) && self.sky.is_none_or(|sky| is_grey(sky.irradiance))
    }
}

impl Daylight {
    /// Returns sun and sky for a renderer.
    #[must_use]
    pub fn outdoors(&self) -> Outdoors {
        Outdoors {
            sun: self.sun.map(|request| DistantSun {
                direction: request.sun.direction(),
                sine: request.sun.angular_radius_deg().to_radians().sin(),
                irradiance: request.irradiance,
            }),
            sky: self.sky.map(|request| DistantSky {
                up: request.sky.up(),
                radiosity: request.irradiance,
            }),
        }
    }
}

impl DirectDaylight {
    /// Returns the irradiances of sun and sky with their errors.
    fn parts(&self) -> impl Iterator<Item = [&Block; 2]> {
        let sun = self.sun.as_ref().map(|sunlit| [&sunlit.irradiance, &sunlit.error]);
        let sky = self.sky.as_ref().map(|[irradiance, error]| [irradiance, error]);
        sun.into_iter().chain(sky)
    }
}

impl DirectDaylight {
    /// Returns E + ρ D, the exitance before interreflection, and its error, W·m⁻², \[n, c\].
    pub(super) fn lit(&self, reflectance: &Block, exitance: &Block) -> (Block, Block) {
        let (mut lit, mut error) = (exitance.clone(), Block::zeros(exitance.n_rows(), exitance.n_channels()));
        for [irradiance, own_error] in self.parts() {
            add(&mut lit, irradiance, Some(reflectance));
            add(&mut error, own_error, Some(reflectance));
        }
        (lit, error)
    }

    /// Returns the light of the first `n` channels.
    pub(super) fn of_channels(&self, n: usize) -> Self {
        Self {
            sun: self.sun.as_ref().map(|sun| Sunlit {
                light: sun.light.clone(),
                irradiance: sun.irradiance.channels(0..n),
                error: sun.error.channels(0..n),
            }),
            sky: self
                .sky
                .as_ref()
                .map(|sky| sky.each_ref().map(|block| block.channels(0..n))),
        }
    }

    /// Adds the direct light of sun and sky to an irradiance.
    pub(super) fn add_to(&self, irradiance: &mut Block) {
        for [own, _] in self.parts() {
            add(irradiance, own, None);
        }
    }

    /// Returns the irradiance without direct light from emitters and the sun: F (B − E) and that of the sky, W·m⁻², \[n, c\]; `exitance`: E.
    #[must_use]
    pub fn indirect_irradiance(&self, factors: &dyn LinearOperator, exitance: &Block, solution: &Solution) -> Block {
        let mut indirect = super::indirect_irradiance(factors, exitance, solution);
        if let Some([irradiance, _]) = &self.sky {
            add(&mut indirect, irradiance, None);
        }
        indirect
    }
}

impl SolutionStudy {
    /// Adds the direct light of sun and sky to the irradiance.
    pub(super) fn shine(&mut self, direct: DirectDaylight) {
        direct.add_to(&mut self.solution.irradiance);
        self.direct = direct;
    }
}

/// Adds a block to another, times a `factor` if there is one.
fn add(to: &mut Block, light: &Block, factor: Option<&Block>) {
    for (k, (sum, value)) in to.values_mut().iter_mut().zip(light.values()).enumerate() {
        *sum += factor.map_or(*value, |factor| factor.values()[k] * value);
    }
}

impl Model {
    /// Solves for the light of the scene's own materials in daylight, and estimates its error.
    ///
    /// B = E + ρ (D + F B), with D straight from sun and sky. The irradiance of the solution includes D; its energy counts ρ D as emitted.
    ///
    /// # Errors
    /// As [`solve_system`](Self::solve_system).
    pub fn solve_in_daylight(
        &mut self,
        study: &FormFactorStudy,
        request: &SolveRequest,
        daylight: &Daylight,
        cx: &mut Context,
    ) -> Result<SolutionStudy, WorkflowError> {
        self.see_colours(daylight);
        let (reflectance, exitance) = self.materials();
        let direct = self.direct_daylight(study, daylight, self.plan.n_channels, cx);
        let (lit, error) = direct.lit(&reflectance, &exitance);
        let materials = (&reflectance, &lit);
        let solution = self.solve_system(&study.factors, request, materials, study.known(), cx)?;
        let mut found = self.judged(study, materials, Some(&error), solution, cx)?;
        found.shine(direct);
        Ok(found)
    }

    /// Switches to three channels if daylight has a colour.
    pub(super) fn see_colours(&mut self, daylight: &Daylight) {
        if !daylight.is_grey() {
            self.plan.revise_channels(3);
            self.plan.n_channels = 3;
            self.plan.revise("channels", "3", "sun or sky have a colour");
        }
    }

    /// Computes the direct light of sun and sky.
    pub(super) fn direct_daylight(
        &self,
        study: &FormFactorStudy,
        daylight: &Daylight,
        n_channels: usize,
        cx: &Context,
    ) -> DirectDaylight {
        let sun = daylight.sun.map(|sun| {
            let strengths = &sun.irradiance[..n_channels];
            cx.time("sun", || Sunlit::new(self.input(), &sun.sun, strengths))
        });
        let sky = daylight.sky.map(|request| {
            let above = self.above_horizon(study, &request.sky, cx);
            let strengths = &request.irradiance[..n_channels];
            let block = |of: fn(&Fraction) -> f64| {
                let values = above.iter().flat_map(|own| strengths.iter().map(move |s| s * of(own)));
                Block::from_values(values.collect(), n_channels)
            };
            [block(|own| own.value), block(|own| own.error())]
        });
        DirectDaylight { sun, sky }
    }

    /// Returns the fraction of the light of each patch that escapes above the horizon of a sky, \[n\].
    pub(super) fn above_horizon(&self, study: &FormFactorStudy, sky: &Sky, cx: &Context) -> Vec<Fraction> {
        let row_sums = study.factors.row_sums();
        let sees_nothing = |i: usize| {
            let back = study.sky.back[i];
            row_sums[i] <= 0.0 && back.value + back.error() <= 0.0
        };
        let sees_nothing: Vec<bool> = (0..self.mesh.n_patches()).map(sees_nothing).collect();
        cx.time("sky", || {
            above_horizon(self.input(), sky, &study.sky.sky, &sees_nothing)
        })
    }
}
