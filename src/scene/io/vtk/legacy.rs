//! Reads legacy VTK files, versions 1 to 5, ASCII and binary (most significant byte first).

use glam::DVec3;

use super::super::cells::{Array, Values};
use super::super::cursor::Cursor;
use super::super::scalar::Scalar;
use super::super::source::Source;
use super::super::{Counts, stl};
use super::dataset::{Dataset, LINE, STRIP, VERTICES};
use crate::scene::{MAX_COORDINATE, SceneError, SceneErrorKind};

/// The text that error messages quote at the end of the file.
const END: &str = "the end of the file";

/// The things to which the following arrays belong.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Of {
    Field,
    Points(u64),
    Cells(u64),
}

struct Legacy<'a> {
    source: &'a Source<'a>,
    cursor: Cursor<'a>,
    is_binary: bool,
    of: Of,
    dataset: Dataset,
    /// The ends of cells whose types follow.
    untyped: Vec<usize>,
}

pub(super) fn read(source: &Source<'_>) -> Result<Dataset, SceneError> {
    let mut cursor = source.cursor();
    // The version and a title.
    cursor.next_full_line()?;
    cursor.next_line()?;
    let is_there = cursor.next_full_line()?.is_some();
    let encoding = if is_there { cursor.last() } else { END };
    let is_binary = match encoding.to_ascii_uppercase().as_str() {
        "ASCII" => false,
        "BINARY" => true,
        _ => return Err(cursor.malformed("`ASCII` or `BINARY`", encoding)),
    };
    cursor.is_little = false;
    let mut file = Legacy {
        source,
        cursor,
        is_binary,
        of: Of::Field,
        dataset: Dataset::default(),
        untyped: Vec::new(),
    };
    while file.cursor.next_full_line()?.is_some() {
        let line = file.cursor.last().to_owned();
        let words: Vec<&str> = line.split_whitespace().collect();
        let keyword = words[0].to_ascii_uppercase();
        file.section(&keyword, &words[1..])?;
    }
    if file.untyped.is_empty() {
        Ok(file.dataset)
    } else {
        Err(source.error(SceneErrorKind::CutShort {
            what: "the types of the cells",
        }))
    }
}

impl Legacy<'_> {
    fn error(&self, kind: SceneErrorKind) -> SceneError {
        if self.is_binary {
            self.source.error(kind)
        } else {
            self.cursor.error(kind)
        }
    }

    fn malformed(&self, expected: &str, found: &str) -> SceneError {
        self.error(SceneErrorKind::malformed(expected, found))
    }

    fn section(&mut self, keyword: &str, words: &[&str]) -> Result<(), SceneError> {
        match keyword {
            "DATASET" => self.kind(words),
            "POINTS" => self.points(words),
            "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" | "CELLS" => self.cells(keyword, words),
            "CELL_TYPES" => self.types(words),
            "CELL_DATA" => self
                .counted(words, "the number of cells")
                .map(|n| self.of = Of::Cells(n)),
            "POINT_DATA" => self
                .counted(words, "the number of points")
                .map(|n| self.of = Of::Points(n)),
            "FIELD" => self.field(words),
            "METADATA" => self.metadata(),
            _ => self.attribute(keyword, words),
        }
    }

    fn counted(&self, words: &[&str], what: &str) -> Result<u64, SceneError> {
        let word = words.first().copied().unwrap_or("nothing");
        word.parse().map_err(|_| self.malformed(what, word))
    }

    fn scalar(&self, word: Option<&&str>) -> Result<Scalar, SceneError> {
        let word = word.copied().unwrap_or("nothing");
        Scalar::of_legacy(word).ok_or_else(|| self.malformed("a type of numbers such as `float`", word))
    }

    fn kind(&self, words: &[&str]) -> Result<(), SceneError> {
        let kind = words.first().copied().unwrap_or("nothing");
        if matches!(kind.to_ascii_uppercase().as_str(), "POLYDATA" | "UNSTRUCTURED_GRID") {
            return Ok(());
        }
        let message = format!("`{kind}` is not read; save the surface as POLYDATA or UNSTRUCTURED_GRID");
        Err(self.error(SceneErrorKind::unsupported(message)))
    }

    /// Checks a count of numbers against the rest of the file.
    fn fits(&self, n: u64, scalar: Scalar, what: &'static str) -> Result<usize, SceneError> {
        let counted = if self.is_binary {
            let n_bytes = if scalar == Scalar::Bit { n.div_ceil(8) } else { n };
            self.cursor.count(n_bytes, scalar.bytes() as u64, what)?;
            usize::try_from(n).map_err(|_| self.cursor.error(SceneErrorKind::CutShort { what }))
        } else {
            // The shortest number is a digit and a blank, but the last one needs no blank.
            let room = (self.cursor.left()).div_ceil(2);
            usize::try_from(n)
                .ok()
                .filter(|_| n <= room)
                .ok_or_else(|| self.cursor.error(SceneErrorKind::Truncated { what, n, room }))
        };
        counted.map_err(|error| self.error(error.kind))
    }

    fn points(&mut self, words: &[&str]) -> Result<(), SceneError> {
        let n = self.counted(words, "the number of points")?;
        let scalar = self.scalar(words.get(1))?;
        self.fits(n.saturating_mul(3), scalar, "coordinates")?;
        self.source.expect(Counts {
            vertices: n,
            ..Counts::default()
        })?;
        for k in 0..n {
            let mut position = [0.0; 3];
            for x in &mut position {
                *x = self.coordinate(scalar, k)?;
            }
            self.dataset.points.push(DVec3::from_array(position));
        }
        Ok(())
    }

    fn coordinate(&mut self, scalar: Scalar, k: u64) -> Result<f64, SceneError> {
        if !self.is_binary {
            return stl::coordinate(&mut self.cursor, &mut self.dataset.written);
        }
        let x = match scalar {
            Scalar::F32 => {
                let x: f32 = self.cursor.binary("the points")?;
                self.dataset.written.see_single(x);
                f64::from(x)
            }
            Scalar::F64 => {
                let x: f64 = self.cursor.binary("the points")?;
                if x.is_finite() {
                    self.dataset.written.see_binary(x);
                }
                x
            }
            _ => self.whole(scalar)? as f64,
        };
        if x.is_nan() || x.abs() > MAX_COORDINATE {
            let kind = SceneErrorKind::BadCoordinate { token: x.to_string() };
            return Err(self.cursor.error_in(format!("point {k}"), kind));
        }
        Ok(x)
    }

    /// Reads a whole number.
    fn whole(&mut self, scalar: Scalar) -> Result<i64, SceneError> {
        const WHAT: &str = "an array";
        if !self.is_binary {
            return self.cursor.number("a whole number");
        }
        if !scalar.is_whole() {
            return Err(self.malformed("whole numbers", "others"));
        }
        let is_little = self.cursor.is_little;
        let own = self.cursor.take(scalar.bytes(), WHAT)?;
        Ok(scalar.whole(own, is_little).unwrap_or(-1))
    }

    fn point(&mut self, scalar: Scalar) -> Result<u32, SceneError> {
        let index = self.whole(scalar)?;
        u32::try_from(index).map_err(|_| {
            let token = index.to_string();
            self.error(SceneErrorKind::BadIndex { token })
        })
    }

    /// Reads cells: in version 5 an array of offsets and one of points; in older versions the number of points of each cell, and these.
    fn cells(&mut self, keyword: &str, words: &[&str]) -> Result<(), SceneError> {
        let n = self.counted(words, "the number of cells")?;
        let size = self.counted(words.get(1..).unwrap_or(&[]), "the number of points of cells")?;
        let is_by_offsets = self.cursor.is_before("OFFSETS")?;
        let start = self.dataset.connectivity.len();
        let mut ends = Vec::new();
        if is_by_offsets {
            let n = n.saturating_sub(1);
            let scalar = self.array_line("OFFSETS")?;
            self.fits(n + 1, scalar, "offsets of cells")?;
            let mut last = self.whole(scalar)?;
            for _ in 0..n {
                let end = self.whole(scalar)?;
                if end < last || u64::try_from(end).map_or(true, |end| end > size) {
                    return Err(self.malformed("offsets that grow up to the number of points", &end.to_string()));
                }
                last = end;
                ends.push(start + usize::try_from(end).unwrap_or(0));
            }
            let of_points = self.array_line("CONNECTIVITY")?;
            self.fits(size, of_points, "points of cells")?;
            for _ in 0..size {
                let point = self.point(of_points)?;
                self.dataset.connectivity.push(point);
            }
        } else {
            self.fits(size, Scalar::I32, "points of cells")?;
            let n_points = size.saturating_sub(n);
            for _ in 0..n {
                let length = self.whole(Scalar::I32)?;
                let so_far = (self.dataset.connectivity.len() - start) as u64;
                let Some(length) = u64::try_from(length).ok().filter(|length| so_far + length <= n_points) else {
                    return Err(self.malformed("a number of points within those of the section", &length.to_string()));
                };
                for _ in 0..length {
                    let point = self.point(Scalar::I32)?;
                    self.dataset.connectivity.push(point);
                }
                ends.push(self.dataset.connectivity.len());
            }
        }
        let connected = self.dataset.connectivity.len();
        if ends.last().is_some_and(|end| *end > connected) {
            return Err(self.error(SceneErrorKind::CutShort {
                what: "the points of cells",
            }));
        }
        self.dataset
            .connectivity
            .truncate(ends.last().copied().unwrap_or(start));
        match keyword {
            "CELLS" => self.untyped = ends,
            "VERTICES" => self.dataset.push_cells(ends, |_| VERTICES),
            "LINES" => self.dataset.push_cells(ends, |_| LINE),
            "TRIANGLE_STRIPS" => self.dataset.push_cells(ends, |_| STRIP),
            _ => self.dataset.push_cells(ends, Dataset::polygon_of),
        }
        Ok(())
    }

    /// Reads the line before an array, as in `OFFSETS vtktypeint64`.
    fn array_line(&mut self, keyword: &str) -> Result<Scalar, SceneError> {
        let is_there = self.cursor.next_full_line()?.is_some();
        let line = if is_there { self.cursor.last() } else { END };
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.first().is_none_or(|word| !word.eq_ignore_ascii_case(keyword)) {
            return Err(self.malformed(keyword, line));
        }
        self.scalar(words.get(1))
    }

    fn types(&mut self, words: &[&str]) -> Result<(), SceneError> {
        let n = self.counted(words, "the number of types")?;
        let n = self.fits(n, Scalar::I32, "types of cells")?;
        if n != self.untyped.len() {
            return Err(self.malformed("a type for each cell", &n.to_string()));
        }
        let mut types = Vec::with_capacity(n);
        for _ in 0..n {
            let kind = self.whole(Scalar::I32)?;
            types.push(u8::try_from(kind).unwrap_or(u8::MAX));
        }
        self.dataset.ends.append(&mut self.untyped);
        self.dataset.types.append(&mut types);
        Ok(())
    }

    /// Reads arrays of a field.
    fn field(&mut self, words: &[&str]) -> Result<(), SceneError> {
        let n_arrays = self.counted(words.get(1..).unwrap_or(&[]), "the number of arrays")?;
        let mut k = 0;
        while k < n_arrays {
            if self.cursor.next_full_line()?.is_none() {
                return Err(self.source.error(SceneErrorKind::CutShort { what: "a field" }));
            }
            let line = self.cursor.last().to_owned();
            let of_array: Vec<&str> = line.split_whitespace().collect();
            if of_array[0] == "METADATA" {
                self.metadata()?;
                continue;
            }
            let [name, n_components, n_tuples, scalar] = of_array[..] else {
                return Err(self.malformed("a name, two counts and a type", &line));
            };
            let scalar = self.scalar(Some(&scalar))?;
            let n_components = self.counted(&[n_components], "the number of components")?;
            let n_tuples = self.counted(&[n_tuples], "the number of values")?;
            self.array(name, n_components, n_tuples, scalar)?;
            k += 1;
        }
        Ok(())
    }

    /// Skips a block that ends in an empty line.
    fn metadata(&mut self) -> Result<(), SceneError> {
        while self.cursor.next_line()?.is_some_and(|line| !line.is_empty()) {}
        Ok(())
    }

    /// Reads an attribute of points or cells.
    fn attribute(&mut self, keyword: &str, words: &[&str]) -> Result<(), SceneError> {
        let n = match self.of {
            Of::Points(n) | Of::Cells(n) => n,
            Of::Field => return Err(self.malformed("a section such as `POINTS`", keyword)),
        };
        let name = words.first().copied().unwrap_or("");
        match keyword {
            "SCALARS" => {
                let scalar = self.scalar(words.get(1))?;
                let n_components = words
                    .get(2)
                    .map_or(Ok(1), |word| self.counted(&[word], "a number of components"))?;
                if self.cursor.is_before("LOOKUP_TABLE")? {
                    self.cursor.next_full_line()?;
                }
                self.array(name, n_components, n, scalar)
            }
            "LOOKUP_TABLE" => {
                let size = self.counted(words.get(1..).unwrap_or(&[]), "the size of the table")?;
                self.skip(size.saturating_mul(4), Scalar::U8)
            }
            "COLOR_SCALARS" => {
                let n_components = self.counted(words.get(1..).unwrap_or(&[]), "a number of components")?;
                self.skip(n.saturating_mul(n_components), Scalar::U8)
            }
            "TEXTURE_COORDINATES" => {
                let n_components = self.counted(words.get(1..).unwrap_or(&[]), "a number of components")?;
                let scalar = self.scalar(words.get(2))?;
                self.skip(n.saturating_mul(n_components), scalar)
            }
            "VECTORS" | "NORMALS" | "TENSORS" | "TENSORS6" | "GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS" => {
                let n_components = match keyword {
                    "TENSORS" => 9,
                    "TENSORS6" => 6,
                    "VECTORS" | "NORMALS" => 3,
                    _ => 1,
                };
                let scalar = self.scalar(words.get(1))?;
                self.skip(n.saturating_mul(n_components), scalar)
            }
            _ => Err(self.malformed("a section such as `CELL_DATA`", keyword)),
        }
    }

    fn skip(&mut self, n: u64, scalar: Scalar) -> Result<(), SceneError> {
        let n = self.fits(n, scalar, "values of an array")?;
        if scalar == Scalar::Text {
            return self.texts(n).map(drop);
        }
        if self.is_binary {
            let n_bytes = match scalar {
                Scalar::Bit => (n as u64).div_ceil(8),
                _ => (n as u64).saturating_mul(scalar.bytes() as u64),
            };
            self.cursor.skip(n_bytes, "an array")?;
        } else {
            for _ in 0..n {
                self.cursor.expect_word("a number")?;
            }
        }
        Ok(())
    }

    /// Reads an array; keeps one of cells if it has one whole number or text for each.
    fn array(&mut self, name: &str, n_components: u64, n_tuples: u64, scalar: Scalar) -> Result<(), SceneError> {
        let n = n_components.saturating_mul(n_tuples);
        let is_of_cells = matches!(self.of, Of::Cells(_)) && n_components == 1;
        if is_of_cells && scalar.is_whole() {
            let n = self.fits(n, scalar, "values of an array")?;
            let mut values = Vec::with_capacity(n);
            for _ in 0..n {
                values.push(self.whole(scalar)?);
            }
            self.keep(name, Values::Whole(values));
            return Ok(());
        }
        if is_of_cells && scalar == Scalar::Text {
            let n = self.fits(n, scalar, "values of an array")?;
            let values = self.texts(n)?;
            self.keep(name, Values::Text(values));
            return Ok(());
        }
        self.skip(n, scalar)
    }

    fn keep(&mut self, name: &str, values: Values) {
        let name = decoded(name);
        self.dataset.arrays.push(Array { name, values });
    }

    /// Reads texts: in ASCII, one per line.
    ///
    /// In binary files a length of one, two, four or eight bytes precedes each text; its first two bits give its size.
    fn texts(&mut self, n: usize) -> Result<Vec<String>, SceneError> {
        const WHAT: &str = "an array of texts";
        let mut texts = Vec::with_capacity(n);
        for _ in 0..n {
            if !self.is_binary {
                let cut_short = || self.source.error(SceneErrorKind::CutShort { what: WHAT });
                let line = self.cursor.next_line()?.ok_or_else(cut_short)?;
                texts.push(decoded(line));
                continue;
            }
            let first: u8 = self.cursor.binary(WHAT)?;
            let n_more = match first >> 6 {
                3 => 0,
                2 => 1,
                1 => 3,
                _ => 7,
            };
            let more = self.cursor.take(n_more, WHAT)?;
            let length = more
                .iter()
                .fold(u64::from(first & 63), |length, byte| length << 8 | u64::from(*byte));
            let bytes = self.cursor.take(usize::try_from(length).unwrap_or(usize::MAX), WHAT)?;
            texts.push(String::from_utf8_lossy(bytes).into_owned());
        }
        Ok(texts)
    }
}

/// Returns a text with its percent-encoded signs decoded.
fn decoded(text: &str) -> String {
    let bytes = super::super::gltf::percent_decoded(text);
    String::from_utf8_lossy(&bytes).into_owned()
}
