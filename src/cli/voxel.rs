//! The command `radiosity voxel`.

use std::fmt::Write as _;
use std::path::Path;

use super::Outcome;
use super::args::{LinksName, VoxelArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::run::Run;
use super::view::{samples, tell_camera};
use super::voxel_text::{describe, describe_surfaces};
use crate::document::VoxelDocument;
use crate::mesh::Subdivision;
use crate::render::{RenderSettings, exr, png};
use crate::report::voxels::write_vtu;
use crate::report::{ReportError, by_ending};
use crate::workflow::{ImageView, Model, VoxelImageRequest, VoxelStudy, image_byte, voxel_patches};

/// The output that `-o` requests.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Image,
    Vtu,
}

pub(super) fn run(args: &VoxelArgs, run: &mut Run) -> Result<Outcome, Failure> {
    let format = args.output.as_deref().map(format_of).transpose()?;
    let is_image = format == Some(Format::Image);
    args.expect_sensible(is_image).map_err(Failure::usage)?;
    files(args, format).check()?;
    // Without an image the patches are not used.
    let cut_as = is_image.then_some(args.mesh);
    run.cx.memory.limit_byte = args.memory_limit;
    let mut model = run.prepare(&args.scene, cut_as, |scene| {
        cut_as.map_or(Subdivision::Uniform(1), |_| voxel_patches(scene, args.voxels))
    })?;
    if !is_image && args.mesh.is_given() {
        let nothing = "cutting faces into patches: voxels need none, only their picture does";
        model.plan.left_out.push(nothing.into());
    }
    if is_image {
        let view = args.image.view.request().view(&args.scene, &model.scene)?;
        run.cx.demand.image_byte = image_byte(view.as_view(), &render_settings(args), &run.cx.memory)?;
    }
    let request = args.request(format == Some(Format::Vtu), is_image);
    let study = model.solve_on_voxels(&request, &mut run.cx)?;
    let view = write(run, &mut model, &study, args, format)?;
    run.bars.finish();

    let output = args.output.as_ref().map(|path| path.display().to_string());
    let result = VoxelDocument::new(&model.scene, &request, &study, output);
    let mut text = run.explanation(&model);
    describe(&mut text, &request, &study);
    describe_surfaces(&mut text, &model.scene, &study);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    if let Some(view) = view {
        tell_camera(&view, run, &mut text);
    }
    if let Some(path) = &args.output {
        let _ = writeln!(text, "wrote {}", path.display());
    }
    let code = if study.is_done() {
        ExitCode::Done
    } else {
        ExitCode::NotConverged
    };
    Ok(Outcome {
        text,
        document: run.document_of(&model, result),
        code: run.judged(code, args.audit.strict),
    })
}

fn files(args: &VoxelArgs, format: Option<Format>) -> FileSet {
    let mut files = FileSet::default();
    match (&args.output, format) {
        (Some(path), Some(Format::Image)) => files.writes_picture("output", path),
        (Some(path), _) => files.writes("the output", path),
        (None, _) => &mut files,
    };
    let may_be_on_disk = matches!(args.links, LinksName::Auto | LinksName::Disk) && args.adaptive.is_none();
    files.keeps("the link file", may_be_on_disk.then(|| args.link_file()).as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the camera", args.image.view.request().camera_file());
    files
}

fn format_of(path: &Path) -> Result<Format, ReportError> {
    by_ending(path, "voxels", &[("exr", Format::Image), ("vtu", Format::Vtu)])
}

fn render_settings(args: &VoxelArgs) -> RenderSettings {
    RenderSettings {
        flat: args.image.flat,
        samples: samples(&args.image.view, false),
        adaptive: true,
        ..RenderSettings::default()
    }
}

/// Writes the requested output, and returns the view of an image.
fn write(
    run: &mut Run,
    model: &mut Model,
    study: &VoxelStudy,
    args: &VoxelArgs,
    format: Option<Format>,
) -> Result<Option<ImageView>, Failure> {
    let (Some(path), Some(format)) = (&args.output, format) else {
        return Ok(None);
    };
    if format == Format::Vtu {
        let settings = run.cx.settings.record();
        let (b, h) = (&study.radiosity, &study.irradiance);
        run.cx.time("write", || {
            write_vtu(path, &model.scene, &study.voxels, b, h, &settings)
        })?;
        return Ok(None);
    }
    let view = args.image.view.request().view(&args.scene, &model.scene)?;
    view.note_left_out(model, &run.cx);
    let request = VoxelImageRequest {
        view: &view,
        settings: render_settings(args),
        show_voxels: args.show_voxels,
    };
    let (image, attributes) = model.render_voxels(study, request, &mut run.cx)?;
    run.cx.time("write", || {
        exr::write(path, &image, &attributes)?;
        png::write(&path.with_extension("png"), &image)
    })?;
    Ok(Some(view))
}
