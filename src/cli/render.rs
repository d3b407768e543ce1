//! `radiosity render`.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::args::RenderArgs;
use super::checks::{checks_to_json, describe_checks};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::picture::{preview_of, shoot};
use super::run::Run;
use super::view::{demand, render_settings, view};
use super::{Outcome, solution};
use crate::matrix::operator::Block;
use crate::printable::{counted, short};
use crate::render::{DirectMethod, RenderInput};
use crate::workflow::{
    Afterwards, FormFactorStudy, Model, SolutionStudy, gathered, image_byte, image_patches, indirect_irradiance,
};

pub(super) fn run(args: &RenderArgs) -> Result<Outcome, Failure> {
    let mut run = Run::new("render", &args.common);
    let result = match &args.frames {
        Some(file) => super::frames::work(args, file, &mut run),
        None => work(args, &mut run),
    };
    run.ended(result)
}

fn work(args: &RenderArgs, run: &mut Run) -> Result<Outcome, Failure> {
    let settings = render_settings(args, &args.image.view)?;
    let preview = preview_of(&args.output)?;
    let mut files = FileSet::default();
    files.writes_picture("output", &args.output);
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the camera", args.image.view.camera_file()).check()?;
    run.expect(&args.storage, demand(args));
    let mut model = run.prepare(&args.scene, args.mesh, image_patches)?;
    let view = view(&args.image.view, &args.scene, &model.scene)?;
    run.cx.demand.image_byte = image_byte(view.as_view(), &settings, &run.cx.memory)?;
    if settings.direct != DirectMethod::Off {
        model.warn_of_narrow_gaps(&run.cx);
    }
    let solved = solve_scene(run, &mut model, args, settings.direct)?;
    if settings.direct == DirectMethod::Off {
        model
            .plan
            .left_out
            .push("direct light at each pixel: the patches' light is interpolated".into());
    }
    view.tell_left_out(run, &mut model);
    let input = RenderInput {
        scene: &model.scene,
        mesh: &model.mesh,
        visibility: &model.visibility,
        radiosity: &solved.study.solution.radiosity,
        irradiance: &solved.study.solution.irradiance,
        indirect_irradiance: solved.indirect_irradiance.as_ref(),
        error: solved.study.carried.as_ref(),
    };
    let output = (args.output.as_path(), preview.as_path());
    let image = shoot(run, &input, &view, settings, args, output)?;
    run.bars.finish();

    let stated = solved.study.error;
    let mut result = solution::to_json(&model, &solved.solver, &solved.study.solution, stated);
    result["form_factors"] = solved.computed.as_ref().map_or(Value::Null, checks_to_json);
    result["mesh_error"] = json!(solved.study.mesh_error);
    result["image"] = json!(args.output.display().to_string());
    result["preview"] = json!(preview.display().to_string());
    let gather = gathered(&image, settings, &args.output, &run.cx);
    result["final_gather"] = json!(gather);
    result["width"] = json!(image.width());
    result["height"] = json!(image.height());
    let mut text = run.explanation(&model);
    view.tell_camera(run, &mut text);
    let document = run.document_of(&model, result);
    let (n_patches, n_surfaces) = (model.mesh.n_patches(), model.scene.surfaces.len());
    let _ = writeln!(text, "{n_patches} patches on {}", counted(n_surfaces, "surface"));
    if let Some(computed) = &solved.computed {
        describe_checks(&mut text, computed);
    }
    let solver = (solved.solver.as_str(), solved.study.mesh_error.as_ref());
    solution::describe(&mut text, &model, solver, &solved.study.solution, stated);
    if let Some(report) = &gather {
        let _ = writeln!(
            text,
            "final gather: {} rays, {} of {} pixels above the noise of {}",
            report.n_rays,
            report.n_above,
            report.n_pixels,
            short(report.noise)
        );
    }
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    let _ = writeln!(
        text,
        "wrote {} ({} × {}) and {}",
        args.output.display(),
        image.width(),
        image.height(),
        preview.display()
    );
    let is_noisy = gather.is_some_and(|report| report.n_above > 0);
    let code = match solution::code(&solved.study.solution, solved.computed.as_ref(), stated) {
        ExitCode::Done if is_noisy => ExitCode::NotConverged,
        code => code,
    };
    Ok(Outcome {
        text,
        document,
        code: run.judged(code, args.audit.strict),
    })
}

/// What the picture is made from.
struct Solved {
    solver: String,
    study: SolutionStudy,
    /// The form factors, where they are stored.
    computed: Option<FormFactorStudy>,
    /// F (B − E), where a direct pass adds the rest.
    indirect_irradiance: Option<Block>,
}

/// Solves the scene, as far as the picture needs it.
fn solve_scene(run: &mut Run, model: &mut Model, args: &RenderArgs, direct: DirectMethod) -> Result<Solved, Failure> {
    let with_direct = direct != DirectMethod::Off;
    if with_direct && !model.scene.is_reflecting() {
        let (study, dark) = model.without_reflection(&run.cx);
        return Ok(Solved {
            solver: solution::NO_SOLVER.to_owned(),
            study,
            computed: None,
            indirect_irradiance: Some(dark),
        });
    }
    let solver = args.solver.request();
    let need = solver.need(&run.cx)?;
    let method = run.request(&args.method, args.form_factor_tolerance, Afterwards::Image);
    let name = args.solver.solver.clone();
    if args.on_the_fly {
        let (study, indirect_irradiance) = model.solve_on_the_fly(&method, &solver, with_direct, &mut run.cx)?;
        let reason = "the error layer: it is carried from stored form factors";
        model.plan.left_out.push(reason.into());
        return Ok(Solved {
            solver: name,
            study,
            computed: None,
            indirect_irradiance,
        });
    }
    let computed = model.form_factors(&method, need, &mut run.cx)?;
    let study = model.solve(&computed, &solver, &mut run.cx)?;
    let indirect_irradiance = with_direct.then(|| {
        run.cx.time("solve", || {
            indirect_irradiance(&computed.factors, &model.materials().1, &study.solution)
        })
    });
    computed.factors.if_readable(())?;
    Ok(Solved {
        solver: name,
        study,
        computed: Some(computed),
        indirect_irradiance,
    })
}
