//! Views: the rays of the pixels.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::unfolded::Unfolded;
use crate::scene::{Camera, SceneError, SurfaceId};

/// The hit seen through one point of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// The first face along a ray.
    Ray {
        /// The origin of the ray, in world coordinates (m).
        origin: DVec3,
        /// The direction of the ray, of any length but zero.
        direction: DVec3,
        /// The unit vector along which depth is measured.
        depth_axis: DVec3,
    },
    /// A given point of a planar surface, seen from right above; its depth is 0.
    Point {
        /// The point in world coordinates (m).
        point: DVec3,
        /// The unit normal of the surface there.
        normal: DVec3,
        /// The greatest distance of the surface's faces from the point, in m.
        clearance: f64,
        /// The only surface whose faces count.
        surface: SurfaceId,
    },
}

/// A camera, or any other map from the image to the scene.
pub trait View: Sync {
    /// Returns width and height in pixels.
    fn size(&self) -> (u32, u32);

    /// Returns the sight at image coordinates (x, y), or `None` for background.
    ///
    /// x runs right from 0 to the width and y down from 0 to the height; pixel (i, j) has its centre at (i + 1/2, j + 1/2).
    fn sight(&self, x: f64, y: f64) -> Option<Sight>;

    /// Returns the description of the view for the image file.
    fn description(&self) -> ViewDescription;
}

/// A perspective camera as the image file describes it.
///
/// Pixels are square; the image's size completes the description.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraRecord {
    /// The pinhole, in m.
    pub eye: DVec3,
    /// The direction of view.
    pub direction: DVec3,
    /// The image's vertical.
    pub up: DVec3,
    /// The angle between the middles of the upper and the lower edge.
    pub vertical_fov_degree: f64,
}

impl From<&Camera> for CameraRecord {
    fn from(camera: &Camera) -> Self {
        Self {
            eye: camera.eye(),
            direction: camera.direction(),
            up: camera.up(),
            vertical_fov_degree: camera.vertical_fov(),
        }
    }
}

impl CameraRecord {
    /// Returns the camera.
    ///
    /// # Errors
    /// As [`Camera::new`].
    pub fn camera(&self) -> Result<Camera, SceneError> {
        Camera::new(self.eye, self.direction, self.up, self.vertical_fov_degree)
    }
}

/// A view as the image file describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ViewDescription {
    /// The parameters of a perspective camera: a [`CameraRecord`], if the view is a [`Camera`].
    Perspective(serde_json::Value),
    /// The tiles of an unfolded view.
    Unfolded(Unfolded),
}

/// A view along rays of a given function.
#[derive(Clone, Debug)]
pub struct RayView<F> {
    width: u32,
    height: u32,
    forward: DVec3,
    ray: F,
    parameters: serde_json::Value,
}

impl<F: Fn(f64, f64) -> (DVec3, DVec3) + Sync> RayView<F> {
    /// Makes a view of width × height pixels from a function that returns origin and direction of the ray at (x, y), in pixels.
    ///
    /// Depth is measured along the ray through the image's middle, the camera's axis: it is the distance from the image
    /// plane, not along each ray. `parameters` is written to the image file unchanged.
    pub fn new(width: u32, height: u32, ray: F, parameters: serde_json::Value) -> Self {
        let (_, forward) = ray(0.5 * f64::from(width), 0.5 * f64::from(height));
        Self {
            width,
            height,
            forward: forward.normalize_or_zero(),
            ray,
            parameters,
        }
    }
}

impl<F: Fn(f64, f64) -> (DVec3, DVec3) + Sync> View for RayView<F> {
    fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    fn sight(&self, x: f64, y: f64) -> Option<Sight> {
        let (origin, direction) = (self.ray)(x, y);
        Some(Sight::Ray {
            origin,
            direction,
            depth_axis: self.forward,
        })
    }

    fn description(&self) -> ViewDescription {
        ViewDescription::Perspective(self.parameters.clone())
    }
}
