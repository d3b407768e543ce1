//! Errors of a scene, a material library or a camera file.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use crate::parameter::{Named, Parameter};
use crate::printable::{printable_message, quoted};

/// The place of an error.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origin {
    /// In a file.
    File {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1, where one is to blame.
        line: Option<u32>,
    },
    /// In a file whose parts are no lines.
    Element {
        /// The file.
        path: PathBuf,
        /// The part.
        element: String,
    },
    /// In a scene, material or camera made in memory.
    Memory {
        /// The part: a face, a material, a camera.
        element: String,
    },
    /// In an argument of the caller, such as a name.
    #[default]
    Asked,
}

impl Origin {
    /// Returns a file as a whole.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self::File {
            path: path.into(),
            line: None,
        }
    }

    /// Returns a line of a file.
    pub fn line(path: impl Into<PathBuf>, line: impl Into<Option<u32>>) -> Self {
        Self::File {
            path: path.into(),
            line: line.into(),
        }
    }
}

impl Origin {
    pub(super) fn line_number(&self) -> Option<u32> {
        match self {
            Self::File { line, .. } => *line,
            _ => None,
        }
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, line: Some(line) } => write!(f, "{}:{line}: ", path.display()),
            Self::File { path, line: None } => write!(f, "{}: ", path.display()),
            Self::Element { path, element } => write!(f, "{}: {element}: ", path.display()),
            Self::Memory { element } => write!(f, "{element}: "),
            Self::Asked => Ok(()),
        }
    }
}

/// The things that the numbers of faces ([`Face::line`](super::Face::line)) count.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Numbering {
    /// The lines of a file, from 1.
    Lines,
    /// The elements of a file whose parts are no lines.
    Elements {
        /// The name of an element: `triangle`, `cell`.
        noun: &'static str,
        /// The number of the first one in messages: 0 where the format counts from 0.
        first: u32,
        /// The parts of the file, each with the number before its first element, in order; empty for a file without parts.
        parts: Vec<(u32, String)>,
    },
    /// The faces of a scene made in memory, from 0.
    #[default]
    Memory,
}

impl Numbering {
    /// Returns elements without parts.
    pub(super) fn elements(noun: &'static str, first: u32) -> Self {
        Self::Elements {
            noun,
            first,
            parts: Vec::new(),
        }
    }

    /// Returns the label of a face in messages, as in `line 12`, `cell 11` or `face 3`.
    #[must_use]
    pub fn label(&self, number: u32) -> String {
        match self {
            Self::Lines => format!("line {number}"),
            Self::Elements { noun, first, parts } => {
                let behind = parts.partition_point(|(before, _)| *before < number);
                let (before, part) = match parts.get(behind.wrapping_sub(1)) {
                    Some((before, part)) => (*before, format!("{part}, ")),
                    None => (0, String::new()),
                };
                let own = u64::from(number.saturating_sub(before)) + u64::from(*first);
                format!("{part}{noun} {}", own.saturating_sub(1))
            }
            Self::Memory => format!("face {number}"),
        }
    }

    /// Returns the place of a face of a file.
    pub fn origin(&self, file: impl Into<PathBuf>, number: u32) -> Origin {
        match self {
            Self::Lines => Origin::line(file, number),
            Self::Elements { .. } => Origin::Element {
                path: file.into(),
                element: self.label(number),
            },
            Self::Memory => Origin::Memory {
                element: self.label(number),
            },
        }
    }
}

/// An earlier face: by its line in a file, by its number in a scene made in memory, or as an element of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Earlier {
    /// The line.
    Line(u32),
    /// The number.
    Number(u32),
    /// The element.
    Element(String),
}

impl fmt::Display for Earlier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "the one of line {line}"),
            Self::Number(number) => write!(f, "face {number}"),
            Self::Element(element) => f.write_str(element),
        }
    }
}

/// A reason why a scene cannot be read, built or written, with its place.
///
/// Every message is one line: the place, what is wrong, and the remedy.
#[derive(Debug, thiserror::Error)]
#[error("{at}{kind}")]
pub struct SceneError {
    /// Where.
    pub at: Origin,
    /// The error.
    pub kind: SceneErrorKind,
}

impl SceneError {
    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        match &self.kind {
            SceneErrorKind::OutsideFolder { name } => {
                let allowed = named(Parameter::AllowOutside, None);
                format!("{}{}", self.at, outside_folder(name, &allowed))
            }
            _ => self.to_string(),
        }
    }
}

fn outside_folder(library: &str, allowed: &str) -> String {
    let library = quoted(library);
    format!("the library `{library}` lies outside the scene's folder; move it there, or say {allowed}")
}

/// An error of a scene, a material library, a camera, a lighting or a list of frames, and the remedy.
#[derive(Debug, thiserror::Error, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
#[non_exhaustive]
pub enum SceneErrorKind {
    /// The file cannot be read: missing, a directory, no permission.
    #[error("{source}")]
    Unreadable {
        /// The operating system's message, with a remedy.
        source: io::Error,
    },
    /// The file is not text in UTF-8.
    #[error("not UTF-8 text; convert the file to UTF-8")]
    NotUtf8,
    /// The file has no face with an area.
    #[error("no face with an area; export the scene with its faces")]
    NoFaces,
    /// The text of the file does not follow its format.
    #[error("expected {expected}, found `{}`; correct the file or export it again", quoted(.found))]
    Malformed {
        /// The text that the format requires there.
        expected: String,
        /// The text in the file.
        found: String,
    },
    /// The file states more elements than its length allows.
    #[error(
        "the file states {n} {what} and has room for {room}: it is cut short, or its header is wrong; export it again"
    )]
    Truncated {
        /// The counted things, such as `triangles`.
        what: &'static str,
        /// The stated number.
        n: u64,
        /// The greatest number that fits into the rest of the file.
        room: u64,
    },
    /// The file ends too early.
    #[error("the file ends within {what}: it is cut short; export it again")]
    #[strum(serialize = "truncated")]
    CutShort {
        /// The incomplete part.
        what: &'static str,
    },
    /// The file is of a kind that is not supported.
    #[error("{}", printable_message(.message))]
    Unsupported {
        /// The unsupported part, and the remedy.
        message: String,
    },
    /// The file has no cell array of the given name.
    #[error("there is no array `{}` with one whole number or name for each face; the file has {}", quoted(.name), printable_message(.known))]
    UnknownArray {
        /// The name.
        name: String,
        /// The arrays that the file has.
        known: String,
    },
    /// Reading the file would exceed the memory limit.
    #[error(
        "the scene takes some {needed} bytes more, and there are fewer; raise the limit of memory or split the scene"
    )]
    NoRoom {
        /// How many bytes more are needed.
        needed: u64,
    },
    /// There are more faces, vertices or corners than can be numbered.
    #[error("{limit} {what} is the limit, and there are more; split the scene")]
    TooMany {
        /// The counted things, such as `faces`.
        what: &'static str,
        /// How many there may be.
        limit: u32,
    },
    /// A `v` line with fewer than three coordinates.
    #[error("a vertex needs 3 coordinates and has {count}; complete the line")]
    MissingCoordinate {
        /// How many coordinates the line has.
        count: usize,
    },
    /// A coordinate that is not a finite number within the allowed range.
    #[error("coordinate `{}` is not a finite number within ±{limit:e}; correct it", quoted(.token), limit = super::MAX_COORDINATE)]
    BadCoordinate {
        /// The text in the file.
        token: String,
    },
    /// A vertex index that is no integer.
    #[error("`{}` is not a vertex index; correct the face", quoted(.token))]
    BadIndex {
        /// The text in the file.
        token: String,
    },
    /// A vertex index that names no vertex above its face.
    #[error("vertex index {index} is out of range: there are {n_vertices} vertices so far; correct the face")]
    IndexOutOfRange {
        /// The index in the file, counted from 1, or from the end if negative.
        index: i64,
        /// The number of vertices above the face.
        n_vertices: usize,
    },
    /// Slices with neither one element for each face nor one for all.
    #[error("{n} {what} for {n_faces} faces; give one for each, or one for all")]
    NotOneEach {
        /// The things in a wrong number.
        what: &'static str,
        /// How many there are.
        n: usize,
        /// How many faces there are.
        n_faces: usize,
    },
    /// A face with fewer than three corners.
    #[error("a face needs at least 3 vertices and has {count}; complete or remove it")]
    TooFewCorners {
        /// How many corners the face has.
        count: usize,
    },
    /// A face whose outline crosses itself.
    #[error("the outline of the face crosses itself; correct the order of its vertices")]
    SelfIntersecting,
    /// Two faces with the same corners and the same winding.
    #[error("the face repeats {first}, with the same winding; remove one, or reverse it for a two-sided sheet")]
    DuplicateFace {
        /// The first face.
        first: Earlier,
    },
    /// Two faces, or two flat parts of surfaces, that coincide with the same winding, so that neither is drawn on the other.
    #[error(
        "the face overlaps {first} in one plane, with the same winding, so radiation would count twice; \
         remove one, move it out of the plane, or reverse it for a sheet"
    )]
    OverlappingFaces {
        /// The first face.
        first: Earlier,
    },
    /// A statement that needs a name and has none.
    #[error("`{keyword}` without a name; add the name")]
    MissingName {
        /// The statement: `usemtl`, `mtllib` or `newmtl`.
        keyword: &'static str,
    },
    /// A material library or a buffer that is not in the scene's folder or below it.
    #[error("{}", outside_folder(.name, Parameter::AllowOutside.name()))]
    OutsideFolder {
        /// The library as the scene file names it.
        name: String,
    },
    /// A `Kd` or `Ke` above the first `newmtl`.
    #[error("`{keyword}` before the first `newmtl`; name the material first")]
    OutsideMaterial {
        /// The statement: `Kd` or `Ke`.
        keyword: &'static str,
    },
    /// A `Kd` or `Ke` that is neither one nor three numbers.
    #[error("`{keyword} {}` is neither one nor three numbers; give red, green and blue", quoted(.value))]
    BadMaterialValue {
        /// The statement: `Kd` or `Ke`.
        keyword: &'static str,
        /// The text after the statement.
        value: String,
    },
    /// A reflectance outside [0, 1].
    #[error("reflectance `{keyword}` {value} is outside [0, 1]; correct it")]
    ReflectanceOutOfRange {
        /// The keyword of the value in its format: `Kd`, `baseColorFactor`.
        keyword: &'static str,
        /// The first value out of range.
        value: f64,
    },
    /// An exitance that is negative or not finite.
    #[error("exitance `{keyword}` {value} is negative or not finite; correct it")]
    ExitanceOutOfRange {
        /// The keyword of the value in its format: `Ke`, `emissiveFactor`.
        keyword: &'static str,
        /// The first value out of range.
        value: f64,
    },
    /// An exitance so great that the light leaves the range of f64.
    #[error("exitance `{keyword}` {value:e} is above {limit:.1e} W/m², beyond which light overflows here; lower it")]
    TooBright {
        /// The keyword of the value in its format: `Ke`, `emissiveFactor`.
        keyword: &'static str,
        /// The exitance, in W·m⁻².
        value: f64,
        /// The greatest one that is possible, in W·m⁻².
        limit: f64,
    },
    /// An exitance above 0, but so small that numbers lose their digits.
    #[error(
        "exitance `{keyword}` {value:e} is below {limit:.0e} W/m², where numbers lose their digits; write 0, or a greater one"
    )]
    TooDim {
        /// The keyword of the value in its format: `Ke`, `emissiveFactor`.
        keyword: &'static str,
        /// The exitance, in W·m⁻².
        value: f64,
        /// The least one that is possible beside 0, in W·m⁻².
        limit: f64,
    },
    /// The scene has no surface of the given name.
    #[error("there is no surface `{}`; the first ones are `{}`", quoted(.name), printable_message(.known))]
    UnknownSurface {
        /// The name.
        name: String,
        /// Names that the scene has.
        known: String,
    },
    /// The parser refused a text that had passed the checks: a defect of this crate.
    #[error("the parser disagrees with the check before it ({}); please report the file", printable_message(.message))]
    Parser {
        /// The parser's message.
        message: String,
    },
    /// A camera file that cannot be understood or makes no camera.
    #[error("{}", printable_message(.message))]
    BadCamera {
        /// The fault, and the remedy.
        message: String,
    },
    /// A lighting file that cannot be understood, or names a surface or material that the scene does not have.
    #[error("{}", printable_message(.message))]
    BadLighting {
        /// The fault, and the remedy.
        message: String,
    },
    /// A list of frames that cannot be understood.
    #[error("{}", printable_message(.message))]
    BadFrames {
        /// The fault, and the remedy.
        message: String,
    },
    /// A file of boundary conditions that cannot be understood, or names a surface or group that the scene does not have.
    #[error("{}", printable_message(.message))]
    BadBoundary {
        /// The fault, and the remedy.
        message: String,
    },
    /// The file cannot be written.
    #[error("cannot be written: {source}; check the directory and its permissions")]
    Unwritable {
        /// The operating system's message.
        source: io::Error,
    },
    /// The output path does not name an OBJ file.
    #[error("a scene is written to a file whose name ends in .obj; change the name")]
    NotObj,
    /// A name in the scene that an OBJ or MTL file cannot hold: empty, of several lines, framed by blanks, or used twice.
    #[error(
        "the {what} name {name:?} cannot be written (empty, repeated, framed by blanks, or of several lines); rename it"
    )]
    UnwritableName {
        /// The kind of name: `surface` or `material`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// No built-in scene has this name.
    #[error("there is no built-in scene `{name}`; choose one of {known}")]
    UnknownBuiltin {
        /// The requested name.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// A level was given for a built-in scene that has none.
    #[error("the built-in scene `{name}` has no levels; leave the level out")]
    NoLevels {
        /// The scene.
        name: String,
    },
    /// A level beyond the greatest one of a built-in scene.
    #[error("level {level} of `{name}` is too fine; the greatest level is {max}")]
    LevelTooHigh {
        /// The scene.
        name: String,
        /// The requested level.
        level: u32,
        /// The greatest level.
        max: u32,
    },
}

impl SceneError {
    /// Returns an error at a place.
    #[must_use]
    pub fn new(at: Origin, kind: SceneErrorKind) -> Self {
        Self { at, kind }
    }

    /// Returns a stable name of the kind of error, in snake case, for programs.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.kind.name()
    }

    /// Returns the file at fault, or `None` for an error without one.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match &self.at {
            Origin::File { path, .. } | Origin::Element { path, .. } => Some(path),
            Origin::Memory { .. } | Origin::Asked => None,
        }
    }

    /// Returns the line at fault, counted from 1, or `None` for an error that is not about one line.
    #[must_use]
    pub fn line(&self) -> Option<u32> {
        self.at.line_number()
    }
}

impl SceneErrorKind {
    /// Returns the error that `expected` was required and `found` was read.
    pub(super) fn malformed(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self::Malformed {
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Returns the error of an unsupported part, with its remedy.
    pub(super) fn unsupported(message: impl Into<String>) -> Self {
        Self::Unsupported {
            message: message.into(),
        }
    }

    /// Returns a stable name of the kind of error, in snake case, for programs.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.into()
    }
}
