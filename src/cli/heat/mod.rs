//! The command `radiosity heat`.

mod describe;
mod picture;

use glam::DVec3;

use super::Outcome;
use super::args::HeatArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::run::Run;
use super::solution::code;
use super::sun::{daylight, expect_grey, sky, sun};
use super::sun_path::{self, OnPath};
use crate::document::HeatDocument;
use crate::heat::Boundary;
use crate::mesh::Subdivision;
use crate::report::exchange;
use crate::report::form_factors::{FormFactorFile, files_of};
use crate::report::heat::HeatReport;
use crate::workflow::{Afterwards, FormFactorStudy, HeatStudy, Model};

pub(super) fn run(args: &HeatArgs, run: &mut Run) -> Result<Outcome, Failure> {
    if let Some(path) = &args.exchange_factors {
        exchange::Format::of(path, exchange::CONTENT)?;
    }
    // Errors in sun and sky are reported before the work begins.
    expect_grey(&args.sun)?;
    daylight(&args.sun)?;
    args.picture.as_deref().map(picture::expect_png).transpose()?;
    files(args)?.check()?;
    let file = args.form_factors.as_deref().map(FormFactorFile::open).transpose()?;
    let mesh = file.as_ref().map_or(Ok(args.mesh), |file| args.mesh.of_file(file))?;
    run.expect(&args.storage, args.solver.demand(args.output.as_ref()));
    let mut model = run.prepare(&args.scene, mesh, |_| Subdivision::Uniform(1))?;
    // Errors in the boundary conditions are reported before the work begins.
    let mut boundary = Boundary::load(&args.boundary, &model.scene)?;
    let up = boundary.sky.map_or(DVec3::Z, |sky| sky.up());
    boundary.sun = sun(&args.sun, up)?.map(|request| request.sun).or(boundary.sun);
    boundary.sky = sky(&args.sun, up)?.map(|request| request.sky).or(boundary.sky);
    let on_path = sun_path::read(args.sun_path.as_deref(), &args.sun, up)?;
    let method = run.request(&args.method, args.form_factor_tolerance, Afterwards::Light);
    let solver = args.solver.request();
    let need = solver.need(&run.cx)?;
    let factors = match &file {
        None => model.form_factors(&method, need, &mut run.cx)?,
        Some(file) => model.form_factors_of(file, &method, need, &mut run.cx)?,
    };
    if let Some(path) = &on_path {
        let factors = &factors;
        return OnPath { model, factors, path }.heat(args, &boundary, run);
    }
    let study = model.heat(&factors, &boundary, &solver, &mut run.cx)?;
    if let Some(path) = &args.exchange_factors {
        let found = model.exchange_factors(&factors, &boundary, args.by, &solver, &mut run.cx)?;
        run.cx
            .time("write", || exchange::write(path, &found, &run.cx.settings.record()))?;
    }
    if let Some(path) = &args.picture {
        picture::write(path, args, (&mut model, &study), run)?;
    }
    finish(args, run, &model, &factors, &study)
}

fn files(args: &HeatArgs) -> Result<FileSet, Failure> {
    let of_sun = args.sun_path.as_deref();
    sun_path::expect_work(args.storage.checkpoint.as_deref(), args.form_factors.as_deref(), of_sun)?;
    let mut files = FileSet::default();
    if let Some(output) = &args.output {
        files.writes("the output", &sun_path::output(output, of_sun)?);
    }
    files.reads("the path of the sun", of_sun);
    if let Some(path) = &args.exchange_factors {
        files.writes("the exchange factors", path);
    }
    if let Some(path) = &args.picture {
        files.writes("the picture", path);
        files.reads("the camera", picture::request(args).camera_file());
    }
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the boundary conditions", Some(&args.boundary));
    for file in args.form_factors.iter().flat_map(|path| files_of(path)) {
        files.reads("the form factors", Some(&file));
    }
    Ok(files)
}

/// Writes and describes the results.
fn finish(
    args: &HeatArgs,
    run: &mut Run,
    model: &Model,
    factors: &FormFactorStudy,
    study: &HeatStudy,
) -> Result<Outcome, Failure> {
    if let Some(path) = &args.output {
        let report = HeatReport {
            scene: &model.scene,
            mesh: &model.mesh,
            heat: &study.heat,
            settings: &run.cx.settings.record(),
        };
        run.cx.time("write", || report.write(path))?;
    }
    run.bars.finish();
    let document = run.document_of(model, HeatDocument::new(model, factors, study));
    let mut text = run.explanation(model);
    describe::describe(&mut text, run, args, model, factors, study);
    let bands = std::iter::once(&study.thermal).chain(&study.solar);
    let codes = bands.map(|solution| code(solution, Some(factors), study.error));
    let inexact = (!study.is_exact()).then_some(ExitCode::NotConverged);
    let code = codes.chain(inexact).find(|code| *code != ExitCode::Done);
    let written = args.output.iter().chain(&args.exchange_factors).chain(&args.picture);
    let code = (code.unwrap_or(ExitCode::Done), args.audit.strict);
    Ok(run.outcome(text, document, written, code))
}
