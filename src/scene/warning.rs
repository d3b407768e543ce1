//! What a scene leaves open, and how it was filled: the scene is usable, but perhaps not what was meant.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::printable::printable;

/// A doubt about a scene that was loaded.
///
/// Each kind is told once per cause, with the first line and a count, not once per face.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneWarning {
    /// Faces without an area were skipped.
    ZeroAreaFaces {
        /// The scene file.
        file: PathBuf,
        /// The line of the first one.
        line: u32,
        /// How many there are.
        count: usize,
    },
    /// Faces of four corners or more are not flat, and were cut into triangles.
    BentFaces {
        /// The scene file.
        file: PathBuf,
        /// The line of the first one.
        line: u32,
        /// How many there are.
        count: usize,
    },
    /// A material library does not exist.
    MissingLibrary {
        /// The scene file.
        file: PathBuf,
        /// The line of the `mtllib`.
        line: u32,
        /// The name in the file.
        name: String,
    },
    /// A `usemtl` names a material that no library defines: reflectance 0.5, exitance 0.
    UnknownMaterial {
        /// The scene file.
        file: PathBuf,
        /// The line of the first such `usemtl`.
        line: u32,
        /// The material's name.
        name: String,
    },
    /// Faces have no material: reflectance 0.5, exitance 0.
    NoMaterial {
        /// The scene file.
        file: PathBuf,
        /// The line of the first one.
        line: u32,
        /// How many there are.
        count: usize,
    },
    /// A material in use has no `Kd`: reflectance 0.5.
    MissingReflectance {
        /// The material file.
        file: PathBuf,
        /// The line of its `newmtl`.
        line: u32,
        /// The material's name.
        name: String,
    },
    /// A material in use is defined twice: the last definition counts.
    RepeatedMaterial {
        /// The material file of the last definition.
        file: PathBuf,
        /// The line of its `newmtl`.
        line: u32,
        /// The material's name.
        name: String,
    },
    /// A material in use has a texture, which is not read: its `Kd` or `Ke` counts.
    IgnoredTexture {
        /// The material file.
        file: PathBuf,
        /// The line of the texture.
        line: u32,
        /// What counts in its place.
        keyword: &'static str,
        /// The material's name.
        name: String,
    },
    /// Materials in use mirror light or let it through (`Ks`, `d`, `Tr`), which is not used.
    NotDiffuse {
        /// The material file of the first one.
        file: PathBuf,
        /// The line that says so.
        line: u32,
        /// The keyword of that line.
        keyword: &'static str,
        /// How many materials there are.
        count: usize,
    },
    /// No face emits light.
    NoEmission {
        /// The scene file.
        file: PathBuf,
    },
}

impl SceneWarning {
    /// Returns a stable name of the kind of warning, in snake case, for programs.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::ZeroAreaFaces { .. } => "zero_area_faces",
            Self::BentFaces { .. } => "bent_faces",
            Self::MissingLibrary { .. } => "missing_library",
            Self::UnknownMaterial { .. } => "unknown_material",
            Self::NoMaterial { .. } => "no_material",
            Self::MissingReflectance { .. } => "missing_reflectance",
            Self::RepeatedMaterial { .. } => "repeated_material",
            Self::IgnoredTexture { .. } => "ignored_texture",
            Self::NotDiffuse { .. } => "not_diffuse",
            Self::NoEmission { .. } => "no_emission",
        }
    }

    /// Tells whether the warning is about light and materials alone: of no interest where only the geometry counts.
    #[must_use]
    pub fn is_about_light(&self) -> bool {
        !matches!(self, Self::ZeroAreaFaces { .. } | Self::BentFaces { .. })
    }

    /// Returns the file that the warning is about.
    #[must_use]
    pub fn file(&self) -> &Path {
        match self {
            Self::ZeroAreaFaces { file, .. }
            | Self::BentFaces { file, .. }
            | Self::MissingLibrary { file, .. }
            | Self::UnknownMaterial { file, .. }
            | Self::NoMaterial { file, .. }
            | Self::MissingReflectance { file, .. }
            | Self::RepeatedMaterial { file, .. }
            | Self::IgnoredTexture { file, .. }
            | Self::NotDiffuse { file, .. }
            | Self::NoEmission { file } => file,
        }
    }

    /// Returns the line that the warning is about, counted from 1, or `None` if it is about the whole file.
    #[must_use]
    pub fn line(&self) -> Option<u32> {
        match self {
            Self::ZeroAreaFaces { line, .. }
            | Self::BentFaces { line, .. }
            | Self::MissingLibrary { line, .. }
            | Self::UnknownMaterial { line, .. }
            | Self::NoMaterial { line, .. }
            | Self::MissingReflectance { line, .. }
            | Self::RepeatedMaterial { line, .. }
            | Self::IgnoredTexture { line, .. }
            | Self::NotDiffuse { line, .. } => Some(*line),
            Self::NoEmission { .. } => None,
        }
    }
}

impl fmt::Display for SceneWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file().display())?;
        if let Some(line) = self.line() {
            write!(f, ":{line}")?;
        }
        match self {
            Self::ZeroAreaFaces { count: 1, .. } => write!(f, ": a face without an area is skipped"),
            Self::ZeroAreaFaces { count, .. } => {
                write!(f, ": {count} faces without an area are skipped, this is the first")
            }
            Self::BentFaces { count: 1, .. } => {
                write!(
                    f,
                    ": a face is not flat; it is cut into triangles, which may not be those that were meant"
                )
            }
            Self::BentFaces { count, .. } => {
                write!(
                    f,
                    ": {count} faces are not flat, this is the first; they are cut into triangles, which may not be those that were meant"
                )
            }
            Self::MissingLibrary { name, .. } => {
                write!(
                    f,
                    ": material library `{}` is not there; its materials reflect 0.5",
                    printable(name)
                )
            }
            Self::UnknownMaterial { name, .. } => write!(
                f,
                ": no library defines material `{}`; it reflects 0.5",
                printable(name)
            ),
            Self::NoMaterial { count: 1, .. } => write!(f, ": a face has no material; it reflects 0.5"),
            Self::NoMaterial { count, .. } => {
                write!(
                    f,
                    ": {count} faces have no material, this is the first; they reflect 0.5"
                )
            }
            Self::MissingReflectance { name, .. } => {
                write!(f, ": material `{}` has no `Kd`; it reflects 0.5", printable(name))
            }
            Self::RepeatedMaterial { name, .. } => {
                write!(
                    f,
                    ": material `{}` is defined again; this definition counts",
                    printable(name)
                )
            }
            Self::IgnoredTexture { name, keyword, .. } => {
                write!(
                    f,
                    ": the texture of material `{}` is not read; its `{keyword}` counts everywhere",
                    printable(name)
                )
            }
            Self::NotDiffuse { keyword, count: 1, .. } => {
                write!(f, ": `{keyword}` is not used: surfaces are diffuse and opaque")
            }
            Self::NotDiffuse { keyword, count, .. } => {
                write!(
                    f,
                    ": `{keyword}` is not used: surfaces are diffuse and opaque; {count} materials are meant otherwise, this is the first"
                )
            }
            Self::NoEmission { .. } => write!(f, ": no face emits light; give a material an exitance `Ke`"),
        }
    }
}
