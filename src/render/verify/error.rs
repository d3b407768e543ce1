//! Errors of the verification of images.

use thiserror::Error;

use crate::printable::quoted;
use crate::render::error::RenderError;

/// An image cannot be verified.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] RenderError),
    /// The irradiance in the image is interpolated between patches: it depends on the mesh, not on the scene alone.
    #[error(
        "the image has no direct pass, only values interpolated between patches, which no closed form describes; \
         render it with a direct pass to verify it"
    )]
    NoDirectPass,
    /// The image shows the light of a sun or a sky.
    #[error("the image shows daylight, of which no closed form is known; render it without sun and sky to verify it")]
    Daylight,
    /// The file does not describe its camera.
    #[error("the image's description of its camera cannot be used: {}", quoted(.0))]
    BadCamera(String),
    /// A layer is missing.
    #[error("the image has no layer \"{}\"", quoted(.0))]
    MissingLayer(String),
    /// A pixel has a number of samples that the settings do not allow.
    #[error("the layer \"pixel_samples\" has a wrong number for pixel {pixel}: the image is damaged")]
    BadSamples {
        /// The pixel, counted along the rows from the upper left one.
        pixel: usize,
    },
    /// The description of the tiles does not fit the image or the scene.
    #[error("the image's description of its tiles does not fit it: {}", quoted(.0))]
    BadLayout(String),
    /// The description of the scene makes no scene.
    #[error("the image's description of its scene cannot be used: {}", quoted(.0))]
    BadScene(String),
    /// The surface of a field does not belong to the scene.
    #[error("the form factors are to \"{}\", which is no surface of the image's scene", quoted(.0))]
    NoSuchSurface(String),
    /// No surface has an exitance.
    #[error("no surface of the image's scene emits light: there is nothing to verify")]
    NoEmitter,
}
