//! Arrays of VTK's XML files: text, base64 inside of their element or appended, raw appended.

use std::io::Read as _;
use std::ops::Range;

use glam::DVec3;

use super::super::cells::{Array, Values};
use super::super::scalar::{Binary as _, Scalar};
use super::super::source::Source;
use super::dataset::Dataset;
use super::xml_bytes::{self, Encoding};
use crate::scene::{MAX_COORDINATE, SceneErrorKind};

/// The place of an array's numbers.
pub(super) enum Content {
    /// Text in its element, at a place of the file.
    Ascii(Range<u64>),
    /// Base64 in its element.
    Base64(Range<u64>),
    /// After the XML, from an offset.
    Appended(u64),
}

impl Content {
    /// Records the place of the element's text.
    pub(super) fn write(&mut self, place: Range<u64>) {
        match self {
            Self::Ascii(own) | Self::Base64(own) if own.is_empty() => *own = place,
            _ => {}
        }
    }
}

/// An array as its element describes it.
pub(super) struct DataArray {
    pub(super) name: String,
    kind: Scalar,
    n_components: u64,
    pub(super) content: Content,
}

/// Bytes of an array that are decoded at once.
const BLOCK: u64 = 1 << 20;

/// A number of an array.
#[derive(Clone, Copy)]
enum Number<'t> {
    Word(&'t str),
    Bytes(&'t [u8]),
}

/// An attribute of an element, by its name.
type Attribute<'t> = &'t dyn Fn(&str) -> Option<String>;

/// A file, and the encoding of its arrays.
type From<'f> = (&'f Source<'f>, &'f Encoding);

impl DataArray {
    /// Begins an array; an error is the expected and the found text.
    pub(super) fn begun(attribute: Attribute<'_>) -> Result<Self, (&'static str, String)> {
        let kind = attribute("type").unwrap_or_default();
        let format = attribute("format").unwrap_or_else(|| "ascii".to_owned());
        let content = match &*format {
            "ascii" => Content::Ascii(0..0),
            "binary" => Content::Base64(0..0),
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

    /// Reads the numbers one after another; `n` is the number needed, if known.
    fn numbers(
        &self,
        (source, encoding): From<'_>,
        n: Option<u64>,
        mut push: impl FnMut(Number<'_>) -> Result<(), SceneErrorKind>,
    ) -> Result<(), SceneErrorKind> {
        if let Content::Ascii(place) = &self.content {
            let mut cursor = source.cursor_over(place.start, place.end);
            while let Some(word) = cursor.word().map_err(|error| error.kind)? {
                push(Number::Word(word))?;
            }
            return Ok(());
        }
        let size = self.kind.bytes();
        let limit = n.map_or(u64::MAX, |n| n.saturating_mul(size as u64));
        let mut stream = encoding.bytes(source, &self.content, limit)?;
        let mut block = Vec::new();
        loop {
            // A byte yields at most one end of a cell.
            let room = source.expect_room(size_of::<usize>() as u64 * BLOCK);
            room.map_err(|error| error.kind)?;
            block.clear();
            let read = stream.by_ref().take(BLOCK).read_to_end(&mut block);
            let n_read = read.map_err(xml_bytes::kind_of)?;
            block.chunks_exact(size).try_for_each(|own| push(Number::Bytes(own)))?;
            if (n_read as u64) < BLOCK {
                return Ok(());
            }
        }
    }

    /// Adds the coordinates of points.
    pub(super) fn points(&self, from: From<'_>, n: u64, dataset: &mut Dataset) -> Result<(), SceneErrorKind> {
        let is_little = from.1.is_little;
        let mut point = Vec::with_capacity(3);
        let mut n_there = 0;
        self.numbers(from, Some(n), |number| {
            let x = match (number, self.kind) {
                (Number::Word(word), _) => word.parse().unwrap_or(f64::NAN),
                (Number::Bytes(own), Scalar::F32) => f32::of(own, is_little).into(),
                (Number::Bytes(own), Scalar::F64) => f64::of(own, is_little),
                (Number::Bytes(own), kind) => kind.whole(own, is_little).unwrap_or(-1) as f64,
            };
            if x.is_nan() || x.abs() > MAX_COORDINATE {
                let token = match number {
                    Number::Word(word) => word.to_owned(),
                    Number::Bytes(_) => x.to_string(),
                };
                return Err(SceneErrorKind::BadCoordinate { token });
            }
            #[expect(clippy::cast_possible_truncation, reason = "it was an f32")]
            match (number, self.kind) {
                (Number::Word(word), _) => dataset.written.see_value(word, x),
                (_, Scalar::F32) => dataset.written.see_single(x as f32),
                (_, Scalar::F64) => dataset.written.see_binary(x),
                _ => {}
            }
            n_there += 1;
            point.push(x);
            if let Ok(position) = point[..].try_into() {
                point.clear();
                if n_there <= n {
                    dataset.points.push(DVec3::from_array(position));
                }
            }
            Ok(())
        })?;
        expect_all(n_there, n, "coordinates")
    }

    /// Reads whole numbers, at least `n` of them if that is known.
    pub(super) fn whole(
        &self,
        from: From<'_>,
        n: Option<u64>,
        mut push: impl FnMut(i64) -> Result<(), SceneErrorKind>,
    ) -> Result<(), SceneErrorKind> {
        let mut n_there = 0;
        self.numbers(from, n, |number| {
            n_there += 1;
            push(match number {
                Number::Word(word) => word
                    .parse()
                    .map_err(|_| SceneErrorKind::malformed("a whole number", word))?,
                // An index that is not a whole number is out of range.
                Number::Bytes(own) => self.kind.whole(own, from.1.is_little).unwrap_or(-1),
            })
        })?;
        expect_all(n_there, n.unwrap_or(0), "values of an array")
    }

    /// Returns whether the array has whole numbers or texts, one for each cell, which may name surfaces.
    pub(super) fn may_name(&self) -> bool {
        self.n_components == 1 && !matches!(self.kind, Scalar::F32 | Scalar::F64)
    }

    /// Returns the values for cells, if there is one for each.
    pub(super) fn names(&self, from: From<'_>, n_cells: u64) -> Result<Option<Values>, SceneErrorKind> {
        if self.kind != Scalar::Text {
            let mut values = Vec::new();
            self.whole(from, Some(n_cells), |value| {
                values.push(value);
                Ok(())
            })?;
            return Ok((values.len() as u64 == n_cells).then_some(Values::Whole(values)));
        }
        let mut bytes: Vec<u8> = Vec::new();
        self.numbers(from, None, |number| {
            match number {
                // Texts are stored as the numbers of their bytes.
                Number::Word(word) => bytes.extend(word.parse::<u8>().ok()),
                Number::Bytes(own) => bytes.extend(own),
            }
            Ok(())
        })?;
        let texts = bytes.split(|byte| *byte == 0);
        let mut texts: Vec<String> = texts.map(|text| String::from_utf8_lossy(text).into_owned()).collect();
        // A zero ends each text.
        texts.pop();
        Ok((texts.len() as u64 == n_cells).then_some(Values::Text(texts)))
    }
}

/// Refuses an array with fewer values than required.
fn expect_all(n_there: u64, n: u64, what: &'static str) -> Result<(), SceneErrorKind> {
    if n_there < n {
        let room = n_there;
        return Err(SceneErrorKind::Truncated { what, n, room });
    }
    Ok(())
}

/// Appends the arrays of a piece to those of earlier pieces, which have `n_cells_before` cells.
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
