//! Errors of images.

use std::path::PathBuf;

use thiserror::Error;

use crate::printable::{printable_message, quoted};

/// An image cannot be rendered, written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A direct pass needs the indirect irradiance, which is missing.
    #[error("a direct pass needs the indirect irradiance F (B - E) of every patch")]
    MissingIndirect,
    /// The view has more pixels than an image file can hold.
    #[error("an image of {width} x {height} pixels is too large: at most {limit} pixels in all, and 2^31 - 1 a side")]
    TooLarge {
        /// The width in pixels.
        width: u64,
        /// The height in pixels.
        height: u64,
        /// The largest number of pixels.
        limit: u64,
    },
    /// The view has no pixels: an image side of zero, or an unfolded view without a planar surface.
    #[error("the view has no pixels; an unfolded view needs at least one planar surface")]
    Empty,
    /// The file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The file is no OpenEXR file, or a damaged one.
    #[error("{path} is not a readable OpenEXR file: {}", printable_message(.reason))]
    NotExr {
        /// The file.
        path: PathBuf,
        /// The message of the decoder.
        reason: String,
    },
    /// The file lacks an attribute that `radiosity render` writes.
    #[error("{path} has no attribute \"{name}\": it was not written by `radiosity render`")]
    MissingAttribute {
        /// The file.
        path: PathBuf,
        /// The attribute.
        name: &'static str,
    },
    /// An attribute cannot be understood.
    #[error("{path}: the attribute \"{name}\" is damaged: {}", printable_message(.reason))]
    BadAttribute {
        /// The file.
        path: PathBuf,
        /// The attribute.
        name: &'static str,
        /// The error in the attribute.
        reason: String,
    },
    /// A version with another layout wrote the attributes.
    #[error("{path} has attributes of format {}, this program reads format {expected}", quoted(.found))]
    WrongFormat {
        /// The file.
        path: PathBuf,
        /// The format of the file.
        found: String,
        /// The format that is understood.
        expected: u32,
    },
    /// A pixel is not a finite number: the light leaves the range of f32.
    #[error("pixel {pixel} of the layer \"{layer}\" overflows f32; lower the exitances (`Ke`) of the scene")]
    Overflow {
        /// The layer.
        layer: String,
        /// The pixel, counted along the rows from the upper left one.
        pixel: usize,
    },
    /// The caller asked to stop.
    #[error("the rendering was interrupted")]
    Interrupted,
    /// An image could not be encoded.
    #[error("the image cannot be encoded: {0}")]
    Encode(String),
}
