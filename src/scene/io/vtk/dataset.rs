//! The points and cells of a VTK file, and the faces among these.

use glam::DVec3;

use super::super::cells::{Array, Cell, Others, Values, surfaces};
use super::super::polygons::{NONE, Polygons};
use super::super::source::Source;
use super::super::{Counts, LoadOptions};
use crate::printable::counted;
use crate::scene::{MAX_CORNERS, Numbering, Origin, SceneError, SceneErrorKind, Written};

/// Types of cells that are not a single flat face.
pub(super) const LINE: u8 = 4;
pub(super) const VERTICES: u8 = 2;
pub(super) const STRIP: u8 = 6;
const POLYGON: u8 = 7;
const PIXEL: u8 = 8;
const QUADRATIC_POLYGON: u8 = 36;

/// A mesh of a file.
pub(super) struct Dataset {
    pub(super) points: Vec<DVec3>,
    pub(super) written: Written,
    /// The points of all cells, one cell after another.
    pub(super) connectivity: Vec<u32>,
    /// The end of each cell in these.
    pub(super) ends: Vec<usize>,
    /// The type of each cell.
    pub(super) types: Vec<u8>,
    /// The arrays of the cells.
    pub(super) arrays: Vec<Array>,
}

impl Default for Dataset {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            written: Written::new(),
            connectivity: Vec::new(),
            ends: Vec::new(),
            types: Vec::new(),
            arrays: Vec::new(),
        }
    }
}

/// Returns the class of a type of cells.
fn cell_of(kind: u8, n_points: usize) -> Cell {
    match kind {
        5 => Cell::Face(3, false),
        9 | PIXEL => Cell::Face(4, false),
        POLYGON => Cell::Face(n_points, false),
        // The midpoints of its edges follow its corners.
        QUADRATIC_POLYGON => Cell::Face(n_points / 2, true),
        22 | 34 | 69 | 76 => Cell::Face(3, true),
        23 | 28 | 30 | 70 | 77 => Cell::Face(4, true),
        0..=LINE | 21 | 35 | 68 | 75 => Cell::Thin,
        _ => Cell::Volume,
    }
}

/// Returns the name of a type of cells and the number of its points; `None` for types whose cells differ in it.
fn fixed_points_of(kind: u8) -> Option<(&'static str, usize)> {
    Some(match kind {
        1 => ("vertex", 1),
        3 => ("line", 2),
        5 => ("triangle", 3),
        PIXEL => ("pixel", 4),
        9 => ("quad", 4),
        10 => ("tetrahedron", 4),
        11 => ("voxel", 8),
        12 => ("hexahedron", 8),
        13 => ("wedge", 6),
        14 => ("pyramid", 5),
        21 => ("quadratic edge", 3),
        22 => ("quadratic triangle", 6),
        23 => ("quadratic quad", 8),
        28 => ("biquadratic quad", 9),
        30 => ("quadratic linear quad", 6),
        34 => ("biquadratic triangle", 7),
        35 => ("cubic line", 4),
        _ => return None,
    })
}

/// Refuses a cell with another number of points than its type has: what it is meant to be is unknown.
fn expect_points(kind: u8, n_points: usize) -> Result<(), SceneErrorKind> {
    let expected = match fixed_points_of(kind) {
        Some((_, n)) if n == n_points => return Ok(()),
        Some((name, n)) => format!("{} in a cell of type {kind} ({name})", counted(n, "point")),
        None if kind == STRIP && n_points < 3 => format!("3 points or more in a cell of type {kind} (triangle strip)"),
        None if kind == QUADRATIC_POLYGON && n_points % 2 == 1 => {
            format!("an even number of points in a cell of type {kind} (quadratic polygon)")
        }
        None => return Ok(()),
    };
    Err(SceneErrorKind::malformed(expected, n_points.to_string()))
}

impl Dataset {
    /// Adds cells of one kind, by the end of each among the last added points.
    pub(super) fn push_cells(&mut self, ends: impl IntoIterator<Item = usize>, kind: impl Fn(usize) -> u8) {
        let mut start = self.ends.last().copied().unwrap_or(0);
        for end in ends {
            self.types.push(kind(end - start));
            self.ends.push(end);
            start = end;
        }
    }

    /// Returns the type of a polygon with `n_points` points.
    pub(super) fn polygon_of(n_points: usize) -> u8 {
        match n_points {
            3 => 5,
            4 => 9,
            _ => POLYGON,
        }
    }

    /// Returns the faces, with their surfaces.
    pub(super) fn polygons(self, source: &Source<'_>, options: &LoadOptions) -> Result<Polygons, SceneError> {
        let n_strip_corners = self
            .types
            .contains(&STRIP)
            .then_some(2 * self.connectivity.len() as u64);
        source.expect(Counts {
            vertices: self.points.len() as u64,
            corners: self.connectivity.len() as u64 + n_strip_corners.unwrap_or(0),
            faces: self.ends.len() as u64 + n_strip_corners.unwrap_or(0) / 2,
        })?;
        let mut polygons = Polygons {
            vertices: self.points,
            numbering: Numbering::elements("cell", 0),
            written: self.written,
            has_no_materials: true,
            ..Polygons::default()
        };
        let mut others = Others::default();
        // The cell of each face.
        let mut cells: Vec<usize> = Vec::with_capacity(self.ends.len());
        let mut start = 0;
        for (k, (&end, &kind)) in self.ends.iter().zip(&self.types).enumerate() {
            let points = &self.connectivity[start..end];
            start = end;
            let number = u32::try_from(k + 1).unwrap_or(u32::MAX);
            let refused = |reason| {
                let (path, element) = (source.path.clone(), polygons.numbering.label(number));
                SceneError::new(Origin::Element { path, element }, reason)
            };
            expect_points(kind, points.len()).map_err(refused)?;
            if kind == STRIP {
                for (j, triangle) in points.windows(3).enumerate() {
                    let mut corners = [triangle[0], triangle[1], triangle[2]];
                    if j % 2 == 1 {
                        corners.swap(0, 1);
                    }
                    polygons.face(corners, NONE, NONE, number);
                    cells.push(k);
                }
                continue;
            }
            let cell = cell_of(kind, points.len());
            others.count(cell);
            let Cell::Face(n_corners, _) = cell else {
                continue;
            };
            if points.len() < n_corners || n_corners < 3 {
                return Err(refused(SceneErrorKind::TooFewCorners { count: points.len() }));
            }
            if n_corners > MAX_CORNERS as usize {
                let (what, limit) = ("corners in one face", MAX_CORNERS);
                return Err(refused(SceneErrorKind::TooMany { what, limit }));
            }
            if kind == PIXEL {
                polygons.face([points[0], points[1], points[3], points[2]], NONE, NONE, number);
            } else {
                polygons.face(points[..n_corners].iter().copied(), NONE, NONE, number);
            }
            cells.push(k);
        }
        let arrays = self
            .arrays
            .into_iter()
            .filter_map(|array| of_faces(array, &cells, self.ends.len()));
        let arrays = arrays.collect();
        let warnings = others.warnings(&source.path);
        polygons.warnings.extend(warnings);
        surfaces(&mut polygons, arrays, options, source)?;
        Ok(polygons)
    }
}

/// Returns the values of a cell array for the faces; `None` unless it has one value for each cell.
fn of_faces(array: Array, cells: &[usize], n_cells: usize) -> Option<Array> {
    let values = match array.values {
        Values::Whole(values) if values.len() == n_cells => {
            Values::Whole(cells.iter().map(|cell| values[*cell]).collect())
        }
        Values::Text(values) if values.len() == n_cells => {
            Values::Text(cells.iter().map(|cell| values[*cell].clone()).collect())
        }
        _ => return None,
    };
    Some(Array {
        name: array.name,
        values,
    })
}
