//! The command `radiosity render`.

use std::fmt::Write as _;

use super::args::RenderArgs;
use super::checks::describe_patches;
use super::exit_code::ExitCode;
use super::failure::{Failure, flag};
use super::file_set::FileSet;
use super::picture::{image_file, preview_of};
use super::run::Run;
use super::view::{expect_sensible, render_settings, tell_camera};
use super::{Outcome, solution, sun};
use crate::document::{FormFactorRecord, LitSurface, RenderDocument, SolverRecord};
use crate::printable::short;
use crate::render::GatherReport;
use crate::workflow::{Afterwards, ImageLight, ImageRequest, Model, gathered, image_byte, image_patches, render_shown};

pub(super) fn run(args: &RenderArgs, run: &mut Run) -> Result<Outcome, Failure> {
    if let Some(file) = &args.frames {
        return super::frames::run(args, file, run);
    }
    expect_sensible(&args.image)?;
    let request = args.image.view.request();
    let settings = render_settings(args, request.is_unfolded());
    let preview = preview_of(&args.output)?;
    let mut files = FileSet::default();
    files.writes_picture("output", &args.output);
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the camera", request.camera_file()).check()?;
    run.expect(&args.storage, args.solver.demand(Some(&args.output)));
    let daylight = sun::daylight(&args.sun)?;
    // In daylight no face has to emit.
    run.has_lightings = daylight.shines();
    args.sun.note(&mut run.cx);
    let mut model = run.prepare(&args.scene, args.mesh, image_patches)?;
    let view = request.view(&args.scene, &model.scene)?;
    run.cx.demand.image_byte = image_byte(view.as_view(), &settings, &run.cx.memory)?;
    let method = run.request(&args.method, args.form_factor_tolerance, Afterwards::Image);
    let asked = (&method, &args.solver.request());
    let direct = (settings.direct, &daylight);
    let light = model.light_for_image(asked, direct, args.on_the_fly, &mut run.cx)?;
    view.note_left_out(&mut model, &run.cx);
    let camera = view.origin().map(|origin| origin.text(&flag));
    let wanted = ImageRequest {
        view: view.as_view(),
        camera: camera.as_deref(),
        settings,
        file: image_file(args.file),
        output: &args.output,
        preview: &preview,
    };
    let image = render_shown(&light.input(&model), &wanted, args.display.as_deref(), &mut run.cx)?;
    run.bars.finish();

    let gather = gathered(&image, settings, &args.output, &run.cx);
    let mut text = run.explanation(&model);
    tell_camera(&view, run, &mut text);
    let (solution, error) = (&light.study.solution, light.study.error);
    let document = RenderDocument {
        solver: SolverRecord::new(&model, &light.solver, solution, error),
        energy: solution.energy.clone(),
        surfaces: LitSurface::in_daylight(&model, &light.study.solution, &light.study.direct),
        form_factors: light.factors.as_ref().map(FormFactorRecord::from),
        mesh_error: light.study.mesh_error.clone(),
        image: args.output.display().to_string(),
        preview: preview.display().to_string(),
        final_gather: gather,
        width: image.width(),
        height: image.height(),
    };
    let document = run.document_of(&model, document);
    describe(&mut text, run, &model, &light, gather.as_ref());
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    let (width, height) = (image.width(), image.height());
    let (file, preview) = (args.output.display(), preview.display());
    let _ = writeln!(text, "wrote {file} ({width} × {height}) and {preview}");
    let is_noisy = gather.is_some_and(|report| report.n_above > 0);
    let code = match solution::code(solution, light.factors.as_ref(), error) {
        ExitCode::Done if is_noisy => ExitCode::NotConverged,
        code => code,
    };
    Ok(Outcome {
        text,
        document,
        code: run.judged(code, args.audit.strict),
    })
}

/// Describes the light of an image, and the cost of final gather.
fn describe(text: &mut String, run: &Run, model: &Model, light: &ImageLight, gather: Option<&GatherReport>) {
    describe_patches(text, model);
    if let Some(factors) = &light.factors {
        run.describe_form_factors(text, factors);
    }
    solution::describe(text, model, &light.solver, &light.study);
    if let Some(report) = gather {
        let _ = writeln!(
            text,
            "final gather: {} rays, {} of {} pixels above the noise of {}",
            report.n_rays,
            report.n_above,
            report.n_pixels,
            short(report.noise)
        );
    }
}
