//! OpenEXR files with the image's layers and the input of verification.

use std::collections::BTreeMap;
use std::io::{BufReader, Cursor, Write as _};
use std::path::Path;

use ::exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Layer as ExrLayer, Layers};
use ::exr::meta::MetaData;
use ::exr::meta::attribute::{AttributeValue, LineOrder, Text};
use ::exr::meta::header::{Header, ImageAttributes, LayerAttributes};
use ::exr::prelude::{Blocks, Compression, ReadChannels, ReadLayers, WritableImage, f16, read as reader};
use serde::{Deserialize, Serialize};

use super::attributes::{AttributeError, Attributes, FORMAT};
use super::error::RenderError;
use super::image::{Image, Layer, Samples};
use crate::input_file;
use crate::whole_file;

/// How the numbers of a file are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Pixels {
    /// 32-bit floats.
    #[default]
    F32,
    /// 16-bit floats for colours and normals.
    ///
    /// 11 bits, up to 65504: `R,G,B`, `irradiance.*`, `radiosity.*`, `direct.*`, `albedo.*`, `N.*`.
    ///
    /// A layer with a value beyond their range stays at 32 bits, as do all others: positions, depth, errors and variances.
    F16,
}

/// How the layers of a file are arranged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Parts {
    /// All layers in one part.
    ///
    /// Programs group them by the dots of their names.
    #[default]
    Single,
    /// A part for each group of layers.
    ///
    /// They are `rgba` (the picture), `depth`, and the names before the dots. Channels keep their full names.
    Multi,
}

/// Writes an image with its attributes in one part; see [`write_parts`].
///
/// # Errors
/// As [`write_parts`].
pub fn write(path: &Path, image: &Image, attributes: &Attributes) -> Result<(), RenderError> {
    write_parts(path, image, attributes, Parts::Single)
}

/// Writes an image with its attributes; the file is replaced atomically.
///
/// Scan lines, ZIP in blocks of 16 lines, every layer a channel of floats (as `attributes.pixels` sets) or of 32-bit unsigned integers.
/// With several parts the attributes are those of the first. Equal arguments give equal bytes.
///
/// # Errors
/// [`RenderError::Io`], [`RenderError::Encode`]; [`RenderError::Overflow`] for light that is not a finite number.
pub fn write_parts(path: &Path, image: &Image, attributes: &Attributes, parts: Parts) -> Result<(), RenderError> {
    let bytes = encode(image, attributes, parts)?;
    whole_file::write(path, |writer| writer.write_all(&bytes)).map_err(|source| RenderError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Reads an image that [`write()`] wrote.
///
/// # Errors
/// [`RenderError::Io`] if the file cannot be read, [`RenderError::NotExr`] if it is no EXR file or damaged,
/// [`RenderError::MissingAttribute`], [`RenderError::BadAttribute`] and [`RenderError::WrongFormat`] if its attributes are incomplete or unreadable.
pub fn read(path: &Path) -> Result<(Image, Attributes), RenderError> {
    let bytes = input_file::read(path, u64::MAX).map_err(|source| RenderError::Io {
        path: path.to_owned(),
        source,
    })?;
    decode(path, &bytes)
}

fn encode(image: &Image, attributes: &Attributes, parts: Parts) -> Result<Vec<u8>, RenderError> {
    let failed = |reason: &dyn std::fmt::Display| RenderError::Encode(reason.to_string());
    let mut texts = LayerAttributes::default();
    for (name, text) in attributes.to_texts().map_err(|error| failed(&error))? {
        texts
            .other
            .insert(Text::from(name), AttributeValue::Text(Text::from(text.as_str())));
    }
    let mut groups: BTreeMap<&str, Vec<AnyChannel<FlatSamples>>> = BTreeMap::new();
    for layer in image.layers() {
        if let Samples::F32(values) = &layer.samples
            && let Some(pixel) = values.iter().position(|value| layer.is_light() && !value.is_finite())
        {
            let layer = layer.name.clone();
            return Err(RenderError::Overflow { layer, pixel });
        }
        let group = match parts {
            Parts::Single => PICTURE,
            Parts::Multi => part_of(&layer.name),
        };
        let channel = AnyChannel::new(layer.name.as_str(), stored(layer, attributes.pixels));
        groups.entry(group).or_default().push(channel);
    }
    // The `rgba` part comes first, as programs without support for parts show it.
    let mut order: Vec<&str> = groups.keys().copied().collect();
    order.sort_by_key(|&name| (name != PICTURE, name));
    let layers = order.into_iter().enumerate().map(|(k, name)| {
        let mut header = if k == 0 {
            texts.clone()
        } else {
            LayerAttributes::default()
        };
        header.layer_name = (parts == Parts::Multi).then(|| Text::from(name));
        let encoding = Encoding {
            compression: Compression::ZIP16,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        };
        let channels = groups.remove(name).unwrap_or_default().into_iter().collect();
        let size = (image.width(), image.height());
        ExrLayer::new(size, header, encoding, AnyChannels::sort(channels))
    });
    let layers: Layers<AnyChannels<FlatSamples>> = layers.collect();
    let size = ImageAttributes::with_size((image.width(), image.height()));
    let mut bytes = Cursor::new(Vec::new());
    ::exr::image::Image::from_layers(size, layers)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| failed(&error))?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes).ok_or_else(|| failed(&"its header cannot be sorted"))?;
    Ok(bytes)
}

/// The part of `R,G,B`.
const PICTURE: &str = "rgba";

/// Returns the part that a layer belongs to.
fn part_of(layer: &str) -> &str {
    match layer {
        "R" | "G" | "B" | "Y" => PICTURE,
        "Z" => "depth",
        _ => layer.split_once('.').map_or(layer, |(group, _)| group),
    }
}

/// The groups of layers that may be stored as 16-bit floats.
const HALVED: [&str; 6] = [PICTURE, "irradiance", "radiosity", "direct", "albedo", "N"];

fn stored(layer: &Layer, pixels: Pixels) -> FlatSamples {
    match &layer.samples {
        Samples::U32(values) => FlatSamples::U32(values.clone()),
        Samples::F32(values) => {
            let fits = || values.iter().all(|value| value.abs() <= f16::MAX.to_f32());
            let halved = pixels == Pixels::F16 && layer.name != "Y" && HALVED.contains(&part_of(&layer.name));
            if halved && fits() {
                FlatSamples::F16(values.iter().map(|&value| f16::from_f32(value)).collect())
            } else {
                FlatSamples::F32(values.clone())
            }
        }
    }
}

/// Sorts the attributes of each part by their names: the encoder's own order changes from run to run.
///
/// The headers keep their lengths, so the offsets of the pixel blocks stay valid. Returns `None` if the bytes are not such headers.
fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    const START: usize = 8; // magic number, version
    const MULTI_PART: u8 = 0x10; // of the version's second byte
    let is_multi_part = bytes.get(5)? & MULTI_PART != 0;
    let mut at = sort_header(bytes, START)?;
    // An empty header ends a list of several.
    while is_multi_part && *bytes.get(at)? != 0 {
        at = sort_header(bytes, at)?;
    }
    Some(())
}

/// Sorts the header that starts at `start`, and returns its end.
fn sort_header(bytes: &mut [u8], start: usize) -> Option<usize> {
    let mut attributes: Vec<&[u8]> = Vec::new();
    let mut at = start;
    // An attribute is name, 0, type, 0, length as i32, value; an empty name ends the list.
    while *bytes.get(at)? != 0 {
        let after_text = |from: usize| Some(from + bytes.get(from..)?.iter().position(|&byte| byte == 0)? + 1);
        let length_at = after_text(after_text(at)?)?;
        let length: [u8; 4] = bytes.get(length_at..length_at + 4)?.try_into().ok()?;
        let end = length_at + 4 + usize::try_from(i32::from_le_bytes(length)).ok()?;
        attributes.push(bytes.get(at..end)?);
        at = end;
    }
    // The bytes begin with the name, and with its final 0 no name is a prefix of another.
    attributes.sort_unstable();
    let sorted = attributes.concat();
    bytes.get_mut(start..at)?.copy_from_slice(&sorted);
    Some(at + 1)
}

/// The greatest number of bytes of pixels in one byte of a file.
///
/// Deflate expands a byte to at most 1032, of which `PXR24` makes 4/3, as it stores 3 of 4 bytes; other compressions expand less.
const BYTES_OF_ONE: u128 = 1376;

/// Returns the sum over all pixels of `of_pixel` for their header.
fn promised(meta: &MetaData, of_pixel: impl Fn(&Header) -> usize) -> u128 {
    let of_header = |header: &Header| {
        let [width, height] = [header.layer_size.x(), header.layer_size.y()].map(|n| n as u128);
        width.saturating_mul(height).saturating_mul(of_pixel(header) as u128)
    };
    meta.headers.iter().map(of_header).fold(0, u128::saturating_add)
}

/// The memory for each number of a file while it is read and verified: an image of 1024 by 768 pixels and 33 layers needs 8.2 bytes.
const NUMBER_BYTE: u128 = 10;

/// Returns the memory, in bytes, for reading a file and [verifying](super::verify::verify) it, as its header states.
///
/// The size of a pipe's content is unknown and counts as 0.
///
/// # Errors
/// [`RenderError::Io`], [`RenderError::NotExr`].
pub fn reading_byte(path: &Path) -> Result<u64, RenderError> {
    let failed = |source| RenderError::Io {
        path: path.to_owned(),
        source,
    };
    let Some(file) = input_file::open_to_look(path).map_err(failed)? else {
        return Ok(0);
    };
    let in_file = file.metadata().map_err(failed)?.len();
    let read = MetaData::read_from_buffered(BufReader::new(file), false);
    let held = read.and_then(|meta| expect_held(&meta, in_file).map(|()| meta));
    let meta = held.map_err(|error| RenderError::NotExr {
        path: path.to_owned(),
        reason: error.to_string(),
    })?;
    let numbers = promised(&meta, |header| header.channels.list.len());
    let byte = NUMBER_BYTE.saturating_mul(numbers).saturating_add(in_file.into());
    Ok(u64::try_from(byte).unwrap_or(u64::MAX))
}

/// Refuses a header that states more pixels than its file can hold: the decoder allocates them at once, and aborts the program if this fails.
fn expect_held(meta: &MetaData, in_file: u64) -> Result<(), ::exr::error::Error> {
    let promised = promised(meta, |header| header.channels.bytes_per_pixel);
    if promised <= BYTES_OF_ONE * u128::from(in_file) {
        return Ok(());
    }
    let reason = format!("its header promises {promised} bytes of pixels, and it has {in_file} bytes in all");
    Err(::exr::error::Error::Invalid(reason.into()))
}

fn decode(path: &Path, bytes: &[u8]) -> Result<(Image, Attributes), RenderError> {
    let path = || path.to_owned();
    let damaged = |error: ::exr::error::Error| RenderError::NotExr {
        path: path(),
        reason: error.to_string(),
    };
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(damaged)?;
    expect_held(&meta, bytes.len() as u64).map_err(damaged)?;
    let file = reader()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(damaged)?;
    let parts = file.layer_data;
    let text = |name: &'static str| {
        let mut found = parts
            .iter()
            .filter_map(|part| part.attributes.other.get(name.as_bytes()));
        match found.next() {
            Some(AttributeValue::Text(text)) => Some(text.to_string()),
            _ => None,
        }
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
    let size = parts.first().map_or((0, 0), |part| (part.size.x(), part.size.y()));
    if let Some(other) = parts.iter().find(|part| (part.size.x(), part.size.y()) != size) {
        return Err(RenderError::NotExr {
            path: path(),
            reason: format!("its parts differ in size: {size:?} and {:?}", other.size),
        });
    }
    let mut image = Image::new(size.0, size.1);
    for channel in parts.into_iter().flat_map(|part| part.channel_data.list) {
        let samples = match channel.sample_data {
            FlatSamples::F32(values) => Samples::F32(values),
            FlatSamples::U32(values) => Samples::U32(values),
            FlatSamples::F16(values) => Samples::F32(values.into_iter().map(f32::from).collect()),
        };
        image.insert(&channel.name.to_string(), samples);
    }
    Ok((image, attributes))
}
