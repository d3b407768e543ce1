//! OpenEXR files: the image's layers and what verification needs.

use std::io::{Cursor, Write as _};
use std::path::Path;

use ::exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Layer as ExrLayer};
use ::exr::meta::attribute::{AttributeValue, LineOrder, Text};
use ::exr::meta::header::LayerAttributes;
use ::exr::prelude::{Blocks, Compression, ReadChannels, ReadLayers, WritableImage, read as reader};

use super::attributes::{AttributeError, Attributes, FORMAT};
use super::error::RenderError;
use super::image::{Image, Samples};
use crate::whole_file;

/// Writes an image with its attributes, whole or not at all.
///
/// One part of scan lines, ZIP in blocks of 16 lines, every layer a channel of 32-bit float or unsigned integer. Equal arguments
/// give equal bytes.
///
/// # Errors
/// [`RenderError::Io`], [`RenderError::Encode`].
pub fn write(path: &Path, image: &Image, attributes: &Attributes) -> Result<(), RenderError> {
    let bytes = encode(image, attributes)?;
    whole_file::write(path, |writer| writer.write_all(&bytes)).map_err(|source| RenderError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Reads an image that [`write()`] wrote.
///
/// # Errors
/// [`RenderError::Io`] if the file cannot be read, [`RenderError::NotExr`] if it is no EXR file or damaged,
/// [`RenderError::MissingAttribute`], [`RenderError::BadAttribute`] and [`RenderError::WrongFormat`] if it says too little about itself.
pub fn read(path: &Path) -> Result<(Image, Attributes), RenderError> {
    let bytes = std::fs::read(path).map_err(|source| RenderError::Io {
        path: path.to_owned(),
        source,
    })?;
    decode(path, &bytes)
}

fn encode(image: &Image, attributes: &Attributes) -> Result<Vec<u8>, RenderError> {
    let failed = |reason: &dyn std::fmt::Display| RenderError::Encode(reason.to_string());
    let mut header = LayerAttributes::default();
    for (name, text) in attributes.to_texts().map_err(|error| failed(&error))? {
        header
            .other
            .insert(Text::from(name), AttributeValue::Text(Text::from(text.as_str())));
    }
    let channels = image.layers().iter().map(|layer| {
        let samples = match &layer.samples {
            Samples::F32(values) => FlatSamples::F32(values.clone()),
            Samples::U32(values) => FlatSamples::U32(values.clone()),
        };
        AnyChannel::new(layer.name.as_str(), samples)
    });
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = ExrLayer::new(
        (image.width(), image.height()),
        header,
        encoding,
        AnyChannels::sort(channels.collect()),
    );
    let mut bytes = Cursor::new(Vec::new());
    ::exr::image::Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| failed(&error))?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes).ok_or_else(|| failed(&"its header cannot be sorted"))?;
    Ok(bytes)
}

/// Puts the attributes of a single-part file into the order of their names: the encoder's own order changes from run to run.
///
/// The header keeps its length, so that the offsets of the pixel blocks stay right. Returns `None` if the bytes are no such header.
fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    const START: usize = 8; // magic number, version
    let mut attributes: Vec<&[u8]> = Vec::new();
    let mut at = START;
    // An attribute is name, 0, type, 0, length as i32, value; an empty name ends the list.
    while *bytes.get(at)? != 0 {
        let after_text = |from: usize| Some(from + bytes.get(from..)?.iter().position(|&byte| byte == 0)? + 1);
        let length_at = after_text(after_text(at)?)?;
        let length: [u8; 4] = bytes.get(length_at..length_at + 4)?.try_into().ok()?;
        let end = length_at + 4 + usize::try_from(i32::from_le_bytes(length)).ok()?;
        attributes.push(bytes.get(at..end)?);
        at = end;
    }
    // The name comes first in the bytes, and no name is the beginning of another without its 0.
    attributes.sort_unstable();
    let sorted = attributes.concat();
    bytes.get_mut(START..at)?.copy_from_slice(&sorted);
    Some(())
}

fn decode(path: &Path, bytes: &[u8]) -> Result<(Image, Attributes), RenderError> {
    let path = || path.to_owned();
    let damaged = |error: ::exr::error::Error| RenderError::NotExr {
        path: path(),
        reason: error.to_string(),
    };
    let file = reader()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let layer = file.layer_data;
    let text = |name: &'static str| match layer.attributes.other.get(name.as_bytes()) {
        Some(AttributeValue::Text(text)) => Some(text.to_string()),
        _ => None,
    };
    let attributes = Attributes::from_texts(text).map_err(|error| match error {
        AttributeError::Missing(name) => RenderError::MissingAttribute { path: path(), name },
        AttributeError::Format(found) => RenderError::WrongFormat {
            path: path(),
            found,
            expected: FORMAT,
        },
        AttributeError::Bad { name, reason } => RenderError::BadAttribute {
            path: path(),
            name,
            reason,
        },
    })?;
    let mut image = Image::new(layer.size.x(), layer.size.y());
    for channel in layer.channel_data.list {
        let samples = match channel.sample_data {
            FlatSamples::F32(values) => Samples::F32(values),
            FlatSamples::U32(values) => Samples::U32(values),
            FlatSamples::F16(values) => Samples::F32(values.into_iter().map(f32::from).collect()),
        };
        image.insert(&channel.name.to_string(), samples);
    }
    Ok((image, attributes))
}
