//! The command `radiosity field`.

use std::fmt::Write as _;
use std::num::NonZeroU32;

use super::args::FieldArgs;
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::picture::{image_file, preview_of};
use super::run::Run;
use super::surface_table::surface_named;
use super::view::{samples, tell_camera};
use super::{Outcome, printable_names};
use crate::document::{FieldDocument, FieldSurface};
use crate::printable::printable;
use crate::render::{Field, RenderSettings, SurfaceMean};
use crate::workflow::{FieldMethod, FieldRequest, Model, image_patches};

pub(super) fn run(args: &FieldArgs, run: &mut Run) -> Result<Outcome, Failure> {
    let view = args.view.request();
    let settings = settings(args, view.is_unfolded())?;
    let preview = preview_of(&args.output)?;
    let mut files = FileSet::default();
    files.writes_picture("output", &args.output);
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the camera", view.camera_file()).check()?;
    run.cx.memory.limit_byte = args.memory_limit;
    let mut model = run.prepare(&args.scene, args.mesh, image_patches)?;
    let surface = surface_named(&model.scene, &args.surface)?;
    let view = view.view(&args.scene, &model.scene)?;
    run.cx.settings.method = Some(args.method.name().to_owned());
    let request = FieldRequest {
        surface,
        view: &view,
        settings,
    };
    let outputs = [&*args.output, &*preview];
    let Field { image, means } = model.field_to_files(request, image_file(args.file), outputs, &mut run.cx)?;
    run.bars.finish();

    let mut text = run.explanation(&model);
    tell_camera(&view, run, &mut text);
    describe(&mut text, &model, &args.surface, &means);
    run.describe_times(&mut text);
    let (width, height) = (image.width(), image.height());
    let (file, preview) = (args.output.display(), preview.display());
    let _ = writeln!(text, "wrote {file} ({width} × {height}) and {preview}");
    let result = FieldDocument {
        surface: args.surface.clone(),
        image: file.to_string(),
        preview: preview.to_string(),
        width,
        height,
        surfaces: FieldSurface::of(&model, &means),
    };
    Ok(Outcome {
        text,
        document: run.document_of(&model, result),
        code: ExitCode::Done,
    })
}

fn settings(args: &FieldArgs, is_unfolded: bool) -> Result<RenderSettings, Failure> {
    let is_exact = args.method == FieldMethod::Exact;
    if is_exact && (args.rays.is_some() || args.sequence.is_some()) {
        return Err(Failure::usage(
            "--rays and --sequence are for --method sr and qmc; exact traces no rays",
        ));
    }
    let rays = args.rays.and_then(NonZeroU32::new);
    Ok(RenderSettings {
        samples: samples(&args.view, is_unfolded),
        adaptive: true,
        direct: args.method.direct(rays),
        sequence: args.sequence.unwrap_or_default(),
        seed: args.seed,
        ..RenderSettings::default()
    })
}

fn describe(text: &mut String, model: &Model, target: &str, means: &[SurfaceMean]) {
    let (names, width) = printable_names(model.scene.surfaces.iter().map(|surface| surface.name.as_str()));
    let _ = writeln!(
        text,
        "mean form factor to {} over the samples that show the front of a surface",
        printable(target)
    );
    for (name, mean) in names.iter().zip(means) {
        match mean.form_factor {
            Some(value) => {
                let _ = writeln!(text, "{name:width$} {value:>12.9} ({} samples)", mean.n_samples);
            }
            None => {
                let _ = writeln!(text, "{name:width$}    not seen");
            }
        }
    }
    let _ = writeln!(text);
}
