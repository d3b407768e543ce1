//! The light of a scene along a path of the sun.

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::sun_path::{BlockSink, PathStudy, PathWork, SolvedBlock, hash_block};
use super::{
    Context, Daylight, DirectDaylight, FormFactorStudy, LitSurface, MeshError, Model, Quality, SkyRequest,
    SolutionStudy, SolveRequest, TotalError, WorkflowError,
};
use crate::heat::{SunOccluders, SunPath, SunStep, Sunlit};
use crate::matrix::operator::Block;
use crate::report::series::{SeriesBlock, SeriesQuantity};
use crate::report::sky::sky_columns;
use crate::solver::Energy;

/// The light of a scene at one time.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LightStep {
    /// The power balance of each channel.
    pub energy: Vec<Energy>,
    /// The surfaces, in file order.
    pub surfaces: Vec<LitSurface>,
    /// The change by a mesh of about a quarter of the patches; null where that is not known.
    pub mesh_error: Option<MeshError>,
    /// How good the solution is.
    #[serde(flatten)]
    pub quality: Quality,
}

/// The light of the scene's materials, with a moving sun and a fixed sky.
struct LightWork<'a> {
    study: &'a FormFactorStudy,
    request: &'a SolveRequest,
    /// The irradiance straight from the sky and its error.
    sky: Option<[Block; 2]>,
}

impl Model {
    /// Solves for the light of the scene's own materials at every time of a path of the sun, and estimates its errors; `sink` receives the values of the patches.
    ///
    /// Each time is solved as by [`solve_in_daylight`](Self::solve_in_daylight), many times in the same passes over the form factors. Blocks in the checkpoint are not solved again.
    ///
    /// # Errors
    /// As [`solve_system`](Self::solve_system), and those of `sink`.
    pub fn solve_along_sun_path(
        &mut self,
        study: &FormFactorStudy,
        (path, sky): (&SunPath, Option<SkyRequest>),
        request: &SolveRequest,
        sink: Option<BlockSink<'_>>,
        cx: &mut Context,
    ) -> Result<PathStudy<LightStep>, WorkflowError> {
        let daylight = Daylight { sun: None, sky };
        self.see_colours(&daylight);
        let work = LightWork {
            study,
            request,
            sky: self.direct_daylight(study, &daylight, self.plan.n_channels, cx).sky,
        };
        self.along(study, path, (&work, request), sink, cx)
    }
}

impl PathWork for LightWork<'_> {
    type Step = LightStep;

    const NAME: &'static str = "solve";

    fn size(&self, model: &Model) -> usize {
        model.mesh.n_patches() * model.plan.n_channels
    }

    fn hash_into(&self, _: &Model, hasher: &mut Sha256) {
        let sky = self.sky.iter().flatten();
        sky.for_each(|block| hash_block(hasher, block));
        hasher.update([u8::from(self.study.errors_known)]);
    }

    fn drop_surfaces(step: &mut LightStep) {
        step.surfaces = Vec::new();
    }

    fn solve(
        &self,
        model: &mut Model,
        occluders: &SunOccluders,
        steps: &[SunStep],
        with_values: bool,
        cx: &mut Context,
    ) -> Result<SolvedBlock<LightStep>, WorkflowError> {
        let study = self.study;
        let (reflectance, exitance) = model.materials();
        let direct = self.direct(model, occluders, steps, cx);
        let lit = direct.iter().map(|own| own.lit(&reflectance, &exitance));
        let (lit, errors): (Vec<Block>, Vec<Block>) = lit.unzip();
        let rho = Block::side_by_side(&vec![reflectance.clone(); steps.len()]);
        let [all_lit, all_errors] = [&lit, &errors].map(|blocks| Block::side_by_side(blocks));
        let materials = (&rho, &all_lit);
        let solution = model.solve_system(&study.factors, self.request, materials, study.known(), cx)?;
        let carried = study.carried_error(materials, Some(&all_errors), &solution, cx)?;
        let coarse = model.coarsened(study, &study.factors, &rho, &solution, cx)?;
        study.factors.if_readable(())?;
        let (mut found, mut values) = (Vec::new(), Values::default());
        let mut worst = TotalError::Relative(0.0);
        for (k, (daylight, sent)) in direct.into_iter().zip(&lit).enumerate() {
            let c = exitance.n_channels();
            let own = k * c..(k + 1) * c;
            let own_carried = carried.as_ref().map(|all| all.channels(own.clone()));
            let own_coarse = coarse.as_ref().map(|all| all.of_channels(own.clone()));
            let own = solution.of_channels(own);
            let error = TotalError::of(model, own_carried.as_ref(), &own, cx);
            worst = worst.or_worse(error);
            let mut light = SolutionStudy {
                mesh_error: model.mesh_error(own_coarse.as_ref(), (sent, &own), cx),
                solution: own,
                carried: own_carried,
                error,
                direct: DirectDaylight::default(),
            };
            light.shine(daylight);
            if with_values {
                values.push(&light, study.errors_known);
            }
            found.push(LightStep {
                energy: light.solution.energy.clone(),
                surfaces: LitSurface::in_daylight(model, &light.solution, &light.direct),
                quality: Quality::new(&light.solution, light.error),
                mesh_error: light.mesh_error,
            });
        }
        let constants = with_values.then(|| self.constants(&reflectance, &exitance));
        Ok(SolvedBlock {
            solver: solution.solver_name(&self.request.solver).to_owned(),
            n_passes: solution.n_passes,
            error: worst,
            values: SeriesBlock {
                n_steps: steps.len(),
                quantities: values.quantities,
                constants: constants.unwrap_or_default(),
            },
            steps: found,
            checks: Vec::new(),
            leak: None,
            leak_is_too_great: false,
            warnings: Vec::new(),
        })
    }
}

impl LightWork<'_> {
    /// Computes the direct light of sun and sky at some times.
    fn direct(&self, model: &Model, occluders: &SunOccluders, steps: &[SunStep], cx: &Context) -> Vec<DirectDaylight> {
        let (input, n_channels) = (model.input(), model.plan.n_channels);
        let at = |step: &SunStep| {
            let strengths = vec![step.sun.map_or(0.0, |sun| sun.irradiance()); n_channels];
            let sunlit = match &step.sun {
                Some(sun) => Sunlit::of(occluders, input, sun, &strengths),
                None => Sunlit::dark(input.mesh.n_patches(), n_channels),
            };
            DirectDaylight {
                sun: Some(sunlit),
                sky: self.sky.clone(),
            }
        };
        cx.time("sun", || steps.iter().map(at).collect())
    }

    fn constants(&self, reflectance: &Block, exitance: &Block) -> Vec<SeriesQuantity> {
        let of = SeriesQuantity::of_block;
        let mut constants = vec![of("exitance", exitance), of("reflectance", reflectance)];
        if let Some([irradiance, error]) = &self.sky {
            constants.extend([of("sky_irradiance", irradiance), of("sky_irradiance_error", error)]);
        }
        constants.push(SeriesQuantity::of_channels("row_sum", 1, self.study.factors.row_sums()));
        let sky = sky_columns(&self.study.sky).into_iter();
        constants.extend(sky.map(|(name, values)| SeriesQuantity::of_channels(name, 1, values)));
        constants
    }
}

/// The values of patches at the times of a block.
#[derive(Default)]
struct Values {
    quantities: Vec<SeriesQuantity>,
}

impl Values {
    fn push(&mut self, light: &SolutionStudy, errors_known: bool) {
        let SolutionStudy { solution, carried, .. } = light;
        self.add("radiosity", &solution.radiosity);
        self.add("irradiance", &solution.irradiance);
        if errors_known {
            let (n, c) = (solution.radiosity.n_rows(), solution.radiosity.n_channels());
            let unknown = || Block::from_values(vec![f64::INFINITY; n * c], c);
            self.add("error", &carried.clone().unwrap_or_else(unknown));
        }
        if let Some(sun) = &light.direct.sun {
            let one = |values: &[f64]| Block::from_values(values.to_vec(), 1);
            self.add("sunlit_fraction", &one(&sun.light.fraction));
            self.add("sunlit_fraction_error", &one(&sun.light.fraction_error));
            self.add("sun_irradiance", &sun.irradiance);
            self.add("sun_irradiance_error", &sun.error);
        }
    }

    fn add(&mut self, name: &str, block: &Block) {
        let known = self.quantities.iter().position(|own| own.name == name);
        let place = known.unwrap_or_else(|| {
            let new = SeriesQuantity::of_channels(name, block.n_channels(), Vec::new());
            self.quantities.push(new);
            self.quantities.len() - 1
        });
        self.quantities[place].values.extend_from_slice(block.values());
    }
}
