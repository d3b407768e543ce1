//! What a scene leaves open, and how it was filled: the scene is usable, but perhaps not what was meant.

use std::fmt;

use super::Origin;
use crate::printable::{counted, quoted, short};

/// A doubt about a scene that was loaded, with its place.
///
/// Each kind is told once per cause, with the first place and a count, not once per face.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneWarning {
    /// Where; of several places the first.
    pub at: Origin,
    /// What.
    pub kind: SceneWarningKind,
}

/// What is doubtful about a scene.
#[derive(Clone, Debug, PartialEq, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
#[non_exhaustive]
pub enum SceneWarningKind {
    /// Faces without an area were skipped.
    ZeroAreaFaces {
        /// How many there are.
        count: usize,
    },
    /// Faces of four corners or more are not flat, and were cut into triangles.
    BentFaces {
        /// How many there are.
        count: usize,
    },
    /// Faces are drawn on larger ones in their plane, as doors on a wall, and were cut out of these.
    CutFaces {
        /// How many are.
        count: usize,
        /// The area that the larger faces lost, in m².
        area: f64,
    },
    /// Faces were cut away as a whole: smaller ones in their plane cover them.
    CoveredFaces {
        /// How many there are.
        count: usize,
    },
    /// Statements of one kind were skipped.
    SkippedStatements {
        /// How many there are.
        count: usize,
        /// What they are, in the plural.
        what: &'static str,
    },
    /// Parts of one kind, which are no surfaces, were skipped.
    SkippedElements {
        /// How many there are.
        count: usize,
        /// What they are, in the plural.
        what: &'static str,
    },
    /// Faces of higher order are read as flat, through their corners.
    HigherOrder {
        /// How many there are.
        count: usize,
    },
    /// The normals that a file states oppose the winding of faces, which counts.
    OpposedNormals {
        /// How many faces there are.
        count: usize,
    },
    /// Vertices were joined that are not equal.
    MergedVertices {
        /// How many vertices were moved.
        count: usize,
        /// The greatest distance by which one was, in m.
        distance: f64,
    },
    /// Vertices are nearly equal, but not joined.
    NearlyEqualVertices {
        /// How many there are beside those that they nearly equal.
        count: usize,
        /// How near they are, in m.
        tolerance: f64,
    },
    /// Mask surfaces were moved off the surfaces that they cover.
    MovedMasks {
        /// How many there are.
        count: usize,
        /// The distance, as a part of their size.
        relative: f64,
    },
    /// Surfaces that only block, or that nothing is to be computed of, are black surfaces of the scene.
    BlackSurfaces {
        /// How many faces there are.
        count: usize,
        /// What they are in the format, in the plural.
        what: &'static str,
    },
    /// Keywords in capitals were read as if they were in small letters.
    Capitals {
        /// How many there are.
        count: usize,
    },
    /// A `mtllib` names no library.
    NamelessLibrary,
    /// A material library is not where the scene file says: a file of its name beside the scene was read.
    LibraryElsewhere {
        /// The name in the file.
        name: String,
        /// The name of the file that was read.
        used: String,
    },
    /// A material library does not exist.
    MissingLibrary {
        /// The name in the file.
        name: String,
    },
    /// A `usemtl` names a material that no library defines: reflectance 0.5, exitance 0.
    UnknownMaterial {
        /// The material's name.
        name: String,
    },
    /// Faces have no material: reflectance 0.5, exitance 0.
    NoMaterial {
        /// How many there are.
        count: usize,
    },
    /// The file states no materials: reflectance 0.5, exitance 0.
    NoMaterials,
    /// A material in use states something that a diffuse face has no use for.
    IgnoredProperty {
        /// What it is.
        what: &'static str,
        /// The material's name.
        name: String,
    },
    /// A material in use has no `Kd`: reflectance 0.5.
    MissingReflectance {
        /// The material's name.
        name: String,
    },
    /// A material in use is defined twice: the last definition counts.
    RepeatedMaterial {
        /// The material's name.
        name: String,
    },
    /// A material in use has a texture, which is not read: its `Kd` or `Ke` counts.
    IgnoredTexture {
        /// What counts in its place.
        keyword: &'static str,
        /// The material's name.
        name: String,
    },
    /// Materials in use mirror light or let it through (`Ks`, `d`, `Tr`), which is not used.
    NotDiffuse {
        /// The keyword of that line.
        keyword: &'static str,
        /// How many materials there are.
        count: usize,
    },
    /// No face emits light.
    NoEmission,
}

impl SceneWarning {
    /// Returns a warning about a place.
    #[must_use]
    pub fn new(at: Origin, kind: SceneWarningKind) -> Self {
        Self { at, kind }
    }

    /// Returns a stable name of the kind of warning, in snake case, for programs.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.kind.name()
    }

    /// Returns the line that the warning is about, counted from 1, or `None` if it is not about one line of a file.
    #[must_use]
    pub fn line(&self) -> Option<u32> {
        self.at.line_number()
    }
}

impl fmt::Display for SceneWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.at, self.kind)
    }
}

impl SceneWarningKind {
    /// Returns a stable name of the kind of warning, in snake case, for programs.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.into()
    }

    /// Tells whether the warning is about light and materials alone: of no interest where only the geometry counts. A library that was not found where the file says counts everywhere.
    #[must_use]
    pub fn is_about_light(&self) -> bool {
        matches!(
            self,
            Self::UnknownMaterial { .. }
                | Self::NoMaterial { .. }
                | Self::NoMaterials
                | Self::IgnoredProperty { .. }
                | Self::MissingReflectance { .. }
                | Self::RepeatedMaterial { .. }
                | Self::IgnoredTexture { .. }
                | Self::NotDiffuse { .. }
                | Self::NoEmission
        )
    }
}

impl SceneWarningKind {
    /// Writes what is not about light and materials.
    fn fmt_of_geometry(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ZeroAreaFaces { count: 1, .. } => write!(f, "a face without an area is skipped"),
            Self::ZeroAreaFaces { count, .. } => {
                write!(f, "{count} faces without an area are skipped, this is the first")
            }
            Self::BentFaces { count: 1, .. } => {
                write!(
                    f,
                    "a face is not flat; it is cut into triangles, which may not be those that were meant"
                )
            }
            Self::BentFaces { count, .. } => {
                write!(
                    f,
                    "{count} faces are not flat, this is the first; they are cut into triangles, which may not be those that were meant"
                )
            }
            Self::CutFaces { count: 1, area, .. } => {
                write!(
                    f,
                    "a face lies on larger ones in its plane and is cut out of them, {} m² in all",
                    short_area(*area)
                )
            }
            Self::CutFaces { count, area, .. } => write!(
                f,
                "{count} faces lie on larger ones in their plane, this is the first; they are cut out of these, {} m² in all",
                short_area(*area)
            ),
            Self::CoveredFaces { count: 1, .. } => {
                write!(f, "smaller faces in its plane cover this face, which is left out")
            }
            Self::CoveredFaces { count, .. } => write!(
                f,
                "smaller faces in their plane cover {count} faces, which are left out; this is the first"
            ),
            Self::SkippedStatements { count, what, .. } => write!(
                f,
                "{} skipped, of which this is the first: {what} are not read; export them as faces (`f`)",
                counted(*count, "statement")
            ),
            Self::SkippedElements { count, what } => {
                write!(
                    f,
                    "{count} {what} are skipped: only faces are read; export the boundary as triangles or quads"
                )
            }
            Self::HigherOrder { count } => write!(
                f,
                "{} of higher order are read as flat, through their corners; export first order where they are curved",
                counted(*count, "face")
            ),
            Self::OpposedNormals { count } => write!(
                f,
                "the stated normal opposes the winding of {}, this is the first; the winding counts, and --flip reverses it",
                counted(*count, "face")
            ),
            Self::MergedVertices { count, distance } => write!(
                f,
                "{count} vertices are joined with others, by up to {distance:.1e} m, which counts as rounding"
            ),
            Self::NearlyEqualVertices { count, tolerance } => write!(
                f,
                "{count} vertices are within {tolerance:.1e} m of others, but not equal to them; --merge-tolerance joins what is to be one"
            ),
            Self::MovedMasks { count, relative } => write!(
                f,
                "{} stand {relative:e} of their size off their base; the factors between both err by about twice that",
                counted(*count, "mask surface")
            ),
            Self::BlackSurfaces { count, what } => {
                write!(
                    f,
                    "{count} {what} are black surfaces of the scene; their rows and columns can be left out"
                )
            }
            Self::Capitals { count, .. } => write!(
                f,
                "{} in capitals, of which this is the first, read as in small letters",
                counted(*count, "keyword")
            ),
            _ => Ok(()),
        }
    }
}

impl fmt::Display for SceneWarningKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ZeroAreaFaces { .. }
            | Self::BentFaces { .. }
            | Self::CutFaces { .. }
            | Self::CoveredFaces { .. }
            | Self::SkippedStatements { .. }
            | Self::SkippedElements { .. }
            | Self::HigherOrder { .. }
            | Self::OpposedNormals { .. }
            | Self::MergedVertices { .. }
            | Self::NearlyEqualVertices { .. }
            | Self::MovedMasks { .. }
            | Self::BlackSurfaces { .. }
            | Self::Capitals { .. } => self.fmt_of_geometry(f),
            Self::NamelessLibrary => {
                write!(
                    f,
                    "`mtllib` without a name is skipped; materials that no library defines reflect 0.5"
                )
            }
            Self::LibraryElsewhere { name, used, .. } => write!(
                f,
                "material library `{}` is not there; `{}` beside the scene is read in its place",
                quoted(name),
                quoted(used)
            ),
            Self::MissingLibrary { name, .. } => {
                write!(
                    f,
                    "material library `{}` is not there; its materials reflect 0.5",
                    quoted(name)
                )
            }
            Self::UnknownMaterial { name, .. } => {
                write!(f, "no library defines material `{}`; it reflects 0.5", quoted(name))
            }
            Self::NoMaterial { count: 1, .. } => write!(f, "a face has no material; it reflects 0.5"),
            Self::NoMaterial { count, .. } => {
                write!(f, "{count} faces have no material, this is the first; they reflect 0.5")
            }
            Self::NoMaterials => write!(
                f,
                "the file states no materials: all faces reflect 0.5 and emit nothing; --materials FILE.toml gives others"
            ),
            Self::IgnoredProperty { what, name } => {
                write!(
                    f,
                    "{what} of material `{}` is not used: surfaces are diffuse and opaque",
                    quoted(name)
                )
            }
            Self::MissingReflectance { name, .. } => {
                write!(f, "material `{}` has no `Kd`; it reflects 0.5", quoted(name))
            }
            Self::RepeatedMaterial { name, .. } => {
                write!(
                    f,
                    "material `{}` is defined again; this definition counts",
                    quoted(name)
                )
            }
            Self::IgnoredTexture { name, keyword, .. } => {
                write!(
                    f,
                    "the texture of material `{}` is not read; its `{keyword}` counts everywhere",
                    quoted(name)
                )
            }
            Self::NotDiffuse { keyword, count: 1, .. } => {
                write!(f, "`{keyword}` is not used: surfaces are diffuse and opaque")
            }
            Self::NotDiffuse { keyword, count, .. } => {
                write!(
                    f,
                    "`{keyword}` is not used: surfaces are diffuse and opaque; {count} materials are meant otherwise, this is the first"
                )
            }
            Self::NoEmission => write!(f, "no face emits light; give a material an exitance `Ke`"),
        }
    }
}

/// Returns an area with six digits.
fn short_area(area: f64) -> String {
    let rounded = format!("{area:.5e}").parse().unwrap_or(area);
    short(rounded)
}
