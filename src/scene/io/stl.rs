//! Reads 3D Systems' STL, ASCII and binary.

use std::io::BufRead as _;

use glam::DVec3;

use super::cursor::Cursor;
use super::polygons::{NONE, Names, Polygons};
use super::reader::{Head, Reader};
use super::source::Source;
use super::{Counts, LoadOptions};
use crate::scene::builder::FirstAndCount;
use crate::scene::{MAX_COORDINATE, Numbering, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind, Written};

/// Bytes of a binary file before its triangles, and of each triangle.
const HEADER: usize = 84;
const TRIANGLE: u64 = 50;

/// The format.
pub(super) struct Stl;

impl Reader for Stl {
    fn name(&self) -> &'static str {
        "stl"
    }

    fn summary(&self) -> &'static str {
        "STL, ASCII or binary"
    }

    fn suffixes(&self) -> &'static [&'static str] {
        &["stl"]
    }

    fn recognises(&self, head: &Head<'_>) -> bool {
        has_binary_length(head.bytes, head.length) || is_ascii(head)
    }

    fn read(&self, source: &Source<'_>, _options: &LoadOptions) -> Result<Polygons, SceneError> {
        let head = source.head();
        let may_be_ascii = !has_binary_length(head.bytes, head.length) && head.begins_with_any_case("solid");
        let n_corners = if may_be_ascii { corners_of_text(source)? } else { None };
        match n_corners {
            Some(n_corners) => ascii(source, n_corners),
            None => binary(source),
        }
    }
}

/// Returns whether the length of a file fits its count of triangles.
fn has_binary_length(bytes: &[u8], length: u64) -> bool {
    let count = bytes
        .get(80..84)
        .and_then(|count| count.try_into().ok())
        .map(u32::from_le_bytes);
    count.is_some_and(|count| length == HEADER as u64 + TRIANGLE * u64::from(count))
}

fn is_ascii(head: &Head<'_>) -> bool {
    let has_keyword = || {
        ["facet", "endsolid"]
            .into_iter()
            .any(|word| head.contains_any_case(word))
    };
    head.begins_with_any_case("solid") && !head.bytes.contains(&0) && has_keyword()
}

fn counts(n_triangles: u64) -> Counts {
    Counts {
        vertices: 3 * n_triangles,
        corners: 3 * n_triangles,
        faces: n_triangles,
    }
}

/// The triangles read so far, and the agreement of their normals.
struct Triangles<'a> {
    source: &'a Source<'a>,
    polygons: Polygons,
    opposed: FirstAndCount,
}

impl<'a> Triangles<'a> {
    fn new(source: &'a Source<'a>, numbering: Numbering) -> Self {
        Self {
            source,
            polygons: Polygons {
                numbering,
                written: Written::new(),
                repeats_vertices: true,
                has_no_materials: true,
                ..Polygons::default()
            },
            opposed: FirstAndCount::default(),
        }
    }

    fn reserve(&mut self, n: usize) {
        self.polygons.vertices.reserve(3 * n);
        self.polygons.corners.reserve(3 * n);
        self.polygons.faces.reserve(n);
    }

    fn push(&mut self, normal: DVec3, corners: [DVec3; 3], group: u32, number: u32) {
        let [a, b, c] = corners;
        if normal.dot((b - a).cross(c - a)) < 0.0 {
            self.opposed.count(number);
        }
        let first = u32::try_from(self.polygons.vertices.len()).unwrap_or(NONE - 3);
        self.polygons.vertices.extend(corners);
        self.polygons
            .face([0, 1, 2].map(|k| first.saturating_add(k)), group, NONE, number);
    }

    fn end(mut self) -> Polygons {
        if let Some((number, count)) = self.opposed.0 {
            let at = self.polygons.numbering.origin(&self.source.path, number);
            let warning = SceneWarning::new(at, SceneWarningKind::OpposedNormals { count });
            self.polygons.warnings.push(warning);
        }
        self.polygons
    }
}

/// The solids of a file; a single one names no surface, as its name is mostly that of a program.
#[derive(Default)]
struct Solids {
    names: Names,
    n: usize,
}

impl Solids {
    /// Adds a solid, and returns its number.
    fn add(&mut self, name: &str) -> u32 {
        self.n += 1;
        if name.is_empty() {
            self.names.number(&format!("solid{}", self.n))
        } else {
            self.names.number(name)
        }
    }

    /// Names the surfaces of all triangles.
    fn end(self, mut triangles: Triangles<'_>) -> Polygons {
        if self.n > 1 {
            triangles.polygons.groups = self.names.all;
        } else {
            triangles.polygons.faces.iter_mut().for_each(|face| face.group = NONE);
        }
        triangles.end()
    }
}

/// Reads a solid and all that follow it, as gmsh writes one for each surface.
fn binary(source: &Source<'_>) -> Result<Polygons, SceneError> {
    let mut cursor = source.cursor();
    let mut triangles = Triangles::new(source, Numbering::elements("triangle", 1));
    let mut solids = Solids::default();
    let (mut n_before, mut is_first) = (0_u32, true);
    loop {
        let behind = cursor.left();
        let header = cursor.take(HEADER - 4, "the header of 80 bytes")?;
        let name = header.split(|byte| *byte == 0).next().unwrap_or_default();
        let name = String::from_utf8_lossy(name).trim().to_owned();
        let n = cursor.binary::<u32>("the number of triangles")?;
        let (what, room) = ("triangles", cursor.left() / TRIANGLE);
        if u64::from(n) > room {
            let n = n.into();
            return Err(if is_first {
                source.error(SceneErrorKind::Truncated { what, n, room })
            } else {
                left_over(source, n_before, behind)
            });
        }
        if n > 0 {
            source.expect(counts(n.into()))?;
            triangles.reserve(n as usize);
            let group = solids.add(&name);
            for number in 1..=n {
                triangle(&mut cursor, &mut triangles, group, n_before.saturating_add(number))?;
            }
            n_before = n_before.saturating_add(n);
        }
        is_first = false;
        // A rest shorter than a triangle is padding.
        match cursor.left() {
            left if left < TRIANGLE => return Ok(solids.end(triangles)),
            left if left < HEADER as u64 => return Err(left_over(source, n_before, left)),
            _ => {}
        }
    }
}

/// Returns the error of a file that is longer than its stated triangles.
fn left_over(source: &Source<'_>, n: u32, n_bytes: u64) -> SceneError {
    let expected = format!("the end of the file, or another solid, after {n} triangles");
    source.error(SceneErrorKind::malformed(expected, format!("{n_bytes} bytes")))
}

/// Reads a binary triangle.
fn triangle(cursor: &mut Cursor<'_>, triangles: &mut Triangles<'_>, group: u32, number: u32) -> Result<(), SceneError> {
    let mut point = |is_corner: bool| {
        let mut numbers = [0.0; 3];
        for x in &mut numbers {
            let value: f32 = cursor.binary("a triangle")?;
            if is_corner && (value.is_nan() || f64::from(value).abs() > MAX_COORDINATE) {
                let token = value.to_string();
                return Err(cursor.error_in(format!("triangle {number}"), SceneErrorKind::BadCoordinate { token }));
            }
            if is_corner {
                triangles.polygons.written.see_single(value);
            }
            *x = f64::from(value);
        }
        Ok(DVec3::from_array(numbers))
    };
    let normal = point(false)?;
    let corners = [point(true)?, point(true)?, point(true)?];
    triangles.push(normal, corners, group, number);
    cursor.skip(2, "a triangle")
}

/// Returns an upper bound of the corners of a text file; `None` if a byte is 0, which text does not contain.
fn corners_of_text(source: &Source<'_>) -> Result<Option<u64>, SceneError> {
    let mut stream = source.stream(0, u64::MAX);
    let mut n_corners = 0;
    loop {
        let bytes = stream.fill_buf().map_err(|error| source.unreadable(error))?;
        if bytes.contains(&0) {
            return Ok(None);
        }
        // Each corner has an x in its keyword, `vertex`, and few other words have one.
        n_corners += bytes.iter().filter(|byte| matches!(byte, b'x' | b'X')).count() as u64;
        let n_read = bytes.len();
        if n_read == 0 {
            return Ok(Some(n_corners));
        }
        stream.consume(n_read);
    }
}

fn ascii(source: &Source<'_>, n_corners: u64) -> Result<Polygons, SceneError> {
    let mut cursor = source.cursor();
    source.expect(counts(n_corners.div_ceil(3)))?;
    let mut triangles = Triangles::new(source, Numbering::Lines);
    let mut solids = Solids::default();
    while let Some(line) = cursor.next_full_line()? {
        let text = cursor.last().trim_start_matches('\u{feff}');
        let keyword = text.split_whitespace().next().unwrap_or("");
        if !keyword.eq_ignore_ascii_case("solid") {
            let found = SceneErrorKind::malformed("`solid`", keyword);
            return Err(SceneError::new(
                triangles.polygons.numbering.origin(&source.path, line),
                found,
            ));
        }
        let group = solids.add(text.get(keyword.len()..).unwrap_or("").trim());
        while facet(&mut cursor, &mut triangles, group)? {}
    }
    Ok(solids.end(triangles))
}

/// Reads a facet, or the end of a solid; returns false for the latter.
fn facet(cursor: &mut Cursor<'_>, triangles: &mut Triangles<'_>, group: u32) -> Result<bool, SceneError> {
    cursor.expect_word("`facet` or `endsolid`")?;
    let (word, line) = (cursor.last(), cursor.line());
    if word.eq_ignore_ascii_case("endsolid") || word.eq_ignore_ascii_case("end") {
        // The name is repeated.
        cursor.next_line()?;
        return Ok(false);
    }
    if !word.eq_ignore_ascii_case("facet") {
        return Err(cursor.malformed("`facet` or `endsolid`", word));
    }
    expect(cursor, "normal")?;
    // Some programs write `nan` or `-1.#IND` for a triangle without an area.
    let mut normal = [0.0; 3];
    for x in &mut normal {
        *x = cursor.expect_word("a normal")?.parse().unwrap_or(0.0);
    }
    expect(cursor, "outer")?;
    expect(cursor, "loop")?;
    let mut corners = [DVec3::ZERO; 3];
    for corner in &mut corners {
        expect(cursor, "vertex")?;
        *corner = coordinates(cursor, &mut triangles.polygons.written)?;
    }
    expect(cursor, "endloop")?;
    expect(cursor, "endfacet")?;
    triangles.push(DVec3::from_array(normal), corners, group, line);
    Ok(true)
}

fn expect(cursor: &mut Cursor<'_>, keyword: &str) -> Result<(), SceneError> {
    let expected = format!("`{keyword}`");
    if cursor.expect_word(&expected)?.eq_ignore_ascii_case(keyword) {
        Ok(())
    } else {
        Err(cursor.malformed(&expected, cursor.last()))
    }
}

/// Reads three coordinates as text.
pub(super) fn coordinates(cursor: &mut Cursor<'_>, written: &mut Written) -> Result<DVec3, SceneError> {
    let mut position = [0.0; 3];
    for x in &mut position {
        *x = coordinate(cursor, written)?;
    }
    Ok(DVec3::from_array(position))
}

/// Reads a coordinate as text.
pub(super) fn coordinate(cursor: &mut Cursor<'_>, written: &mut Written) -> Result<f64, SceneError> {
    cursor.expect_word("a coordinate")?;
    let token = cursor.last();
    let number = token.parse::<f64>().ok().filter(|x| x.abs() <= MAX_COORDINATE);
    let value = number.ok_or_else(|| {
        let token = token.to_owned();
        cursor.error(SceneErrorKind::BadCoordinate { token })
    })?;
    written.see_value(token, value);
    Ok(value)
}
