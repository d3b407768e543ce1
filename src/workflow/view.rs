//! The view of an image: a camera of a file, of a scene or chosen for it, with changes, or the unfolded surfaces.

use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::json;

use super::{Context, Model, Unsuited, Warning, WorkflowError};
use crate::parameter::{Named, Parameter};
use crate::render::{CameraRecord, RayView, UnfoldedView, View};
use crate::scene::{Camera, IMAGE_SIDES, Scene};

/// The default width of an image, in pixels.
const DEFAULT_WIDTH: u32 = 512;

/// The default number of pixels along the longest edge of a tile of an unfolded view.
const DEFAULT_TILE: NonZeroU32 = NonZeroU32::MIN.saturating_add(63);

/// The camera of an image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum CameraChoice {
    /// The file beside the scene, else a view chosen for the scene.
    #[default]
    OfScene,
    /// A file.
    File(PathBuf),
    /// None: one orthographic tile for each planar surface.
    Unfolded,
}

impl CameraChoice {
    /// Returns the camera that a list of frames in `folder` names: a file, or `unfolded`.
    #[must_use]
    pub fn of_list(folder: &Path, name: &Path) -> Self {
        if name == Path::new("unfolded") {
            Self::Unfolded
        } else {
            Self::File(folder.join(name))
        }
    }
}

/// The request for the view of an image and its size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewRequest {
    /// The camera.
    pub camera: CameraChoice,
    /// Another position of the camera, m.
    pub eye: Option<DVec3>,
    /// Another point that it looks at, m.
    pub look_at: Option<DVec3>,
    /// Another direction that is up in the image.
    pub up: Option<DVec3>,
    /// Another vertical field of view, in degrees.
    pub fov: Option<f64>,
    /// The width in pixels; for an unfolded view, that of the longest edge of a tile.
    pub width: Option<u32>,
    /// The height in pixels.
    pub height: Option<u32>,
}

/// A view of either kind.
pub enum ImageView {
    /// The view of a camera.
    Perspective {
        /// The view.
        view: Box<dyn View>,
        /// The origin of its camera.
        origin: CameraOrigin,
    },
    /// The view of unfolded surfaces.
    Unfolded(UnfoldedView),
}

/// The origin of a camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraOrigin {
    /// The file, named by the user or found beside the scene; `None` if the view was chosen for the scene.
    file: Option<PathBuf>,
    /// True if the request changed it.
    changed: bool,
    /// The chosen up, where the view is along the camera's own.
    chosen_up: Option<DVec3>,
}

impl CameraOrigin {
    /// Returns the origin as text, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        let name = |parameter| named(parameter, None);
        let source = match &self.file {
            Some(file) => file.display().to_string(),
            None => "a view chosen for the scene".to_owned(),
        };
        let changed = if self.changed {
            let [eye, look_at, up, fov] = [Parameter::Eye, Parameter::LookAt, Parameter::Up, Parameter::Fov].map(name);
            format!(", changed by {eye}, {look_at}, {up} or {fov}")
        } else {
            String::new()
        };
        let up = self.chosen_up.map_or(String::new(), |up| {
            let other = name(Parameter::Up);
            format!("; up in the image is {up}, as the view is along the camera's own: {other} sets another")
        });
        format!("{source}{changed}{up}")
    }
}

impl ImageView {
    /// Returns the view itself.
    #[must_use]
    pub fn as_view(&self) -> &dyn View {
        match self {
            Self::Perspective { view, .. } => view.as_ref(),
            Self::Unfolded(view) => view,
        }
    }

    /// Returns the origin of the camera, if there is one.
    #[must_use]
    pub fn origin(&self) -> Option<&CameraOrigin> {
        match self {
            Self::Perspective { origin, .. } => Some(origin),
            Self::Unfolded(_) => None,
        }
    }

    /// Returns a description of the camera, with parameters as `named` writes them.
    #[must_use]
    pub fn camera_text(&self, named: Named<'_>) -> String {
        self.origin().map_or("unfolded".to_owned(), |origin| origin.text(named))
    }

    /// Warns of surfaces that an unfolded view does not show, and records them in the plan: the image itself does not show their absence.
    pub fn note_left_out(&self, model: &mut Model, cx: &Context) {
        if let Self::Unfolded(unfolded) = self {
            for sentence in unfolded.layout().without_tile() {
                cx.warn(Warning::Other(sentence.clone()));
                model.plan.left_out.push(sentence);
            }
        }
    }
}

impl ViewRequest {
    /// Returns whether the request moves or turns the camera.
    #[must_use]
    pub fn changes_camera(&self) -> bool {
        self.eye.is_some() || self.look_at.is_some() || self.up.is_some() || self.fov.is_some()
    }

    /// Returns whether the request is for unfolded surfaces.
    #[must_use]
    pub fn is_unfolded(&self) -> bool {
        self.camera == CameraChoice::Unfolded
    }

    /// Returns the camera's file, if one is named.
    #[must_use]
    pub fn camera_file(&self) -> Option<&Path> {
        match &self.camera {
            CameraChoice::File(file) => Some(file),
            CameraChoice::OfScene | CameraChoice::Unfolded => None,
        }
    }

    /// Returns the view of a scene.
    ///
    /// # Errors
    /// [`WorkflowError::Scene`] for a camera file, [`WorkflowError::Render`] for surfaces that have no tile, and [`Unsuited`] for a request that does not fit together.
    pub fn view(&self, scene_file: &Path, scene: &Scene) -> Result<ImageView, WorkflowError> {
        if self.is_unfolded() {
            if self.changes_camera() || self.height.is_some() {
                return Err(Unsuited::UnfoldedCamera.into());
            }
            let n_pixels = self.width.and_then(NonZeroU32::new).unwrap_or(DEFAULT_TILE);
            return Ok(ImageView::Unfolded(UnfoldedView::new(scene, n_pixels)?));
        }
        let (given, file) = match &self.camera {
            CameraChoice::File(file) => (Some(Camera::load(file)?), Some(file.clone())),
            _ => (Camera::load_beside(scene_file)?, Camera::file_beside(scene_file)),
        };
        let mut camera = given.unwrap_or_else(|| Camera::default_view(scene));
        let mut chosen_up = None;
        if self.changes_camera() {
            (camera, chosen_up) = self.changed(&camera)?;
        }
        let (width, height) = image_size([self.width, self.height], [camera.width(), camera.height()]);
        if ![width, height].iter().all(|side| IMAGE_SIDES.contains(side)) {
            return Err(Unsuited::ImageSize(width, height).into());
        }
        let parameters = json!(CameraRecord::from(&camera));
        let ray = move |x: f64, y: f64| camera.primary_ray(x, y, width, height);
        Ok(ImageView::Perspective {
            view: Box::new(RayView::new(width, height, ray, parameters)),
            origin: CameraOrigin {
                file,
                changed: self.changes_camera(),
                chosen_up,
            },
        })
    }

    /// Returns the requested camera, and the chosen up where the view is along its own.
    fn changed(&self, camera: &Camera) -> Result<(Camera, Option<DVec3>), WorkflowError> {
        let mut chosen_up = None;
        let eye = self.eye.unwrap_or(camera.eye());
        let direction = match self.look_at {
            Some(target) if target == eye => return Err(Unsuited::LookAtEye.into()),
            Some(target) => target - eye,
            None => camera.direction(),
        };
        let up = match self.up {
            Some(up) if Camera::is_along(direction, up) => return Err(Unsuited::UpAlongView.into()),
            Some(up) => up,
            None if Camera::is_along(direction, camera.given_up()) => *chosen_up.insert(up_across(direction)),
            None => camera.given_up(),
        };
        let fov = self.fov.unwrap_or(camera.vertical_fov());
        let changed = Camera::new(eye, direction, up, fov)?.with_image_size(camera.width(), camera.height());
        Ok((changed, chosen_up))
    }
}

/// Returns width and height of an image: as requested, else those of the camera; if only one is requested, the other follows the camera's proportion.
fn image_size(asked: [Option<u32>; 2], stated: [Option<u32>; 2]) -> (u32, u32) {
    // A camera that states at most one side makes square images by default.
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

/// Returns an up for a view along the usual one: +y, as on a plan with x to the right, or −z where the view is along y.
fn up_across(direction: DVec3) -> DVec3 {
    if Camera::is_along(direction, DVec3::Y) {
        DVec3::NEG_Z
    } else {
        DVec3::Y
    }
}

#[cfg(test)]
mod tests {
    use super::image_size;

    #[test]
    fn one_side_of_an_image_brings_the_other_in_proportion() {
        let stated = [Some(80), Some(60)];
        assert_eq!(image_size([None, None], stated), (80, 60));
        assert_eq!(image_size([Some(40), None], stated), (40, 30));
        assert_eq!(image_size([None, Some(30)], stated), (40, 30));
        assert_eq!(image_size([Some(1), None], [Some(1000), Some(10)]), (1, 1));
        assert_eq!(image_size([Some(7), Some(9)], stated), (7, 9));
        assert_eq!(image_size([Some(40), None], [None; 2]), (40, 40));
        assert_eq!(image_size([None, Some(40)], [None; 2]), (40, 40));
        assert_eq!(image_size([None; 2], [None, Some(100)]), (512, 100));
        assert_eq!(image_size([None; 2], [None; 2]), (512, 512));
    }
}
