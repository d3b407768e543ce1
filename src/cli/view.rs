//! The view and the settings of a picture, as flags, camera files and the scene have them.

use std::fmt::Write as _;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::json;

use super::args::{DirectName, GatherArgs, RenderArgs, ViewArgs};
use super::failure::Failure;
use super::run::Run;
use crate::geometry::sampling::Sequence;
use crate::render::{CameraRecord, DirectMethod, GatherSettings, RayView, RenderSettings, UnfoldedView, View};
use crate::scene::{Camera, IMAGE_SIDES, Scene};
use crate::workflow::{Demand, Model};

/// The noise of final gather unless `--noise` says otherwise.
const DEFAULT_NOISE: f64 = 0.02;

/// The most rays to gather for one pixel unless `--gather-rays` says otherwise.
const DEFAULT_GATHER_RAYS: u32 = 16384;

/// Returns what is known of the work after the form factors.
pub(super) fn demand(args: &RenderArgs) -> Demand {
    Demand {
        output: Some(args.output.clone()),
        tolerance: Some(args.solver.tolerance),
        ..Demand::default()
    }
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
    pub(super) fn tell_left_out(&self, run: &Run, model: &mut Model) {
        if let Self::Unfolded(unfolded) = self {
            for sentence in unfolded.layout().without_tile() {
                run.warn(&sentence);
                model.plan.left_out.push(sentence);
            }
        }
    }

    /// Returns what a warning calls the camera, if there is one.
    pub(super) fn camera_name(&self) -> Option<String> {
        self.origin().map(CameraOrigin::describe)
    }

    pub(super) fn describe_camera(&self) -> String {
        self.origin().map_or("unfolded".to_owned(), CameraOrigin::describe)
    }

    /// Says which camera made a picture, in the text and the settings of the document; after the picture is written, as a picture names no files.
    pub(super) fn tell_camera(&self, run: &mut Run, text: &mut String) {
        let camera = self.describe_camera();
        let _ = writeln!(text, "camera: {camera}");
        run.cx.set("camera", camera);
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
