//! The report, tables, plot and JSON of the comparison.

use std::fmt::Write as _;

use serde::Serialize;

use super::{PictureRun, PicturesResults};
use crate::experiment::ExperimentError;
use crate::experiment::findings::{Check, Files, Findings, PaperFindings, text_file};
use crate::report::plot::{ErrorTimePlot, PlotPoint, Ranged, Series};
use crate::report::{Machine, Table, table};

/// The file of the reference's image.
const REFERENCE: &str = "reference.png";

/// Wall times of the rendering, s.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PictureTimes {
    /// Of each picture, in the order of the runs.
    pub runs_s: Vec<f64>,
    /// Of the reference.
    pub reference_s: f64,
}

impl PicturesResults {
    /// Returns the report, files and document.
    ///
    /// # Errors
    /// [`ExperimentError::Plot`].
    pub fn findings(&self) -> Result<PaperFindings<'_, Self, PictureTimes>, ExperimentError> {
        let inside = Check::all_met(&self.checks);
        let times = PictureTimes {
            runs_s: self.runs.iter().map(|run| run.time_s).collect(),
            reference_s: self.reference_time_s,
        };
        Ok(Findings {
            captions: captions(self),
            ..PaperFindings::new(self, times, inside, report(self, true), files(self)?)
        })
    }
}

fn files(results: &PicturesResults) -> Result<Files, ExperimentError> {
    let mut files = vec![
        text_file("report.md", report(results, false)),
        text_file("report-times.md", report(results, true)),
        text_file("pictures.csv", table(results, false).to_csv()),
        text_file("pictures-times.csv", table(results, true).to_csv()),
        text_file("error-time.svg", error_time(results).to_svg()?),
    ];
    let images = results.runs.iter().map(|run| (file_of(run), run.picture.clone()));
    files.extend(images);
    files.push((REFERENCE.to_owned(), results.reference_picture.clone()));
    Ok(files)
}

/// Returns the name of a run's image: that of `--flat --direct exact` is flat-direct-exact.png.
fn file_of(run: &PictureRun) -> String {
    let name = run.flags.trim_start_matches('-').replace(" --", "-").replace(' ', "-");
    format!("{name}.png")
}

fn captions(results: &PicturesResults) -> Vec<(String, String)> {
    let of_run = |run: &PictureRun| {
        let text = format!(
            "The scene {}, rendered with {} ({}).",
            results.scene,
            run.flags,
            method_of(run)
        );
        (file_of(run), text)
    };
    let reference = format!(
        "The reference: the scene {}, rendered with final gather at a noise of {}.",
        results.scene, results.reference_noise
    );
    let runs = results.runs.iter().map(of_run);
    runs.chain([(REFERENCE.to_owned(), reference)]).collect()
}

/// Returns the method of a run as the plot names it.
fn method_of(run: &PictureRun) -> &'static str {
    match run.noise {
        Some(_) => "final gather",
        None if run.flags.contains("--flat") => "flat",
        None => "interpolated",
    }
}

/// Returns the report in Markdown, with or without times.
///
/// Writing to a String cannot fail; the results of `write!` are dropped for that reason.
fn report(results: &PicturesResults, with_times: bool) -> String {
    let mut text = String::from("# Flat, interpolated and gathered pictures of one solution\n\n");
    let width = results.width;
    let _ = writeln!(
        text,
        "`{}`, {} patches, {width} × {width} pixels, one sample each. Error of the irradiance against final gather with a noise of {}: root mean square relative to the mean, \
         median of the pixels' own, and root mean square relative to each pixel's brightest channel.",
        results.scene, results.n_patches, results.reference_noise
    );
    if with_times {
        let machine = Machine::here();
        let _ = writeln!(
            text,
            "\nTimes: of the rendering alone, one run each with {} threads on {}; the reference took {:.1} s.",
            machine.n_threads,
            machine.processor(),
            results.reference_time_s
        );
    }
    text.push('\n');
    text.push_str(&table(results, with_times).to_markdown());
    text.push_str("\n## Checks\n\n");
    text.push_str(&Check::table(&results.checks, 3).to_markdown());
    text
}

fn table(results: &PicturesResults, with_times: bool) -> Table {
    let all = table! { run in &results.runs;
        "flags": run.flags,
        "method": method_of(run),
        "root mean square": format!("{:.3e}", run.rms),
        "median": format!("{:.3e}", run.median),
        "relative to the pixel": format!("{:.3e}", run.relative_rms),
        "rays": run.n_rays,
        "time (s)": format!("{:.3}", run.time_s),
    };
    all.without_last(usize::from(!with_times))
}

fn error_time(results: &PicturesResults) -> ErrorTimePlot {
    let series = |(style, name): (usize, &str)| Series {
        name: name.to_owned(),
        style,
        points: results
            .runs
            .iter()
            .filter(|run| method_of(run) == name)
            .map(|run| PlotPoint {
                setting: run.flags.clone(),
                time_s: Ranged::exactly(run.time_s),
                error: Ranged::exactly(run.rms),
                on_front: false,
            })
            .collect(),
    };
    ErrorTimePlot {
        title: format!("Error against rendering time: {}", results.scene),
        subtitle: format!(
            "one solution; against final gather with a noise of {}; one run each",
            results.reference_noise
        ),
        error_label: "relative root-mean-square error of the irradiance".to_owned(),
        series: ["flat", "interpolated", "final gather"]
            .into_iter()
            .enumerate()
            .map(series)
            .collect(),
        joined: true,
        reference_error: Some(results.reference_noise),
    }
}
