//! The documents of `solve` and `heat` along a path of the sun.

use serde::Serialize;

use super::FormFactorRecord;
use crate::heat::{SunPath, SunStep};
use crate::workflow::{FormFactorStudy, Model, PathStudy};

/// The result of `solve` or `heat` with a path of the sun.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PathDocument<S> {
    /// How many patches there are.
    pub n_patches: usize,
    /// How many times there are.
    pub n_steps: usize,
    /// The unit of `time`: `s`, from the first time on, where times are dates, else `as given`.
    pub time_unit: &'static str,
    /// The solver: the one that was asked for, or that `auto` chose for the first times.
    pub solver: String,
    /// Passes over the form factors, for all times.
    pub n_passes: usize,
    /// The worst relative error of B by solver and form factors together, in the area-weighted L2 norm, the mesh's aside; null where it is not known.
    pub estimated_relative_error: Option<f64>,
    /// The times, in the order of the table.
    pub steps: Vec<StepRecord<S>>,
    /// The form factors.
    pub form_factors: FormFactorRecord,
}

/// A time of a path of the sun.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct StepRecord<S> {
    /// The line of the table, from 1.
    pub line: usize,
    /// The time as a number, in `time_unit`.
    pub time: f64,
    /// The time as the table has it.
    pub time_text: String,
    /// The unit vector towards the sun.
    pub sun_direction: [f64; 3],
    /// The irradiance of a plane that faces the sun, W·m⁻²; 0 of a sun below the horizon.
    pub sun_irradiance_w_m2: f64,
    /// The result then.
    #[serde(flatten)]
    pub result: S,
}

impl<S> PathDocument<S> {
    /// Returns the document of a path's results.
    #[must_use]
    pub fn new(model: &Model, factors: &FormFactorStudy, path: &SunPath, study: PathStudy<S>) -> Self {
        let record = |(step, result): (&SunStep, S)| StepRecord {
            line: step.line,
            time: step.time,
            time_text: step.time_text.clone(),
            sun_direction: step.direction.to_array(),
            sun_irradiance_w_m2: step.sun.map_or(0.0, |sun| sun.irradiance()),
            result,
        };
        Self {
            n_patches: model.mesh.n_patches(),
            n_steps: path.steps.len(),
            time_unit: path.unit(),
            solver: study.solver,
            n_passes: study.n_passes,
            estimated_relative_error: study.error.relative().filter(|error| error.is_finite()),
            steps: path.steps.iter().zip(study.steps).map(record).collect(),
            form_factors: factors.into(),
        }
    }
}
