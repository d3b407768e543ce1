//! Reads VTK's XML files of unstructured grids and of polygons.

use std::error::Error as _;
use std::str::Utf8Error;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::super::cells::Array;
use super::super::source::Source;
use super::dataset::{Dataset, LINE, STRIP, VERTICES};
use super::xml_array::{Content, DataArray};
use super::xml_bytes::Encoding;
use crate::scene::lines::line_after;
use crate::scene::{Origin, SceneError, SceneErrorKind};

/// A part of a file, with its arrays.
#[derive(Default)]
struct Piece {
    n_points: u64,
    /// The numbers of cells of each section; those of a grid in the place of polygons.
    n_cells: [u64; 4],
    points: Option<DataArray>,
    /// Offsets, connectivity and, for a grid, types of each section; those of a grid are in the place of polygons.
    cells: [[Option<DataArray>; 3]; 4],
    cell_data: Vec<DataArray>,
}

/// The kinds of polygons, in the order of their data among the cells of a piece.
const SECTIONS: [&str; 4] = ["Verts", "Lines", "Polys", "Strips"];

/// The place of polygons, or of all cells of a grid.
const POLYS: usize = 2;

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

struct File<'a> {
    source: &'a Source<'a>,
    encoding: Encoding,
    is_grid: bool,
    pieces: Vec<Piece>,
    /// The current section.
    section: &'static str,
    is_ended: bool,
}

pub(super) fn read(source: &Source<'_>) -> Result<Dataset, SceneError> {
    let mut file = File {
        source,
        encoding: Encoding::default(),
        is_grid: false,
        pieces: Vec::new(),
        section: "",
        is_ended: false,
    };
    file.parse()?;
    if !file.is_ended {
        return Err(source.error(SceneErrorKind::CutShort { what: "`VTKFile`" }));
    }
    file.dataset()
}

impl File<'_> {
    /// Reads all elements up to appended data, which may be binary; of arrays it records only the places.
    fn parse(&mut self) -> Result<(), SceneError> {
        let source = self.source;
        let start = if source.head().bytes.starts_with(BYTE_ORDER_MARK) {
            BYTE_ORDER_MARK.len() as u64
        } else {
            0
        };
        let mut reader = Reader::from_reader(source.stream(start, u64::MAX));
        let mut buffer = Vec::new();
        let mut array: Option<DataArray> = None;
        // The nesting depth of elements that describe an array.
        let mut depth = 0;
        loop {
            buffer.clear();
            let before = start + reader.buffer_position();
            let event = reader.read_event_into(&mut buffer);
            let place = before..start + reader.buffer_position();
            let event = event.map_err(|error| refused(source, error, before, start + reader.error_position()))?;
            let malformed = |(expected, found): (&str, String)| {
                error_at(source, place.end, SceneErrorKind::malformed(expected, found))
            };
            match event {
                Event::Start(_) if array.is_some() => depth += 1,
                Event::End(_) if depth > 0 => depth -= 1,
                Event::Empty(_) if array.is_some() => {}
                Event::Start(tag) if tag.name().as_ref() == "AppendedData" => {
                    self.is_ended = true;
                    return self.encoding.append(source, &tag, place.end);
                }
                Event::Start(tag) => array = self.begin(&tag).map_err(malformed)?,
                Event::Empty(tag) => {
                    if let Some(empty) = self.begin(&tag).map_err(malformed)? {
                        self.keep(empty);
                    }
                }
                Event::Text(content) => {
                    if let Some(own) = array.as_mut().filter(|_| depth == 0 && !content.trim().is_empty()) {
                        own.content.write(place);
                    }
                }
                Event::End(tag) => match tag.name().as_ref() {
                    "DataArray" | "Array" => {
                        if let Some(ended) = array.take() {
                            self.keep(ended);
                        }
                    }
                    "VTKFile" => {
                        self.is_ended = true;
                        return Ok(());
                    }
                    name if name == self.section => self.section = "",
                    _ => {}
                },
                Event::Eof => return Ok(()),
                _ => {}
            }
        }
    }

    /// Handles the start of an element, and returns an array that begins; an error is the expected and the found text.
    fn begin(&mut self, tag: &BytesStart<'_>) -> Result<Option<DataArray>, (&'static str, String)> {
        let attribute = |name: &str| -> Option<String> {
            let found = tag.try_get_attribute(name).ok()??;
            found
                .normalized_value(XmlVersion::Implicit1_0)
                .ok()
                .map(std::borrow::Cow::into_owned)
        };
        let count = |name: &str| -> Result<u64, (&'static str, String)> {
            let text = attribute(name).unwrap_or_default();
            if text.trim().is_empty() {
                return Ok(0);
            }
            text.trim().parse().map_err(|_| ("a number of points or cells", text))
        };
        match tag.name().as_ref() {
            "VTKFile" => {
                let kind = attribute("type").unwrap_or_default();
                self.is_grid = kind == "UnstructuredGrid";
                if !self.is_grid && kind != "PolyData" {
                    return Err(("a file of type `UnstructuredGrid` or `PolyData`", kind));
                }
                let (order, header) = (attribute("byte_order"), attribute("header_type"));
                self.encoding.is_little = order.as_deref() != Some("BigEndian");
                self.encoding.has_wide_headers = header.as_deref() == Some("UInt64");
                self.encoding.compressor = attribute("compressor").filter(|name| !name.is_empty());
            }
            "Piece" => {
                let mut piece = Piece {
                    n_points: count("NumberOfPoints")?,
                    ..Piece::default()
                };
                if self.is_grid {
                    piece.n_cells[POLYS] = count("NumberOfCells")?;
                } else {
                    for (n, section) in piece.n_cells.iter_mut().zip(SECTIONS) {
                        *n = count(&format!("NumberOf{section}"))?;
                    }
                }
                self.pieces.push(piece);
            }
            name => {
                const ALL: [&str; 9] = [
                    "Points",
                    "Cells",
                    "Verts",
                    "Lines",
                    "Polys",
                    "Strips",
                    "CellData",
                    "PointData",
                    "FieldData",
                ];
                if let Some(section) = ALL.iter().find(|section| **section == name) {
                    self.section = section;
                } else if matches!(name, "DataArray" | "Array") {
                    return DataArray::begun(&attribute).map(Some);
                }
            }
        }
        Ok(None)
    }

    /// Stores an array in its place.
    fn keep(&mut self, array: DataArray) {
        if let Content::Appended(offset) = array.content {
            self.encoding.offsets.push(offset);
        }
        let Some(piece) = self.pieces.last_mut() else {
            return;
        };
        let place = match self.section {
            "Points" => {
                piece.points = Some(array);
                return;
            }
            "CellData" => {
                piece.cell_data.push(array);
                return;
            }
            "Cells" => POLYS,
            section => match SECTIONS.iter().position(|known| *known == section) {
                Some(place) => place,
                None => return,
            },
        };
        let which = match &*array.name {
            "offsets" => 0,
            "connectivity" => 1,
            "types" => 2,
            _ => return,
        };
        piece.cells[place][which] = Some(array);
    }

    fn dataset(mut self) -> Result<Dataset, SceneError> {
        self.encoding.offsets.sort_unstable();
        let mut dataset = Dataset::default();
        let pieces = std::mem::take(&mut self.pieces);
        let n_pieces = pieces.len();
        for (k, piece) in pieces.into_iter().enumerate() {
            let refused = |kind| {
                if n_pieces == 1 {
                    return self.source.error(kind);
                }
                let (path, element) = (self.source.path.clone(), format!("piece {k}"));
                SceneError::new(Origin::Element { path, element }, kind)
            };
            self.add(piece, &mut dataset).map_err(refused)?;
        }
        Ok(dataset)
    }

    fn add(&self, piece: Piece, dataset: &mut Dataset) -> Result<(), SceneErrorKind> {
        let from = (self.source, &self.encoding);
        let first_point = u32::try_from(dataset.points.len()).unwrap_or(u32::MAX);
        let n_points = piece.n_points.saturating_mul(3);
        if let Some(points) = piece.points.filter(|_| n_points > 0) {
            points.points(from, n_points, dataset)?;
        } else if n_points > 0 {
            return Err(SceneErrorKind::malformed("an array of points", "none"));
        }
        let first_cell = dataset.ends.len();
        for ((place, n), arrays) in piece.n_cells.into_iter().enumerate().zip(piece.cells) {
            if n == 0 {
                continue;
            }
            let [Some(offsets), Some(connectivity), types] = arrays else {
                return Err(SceneErrorKind::malformed(
                    "arrays `offsets` and `connectivity` of cells",
                    "none",
                ));
            };
            let start = dataset.connectivity.len();
            let mut ends = Vec::new();
            let mut last = 0;
            offsets.whole(from, Some(n), |end| {
                let own = usize::try_from(end).ok().filter(|own| *own >= last);
                last = own.ok_or_else(|| SceneErrorKind::malformed("offsets that grow", end.to_string()))?;
                ends.push(start.saturating_add(last));
                Ok(())
            })?;
            connectivity.whole(from, None, |point| {
                let own = u32::try_from(point).ok().filter(|own| u64::from(*own) < piece.n_points);
                let own = own.ok_or(SceneErrorKind::IndexOutOfRange {
                    index: point,
                    n_vertices: usize::try_from(piece.n_points).unwrap_or(usize::MAX),
                })?;
                dataset.connectivity.push(first_point.saturating_add(own));
                Ok(())
            })?;
            let n_connected = dataset.connectivity.len() - start;
            if last > n_connected {
                return Err(SceneErrorKind::Truncated {
                    what: "points of cells",
                    n: last as u64,
                    room: n_connected as u64,
                });
            }
            dataset.connectivity.truncate(start + last);
            if self.is_grid {
                let types = types.ok_or_else(|| SceneErrorKind::malformed("an array `types` of cells", "none"))?;
                types.whole(from, Some(n), |kind| {
                    dataset.types.push(u8::try_from(kind).unwrap_or(u8::MAX));
                    Ok(())
                })?;
                dataset.ends.append(&mut ends);
            } else {
                match SECTIONS[place] {
                    "Verts" => dataset.push_cells(ends, |_| VERTICES),
                    "Lines" => dataset.push_cells(ends, |_| LINE),
                    "Strips" => dataset.push_cells(ends, |_| STRIP),
                    _ => dataset.push_cells(ends, Dataset::polygon_of),
                }
            }
        }
        let n_cells = (dataset.ends.len() - first_cell) as u64;
        let mut arrays = Vec::new();
        for array in piece.cell_data.into_iter().filter(DataArray::may_name) {
            let name = array.name.clone();
            if let Some(values) = array.names(from, n_cells)? {
                arrays.push(Array { name, values });
            }
        }
        super::xml_array::join(&mut dataset.arrays, arrays, first_cell);
        Ok(())
    }
}

/// Returns an error at the line of a place.
fn error_at(source: &Source<'_>, at: u64, kind: SceneErrorKind) -> SceneError {
    let before = match source.part(0, at) {
        Ok(before) => before,
        Err(error) => return error,
    };
    let line = line_after(&String::from_utf8_lossy(&before));
    SceneError::new(Origin::line(&source.path, line), kind)
}

/// Returns the error of invalid XML, in an event that begins at a place.
fn refused(source: &Source<'_>, error: quick_xml::Error, start: u64, at: u64) -> SceneError {
    match error {
        quick_xml::Error::Io(error) => source.unreadable(std::io::Error::new(error.kind(), error.to_string())),
        quick_xml::Error::Encoding(error) => {
            let text = error.source().and_then(|error| error.downcast_ref::<Utf8Error>());
            let n_valid = text.map_or(0, Utf8Error::valid_up_to);
            error_at(source, start + n_valid as u64, SceneErrorKind::NotUtf8)
        }
        error => error_at(
            source,
            at,
            SceneErrorKind::malformed("well-formed XML", error.to_string()),
        ),
    }
}
