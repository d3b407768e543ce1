//! `radiosity voxel`.

mod report;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use report::{describe, describe_surfaces, describe_walls, surfaces, to_json};

use super::args::{LinksName, VoxelArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::run::Run;
use super::view::{self, AnyView};
use super::{Outcome, merge, solution};
use crate::audit;
use crate::mesh::Subdivision;
use crate::render::{Attributes, DirectMethod, RenderInput, RenderSettings, exr, png};
use crate::report::voxels::write_vtu;
use crate::voxel::{Grid, RowWeights, SolidAngle, onto_patches, picture};
use crate::workflow::{
    LinkPlace, Model, TotalError, VoxelLight, VoxelRequest, VoxelResult, VoxelStudy, image_byte, warn_if_blank,
};

/// Patches of the display, in voxels: fine enough to show what the voxels resolve.
const PATCH_VOXELS: f64 = 2.0;

/// What `-o` asks for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Image,
    Vtu,
}

pub(super) fn run(args: &VoxelArgs) -> Result<Outcome, Failure> {
    let mut run = Run::new("voxel", &args.common);
    let result = work(args, &mut run);
    run.ended(result)
}

fn work(args: &VoxelArgs, run: &mut Run) -> Result<Outcome, Failure> {
    let format = args.output.as_deref().map(format_of).transpose()?;
    expect_sensible(args, format)?;
    files(args, format).check()?;
    // Without a picture the patches play no part.
    let without_patches = format != Some(Format::Image) && args.mesh.is_given();
    let cut_as = (format == Some(Format::Image)).then_some(args.mesh);
    run.cx.memory.limit_byte = args.memory_limit;
    let mut model = run.prepare(&args.scene, cut_as, |scene| match format {
        None | Some(Format::Vtu) => Subdivision::Uniform(1),
        Some(Format::Image) => Grid::new(scene, args.voxels).map_or(Subdivision::Uniform(1), |grid| {
            Subdivision::MaxEdge(PATCH_VOXELS * grid.voxel_size)
        }),
    })?;
    if without_patches {
        let nothing = "cutting faces into patches: voxels need none, only their picture does";
        model.plan.left_out.push(nothing.into());
    }
    if format == Some(Format::Image) {
        let view = view::view(&args.image.view, &args.scene, &model.scene)?;
        run.cx.demand.image_byte = image_byte(view.as_view(), &render_settings(args), &run.cx.memory)?;
    }
    let study = model.solve_on_voxels(&request(args, format), &mut run.cx)?;
    let view = write(run, &mut model, &study, args, format)?;
    run.bars.finish();

    let mut result = to_json(&model.scene, &study);
    result["surfaces"] = surfaces(&model.scene, &study);
    merge(&mut result, document(args, &study));
    if let Some(path) = &args.output {
        result["output"] = json!(path.display().to_string());
    }
    let mut text = run.explanation(&model);
    describe(&mut text, &study);
    describe_walls(&mut text, &study.voxels);
    let _ = writeln!(text, "{}", line(args, &study));
    describe_surfaces(&mut text, &model.scene, &study);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    if let Some(view) = view {
        view.tell_camera(run, &mut text);
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

/// Returns what the flags ask for.
fn request(args: &VoxelArgs, format: Option<Format>) -> VoxelRequest {
    VoxelRequest {
        n_voxels: args.voxels,
        radius: args.radius,
        solid_angle: if args.exact_solid_angles {
            SolidAngle::Exact
        } else {
            SolidAngle::Centre
        },
        row_weights: if args.unnormalised {
            RowWeights::Plain
        } else {
            RowWeights::Normalised
        },
        plain_emission: args.plain_emission,
        light: match (args.adaptive, &args.solver) {
            (Some(tolerance), _) => VoxelLight::Cells {
                passes: args.passes,
                tolerance,
                coarsest: args.coarsest,
            },
            (None, Some(name)) => VoxelLight::Solver {
                name: name.clone(),
                tolerance: args.tolerance,
            },
            (None, None) => VoxelLight::Propagations {
                passes: args.passes,
                form: args.form.into(),
            },
        },
        links: match args.links {
            LinksName::Auto => LinkPlace::Auto {
                has_file: args.link_file.is_some(),
            },
            LinksName::Memory => LinkPlace::Memory,
            LinksName::Disk => LinkPlace::Disk,
            LinksName::Recompute => LinkPlace::Recompute,
        },
        link_file: link_file(args),
        closure: args.closure.closure(),
        is_written: format == Some(Format::Vtu),
        is_shown: format == Some(Format::Image),
    }
}

/// Returns what the document says of how light was found.
fn document(args: &VoxelArgs, study: &VoxelStudy) -> Value {
    match &study.result {
        VoxelResult::Propagations(changes) => {
            let form: crate::voxel::Form = args.form.into();
            json!({"form": form, "n_passes": args.passes, "changes": changes})
        }
        VoxelResult::Cells {
            changes,
            n_by_level,
            n_by_round,
        } => json!({
            "n_passes": args.passes,
            "changes": changes,
            "n_cells": n_by_round.last(),
            "n_cells_by_level": n_by_level,
            "n_cells_by_round": n_by_round,
        }),
        VoxelResult::Solver(solution) => json!({
            "solver": solution::chosen(args.solver.as_deref().unwrap_or_default(), solution),
            "why": solution.choice.as_ref().map(|choice| &choice.why),
            "stop_reason": solution.stop_reason,
            "n_passes": solution.n_passes,
            "residual_l2": solution.residual_l2,
            "residual_max_power": solution.residual_max_power,
            "error_bound": solution.error_bound,
            "history": solution.history,
        }),
    }
}

/// Returns the line that says how light was found.
fn line(args: &VoxelArgs, study: &VoxelStudy) -> String {
    match &study.result {
        VoxelResult::Propagations(changes) => {
            let last = changes.last().copied().unwrap_or(0.0);
            format!(
                "{} propagations; the last one changed the radiosity by {last:.1e} of itself",
                args.passes
            )
        }
        VoxelResult::Cells { n_by_round, .. } => format!(
            "{} cells in place of {} unknowns, after {} rounds of cuts; {} propagations on each",
            n_by_round.last().unwrap_or(&0),
            study.voxels.n_surfels(),
            n_by_round.len() - 1,
            args.passes
        ),
        VoxelResult::Solver(solution) => {
            solution::solver_line(args.solver.as_deref().unwrap_or_default(), solution, TotalError::Untold)
        }
    }
}

fn files(args: &VoxelArgs, format: Option<Format>) -> FileSet {
    let mut files = FileSet::default();
    match (&args.output, format) {
        (Some(path), Some(Format::Image)) => files.writes_picture("output", path),
        (Some(path), _) => files.writes("the output", path),
        (None, _) => &mut files,
    };
    let may_be_on_disk = matches!(args.links, LinksName::Auto | LinksName::Disk) && args.adaptive.is_none();
    files.keeps("the link file", may_be_on_disk.then(|| link_file(args)).as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the camera", args.image.view.camera_file());
    files
}

/// Returns the file of links on disk.
fn link_file(args: &VoxelArgs) -> PathBuf {
    let beside = || args.scene.with_extension("links");
    args.link_file.clone().unwrap_or_else(beside)
}

fn format_of(path: &Path) -> Result<Format, Failure> {
    let ending = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    match ending.as_ref().and_then(|e| e.to_str()) {
        Some("exr") => Ok(Format::Image),
        Some("vtu") => Ok(Format::Vtu),
        _ => Err(Failure::usage(format!(
            "{}: the ending names no format for voxels; use one of .exr, .vtu",
            path.display()
        ))),
    }
}

fn expect_sensible(args: &VoxelArgs, format: Option<Format>) -> Result<(), Failure> {
    if format != Some(Format::Image) && (args.show_voxels || args.image.is_given()) {
        return Err(Failure::usage("a picture wants a file; add -o IMAGE.exr"));
    }
    if args.link_file.is_some() && matches!(args.links, LinksName::Memory | LinksName::Recompute) {
        return Err(Failure::usage(
            "--link-file is for links on disk: leave it out, or take --links disk",
        ));
    }
    if args.image.direct.is_some() || args.image.direct_samples.is_some() {
        return Err(Failure::usage(
            "--direct: voxels show their own light; use `radiosity render` for a direct pass",
        ));
    }
    Ok(())
}

fn render_settings(args: &VoxelArgs) -> RenderSettings {
    RenderSettings {
        flat: args.image.flat,
        samples: std::num::NonZeroU32::new(args.image.view.samples.unwrap_or(2)).unwrap_or(std::num::NonZeroU32::MIN),
        adaptive: true,
        direct: DirectMethod::Off,
        ..RenderSettings::default()
    }
}

/// Writes what was asked for, and returns the view of a picture.
fn write(
    run: &mut Run,
    model: &mut Model,
    study: &VoxelStudy,
    args: &VoxelArgs,
    format: Option<Format>,
) -> Result<Option<AnyView>, Failure> {
    let voxels = &study.voxels;
    let (Some(path), Some(format)) = (&args.output, format) else {
        return Ok(None);
    };
    if format == Format::Vtu {
        let description = json!({"format": "radiosity voxels 1", "settings": run.cx.settings}).to_string();
        run.cx.time("write", || {
            write_vtu(
                path,
                &model.scene,
                voxels,
                &study.radiosity,
                &study.irradiance,
                &description,
            )
        })?;
        return Ok(None);
    }
    let view = view::view(&args.image.view, &args.scene, &model.scene)?;
    view.tell_left_out(run, model);
    let settings = render_settings(args);
    run.cx.set("show_voxels", args.show_voxels);
    let image = if args.show_voxels {
        run.cx
            .time("render", || picture(voxels, &study.radiosity, view.as_view()))
    } else {
        let irradiance = run.cx.time("display", || {
            onto_patches(voxels, &model.scene.faces, &model.mesh, &study.irradiance)
        });
        let (reflectance, exitance) = model.materials();
        let mut radiosity = exitance.clone();
        let terms = reflectance.values().iter().zip(irradiance.values());
        for (b, (rho, h)) in radiosity.values_mut().iter_mut().zip(terms) {
            *b += rho * h;
        }
        run.cx.judge_leaking_power((&reflectance, &exitance), &radiosity);
        let input = RenderInput {
            scene: &model.scene,
            mesh: &model.mesh,
            visibility: &model.visibility,
            radiosity: &radiosity,
            irradiance: &irradiance,
            indirect_irradiance: None,
            error: None,
        };
        run.cx.time("render", || {
            crate::render::render(&input, view.as_view(), &settings, &run.cx.progress())
        })?
    };
    run.cx.audited(audit::picture(&image));
    // A picture of the voxels themselves has other layers.
    if !args.show_voxels {
        warn_if_blank(&image, view.as_view(), view.camera_name().as_deref(), &run.cx);
    }
    let attributes = Attributes::new(
        &model.scene,
        view.as_view().description(),
        settings,
        crate::visibility::Visibility::offset(&model.visibility),
        json!(run.cx.settings),
    );
    run.cx.time("write", || {
        exr::write(path, &image, &attributes)?;
        png::write(&path.with_extension("png"), &image)
    })?;
    Ok(Some(view))
}
