//! `radiosity voxel`.

mod memory;
mod report;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use report::{
    Checked, LinkFigures, describe, describe_surfaces, describe_walls, surfaces, to_json, warn_of_escapes,
    warn_of_gaps, warn_of_leak, warn_of_leaks, warn_of_small_surfaces,
};

use super::args::{LinksName, VoxelArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::picture::warn_if_blank;
use super::render::AnyView;
use super::run::Run;
use super::{Outcome, merge, render, solve};
use crate::audit::{self, Given};
use crate::matrix::operator::{Block, LinearOperator};
use crate::mesh::Subdivision;
use crate::render::{Attributes, DirectMethod, RenderInput, RenderSettings, exr, png};
use crate::report::voxels::write_vtu;
use crate::solver::{self, RadiositySystem, SolveOptions, SolverError, SolverSettings, StopReason, Tolerance};
use crate::voxel::{
    AdaptiveSettings, DiscreteSphere, Form, Grid, Leak, LinkOperator, Links, Materials, RowWeights, SolidAngle,
    VoxelScene, onto_patches, picture, propagate, solve_adaptively,
};
use crate::workflow::{Model, TotalError, go_on};

/// Patches of the display, in voxels: fine enough to show what the voxels resolve.
const PATCH_VOXELS: f64 = 2.0;

/// What `-o` asks for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Format {
    Image,
    Vtu,
}

/// Radiosities of all surfels, and how they were reached.
struct Solved {
    radiosity: Block,
    irradiance: Block,
    /// How the document tells it.
    document: Value,
    /// How it is told to people.
    line: String,
    /// What passes closed surfaces, W, by channel.
    leak_power: Vec<f64>,
    code: ExitCode,
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
    model.state_closure(args.closure.closure(), &mut run.cx)?;
    memory::expect_voxels(&model, args, &run.cx.memory)?;
    let voxels = run
        .cx
        .time("discretise", || VoxelScene::new(&model.scene, args.voxels))?;
    let solid_angle = if args.exact_solid_angles {
        SolidAngle::Exact
    } else {
        SolidAngle::Centre
    };
    let sphere = DiscreteSphere::new(args.radius, solid_angle)?;
    let kept = memory::choose_links(&mut model, &voxels, &sphere, args, format, &run.cx.memory)?;
    run.cx.set("voxels", args.voxels);
    run.cx.set("radius", args.radius);
    run.cx.set("exact_solid_angles", args.exact_solid_angles);
    run.cx.set("unnormalised", args.unnormalised);
    run.cx.set("plain_emission", args.plain_emission);
    let small = run.cx.time("checks", || voxels.small_surfaces(&model.scene));
    warn_of_small_surfaces(run, &model.scene, &small, &voxels);
    let gaps = run.cx.time("checks", || voxels.thin_gaps(&model.scene));
    warn_of_gaps(run, &model.scene, &gaps, args.voxels);
    let leaks = if model.plan.watertight {
        run.cx.time("checks", || voxels.reached_from_outside())
    } else {
        model
            .plan
            .left_out
            .push("search for leaks: the scene's faces do not close a space".into());
        Vec::new()
    };
    warn_of_leaks(run, &model.scene, &voxels, &leaks);
    let hausdorff = run.cx.time("checks", || voxels.hausdorff_distance(&model.scene));
    let (solved, links) = match args.adaptive {
        Some(tolerance) => solve_on_cells(run, &mut model, &voxels, &sphere, args, tolerance)?,
        None => solve_on_voxels(run, &mut model, &voxels, &sphere, kept, args)?,
    };
    warn_of_escapes(run, &links, model.plan.watertight);
    run.cx.audited(audit::sides(&solved.leak_power));
    let materials = Materials::new(&model.scene, &voxels, model.plan.n_channels);
    let leak = Leak::new(&solved.leak_power, &voxels, &materials.exitance);
    warn_of_leak(run, &voxels, &leak);
    let view = write(run, &mut model, &voxels, &solved, args, format)?;
    run.bars.finish();

    let code = if leak.is_too_much() {
        ExitCode::NotConverged
    } else {
        solved.code
    };
    let checked = Checked {
        small,
        gaps,
        leaks,
        leak,
        hausdorff,
    };
    let mut result = to_json(&model.scene, &voxels, &sphere, &links, &checked);
    result["surfaces"] = surfaces(&model.scene, &voxels, &solved.radiosity);
    merge(&mut result, solved.document);
    if let Some(path) = &args.output {
        result["output"] = json!(path.display().to_string());
    }
    let mut text = run.explanation(&model);
    describe(&mut text, &voxels, &sphere, &links);
    describe_walls(&mut text, &voxels);
    let _ = writeln!(text, "{}", solved.line);
    describe_surfaces(&mut text, &model.scene, &voxels, &solved.radiosity);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    if let Some(view) = view {
        view.tell_camera(run, &mut text);
    }
    if let Some(path) = &args.output {
        let _ = writeln!(text, "wrote {}", path.display());
    }
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
    files.keeps("the link file", may_be_on_disk.then(|| link_file(args)).as_deref());
    files.reads_scene(&args.scene);
    files.reads("the camera", args.image.view.camera_file());
    files
}

/// Returns the file of links on disk.
fn link_file(args: &VoxelArgs) -> PathBuf {
    let beside = || args.scene.with_extension("links");
    args.link_file.clone().unwrap_or_else(beside)
}

/// Solves with one unknown for each surfel.
fn solve_on_voxels(
    run: &mut Run,
    model: &mut Model,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    kept: LinksName,
    args: &VoxelArgs,
) -> Result<(Solved, LinkFigures), Failure> {
    let links = find_links(run, voxels, sphere, kept, args)?;
    run.cx.go_on()?;
    let operator = LinkOperator::new(voxels, sphere, &links, row_weights(args));
    let solved = solve_to_tolerance(run, model, &operator, args);
    // What went wrong with the links explains whatever the solver made of it.
    if let Some(error) = links.failure() {
        return Err(error.into());
    }
    let figures = LinkFigures {
        n_links: links.n_links(),
        n_backs: links.n_backs(),
        n_escaped: links.n_escaped(),
        n_bytes: links.n_bytes(),
    };
    Ok((solved?, figures))
}

/// Solves with one unknown for each cell, cells as fine as the light asks for.
fn solve_on_cells(
    run: &mut Run,
    model: &mut Model,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    args: &VoxelArgs,
    tolerance: f64,
) -> Result<(Solved, LinkFigures), Failure> {
    run.cx.set("adaptive", tolerance);
    run.cx.set("coarsest", args.coarsest);
    run.cx.set("passes", args.passes);
    let materials = Materials::new(&model.scene, voxels, model.plan.n_channels);
    let settings = AdaptiveSettings {
        coarsest: args.coarsest,
        tolerance,
        n_passes: args.passes,
        row_weights: row_weights(args),
    };
    let emission = emission(&materials, args);
    let result = run.cx.time("cells", || {
        solve_adaptively(
            &model.scene,
            voxels,
            sphere,
            &materials.reflectance,
            emission,
            &settings,
            &run.cx.progress(),
        )
    });
    run.cx.go_on()?;
    // The light of surfels spread over cells and back; their rows sum to 1 at most.
    let row_sums = vec![1.0; voxels.n_surfels()];
    if !args.unnormalised {
        let (b, h) = (&result.radiosity, &result.irradiance);
        run.cx
            .audited(audit::propagation(&materials.reflectance, emission, &row_sums, b, h));
    }
    let n_cells = result.cells.n_cells();
    let figures = LinkFigures {
        n_links: result.n_links,
        n_backs: Some(result.n_backs),
        n_escaped: Some(result.n_escaped),
        n_bytes: result.link_byte,
    };
    let solved = Solved {
        document: json!({
            "n_passes": args.passes,
            "changes": result.changes,
            "n_cells": n_cells,
            "n_cells_by_level": result.cells.n_by_level(),
            "n_cells_by_round": result.n_cells,
        }),
        line: format!(
            "{n_cells} cells in place of {} unknowns, after {} rounds of cuts; {} propagations on each",
            voxels.n_surfels(),
            result.n_cells.len() - 1,
            args.passes
        ),
        radiosity: materials.radiosity(&result.irradiance),
        irradiance: result.irradiance,
        leak_power: result.leak_power,
        code: ExitCode::Done,
    };
    Ok((solved, figures))
}

/// Returns what goes into the system as E.
fn emission<'a>(materials: &'a Materials, args: &VoxelArgs) -> &'a Block {
    if args.plain_emission {
        &materials.exitance
    } else {
        &materials.emission
    }
}

fn row_weights(args: &VoxelArgs) -> RowWeights {
    if args.unnormalised {
        RowWeights::Plain
    } else {
        RowWeights::Normalised
    }
}

/// Finds the links and keeps them where the plan says.
fn find_links(
    run: &mut Run,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    kept: LinksName,
    args: &VoxelArgs,
) -> Result<Links, Failure> {
    Ok(match kept {
        LinksName::Memory | LinksName::Auto => run
            .cx
            .time("links", || Links::in_memory(voxels, sphere, &run.cx.progress())),
        LinksName::Recompute => Links::recomputed(voxels, sphere),
        LinksName::Disk => {
            let path = link_file(args);
            run.cx
                .time("links", || Links::on_disk(voxels, sphere, &path, &run.cx.progress()))?
        }
    })
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

fn solve_to_tolerance(
    run: &mut Run,
    model: &mut Model,
    operator: &LinkOperator<'_>,
    args: &VoxelArgs,
) -> Result<Solved, Failure> {
    let materials = Materials::new(&model.scene, operator.scene(), model.plan.n_channels);
    let emission = emission(&materials, args);
    let Some(name) = args.solver.as_deref() else {
        let form: Form = args.form.into();
        run.cx.set("form", json!(form));
        run.cx.set("passes", args.passes);
        let result = run.cx.time("propagation", || {
            propagate(
                operator,
                &materials.reflectance,
                emission,
                form,
                args.passes,
                &run.cx.progress(),
            )
        });
        run.cx.go_on()?;
        let mut row_sums = Block::zeros(operator.n_rows(), 1);
        let ones = Block::from_values(vec![1.0; operator.n_rows()], 1);
        let (b, h) = (&result.radiosity, &result.irradiance);
        let found = run.cx.time("audit", || {
            operator.apply(&ones, &mut row_sums);
            audit::propagation(&materials.reflectance, emission, row_sums.values(), b, h)
        });
        run.cx.audited(found);
        let last = result.changes.last().copied().unwrap_or(0.0);
        let under_way = under_way(&result.changes);
        if under_way > MOST_UNDER_WAY {
            run.warn(&format!(
                "after {} propagations light is still under way, {under_way:.1e} of what there is or more; give more --passes, or a --solver",
                args.passes
            ));
        }
        return Ok(Solved {
            leak_power: operator.leak_power(b),
            radiosity: materials.radiosity(&result.irradiance),
            irradiance: result.irradiance,
            document: json!({"form": form, "n_passes": args.passes, "changes": result.changes}),
            line: format!(
                "{} propagations; the last one changed the radiosity by {last:.1e} of itself",
                args.passes
            ),
            code: ExitCode::Done,
        });
    };
    run.cx.set("solver", name);
    run.cx.set("tolerance", args.tolerance);
    let system = RadiositySystem::new(
        operator,
        operator.scene().areas(),
        materials.reflectance.clone(),
        emission.clone(),
    )
    .map_err(|error| refused(run, model, operator.scene(), error))?;
    let options = SolveOptions {
        tolerance: Tolerance::ResidualL2(args.tolerance),
        ..SolveOptions::default()
    };
    let solver = solver::solver(name, &SolverSettings::default())?;
    let solved = run.cx.time("solve", || {
        solver.solve(&system, &options, &mut |_| go_on(&run.cx.progress()))
    });
    let solution = solved.map_err(|error| refused(run, model, operator.scene(), error))?;
    run.cx.go_on()?;
    let given = Given {
        gain: None,
        costly: args.links == LinksName::Recompute,
    };
    let found = run.cx.time("audit", || audit::solution(&system, &solution, given))?;
    run.cx.audited(found);
    if let Some(choice) = &solution.choice {
        model.plan.decide("solver", choice.solver, choice.why.to_string());
    }
    let converged = solution.stop_reason == StopReason::Converged;
    Ok(Solved {
        document: json!({
            "solver": solve::chosen(name, &solution),
            "why": solution.choice.as_ref().map(|choice| &choice.why),
            "stop_reason": solution.stop_reason,
            "n_passes": solution.n_passes,
            "residual_l2": solution.residual_l2,
            "residual_max_power": solution.residual_max_power,
            "error_bound": solution.error_bound,
            "history": solution.history,
        }),
        line: solve::solver_line(name, &solution, TotalError::Untold),
        leak_power: operator.leak_power(&solution.radiosity),
        radiosity: materials.radiosity(&solution.irradiance),
        irradiance: solution.irradiance,
        code: if converged {
            ExitCode::Done
        } else {
            ExitCode::NotConverged
        },
    })
}

/// Says of a system that a solver refuses what helps, with voxels.
fn refused(run: &Run, model: &Model, voxels: &VoxelScene, error: SolverError) -> Failure {
    if let SolverError::NeedsRows { .. } = error {
        return Failure::usage(format!(
            "{error}, which links have that are kept: leave --links recompute out, or take auto, jacobi, chebyshev, gmres or anderson"
        ));
    }
    let face = |surfel: usize| voxels.surfels.get(surfel).map(|surfel| surfel.face.0 as usize);
    let surface = |surfel| Some(model.scene.faces.get(face(surfel)?)?.surface);
    model.refused(error, surface, &run.cx).into()
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
    voxels: &VoxelScene,
    solved: &Solved,
    args: &VoxelArgs,
    format: Option<Format>,
) -> Result<Option<AnyView>, Failure> {
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
                &solved.radiosity,
                &solved.irradiance,
                &description,
            )
        })?;
        return Ok(None);
    }
    let view = render::view(&args.image.view, &args.scene, &model.scene)?;
    view.tell_left_out(run, model);
    let settings = render_settings(args);
    run.cx.set("show_voxels", args.show_voxels);
    let image = if args.show_voxels {
        run.cx
            .time("render", || picture(voxels, &solved.radiosity, view.as_view()))
    } else {
        let irradiance = run.cx.time("display", || {
            onto_patches(voxels, &model.scene.faces, &model.mesh, &solved.irradiance)
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
        warn_if_blank(run, &image, &view);
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

/// Light that is still under way, relative to what there is, from which it is warned of.
const MOST_UNDER_WAY: f64 = 0.05;

/// Returns what further propagations would add, by the changes of those that there were, each relative to what there was then: the rest of a geometric series.
fn under_way(changes: &[f64]) -> f64 {
    match *changes {
        [.., before, last] if last < before => last / (1.0 - last / before),
        [.., last] => last,
        [] => 0.0,
    }
}
