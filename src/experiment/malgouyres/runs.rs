//! The runs: voxels by resolution and radius, cells, and patches beside them.

use std::time::Instant;

use serde::Serialize;

use super::super::findings::Check;
use super::LEVEL_MAX;
use super::measure::{CASES, Case, PatchReference};
use crate::experiment::ExperimentError;
use crate::form_factor::{ExactMethod, FormFactorMethod, MethodSettings, method as form_factor_method};
use crate::matrix::operator::Block;
use crate::progress::{Progress, Silent};
use crate::voxel::{
    AdaptiveSettings, DiscreteSphere, Form, LinkOperator, Links, Materials, RowWeights, SolidAngle, VoxelScene,
    onto_patches, propagate, solve_adaptively,
};

/// The radius of the runs by resolution: the paper's.
const RADIUS: u32 = 30;

/// The coarsest resolution.
const N_LEAST: u32 = 10;

/// The radii of the runs by radius, and the resolution of these.
const RADII: [u32; 5] = [4, 8, 16, 32, 64];
const N_OF_RADII: u32 = 20;

/// Tolerances of the runs on cells, and the level of their largest cells.
const TOLERANCES: [f64; 3] = [0.2, 0.05, 0.02];
const COARSEST: u8 = 3;

/// The result of a run on voxels.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct VoxelRun {
    /// Voxels along the longest axis.
    pub n: u32,
    /// R.
    pub radius: u32,
    /// The tolerance where voxels were joined to cells.
    pub tolerance: Option<f64>,
    /// Unknowns: surfels or cells.
    pub n_unknowns: usize,
    /// Links.
    pub n_links: u64,
    /// ‖H_voxels − H‖ / ‖H‖.
    pub error: f64,
    /// ‖H_voxels − H_R‖ / ‖H‖ from the run with the greatest R, where R is varied.
    pub change: Option<f64>,
    /// Wall time of discretisation, links and propagation, s.
    #[serde(skip)]
    pub time_s: f64,
}

/// The result of a run on patches.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PatchRun {
    /// The form-factor method.
    pub method: &'static str,
    /// Parts of each edge of a face.
    pub per_edge: u32,
    /// Unknowns.
    pub n_patches: usize,
    /// ‖H_patches − H‖ / ‖H‖.
    pub error: f64,
    /// Wall time of form factors and solution, s.
    #[serde(skip)]
    pub time_s: f64,
}

/// All runs on one scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "MalgouyresScene"))]
pub struct SceneResult {
    /// The scene.
    pub scene: &'static str,
    /// Patches of the reference.
    pub n_patches: usize,
    /// Measuring patches.
    pub n_measuring: usize,
    /// The change of the reference when its patches are halved.
    pub reference_change: f64,
    /// Voxels, by resolution.
    pub by_resolution: Vec<VoxelRun>,
    /// The order p of error ~ hᵖ, h = 1/(n − 1): the slope of the least-squares line through the logarithms.
    pub order_in_h: f64,
    /// Voxels, by radius.
    pub by_radius: Vec<VoxelRun>,
    /// The order of the change in 1/R, the greatest R left out.
    pub order_in_radius: f64,
    /// Cells on the finest voxels.
    pub adaptive: Vec<VoxelRun>,
    /// Patches.
    pub patches: Vec<PatchRun>,
}

impl SceneResult {
    /// Returns the error of uniform voxels after a given time, interpolated in logarithms between the resolutions with adjacent times.
    ///
    /// If the finest resolution took no longer, its error is returned; if the coarsest took longer, `None`.
    #[must_use]
    pub fn uniform_error_after(&self, time_s: f64) -> Option<f64> {
        let runs = &self.by_resolution;
        let next = runs.iter().position(|run| run.time_s > time_s).unwrap_or(runs.len());
        let before = runs[..next].last()?;
        let Some(after) = runs.get(next) else {
            return Some(before.error);
        };
        let share = (time_s / before.time_s).ln() / (after.time_s / before.time_s).ln();
        Some(before.error * (after.error / before.error).powf(share))
    }
}

/// The result of `reproduce malgouyres`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct MalgouyresResults {
    /// The finest resolution is 10 · 2^level.
    pub level: u32,
    /// Scene by scene.
    pub scenes: Vec<SceneResult>,
    /// The checks that must hold.
    pub checks: Vec<Check>,
}

/// Runs voxels, cells and patches on all scenes.
///
/// # Errors
/// [`ExperimentError`] if a reference cannot be computed.
///
/// # Panics
/// If `level` is 0 or above [`LEVEL_MAX`].
#[track_caller]
pub fn reproduce(level: u32, progress: &dyn Progress) -> Result<MalgouyresResults, ExperimentError> {
    assert!((1..=LEVEL_MAX).contains(&level), "a level from 1 to {LEVEL_MAX}");
    let scenes = CASES.iter().map(|case| scene_result(case, level, progress));
    let scenes = scenes.collect::<Result<Vec<_>, _>>()?;
    Ok(MalgouyresResults {
        level,
        checks: CASES
            .iter()
            .zip(&scenes)
            .flat_map(|(case, result)| checks(case, result))
            .collect(),
        scenes,
    })
}

fn scene_result(case: &Case, level: u32, progress: &dyn Progress) -> Result<SceneResult, ExperimentError> {
    let reference = PatchReference::solve(case, progress)?;
    progress.begin(
        case.scene,
        u64::from(level) + 1 + RADII.len() as u64 + TOLERANCES.len() as u64 + 2,
    );
    let mut by_resolution = Vec::new();
    for k in 0..=level {
        by_resolution.push(on_voxels(&reference, case, N_LEAST << k, RADIUS).0);
        progress.advance(1);
    }
    let mut radii: Vec<(VoxelRun, Block)> = Vec::new();
    for radius in RADII {
        radii.push(on_voxels(&reference, case, N_OF_RADII, radius));
        progress.advance(1);
    }
    let best = radii.last().map(|(_, values)| values.clone());
    let by_radius: Vec<VoxelRun> = radii
        .into_iter()
        .map(|(run, values)| VoxelRun {
            change: best.as_ref().map(|best| reference.distance(&values, best)),
            ..run
        })
        .collect();
    let mut adaptive = Vec::new();
    for tolerance in TOLERANCES {
        adaptive.push(on_cells(&reference, case, N_LEAST << level, tolerance));
        progress.advance(1);
    }
    let patches = patch_runs(&reference, case, progress)?;
    let slope = |runs: &[VoxelRun], x: fn(&VoxelRun) -> f64, y: fn(&VoxelRun) -> f64| {
        let points: Vec<(f64, f64)> = runs.iter().map(|run| (x(run).ln(), y(run).ln())).collect();
        slope(&points)
    };
    let shorter = by_radius.len() - 1;
    Ok(SceneResult {
        scene: case.scene,
        n_patches: reference.n_patches,
        n_measuring: reference.n_measuring(),
        reference_change: reference.change,
        order_in_h: slope(&by_resolution, |run| 1.0 / f64::from(run.n - 1), |run| run.error),
        order_in_radius: slope(
            &by_radius[..shorter],
            |run| 1.0 / f64::from(run.radius),
            |run| run.change.unwrap_or(f64::NAN),
        ),
        by_resolution,
        by_radius,
        adaptive,
        patches,
    })
}

/// Returns the slope of the least-squares line.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (above, below) = points.iter().fold((0.0, 0.0), |(a, b), p| {
        (a + (p.0 - x) * (p.1 - y), b + (p.0 - x).powi(2))
    });
    above / below
}

/// Returns values of surfels on the measuring patches.
fn measured(reference: &PatchReference, case: &Case, voxels: &VoxelScene, values: &Block) -> Block {
    let on_points = onto_patches(voxels, &reference.scene.faces, &reference.sampling, values);
    reference.to_measuring(on_points, case, case.per_edge << 3)
}

fn discretised(reference: &PatchReference, n: u32, radius: u32) -> (VoxelScene, DiscreteSphere) {
    let voxels = VoxelScene::new(&reference.scene, n).expect("10 to 160 voxels are in range");
    let sphere = DiscreteSphere::new(radius, SolidAngle::Centre).expect("radii of 4 to 64 are in range");
    (voxels, sphere)
}

fn on_voxels(reference: &PatchReference, case: &Case, n: u32, radius: u32) -> (VoxelRun, Block) {
    let start = Instant::now();
    let (voxels, sphere) = discretised(reference, n, radius);
    let links = Links::in_memory(&voxels, &sphere, &Silent);
    let operator = LinkOperator::new(&voxels, &sphere, &links, RowWeights::Normalised);
    let materials = Materials::new(&reference.scene, &voxels, reference.n_channels());
    let solved = propagate(
        &operator,
        &materials.reflectance,
        &materials.emission,
        Form::InPlace,
        case.n_passes,
        &Silent,
    );
    let time_s = start.elapsed().as_secs_f64();
    let values = measured(reference, case, &voxels, &solved.irradiance);
    let run = VoxelRun {
        n,
        radius,
        tolerance: None,
        n_unknowns: voxels.n_surfels(),
        n_links: links.n_links(),
        error: reference.error(&values),
        change: None,
        time_s,
    };
    (run, values)
}

fn on_cells(reference: &PatchReference, case: &Case, n: u32, tolerance: f64) -> VoxelRun {
    let start = Instant::now();
    let (voxels, sphere) = discretised(reference, n, RADIUS);
    let materials = Materials::new(&reference.scene, &voxels, reference.n_channels());
    let settings = AdaptiveSettings {
        coarsest: COARSEST,
        tolerance,
        n_passes: case.n_passes,
        row_weights: RowWeights::Normalised,
    };
    let solved = solve_adaptively(
        &reference.scene,
        &voxels,
        &sphere,
        &materials.reflectance,
        &materials.emission,
        &settings,
        &Silent,
    );
    let time_s = start.elapsed().as_secs_f64();
    let values = measured(reference, case, &voxels, &solved.irradiance);
    VoxelRun {
        n,
        radius: RADIUS,
        tolerance: Some(tolerance),
        n_unknowns: solved.cells.n_cells(),
        n_links: solved.n_links,
        error: reference.error(&values),
        change: None,
        time_s,
    }
}

/// Runs classical radiosity: hemicubes, the method of the paper's time, and exact form factors up to the measuring patches.
fn patch_runs(
    reference: &PatchReference,
    case: &Case,
    progress: &dyn Progress,
) -> Result<Vec<PatchRun>, ExperimentError> {
    let exact = ExactMethod {
        tolerance: case.tolerance,
        ..ExactMethod::default()
    };
    let hemicube = form_factor_method("hemicube", &MethodSettings::default()).map_err(ExperimentError::FormFactors)?;
    let methods: [(&'static str, &dyn FormFactorMethod, u32); 2] = [
        ("hemicube", hemicube.as_ref(), 2 * case.per_edge),
        ("exact", &exact, case.per_edge),
    ];
    let mut runs = Vec::new();
    for (name, method, finest) in methods {
        let mut per_edge = 1;
        while per_edge <= finest {
            let start = Instant::now();
            let irradiance = reference.solve_patches(method, per_edge)?;
            let time_s = start.elapsed().as_secs_f64();
            let n_patches = irradiance.n_rows();
            runs.push(PatchRun {
                method: name,
                per_edge,
                n_patches,
                error: reference.error(&reference.to_measuring(irradiance, case, per_edge)),
                time_s,
            });
            per_edge *= 2;
        }
        progress.advance(1);
    }
    Ok(runs)
}

/// The allowed relative difference from the measured error: three digits are recorded, and rounding on another machine may move a few voxels.
const SPREAD: f64 = 0.02;

/// Returns the checks that must hold on a scene.
fn checks(case: &Case, result: &SceneResult) -> Vec<Check> {
    let check =
        |name: String, value: f64, range: [f64; 2]| Check::new(format!("{}: {name}", result.scene), value, range);
    // The measured orders are 1.2 to 1.4: neighbouring voxels have different directions, so the errors of their sums partly cancel.
    let mut checks = vec![check("order in 1/R".into(), result.order_in_radius, [0.9, 1.8])];
    for (run, expected) in result.by_resolution.iter().zip(case.expected_errors) {
        let range = [1.0 - SPREAD, 1.0 + SPREAD].map(|factor| factor * expected);
        checks.push(check(format!("error at {} voxels", run.n), run.error, range));
    }
    let (Some(voxels), Some(cells)) = (result.by_resolution.last(), result.adaptive.first()) else {
        return checks;
    };
    // At 20 voxels a wall has few cells, and two resolutions do not determine a line.
    if result.by_resolution.len() > 2 {
        checks.push(check("order in h".into(), result.order_in_h, case.order));
        // The measured error at 40 voxels is 0.97 to 1.09 of that of voxels, with 0.16 to 0.63 of the links.
        checks.push(check(
            "error of cells by that of voxels".into(),
            cells.error / voxels.error,
            [0.8, 1.2],
        ));
        checks.push(check(
            "links of cells by those of voxels".into(),
            cells.n_links as f64 / voxels.n_links as f64,
            [0.0, 0.75],
        ));
    }
    checks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns errors 0.1 / n after n² seconds for n = 1, 2 and 4.
    fn result() -> SceneResult {
        let run = |n: u32| VoxelRun {
            n,
            radius: RADIUS,
            tolerance: None,
            n_unknowns: 0,
            n_links: 0,
            error: 0.1 / f64::from(n),
            change: None,
            time_s: f64::from(n * n),
        };
        SceneResult {
            scene: "none",
            n_patches: 0,
            n_measuring: 0,
            reference_change: 0.0,
            by_resolution: [1, 2, 4].map(run).to_vec(),
            order_in_h: 1.0,
            by_radius: Vec::new(),
            order_in_radius: 1.0,
            adaptive: Vec::new(),
            patches: Vec::new(),
        }
    }

    #[test]
    fn uniform_errors_lie_on_the_power_law_between_resolutions() {
        let result = result();
        for time_s in [1.0, 2.0, 4.0, 9.0, 15.9] {
            let error = result.uniform_error_after(time_s).expect("after the coarsest");
            assert!(
                (error * f64::sqrt(time_s) - 0.1).abs() < 1e-15,
                "{error} after {time_s} s"
            );
        }
        assert_eq!(result.uniform_error_after(0.9), None);
        assert_eq!(result.uniform_error_after(1e3), Some(0.025));
    }
}
