//! `radiosity solve`.

use std::fmt::Write as _;

use glam::DVec3;
use serde_json::{Value, json};

use super::args::{MeshArgs, SolveArgs};
use super::checks::{checks_to_json, describe_checks};
use super::failure::Failure;
use super::file_set::FileSet;
use super::lightings::{Lightings, with_suffix};
use super::run::Run;
use super::solution::{code, describe, to_json};
use super::surfaces::add_sun;
use super::{Outcome, lightings, sun};
use crate::heat::Sunlit;
use crate::mesh::Subdivision;
use crate::printable::counted;
use crate::report::form_factors::{FormFactorFile, files_of};
use crate::report::solution::{Format, SolutionReport};
use crate::workflow::{self, Afterwards, Demand, FormFactorStudy, Model, SolutionStudy};

pub(super) fn run(args: &SolveArgs) -> Result<Outcome, Failure> {
    let mut run = Run::new("solve", &args.common);
    let result = work(args, &mut run);
    run.ended(result)
}

fn work(args: &SolveArgs, run: &mut Run) -> Result<Outcome, Failure> {
    if let Some(path) = &args.output {
        Format::of(path)?;
    }
    files(args)?.check()?;
    let file = args.form_factors.as_deref().map(FormFactorFile::open).transpose()?;
    let mesh_args = file.as_ref().map_or(Ok(args.mesh), |file| mesh_args(file, args.mesh))?;
    let demand = Demand {
        output: args.output.clone(),
        tolerance: Some(args.solver.tolerance),
        ..Demand::default()
    };
    run.expect(&args.storage, demand);
    let shining = sun::sun(&args.sun, DVec3::Z)?;
    // In sunlight no face has to emit.
    run.has_lightings = !args.lighting.is_empty() || shining.is_some();
    let mut model = run.prepare(&args.scene, mesh_args, |_| Subdivision::Uniform(1))?;
    // Before the work: a mistake in them is found at once, and their reflectances count in how form factors are stored.
    let loaded = Lightings::load(args, &model.scene)?;
    run.cx.demand.reflectance_max = loaded.reflectance_max();
    if shining.is_none() {
        loaded.warn_of_darkness(run, &model, &args.lighting);
    }
    let method = run.request(&args.method, args.form_factor_tolerance, Afterwards::Light);
    let solver = args.solver.request();
    if args.on_the_fly {
        let (study, _) = model.solve_on_the_fly(&method, &solver, false, &mut run.cx)?;
        return finish(args, run, &model, None, (&study, None));
    }
    let need = solver.need(&run.cx)?;
    let factors = match &file {
        None => model.form_factors(&method, need, &mut run.cx)?,
        Some(file) => model.form_factors_of(file, &method, need, &mut run.cx)?,
    };
    if !args.lighting.is_empty() {
        return lightings::run(&loaded, run, model, &factors, args);
    }
    if let Some(request) = shining {
        run.cx.set("sun", json!(args.sun));
        let (study, sunlit) = model.solve_in_sun(&factors, &solver, &request, &mut run.cx)?;
        return finish(args, run, &model, Some(&factors), (&study, Some(&sunlit)));
    }
    let study = model.solve(&factors, &solver, &mut run.cx)?;
    finish(args, run, &model, Some(&factors), (&study, None))
}

/// Returns the flags of the patches that a file is for; flags that ask for others are an error.
pub(super) fn mesh_args(file: &FormFactorFile, given: MeshArgs) -> Result<MeshArgs, Failure> {
    let default = given.options(Subdivision::Uniform(1));
    // A flag that is left out asks for nothing.
    let is_asked = given.subdivide.is_some() || given.max_edge.is_some();
    let asked = is_asked.then_some(default.subdivision);
    let options = workflow::mesh_options(file, asked, given.no_cut, default)?;
    let (subdivide, max_edge) = match options.subdivision {
        Subdivision::Uniform(n) => (Some(n), None),
        Subdivision::MaxEdge(length) => (None, Some(length)),
    };
    Ok(MeshArgs {
        subdivide,
        max_edge,
        no_cut: !options.cut_at_walls,
        cut_at_walls: false,
    })
}

fn files(args: &SolveArgs) -> Result<FileSet, Failure> {
    let mut files = FileSet::default();
    match &args.output {
        Some(path) if args.lighting.is_empty() => {
            files.writes("the output", path);
        }
        Some(path) => {
            for name in lightings::names(&args.lighting)? {
                files.writes(
                    format!("the output for the lighting `{name}`"),
                    &with_suffix(path, &name),
                );
            }
        }
        None => {}
    }
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene);
    for file in args.form_factors.iter().flat_map(|path| files_of(path)) {
        files.reads("the form factors", Some(&file));
    }
    for file in &args.lighting {
        files.reads("a lighting", Some(file));
    }
    Ok(files)
}

/// Writes and describes a solution; without `computed` there are no stored form factors to tell of.
fn finish(
    args: &SolveArgs,
    run: &mut Run,
    model: &Model,
    computed: Option<&FormFactorStudy>,
    (study, sunlit): (&SolutionStudy, Option<&Sunlit>),
) -> Result<Outcome, Failure> {
    let (reflectance, exitance) = model.materials();
    let SolutionStudy {
        solution,
        carried,
        error,
        mesh_error,
    } = study;
    if let Some(path) = &args.output {
        let row_sums = computed.map(|computed| computed.factors.row_sums());
        let report = SolutionReport {
            scene: &model.scene,
            mesh: &model.mesh,
            reflectance: &reflectance,
            exitance: &exitance,
            solution,
            error: carried.as_ref(),
            row_sums: row_sums.as_deref(),
            sun: sunlit,
            settings: &run.cx.settings,
        };
        run.cx.time("write", || report.write(path))?;
    }
    let stated = *error;
    run.bars.finish();
    let mut result = to_json(model, &args.solver.solver, solution, stated);
    result["form_factors"] = computed.map_or(Value::Null, checks_to_json);
    result["mesh_error"] = json!(mesh_error);
    if let Some(sunlit) = sunlit {
        add_sun(&mut result["surfaces"], model, sunlit);
    }
    let document = run.document_of(model, result);
    let mut text = run.explanation(model);
    let _ = writeln!(
        text,
        "{} patches on {}",
        model.mesh.n_patches(),
        counted(model.scene.surfaces.len(), "surface")
    );
    if let Some(computed) = computed {
        describe_checks(&mut text, computed);
    }
    let solver = &args.solver.solver;
    describe(&mut text, model, (solver, mesh_error.as_ref()), solution, stated);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    if let Some(path) = &args.output {
        let _ = writeln!(text, "wrote {}", path.display());
    }
    Ok(Outcome {
        text,
        document,
        code: run.judged(code(solution, computed, stated), args.audit.strict),
    })
}
