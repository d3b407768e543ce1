//! The perspective camera, and the `camera.toml` beside a scene.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::io::write_whole;
use super::lines::{line_after, read_text};
use super::table::{three, three_if_given};
use super::{Origin, SceneError, SceneErrorKind, default_view};
use crate::input_file::{self, DESCRIPTION_LIMIT};
use crate::scene::Scene;

/// A pinhole camera with square pixels.
///
/// In its own frame it looks along −z, with x to the right and y upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    eye: DVec3,
    axes: DMat3,
    /// The vector as given, so that a camera turned elsewhere still stands upright.
    given_up: DVec3,
    vertical_fov: f64,
    image_size: [Option<u32>; 2],
}

/// The number of pixels that a side of an image may have.
pub const IMAGE_SIDES: RangeInclusive<u32> = 1..=16384;

/// The name of the camera file in the directory of a scene.
const FILE_NAME: &str = "camera.toml";

/// The angle, as a sine, within which a view counts as parallel to `up`.
const PARALLEL: f64 = 1e-9;

/// The content of a camera file.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    #[serde(deserialize_with = "three")]
    eye: [f64; 3],
    #[serde(
        default,
        deserialize_with = "three_if_given",
        skip_serializing_if = "Option::is_none"
    )]
    look_at: Option<[f64; 3]>,
    #[serde(
        default,
        deserialize_with = "three_if_given",
        skip_serializing_if = "Option::is_none"
    )]
    direction: Option<[f64; 3]>,
    #[serde(deserialize_with = "three")]
    up: [f64; 3],
    vertical_fov_degree: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    width: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height: Option<u32>,
}

impl Camera {
    /// Makes a camera at `eye` (m) that looks along `direction`, with the image's vertical as near to `up` as that allows.
    ///
    /// `vertical_fov` is the angle, in degrees, between the middles of the upper and the lower edge of the image. The vectors
    /// need not be unit vectors.
    ///
    /// # Errors
    /// [`BadCamera`](crate::scene::SceneErrorKind::BadCamera), without a line: a number that is not finite, a zero vector, `up` along the direction, or an angle outside (0, 180).
    pub fn new(eye: DVec3, direction: DVec3, up: DVec3, vertical_fov: f64) -> Result<Self, SceneError> {
        Self::checked(eye, direction, up, vertical_fov).map_err(|(key, message)| {
            SceneError::new(
                Origin::Memory {
                    element: "camera".to_owned(),
                },
                SceneErrorKind::BadCamera {
                    message: format!("{key}: {message}"),
                },
            )
        })
    }

    /// Reads a camera from a TOML file.
    ///
    /// Keys: `eye`, `look_at` (a point) or `direction`, `up` ([x, y, z] in m), `vertical_fov_degree`, and optionally the image's
    /// `width` and `height` in pixels. There are no others.
    ///
    /// # Errors
    /// A file that cannot be read, contains no such TOML (with the line), or makes no camera (see [`Camera::new`]).
    pub fn load(file: impl AsRef<Path>) -> Result<Self, SceneError> {
        let file = file.as_ref();
        let text = read_text(file, DESCRIPTION_LIMIT)?;
        let parsed: CameraFile = toml::from_str(&text).map_err(|error| {
            let line = error
                .span()
                .map(|span| line_after(text.get(..span.start).unwrap_or(&text)));
            let message = error.message().trim().replace('\n', ", ");
            bad(file, line, format!("{message}; correct the camera"))
        })?;
        let blame = |key: &str| {
            text.lines()
                .position(|l| {
                    l.trim_start()
                        .strip_prefix(key)
                        .is_some_and(|l| l.trim_start().starts_with('='))
                })
                .and_then(|k| u32::try_from(k + 1).ok())
        };
        let direction = match (parsed.look_at, parsed.direction) {
            (Some(point), None) => DVec3::from_array(point) - DVec3::from_array(parsed.eye),
            (None, Some(direction)) => DVec3::from_array(direction),
            (Some(_), Some(_)) => {
                let message = "both `look_at` and `direction`; keep one".to_owned();
                return Err(bad(file, blame("direction"), message));
            }
            (None, None) => {
                let message = "neither `look_at` nor `direction`; add one".to_owned();
                return Err(bad(file, None, message));
            }
        };
        for (key, size) in [("width", parsed.width), ("height", parsed.height)] {
            if size.is_some_and(|side| !IMAGE_SIDES.contains(&side)) {
                let (least, most) = (IMAGE_SIDES.start(), IMAGE_SIDES.end());
                let message = format!("the {key} of an image is {least} to {most} pixels; correct it");
                return Err(bad(file, blame(key), message));
            }
        }
        let camera = Self::checked(
            DVec3::from_array(parsed.eye),
            direction,
            DVec3::from_array(parsed.up),
            parsed.vertical_fov_degree,
        )
        .map_err(|(key, message)| {
            let key = if key == "direction" && parsed.look_at.is_some() {
                "look_at"
            } else {
                key
            };
            bad(file, blame(key), format!("{key}: {message}"))
        })?;
        Ok(camera.with_image_size(parsed.width, parsed.height))
    }

    /// Reads the `camera.toml` in the directory of a scene file, or returns `None` if there is none.
    ///
    /// # Errors
    /// As [`Camera::load`].
    pub fn load_beside(scene_file: impl AsRef<Path>) -> Result<Option<Self>, SceneError> {
        let Some(file) = Self::file_beside(scene_file) else {
            return Ok(None);
        };
        input_file::expect_plain(&file)
            .map_err(|source| SceneError::new(Origin::file(file.clone()), SceneErrorKind::Unreadable { source }))?;
        Self::load(file).map(Some)
    }

    /// Returns the `camera.toml` in the directory of a scene file, if there is one.
    #[must_use]
    pub fn file_beside(scene_file: impl AsRef<Path>) -> Option<PathBuf> {
        let file = scene_file.as_ref().with_file_name(FILE_NAME);
        file.exists().then_some(file)
    }

    /// Writes the camera as a TOML file that [`Camera::load`] reads; a failed write leaves no partial file.
    ///
    /// The direction survives to rounding error; all other values survive to the bit.
    ///
    /// # Errors
    /// [`Unwritable`](crate::scene::SceneErrorKind::Unwritable).
    pub fn save(&self, file: impl AsRef<Path>) -> Result<(), SceneError> {
        write_whole(file.as_ref(), &self.to_toml())
    }

    /// Returns the text that [`Camera::save`] writes.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let [width, height] = self.image_size;
        toml::to_string(&CameraFile {
            eye: self.eye.to_array(),
            look_at: None,
            direction: Some(self.direction().to_array().map(|x| x + 0.0)),
            up: self.given_up.to_array().map(|x| x + 0.0),
            vertical_fov_degree: self.vertical_fov,
            width,
            height,
        })
        .unwrap_or_default()
    }

    /// Chooses a view of a scene, deterministically.
    ///
    /// Up is +y if light leaves mostly along −y, and +z otherwise (lamps hang from ceilings). The eye stands in the middle of a side of the bounding
    /// box, just inside it or further in, and looks at the centre of the opposite side with a vertical angle of 60 degrees. The chosen place is that from
    /// which most rays of a grid meet the front of a face; places outside the box are used only where they show more.
    ///
    /// # Panics
    /// If the scene has no face.
    #[must_use]
    #[track_caller]
    pub fn default_view(scene: &Scene) -> Self {
        default_view::choose(scene)
    }

    /// Sets the image's size in pixels; `None` leaves a side open.
    #[must_use]
    pub fn with_image_size(mut self, width: Option<u32>, height: Option<u32>) -> Self {
        self.image_size = [width, height];
        self
    }

    /// Returns whether `direction` and `up` are parallel, so that the view has no vertical; [`Camera::new`] refuses these.
    #[must_use]
    pub fn is_along(direction: DVec3, up: DVec3) -> bool {
        direction.normalize_or_zero().cross(up.normalize_or_zero()).length() < PARALLEL
    }

    /// Returns the place of the pinhole, in m.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Returns the unit vector along which the camera looks.
    #[must_use]
    pub fn direction(&self) -> DVec3 {
        -self.axes.z_axis
    }

    /// Returns the unit vector of the image's vertical.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.axes.y_axis
    }

    /// Returns the vector given as up; [`up`](Self::up) is the direction nearest to it that is perpendicular to the view.
    #[must_use]
    pub fn given_up(&self) -> DVec3 {
        self.given_up
    }

    /// Returns the vertical field of view, in degrees.
    #[must_use]
    pub fn vertical_fov(&self) -> f64 {
        self.vertical_fov
    }

    /// Returns the width of the image in pixels, if the camera states it.
    #[must_use]
    pub fn width(&self) -> Option<u32> {
        self.image_size[0]
    }

    /// Returns the height of the image in pixels, if the camera states it.
    #[must_use]
    pub fn height(&self) -> Option<u32> {
        self.image_size[1]
    }

    /// Returns the rigid motion from the camera's frame to the world: its columns are right, up and back, and the eye.
    #[must_use]
    pub fn world_from_camera(&self) -> DAffine3 {
        DAffine3::from_mat3_translation(self.axes, self.eye)
    }

    /// Returns the origin and the unit direction of the ray through a point of the image.
    ///
    /// (x, y) is in pixels from the upper left corner of an image of `width` × `height`: the middle of the first pixel is (0.5, 0.5). With t = tan(fov/2) and
    /// h the height, the direction in the camera's frame is along ((2x − width) t/h, (h − 2y) t/h, −1).
    #[must_use]
    pub fn primary_ray(&self, x: f64, y: f64, width: u32, height: u32) -> (DVec3, DVec3) {
        let (width, height) = (f64::from(width), f64::from(height));
        let scale = (0.5 * self.vertical_fov.to_radians()).tan() / height;
        let in_camera = DVec3::new((2.0 * x - width) * scale, (height - 2.0 * y) * scale, -1.0);
        (self.eye, (self.axes * in_camera).normalize())
    }

    /// Makes a camera, or returns the key at fault and the error.
    fn checked(eye: DVec3, direction: DVec3, up: DVec3, vertical_fov: f64) -> Result<Self, (&'static str, String)> {
        if !eye.is_finite() {
            return Err(("eye", "not finite; correct it".to_owned()));
        }
        let Some(forward) = direction.try_normalize() else {
            return Err(("direction", "zero or not finite; look elsewhere".to_owned()));
        };
        let Some(unit_up) = up.try_normalize() else {
            return Err(("up", "zero or not finite; correct it".to_owned()));
        };
        let right = forward.cross(unit_up);
        if right.length() < PARALLEL {
            return Err(("up", "parallel to the direction; choose another one".to_owned()));
        }
        if !(vertical_fov > 0.0 && vertical_fov < 180.0) {
            let message = format!("{vertical_fov} is not between 0 and 180 degrees; correct it");
            return Err(("vertical_fov_degree", message));
        }
        let right = right.normalize();
        Ok(Self {
            eye,
            axes: DMat3::from_cols(right, right.cross(forward), -forward),
            given_up: up,
            vertical_fov,
            image_size: [None, None],
        })
    }
}

fn bad(file: &Path, line: Option<u32>, message: String) -> SceneError {
    SceneError::new(Origin::line(file, line), SceneErrorKind::BadCamera { message })
}
