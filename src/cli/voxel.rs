//! `radiosity voxel`.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::args::{LinksName, VoxelArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::pipeline::{Prepared, Run, go_on};
use super::{Outcome, merge, output, render};
use crate::audit::{self, Given};
use crate::matrix::operator::{Block, LinearOperator};
use crate::mesh::Subdivision;
use crate::render::{Attributes, DirectMethod, RenderInput, RenderSettings, exr, png};
use crate::report::voxels::write_vtu;
use crate::scene::Scene;
use crate::solver::{self, RadiositySystem, SolveOptions, SolverSettings, StopReason, Tolerance};
use crate::voxel::{
    AdaptiveSettings, DiscreteSphere, Form, Grid, LinkOperator, Links, Materials, RowWeights, SolidAngle, ThinGap,
    VoxelScene, onto_patches, picture, propagate, solve_adaptively,
};

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
    if let Some(path) = &args.output {
        output::expect_possible(path)?;
    }
    let mut prepared = run.prepare(&args.scene, args.mesh, |scene| match format {
        // Without a picture the patches play no part.
        None | Some(Format::Vtu) => Subdivision::Uniform(1),
        Some(Format::Image) => match Grid::new(scene, args.voxels) {
            Ok(grid) => Subdivision::MaxEdge(PATCH_VOXELS * grid.voxel_size),
            Err(_) => Subdivision::Uniform(1),
        },
    })?;
    let voxels = run
        .times
        .time("discretise", || VoxelScene::new(&prepared.scene, args.voxels))?;
    let solid_angle = if args.exact_solid_angles {
        SolidAngle::Exact
    } else {
        SolidAngle::Centre
    };
    let sphere = DiscreteSphere::new(args.radius, solid_angle)?;
    run.set("voxels", args.voxels);
    run.set("radius", args.radius);
    run.set("exact_solid_angles", args.exact_solid_angles);
    run.set("unnormalised", args.unnormalised);
    run.set("plain_emission", args.plain_emission);
    let gaps = run.times.time("checks", || voxels.thin_gaps(&prepared.scene));
    warn_of_gaps(run, &prepared.scene, &gaps, args.voxels);
    let leaks = if prepared.plan.watertight {
        run.times.time("checks", || voxels.reached_from_outside())
    } else {
        prepared
            .plan
            .left_out
            .push("search for leaks: the scene's faces do not close a space".into());
        Vec::new()
    };
    warn_of_leaks(run, &prepared.scene, &voxels, &leaks);
    let hausdorff = run.times.time("checks", || voxels.hausdorff_distance(&prepared.scene));
    let (solved, links) = match args.adaptive {
        Some(tolerance) => solve_on_cells(run, &mut prepared, &voxels, &sphere, args, tolerance)?,
        None => solve_on_voxels(run, &mut prepared, &voxels, &sphere, args)?,
    };
    write(run, &prepared, &voxels, &solved, args, format)?;
    run.progress.finish();

    let checked = Checked { gaps, leaks, hausdorff };
    let mut result = to_json(&prepared.scene, &voxels, &sphere, &links, &checked);
    result["surfaces"] = surfaces(&prepared.scene, &voxels, &solved.radiosity);
    merge(&mut result, solved.document);
    if let Some(path) = &args.output {
        result["output"] = json!(path.display().to_string());
    }
    let mut text = run.explanation(&prepared);
    describe(&mut text, &voxels, &sphere, &links);
    let _ = writeln!(text, "{}", solved.line);
    describe_surfaces(&mut text, &prepared.scene, &voxels, &solved.radiosity);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    if let Some(path) = &args.output {
        let _ = writeln!(text, "wrote {}", path.display());
    }
    Ok(Outcome {
        text,
        document: run.document_of(&prepared, result),
        code: run.judged(solved.code, args.audit.strict),
    })
}

/// What the checks of the discretisation found.
struct Checked {
    gaps: Vec<ThinGap>,
    /// Surfels that are reached from outside.
    leaks: Vec<u32>,
    /// The Hausdorff distance from the scene, in voxels.
    hausdorff: Option<f64>,
}

/// How many links there are, and what they take.
#[expect(clippy::struct_field_names, reason = "counts are named n_ everywhere")]
struct LinkFigures {
    n_links: u64,
    n_backs: u64,
    n_escaped: u64,
    n_bytes: u64,
}

fn to_json(
    scene: &Scene,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    links: &LinkFigures,
    checked: &Checked,
) -> Value {
    json!({
        "n_voxels": voxels.octree.n_voxels(),
        "n_surfels": voxels.n_surfels(),
        "lattice": voxels.grid.n_voxels,
        "voxel_size_m": voxels.grid.voxel_size,
        "n_directions": sphere.directions().len(),
        "n_links": links.n_links,
        "n_escaped": links.n_escaped,
        "n_backs": links.n_backs,
        "link_byte": links.n_bytes,
        "octree_byte": voxels.octree.n_bytes(),
        "surfel_byte": voxels.n_bytes() - voxels.octree.n_bytes(),
        "n_leaks": checked.leaks.len(),
        "hausdorff_distance_voxel": checked.hausdorff,
        "thin_gaps": gaps_to_json(scene, &checked.gaps),
    })
}

fn describe(text: &mut String, voxels: &VoxelScene, sphere: &DiscreteSphere, links: &LinkFigures) {
    let [x, y, z] = voxels.grid.n_voxels;
    let _ = writeln!(
        text,
        "{x} × {y} × {z} voxels of {:.4e} m, {} of them surface, {} unknowns, octree {}",
        voxels.grid.voxel_size,
        voxels.octree.n_voxels(),
        voxels.n_surfels(),
        mebibytes(voxels.octree.n_bytes() as f64)
    );
    let _ = writeln!(
        text,
        "{} directions, {} links in {} ({:.2} bytes a link); {} end at backs, {} leave the scene",
        sphere.directions().len(),
        links.n_links,
        mebibytes(links.n_bytes as f64),
        links.n_bytes as f64 / (links.n_links.max(1)) as f64,
        links.n_backs,
        links.n_escaped
    );
}

/// Bytes for a link, by which the plan reckons: measured, 1.3 to 2.3, the less the more directions there are.
const BYTES_PER_LINK: u64 = 2;

/// Solves with one unknown for each surfel.
fn solve_on_voxels(
    run: &mut Run,
    prepared: &mut Prepared,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    args: &VoxelArgs,
) -> Result<(Solved, LinkFigures), Failure> {
    let links = find_links(run, prepared, voxels, sphere, args)?;
    run.go_on()?;
    let operator = LinkOperator::new(voxels, sphere, &links, row_weights(args));
    let solved = solve(run, prepared, &operator, args);
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
    prepared: &mut Prepared,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    args: &VoxelArgs,
    tolerance: f64,
) -> Result<(Solved, LinkFigures), Failure> {
    run.set("adaptive", tolerance);
    run.set("coarsest", args.coarsest);
    run.set("passes", args.passes);
    prepared
        .plan
        .decide("links", "memory", "those of cells, as they are cut".to_owned());
    let materials = Materials::new(&prepared.scene, voxels, prepared.plan.n_channels);
    let settings = AdaptiveSettings {
        coarsest: args.coarsest,
        tolerance,
        n_passes: args.passes,
        row_weights: row_weights(args),
    };
    let emission = emission(&materials, args);
    let result = run.times.time("cells", || {
        solve_adaptively(
            &prepared.scene,
            voxels,
            sphere,
            &materials.reflectance,
            emission,
            &settings,
            &run.progress,
        )
    });
    run.go_on()?;
    // The light of surfels spread over cells and back; their rows sum to 1 at most.
    let row_sums = vec![1.0; voxels.n_surfels()];
    if !args.unnormalised {
        let (b, h) = (&result.radiosity, &result.irradiance);
        run.audited(audit::propagation(&materials.reflectance, emission, &row_sums, b, h));
    }
    let n_cells = result.cells.n_cells();
    let figures = LinkFigures {
        n_links: result.n_links,
        n_backs: result.n_backs,
        n_escaped: result.n_escaped,
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

/// Finds the links and keeps them where they fit.
fn find_links(
    run: &mut Run,
    prepared: &mut Prepared,
    voxels: &VoxelScene,
    sphere: &DiscreteSphere,
    args: &VoxelArgs,
) -> Result<Links, Failure> {
    let n_directions = sphere.directions().len() as u64;
    let expected = BYTES_PER_LINK * voxels.n_surfels() as u64 * n_directions / 2;
    let (kept, reason) = match args.links {
        LinksName::Auto if expected <= args.memory_limit => (LinksName::Memory, "they fit"),
        LinksName::Auto => (LinksName::Disk, "they do not fit into memory"),
        asked => (asked, "asked for"),
    };
    let size = format!("about {}, {reason}", mebibytes(expected as f64));
    let choice = match kept {
        LinksName::Memory | LinksName::Auto => "memory",
        LinksName::Disk => "disk",
        LinksName::Recompute => "recompute",
    };
    prepared.plan.decide("links", choice, size);
    Ok(match kept {
        LinksName::Memory | LinksName::Auto => run
            .times
            .time("links", || Links::in_memory(voxels, sphere, &run.progress)),
        LinksName::Recompute => Links::recomputed(voxels, sphere),
        LinksName::Disk => {
            let path = args
                .link_file
                .clone()
                .unwrap_or_else(|| args.scene.with_extension("links"));
            run.times
                .time("links", || Links::on_disk(voxels, sphere, &path, &run.progress))?
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
    if args.image.direct.is_some() || args.image.direct_samples.is_some() {
        return Err(Failure::usage(
            "--direct: voxels show their own light; use `radiosity render` for a direct pass",
        ));
    }
    Ok(())
}

/// Names of the surfaces of at most three gaps: a line is for reading.
fn warn_of_gaps(run: &Run, scene: &Scene, gaps: &[ThinGap], n: u32) {
    if gaps.is_empty() {
        return;
    }
    let name = |id: crate::scene::SurfaceId| scene.surfaces[id.0 as usize].name.as_str();
    let pair = |gap: &ThinGap| format!("{} and {}", name(gap.surfaces[0]), name(gap.surfaces[1]));
    let named: Vec<String> = gaps.iter().take(3).map(pair).collect();
    let more = gaps.len().saturating_sub(3);
    let others = if more > 0 {
        format!(" and {more} other pairs")
    } else {
        String::new()
    };
    run.warn(&format!(
        "at {n} voxels along the longest axis less than two voxels lie between {}{others}; the light in such gaps is not resolved, give --voxels a larger number",
        named.join(", ")
    ));
}

fn warn_of_leaks(run: &Run, scene: &Scene, voxels: &VoxelScene, leaks: &[u32]) {
    if leaks.is_empty() {
        return;
    }
    let mut surfaces: Vec<u32> = leaks
        .iter()
        .map(|&s| scene.faces[voxels.surfels[s as usize].face.0 as usize].surface.0)
        .collect();
    surfaces.sort_unstable();
    surfaces.dedup();
    let names: Vec<&str> = surfaces
        .iter()
        .take(5)
        .map(|&s| scene.surfaces[s as usize].name.as_str())
        .collect();
    run.warn(&format!(
        "{} voxels of a closed scene can be reached from outside, on {}; it leaks there, give --voxels a larger number",
        leaks.len(),
        names.join(", ")
    ));
}

fn gaps_to_json(scene: &Scene, gaps: &[ThinGap]) -> Value {
    let name = |id: crate::scene::SurfaceId| scene.surfaces[id.0 as usize].name.as_str();
    gaps.iter()
        .map(|gap| json!({"surfaces": gap.surfaces.map(name), "n_surfels": gap.n_surfels}))
        .collect()
}

fn solve(run: &mut Run, prepared: &Prepared, operator: &LinkOperator<'_>, args: &VoxelArgs) -> Result<Solved, Failure> {
    let materials = Materials::new(&prepared.scene, operator.scene(), prepared.plan.n_channels);
    let emission = emission(&materials, args);
    let Some(name) = args.solver.as_deref() else {
        let form: Form = args.form.into();
        run.set("form", json!(form));
        run.set("passes", args.passes);
        let result = run.times.time("propagation", || {
            propagate(
                operator,
                &materials.reflectance,
                emission,
                form,
                args.passes,
                &run.progress,
            )
        });
        run.go_on()?;
        let mut row_sums = Block::zeros(operator.n_rows(), 1);
        let ones = Block::from_values(vec![1.0; operator.n_rows()], 1);
        let (b, h) = (&result.radiosity, &result.irradiance);
        let found = run.times.time("audit", || {
            operator.apply(&ones, &mut row_sums);
            audit::propagation(&materials.reflectance, emission, row_sums.values(), b, h)
        });
        run.audited(found);
        let last = result.changes.last().copied().unwrap_or(0.0);
        return Ok(Solved {
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
    run.set("solver", name);
    run.set("tolerance", args.tolerance);
    let system = RadiositySystem::new(
        operator,
        operator.scene().areas(),
        materials.reflectance.clone(),
        emission.clone(),
    )?;
    let options = SolveOptions {
        tolerance: Tolerance::ResidualL2(args.tolerance),
        ..SolveOptions::default()
    };
    let solver = solver::solver(name, &SolverSettings::default())?;
    let solution = run.times.time("solve", || {
        solver.solve(&system, &options, &mut |_| go_on(&run.progress))
    })?;
    run.go_on()?;
    let given = Given {
        gain: None,
        costly: args.links == LinksName::Recompute,
    };
    let found = run.times.time("audit", || audit::solution(&system, &solution, given))?;
    run.audited(found);
    let converged = solution.stop_reason == StopReason::Converged;
    Ok(Solved {
        document: json!({
            "solver": name,
            "stop_reason": solution.stop_reason,
            "n_passes": solution.n_passes,
            "residual_l2": solution.residual_l2,
            "residual_max_power": solution.residual_max_power,
            "error_bound": solution.error_bound,
            "history": solution.history,
        }),
        line: format!(
            "{name}: {} after {} passes, relative residual {:.1e}",
            solution.stop_reason, solution.n_passes, solution.residual_l2
        ),
        radiosity: materials.radiosity(&solution.irradiance),
        irradiance: solution.irradiance,
        code: if converged {
            ExitCode::Done
        } else {
            ExitCode::NotConverged
        },
    })
}

fn write(
    run: &mut Run,
    prepared: &Prepared,
    voxels: &VoxelScene,
    solved: &Solved,
    args: &VoxelArgs,
    format: Option<Format>,
) -> Result<(), Failure> {
    let (Some(path), Some(format)) = (&args.output, format) else {
        return Ok(());
    };
    if format == Format::Vtu {
        let description = json!({"format": "radiosity voxels 1", "settings": run.settings}).to_string();
        return Ok(run.times.time("write", || {
            write_vtu(
                path,
                &prepared.scene,
                voxels,
                &solved.radiosity,
                &solved.irradiance,
                &description,
            )
        })?);
    }
    let view = render::view(&args.image.view, &args.scene, &prepared.scene)?;
    let settings = RenderSettings {
        flat: args.image.flat,
        samples: std::num::NonZeroU32::new(args.image.view.samples.unwrap_or(2)).unwrap_or(std::num::NonZeroU32::MIN),
        direct: DirectMethod::Off,
        ..RenderSettings::default()
    };
    run.set("show_voxels", args.show_voxels);
    let image = if args.show_voxels {
        run.times
            .time("render", || picture(voxels, &solved.radiosity, view.as_view()))
    } else {
        let irradiance = run.times.time("display", || {
            onto_patches(voxels, &prepared.scene.faces, &prepared.mesh, &solved.irradiance)
        });
        let (reflectance, exitance) = prepared.materials();
        let mut radiosity = exitance;
        let terms = reflectance.values().iter().zip(irradiance.values());
        for (b, (rho, h)) in radiosity.values_mut().iter_mut().zip(terms) {
            *b += rho * h;
        }
        let input = RenderInput {
            scene: &prepared.scene,
            mesh: &prepared.mesh,
            visibility: &prepared.visibility,
            radiosity: &radiosity,
            irradiance: &irradiance,
            indirect_irradiance: None,
            error: None,
        };
        run.times.time("render", || {
            crate::render::render(&input, view.as_view(), &settings, &run.progress)
        })?
    };
    run.audited(audit::picture(&image));
    let attributes = Attributes::new(
        &prepared.scene,
        view.as_view().description(),
        settings,
        crate::visibility::Visibility::offset(&prepared.visibility),
        json!(run.settings),
    );
    Ok(run.times.time("write", || {
        exr::write(path, &image, &attributes)?;
        png::write(&path.with_extension("png"), &image)
    })?)
}

/// Returns name, area, number of surfels and mean radiosity of each surface.
fn surfaces(scene: &Scene, voxels: &VoxelScene, radiosity: &Block) -> Value {
    let (areas, counts, means) = surface_means(scene, voxels, radiosity);
    let surface = |(k, s): (usize, &crate::scene::Surface)| json!({"name": s.name, "area_m2": areas[k], "n_voxels": counts[k], "radiosity": means[k]});
    scene.surfaces.iter().enumerate().map(surface).collect()
}

fn surface_means(scene: &Scene, voxels: &VoxelScene, radiosity: &Block) -> (Vec<f64>, Vec<u64>, Vec<Vec<f64>>) {
    let n = scene.surfaces.len();
    let (mut areas, mut counts) = (vec![0.0; n], vec![0; n]);
    let mut means = vec![vec![0.0; radiosity.n_channels()]; n];
    for (i, surfel) in voxels.surfels.iter().enumerate() {
        let k = scene.faces[surfel.face.0 as usize].surface.0 as usize;
        areas[k] += surfel.area;
        counts[k] += 1;
        for (mean, value) in means[k].iter_mut().zip(radiosity.row(i)) {
            *mean += surfel.area * value;
        }
    }
    for (mean, area) in means.iter_mut().zip(&areas) {
        if *area > 0.0 {
            for channel in mean {
                *channel /= area;
            }
        }
    }
    (areas, counts, means)
}

/// The most surfaces that are listed for people; the document has all.
const LISTED: usize = 40;

fn describe_surfaces(text: &mut String, scene: &Scene, voxels: &VoxelScene, radiosity: &Block) {
    let (_, _, means) = surface_means(scene, voxels, radiosity);
    let _ = writeln!(text, "\nmean radiosity by surface, W/m²");
    let width = scene.surfaces.iter().map(|s| s.name.chars().count()).max().unwrap_or(0);
    for (surface, mean) in scene.surfaces.iter().zip(&means).take(LISTED) {
        let _ = write!(text, "{:width$}", surface.name);
        for value in mean {
            let _ = write!(text, " {value:>12.6}");
        }
        let _ = writeln!(text);
    }
    if means.len() > LISTED {
        let _ = writeln!(text, "... and {} more, all of them with --json", means.len() - LISTED);
    }
    let _ = writeln!(text);
}

fn mebibytes(bytes: f64) -> String {
    format!("{:.1} MiB", bytes / f64::from(1 << 20))
}
