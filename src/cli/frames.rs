//! `radiosity render --frames`: a sequence of lightings, cameras and poses, with the form factors computed once as far as they stay the same.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::args::{RenderArgs, ViewArgs};
use super::checks::{checks_to_json, describe_checks};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::lightings::{greatest_reflectance, with_suffix};
use super::picture::{preview_of, shoot};
use super::run::Run;
use super::surfaces::surfaces_with_radiosity;
use super::view::{AnyView, demand, render_settings, view};
use super::{Outcome, merge, solution};
use crate::form_factor::{Before, Change};
use crate::matrix::FormFactors;
use crate::matrix::operator::LinearOperator;
use crate::printable::counted;
use crate::render::MAX_PICTURE_EXITANCE;
use crate::render::{DirectMethod, RenderInput, RenderSettings};
use crate::scene::{Lighting, Motion, Pose, frames};
use crate::solver::{Coarsened, Solution, StopReason};
use crate::workflow::{
    Afterwards, FormFactorStudy, Model, Stack, TotalError, WorkflowError, gathered, image_byte, image_patches,
    indirect_irradiance,
};

/// A frame, ready to be rendered.
struct Frame {
    name: String,
    /// The number of its lighting.
    lighting: usize,
    lighting_file: Option<PathBuf>,
    /// The number of its pose.
    pose: usize,
    motions: Vec<Motion>,
    view: AnyView,
    settings: RenderSettings,
    output: PathBuf,
    preview: PathBuf,
}

/// All frames, with what some of them share.
struct Sequence {
    frames: Vec<Frame>,
    lightings: Vec<Option<Lighting>>,
    lighting_files: Vec<Option<PathBuf>>,
    /// No two alike, in the order of their first frames.
    poses: Vec<Pose>,
}

pub(super) fn work(args: &RenderArgs, file: &Path, run: &mut Run) -> Result<Outcome, Failure> {
    let wanted = frames::load(file)?;
    run.has_lightings = true;
    run.expect(&args.storage, demand(args));
    let model = run.prepare(&args.scene, args.mesh, image_patches)?;
    let all = ready(args, file, wanted, &model)?;
    let files = all.lighting_files.iter().map(Option::as_deref);
    let lightings: Vec<_> = files.zip(all.lightings.iter().map(Option::as_ref)).collect();
    run.warn_of_darkness(&model, &lightings);
    let mut largest = 0;
    for frame in &all.frames {
        largest = largest.max(image_byte(frame.view.as_view(), &frame.settings, &run.cx.memory)?);
    }
    run.cx.demand.image_byte = largest;
    run.cx.demand.reflectance_max = greatest_reflectance(all.lightings.iter().flatten());
    if all
        .frames
        .iter()
        .any(|frame| frame.settings.direct != DirectMethod::Off)
    {
        model.warn_of_narrow_gaps(&run.cx);
    }
    let mut first: Option<First> = None;
    let mut told = Vec::new();
    for number in 0..all.poses.len() {
        let (pose, of_first) = all.work_on(number, args, run, &model, first.as_ref())?;
        first = first.or(Some(of_first));
        told.push(pose);
    }
    run.bars.finish();
    let Some(First { model: posed, .. }) = first else {
        return Err(Failure::usage("there is no frame"));
    };
    let mut result = worst(&told);
    let shots = || told.iter().flat_map(|pose: &Told| &pose.shots);
    let in_order = (0..all.frames.len()).filter_map(|k| shots().find(|shot| shot.frame == k));
    result["n_lightings"] = json!(all.lightings.len());
    result["poses"] = told.iter().map(|pose| pose.document.clone()).collect();
    result["frames"] = in_order.clone().map(|shot| shot.document.clone()).collect();
    let document = run.document_of(&posed, result);
    let mut text = run.explanation(&posed);
    let (n, n_frames) = (posed.mesh.n_patches(), all.frames.len());
    let _ = writeln!(text, "{n} patches, {}", counted(n_frames, "frame"));
    text.extend(told.iter().map(|pose| pose.text.as_str()));
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    text.extend(in_order.map(|shot| shot.line.as_str()));
    let not_done = told.iter().map(|pose| pose.code).find(|code| *code != ExitCode::Done);
    let is_noisy = shots().any(|shot| shot.is_noisy);
    let code = not_done.unwrap_or(if is_noisy {
        ExitCode::NotConverged
    } else {
        ExitCode::Done
    });
    Ok(Outcome {
        text,
        document,
        code: run.judged(code, args.audit.strict),
    })
}

/// What the later poses and the report need of the first one.
struct First {
    model: Model,
    /// The form factors without repairs, and whether they met their tolerance.
    raw: FormFactors,
    tolerance_met: bool,
}

/// What is told of a pose.
struct Told {
    document: Value,
    /// What the document says of its solution and form factors.
    result: Value,
    stop_reason: StopReason,
    tolerance_met: bool,
    text: String,
    code: ExitCode,
    shots: Vec<Shot>,
}

/// Returns what the document says first: of the pose whose solution is worst, with the worst figures of all poses.
fn worst(poses: &[Told]) -> Value {
    let number = |pose: &Told, name: &str| pose.result[name].as_f64();
    let order = |a: &&Told, b: &&Told| {
        let rank = |pose: &Told| (severity(pose.stop_reason), !pose.tolerance_met);
        let residual = |pose: &Told| number(pose, "residual_l2").unwrap_or(f64::INFINITY);
        rank(a).cmp(&rank(b)).then(residual(a).total_cmp(&residual(b)))
    };
    let mut result = poses
        .iter()
        .max_by(order)
        .map_or(Value::Null, |pose| pose.result.clone());
    for name in [
        "residual_l2",
        "residual_max_power",
        "error_bound",
        "estimated_relative_error",
    ] {
        let of_all: Option<Vec<f64>> = poses.iter().map(|pose| number(pose, name)).collect();
        result[name] = json!(of_all.map(|values| values.into_iter().fold(0.0, f64::max)));
    }
    result
}

/// Returns how bad the end of a solver is, beside others.
fn severity(reason: StopReason) -> u8 {
    match reason {
        StopReason::Converged => 0,
        StopReason::MaxPasses => 1,
        StopReason::Stagnated => 2,
        _ => 3,
    }
}

impl Sequence {
    /// Computes, solves and renders all that is in one pose.
    fn work_on(
        &self,
        number: usize,
        args: &RenderArgs,
        run: &mut Run,
        as_loaded: &Model,
        first: Option<&First>,
    ) -> Result<(Told, First), Failure> {
        let own: Vec<(usize, &Frame)> = self
            .frames
            .iter()
            .enumerate()
            .filter(|(_, f)| f.pose == number)
            .collect();
        let mut model = as_loaded.posed(&self.poses[number], &mut run.cx)?;
        let solver = args.solver.request();
        let request = run.request(&args.method, args.form_factor_tolerance, Afterwards::Image);
        let need = run.cx.memory.or_symmetry(request.balance, solver.need(&run.cx)?)?;
        let change = first.map(|first| Change::between(&first.model.scene, &model.scene));
        // Patches that are others than before have no form factors yet.
        let has_same_patches = !model.is_cut_anew && first.is_none_or(|first| !first.model.is_cut_anew);
        let known = first.zip(change.as_ref()).filter(|_| has_same_patches);
        let before = known.map(|(known, since)| Before {
            factors: &known.raw,
            tolerance_met: known.tolerance_met,
            change: since,
        });
        run.cx.demand.part = u32::try_from(number).unwrap_or(u32::MAX);
        let raw = model.raw_form_factors(&request, need, before, &mut run.cx)?;
        let (factors, tolerance_met) = (raw.computed.factors.clone(), raw.computed.tolerance_met);
        let computed = model.repaired(raw, &request, need, &mut run.cx)?;
        // Those of the lightings that this pose is seen in.
        let mut numbers: Vec<usize> = own.iter().map(|(_, frame)| frame.lighting).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let lightings: Vec<Option<Lighting>> = numbers.iter().map(|&k| self.lightings[k].clone()).collect();
        let stack = Stack::new(&model, &lightings);
        let files: Vec<Option<PathBuf>> = numbers.iter().map(|&k| self.lighting_files[k].clone()).collect();
        stack.announce(&mut model, &files, &mut run.cx);
        let areas = computed.factors.areas().to_vec();
        let system = (&computed.factors as &dyn LinearOperator, areas);
        let materials = (stack.reflectance.clone(), stack.exitance.clone());
        let solution = model.solve_system(system, &solver, materials, computed.known(), &mut run.cx)?;
        let coarse = model.coarsened(&computed, &stack.reflectance, &solution, &run.cx)?;
        let solved = Solved {
            coarse: coarse.as_ref(),
            model: &model,
            computed: &computed,
            lightings: &self.lightings,
            numbers: &numbers,
            stack: &stack,
            solution: &solution,
        };
        let shots = own
            .iter()
            .map(|&(k, frame)| solved.shoot(run, args, k, frame))
            .collect::<Result<Vec<_>, _>>()?;
        let stated = shots.iter().map(|shot| shot.stated);
        let stated = stated.fold(TotalError::Relative(0.0), TotalError::or_worse);
        let mut result = solution::to_json(&model, &args.solver.solver, &solution, stated);
        if let Value::Object(result) = &mut result {
            // Each frame has its own.
            result.remove("surfaces");
            result.remove("energy");
        }
        result["form_factors"] = checks_to_json(&computed);
        let names: Vec<&str> = own.iter().map(|(_, frame)| frame.name.as_str()).collect();
        let update = change.as_ref().map(|change| Update::new(change, &computed));
        let mut document = json!({
            "frames": names,
            "n_lightings": numbers.len(),
            "solver": result["solver"],
            "why": result["why"],
            "n_passes": solution.n_passes,
            "form_factors": result["form_factors"],
            "update": update,
        });
        merge(&mut document, solution::quality_to_json(&solution, stated));
        let line = solution::solver_line(&args.solver.solver, &solution, stated);
        let told = Told {
            text: describe_pose(&names, (numbers.len(), &line, &computed), update.as_ref()),
            code: solution::code(&solution, Some(&computed), stated),
            document,
            result,
            stop_reason: solution.stop_reason,
            tolerance_met,
            shots,
        };
        let of_first = First {
            raw: factors,
            tolerance_met,
            model,
        };
        Ok((told, of_first))
    }
}

/// What became of the first pose's form factors in a later one.
#[derive(serde::Serialize)]
#[expect(clippy::struct_field_names, reason = "the names of the document")]
struct Update {
    n_moved_faces: usize,
    /// Pairs of patches that face each other and were taken over; 0 where the method computes everything anew.
    n_kept: u64,
    /// Pairs that face each other and were computed anew; `None` of methods that do not look at pairs.
    n_recomputed: Option<u64>,
}

impl Update {
    fn new(change: &Change, computed: &FormFactorStudy) -> Self {
        Self {
            n_moved_faces: change.n_faces(),
            n_kept: computed.pairs.map_or(0, |pairs| pairs.kept),
            n_recomputed: computed.pairs.map(|pairs| pairs.full + pairs.partial + pairs.hidden),
        }
    }

    fn describe(&self, text: &mut String) {
        let Self {
            n_moved_faces, n_kept, ..
        } = self;
        let _ = match self.n_recomputed {
            Some(n) if *n_kept > 0 => writeln!(
                text,
                "{n_moved_faces} faces moved: {n} of {} form factors between pairs computed anew, the others are as before",
                n + n_kept
            ),
            _ => writeln!(text, "{n_moved_faces} faces moved: all form factors computed anew"),
        };
    }
}

/// Writing to a String cannot fail; the results of `write!` are dropped for that reason.
fn describe_pose(
    names: &[&str],
    (n_lightings, solver_line, computed): (usize, &str, &FormFactorStudy),
    update: Option<&Update>,
) -> String {
    let mut text = String::new();
    let lightings = match n_lightings {
        1 => "1 lighting".to_owned(),
        n => format!("{n} lightings solved together"),
    };
    let _ = writeln!(text, "{}: {lightings}", names.join(", "));
    let _ = writeln!(text, "{solver_line}");
    if let Some(update) = update {
        update.describe(&mut text);
    }
    describe_checks(&mut text, computed);
    text
}

/// What the frames of a pose are made from.
struct Solved<'a> {
    model: &'a Model,
    computed: &'a FormFactorStudy,
    lightings: &'a [Option<Lighting>],
    /// The lightings that were solved for.
    numbers: &'a [usize],
    stack: &'a Stack,
    /// Of all these lightings together.
    solution: &'a Solution,
    /// What a coarser mesh would change in it.
    coarse: Option<&'a Coarsened>,
}

/// What is told of a frame.
struct Shot {
    /// The number of the frame.
    frame: usize,
    document: Value,
    line: String,
    /// True if final gather left pixels above the noise asked for.
    is_noisy: bool,
    /// The relative error that solver and form factors together state.
    stated: TotalError,
}

impl Solved<'_> {
    fn shoot(&self, run: &mut Run, args: &RenderArgs, number: usize, frame: &Frame) -> Result<Shot, Failure> {
        let Self { model, computed, .. } = self;
        let place = self.numbers.partition_point(|&k| k < frame.lighting);
        let own = self.stack.solution(place, self.solution);
        let (reflectance, exitance) = self.stack.materials(place);
        let indirect = run
            .cx
            .time("solve", || indirect_irradiance(&computed.factors, &exitance, &own));
        let error = computed.carried_error((&reflectance, &exitance), &own, &run.cx)?;
        let coarse = self.coarse.map(|coarse| self.stack.coarsened(place, coarse));
        let mesh_error = model.mesh_error(coarse.as_ref(), (&exitance, &own), &run.cx);
        let stated = TotalError::of(model, error.as_ref(), &own, &run.cx);
        computed.factors.if_readable(())?;
        let lighting = self.lightings[frame.lighting].as_ref();
        let lit = lighting.map(|lighting| lighting.apply(&model.scene));
        let input = RenderInput {
            scene: lit.as_ref().unwrap_or(&model.scene),
            mesh: &model.mesh,
            visibility: &model.visibility,
            radiosity: &own.radiosity,
            irradiance: &own.irradiance,
            indirect_irradiance: Some(&indirect),
            error: error.as_ref(),
        };
        let output = (frame.output.as_path(), frame.preview.as_path());
        let image = shoot(run, &input, &frame.view, frame.settings, args, output)?;
        let gather = gathered(&image, frame.settings, &frame.output, &run.cx);
        let (width, height) = (image.width(), image.height());
        let (picture, preview) = (frame.output.display(), frame.preview.display());
        let mut document = json!({
            "name": frame.name,
            "lighting": frame.lighting_file,
            "moves": frame.motions,
            "camera": frame.view.describe_camera(),
            "image": frame.output,
            "preview": frame.preview,
            "width": width,
            "height": height,
            "final_gather": gather,
            "mesh_error": mesh_error,
            "energy": own.energy,
            "surfaces": surfaces_with_radiosity(model, &own),
        });
        merge(&mut document, solution::quality_to_json(&own, stated));
        Ok(Shot {
            frame: number,
            stated,
            line: format!("{}: wrote {picture} ({width} × {height}) and {preview}\n", frame.name),
            is_noisy: gather.is_some_and(|report| report.n_above > 0),
            document,
        })
    }
}

/// Adds the place in a list of frames that names the file at fault.
fn named_by(failure: Failure, list: &Path, line: u32, frame: &str) -> Failure {
    let message = format!(
        "{}; frame `{frame}` names it, {}:{line}",
        failure.message,
        list.display()
    );
    Failure { message, ..failure }
}

/// Prepares views and outputs, loads every lighting once, and finds the frames that share a pose.
fn ready(args: &RenderArgs, file: &Path, wanted: Vec<frames::Frame>, model: &Model) -> Result<Sequence, Failure> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut lighting_files: Vec<Option<PathBuf>> = Vec::new();
    let mut files = FileSet::default();
    files.keeps("the checkpoint", args.storage.checkpoint.as_deref());
    files.reads_scene(&args.scene, &args.common.reading);
    files.reads("the list of frames", Some(file));
    let mut lightings = Vec::new();
    let mut poses: Vec<Pose> = Vec::new();
    let mut frames = Vec::new();
    for frame in wanted {
        let (motions, pose) = (frame.motions(), frame.pose(file, &model.scene)?);
        let (line, name) = (frame.line, frame.name.clone());
        let in_list = |failure: Failure| named_by(failure, file, line, &name);
        let lighting_file = frame.lighting.map(|path| folder.join(path));
        let known = lighting_files.iter().position(|other| *other == lighting_file);
        let lighting = if let Some(k) = known {
            k
        } else {
            let loaded = lighting_file
                .as_ref()
                .map(|path| Lighting::load_up_to(path, &model.scene, MAX_PICTURE_EXITANCE));
            lightings.push(loaded.transpose().map_err(|error| in_list(error.into()))?);
            lighting_files.push(lighting_file.clone());
            lighting_files.len() - 1
        };
        let names_a_camera = frame.camera.is_some();
        let camera = frame.camera.map(|path| {
            if path == Path::new("unfolded") {
                path
            } else {
                folder.join(path)
            }
        });
        let view_args = ViewArgs {
            camera: camera.or(args.image.view.camera.clone()),
            ..args.image.view.clone()
        };
        // The camera stays where it would be of the scene as loaded; the tiles of an unfolded view go with their surfaces.
        let view = if view_args.is_unfolded() {
            view(
                &view_args,
                &args.scene,
                &model.scene.posed(&pose).map_err(WorkflowError::from)?,
            )
        } else {
            view(&view_args, &args.scene, &model.scene)
        };
        let view = if names_a_camera { view.map_err(in_list)? } else { view? };
        let output = with_suffix(&args.output, &frame.name);
        files.writes_picture(&format!("picture of frame `{}`", frame.name), &output);
        files.reads("a lighting", lighting_file.as_deref());
        files.reads("a camera", view_args.camera_file());
        frames.push(Frame {
            name: frame.name,
            lighting,
            lighting_file,
            settings: render_settings(args, &view_args)?,
            view,
            pose: poses.iter().position(|other| *other == pose).unwrap_or(poses.len()),
            motions,
            preview: preview_of(&output)?,
            output,
        });
        if !poses.contains(&pose) {
            poses.push(pose);
        }
    }
    files.check()?;
    Ok(Sequence {
        frames,
        lightings,
        lighting_files,
        poses,
    })
}
