//! The command `radiosity compare`.

use std::path::PathBuf;

use clap::ValueEnum as _;

use super::Outcome;
use super::args::{CompareArgs, VisibilityName};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::json::in_order;
use super::output;
use super::run::Run;
use crate::document::OfScene;
use crate::experiment::compare::{Part, Subject, default_subdivision, matrix_demand};
use crate::experiment::findings::text_file;
use crate::experiment::{CompareSettings, SWEEPS, Sweep, storage_figures, sweep_by_name};
use crate::report::{Machine, load_average};
use crate::scene::builtin;
use crate::workflow::{Demand, Model, Storage, choose_storage};

pub(super) fn run(args: &CompareArgs) -> Result<Outcome, Failure> {
    let sweeps = sweeps(&args.methods)?;
    if args.memory.storage == Storage::Symmetric {
        return Err(Failure::usage(
            "methods are compared without repairs, and --storage symmetric would average and balance their form factors; use auto, dense, sparse or disk",
        ));
    }
    let name = args
        .scene
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let default = || PathBuf::from(format!("compare-{name}"));
    let directory = args.output.clone().unwrap_or_else(default);
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
    let demand = matrix_demand(&model.mesh);
    let chosen = choose_storage(&run.cx, &mut model, demand)?;
    let settings = CompareSettings {
        sweeps,
        n_seeds: args.seeds,
        first_seed: args.seed,
        time_limit_s: args.time_limit,
        storage: chosen.choice(),
    };
    output::make_directory(&directory)?;
    note_settings(&mut run, args, &settings);
    let visibilities: &[&'static str] = match args.visibility {
        VisibilityName::On => &["on"],
        VisibilityName::Off => &["off"],
        VisibilityName::Both => &["on", "off"],
    };
    let measure = |&visibility: &&'static str| Part::measure(&model, &settings, visibility, args.tolerance, &run.cx);
    let parts: Vec<Part> = visibilities.iter().map(measure).collect::<Result<_, _>>()?;
    let input = Part::input(&model, parts[0].visibility);
    let storage = run.cx.time("storage", || {
        storage_figures(input, &parts[0].reference, settings.storage, &run.cx.progress())
    })?;
    run.bars.finish();
    let subject = Subject {
        name: &name,
        model: &model,
        settings: &settings,
        machine: &Machine::here(),
        load_before,
    };
    run.cx.judge_leaking_exchange();
    let report = subject.report(&parts, &storage);
    // The document is made before the plots are drawn, which are not part of the memory limit.
    let of_scene = OfScene::new(
        &model,
        &run.cx,
        args.common.explain,
        subject.document(&parts, storage, Vec::new()),
    );
    let mut document = run.typed_document(of_scene);
    let mut files = subject.files(&parts, &report)?;
    output::add_page(&mut files, &[], &report, &run.cx.settings);
    let names = files.iter().map(|(file, _)| file.clone());
    document.result.result.files = names.chain(["results.json".to_owned()]).collect();
    let document = in_order(&document);
    files.push(text_file("results.json", format!("{document:#}\n")));
    let (_, written) = output::write_all(&directory, &files)?;
    Ok(Outcome {
        text: format!("{}{report}\n{written}\n", run.explanation(&model)),
        document: document.into(),
        code: run.judged(ExitCode::Done, false),
    })
}

fn note_settings(run: &mut Run, args: &CompareArgs, settings: &CompareSettings<'_>) {
    let noted = &mut run.cx.settings;
    noted.seeds = Some(args.seeds);
    noted.seed = Some(args.seed);
    noted.time_limit_s = Some(args.time_limit);
    noted.tolerance = Some(args.tolerance);
    let visibility = args.visibility.to_possible_value();
    noted.visibility = visibility.map(|value| value.get_name().to_owned());
    noted.methods = Some(settings.sweeps.iter().map(|sweep| sweep.name.to_owned()).collect());
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

/// Reads the scene file, or builds the built-in scene of that name if there is no such file.
fn prepare(run: &mut Run, args: &CompareArgs) -> Result<Model, Failure> {
    let name = args.scene.to_string_lossy();
    if args.scene.exists() {
        return run.prepare(&args.scene, args.mesh, default_subdivision);
    }
    if builtin::names().any(|known| known == name) {
        let scene = builtin::build(&name, None)?.scene;
        return run.prepare_scene(&args.scene, scene, args.mesh, default_subdivision);
    }
    let known: Vec<&str> = builtin::names().collect();
    let message = format!(
        "{name}: no such file, nor a built-in scene; check the path, or give one of {}",
        known.join(", ")
    );
    Err(Failure::new("unreadable", message).in_file(&args.scene))
}
