//! The expected content of a pixel.

use glam::DVec3;

use super::light::{Drawn, Lit};
use crate::scene::SurfaceId;

/// Exitance and reflectance.
pub(super) type Material = ([f64; 3], [f64; 3]);

/// The properties of a pixel that follow from scene and view.
#[derive(Clone, Debug)]
pub(super) enum PixelAnswer {
    /// No sample of the pixel is on a surface.
    Background,
    /// The surfaces of some samples depend on rounding.
    Border,
    /// The surfaces of all samples are certain.
    Surface(Box<Shown>),
}

/// The content of a pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Shown {
    /// The mean reflectance over the samples, backs counting as 0, if known.
    pub(super) albedo: Option<[f64; 3]>,
    /// The surface, if all samples show the same.
    pub(super) surface: Option<SurfaceId>,
    /// The number of the plane, if all samples show the same.
    pub(super) plane: Option<u32>,
    /// The material, if all samples show the same.
    pub(super) material: Option<Material>,
    /// The exact direct irradiance, and its change over the rays' offset, if known.
    pub(super) irradiance: Option<Lit>,
    /// True if an occluder hides a part of an emitter.
    pub(super) shaded: bool,
    /// The result of the image's own shadow rays, where an emitter is partially visible and they decide.
    pub(super) drawn: Option<Drawn>,
    /// The greatest change of the irradiance by the rounding of corners.
    pub(super) rounding: [f64; 3],
    /// True if a sample shows the front of a face: all other pixels are black, whatever the light.
    pub(super) front: bool,
}

impl PixelAnswer {
    pub(super) fn on_surface(&self) -> bool {
        !matches!(self, Self::Background)
    }

    /// Returns whether the pixel shows only backs of faces: it is black, whatever the light.
    pub(super) fn is_back(&self) -> bool {
        self.shown().is_some_and(|shown| !shown.front)
    }

    pub(super) fn is_checked(&self) -> bool {
        self.irradiance().is_some() && !self.is_back()
    }

    pub(super) fn shown(&self) -> Option<&Shown> {
        match self {
            Self::Surface(shown) => Some(shown),
            _ => None,
        }
    }

    pub(super) fn is_shaded(&self) -> bool {
        self.shown().is_some_and(|shown| shown.shaded)
    }

    pub(super) fn irradiance(&self) -> Option<Lit> {
        self.shown().and_then(|shown| shown.irradiance)
    }

    pub(super) fn drawn(&self) -> Option<&Drawn> {
        self.shown().and_then(|shown| shown.drawn.as_ref())
    }
}

/// The content of the centre of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Centre {
    /// Unknown: it depends on rounding.
    Unsure,
    Nothing,
    Face {
        /// The number of the face, or of another one in its plane if it is not `alone`.
        face: u32,
        /// True if no other face of its plane is near.
        alone: bool,
        point: DVec3,
        /// The greatest movement of the point by rounding, in m.
        slack: f64,
    },
}
