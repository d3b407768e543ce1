//! `radiosity render`.

use std::fmt::Write as _;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::{Value, json};

use super::Outcome;
use super::args::{DirectName, GatherArgs, RenderArgs, ViewArgs};
use super::exit_code::ExitCode;
use super::failure::Failure;
use super::file_set::FileSet;
use super::form_factors::{checks_to_json, describe_checks};
use super::mesh_error::MeshError;
use super::on_the_fly::{self, Request};
use super::picture::{gathered, image_byte, preview_of, shoot};
use super::pipeline::{Computed, Fineness, Prepared, Run};
use super::solve;
use super::storage::Storage;
use crate::geometry::sampling::Sequence;
use crate::matrix::operator::{Block, LinearOperator};
use crate::mesh::Subdivision;
use crate::printable::{counted, short};
use crate::render::{
    CameraRecord, DirectMethod, GatherSettings, RayView, RenderInput, RenderSettings, UnfoldedView, View,
};
use crate::scene::{Camera, IMAGE_SIDES, Scene};
use crate::solver::Solution;

/// Rays for each patch unless `--rays` says otherwise: enough that the noise of a patch does not show.
pub(super) const DEFAULT_RAYS: u64 = 16384;

/// The tolerance of form factors unless `--form-factor-tolerance` says otherwise: below a tenth of a typical factor between patches of the default
/// size, which is 1/3000, and errors of both signs mostly cancel; patches of that size are off by more.
pub(super) const DEFAULT_TOLERANCE: f64 = 1e-5;

/// The noise of final gather unless `--noise` says otherwise.
const DEFAULT_NOISE: f64 = 0.02;

/// The most rays to gather for one pixel unless `--gather-rays` says otherwise.
const DEFAULT_GATHER_RAYS: u32 = 16384;

/// The number of patches that the default subdivision aims at.
const DEFAULT_PATCHES: f64 = 3000.0;

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
    files.reads_scene(&args.scene);
    files.reads("the camera", args.image.view.camera_file()).check()?;
    let mut prepared = run.prepare(&args.scene, args.mesh, args.storage.memory.memory_limit, default_mesh)?;
    let view = view(&args.image.view, &args.scene, &prepared.scene)?;
    run.storage = Storage {
        args: args.storage.clone(),
        part: 0,
        output: Some(args.output.clone()),
        tolerance: Some(args.solver.tolerance),
        image_byte: image_byte(&view, &settings, args.storage.memory.memory_limit)?,
        ..Storage::default()
    };
    if settings.direct != DirectMethod::Off {
        run.warn_of_narrow_gaps(&prepared);
    }
    let solved = solve_scene(run, &mut prepared, args, settings.direct)?;
    if settings.direct == DirectMethod::Off {
        prepared
            .plan
            .left_out
            .push("direct light at each pixel: the patches' light is interpolated".into());
    }
    view.tell_left_out(run, &mut prepared);
    let input = RenderInput {
        scene: &prepared.scene,
        mesh: &prepared.mesh,
        visibility: &prepared.visibility,
        radiosity: &solved.solution.radiosity,
        irradiance: &solved.solution.irradiance,
        indirect_irradiance: solved.indirect_irradiance.as_ref(),
        error: solved.error.as_ref(),
    };
    let output = (args.output.as_path(), preview.as_path());
    let image = shoot(run, &input, &view, settings, args, output)?;
    run.progress.finish();

    let stated = run.stated(&prepared, solved.error.as_ref(), &solved.solution);
    let mut result = solve::to_json(&prepared, &solved.solver, &solved.solution, stated);
    result["form_factors"] = solved.computed.as_ref().map_or(Value::Null, checks_to_json);
    result["mesh_error"] = json!(solved.mesh_error);
    result["image"] = json!(args.output.display().to_string());
    result["preview"] = json!(preview.display().to_string());
    let gather = gathered(run, &image, settings, &args.output);
    result["final_gather"] = json!(gather);
    result["width"] = json!(image.width());
    result["height"] = json!(image.height());
    let mut text = run.explanation(&prepared);
    view.tell_camera(run, &mut text);
    let document = run.document_of(&prepared, result);
    let (n_patches, n_surfaces) = (prepared.mesh.n_patches(), prepared.scene.surfaces.len());
    let _ = writeln!(text, "{n_patches} patches on {}", counted(n_surfaces, "surface"));
    if let Some(computed) = &solved.computed {
        describe_checks(&mut text, computed);
    }
    let solver = (solved.solver.as_str(), solved.mesh_error.as_ref());
    solve::describe(&mut text, &prepared, solver, &solved.solution, stated);
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
    let code = match solve::code(&solved.solution, solved.computed.as_ref(), stated) {
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
    solution: Solution,
    /// The form factors, where they are stored.
    computed: Option<Computed>,
    /// F (B − E), where a direct pass adds the rest.
    indirect_irradiance: Option<Block>,
    /// The estimated error of the radiosity, where there are form factors to carry it from.
    error: Option<Block>,
    /// What a coarser mesh would change, where there are form factors to tell it from.
    mesh_error: Option<MeshError>,
}

/// Solves the scene, as far as the picture needs it.
fn solve_scene(
    run: &mut Run,
    prepared: &mut Prepared,
    args: &RenderArgs,
    direct: DirectMethod,
) -> Result<Solved, Failure> {
    let with_direct = direct != DirectMethod::Off;
    if with_direct && !prepared.scene.is_reflecting() {
        // All light comes straight from the emitters, and the direct pass finds it at each pixel.
        let reason = "form factors and solver: nothing reflects, and the direct pass finds all light";
        prepared.plan.left_out.push(reason.into());
        let (_, exitance) = prepared.materials();
        let dark = Block::zeros(exitance.n_rows(), exitance.n_channels());
        return Ok(Solved {
            solver: solve::NO_SOLVER.to_owned(),
            solution: Solution::without_reflection(exitance),
            computed: None,
            indirect_irradiance: Some(dark),
            error: None,
            mesh_error: None,
        });
    }
    let need = run.need(&args.solver)?;
    let fineness = Fineness {
        default_rays: DEFAULT_RAYS,
        tolerance: args.form_factor_tolerance,
        default_tolerance: DEFAULT_TOLERANCE,
        tolerance_flag: "--form-factor-tolerance",
    };
    if args.on_the_fly {
        let request = Request {
            method: &args.method,
            fineness,
            solver: &args.solver,
            indirect: with_direct,
        };
        let (solution, indirect_irradiance) = on_the_fly::solve(run, prepared, &request)?;
        let reason = "the error layer: it is carried from stored form factors";
        prepared.plan.left_out.push(reason.into());
        return Ok(Solved {
            solver: args.solver.solver.clone(),
            solution,
            computed: None,
            indirect_irradiance,
            error: None,
            mesh_error: None,
        });
    }
    let computed = run.form_factors(prepared, &args.method, fineness, need)?;
    let solution = run.solve(prepared, &computed, &args.solver)?;
    let indirect_irradiance = with_direct.then(|| {
        run.times.time("solve", || {
            indirect_irradiance(&computed.factors, &prepared.materials().1, &solution)
        })
    });
    let (reflectance, exitance) = prepared.materials();
    let error = run.carried_error(&computed, (&reflectance, &exitance), &solution)?;
    let coarse = run.coarsened(prepared, &computed, &reflectance, &solution)?;
    let mesh_error = run.mesh_error(prepared, coarse.as_ref(), (&exitance, &solution));
    computed.factors.if_readable(())?;
    Ok(Solved {
        solver: args.solver.solver.clone(),
        solution,
        computed: Some(computed),
        indirect_irradiance,
        error,
        mesh_error,
    })
}

/// Returns patches of about equal size, [`DEFAULT_PATCHES`] in all, and a few more where contact edges cut faces.
pub(super) fn default_mesh(scene: &Scene) -> Subdivision {
    let area: f64 = scene.face_ids().map(|face| scene.area_vector(face).length()).sum();
    Subdivision::MaxEdge((area / DEFAULT_PATCHES).sqrt())
}

/// Returns H without what comes straight from the emitters: F (B − E).
pub(super) fn indirect_irradiance(factors: &dyn LinearOperator, exitance: &Block, solution: &Solution) -> Block {
    let reflected = solution.reflected(exitance);
    let mut irradiance = Block::zeros(reflected.n_rows(), reflected.n_channels());
    factors.apply(&reflected, &mut irradiance);
    irradiance
}

/// Returns how a picture is made; the defaults depend on the view.
pub(super) fn render_settings(args: &RenderArgs, view: &ViewArgs) -> Result<RenderSettings, Failure> {
    let image = &args.image;
    let direct = image.direct.unwrap_or_else(|| match (view.is_unfolded(), image.flat) {
        (_, true) => DirectName::Off,
        (true, false) => DirectName::Rays,
        (false, false) => DirectName::Polygons,
    });
    let n_or = |default: u32| {
        NonZeroU32::new(image.direct_samples.unwrap_or(default)).ok_or(Failure::usage("--direct-samples starts at 1"))
    };
    let direct = match direct {
        DirectName::Off if image.direct_samples.is_some() => {
            return Err(Failure::usage(
                "--direct-samples has no use without a direct pass; leave out --flat or --direct off",
            ));
        }
        DirectName::Exact if image.direct_samples.is_some() => {
            return Err(Failure::usage(
                "--direct exact traces no rays; leave out --direct-samples",
            ));
        }
        DirectName::Off => DirectMethod::Off,
        DirectName::Exact => DirectMethod::Exact,
        DirectName::Rays => DirectMethod::CosineRays { n: n_or(4096)? },
        DirectName::Polygons => DirectMethod::Polygons { n: n_or(16)? },
    };
    Ok(RenderSettings {
        flat: image.flat,
        samples: samples(view)?,
        adaptive: true,
        gather: gather_settings(args.gather)?,
        direct,
        sequence: args.method.sequence.map_or_else(Sequence::default, Into::into),
        seed: args.method.seed,
    })
}

fn gather_settings(args: GatherArgs) -> Result<Option<GatherSettings>, Failure> {
    let max_rays = NonZeroU32::new(args.gather_rays.unwrap_or(DEFAULT_GATHER_RAYS));
    let settings = GatherSettings {
        noise: args.noise.unwrap_or(DEFAULT_NOISE),
        max_rays: max_rays.ok_or(Failure::usage("--gather-rays starts at 1"))?,
    };
    Ok(args.final_gather.then_some(settings))
}

/// Returns the samples along each side of a pixel.
pub(super) fn samples(view: &ViewArgs) -> Result<NonZeroU32, Failure> {
    // One sample a pixel is what a check by pixels wants; more are for the eye.
    let n = view.samples.unwrap_or(if view.is_unfolded() { 1 } else { 2 });
    NonZeroU32::new(n).ok_or(Failure::usage("--samples starts at 1"))
}

/// A view of one kind or the other.
pub(super) enum AnyView {
    Perspective { view: Box<dyn View>, origin: CameraOrigin },
    Unfolded(UnfoldedView),
}

/// Where a camera comes from.
pub(super) struct CameraOrigin {
    /// The file, named by the user or found beside the scene; without one the view was chosen for the scene.
    file: Option<PathBuf>,
    /// Whether flags changed it.
    changed: bool,
    /// The up that was chosen, where the view is along the camera's own.
    chosen_up: Option<DVec3>,
}

impl CameraOrigin {
    pub(super) fn describe(&self) -> String {
        let source = match &self.file {
            Some(file) => file.display().to_string(),
            None => "a view chosen for the scene".to_owned(),
        };
        let changed = if self.changed {
            ", changed by --eye, --look-at, --up or --fov"
        } else {
            ""
        };
        let up = self.chosen_up.map_or(String::new(), |up| {
            format!("; up in the image is {up}, as the view is along the camera's own: --up sets another")
        });
        format!("{source}{changed}{up}")
    }
}

impl AnyView {
    pub(super) fn as_view(&self) -> &dyn View {
        match self {
            Self::Perspective { view, .. } => view.as_ref(),
            Self::Unfolded(view) => view,
        }
    }

    /// Returns where the camera comes from, if it is one.
    pub(super) fn origin(&self) -> Option<&CameraOrigin> {
        match self {
            Self::Perspective { origin, .. } => Some(origin),
            Self::Unfolded(_) => None,
        }
    }

    /// Says which surfaces an unfolded view does not show: the picture looks whole without them.
    pub(super) fn tell_left_out(&self, run: &Run, prepared: &mut Prepared) {
        if let Self::Unfolded(unfolded) = self {
            for sentence in unfolded.layout().without_tile() {
                run.warn(&sentence);
                prepared.plan.left_out.push(sentence);
            }
        }
    }

    pub(super) fn describe_camera(&self) -> String {
        self.origin().map_or("unfolded".to_owned(), CameraOrigin::describe)
    }

    /// Says which camera made a picture, in the text and the settings of the document; after the picture is written, as a picture names no files.
    pub(super) fn tell_camera(&self, run: &mut Run, text: &mut String) {
        let camera = self.describe_camera();
        let _ = writeln!(text, "camera: {camera}");
        run.set("camera", camera);
    }
}

/// The width of a picture unless something says otherwise.
const DEFAULT_WIDTH: u32 = 512;

/// Returns width and height of a picture: as asked for, else as the camera says, and where one of them is asked for, the other in the camera's proportion.
fn picture_size(asked: [Option<u32>; 2], stated: [Option<u32>; 2]) -> (u32, u32) {
    // A camera that states one side or none makes square pictures unless told otherwise.
    let proportion = match stated {
        [Some(width), Some(height)] => (u64::from(width), u64::from(height)),
        _ => (1, 1),
    };
    let scaled = |side: u32, to: u64, from: u64| {
        let rounded = (u64::from(side) * to + from / 2) / from;
        u32::try_from(rounded.max(1)).unwrap_or(u32::MAX)
    };
    match asked {
        [Some(width), Some(height)] => (width, height),
        [Some(width), None] => (width, scaled(width, proportion.1, proportion.0)),
        [None, Some(height)] => (scaled(height, proportion.0, proportion.1), height),
        [None, None] => {
            let width = stated[0].unwrap_or(DEFAULT_WIDTH);
            (width, stated[1].unwrap_or(width))
        }
    }
}

/// Returns an up for a view along the usual one: +y, as on a plan with x to the right, or −z where the view is along y, which has x to the right as well when it looks down.
fn up_across(direction: DVec3) -> DVec3 {
    if Camera::is_along(direction, DVec3::Y) {
        DVec3::NEG_Z
    } else {
        DVec3::Y
    }
}

pub(super) fn view(args: &ViewArgs, scene_file: &Path, scene: &Scene) -> Result<AnyView, Failure> {
    let flags = args.has_camera_flags();
    if args.is_unfolded() {
        if flags || args.height.is_some() {
            return Err(Failure::usage("--camera unfolded goes with --width alone"));
        }
        let n_pixels = NonZeroU32::new(args.width.unwrap_or(64)).ok_or(Failure::usage("--width starts at 1"))?;
        return Ok(AnyView::Unfolded(UnfoldedView::new(scene, n_pixels)?));
    }
    let given = match &args.camera {
        Some(file) => Some(Camera::load(file)?),
        None => Camera::load_beside(scene_file)?,
    };
    let file = args.camera.clone().or_else(|| Camera::file_beside(scene_file));
    let mut camera = given.unwrap_or_else(|| Camera::default_view(scene));
    let mut chosen_up = None;
    if flags {
        let eye = args.eye.map_or(camera.eye(), DVec3::from_array);
        let direction = match args.look_at {
            Some(target) if DVec3::from_array(target) == eye => {
                return Err(Failure::usage(
                    "the camera looks at the point where it stands: give --eye and --look-at two points",
                ));
            }
            Some(target) => DVec3::from_array(target) - eye,
            None => camera.direction(),
        };
        let up = match args.up.map(DVec3::from_array) {
            Some(up) if Camera::is_along(direction, up) => {
                return Err(Failure::usage(
                    "--up is zero or parallel to the view: give a direction that is up in the image",
                ));
            }
            Some(up) => up,
            None if Camera::is_along(direction, camera.given_up()) => *chosen_up.insert(up_across(direction)),
            None => camera.given_up(),
        };
        let fov = args.fov.unwrap_or(camera.vertical_fov());
        camera = Camera::new(eye, direction, up, fov)?.with_image_size(camera.width(), camera.height());
    }
    let (width, height) = picture_size([args.width, args.height], [camera.width(), camera.height()]);
    if ![width, height].iter().all(|side| IMAGE_SIDES.contains(side)) {
        return Err(Failure::usage(format!(
            "a picture of {width} × {height} pixels, in the proportion of the camera: its sides are {} to {} pixels; give --width and --height",
            IMAGE_SIDES.start(),
            IMAGE_SIDES.end()
        )));
    }
    let parameters = json!(CameraRecord::from(&camera));
    let ray = move |x: f64, y: f64| camera.primary_ray(x, y, width, height);
    Ok(AnyView::Perspective {
        view: Box::new(RayView::new(width, height, ray, parameters)),
        origin: CameraOrigin {
            file,
            changed: flags,
            chosen_up,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::picture_size;

    #[test]
    fn one_side_of_a_picture_brings_the_other_in_proportion() {
        let stated = [Some(80), Some(60)];
        assert_eq!(picture_size([None, None], stated), (80, 60));
        assert_eq!(picture_size([Some(40), None], stated), (40, 30));
        assert_eq!(picture_size([None, Some(30)], stated), (40, 30));
        assert_eq!(picture_size([Some(1), None], [Some(1000), Some(10)]), (1, 1));
        assert_eq!(picture_size([Some(7), Some(9)], stated), (7, 9));
        assert_eq!(picture_size([Some(40), None], [None; 2]), (40, 40));
        assert_eq!(picture_size([None, Some(40)], [None; 2]), (40, 40));
        assert_eq!(picture_size([None; 2], [None, Some(100)]), (512, 100));
        assert_eq!(picture_size([None; 2], [None; 2]), (512, 512));
    }
}
