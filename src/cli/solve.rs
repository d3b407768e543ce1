//! The command `radiosity solve`.

use std::path::PathBuf;

use glam::DVec3;

use super::args::SolveArgs;
use super::checks::describe_patches;
use super::failure::Failure;
use super::file_set::FileSet;
use super::lightings::Lightings;
use super::run::Run;
use super::solution::{code, describe};
use super::sun_path::{self, OnPath};
use super::{Outcome, lightings, sun};
use crate::document::{FormFactorRecord, LitSurface, SolveDocument, SolverRecord};
use crate::matrix::operator::Block;
use crate::mesh::Subdivision;
use crate::report::form_factors::{FormFactorFile, files_of};
use crate::workflow::{Afterwards, FormFactorStudy, Model, SolutionStudy, with_suffix};

pub(super) fn run(args: &SolveArgs, run: &mut Run) -> Result<Outcome, Failure> {
    files(args)?.check()?;
    let file = args.form_factors.as_deref().map(FormFactorFile::open).transpose()?;
    let mesh_args = file.as_ref().map_or(Ok(args.mesh), |file| args.mesh.of_file(file))?;
    run.expect(&args.storage, args.solver.demand(args.output.as_ref()));
    let daylight = sun::daylight(&args.sun)?;
    let path = sun_path::read(args.sun_path.as_deref(), &args.sun, DVec3::Z)?;
    let shines = daylight.shines() || path.is_some();
    run.has_lightings = !args.lighting.is_empty() || shines || args.exitance.is_some();
    let mut model = run.prepare(&args.scene, mesh_args, |_| Subdivision::Uniform(1))?;
    // Errors in lightings are reported before the work begins, and their reflectances affect the storage of form factors.
    let loaded = Lightings::load(args, &model.scene)?;
    run.cx.demand.reflectance_max = loaded.reflectance_max();
    let given = args.exitance.as_deref();
    let exitances = given.map(|array| model.materials_of(array)).transpose()?;
    if !shines && exitances.is_none() {
        let files = args.lighting.iter().map(PathBuf::as_path);
        model.warn_of_darkness(files.zip(loaded.all.iter().flatten()), &run.cx);
    }
    let method = run.request(&args.method, args.form_factor_tolerance, Afterwards::Light);
    let solver = args.solver.request();
    if args.on_the_fly {
        let (study, _) = model.solve_on_the_fly(&method, &solver, false, &mut run.cx)?;
        let (rho, e) = model.materials();
        return finish(args, run, &model, None, (&rho, &e), &study);
    }
    let need = solver.need(&run.cx)?;
    let factors = &match &file {
        None if run.has_lightings => model.form_factors(&method, need, &mut run.cx)?,
        None => model.form_factors_for_light(&method, need, &mut run.cx)?,
        Some(file) => model.form_factors_of(file, &method, need, &mut run.cx)?,
    };
    if !args.lighting.is_empty() {
        return lightings::run(&loaded, run, model, factors, args);
    }
    if let Some(path) = &path {
        return OnPath { model, factors, path }.solve(args, run);
    }
    if daylight.shines() {
        args.sun.note(&mut run.cx);
        let study = model.solve_in_daylight(factors, &solver, &daylight, &mut run.cx)?;
        let (rho, e) = model.materials();
        return finish(args, run, &model, Some(factors), (&rho, &e), &study);
    }
    let materials = exitances.unwrap_or_else(|| model.materials());
    model.plan.revise_channels(materials.1.n_channels());
    let study = model.solve_with(factors, (&materials.0, &materials.1), &solver, &mut run.cx)?;
    finish(args, run, &model, Some(factors), (&materials.0, &materials.1), &study)
}

fn files(args: &SolveArgs) -> Result<FileSet, Failure> {
    let of_sun = args.sun_path.as_deref();
    sun_path::expect_work(args.storage.checkpoint.as_deref(), args.form_factors.as_deref(), of_sun)?;
    let mut files = FileSet::default();
    if let Some(output) = &args.output {
        let output = sun_path::output(output, of_sun)?;
        if args.lighting.is_empty() {
            files.writes("the output", &output);
        }
        for name in lightings::names(&args.lighting)? {
            let of = format!("the output for the lighting `{name}`");
            files.writes(of, &with_suffix(&output, &name));
        }
    }
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    for file in args.form_factors.iter().flat_map(|path| files_of(path)) {
        files.reads("the form factors", Some(&file));
    }
    files.reads("the exitances", args.exitance.as_deref());
    files.reads("the path of the sun", of_sun);
    for file in &args.lighting {
        files.reads("a lighting", Some(file));
    }
    Ok(files)
}

/// Writes and describes a solution; without `computed` there are no stored form factors to describe.
fn finish(
    args: &SolveArgs,
    run: &mut Run,
    model: &Model,
    computed: Option<&FormFactorStudy>,
    materials: (&Block, &Block),
    study: &SolutionStudy,
) -> Result<Outcome, Failure> {
    if let Some(path) = &args.output {
        run.cx.time("write", || {
            model.write_solution(path, computed, materials, study, &run.cx)
        })?;
    }
    run.bars.finish();
    let (solver, solution) = (args.solver.solver.as_str(), &study.solution);
    let document = run.document_of(
        model,
        SolveDocument {
            solver: SolverRecord::new(model, solver, solution, study.error),
            energy: solution.energy.clone(),
            surfaces: LitSurface::in_daylight(model, solution, &study.direct),
            form_factors: computed.map(FormFactorRecord::from),
            mesh_error: study.mesh_error.clone(),
        },
    );
    let mut text = run.explanation(model);
    describe_patches(&mut text, model);
    if let Some(computed) = computed {
        run.describe_form_factors(&mut text, computed);
    }
    describe(&mut text, model, solver, study);
    let code = code(solution, computed, study.error);
    Ok(run.outcome(text, document, &args.output, (code, args.audit.strict)))
}
