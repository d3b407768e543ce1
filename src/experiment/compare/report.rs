//! The report, tables, plots and JSON of a comparison.

use std::fmt::Write as _;

use serde::Serialize;

use super::tables::{cases_table, describe, fastest_table, left_out, runs_table, setting, short_name, storage_section};
use super::{CaseSummary, CompareSettings, Comparison, LeftOut, Part, Run};
use crate::experiment::findings::{Files, text_file};
use crate::experiment::statistics::Spread;
use crate::experiment::{ExperimentError, Reference, ReferenceKind, ReferenceLevel, SWEEPS, StorageFigures};
use crate::report::Machine;
use crate::report::plot::{ErrorTimePlot, PlotPoint, Ranged, Series};
use crate::workflow::{Model, choice_text};

/// The subject of a comparison.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The name of the scene.
    pub name: &'a str,
    /// The scene.
    pub model: &'a Model,
    /// The settings of the runs.
    pub settings: &'a CompareSettings<'a>,
    /// The machine of the runs.
    pub machine: &'a Machine,
    /// The load before the runs: processes that ran or waited to run.
    pub load_before: Option<f64>,
}

/// The share of the machine from which on other processes distort the times.
const BUSY: f64 = 0.2;

/// The part of the JSON document about a comparison.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct CompareDocument<'a> {
    /// The name of the scene.
    pub scene: &'a str,
    /// How many patches it has.
    pub n_patches: usize,
    /// How many surfaces it has.
    pub n_surfaces: usize,
    /// The machine that the times were measured on.
    pub machine: &'a Machine,
    /// Processes that ran or waited to run, in the mean of the minute before; null where the system does not tell.
    pub load_average_before: Option<f64>,
    /// With occluders and without, as far as asked for.
    pub comparisons: Vec<ComparisonRecord<'a>>,
    /// The memory of the form factors in each layout.
    pub storage: StorageFigures,
    /// The files that were written into the directory.
    pub files: Vec<String>,
}

/// One half of a comparison: with occluders, or without.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ComparisonRecord<'a> {
    /// Whether occluders were looked at: `on` or `off`.
    pub visibility: &'a str,
    /// The reference that errors are measured against.
    pub reference: ReferenceRecord,
    /// One entry for each setting, by method and value.
    pub cases: &'a [CaseSummary],
    /// Every run, in the order in which it was made.
    pub runs: &'a [Run],
    /// The measurements that were left out.
    pub left_out: &'a [LeftOut],
}

/// The reference that errors are measured against.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ReferenceRecord {
    /// Where it comes from.
    pub kind: ReferenceKind,
    /// The elements between which it is known.
    pub level: ReferenceLevel,
    /// The same in words.
    pub description: String,
    /// The greatest error that it may have itself.
    pub error_max: f64,
    /// Its root-mean-square error.
    pub error_rms: f64,
    /// The tolerance of `exact` that it was computed at; null of others.
    pub tolerance: Option<f64>,
}

impl<'a> Subject<'a> {
    /// Returns the document of these parts; `files` are the names of the written files.
    #[must_use]
    pub fn document(self, parts: &'a [Part], storage: StorageFigures, files: Vec<String>) -> CompareDocument<'a> {
        let part = |part: &'a Part| ComparisonRecord {
            visibility: part.visibility,
            reference: ReferenceRecord {
                kind: part.reference.kind,
                level: part.reference.level(),
                description: describe(&part.reference),
                error_max: part.reference.error_max,
                error_rms: part.reference.error_rms,
                tolerance: part.reference.tolerance,
            },
            cases: &part.comparison.cases,
            runs: &part.comparison.runs,
            left_out: &part.comparison.left_out,
        };
        CompareDocument {
            scene: self.name,
            n_patches: self.model.mesh.n_patches(),
            n_surfaces: self.model.scene.surfaces.len(),
            machine: self.machine,
            load_average_before: self.load_before,
            comparisons: parts.iter().map(part).collect(),
            storage,
            files,
        }
    }

    /// Returns report, table of all runs and plots as files.
    ///
    /// # Errors
    /// [`ExperimentError::Plot`].
    pub fn files(self, parts: &[Part], report: &str) -> Result<Files, ExperimentError> {
        let mut files = vec![
            text_file("report.md", report.to_owned()),
            text_file("results.csv", runs_table(parts).to_csv()),
        ];
        files.extend(self.plots(parts)?);
        Ok(files)
    }

    /// Returns the report in Markdown.
    #[must_use]
    pub fn report(self, parts: &[Part], storage: &StorageFigures) -> String {
        let mut text = format!("# {}: form-factor methods side by side\n\n", self.name);
        let _ = writeln!(
            text,
            "{} patches on {} surfaces; every setting ran {} times, each time with a seed of its own, on {} threads, \
             interleaved with the others. Times are wall times from the patches to the stored form factors ({}).",
            self.model.mesh.n_patches(),
            self.model.scene.surfaces.len(),
            self.settings.n_seeds,
            self.machine.n_threads,
            choice_text(self.settings.storage)
        );
        if let (Some(load), Some(n_cores)) = (self.load_before, self.machine.n_cores)
            && load > BUSY * n_cores as f64
        {
            let _ = writeln!(
                text,
                "\nThe machine was busy with other work: {load:.1} processes ran or waited to run on its {n_cores} cores in the minute before. \
                 The times are longer than on a machine that is idle, and they scatter; the errors are not affected."
            );
        }
        for part in parts {
            let _ = writeln!(text, "\n## Visibility {}\n", part.visibility);
            let Part {
                reference, comparison, ..
            } = part;
            let _ = writeln!(text, "{}\n", describe(reference));
            if comparison.cases.is_empty() {
                let _ = writeln!(text, "No method was measured.");
            } else {
                let _ = writeln!(
                    text,
                    "Medians, and in brackets the least and the greatest of the runs. The last column tells for which error a setting is on \
                     the Pareto front: no other is as fast and as accurate, and better in one of the two. Errors below the reference's own count as that; an error of 0 \
                     means that the method is what made the reference.\n"
                );
                text.push_str(&cases_table(comparison).to_markdown());
                let _ = writeln!(
                    text,
                    "\nThe fastest setting whose error was below the bound in every run, with its median time:\n"
                );
                text.push_str(&fastest_table(comparison, reference).to_markdown());
            }
            text.push_str(&left_out(comparison));
        }
        text.push_str(&storage_section(storage, self.settings.storage));
        text
    }

    /// Returns the plots as files.
    fn plots(self, parts: &[Part]) -> Result<Files, ExperimentError> {
        let mut files = Vec::new();
        for part in parts {
            let Part {
                reference, comparison, ..
            } = part;
            if comparison.cases.is_empty() {
                continue;
            }
            for (short, long) in [("max", "greatest absolute error"), ("rms", "root-mean-square error")] {
                let suffix = if part.visibility == "on" { "" } else { "_visibility_off" };
                let plot = self.plot(part.visibility, reference, comparison, short, long);
                files.push(text_file(format!("error_time_{short}{suffix}.svg"), plot.to_svg()?));
                files.push((format!("error_time_{short}{suffix}.png"), plot.to_png()?));
            }
        }
        Ok(files)
    }

    fn plot(
        self,
        visibility: &str,
        reference: &Reference,
        comparison: &Comparison,
        short: &str,
        long: &str,
    ) -> ErrorTimePlot {
        let reference_error = match short {
            "max" => reference.error_max,
            _ => reference.error_rms,
        };
        let point = |case: &CaseSummary| {
            let (error, on_front) = match short {
                "max" => (case.error_max, case.on_front_max),
                _ => (case.error_rms, case.on_front_rms),
            };
            let Ranged { middle, low, high } = ranged(error);
            PlotPoint {
                setting: setting(case.method, case.value),
                time_s: ranged(case.time_s),
                // The reference does not resolve errors below its own.
                error: Ranged {
                    middle: middle.max(reference_error),
                    low: low.max(reference_error),
                    high: high.max(reference_error),
                },
                on_front,
            }
        };
        let style = |name: &str| SWEEPS.iter().position(|s| s.name == name).unwrap_or(0);
        let series = self.settings.sweeps.iter().map(|sweep| Series {
            name: sweep.name.to_owned(),
            style: style(sweep.name),
            points: comparison
                .cases
                .iter()
                .filter(|c| c.method == sweep.name)
                .map(point)
                .collect(),
        });
        let between = match reference.level() {
            ReferenceLevel::Patches => "patches",
            ReferenceLevel::Surfaces => "surfaces",
        };
        ErrorTimePlot {
            title: format!("{}: error of the form factors against run time", self.name),
            subtitle: format!(
                "{} patches, visibility {visibility}, {} seeds, {} threads; medians; reference: {}",
                self.model.mesh.n_patches(),
                self.settings.n_seeds,
                self.machine.n_threads,
                short_name(reference)
            ),
            error_label: format!("{long} between {between}"),
            series: series.filter(|s| !s.points.is_empty()).collect(),
            joined: true,
            reference_error: Some(reference_error),
        }
    }
}

fn ranged(spread: Spread) -> Ranged {
    Ranged {
        middle: spread.median,
        low: spread.min,
        high: spread.max,
    }
}
