//! The command `radiosity form-factors`.

use super::args::FormFactorsArgs;
use super::checks::describe_patches;
use super::failure::Failure;
use super::file_set::FileSet;
use super::run::Run;
use super::surface_table::{describe_surfaces, surface_named};
use super::{Outcome, solution};
use crate::document::FormFactorsDocument;
use crate::matrix::Need;
use crate::mesh::Subdivision;
use crate::report::form_factors::{FormFactorReport, Format};
use crate::workflow::{Afterwards, Demand, SurfaceTable};

pub(super) fn run(args: &FormFactorsArgs, run: &mut Run) -> Result<Outcome, Failure> {
    let format = args.output.as_deref().map(Format::of).transpose()?;
    let has_quantities = |own| matches!(own, Format::Vtu | Format::Ply | Format::Obj);
    if args.surface.is_some() && format.is_some_and(|own| !has_quantities(own)) {
        return Err(Failure::usage("--surface is for `-o F.vtu`, F.ply and F.obj"));
    }
    if args.dense && format != Some(Format::Npz) {
        return Err(Failure::usage("--dense is for `-o F.npz`"));
    }
    files(args).check()?;
    let demand = Demand {
        output: args.output.clone(),
        ..Demand::default()
    };
    run.expect(&args.storage, demand);
    let mut model = run.prepare(&args.scene, args.mesh, |_| Subdivision::Uniform(1))?;
    let surface = args
        .surface
        .as_deref()
        .map(|name| surface_named(&model.scene, name))
        .transpose()?;
    let request = run.request(&args.method, args.tolerance, Afterwards::Nothing);
    let computed = model.form_factors(&request, Need::AsTheyAre, &mut run.cx)?;
    run.cx.judge_leaking_exchange();
    let table = run.cx.time("surfaces", || {
        SurfaceTable::new(&mut model, &computed, &run.cx, args.surfaces_up_to())
    });
    computed.factors.if_readable(())?;
    if let Some(path) = &args.output {
        let report = FormFactorReport {
            scene: &model.scene,
            mesh: &model.mesh,
            factors: &computed.factors,
            tolerance_met: computed.tolerance_met,
            pairs: computed.pairs,
            sky: Some(&computed.sky),
            settings: &run.cx.settings.record(),
            surface,
            is_closed: computed.closed,
            dense: args.dense,
        };
        run.cx.time("write", || report.write(path))?;
    }
    run.bars.finish();
    let output = args.output.as_ref().map(|path| path.display().to_string());
    let document = run.document_of(&model, FormFactorsDocument::new(&model, &computed, &table, output));
    let mut text = run.explanation(&model);
    describe_patches(&mut text, &model);
    run.describe_form_factors(&mut text, &computed);
    describe_surfaces(&mut text, &model, &computed, &table);
    let code = (solution::code_of(Some(&computed)), args.audit.strict);
    Ok(run.outcome(text, document, &args.output, code))
}

fn files(args: &FormFactorsArgs) -> FileSet {
    let mut files = FileSet::default();
    if let Some(path) = &args.output {
        files.writes_form_factors(path);
    }
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files
}
