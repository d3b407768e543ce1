//! The result of every reader: polygons over vertices, with the names of their surfaces and materials.

use std::collections::HashMap;

use glam::DVec3;

use crate::scene::{Numbering, Origin, SceneWarning, Written};

/// The surface or material of a face that has none.
pub(super) const NONE: u32 = u32::MAX;

/// One face of a file.
#[derive(Clone, Copy, Debug)]
pub(super) struct FileFace {
    /// Where its corners end in [`Polygons::corners`].
    pub(super) end: usize,
    /// Its surface, in [`Polygons::groups`], or [`NONE`].
    pub(super) group: u32,
    /// Its material, in [`Polygons::materials`], or [`NONE`].
    pub(super) material: u32,
    /// Its line, or its number as [`Polygons::numbering`] counts.
    pub(super) number: u32,
}

/// A material as a file states it.
#[derive(Clone, Debug)]
pub(super) struct FileMaterial {
    pub(super) name: String,
    /// ρ, where it is stated.
    pub(super) reflectance: Option<[f64; 3]>,
    /// E, W·m⁻².
    pub(super) exitance: [f64; 3],
    /// The keyword of the exitance in messages.
    pub(super) exitance_keyword: &'static str,
    /// Where the exitance is stated.
    pub(super) at: Origin,
    /// The doubt about it, if a face has it.
    pub(super) doubts: Vec<SceneWarning>,
}

/// The polygons of a file.
#[derive(Debug, Default)]
pub(super) struct Polygons {
    pub(super) vertices: Vec<DVec3>,
    /// The vertices of all faces, one face after another.
    pub(super) corners: Vec<u32>,
    pub(super) faces: Vec<FileFace>,
    /// The names of the surfaces, in file order; some may own no face. Empty if the file names none.
    pub(super) groups: Vec<String>,
    pub(super) materials: Vec<FileMaterial>,
    pub(super) numbering: Numbering,
    /// How finely the coordinates are written.
    pub(super) written: Written,
    /// True if each face has vertices of its own, as in STL.
    pub(super) repeats_vertices: bool,
    /// True of formats that hold no materials.
    pub(super) has_no_materials: bool,
    /// The number of faces that the format requires to lie on others, which need no warning.
    pub(super) n_drawn: usize,
    pub(super) warnings: Vec<SceneWarning>,
}

impl Polygons {
    /// Adds a face of vertices.
    pub(super) fn face(&mut self, corners: impl IntoIterator<Item = u32>, group: u32, material: u32, number: u32) {
        self.corners.extend(corners);
        self.faces.push(FileFace {
            end: self.corners.len(),
            group,
            material,
            number,
        });
    }

    /// Iterates over the faces with their corners.
    pub(super) fn outlines(&self) -> impl Iterator<Item = (&FileFace, &[u32])> {
        let starts = std::iter::once(0).chain(self.faces.iter().map(|face| face.end));
        self.faces
            .iter()
            .zip(starts)
            .map(|(face, start)| (face, &self.corners[start..face.end]))
    }
}

/// Numbers for names, in the order of their first use.
#[derive(Debug, Default)]
pub(super) struct Names {
    pub(super) all: Vec<String>,
    number_of: HashMap<String, u32>,
}

impl Names {
    /// Returns whether a name has a number.
    pub(super) fn has(&self, name: &str) -> bool {
        self.number_of.contains_key(name)
    }

    /// Returns the number of a name, and numbers a new one.
    pub(super) fn number(&mut self, name: &str) -> u32 {
        if let Some(&number) = self.number_of.get(name) {
            return number;
        }
        // No file has 2³² lines with a name each.
        let number = u32::try_from(self.all.len()).unwrap_or(NONE - 1);
        self.all.push(name.to_owned());
        self.number_of.insert(name.to_owned(), number);
        number
    }
}
