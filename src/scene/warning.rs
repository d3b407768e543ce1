//! Warnings about a scene: it is usable, but perhaps not as intended.

use super::Origin;
use crate::printable::{counted, quoted, short};

/// A warning about a loaded scene, with its place.
///
/// Each kind is reported once per cause, with the first place and a count.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{at}{kind}")]
pub struct SceneWarning {
    /// The place; of several places the first.
    pub at: Origin,
    /// The kind, with its numbers.
    pub kind: SceneWarningKind,
}

/// The kind of a warning about a scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
#[non_exhaustive]
pub enum SceneWarningKind {
    /// Faces without an area were skipped.
    #[error("{}", one_or(*count, "a face without an area is skipped", "faces without an area are skipped, this is the first"))]
    ZeroAreaFaces {
        /// How many there are.
        count: usize,
    },
    /// Faces of four corners or more are not flat, and were cut into triangles.
    #[error("{}; {} cut into triangles, which may not be those that were meant", one_or(*count, "a face is not flat", "faces are not flat, this is the first"), if *count == 1 { "it is" } else { "they are" })]
    BentFaces {
        /// How many there are.
        count: usize,
    },
    /// Faces are drawn on larger ones in their plane, as doors on a wall, and were cut out of these.
    #[error("{}, {} m² in all{}", one_or(*count, "a face lies on larger ones in its plane and is cut out of them", "faces lie on larger ones in their plane, this is the first; they are cut out of these"), short_area(*area), moved_corners(*moved))]
    CutFaces {
        /// The number of faces that were cut out.
        count: usize,
        /// The area that the larger faces lost, in m².
        area: f64,
        /// The greatest distance of their corners from the planes of the larger faces, in m, which end there now; 0 within the rounding.
        moved: f64,
    },
    /// Faces were cut away as a whole: smaller ones in their plane cover them.
    #[error("smaller faces in {}", if *count == 1 { "its plane cover this face, which is left out".to_owned() } else { format!("their plane cover {count} faces, which are left out; this is the first") })]
    CoveredFaces {
        /// How many there are.
        count: usize,
    },
    /// Statements of one kind were skipped.
    #[error("{} skipped, of which this is the first: {what} are not read; export them as faces (`f`)", counted(*count, "statement"))]
    SkippedStatements {
        /// How many there are.
        count: usize,
        /// Their name, in the plural.
        what: &'static str,
    },
    /// Elements that are not faces were skipped.
    #[error("{count} {what} are skipped: only faces are read; export the boundary as triangles or quads")]
    SkippedElements {
        /// How many there are.
        count: usize,
        /// Their name, in the plural.
        what: &'static str,
    },
    /// Vertices have colours, which are not used: those of materials count.
    #[error("the colours of the vertices of {} are not used; give reflectances by materials or --materials", counted(*count, "mesh"))]
    UnusedColours {
        /// How many meshes have them.
        count: usize,
    },
    /// Physical groups have names, but no face is in any of them.
    #[error("the file names {}, but no face is in any, so none is a surface; save faces with their groups, as MSH 2.2 does", counted(*count, "physical group"))]
    EmptyGroups {
        /// How many there are.
        count: usize,
    },
    /// A file has no line that ends its data.
    #[error("no line `{end}` ends the data: the file may be cut short; add the line if all is there")]
    NoEnd {
        /// The line.
        end: &'static str,
    },
    /// Curved faces of higher order are read as flat, through their corners.
    #[error("{} of higher order are read as flat, through their corners; export first order where they are curved", counted(*count, "face"))]
    HigherOrder {
        /// How many there are.
        count: usize,
    },
    /// Nodes have rotations that are no unit quaternions.
    #[error("{} to length 1", one_or(*count, "the rotation of a node is no unit quaternion and is scaled", "rotations of nodes are no unit quaternions and are scaled"))]
    ScaledRotations {
        /// How many there are.
        count: usize,
    },
    /// Copies of meshes by an extension are not read.
    #[error("the copies of {} by `EXT_mesh_gpu_instancing` are not read; export each copy as a node", counted(*count, "node"))]
    UnreadCopies {
        /// How many nodes have them.
        count: usize,
    },
    /// The stated normals oppose the winding of faces, which takes precedence.
    #[error("the stated normal opposes the winding of {}, this is the first; the winding counts, and --flip reverses it", counted(*count, "face"))]
    OpposedNormals {
        /// How many faces there are.
        count: usize,
    },
    /// Different vertices were joined.
    #[error("{count} vertices are joined with others, by up to {distance:.1e} m, which counts as rounding")]
    MergedVertices {
        /// How many vertices were moved.
        count: usize,
        /// The greatest distance by which one moved, in m.
        distance: f64,
    },
    /// Vertices are nearly equal, but not joined.
    #[error(
        "{count} vertices are within {tolerance:.1e} m of others, but not equal to them; --merge-tolerance joins what is to be one"
    )]
    NearlyEqualVertices {
        /// The number of vertices near a different earlier one.
        count: usize,
        /// The distance that counts as near, in m.
        tolerance: f64,
    },
    /// Mask surfaces were moved off the surfaces that they cover.
    #[error("{} stand {relative:e} of their size off their base; the factors between both err by about twice that", counted(*count, "mask surface"))]
    MovedMasks {
        /// How many there are.
        count: usize,
        /// The distance, as a part of their size.
        relative: f64,
    },
    /// Surfaces that only occlude, or whose results are not wanted, are black surfaces of the scene.
    #[error("{count} {what} are black surfaces of the scene; their rows and columns can be left out")]
    BlackSurfaces {
        /// How many faces there are.
        count: usize,
        /// Their name in the format, in the plural.
        what: &'static str,
    },
    /// Keywords in capitals were read as if they were in small letters.
    #[error("{} in capitals, of which this is the first, read as in small letters", counted(*count, "keyword"))]
    Capitals {
        /// How many there are.
        count: usize,
    },
    /// A `mtllib` names no library.
    #[error("`mtllib` without a name is skipped; materials that no library defines reflect 0.5")]
    NamelessLibrary,
    /// A material library does not exist at its path: a file of its name beside the scene was read.
    #[error("material library `{}` is not there; `{}` beside the scene is read in its place", quoted(.name), quoted(.used))]
    LibraryElsewhere {
        /// The name in the file.
        name: String,
        /// The name of the file that was read.
        used: String,
    },
    /// A material library lies outside the scene's folder: a file of its name beside the scene was read.
    #[error("material library `{}` lies outside the scene's folder; `{}` beside the scene is read in its place; --allow-outside reads the other", quoted(.name), quoted(.used))]
    LibraryOutside {
        /// The name in the file.
        name: String,
        /// The name of the file that was read.
        used: String,
    },
    /// A material library does not exist.
    #[error("material library `{}` is not there; its materials reflect 0.5", quoted(.name))]
    MissingLibrary {
        /// The name in the file.
        name: String,
    },
    /// A `usemtl` names a material that no library defines: reflectance 0.5, exitance 0.
    #[error("no library defines material `{}`; it reflects 0.5", quoted(.name))]
    UnknownMaterial {
        /// The material's name.
        name: String,
    },
    /// Faces have no material: reflectance 0.5, exitance 0.
    #[error("{}", one_or(*count, "a face has no material; it reflects 0.5", "faces have no material, this is the first; they reflect 0.5"))]
    NoMaterial {
        /// How many there are.
        count: usize,
    },
    /// The file states no materials: reflectance 0.5, exitance 0.
    #[error("the file states no materials: all faces reflect 0.5 and emit nothing; --materials FILE.toml gives others")]
    NoMaterials,
    /// A property of a material in use has no effect on a diffuse face.
    #[error("{what} of material `{}` is not used: surfaces are diffuse and opaque", quoted(.name))]
    IgnoredProperty {
        /// Its kind.
        what: &'static str,
        /// The material's name.
        name: String,
    },
    /// A material in use has no reflectance: it is 0.5.
    #[error("material `{}` has no `{keyword}`; it reflects 0.5", quoted(.name))]
    MissingReflectance {
        /// The keyword of the reflectance in the format: `Kd`, `baseColorFactor`.
        keyword: &'static str,
        /// The material's name.
        name: String,
    },
    /// A material in use is defined twice: the last definition takes precedence.
    #[error("material `{}` is defined again; this definition counts", quoted(.name))]
    RepeatedMaterial {
        /// The material's name.
        name: String,
    },
    /// A material in use has a texture, which is not read: its `Kd` or `Ke` is used.
    #[error("the texture of material `{}` is not read; its `{keyword}` counts everywhere", quoted(.name))]
    IgnoredTexture {
        /// The keyword of the value that is used in its place.
        keyword: &'static str,
        /// The material's name.
        name: String,
    },
    /// Materials in use are specular or transparent (`Ks`, `d`, `Tr`), which is ignored.
    #[error("`{keyword}` is not used: surfaces are diffuse and opaque{}", if *count == 1 { String::new() } else { format!("; {count} materials are meant otherwise, this is the first") })]
    NotDiffuse {
        /// The keyword of that line.
        keyword: &'static str,
        /// How many materials there are.
        count: usize,
    },
    /// No face emits light.
    #[error("no face emits light; give a material an exitance `Ke`")]
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

impl SceneWarningKind {
    /// Returns a stable name of the kind of warning, in snake case, for programs.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.into()
    }

    /// Returns whether the warning is about light and materials alone, so that it can be omitted where only the geometry counts.
    ///
    /// A missing library or one found elsewhere is always reported.
    #[must_use]
    pub fn is_about_light(&self) -> bool {
        matches!(
            self,
            Self::UnknownMaterial { .. }
                | Self::NoMaterial { .. }
                | Self::NoMaterials
                | Self::UnusedColours { .. }
                | Self::IgnoredProperty { .. }
                | Self::MissingReflectance { .. }
                | Self::RepeatedMaterial { .. }
                | Self::IgnoredTexture { .. }
                | Self::NotDiffuse { .. }
                | Self::NoEmission
        )
    }
}

/// Returns the text for one, or the number and the text for more.
fn one_or(count: usize, one: &str, more: &str) -> String {
    if count == 1 {
        one.to_owned()
    } else {
        format!("{count} {more}")
    }
}

/// Returns what corners off the plane of a larger face do to it, after a semicolon.
fn moved_corners(moved: f64) -> String {
    if moved > 0.0 {
        format!("; corners move by {moved:.1e} m, which errors leave out")
    } else {
        String::new()
    }
}

/// Returns an area with six digits.
fn short_area(area: f64) -> String {
    let rounded = format!("{area:.5e}").parse().unwrap_or(area);
    short(rounded)
}
