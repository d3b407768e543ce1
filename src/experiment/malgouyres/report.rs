//! The report, tables, plots and JSON of the reproduction.

use std::fmt::Write as _;

use serde::Serialize;

use super::{MalgouyresResults, PatchRun, SceneResult, VoxelRun};
use crate::experiment::ExperimentError;
use crate::experiment::findings::{Check, Files, PaperFindings, text_file};
use crate::report::curves::{Curve, CurvePlot};
use crate::report::plot::{ErrorTimePlot, PlotPoint, Ranged, Series};
use crate::report::{Machine, Table, table};

/// Our times on one scene, in the order of the runs, s.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "MalgouyresTimes"))]
pub struct SceneTimes {
    /// The scene.
    pub scene: &'static str,
    /// Voxels, by resolution.
    pub by_resolution_s: Vec<f64>,
    /// Voxels, by radius.
    pub by_radius_s: Vec<f64>,
    /// Cells.
    pub adaptive_s: Vec<f64>,
    /// Patches.
    pub patches_s: Vec<f64>,
}

impl From<&SceneResult> for SceneTimes {
    fn from(scene: &SceneResult) -> Self {
        let of_voxels = |runs: &[VoxelRun]| runs.iter().map(|run| run.time_s).collect();
        Self {
            scene: scene.scene,
            by_resolution_s: of_voxels(&scene.by_resolution),
            by_radius_s: of_voxels(&scene.by_radius),
            adaptive_s: of_voxels(&scene.adaptive),
            patches_s: scene.patches.iter().map(|run| run.time_s).collect(),
        }
    }
}

impl MalgouyresResults {
    /// Returns the report, files and document.
    ///
    /// # Errors
    /// [`ExperimentError::Plot`].
    pub fn findings(&self) -> Result<PaperFindings<'_, Self, Vec<SceneTimes>>, ExperimentError> {
        let inside = Check::all_met(&self.checks);
        let times = self.scenes.iter().map(SceneTimes::from).collect();
        let printed = report(self, true);
        Ok(PaperFindings::new(self, times, inside, printed, files(self)?))
    }
}

fn files(results: &MalgouyresResults) -> Result<Files, ExperimentError> {
    let mut files = vec![
        text_file("report.md", report(results, false)),
        text_file("report-times.md", report(results, true)),
        text_file("voxels.csv", voxels_csv(results).to_csv()),
        text_file("patches.csv", patches_csv(results).to_csv()),
        text_file("times.csv", times_csv(results).to_csv()),
        text_file("checks.csv", Check::table(&results.checks, 4).to_csv()),
        text_file("error-resolution.svg", by_resolution(results).to_svg()?),
        text_file("error-radius.svg", by_radius(results).to_svg()?),
    ];
    for scene in &results.scenes {
        let file = format!("error-time-{}.svg", scene.scene);
        files.push(text_file(file, error_time(scene).to_svg()?));
    }
    Ok(files)
}

fn report(results: &MalgouyresResults, with_times: bool) -> String {
    let mut text = String::from("# Malgouyres 2002: the error of voxels, which the paper leaves open\n\n");
    text.push_str(
        "Error: ‖H_voxels − H‖ / ‖H‖, ‖x‖² = Σ A x² over the measuring patches, H the irradiance by patches half as wide with exact form factors. R = 30 but where it \
         is varied, rows normalised, in place.\n",
    );
    if with_times {
        let machine = Machine::here();
        let _ = writeln!(
            text,
            "\nTimes: one run each with {} threads on {}. \"Patches, same time\": the least error of classical radiosity (hemicubes or exact form factors, constant on each \
             patch) in no more time. \"Voxels, same time\": the error of uniform voxels with R = 30 after that time, between two resolutions on the straight line in logarithms, \
             or that of the finest where it took no longer.",
            machine.n_threads,
            machine.processor()
        );
    }
    for scene in &results.scenes {
        let _ = writeln!(
            text,
            "\n## {}\n\n{} measuring patches; the reference has {} patches and moved by {:.1e} when they were halved.\n",
            scene.scene, scene.n_measuring, scene.n_patches, scene.reference_change
        );
        text.push_str(&voxel_table(scene, with_times).to_markdown());
        let _ = writeln!(
            text,
            "\nOrder of the error in h: {:.2}. Order in 1/R of the distance from R = {}: {:.2}.\n",
            scene.order_in_h,
            scene.by_radius.last().map_or(0, |run| run.radius),
            scene.order_in_radius
        );
        text.push_str(&patch_table(scene, with_times).to_markdown());
    }
    text.push_str("\n## Checks\n\n");
    text.push_str(&Check::table(&results.checks, 4).to_markdown());
    text
}

/// Iterates over all runs on voxels, with the varied parameter of each.
fn all_voxel_runs(scene: &SceneResult) -> impl Iterator<Item = (&'static str, &VoxelRun)> {
    let by_resolution = scene.by_resolution.iter().map(|run| ("resolution", run));
    let by_radius = scene.by_radius.iter().map(|run| ("radius", run));
    by_resolution
        .chain(by_radius)
        .chain(scene.adaptive.iter().map(|run| ("cells", run)))
}

fn voxel_table(scene: &SceneResult, with_times: bool) -> Table {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    // A comparison of a resolution with itself is meaningless.
    let uniform = |varied: &str, run: &VoxelRun| scene.uniform_error_after(run.time_s).filter(|_| varied == "cells");
    let best_patches = |run: &VoxelRun| {
        let in_time = scene.patches.iter().filter(|patches| patches.time_s <= run.time_s);
        in_time.min_by(|a, b| a.error.total_cmp(&b.error))
    };
    let all = table! { (varied, run) in all_voxel_runs(scene);
        "varied": varied,
        "n": run.n,
        "R": run.radius,
        "cells to": or_dash(run.tolerance.map(|t| format!("{t}"))),
        "unknowns": run.n_unknowns,
        "links": run.n_links,
        "error": format!("{:.2e}", run.error),
        "from R max": or_dash(run.change.map(|change| format!("{change:.2e}"))),
        "time (s)": format!("{:.3}", run.time_s),
        "voxels, same time": or_dash(uniform(varied, run).map(|error| format!("{error:.2e}"))),
        "patches, same time": or_dash(best_patches(run).map(|p| format!("{:.2e} ({}, {})", p.error, p.method, p.n_patches))),
    };
    all.without_last(if with_times { 0 } else { 3 })
}

fn patch_table(scene: &SceneResult, with_times: bool) -> Table {
    let all = table! { run in &scene.patches;
        "method": format!("patches, {}", run.method),
        "parts of an edge": run.per_edge,
        "patches": run.n_patches,
        "error": format!("{:.2e}", run.error),
        "time (s)": format!("{:.3}", run.time_s),
    };
    all.without_last(usize::from(!with_times))
}

fn voxels_csv(results: &MalgouyresResults) -> Table {
    let runs = results
        .scenes
        .iter()
        .flat_map(|of| all_voxel_runs(of).map(move |(varied, run)| (of, varied, run)));
    table! { (scene, varied, run) in runs;
        "scene": scene.scene,
        "varied": varied,
        "n": run.n,
        "radius": run.radius,
        "tolerance": run.tolerance,
        "n_unknowns": run.n_unknowns,
        "n_links": run.n_links,
        "error": run.error,
        "change": run.change,
    }
}

fn patches_csv(results: &MalgouyresResults) -> Table {
    let runs = results
        .scenes
        .iter()
        .flat_map(|of| of.patches.iter().map(move |run| (of, run)));
    table! { (scene, run) in runs;
        "scene": scene.scene,
        "method": run.method,
        "per_edge": run.per_edge,
        "n_patches": run.n_patches,
        "error": run.error,
    }
}

fn times_csv(results: &MalgouyresResults) -> Table {
    let runs = results.scenes.iter().flat_map(|of| {
        let voxels = all_voxel_runs(of)
            .map(|(varied, run)| (varied, run.n, Some(run.radius), run.tolerance, run.error, run.time_s));
        let patches = of
            .patches
            .iter()
            .map(|run| (run.method, run.per_edge, None, None, run.error, run.time_s));
        voxels.chain(patches).map(move |run| (of.scene, run))
    });
    table! { (scene, (run, n, radius, tolerance, error, time_s)) in runs;
        "scene": scene,
        "run": run,
        "n": n,
        "radius": radius,
        "tolerance": tolerance,
        "error": error,
        "time_s": time_s,
    }
}

/// Returns a curve for each scene.
fn curves(results: &MalgouyresResults, points: fn(&SceneResult) -> Vec<(f64, f64)>) -> Vec<Curve> {
    let curve = |(style, scene): (usize, &SceneResult)| Curve {
        name: scene.scene.to_owned(),
        // The first styles are those of voxels and patches.
        style: 4 + style,
        points: points(scene),
    };
    results.scenes.iter().enumerate().map(curve).collect()
}

fn by_resolution(results: &MalgouyresResults) -> CurvePlot {
    CurvePlot {
        title: "Discrete radiosity: error by resolution".to_owned(),
        subtitle: "R = 30, against patches with exact form factors".to_owned(),
        x_label: "voxels along the longest axis".to_owned(),
        y_label: "relative L2 error of the irradiance".to_owned(),
        log_x: true,
        log_y: true,
        marked: true,
        curves: curves(results, |scene| {
            let runs = scene.by_resolution.iter();
            runs.map(|run| (f64::from(run.n), run.error)).collect()
        }),
    }
}

fn by_radius(results: &MalgouyresResults) -> CurvePlot {
    CurvePlot {
        title: "Discrete radiosity: distance from the largest sphere".to_owned(),
        subtitle: "20 voxels along the longest axis; the resolution's own error left out".to_owned(),
        x_label: "radius of the discrete sphere".to_owned(),
        y_label: "relative L2 distance of the irradiance".to_owned(),
        log_x: true,
        log_y: true,
        marked: true,
        curves: curves(results, |scene| {
            let runs = scene.by_radius.iter();
            runs.map(|run| (f64::from(run.radius), run.change.unwrap_or(0.0)))
                .collect()
        }),
    }
}

fn error_time(scene: &SceneResult) -> ErrorTimePlot {
    let point = |setting: String, time_s: f64, error: f64| PlotPoint {
        setting,
        time_s: Ranged::exactly(time_s),
        error: Ranged::exactly(error),
        on_front: false,
    };
    let voxels = |name: &str, style: usize, runs: &[VoxelRun]| Series {
        name: name.to_owned(),
        style,
        points: runs
            .iter()
            .map(|run| {
                let cells = run.tolerance.map_or(String::new(), |t| format!(", cells to {t}"));
                point(
                    format!("{} voxels, R = {}{cells}", run.n, run.radius),
                    run.time_s,
                    run.error,
                )
            })
            .collect(),
    };
    let patches = |name: &str, style: usize| {
        let of_method = |run: &&PatchRun| run.method == name;
        let points = scene.patches.iter().filter(of_method);
        Series {
            name: format!("patches, {name}"),
            style,
            points: points
                .map(|run| point(format!("{} patches", run.n_patches), run.time_s, run.error))
                .collect(),
        }
    };
    ErrorTimePlot {
        title: format!("Error against run time: {}", scene.scene),
        subtitle: "voxels by resolution (R = 30), cells by tolerance, patches by subdivision; one run each".to_owned(),
        error_label: "relative L2 error of the irradiance".to_owned(),
        series: vec![
            voxels("voxels", 0, &scene.by_resolution),
            voxels("cells", 1, &scene.adaptive),
            patches("hemicube", 2),
            patches("exact", 3),
        ],
        joined: true,
        reference_error: Some(scene.reference_change),
    }
}
