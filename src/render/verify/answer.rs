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
    /// Which samples are on which surface depends on rounding.
    Border,
    /// All samples see the same for certain.
    Surface(Box<Shown>),
}

/// The content of a pixel.
#[derive(Clone, Debug, Default)]
pub(super) struct Shown {
    /// The mean reflectance over the samples, backs counting as 0, where it is known.
    pub(super) albedo: Option<[f64; 3]>,
    /// The surface, where all samples show one.
    pub(super) surface: Option<SurfaceId>,
    /// The number of the plane, where all samples show one.
    pub(super) plane: Option<u32>,
    /// The material, where all samples show one.
    pub(super) material: Option<Material>,
    /// The exact direct irradiance, and its change over the rays' offset, where it is known.
    pub(super) irradiance: Option<Lit>,
    /// Whether something hides a part of an emitter.
    pub(super) shaded: bool,
    /// The result of the picture's own shadow rays, where an emitter is hidden in part and they decide.
    pub(super) drawn: Option<Drawn>,
    /// How far the rounding of corners may change the irradiance.
    pub(super) rounding: [f64; 3],
    /// Whether a sample shows the front of a face: all others are black, whatever the light.
    pub(super) front: bool,
}

impl PixelAnswer {
    pub(super) fn on_surface(&self) -> bool {
        !matches!(self, Self::Background)
    }

    /// Returns whether the pixel shows backs of faces, and no front: it is black, and says nothing of the light.
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
    /// That depends on rounding.
    Unsure,
    Nothing,
    Face {
        /// The number of the face, or of another one in its plane if it is not `alone`.
        face: u32,
        /// Whether no other face of its plane is near.
        alone: bool,
        point: DVec3,
        /// How far rounding may move the point, in m.
        slack: f64,
    },
}
