//! Cells of meshes: the types that are faces, and the arrays that name surfaces.

use super::LoadOptions;
use super::polygons::{Names, Polygons};
use super::source::Source;
use crate::scene::{Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind};

/// The names of cell arrays whose values become surfaces unless [`LoadOptions::surface_array`] names another; the first one in a file counts.
#[rustfmt::skip]
pub const USUAL_ARRAYS: [&str; 20] = [
    "surface", "surface_id", "SurfaceId", "surfaces", "gmsh:physical",
    "CellEntityIds", "gmsh:geometrical", "GroupIds", "group", "group_id",
    "ElementBlockIds", "RegionId", "region", "zone", "PartId",
    "part", "cell_tags", "medit:ref", "MaterialIds", "ObjectId",
];

/// An array with a value for each face.
#[derive(Debug)]
pub(super) struct Array {
    pub(super) name: String,
    pub(super) values: Values,
}

/// The values of an array.
#[derive(Debug)]
pub(super) enum Values {
    Whole(Vec<i64>),
    Text(Vec<String>),
}

impl Array {
    fn len(&self) -> usize {
        match &self.values {
            Values::Whole(values) => values.len(),
            Values::Text(values) => values.len(),
        }
    }
}

/// Assigns surfaces to the faces by an array: its texts, or `surfaceN` for a whole number N.
pub(super) fn surfaces(
    polygons: &mut Polygons,
    arrays: Vec<Array>,
    options: &LoadOptions,
    source: &Source<'_>,
) -> Result<(), SceneError> {
    let n_faces = polygons.faces.len();
    let mut usable: Vec<Array> = arrays.into_iter().filter(|array| array.len() == n_faces).collect();
    let place = match &options.surface_array {
        Some(name) => {
            let found = usable.iter().position(|array| array.name == *name);
            Some(found.ok_or_else(|| source.error(unknown(name, &usable)))?)
        }
        None => USUAL_ARRAYS
            .iter()
            .find_map(|usual| usable.iter().position(|array| array.name == *usual)),
    };
    let Some(place) = place else {
        return Ok(());
    };
    let mut names = Names::default();
    let mut number = |face: usize, name: &str| polygons.faces[face].group = names.number(name);
    match usable.swap_remove(place).values {
        Values::Whole(values) => {
            for (face, value) in values.iter().enumerate() {
                number(face, &format!("surface{value}"));
            }
        }
        Values::Text(values) => {
            for (face, value) in values.iter().enumerate() {
                number(face, value);
            }
        }
    }
    polygons.groups = names.all;
    Ok(())
}

/// Returns the error of an array that is not among those of a file.
pub(super) fn unknown(name: &str, usable: &[Array]) -> SceneErrorKind {
    const SHOWN: usize = 12;
    let known: Vec<String> = usable
        .iter()
        .take(SHOWN)
        .map(|array| format!("`{}`", array.name))
        .collect();
    SceneErrorKind::UnknownArray {
        name: name.to_owned(),
        known: if known.is_empty() {
            "none".to_owned()
        } else {
            known.join(", ")
        },
    }
}

/// A type of cells of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cell {
    /// A face with its number of corners, which are its first vertices; true if it has further vertices between these.
    Face(usize, bool),
    /// A point or a line.
    Thin,
    /// A volume.
    Volume,
}

/// The numbers of cells of a file that are not flat faces.
#[derive(Debug, Default)]
pub(super) struct Others {
    pub(super) thin: usize,
    volumes: usize,
    higher: usize,
}

impl Others {
    /// Counts a cell.
    pub(super) fn count(&mut self, cell: Cell) {
        match cell {
            Cell::Face(_, is_higher) => self.higher += usize::from(is_higher),
            Cell::Thin => self.thin += 1,
            Cell::Volume => self.volumes += 1,
        }
    }

    /// Returns the warnings about skipped or flattened cells.
    pub(super) fn warnings(&self, file: &std::path::Path) -> Vec<SceneWarning> {
        let skipped = |count, what| SceneWarningKind::SkippedElements { count, what };
        let kinds = [
            (self.thin, skipped(self.thin, "points or lines")),
            (self.volumes, skipped(self.volumes, "volume cells")),
            (self.higher, SceneWarningKind::HigherOrder { count: self.higher }),
        ];
        let those = kinds.into_iter().filter(|(count, _)| *count > 0);
        those
            .map(|(_, kind)| SceneWarning::new(Origin::file(file), kind))
            .collect()
    }
}
