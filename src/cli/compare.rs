//! `radiosity compare`.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::Outcome;
use super::args::{CompareArgs, VisibilityName};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::output::{self, Files};
use super::pipeline::{Prepared, Run};
use super::storage;
use crate::experiment::statistics::Spread;
use crate::experiment::{
    CaseSummary, CompareSettings, Comparison, Reference, ReferenceKind, ReferenceLevel, SWEEPS, StorageFigures,
    compare, storage_figures, sweep_by_name,
};
use crate::form_factor::Input;
use crate::mesh::Subdivision;
use crate::plan::byte_text;
use crate::report::plot::{ErrorTimePlot, PlotPoint, Ranged, Series};
use crate::report::{Machine, Table, memory_used_byte, png_from_svg};
use crate::scene::{Scene, builtin};

/// A scene is cut so that it has at least this many patches.
const PATCHES: usize = 200;

/// How much tighter than the tolerance asked for the reference is.
const TIGHTER: f64 = 100.0;

/// One half of the work: occluders looked at or not.
struct Part {
    visibility: &'static str,
    reference: Reference,
    comparison: Comparison,
}

pub(super) fn run(args: &CompareArgs) -> Result<Outcome, Failure> {
    let sweeps = if args.methods.is_empty() {
        SWEEPS.iter().collect()
    } else {
        let of_name = |name: &String| {
            sweep_by_name(name).ok_or_else(|| {
                let known: Vec<&str> = SWEEPS.iter().map(|s| s.name).collect();
                Failure::usage(format!(
                    "there is no method `{name}` to compare; there are {}",
                    known.join(", ")
                ))
            })
        };
        args.methods.iter().map(of_name).collect::<Result<Vec<_>, _>>()?
    };
    let settings = CompareSettings {
        sweeps,
        n_seeds: args.seeds,
        first_seed: args.seed,
        time_limit_s: args.time_limit,
    };
    let name = args
        .scene
        .file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default();
    let directory = args
        .output
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("compare-{name}")));
    let mut run = Run::new("compare", &args.common);
    let prepared = prepare(&mut run, args)?;
    expect_memory(&prepared, args)?;
    output::make_directory(&directory)?;
    run.set("seeds", args.seeds);
    run.set("seed", args.seed);
    run.set("time_limit_s", args.time_limit);
    run.set("tolerance", args.tolerance);
    run.set("visibility", json!(args.visibility));
    run.set(
        "methods",
        json!(settings.sweeps.iter().map(|s| s.name).collect::<Vec<_>>()),
    );
    let visibilities: &[&'static str] = match args.visibility {
        VisibilityName::On => &["on"],
        VisibilityName::Off => &["off"],
        VisibilityName::Both => &["on", "off"],
    };
    let parts: Vec<Part> = visibilities
        .iter()
        .map(|&visibility| measure(&mut run, &prepared, &settings, visibility, args.tolerance))
        .collect::<Result<_, _>>()?;
    let first = &parts[0];
    let input = input(&prepared, first.visibility);
    let storage = run
        .times
        .time("storage", || storage_figures(input, &first.reference, &run.progress));
    let storage = storage?;
    run.progress.finish();
    let subject = Subject {
        name: &name,
        prepared: &prepared,
        settings: &settings,
        machine: Machine::here(),
    };
    let report = subject.report(&parts, &storage);
    let mut document = run.document_of(&prepared, subject.to_json(&parts, &storage));
    let mut files = vec![
        output::text("report.md", report.clone()),
        output::text("results.csv", runs_table(&parts).to_csv()),
    ];
    files.extend(subject.plots(&parts)?);
    output::add_page(&mut files, &report, &run.settings);
    let names = files.iter().map(|(file, _)| file.as_str());
    document["files"] = names.chain(["results.json"]).collect();
    files.push(output::text("results.json", format!("{document:#}\n")));
    let (_, written) = output::write_all(&directory, &files)?;
    Ok(Outcome {
        text: format!("{}{report}\n{written}\n", run.explanation(&prepared)),
        document,
        code: ExitCode::Done,
    })
}

/// Reads the scene file, or builds the built-in scene of that name where there is no such file.
fn prepare(run: &mut Run, args: &CompareArgs) -> Result<Prepared, Failure> {
    let default = |scene: &Scene| {
        let n = (PATCHES as f64 / scene.faces.len().max(1) as f64).sqrt().ceil();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between 1 and 15"
        )]
        Subdivision::Uniform(n as u32)
    };
    let name = args.scene.to_string_lossy();
    if !args.scene.exists() && builtin::names().any(|known| known == name) {
        let scene = builtin::build(&name, None)?.scene;
        return run.prepare_scene(&args.scene, scene, args.mesh, default);
    }
    run.prepare(&args.scene, args.mesh, default)
}

/// Refuses a comparison whose matrices do not fit the memory: reference and result in full, in f64 with errors, for each way of looking.
fn expect_memory(prepared: &Prepared, args: &CompareArgs) -> Result<(), Failure> {
    const MATRICES: u64 = 6;
    let n = prepared.mesh.n_patches() as u64;
    let matrix = n.checked_mul(n).and_then(|entries| entries.checked_mul(16 * MATRICES));
    let used = memory_used_byte().unwrap_or(0);
    let needed = matrix.unwrap_or(u64::MAX).saturating_add(used);
    let limit = storage::limit_byte(args.memory_limit);
    if needed <= limit {
        return Ok(());
    }
    let (needed, limit) = (byte_text(needed), byte_text(limit));
    Err(Failure::new(
        "memory_limit",
        format!(
            "comparing methods on {n} patches needs {needed} of memory, and the limit is {limit}; cut the scene into fewer patches, or raise --memory-limit"
        ),
    ))
}

fn input<'a>(prepared: &'a Prepared, visibility: &str) -> Input<'a> {
    Input {
        scene: &prepared.scene,
        mesh: &prepared.mesh,
        visibility: &prepared.visibility,
        unoccluded: visibility == "off",
    }
}

fn measure(
    run: &mut Run,
    prepared: &Prepared,
    settings: &CompareSettings,
    visibility: &'static str,
    tolerance: f64,
) -> Result<Part, Failure> {
    let input = input(prepared, visibility);
    let occluders = !prepared.plan.convex_and_empty;
    let reference = run.times.time("reference", || {
        Reference::find(input, occluders, tolerance / TIGHTER, &run.progress)
    })?;
    let comparison = run
        .times
        .time("compare", || compare(input, &reference, settings, &run.progress))?;
    Ok(Part {
        visibility,
        reference,
        comparison,
    })
}

/// What was compared.
struct Subject<'a> {
    name: &'a str,
    prepared: &'a Prepared,
    settings: &'a CompareSettings,
    machine: Machine,
}

impl Subject<'_> {
    /// Returns the report in Markdown.
    fn report(&self, parts: &[Part], storage: &StorageFigures) -> String {
        let mut text = format!("# {}: form-factor methods side by side\n\n", self.name);
        let _ = writeln!(
            text,
            "{} patches on {} surfaces; every setting ran {} times, each time with a seed of its own, on {} threads, \
             interleaved with the others. Times are wall times from the patches to the stored form factors.",
            self.prepared.mesh.n_patches(),
            self.prepared.scene.surfaces.len(),
            self.settings.n_seeds,
            self.machine.n_threads
        );
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
            }
            text.push_str(&left_out(comparison));
        }
        text.push_str(&storage_section(storage));
        text
    }

    fn to_json(&self, parts: &[Part], storage: &StorageFigures) -> Value {
        let part = |part: &Part| {
            let Part {
                reference, comparison, ..
            } = part;
            json!({
                "visibility": part.visibility,
                "reference": {
                    "kind": reference.kind,
                    "level": reference.level,
                    "description": describe(reference),
                    "error_max": reference.error_max,
                    "error_rms": reference.error_rms,
                    "tolerance": reference.tolerance,
                },
                "cases": comparison.cases,
                "runs": comparison.runs,
                "left_out": comparison.left_out,
            })
        };
        json!({
            "scene": self.name,
            "n_patches": self.prepared.mesh.n_patches(),
            "n_surfaces": self.prepared.scene.surfaces.len(),
            "machine": self.machine,
            "comparisons": parts.iter().map(part).collect::<Vec<_>>(),
            "storage": storage,
        })
    }

    /// Returns the plots as files.
    fn plots(&self, parts: &[Part]) -> Result<Files, Failure> {
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
                let svg = self
                    .plot(part.visibility, reference, comparison, short, long)
                    .to_svg()?;
                let png = png_from_svg(&svg, 2.0)?;
                files.push(output::text(format!("error_time_{short}{suffix}.svg"), svg));
                files.push((format!("error_time_{short}{suffix}.png"), png));
            }
        }
        Ok(files)
    }

    fn plot(
        &self,
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
                setting: format!("{} {}", case.parameter, case.value),
                time_s: ranged(case.time_s),
                // Less than its own error the reference cannot show.
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
        let between = match reference.level {
            ReferenceLevel::Patches => "patches",
            ReferenceLevel::Surfaces => "surfaces",
        };
        ErrorTimePlot {
            title: format!("{}: error of the form factors against run time", self.name),
            subtitle: format!(
                "{} patches, visibility {visibility}, {} seeds, {} threads; medians; reference: {}",
                self.prepared.mesh.n_patches(),
                self.settings.n_seeds,
                self.machine.n_threads,
                short_name(reference)
            ),
            error_label: format!("{long} between {between}"),
            series: series.filter(|s| !s.points.is_empty()).collect(),
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

fn short_name(reference: &Reference) -> String {
    match (reference.kind, reference.tolerance) {
        (ReferenceKind::ClosedForm, _) => "closed form".to_owned(),
        (ReferenceKind::Polygons, _) => "exact between polygons".to_owned(),
        (ReferenceKind::Certified, _) => "certified".to_owned(),
        (ReferenceKind::Exact, tolerance) => format!("exact at {:e}", tolerance.unwrap_or(0.0)),
    }
}

fn describe(reference: &Reference) -> String {
    let error = reference.error_max;
    match reference.kind {
        ReferenceKind::ClosedForm => {
            format!("Reference: the closed form of every pair of patches, exact to {error:.0e}.")
        }
        ReferenceKind::Polygons => {
            format!("Reference: the exact form factor of every pair of polygons, to {error:.0e}.")
        }
        ReferenceKind::Certified => format!(
            "Reference: certified form factors between the whole surfaces, exact to {error:.0e}; errors are between surfaces."
        ),
        ReferenceKind::Exact => format!(
            "Reference: `exact` at a tolerance of {:e}, two orders tighter than asked for; its own estimate of its error is {:.1e} (root mean square) and {error:.1e} at most.",
            reference.tolerance.unwrap_or(0.0),
            reference.error_rms,
        ),
    }
}

/// Returns one line for each reason.
fn left_out(comparison: &Comparison) -> String {
    let mut reasons: Vec<&str> = Vec::new();
    for item in &comparison.left_out {
        if !reasons.contains(&item.reason.as_str()) {
            reasons.push(&item.reason);
        }
    }
    let mut text = String::new();
    for reason in reasons {
        let names = comparison
            .left_out
            .iter()
            .filter(|item| item.reason == reason)
            .map(|item| {
                let values: Vec<String> = item.values.iter().map(u64::to_string).collect();
                format!("{} ({})", item.method, values.join(", "))
            });
        let _ = writeln!(text, "\nLeft out, {reason}: {}.", names.collect::<Vec<_>>().join("; "));
    }
    text
}

fn cases_table(comparison: &Comparison) -> Table {
    let columns = [
        "method",
        "parameter",
        "value",
        "runs",
        "time (ms)",
        "max error",
        "rms error",
        "front",
    ];
    let mut table = Table::new(columns);
    for case in &comparison.cases {
        let ms = |s: f64| format!("{:.3}", 1e3 * s);
        // A method that is the reference has no error against it.
        let e = |error: f64| {
            if error > 0.0 {
                format!("{error:.2e}")
            } else {
                "0".to_owned()
            }
        };
        let with_range = |s: Spread, show: &dyn Fn(f64) -> String| {
            if case.n_runs == 1 || s.min >= s.max {
                return show(s.median);
            }
            format!("{} [{}, {}]", show(s.median), show(s.min), show(s.max))
        };
        let front = match (case.on_front_max, case.on_front_rms) {
            (true, true) => "max, rms",
            (true, false) => "max",
            (false, true) => "rms",
            (false, false) => "",
        };
        table.push([
            case.method.to_owned(),
            case.parameter.to_owned(),
            case.value.to_string(),
            case.n_runs.to_string(),
            with_range(case.time_s, &ms),
            with_range(case.error_max, &e),
            with_range(case.error_rms, &e),
            front.to_owned(),
        ]);
    }
    table
}

fn runs_table(parts: &[Part]) -> Table {
    let mut table = Table::new([
        "visibility",
        "method",
        "parameter",
        "value",
        "seed",
        "time_s",
        "error_max",
        "error_rms",
        "density",
        "stored_byte",
    ]);
    for part in parts {
        for run in &part.comparison.runs {
            table.push([
                part.visibility.to_owned(),
                run.method.to_owned(),
                run.parameter.to_owned(),
                run.value.to_string(),
                run.seed.to_string(),
                format!("{:?}", run.time_s),
                format!("{:?}", run.error_max),
                format!("{:?}", run.error_rms),
                format!("{:?}", run.density),
                run.stored_byte.to_string(),
            ]);
        }
    }
    table
}

fn storage_section(storage: &StorageFigures) -> String {
    let mut table = Table::new(["layout", "bytes"]);
    for (layout, bytes) in [
        ("dense", storage.dense_byte),
        (
            "symmetric (one triangle, in squares of 64 × 64)",
            storage.symmetric_byte,
        ),
        ("sparse", storage.sparse_byte),
    ] {
        table.push([layout.to_owned(), bytes.to_string()]);
    }
    let entries = match storage.rays {
        None => "the reference's entries".to_owned(),
        Some(rays) => format!("the entries that {rays} rays a patch find"),
    };
    format!(
        "\n## Storage\n\nN = {} patches, N² = {} entries ({:.1} % of them not zero, by {entries}), in f64 without standard errors, as they are in memory. For comparison: Lewis 1992 counts \
         N² = 36 · 16^l entries for N = 6 · 4^l patches (table 1) and cites 10 % for a typical cluttered scene; Baranoski et al. 1995 give 53 % and 70 % \
         for a room around a large and a small sphere.\n\n{}",
        storage.n_patches,
        storage.n_entries,
        100.0 * storage.density,
        table.to_markdown()
    )
}
