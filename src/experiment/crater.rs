//! Reproduces [`INGERSOLL_1992`](crate::references::INGERSOLL_1992): the temperature of the shadow in a bowl-shaped crater, by the level of its tessellation.
//!
//! In a sunlit spherical cap the whole shadow has one temperature, which `docs/heat.md` derives:
//!
//! ε σ T⁴ = (1 − A) S sin h f / (1 − f A) [ε + A (1 − f)], f = 1 / (1 + D² / (4 d²)).
//!
//! The built-in scene `crater` has flat faces with their corners on the sphere, 4^(l+1) at level l, so the deviation falls with their area.

use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use super::ExperimentError;
use super::findings::{Check, Files, PaperFindings, text_file};
use crate::heat::{Boundary, Condition, STEFAN_BOLTZMANN, Sun, SurfaceBoundary};
use crate::matrix::Need;
use crate::mesh::Subdivision;
use crate::progress::Progress;
use crate::report::curves::{Curve, CurvePlot};
use crate::report::{Table, table};
use crate::scene::builtin;
use crate::workflow::{Context, FormFactorRequest, Model, SolveRequest, Use};

/// The greatest level: 16,384 faces.
pub const LEVEL_MAX: u32 = 6;

/// The default level: 1,024 faces.
pub const LEVEL_DEFAULT: u32 = 4;

/// The least level.
const LEVEL_MIN: u32 = 2;

/// The emissivity, the solar absorptance, and the sun's irradiance, W·m⁻².
const EMISSIVITY: f64 = 0.95;
const ABSORPTANCE: f64 = 0.88;
const SUN: f64 = 1361.0;

/// The heights of the sun, in degrees.
const HEIGHTS_DEG: [f64; 3] = [6.0, 12.0, 20.0];

/// The value (D / 2 d)² of the scene.
const SQUARED_SLOPE: f64 = 4.0;

/// The greatest ratio of the deviations at successive levels: it falls with the area of the faces, to a quarter.
const LEFT_OVER: f64 = 0.5;

/// The shadow at one level and height of the sun.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CraterRun {
    /// The level of the tessellation.
    pub level: u32,
    /// Faces, each a patch.
    pub n_faces: u64,
    /// The height of the sun, in degrees.
    pub height_deg: f64,
    /// Faces that lie in the shadow with all of their area.
    pub n_shadowed: u64,
    /// The temperature by the closed form, K.
    pub ingersoll_k: f64,
    /// The mean temperature of these faces, K.
    pub mean_k: f64,
    /// The error that is stated of it by form factors and solver, K, as if all were off alike.
    pub mean_k_error: f64,
    /// The greatest deviation of any of these faces, K.
    pub worst_k: f64,
}

impl CraterRun {
    /// Returns the relative deviation of the mean.
    fn deviation(&self) -> f64 {
        (self.mean_k / self.ingersoll_k - 1.0).abs()
    }
}

/// The shadow at all levels and heights, and what must hold.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CraterResults {
    /// The runs, level by level.
    pub runs: Vec<CraterRun>,
    /// The checks.
    pub checks: Vec<Check>,
    /// The wall time of each level, s.
    #[serde(skip)]
    pub times_s: Vec<f64>,
}

/// Returns the temperature of the shadow for a height of the sun, K.
#[must_use]
pub fn ingersoll_k(height_deg: f64) -> f64 {
    let (reflectance, f) = (1.0 - ABSORPTANCE, 1.0 / (1.0 + SQUARED_SLOPE));
    let received = ABSORPTANCE * SUN * height_deg.to_radians().sin() * f / (1.0 - f * reflectance);
    let emitted = received * (EMISSIVITY + reflectance * (1.0 - f));
    (emitted / (EMISSIVITY * STEFAN_BOLTZMANN)).powf(0.25)
}

/// Computes the temperature of the shadow at levels up to `level`.
///
/// # Errors
/// [`ExperimentError::Study`], [`ExperimentError::Scene`].
pub fn reproduce(level: u32, progress: &dyn Progress) -> Result<CraterResults, ExperimentError> {
    let levels = LEVEL_MIN.min(level)..=level;
    progress.begin("crater", levels.clone().count() as u64);
    let (mut runs, mut times_s) = (Vec::new(), Vec::new());
    for own in levels {
        let begun = Instant::now();
        runs.extend(at_level(own)?);
        times_s.push(begun.elapsed().as_secs_f64());
        progress.advance(1);
    }
    Ok(CraterResults {
        checks: checks(&runs),
        runs,
        times_s,
    })
}

fn at_level(level: u32) -> Result<Vec<CraterRun>, ExperimentError> {
    let scene = builtin::build("crater", Some(level))?.scene;
    let mut cx = Context::default();
    let mut model = Model::new(scene, "crater", Subdivision::Uniform(1).into(), Use::Light, &mut cx)?;
    let request = FormFactorRequest::default();
    let study = model.form_factors(&request, Need::default(), &mut cx)?;
    let mut at_height = |height_deg: f64| {
        let boundary = boundary(height_deg);
        let solver = SolveRequest::default();
        let found = model.heat(&study, &boundary, &solver, &mut cx)?;
        let column = |name: &str| {
            let columns = found.heat.patches.iter();
            columns
                .filter(|(own, _)| *own == name)
                .flat_map(|(_, values)| values.clone())
                .collect::<Vec<f64>>()
        };
        let lit = column("sunlit_fraction");
        let in_shadow = |values: Vec<f64>| {
            let shadowed = values.into_iter().zip(&lit).filter(|(_, lit)| **lit <= 0.0);
            shadowed.map(|(value, _)| value).collect::<Vec<f64>>()
        };
        let (kelvin, errors) = (
            in_shadow(column("temperature_k")),
            in_shadow(column("temperature_k_error")),
        );
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let ingersoll_k = ingersoll_k(height_deg);
        Ok(CraterRun {
            level,
            n_faces: lit.len() as u64,
            height_deg,
            n_shadowed: kelvin.len() as u64,
            ingersoll_k,
            mean_k: mean(&kelvin),
            mean_k_error: mean(&errors),
            worst_k: kelvin.iter().map(|k| (k - ingersoll_k).abs()).fold(0.0, f64::max),
        })
    };
    HEIGHTS_DEG.map(&mut at_height).into_iter().collect()
}

fn boundary(height_deg: f64) -> Boundary {
    let height = height_deg.to_radians();
    let surface = SurfaceBoundary {
        emissivity: EMISSIVITY,
        absorptance: ABSORPTANCE,
        condition: Condition::Supplied(0.0),
    };
    Boundary {
        file: "crater".into(),
        surroundings_k: 0.0,
        sun: Sun::new(DVec3::new(height.cos(), 0.0, height.sin()), SUN, 0.0).ok(),
        sky: None,
        surfaces: vec![Some(surface)],
        nodes: Vec::new(),
        patch_values: Vec::new(),
        lines: Vec::new(),
    }
}

fn checks(runs: &[CraterRun]) -> Vec<Check> {
    let mut checks = Vec::new();
    for height in HEIGHTS_DEG {
        let deviations: Vec<(u32, f64)> = runs
            .iter()
            .filter(|run| run.height_deg.to_bits() == height.to_bits())
            .map(|run| (run.level, run.deviation()))
            .collect();
        for pair in deviations.windows(2) {
            checks.push(Check::new(
                format!(
                    "{height}°: deviation of level {} by that of level {}",
                    pair[1].0, pair[0].0
                ),
                pair[1].1 / pair[0].1,
                [0.0, LEFT_OVER],
            ));
        }
    }
    checks
}

impl CraterResults {
    /// Returns the report, files and document.
    ///
    /// # Errors
    /// [`ExperimentError::Plot`].
    pub fn findings(&self) -> Result<PaperFindings<'_, Self, Vec<f64>>, ExperimentError> {
        let inside = Check::all_met(&self.checks);
        let times = self.times_s.clone();
        Ok(PaperFindings::new(self, times, inside, self.report(), self.files()?))
    }

    fn files(&self) -> Result<Files, ExperimentError> {
        Ok(vec![
            text_file("report.md", self.report()),
            text_file("crater.csv", self.table().to_csv()),
            text_file("deviation.svg", self.deviations().to_svg()?),
        ])
    }

    fn deviations(&self) -> CurvePlot {
        let curve = |(style, height): (usize, f64)| {
            let own = self
                .runs
                .iter()
                .filter(|run| run.height_deg.to_bits() == height.to_bits());
            Curve {
                name: format!("sun at {height}°"),
                style,
                points: own.map(|run| (run.n_faces as f64, run.deviation())).collect(),
            }
        };
        CurvePlot {
            title: "Temperature of the shadow: deviation from the closed form".to_owned(),
            subtitle: "mean of all faces that lie wholly in the shadow".to_owned(),
            x_label: "number of faces".to_owned(),
            y_label: "relative deviation of the temperature".to_owned(),
            log_x: true,
            log_y: true,
            marked: true,
            curves: HEIGHTS_DEG.into_iter().enumerate().map(curve).collect(),
        }
    }

    fn report(&self) -> String {
        let checks = if self.checks.is_empty() {
            "None: a check compares two levels, and this run has one.\n".to_owned()
        } else {
            Check::table(&self.checks, 3).to_markdown()
        };
        format!(
            "# The shadow in a bowl-shaped crater\n\nA spherical cap of 4 m across and 1 m deep with an emissivity of {EMISSIVITY} and a solar absorptance of {ABSORPTANCE}, in a sun of {SUN} W/m²: \
             the mean temperature of all faces that lie wholly in the shadow, beside the closed form of Ingersoll, Svitek and Murray (1992).\n\n{}\n## Checks\n\n{checks}",
            self.table().to_markdown(),
        )
    }

    fn table(&self) -> Table {
        table! { run in &self.runs;
            "faces": run.n_faces,
            "sun (°)": run.height_deg.to_string(),
            "in shadow": run.n_shadowed,
            "Ingersoll (K)": format!("{:.3}", run.ingersoll_k),
            "mean (K)": format!("{:.3}", run.mean_k),
            "stated error (K)": format!("{:.1e}", run.mean_k_error),
            "deviation (K)": format!("{:+.3}", run.mean_k - run.ingersoll_k),
            "greatest of a face (K)": format!("{:.3}", run.worst_k),
        }
    }
}
