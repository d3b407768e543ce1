//! Arrays of VTK's XML files: text, base64 inside of their element or appended, raw appended, each whole or in blocks that zlib compressed.

use std::io::Read as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use glam::DVec3;

use super::super::cells::{Array, Values};
use super::super::scalar::Scalar;
use super::super::source::Binary;
use super::dataset::Dataset;
use crate::scene::{MAX_COORDINATE, SceneErrorKind};

/// How the arrays of a file are written.
#[derive(Default)]
pub(super) struct Encoding<'a> {
    pub(super) is_little: bool,
    /// True if headers have 8 bytes a number, else 4.
    pub(super) has_wide_headers: bool,
    pub(super) compressor: Option<String>,
    /// Where appended arrays begin, in order.
    pub(super) offsets: Vec<usize>,
    /// The appended data.
    appended: &'a [u8],
    is_base64: bool,
}

/// Where the numbers of an array are.
pub(super) enum Content<'a> {
    /// In its element, as text.
    Ascii(&'a str),
    /// In its element, in base64.
    Base64(&'a str),
    /// Behind the XML, from a place on.
    Appended(usize),
}

impl<'a> Content<'a> {
    /// Takes note of the text of the element.
    pub(super) fn write(&mut self, text: &'a str) {
        match self {
            Self::Ascii(own) | Self::Base64(own) if own.trim().is_empty() => *own = text,
            _ => {}
        }
    }
}

/// An array as its element describes it.
pub(super) struct DataArray<'a> {
    pub(super) name: String,
    kind: Scalar,
    n_components: u64,
    pub(super) content: Content<'a>,
}

/// The numbers of an array, as bytes or as words.
enum Numbers<'a> {
    Bytes(Vec<u8>),
    Words(&'a str),
}

impl<'a> Encoding<'a> {
    /// Takes note of what is appended, from `<AppendedData` on.
    pub(super) fn append(&mut self, bytes: &'a [u8]) {
        let end = bytes.iter().position(|byte| *byte == b'>').unwrap_or(bytes.len());
        let (tag, rest) = bytes.split_at(end);
        self.is_base64 = tag.windows(6).any(|window| window == b"base64");
        let start = rest
            .iter()
            .position(|byte| *byte == b'_')
            .map_or(rest.len(), |at| at + 1);
        self.appended = &rest[start..];
    }

    /// Reads a number of a header.
    fn header(&self, left: &mut &[u8]) -> Result<u64, SceneErrorKind> {
        let size = if self.has_wide_headers { 8 } else { 4 };
        let (own, rest) = left
            .split_at_checked(size)
            .ok_or(SceneErrorKind::CutShort { what: "an array" })?;
        *left = rest;
        Ok(if self.has_wide_headers {
            u64::of(own, self.is_little)
        } else {
            u32::of(own, self.is_little).into()
        })
    }

    /// Returns the bytes of an array; `limit` bounds them where it is known.
    fn bytes(
        &self,
        content: &Content<'a>,
        limit: u64,
        room: impl Fn(u64) -> Result<(), SceneErrorKind>,
    ) -> Result<Vec<u8>, SceneErrorKind> {
        const WHAT: &str = "an array";
        let encoded = match content {
            Content::Ascii(text) | Content::Base64(text) => text.as_bytes(),
            Content::Appended(offset) => {
                let next = self
                    .offsets
                    .iter()
                    .find(|next| **next > *offset)
                    .filter(|_| self.is_base64);
                let end = next.map_or(self.appended.len(), |next| (*next).min(self.appended.len()));
                self.appended
                    .get(*offset..end)
                    .ok_or(SceneErrorKind::CutShort { what: WHAT })?
            }
        };
        let is_base64 = self.is_base64 || !matches!(content, Content::Appended(_));
        let decoded;
        let mut left = if is_base64 {
            room(encoded.len() as u64 / 4 * 3)?;
            decoded = decoded_base64(encoded)?;
            &decoded[..]
        } else {
            encoded
        };
        let Some(compressor) = &self.compressor else {
            let n = self.header(&mut left)?;
            let end = usize::try_from(n).ok().filter(|end| *end <= left.len());
            let room_left = left.len() as u64;
            let end = end.ok_or(SceneErrorKind::Truncated {
                what: "bytes of an array",
                n,
                room: room_left,
            })?;
            room(n)?;
            return Ok(left[..end].to_vec());
        };
        if compressor != "vtkZLibDataCompressor" {
            let message = format!("arrays of `{compressor}` are not read; save with zlib or without compression");
            return Err(SceneErrorKind::unsupported(message));
        }
        let n_blocks = self.header(&mut left)?;
        let [whole, last] = [self.header(&mut left)?, self.header(&mut left)?];
        let size = if self.has_wide_headers { 8 } else { 4 };
        let blocks_room = left.len() as u64 / size;
        if n_blocks > blocks_room {
            return Err(SceneErrorKind::Truncated {
                what: "blocks of an array",
                n: n_blocks,
                room: blocks_room,
            });
        }
        let sizes = (0..n_blocks)
            .map(|_| self.header(&mut left))
            .collect::<Result<Vec<_>, _>>()?;
        let mut bytes = Vec::new();
        for (k, n_own) in (1..).zip(&sizes) {
            let (own, rest) = usize::try_from(*n_own)
                .ok()
                .and_then(|n_own| left.split_at_checked(n_own))
                .ok_or(SceneErrorKind::CutShort { what: WHAT })?;
            left = rest;
            let length = if k == n_blocks && last > 0 { last } else { whole };
            // No more than is stated, nor than is of use, nor than zlib can make of so many bytes.
            let most = length
                .min(limit.saturating_sub(bytes.len() as u64))
                .min((own.len() as u64).saturating_mul(MAX_RATIO));
            room(most)?;
            ZlibDecoder::new(own)
                .take(most)
                .read_to_end(&mut bytes)
                .map_err(|_| SceneErrorKind::malformed("data that zlib compressed", "others"))?;
        }
        Ok(bytes)
    }
}

/// The most bytes that zlib makes of one.
const MAX_RATIO: u64 = 1032;

/// Returns bytes that are written in base64, in one or more runs that `=` ends.
fn decoded_base64(text: &[u8]) -> Result<Vec<u8>, SceneErrorKind> {
    let is_sign = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'/' | b'=');
    let mut left: Vec<u8> = text
        .iter()
        .copied()
        .filter(|byte| !byte.is_ascii_whitespace())
        .take_while(is_sign)
        .collect();
    // What is cut off its last group of four is told by what misses of the array.
    left.truncate(left.len() / 4 * 4);
    let mut bytes = Vec::with_capacity(left.len() / 4 * 3);
    let mut rest = &left[..];
    while !rest.is_empty() {
        let first = rest.iter().position(|byte| *byte == b'=').unwrap_or(rest.len());
        let n_signs = rest[first..].iter().take_while(|byte| **byte == b'=').count();
        let (run, behind) = rest.split_at(first + n_signs);
        STANDARD
            .decode_vec(run, &mut bytes)
            .map_err(|_| SceneErrorKind::malformed("base64", String::from_utf8_lossy(run)))?;
        rest = behind;
    }
    Ok(bytes)
}

/// An attribute of an element, by its name.
type Attribute<'t> = &'t dyn Fn(&str) -> Option<String>;

impl<'a> DataArray<'a> {
    /// Begins an array; an error is what was expected, and what was found.
    pub(super) fn begun(attribute: Attribute<'_>) -> Result<Self, (&'static str, String)> {
        let kind = attribute("type").unwrap_or_default();
        let format = attribute("format").unwrap_or_else(|| "ascii".to_owned());
        let content = match &*format {
            "ascii" => Content::Ascii(""),
            "binary" => Content::Base64(""),
            "appended" => {
                let offset = attribute("offset").unwrap_or_default();
                Content::Appended(
                    offset
                        .trim()
                        .parse()
                        .map_err(|_| ("an offset of appended data", offset))?,
                )
            }
            _ => return Err(("`ascii`, `binary` or `appended`", format)),
        };
        let n_components = attribute("NumberOfComponents").and_then(|n| n.trim().parse().ok());
        Ok(Self {
            name: attribute("Name").unwrap_or_default(),
            kind: Scalar::of_xml(&kind).ok_or(("a type of numbers such as `Float64`", kind))?,
            n_components: n_components.unwrap_or(1),
            content,
        })
    }

    fn numbers(
        &self,
        encoding: &Encoding<'a>,
        n: Option<u64>,
        room: impl Fn(u64) -> Result<(), SceneErrorKind>,
    ) -> Result<Numbers<'a>, SceneErrorKind> {
        if let Content::Ascii(text) = self.content {
            return Ok(Numbers::Words(text));
        }
        let limit = n.map_or(u64::MAX, |n| n.saturating_mul(self.kind.bytes() as u64));
        encoding.bytes(&self.content, limit, room).map(Numbers::Bytes)
    }

    /// Adds the coordinates of points.
    pub(super) fn points(
        &self,
        encoding: &Encoding<'a>,
        n: u64,
        room: impl Fn(u64) -> Result<(), SceneErrorKind>,
        dataset: &mut Dataset,
    ) -> Result<(), SceneErrorKind> {
        let mut coordinates = Vec::new();
        let mut push = |x: f64, token: &dyn Fn() -> String| {
            if x.is_nan() || x.abs() > MAX_COORDINATE {
                return Err(SceneErrorKind::BadCoordinate { token: token() });
            }
            coordinates.push(x);
            Ok(())
        };
        match self.numbers(encoding, Some(n), room)? {
            Numbers::Words(text) => {
                for word in text.split_ascii_whitespace() {
                    let x = word.parse().unwrap_or(f64::NAN);
                    push(x, &|| word.to_owned())?;
                    dataset.written.see_value(word, x);
                }
            }
            Numbers::Bytes(bytes) => {
                for own in bytes.chunks_exact(self.kind.bytes()) {
                    let x = match self.kind {
                        Scalar::F32 => f64::from(f32::of(own, encoding.is_little)),
                        Scalar::F64 => f64::of(own, encoding.is_little),
                        kind => kind.whole(own, encoding.is_little).unwrap_or(-1) as f64,
                    };
                    push(x, &|| x.to_string())?;
                    #[expect(clippy::cast_possible_truncation, reason = "it was an f32")]
                    match self.kind {
                        Scalar::F32 => dataset.written.see_single(x as f32),
                        Scalar::F64 => dataset.written.see_binary(x),
                        _ => {}
                    }
                }
            }
        }
        if (coordinates.len() as u64) < n {
            return Err(SceneErrorKind::Truncated {
                what: "coordinates",
                n,
                room: coordinates.len() as u64,
            });
        }
        let n = usize::try_from(n).unwrap_or(usize::MAX);
        let points = coordinates[..n].as_chunks::<3>().0;
        dataset
            .points
            .extend(points.iter().map(|point| DVec3::from_array(*point)));
        Ok(())
    }

    /// Returns the numbers of an array of whole ones: so many, if that is known, or all.
    pub(super) fn whole(
        &self,
        encoding: &Encoding<'a>,
        n: Option<u64>,
        room: impl Fn(u64) -> Result<(), SceneErrorKind>,
    ) -> Result<Vec<i64>, SceneErrorKind> {
        let values: Vec<i64> = match self.numbers(encoding, n, room)? {
            Numbers::Words(text) => text
                .split_ascii_whitespace()
                .map(|word| {
                    word.parse()
                        .map_err(|_| SceneErrorKind::malformed("a whole number", word))
                })
                .collect::<Result<_, _>>()?,
            Numbers::Bytes(bytes) => bytes
                .chunks_exact(self.kind.bytes())
                // An index that is no whole number is out of range.
                .map(|own| self.kind.whole(own, encoding.is_little).unwrap_or(-1))
                .collect(),
        };
        match n {
            Some(n) if (values.len() as u64) < n => {
                let (what, n_there) = ("values of an array", values.len() as u64);
                Err(SceneErrorKind::Truncated { what, n, room: n_there })
            }
            _ => Ok(values),
        }
    }

    /// Returns whether its values may name surfaces: whole numbers, or texts, one for each cell.
    pub(super) fn may_name(&self) -> bool {
        self.n_components == 1 && !matches!(self.kind, Scalar::F32 | Scalar::F64)
    }

    /// Returns the values for cells, if there is one for each.
    pub(super) fn names(
        &self,
        encoding: &Encoding<'a>,
        n_cells: u64,
        room: impl Fn(u64) -> Result<(), SceneErrorKind>,
    ) -> Result<Option<Values>, SceneErrorKind> {
        let limit = (self.kind != Scalar::Text).then_some(n_cells);
        let values = if self.kind == Scalar::Text {
            let bytes = match self.numbers(encoding, limit, room)? {
                Numbers::Bytes(bytes) => bytes,
                // The numbers of bytes.
                Numbers::Words(text) => text
                    .split_ascii_whitespace()
                    .filter_map(|word| word.parse().ok())
                    .collect(),
            };
            let texts = bytes.split(|byte| *byte == 0);
            let mut texts: Vec<String> = texts.map(|text| String::from_utf8_lossy(text).into_owned()).collect();
            // Each ends in a zero.
            texts.pop();
            Values::Text(texts)
        } else {
            Values::Whole(self.whole(encoding, limit, room)?)
        };
        let n = match &values {
            Values::Whole(values) => values.len(),
            Values::Text(values) => values.len(),
        };
        Ok((n as u64 == n_cells).then_some(values))
    }
}

/// Puts the arrays of a piece behind those of the pieces before it, which have so many cells.
pub(super) fn join(known: &mut Vec<Array>, new: Vec<Array>, n_cells_before: usize) {
    if n_cells_before == 0 {
        *known = new;
        return;
    }
    for array in new {
        let Some(old) = known.iter_mut().find(|old| old.name == array.name) else {
            continue;
        };
        match (&mut old.values, array.values) {
            (Values::Whole(before), Values::Whole(behind)) => before.extend(behind),
            (Values::Text(before), Values::Text(behind)) => before.extend(behind),
            _ => {}
        }
    }
}
