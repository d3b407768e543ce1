//! `radiosity field`.

use std::fmt::Write as _;
use std::num::NonZeroU32;

use serde_json::{Value, json};

use super::args::{FieldArgs, FieldMethodName};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::form_factors::surface_named;
use super::picture::preview_of;
use super::run::Run;
use super::surfaces::surfaces_to_json;
use super::view::{samples, view};
use super::{Outcome, name_width};
use crate::geometry::sampling::Sequence;
use crate::printable::printable;
use crate::render::{
    Attributes, DirectMethod, Field, FieldInput, FieldRecord, RenderSettings, SurfaceMean, exr, field, png,
};
use crate::visibility::Visibility as _;
use crate::workflow::{Model, image_byte, image_patches, warn_if_blank};

/// Rays for each sample of a pixel, with `sr`, unless `--rays` says otherwise.
const SHOT_RAYS: u32 = 4096;

/// Rays to each face of the surface, with `qmc`, unless `--rays` says otherwise.
const SHADOW_RAYS: u32 = 64;

pub(super) fn run(args: &FieldArgs) -> Result<Outcome, Failure> {
    let mut run = Run::new("field", &args.common);
    let result = work(args, &mut run);
    run.ended(result)
}

fn work(args: &FieldArgs, run: &mut Run) -> Result<Outcome, Failure> {
    let settings = settings(args)?;
    let preview = preview_of(&args.output)?;
    let mut files = FileSet::default();
    files.writes_picture("output", &args.output);
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the camera", args.view.camera_file()).check()?;
    run.cx.memory.limit_byte = args.memory_limit;
    let mut model = run.prepare(&args.scene, args.mesh, image_patches)?;
    let surface = surface_named(&model.scene, &args.surface)?;
    let view = view(&args.view, &args.scene, &model.scene)?;
    image_byte(view.as_view(), &settings, &run.cx.memory)?;
    run.cx.set("method", json!(args.method));
    if let DirectMethod::CosineRays { n } | DirectMethod::Polygons { n } = settings.direct {
        run.cx.set("rays", n.get());
        run.cx.set("sequence", json!(settings.sequence));
        model.warn_of_narrow_gaps(&run.cx);
    } else {
        let nothing = "rays between points and the surface: what blocks is clipped away exactly";
        model.plan.left_out.push(nothing.into());
    }
    run.cx.set("seed", args.seed);
    run.cx.set("surface", args.surface.as_str());
    view.tell_left_out(run, &mut model);
    let input = FieldInput {
        scene: &model.scene,
        mesh: &model.mesh,
        visibility: &model.visibility,
        surface,
    };
    let Field { image, means } = run.cx.time("render", || {
        field(&input, view.as_view(), &settings, &run.cx.progress())
    })?;
    warn_if_blank(&image, view.as_view(), view.camera_name().as_deref(), &run.cx);
    let mut attributes = Attributes::new(
        &model.scene,
        view.as_view().description(),
        settings,
        model.visibility.offset(),
        json!(run.cx.settings),
    )
    .with_field(FieldRecord {
        surface: args.surface.clone(),
    });
    attributes.pixels = args.file.pixels.into();
    run.cx.time("write", || {
        exr::write_parts(&args.output, &image, &attributes, args.file.parts.into())?;
        png::write(&preview, &image)
    })?;
    run.bars.finish();

    let mut text = run.explanation(&model);
    view.tell_camera(run, &mut text);
    describe(&mut text, &model, &args.surface, &means);
    run.describe_times(&mut text);
    let (width, height) = (image.width(), image.height());
    let (file, preview) = (args.output.display(), preview.display());
    let _ = writeln!(text, "wrote {file} ({width} × {height}) and {preview}");
    let result = json!({
        "surface": args.surface,
        "image": file.to_string(),
        "preview": preview.to_string(),
        "width": width,
        "height": height,
        "surfaces": surface_means_to_json(&model, &means),
    });
    Ok(Outcome {
        text,
        document: run.document_of(&model, result),
        code: ExitCode::Done,
    })
}

fn settings(args: &FieldArgs) -> Result<RenderSettings, Failure> {
    let is_exact = args.method == FieldMethodName::Exact;
    if is_exact && (args.rays.is_some() || args.sequence.is_some()) {
        return Err(Failure::usage(
            "--rays and --sequence are for --method sr and qmc; exact traces no rays",
        ));
    }
    let n_or = |default| NonZeroU32::new(args.rays.unwrap_or(default)).ok_or(Failure::usage("--rays starts at 1"));
    Ok(RenderSettings {
        samples: samples(&args.view)?,
        adaptive: true,
        direct: match args.method {
            FieldMethodName::Exact => DirectMethod::Exact,
            FieldMethodName::Sr => DirectMethod::CosineRays { n: n_or(SHOT_RAYS)? },
            FieldMethodName::Qmc => DirectMethod::Polygons { n: n_or(SHADOW_RAYS)? },
        },
        sequence: args.sequence.map_or_else(Sequence::default, Into::into),
        seed: args.seed,
        ..RenderSettings::default()
    })
}

fn surface_means_to_json(model: &Model, means: &[SurfaceMean]) -> Value {
    let mut surfaces = surfaces_to_json(model);
    for (surface, mean) in surfaces.as_array_mut().into_iter().flatten().zip(means) {
        surface["n_pixels"] = json!(mean.n_pixels);
        surface["n_samples"] = json!(mean.n_samples);
        surface["form_factor"] = json!(mean.form_factor);
    }
    surfaces
}

fn describe(text: &mut String, model: &Model, target: &str, means: &[SurfaceMean]) {
    let names: Vec<String> = (model.scene.surfaces.iter())
        .map(|surface| printable(&surface.name))
        .collect();
    let width = name_width(names.iter().map(String::as_str));
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
