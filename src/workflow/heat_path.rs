//! The heat of a scene along a path of the sun.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::heat::{warn_of_backs, warn_of_errors};
use super::sun_path::{BlockSink, PathStudy, PathWork, SolvedBlock};
use super::{
    Context, FormFactorStudy, HeatStudy, MAX_HEAT_ERROR, MeshError, Model, Quality, SolveRequest, TotalError,
    WorkflowError,
};
use crate::heat::{
    Boundary, DirectLight, HeatBalance, HeatError, SunOccluders, SunPath, SunStep, Sunlight, SurfaceHeat,
};
use crate::report::series::{SeriesBlock, SeriesQuantity};
use crate::scene::Scene;

/// The quantities of patches that do not change with the sun.
const CONSTANTS: [&str; 6] = [
    "sky_irradiance_w_m2",
    "sky_irradiance_w_m2_error",
    "sky_factor",
    "sky_factor_error",
    "emissivity",
    "absorptance",
];

/// The heat of a scene at one time.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct HeatStep {
    /// The surfaces, in file order.
    pub surfaces: Vec<SurfaceHeat>,
    /// Where the heat comes from and goes.
    #[serde(flatten)]
    pub balance: HeatBalance,
    /// The greatest error of a surface's irradiance, relative to the larger of that and its emissive power.
    pub relative_error_max: f64,
    /// The change by a mesh of about a quarter of the patches; null where that is not known.
    pub mesh_error: Option<MeshError>,
    /// How good the solution of the solar band is; null without sun and sky, at all times that are solved together.
    pub solar: Option<Quality>,
    /// How good that of the thermal band is.
    pub thermal: Quality,
}

impl HeatStep {
    /// Returns whether the temperatures are accurate to [`MAX_HEAT_ERROR`].
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.relative_error_max <= MAX_HEAT_ERROR
    }

    /// Returns the results of a study.
    #[must_use]
    pub fn new(study: &HeatStudy) -> Self {
        Self {
            surfaces: study.heat.surfaces.clone(),
            balance: study.heat.balance,
            relative_error_max: study.heat.relative_error,
            mesh_error: study.mesh_error.clone(),
            solar: study.solar.as_ref().map(|solution| Quality::new(solution, study.error)),
            thermal: Quality::new(&study.thermal, study.error),
        }
    }
}

/// The boundary conditions with a moving sun.
struct HeatWork<'a> {
    study: &'a FormFactorStudy,
    boundary: &'a Boundary,
    request: &'a SolveRequest,
    path: &'a SunPath,
    /// The irradiance straight from the sky and its error.
    sky: [Vec<f64>; 2],
}

impl Model {
    /// Computes temperatures and net fluxes at every time of a path of the sun, which replaces the sun of `boundary`; `sink` receives the values of the patches.
    ///
    /// Each time is computed as by [`heat`](Self::heat): surfaces store no heat, and each time is a steady state of its own. Many times share the passes over the form factors. Blocks in the
    /// checkpoint are not solved again.
    ///
    /// # Errors
    /// As [`heat`](Self::heat), with the time of the error if it has one, and those of `sink`.
    pub fn heat_along_sun_path(
        &mut self,
        study: &FormFactorStudy,
        (path, boundary): (&SunPath, &Boundary),
        request: &SolveRequest,
        sink: Option<BlockSink<'_>>,
        cx: &mut Context,
    ) -> Result<PathStudy<HeatStep>, WorkflowError> {
        let boundary = &Boundary {
            sun: None,
            ..boundary.clone()
        };
        let work = HeatWork {
            study,
            boundary,
            request,
            path,
            sky: self.skylight(study, boundary, cx),
        };
        let found = self.along(study, path, (&work, request), sink, cx)?;
        warn_of_the_worst(&found.steps, cx);
        Ok(found)
    }
}

/// Warns of the time at which backs absorb most heat, and of that with the greatest error.
fn warn_of_the_worst(steps: &[HeatStep], cx: &Context) {
    let to_backs = |step: &&HeatStep| step.balance.absorbed_by_backs_w;
    if let Some(step) = steps.iter().max_by(|a, b| to_backs(a).total_cmp(&to_backs(b))) {
        warn_of_backs(&step.balance, cx);
    }
    if let Some(step) = steps
        .iter()
        .max_by(|a, b| a.relative_error_max.total_cmp(&b.relative_error_max))
    {
        warn_of_errors(step.thermal.stop_reason, step.relative_error_max, cx);
    }
}

impl PathWork for HeatWork<'_> {
    type Step = HeatStep;

    const NAME: &'static str = "heat";

    fn size(&self, model: &Model) -> usize {
        model.mesh.n_patches()
    }

    fn hash_into(&self, _: &Model, hasher: &mut Sha256) {
        // The place of the conditions in a file does not affect the results.
        let conditions = Boundary {
            file: PathBuf::new(),
            lines: Vec::new(),
            ..self.boundary.clone()
        };
        hasher.update(format!("{conditions:?}"));
        for value in self.sky.iter().flatten() {
            hasher.update(value.to_le_bytes());
        }
    }

    fn drop_surfaces(step: &mut HeatStep) {
        step.surfaces = Vec::new();
    }

    fn solve(
        &self,
        model: &mut Model,
        occluders: &SunOccluders,
        steps: &[SunStep],
        with_values: bool,
        cx: &mut Context,
    ) -> Result<SolvedBlock<HeatStep>, WorkflowError> {
        let direct = cx.time("sun", || self.direct(model, occluders, steps));
        let refused = |k: usize, error: HeatError, scene: &Scene| WorkflowError::AtTime {
            error: Box::new(WorkflowError::heat(self.boundary, error, scene)),
            path: self.path.file.clone(),
            line: steps[k].line,
            time: steps[k].time_text.clone(),
        };
        let found = model.heat_of_each(self.study, self.boundary, &direct, (self.request, &refused), cx)?;
        for study in &found {
            study.warn_of_mesh(model.scene.faces.len(), cx);
        }
        let is_constant = |name: &str| CONSTANTS.contains(&name);
        let mut values = SeriesBlock {
            n_steps: steps.len(),
            ..SeriesBlock::default()
        };
        if with_values && let Some(first) = found.first() {
            for (k, (name, of_first)) in first.heat.patches.iter().enumerate() {
                if is_constant(name) {
                    values.constants.push(SeriesQuantity::scalar(*name, of_first.clone()));
                } else {
                    let all = found.iter().flat_map(|study| &study.heat.patches[k].1);
                    values
                        .quantities
                        .push(SeriesQuantity::scalar(*name, all.copied().collect()));
                }
            }
        }
        let thermal = found.first().map(|study| &study.thermal);
        let solar = found.first().and_then(|study| study.solar.as_ref());
        let errors = found.iter().map(|study| study.error);
        Ok(SolvedBlock {
            solver: thermal.map_or_else(String::new, |own| own.solver_name(&self.request.solver).to_owned()),
            n_passes: thermal.into_iter().chain(solar).map(|own| own.n_passes).sum(),
            error: errors.fold(TotalError::Relative(0.0), TotalError::or_worse),
            values,
            steps: found.iter().map(HeatStep::new).collect(),
            checks: Vec::new(),
            leak: None,
            leak_is_too_great: false,
            warnings: Vec::new(),
        })
    }
}

impl HeatWork<'_> {
    /// Computes the direct light of sun and sky at some times.
    fn direct(&self, model: &Model, occluders: &SunOccluders, steps: &[SunStep]) -> Vec<DirectLight> {
        let at = |step: &SunStep| {
            let sun = step.sun.map(|sun| occluders.sunlight(model.input(), &sun));
            DirectLight {
                sun: Some(sun.unwrap_or_else(|| Sunlight::dark(model.mesh.n_patches()))),
                sky: self.sky.clone(),
            }
        };
        steps.iter().map(at).collect()
    }
}
