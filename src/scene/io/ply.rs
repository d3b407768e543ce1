//! Reads Stanford's PLY, ASCII and binary of both byte orders.

use glam::DVec3;

use super::cells::{Array, Values, surfaces};
use super::cursor::Cursor;
use super::polygons::{NONE, Polygons};
use super::reader::{Head, Reader};
use super::scalar::Scalar;
use super::source::Source;
use super::{Counts, LoadOptions};
use crate::scene::{
    MAX_COORDINATE, MAX_CORNERS, Numbering, Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind, Written,
};

/// The format.
pub(super) struct Ply;

impl Reader for Ply {
    fn name(&self) -> &'static str {
        "ply"
    }

    fn summary(&self) -> &'static str {
        "Stanford PLY, ASCII or binary"
    }

    fn suffixes(&self) -> &'static [&'static str] {
        &["ply"]
    }

    fn recognises(&self, head: &Head<'_>) -> bool {
        head.bytes.starts_with(b"ply\n") || head.bytes.starts_with(b"ply\r")
    }

    fn has_arrays(&self) -> bool {
        true
    }

    fn read(&self, source: &Source<'_>, options: &LoadOptions) -> Result<Polygons, SceneError> {
        let mut cursor = source.cursor();
        let (encoding, elements) = header(&mut cursor)?;
        cursor.is_little = encoding == Encoding::LittleEndian;
        let mut content = Content {
            source,
            encoding,
            polygons: Polygons {
                numbering: if encoding == Encoding::Ascii {
                    Numbering::Lines
                } else {
                    Numbering::elements("face", 0)
                },
                written: Written::new(),
                has_no_materials: true,
                ..Polygons::default()
            },
            arrays: Vec::new(),
        };
        for element in &elements {
            match &*element.name {
                "vertex" => content.vertices(&mut cursor, element)?,
                "face" => content.faces(&mut cursor, element)?,
                _ => content.skip(&mut cursor, element)?,
            }
        }
        let Content {
            mut polygons, arrays, ..
        } = content;
        surfaces(&mut polygons, arrays, options, source)?;
        Ok(polygons)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Debug)]
struct Property {
    name: String,
    /// The type of the count of a list.
    count: Option<Scalar>,
    scalar: Scalar,
}

#[derive(Debug)]
struct Element {
    name: String,
    n: u64,
    properties: Vec<Property>,
}

impl Element {
    /// Returns the least bytes of one element.
    fn least_bytes(&self, encoding: Encoding) -> u64 {
        let of = |property: &Property| match encoding {
            // The shortest number is a digit and a blank, but the last one of a file needs no blank.
            Encoding::Ascii => 1,
            _ => property.count.unwrap_or(property.scalar).bytes() as u64,
        };
        self.properties.iter().map(of).sum::<u64>()
    }
}

/// Reads the header, which is text in each encoding.
fn header(cursor: &mut Cursor<'_>) -> Result<(Encoding, Vec<Element>), SceneError> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    cursor.next_line()?;
    loop {
        let Some(line) = cursor.next_full_line()? else {
            return Err(cursor.malformed("`end_header`", "the end of the file"));
        };
        let text = cursor.last();
        let words: Vec<&str> = text.split_whitespace().collect();
        let scalar = |name: &str| Scalar::of_ply(name).ok_or("a type of numbers such as `float`");
        let property = match words[..] {
            ["end_header"] => break,
            ["comment" | "obj_info", ..] => continue,
            ["format", name, _version] => {
                encoding = match name {
                    "ascii" => Some(Encoding::Ascii),
                    "binary_little_endian" => Some(Encoding::LittleEndian),
                    "binary_big_endian" => Some(Encoding::BigEndian),
                    _ => None,
                };
                if encoding.is_none() {
                    Err("`ascii`, `binary_little_endian` or `binary_big_endian`")
                } else {
                    continue;
                }
            }
            ["element", name, n] => match n.parse() {
                Ok(n) => {
                    let (name, properties) = (name.to_owned(), Vec::new());
                    elements.push(Element { name, n, properties });
                    continue;
                }
                Err(_) => Err("a number of elements"),
            },
            ["property", "list", count, of, name] => scalar(count)
                .and_then(|count| {
                    if count.is_whole() {
                        Ok(count)
                    } else {
                        Err("a whole type of counts such as `uchar`")
                    }
                })
                .and_then(|count| Ok((name, Some(count), scalar(of)?))),
            ["property", of, name] => scalar(of).map(|of| (name, None, of)),
            _ => Err("`format`, `element`, `property`, `comment` or `end_header`"),
        };
        let malformed = |expected: &str| {
            let at = Numbering::Lines.origin(cursor.path(), line);
            SceneError::new(at, SceneErrorKind::malformed(expected, text))
        };
        let (name, count, of) = property.map_err(malformed)?;
        let element = elements
            .last_mut()
            .ok_or_else(|| malformed("`element` before its properties"))?;
        let name = name.to_owned();
        element.properties.push(Property {
            name,
            count,
            scalar: of,
        });
    }
    let encoding = encoding.ok_or_else(|| cursor.malformed("a line `format` in the header", "end_header"))?;
    Ok((encoding, elements))
}

/// Reads a number of an element; f64 holds all whole numbers of the format.
fn value(cursor: &mut Cursor<'_>, scalar: Scalar, encoding: Encoding) -> Result<f64, SceneError> {
    const WHAT: &str = "the elements";
    if encoding == Encoding::Ascii {
        return cursor.number("a number");
    }
    Ok(match scalar {
        Scalar::F32 => cursor.binary::<f32>(WHAT)?.into(),
        Scalar::F64 => cursor.binary(WHAT)?,
        whole => {
            let is_little = cursor.is_little;
            let own = cursor.take(whole.bytes(), WHAT)?;
            whole.whole(own, is_little).unwrap_or(-1) as f64
        }
    })
}

struct Content<'a> {
    source: &'a Source<'a>,
    encoding: Encoding,
    polygons: Polygons,
    /// The whole numbers of all faces, by property.
    arrays: Vec<Array>,
}

impl Content<'_> {
    fn count(&self, cursor: &Cursor<'_>, element: &Element, what: &'static str) -> Result<usize, SceneError> {
        let (n, room) = (element.n, cursor.left() / element.least_bytes(self.encoding).max(1));
        match usize::try_from(n) {
            Ok(count) if n <= room => Ok(count),
            _ => Err(self.source.error(SceneErrorKind::Truncated { what, n, room })),
        }
    }

    /// Returns an error at the line of the place, or in an element of a binary file.
    fn refused(&self, cursor: &Cursor<'_>, element: String, kind: SceneErrorKind) -> SceneError {
        if self.encoding == Encoding::Ascii {
            cursor.error(kind)
        } else {
            cursor.error_in(element, kind)
        }
    }

    fn vertices(&mut self, cursor: &mut Cursor<'_>, element: &Element) -> Result<(), SceneError> {
        let n = self.count(cursor, element, "vertices")?;
        for axis in ["x", "y", "z"] {
            if !element.properties.iter().any(|p| p.name == axis && p.count.is_none()) {
                let message = format!("the vertices have no property `{axis}`; export them with x, y and z");
                return Err(self.source.error(SceneErrorKind::unsupported(message)));
            }
        }
        self.source.expect(Counts {
            vertices: n as u64,
            ..Counts::default()
        })?;
        self.polygons.vertices.reserve(n);
        for k in 0..n {
            let position = self.position(cursor, element, k)?;
            self.polygons.vertices.push(position);
        }
        Ok(())
    }

    fn position(&mut self, cursor: &mut Cursor<'_>, element: &Element, k: usize) -> Result<DVec3, SceneError> {
        let mut position = [0.0; 3];
        for property in &element.properties {
            let axis = ["x", "y", "z"].iter().position(|axis| *axis == property.name);
            if let (Some(axis), None) = (axis, property.count) {
                position[axis] = self.coordinate(cursor, property.scalar, k)?;
            } else {
                self.skip_property(cursor, property)?;
            }
        }
        Ok(DVec3::from_array(position))
    }

    fn coordinate(&mut self, cursor: &mut Cursor<'_>, scalar: Scalar, k: usize) -> Result<f64, SceneError> {
        if self.encoding == Encoding::Ascii {
            return super::stl::coordinate(cursor, &mut self.polygons.written);
        }
        let x = value(cursor, scalar, self.encoding)?;
        if x.is_nan() || x.abs() > MAX_COORDINATE {
            let kind = SceneErrorKind::BadCoordinate { token: x.to_string() };
            return Err(cursor.error_in(format!("vertex {k}"), kind));
        }
        let written = &mut self.polygons.written;
        if scalar == Scalar::F32 {
            #[expect(clippy::cast_possible_truncation, reason = "it was an f32")]
            written.see_single(x as f32);
        } else if scalar == Scalar::F64 {
            written.see_binary(x);
        }
        Ok(x)
    }

    fn skip_property(&self, cursor: &mut Cursor<'_>, property: &Property) -> Result<(), SceneError> {
        let n = match property.count {
            Some(count) => self.length(cursor, count, property.scalar)?,
            None => 1,
        };
        if self.encoding == Encoding::Ascii {
            for _ in 0..n {
                cursor.expect_word("a number")?;
            }
        } else {
            cursor.skip(
                (n as u64).saturating_mul(property.scalar.bytes() as u64),
                "the elements",
            )?;
        }
        Ok(())
    }

    /// Reads the length of a list, and checks it against the rest of the file.
    fn length(&self, cursor: &mut Cursor<'_>, count: Scalar, of: Scalar) -> Result<usize, SceneError> {
        let n = value(cursor, count, self.encoding)?;
        if !(0.0..=f64::from(u32::MAX)).contains(&n) || n.fract().abs() > 0.0 {
            return Err(cursor.malformed("the length of a list", &n.to_string()));
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a whole number in range"
        )]
        let n = n as u64;
        let least = if self.encoding == Encoding::Ascii {
            1
        } else {
            of.bytes() as u64
        };
        let counted = cursor.count(n, least, "numbers in a list");
        counted.map_err(|error| self.source.error(error.kind))
    }

    fn skip(&mut self, cursor: &mut Cursor<'_>, element: &Element) -> Result<(), SceneError> {
        let n = self.count(cursor, element, "elements")?;
        if element.name == "tristrips" {
            let kind = SceneErrorKind::unsupported("strips of triangles are not read; export faces");
            return Err(self.source.error(kind));
        }
        if element.least_bytes(self.encoding) == 0 {
            return Ok(());
        }
        for _ in 0..n {
            for property in &element.properties {
                self.skip_property(cursor, property)?;
            }
        }
        if element.name == "edge" && n > 0 {
            let kind = SceneWarningKind::SkippedElements {
                count: n,
                what: "edges",
            };
            let warning = SceneWarning::new(Origin::file(&self.source.path), kind);
            self.polygons.warnings.push(warning);
        }
        Ok(())
    }

    fn faces(&mut self, cursor: &mut Cursor<'_>, element: &Element) -> Result<(), SceneError> {
        let n = self.count(cursor, element, "faces")?;
        let is_outline = |p: &Property| p.count.is_some() && matches!(&*p.name, "vertex_indices" | "vertex_index");
        let Some(list) = element.properties.iter().position(is_outline) else {
            let message = "the faces have no list `vertex_indices`; export them with their vertices";
            return Err(self.source.error(SceneErrorKind::unsupported(message)));
        };
        let n_indices = cursor.left() / self.index_bytes(&element.properties[list]);
        self.source.expect(Counts {
            corners: n_indices.min(4 * n as u64),
            faces: n as u64,
            ..Counts::default()
        })?;
        let mut arrays: Vec<Option<Vec<i64>>> = element
            .properties
            .iter()
            .map(|p| (p.count.is_none() && p.scalar.is_whole()).then(Vec::new))
            .collect();
        for k in (0_u32..).take(n) {
            let mut number = k.saturating_add(1);
            for (which, property) in element.properties.iter().enumerate() {
                if which == list {
                    number = self.outline(cursor, property, k)?;
                } else if let Some(values) = &mut arrays[which] {
                    #[expect(clippy::cast_possible_truncation, reason = "whole numbers of 32 bits")]
                    values.push(value(cursor, property.scalar, self.encoding)? as i64);
                } else {
                    self.skip_property(cursor, property)?;
                }
            }
            self.polygons.face([], NONE, NONE, number);
        }
        let named = element.properties.iter().zip(arrays);
        self.arrays = named
            .filter_map(|(property, values)| Some((property.name.clone(), values?)))
            .map(|(name, values)| Array {
                name,
                values: Values::Whole(values),
            })
            .collect();
        Ok(())
    }

    /// Returns the least bytes of an index.
    fn index_bytes(&self, list: &Property) -> u64 {
        if self.encoding == Encoding::Ascii {
            2
        } else {
            list.scalar.bytes() as u64
        }
    }

    /// Reads the vertices of a face; returns its line, or its number from 1.
    fn outline(&mut self, cursor: &mut Cursor<'_>, list: &Property, k: u32) -> Result<u32, SceneError> {
        let count = list.count.unwrap_or(Scalar::U8);
        let n = self.length(cursor, count, list.scalar)?;
        let line = cursor.line();
        let element = || format!("face {k}");
        if n < 3 {
            return Err(self.refused(cursor, element(), SceneErrorKind::TooFewCorners { count: n }));
        }
        if n > MAX_CORNERS as usize {
            let (what, limit) = ("corners in one face", MAX_CORNERS);
            return Err(self.refused(cursor, element(), SceneErrorKind::TooMany { what, limit }));
        }
        for _ in 0..n {
            let index = value(cursor, list.scalar, self.encoding)?;
            if !(0.0..f64::from(u32::MAX)).contains(&index) || index.fract().abs() > 0.0 {
                let token = index.to_string();
                return Err(self.refused(cursor, element(), SceneErrorKind::BadIndex { token }));
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a whole number in range"
            )]
            self.polygons.corners.push(index as u32);
        }
        Ok(if self.encoding == Encoding::Ascii {
            line
        } else {
            k.saturating_add(1)
        })
    }
}
