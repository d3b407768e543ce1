//! `radiosity render --frames`: a sequence of lightings and cameras on the same form factors.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::{Value, json};
use toml::Spanned;

use super::args::{RenderArgs, ViewArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::form_factors::{checks_to_json, describe_checks};
use super::lightings::{Stack, with_suffix};
use super::picture::{image_byte, preview_of, shoot};
use super::pipeline::{Computed, Fineness, Prepared, Run};
use super::render::{
    AnyView, DEFAULT_RAYS, DEFAULT_TOLERANCE, default_subdivision, indirect_irradiance, render_settings, view,
};
use super::storage::Storage;
use super::{Outcome, solve};
use crate::render::{DirectMethod, GatherReport, RenderInput, RenderSettings};
use crate::scene::Lighting;
use crate::solver::{Solution, carried_error};

/// A file of frames:
///
/// ```toml
/// [[frame]]
/// name = "noon"
/// lighting = "noon.toml"  # as for solve --lighting; without it, the scene's own
/// camera = "door.toml"    # a camera file or "unfolded"; without it, as the flags say
/// ```
///
/// Paths are relative to the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FramesFile {
    #[serde(default)]
    frame: Vec<Spanned<FrameInFile>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FrameInFile {
    name: String,
    lighting: Option<PathBuf>,
    camera: Option<PathBuf>,
}

/// A frame, ready to be rendered.
struct Frame {
    name: String,
    /// The number of its lighting.
    lighting: usize,
    lighting_file: Option<PathBuf>,
    view: AnyView,
    settings: RenderSettings,
    output: PathBuf,
    preview: PathBuf,
}

pub(super) fn work(args: &RenderArgs, file: &Path, run: &mut Run) -> Result<Outcome, Failure> {
    let wanted = read(file)?;
    let mut prepared = run.prepare(&args.scene, args.mesh, default_subdivision)?;
    let (frames, lightings) = ready(args, file, wanted, &prepared)?;
    let mut largest = 0;
    for frame in &frames {
        largest = largest.max(image_byte(&frame.view, &frame.settings, args.storage.memory_limit)?);
    }
    run.storage = Storage {
        args: args.storage.clone(),
        output: Some(args.output.clone()),
        tolerance: Some(args.solver.tolerance),
        image_byte: largest,
    };
    if frames.iter().any(|frame| frame.settings.direct != DirectMethod::Off) {
        run.warn_of_narrow_gaps(&prepared);
    }
    let needs_symmetry = run.solver_entry(&args.solver)?.gains_by_reciprocity();
    let fineness = Fineness {
        default_rays: DEFAULT_RAYS,
        tolerance: args.form_factor_tolerance,
        default_tolerance: DEFAULT_TOLERANCE,
        tolerance_name: "form_factor_tolerance",
    };
    let computed = run.form_factors(&mut prepared, &args.method, fineness, needs_symmetry)?;
    let stack = Stack::new(&prepared, &lightings);
    let areas = computed.factors.areas().to_vec();
    let solution = run.solve_system(
        (&mut prepared.plan, &prepared.mesh),
        (&computed.factors, areas),
        &args.solver,
        (stack.reflectance.clone(), stack.exitance.clone()),
        computed.given(),
    )?;
    let solved = Solved {
        prepared: &prepared,
        computed: &computed,
        lightings: &lightings,
        stack: &stack,
        solution: &solution,
    };
    let shots: Vec<Shot> = frames
        .iter()
        .map(|frame| solved.shoot(run, args, frame))
        .collect::<Result<_, _>>()?;
    run.progress.finish();
    let mut result = solve::to_json(&prepared, &args.solver.solver, &solution);
    if let Value::Object(result) = &mut result {
        // Each frame has its own.
        result.remove("surfaces");
        result.remove("energy");
    }
    result["form_factors"] = checks_to_json(&computed);
    result["n_lightings"] = json!(lightings.len());
    result["frames"] = shots.iter().map(|shot| shot.document.clone()).collect();
    let document = run.document_of(&prepared, result);
    let mut text = run.explanation(&prepared);
    let (n, n_frames, n_lightings) = (prepared.mesh.n_patches(), frames.len(), lightings.len());
    let _ = writeln!(
        text,
        "{n} patches, {n_frames} frames, {n_lightings} lightings solved together in {} passes",
        solution.n_passes
    );
    describe_checks(&mut text, &computed);
    run.describe_audit(&mut text);
    run.describe_times(&mut text);
    text.extend(shots.iter().map(|shot| shot.line.as_str()));
    let code = match solve::code(&solution, Some(&computed)) {
        ExitCode::Done if shots.iter().any(|shot| shot.is_noisy) => ExitCode::NotConverged,
        code => code,
    };
    Ok(Outcome {
        text,
        document,
        code: run.judged(code, args.audit.strict),
    })
}

/// What all frames are made from.
struct Solved<'a> {
    prepared: &'a Prepared,
    computed: &'a Computed,
    lightings: &'a [Option<Lighting>],
    stack: &'a Stack,
    /// Of all lightings together.
    solution: &'a Solution,
}

/// What is told of a frame.
struct Shot {
    document: Value,
    line: String,
    /// True if final gather left pixels above the noise asked for.
    is_noisy: bool,
}

impl Solved<'_> {
    fn shoot(&self, run: &mut Run, args: &RenderArgs, frame: &Frame) -> Result<Shot, Failure> {
        let Self { prepared, computed, .. } = self;
        let own = self.stack.solution(frame.lighting, self.solution);
        let (reflectance, exitance) = self.stack.materials(frame.lighting);
        let (indirect, error) = run.times.time("solve", || {
            (
                indirect_irradiance(&computed.factors, &exitance, &own),
                carried_error(&computed.factors, &reflectance, &exitance, &own),
            )
        });
        let error = error?;
        computed.factors.if_readable(())?;
        let lighting = self.lightings[frame.lighting].as_ref();
        let lit = lighting.map(|lighting| lighting.apply(&prepared.scene));
        let input = RenderInput {
            scene: lit.as_ref().unwrap_or(&prepared.scene),
            mesh: &prepared.mesh,
            visibility: &prepared.visibility,
            radiosity: &own.radiosity,
            irradiance: &own.irradiance,
            indirect_irradiance: Some(&indirect),
            error: Some(&error),
        };
        let output = (frame.output.as_path(), frame.preview.as_path());
        let image = shoot(run, &input, &frame.view, frame.settings, args, output)?;
        let gathered = frame.settings.gather.map(|gather| GatherReport::new(&image, gather));
        let (width, height) = (image.width(), image.height());
        let (picture, preview) = (frame.output.display(), frame.preview.display());
        Ok(Shot {
            line: format!("{}: wrote {picture} ({width} × {height}) and {preview}\n", frame.name),
            is_noisy: gathered.is_some_and(|report| report.n_above > 0),
            document: json!({
                "name": frame.name,
                "lighting": frame.lighting_file,
                "image": frame.output,
                "preview": frame.preview,
                "width": width,
                "height": height,
                "final_gather": gathered,
                "energy": own.energy,
                "surfaces": prepared.surfaces_with_radiosity(&own),
            }),
        })
    }
}

/// Reads the file of frames.
fn read(file: &Path) -> Result<Vec<FrameInFile>, Failure> {
    let bad = |line: Option<usize>, message: String| {
        let place = line.map_or_else(String::new, |line| format!(":{line}"));
        let mut failure = Failure::new("bad_frames", format!("{}{place}: {message}", file.display())).in_file(file);
        failure.line = line.and_then(|line| u32::try_from(line).ok());
        failure
    };
    let text = std::fs::read_to_string(file).map_err(|error| bad(None, format!("cannot be read: {error}")))?;
    let line_of = |at: usize| text.get(..at).map_or(1, |before| before.matches('\n').count() + 1);
    let parsed: FramesFile = toml::from_str(&text).map_err(|error| {
        let message = error.message().trim().replace('\n', ", ");
        bad(
            error.span().map(|span| line_of(span.start)),
            format!("{message}; correct the frames"),
        )
    })?;
    if parsed.frame.is_empty() {
        return Err(bad(None, "there is no [[frame]]; add one".to_owned()));
    }
    let mut frames: Vec<FrameInFile> = Vec::new();
    for spanned in parsed.frame {
        let line = line_of(spanned.span().start);
        let frame = spanned.into_inner();
        let is_plain = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        if frame.name.is_empty() || !frame.name.chars().all(is_plain) {
            let message = format!(
                "the name {:?} is to be a part of a file's name; use letters, digits, -, _ and .",
                frame.name
            );
            return Err(bad(Some(line), message));
        }
        if frames.iter().any(|other| other.name == frame.name) {
            let message = format!("two frames are called `{}`; rename one", frame.name);
            return Err(bad(Some(line), message));
        }
        frames.push(frame);
    }
    Ok(frames)
}

/// Prepares views and outputs, and loads every lighting once.
fn ready(
    args: &RenderArgs,
    file: &Path,
    wanted: Vec<FrameInFile>,
    prepared: &Prepared,
) -> Result<(Vec<Frame>, Vec<Option<Lighting>>), Failure> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut files: Vec<Option<PathBuf>> = Vec::new();
    let mut lightings = Vec::new();
    let mut frames = Vec::new();
    for frame in wanted {
        let lighting_file = frame.lighting.map(|path| folder.join(path));
        let known = files.iter().position(|other| *other == lighting_file);
        let lighting = if let Some(k) = known {
            k
        } else {
            let loaded = lighting_file.as_ref().map(|path| Lighting::load(path, &prepared.scene));
            lightings.push(loaded.transpose()?);
            files.push(lighting_file.clone());
            files.len() - 1
        };
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
        let output = with_suffix(&args.output, &frame.name);
        frames.push(Frame {
            name: frame.name,
            lighting,
            lighting_file,
            settings: render_settings(args, &view_args)?,
            view: view(&view_args, &args.scene, &prepared.scene)?,
            preview: preview_of(&output)?,
            output,
        });
    }
    Ok((frames, lightings))
}
