//! The preview beside an image: 8-bit sRGB.

use std::io::Write as _;
use std::path::Path;

use ::png::{ColorType, EncodingError, SrgbRenderingIntent};

use super::error::RenderError;
use super::image::Image;
use super::tone_map::tone_map;
use crate::whole_file;

/// Writes a tone-mapped PNG of the image's `R,G,B` or `Y` layers; the file is replaced atomically.
///
/// The curve is that of [`tone_map`]; the file states that its values are sRGB.
///
/// # Errors
/// [`RenderError::Io`], [`RenderError::Encode`].
pub fn write(path: &Path, image: &Image) -> Result<(), RenderError> {
    let bytes = encode(image)?;
    whole_file::write(path, |writer| writer.write_all(&bytes)).map_err(|source| RenderError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Returns the PNG that [`write`](write()) writes.
///
/// # Errors
/// [`RenderError::Encode`].
pub fn encode(image: &Image) -> Result<Vec<u8>, RenderError> {
    let size = [image.width(), image.height()];
    let srgb = Some(SrgbRenderingIntent::Perceptual);
    encode_bytes(size, ColorType::Rgb, srgb, &tone_map(image)).map_err(|error| RenderError::Encode(error.to_string()))
}

/// Returns the PNG of pixels with a byte for each channel, row by row from the top.
pub(crate) fn encode_bytes(
    [width, height]: [usize; 2],
    colour: ColorType,
    srgb: Option<SrgbRenderingIntent>,
    pixels: &[u8],
) -> Result<Vec<u8>, EncodingError> {
    let side = |n: usize| u32::try_from(n).map_err(|_| EncodingError::LimitsExceeded);
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, side(width)?, side(height)?);
    encoder.set_color(colour);
    encoder.set_depth(::png::BitDepth::Eight);
    if let Some(intent) = srgb {
        encoder.set_source_srgb(intent);
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}
