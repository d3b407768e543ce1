//! `radiosity compare`.

mod tables;

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use super::Outcome;
use super::args::{CompareArgs, StorageName, VisibilityName};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::output::{self, Files};
use super::run::Run;
use crate::experiment::statistics::Spread;
use crate::experiment::{
    CaseSummary, CompareSettings, Comparison, Reference, ReferenceLevel, SWEEPS, StorageFigures, Sweep, compare,
    storage_figures, sweep_by_name,
};
use crate::form_factor::{ExactMethod, FormFactorMethod, Input};
use crate::mesh::Subdivision;
use crate::report::plot::{ErrorTimePlot, PlotPoint, Ranged, Series};
use crate::report::{Machine, load_average};
use crate::scene::{Scene, builtin};
use crate::workflow::{Demand, MatrixDemand, Model, choice_text, choose_storage};
use tables::{cases_table, describe, fastest_table, left_out, runs_table, setting, short_name, storage_section};

/// A scene is cut so that it has at least this many patches.
const PATCHES: usize = 200;

/// How much tighter than the tolerance asked for the reference is.
const TIGHTER: f64 = 100.0;

/// Matrices that exist at a time beside the one that is being computed: the references with visibility and without.
const REFERENCES: u32 = 2;

/// One half of the work: occluders looked at or not.
struct Part {
    visibility: &'static str,
    reference: Reference,
    comparison: Comparison,
}

pub(super) fn run(args: &CompareArgs) -> Result<Outcome, Failure> {
    let sweeps = sweeps(&args.methods)?;
    if args.memory.storage == StorageName::Symmetric {
        return Err(Failure::usage(
            "form factors are compared as the methods give them, and --storage symmetric would average and balance those that are not symmetric; use auto, dense, sparse or disk",
        ));
    }
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
    let load_before = load_average();
    run.cx.memory = args.memory.memory();
    let mut model = prepare(&mut run, args)?;
    model.state_closure(args.closure.closure(), &mut run.cx)?;
    // Scratch files go into the directory of the tables.
    run.cx.demand = Demand {
        output: Some(directory.join("results.json")),
        ..Demand::default()
    };
    let matrix = MatrixDemand {
        by_rows: true,
        repaired: false,
        n_entries: u64::MAX,
        n_beside: REFERENCES,
        // No method takes more than the reference.
        working_byte: ExactMethod::default().working_byte(model.mesh.n_patches()),
    };
    let chosen = choose_storage(&run.cx, &mut model, matrix)?;
    let settings = CompareSettings {
        sweeps,
        n_seeds: args.seeds,
        first_seed: args.seed,
        time_limit_s: args.time_limit,
        storage: chosen.choice(),
    };
    output::make_directory(&directory)?;
    run.cx.set("seeds", args.seeds);
    run.cx.set("seed", args.seed);
    run.cx.set("time_limit_s", args.time_limit);
    run.cx.set("tolerance", args.tolerance);
    run.cx.set("visibility", json!(args.visibility));
    run.cx.set(
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
        .map(|&visibility| measure(&mut run, &model, &settings, visibility, args.tolerance))
        .collect::<Result<_, _>>()?;
    let first = &parts[0];
    let input = input(&model, first.visibility);
    let storage = run.cx.time("storage", || {
        storage_figures(input, &first.reference, settings.storage, &run.cx.progress())
    })?;
    run.bars.finish();
    let subject = Subject {
        name: &name,
        model: &model,
        settings: &settings,
        machine: Machine::here(),
        load_before,
    };
    run.cx.judge_leaking_exchange();
    let report = subject.report(&parts, &storage);
    let mut document = run.document_of(&model, subject.to_json(&parts, &storage));
    let mut files = vec![
        output::text("report.md", report.clone()),
        output::text("results.csv", runs_table(&parts).to_csv()),
    ];
    files.extend(subject.plots(&parts)?);
    output::add_page(&mut files, &report, &run.cx.settings);
    let names = files.iter().map(|(file, _)| file.as_str());
    document["files"] = names.chain(["results.json"]).collect();
    files.push(output::text("results.json", format!("{document:#}\n")));
    let (_, written) = output::write_all(&directory, &files)?;
    Ok(Outcome {
        text: format!("{}{report}\n{written}\n", run.explanation(&model)),
        document,
        code: run.judged(ExitCode::Done, false),
    })
}

/// Returns the methods of these names, or all.
fn sweeps(names: &[String]) -> Result<Vec<&'static Sweep>, Failure> {
    if names.is_empty() {
        return Ok(SWEEPS.iter().collect());
    }
    let of_name = |name: &String| {
        sweep_by_name(name).ok_or_else(|| {
            let known: Vec<&str> = SWEEPS.iter().map(|s| s.name).collect();
            Failure::usage(format!(
                "there is no method `{name}` to compare; there are {}",
                known.join(", ")
            ))
        })
    };
    names.iter().map(of_name).collect()
}

/// Reads the scene file, or builds the built-in scene of that name where there is no such file.
fn prepare(run: &mut Run, args: &CompareArgs) -> Result<Model, Failure> {
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
    if !args.scene.exists() {
        if builtin::names().any(|known| known == name) {
            let scene = builtin::build(&name, None)?.scene;
            return run.prepare_scene(&args.scene, scene, args.mesh, default);
        }
        let known: Vec<&str> = builtin::names().collect();
        let message = format!(
            "{name}: no such file, nor a built-in scene; check the path, or give one of {}",
            known.join(", ")
        );
        return Err(Failure::new("unreadable", message).in_file(&args.scene));
    }
    run.prepare(&args.scene, args.mesh, default)
}

fn input<'a>(model: &'a Model, visibility: &str) -> Input<'a> {
    Input {
        scene: &model.scene,
        mesh: &model.mesh,
        visibility: &model.visibility,
        unoccluded: visibility == "off",
    }
}

fn measure(
    run: &mut Run,
    model: &Model,
    settings: &CompareSettings<'_>,
    visibility: &'static str,
    tolerance: f64,
) -> Result<Part, Failure> {
    let input = input(model, visibility);
    let occluders = !model.plan.convex_and_empty;
    let reference = run.cx.time("reference", || {
        Reference::find(
            input,
            occluders,
            tolerance / TIGHTER,
            settings.storage,
            &run.cx.progress(),
        )
    })?;
    let comparison = run
        .cx
        .time("compare", || compare(input, &reference, settings, &run.cx.progress()))?;
    Ok(Part {
        visibility,
        reference,
        comparison,
    })
}

/// What was compared.
struct Subject<'a> {
    name: &'a str,
    model: &'a Model,
    settings: &'a CompareSettings<'a>,
    machine: Machine,
    /// How busy the machine was before.
    load_before: Option<f64>,
}

/// Processes that run beside ours spoil its times from this share of the machine on.
const BUSY: f64 = 0.2;

impl Subject<'_> {
    /// Returns the report in Markdown.
    fn report(&self, parts: &[Part], storage: &StorageFigures) -> String {
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

    fn to_json(&self, parts: &[Part], storage: &StorageFigures) -> Value {
        let part = |part: &Part| {
            let Part {
                reference, comparison, ..
            } = part;
            json!({
                "visibility": part.visibility,
                "reference": {
                    "kind": reference.kind,
                    "level": reference.level(),
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
            "n_patches": self.model.mesh.n_patches(),
            "n_surfaces": self.model.scene.surfaces.len(),
            "machine": self.machine,
            "load_average_before": self.load_before,
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
                let plot = self.plot(part.visibility, reference, comparison, short, long);
                files.push(output::text(format!("error_time_{short}{suffix}.svg"), plot.to_svg()?));
                files.push((format!("error_time_{short}{suffix}.png"), plot.to_png()?));
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
                setting: setting(case.method, case.value),
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
