//! What can be wrong with a scene, a material library or a camera file.

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use super::builtin;
use crate::printable::{printable_message, quoted};

/// A reason why a scene cannot be read, built or written.
///
/// Every message is one line: the file, the line where there is one, what is wrong, and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The file cannot be read: missing, a directory, no permission.
    #[error("{}: {source}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why, and what to do.
        source: io::Error,
    },
    /// The file is not text in UTF-8.
    #[error("{}:{line}: not UTF-8 text; convert the file to UTF-8", .file.display())]
    NotUtf8 {
        /// The file.
        file: PathBuf,
        /// The line of the first byte that is not UTF-8.
        line: u32,
    },
    /// The file has no face with an area.
    #[error("{}: no face with an area; export the scene with its faces (`v` and `f` lines)", .file.display())]
    NoFaces {
        /// The scene file.
        file: PathBuf,
    },
    /// There are more faces, vertices or corners than can be numbered.
    #[error("{}: {limit} {what} is the limit, and there are more; split the scene", .file.display())]
    TooMany {
        /// The scene file.
        file: PathBuf,
        /// What is counted, such as `faces`.
        what: &'static str,
        /// How many there may be.
        limit: u32,
    },
    /// A `v` line with fewer than three coordinates.
    #[error("{}:{line}: a vertex needs 3 coordinates and has {count}; complete the line", .file.display())]
    MissingCoordinate {
        /// The scene file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// How many coordinates the line has.
        count: usize,
    },
    /// A coordinate that is no finite number of a sensible size.
    #[error("{}:{line}: coordinate `{}` is not a finite number within ±{limit:e}; correct it",
        .file.display(), quoted(.token), limit = super::MAX_COORDINATE)]
    BadCoordinate {
        /// The scene file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The text in the file.
        token: String,
    },
    /// A vertex index that is no integer.
    #[error("{}:{line}: `{}` is not a vertex index; correct the face", .file.display(), quoted(.token))]
    BadIndex {
        /// The scene file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The text in the file.
        token: String,
    },
    /// A vertex index that names no vertex above its face.
    #[error("{}:{line}: vertex index {index} is out of range: the file has {n_vertices} vertices so far; correct the face",
        .file.display())]
    IndexOutOfRange {
        /// The scene file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The index in the file, counted from 1, or from the end if negative.
        index: i64,
        /// The number of vertices above the face.
        n_vertices: usize,
    },
    /// A face with fewer than three corners.
    #[error("{}:{line}: a face needs at least 3 vertices and has {count}; complete or remove it", .file.display())]
    TooFewCorners {
        /// The scene file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// How many corners the face has.
        count: usize,
    },
    /// A face whose outline crosses itself.
    #[error("{}:{line}: the outline of the face crosses itself; correct the order of its vertices", .file.display())]
    SelfIntersecting {
        /// The scene file.
        file: PathBuf,
        /// The line.
        line: u32,
    },
    /// Two faces with the same corners and the same winding.
    #[error("{}:{line}: the face repeats the one of line {first_line}, with the same winding; remove one, or reverse it for a two-sided sheet",
        .file.display())]
    DuplicateFace {
        /// The scene file.
        file: PathBuf,
        /// The line of the second face.
        line: u32,
        /// The line of the first face.
        first_line: u32,
    },
    /// Two faces, or two flat parts of surfaces, that coincide with the same winding, so that neither is drawn on the other.
    #[error("{}:{line}: the face overlaps the one of line {first_line} in one plane, with the same winding, and light would count twice there; \
         remove one, move one out of the plane, or reverse one for a two-sided sheet",
        .file.display())]
    OverlappingFaces {
        /// The scene file.
        file: PathBuf,
        /// The line of the second face.
        line: u32,
        /// The line of the first face.
        first_line: u32,
    },
    /// A statement that needs a name and has none.
    #[error("{}:{line}: `{keyword}` without a name; add the name", .file.display())]
    MissingName {
        /// The scene or material file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The statement: `usemtl`, `mtllib` or `newmtl`.
        keyword: &'static str,
    },
    /// A material library that is not in the scene's folder or below it.
    #[error("{}:{line}: the library `{}` lies outside the scene's folder; move it there, or say --allow-outside", .file.display(), quoted(.name))]
    OutsideFolder {
        /// The scene file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The library as the scene file names it.
        name: String,
    },
    /// A `Kd` or `Ke` above the first `newmtl`.
    #[error("{}:{line}: `{keyword}` before the first `newmtl`; name the material first", .file.display())]
    OutsideMaterial {
        /// The material file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The statement: `Kd` or `Ke`.
        keyword: &'static str,
    },
    /// A `Kd` or `Ke` that is neither one nor three numbers.
    #[error("{}:{line}: `{keyword} {}` is neither one nor three numbers; give red, green and blue", .file.display(), quoted(.value))]
    BadMaterialValue {
        /// The material file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The statement: `Kd` or `Ke`.
        keyword: &'static str,
        /// The text after the statement.
        value: String,
    },
    /// A reflectance outside [0, 1].
    #[error("{}:{line}: reflectance `Kd` {value} is outside [0, 1]; correct it", .file.display())]
    ReflectanceOutOfRange {
        /// The material file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The first value out of range.
        value: f64,
    },
    /// An exitance that is negative or not finite.
    #[error("{}:{line}: exitance `Ke` {value} is negative or not finite; correct it", .file.display())]
    ExitanceOutOfRange {
        /// The material file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The first value out of range.
        value: f64,
    },
    /// An exitance so great that the light leaves the range of numbers.
    #[error("{}:{line}: exitance `Ke` {value:e} is above {limit:.1e} W/m², beyond which light overflows here; lower it", .file.display())]
    TooBright {
        /// The material file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The exitance, in W·m⁻².
        value: f64,
        /// The greatest one that is possible, in W·m⁻².
        limit: f64,
    },
    /// An exitance above 0, but so small that numbers lose their digits.
    #[error("{}:{line}: exitance `Ke` {value:e} is below {limit:.0e} W/m², where numbers lose their digits; write 0, or a greater one", .file.display())]
    TooDim {
        /// The material file.
        file: PathBuf,
        /// The line.
        line: u32,
        /// The exitance, in W·m⁻².
        value: f64,
        /// The least one that is possible beside 0, in W·m⁻².
        limit: f64,
    },
    /// A surface was named that the scene does not have.
    #[error("{}: there is no surface `{}`; the first ones are `{}`", .file.display(), quoted(.name), printable_message(.known))]
    UnknownSurface {
        /// The scene file.
        file: PathBuf,
        /// The name.
        name: String,
        /// Names that the scene has.
        known: String,
    },
    /// The parser refused a text that had been checked: a defect of this crate, told instead of hidden.
    #[error("{}: the parser disagrees with the check before it ({}); please report the file", .file.display(), printable_message(.message))]
    Parser {
        /// The scene or material file.
        file: PathBuf,
        /// What the parser said.
        message: String,
    },
    /// A camera file that cannot be understood or makes no camera.
    #[error("{}{}: {}", .file.as_deref().unwrap_or(Path::new("camera")).display(), colon_line(*.line), printable_message(.message))]
    BadCamera {
        /// The camera file; none for a camera made in memory.
        file: Option<PathBuf>,
        /// The line, where one line is to blame.
        line: Option<u32>,
        /// What is wrong, and the remedy.
        message: String,
    },
    /// A lighting file that cannot be understood, or names what the scene does not have.
    #[error("{}{}: {}", .file.display(), colon_line(*.line), printable_message(.message))]
    BadLighting {
        /// The lighting file.
        file: PathBuf,
        /// The line, where one line is to blame.
        line: Option<u32>,
        /// What is wrong, and the remedy.
        message: String,
    },
    /// A list of frames that cannot be understood.
    #[error("{}{}: {}", .file.display(), colon_line(*.line), printable_message(.message))]
    BadFrames {
        /// The list's file.
        file: PathBuf,
        /// The line, where one line is to blame.
        line: Option<u32>,
        /// What is wrong, and the remedy.
        message: String,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}; check the directory and its permissions", .file.display())]
    Unwritable {
        /// The file.
        file: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The output path does not name an OBJ file.
    #[error("{}: a scene is written to a file whose name ends in .obj; change the name", .file.display())]
    NotObj {
        /// The path.
        file: PathBuf,
    },
    /// A name in the scene that an OBJ or MTL file cannot hold: empty, of several lines, framed by blanks, or used twice.
    #[error(
        "the {what} name {name:?} cannot be written (empty, repeated, framed by blanks, or of several lines); rename it"
    )]
    UnwritableName {
        /// What is named: `surface` or `material`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// No built-in scene has this name.
    #[error("there is no built-in scene `{name}`; choose one of {}", builtin_list())]
    UnknownBuiltin {
        /// The name asked for.
        name: String,
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
        /// The level asked for.
        level: u32,
        /// The greatest level.
        max: u32,
    },
}

impl SceneError {
    /// Returns a stable name of the kind of error, in snake case, for programs.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Unreadable { .. } => "unreadable",
            Self::NotUtf8 { .. } => "not_utf8",
            Self::NoFaces { .. } => "no_faces",
            Self::TooMany { .. } => "too_many",
            Self::MissingCoordinate { .. } => "missing_coordinate",
            Self::BadCoordinate { .. } => "bad_coordinate",
            Self::BadIndex { .. } => "bad_index",
            Self::IndexOutOfRange { .. } => "index_out_of_range",
            Self::TooFewCorners { .. } => "too_few_corners",
            Self::SelfIntersecting { .. } => "self_intersecting",
            Self::DuplicateFace { .. } => "duplicate_face",
            Self::OverlappingFaces { .. } => "overlapping_faces",
            Self::MissingName { .. } => "missing_name",
            Self::OutsideFolder { .. } => "outside_folder",
            Self::OutsideMaterial { .. } => "outside_material",
            Self::BadMaterialValue { .. } => "bad_material_value",
            Self::ReflectanceOutOfRange { .. } => "reflectance_out_of_range",
            Self::ExitanceOutOfRange { .. } => "exitance_out_of_range",
            Self::TooBright { .. } => "too_bright",
            Self::TooDim { .. } => "too_dim",
            Self::UnknownSurface { .. } => "unknown_surface",
            Self::Parser { .. } => "parser",
            Self::BadCamera { .. } => "bad_camera",
            Self::BadLighting { .. } => "bad_lighting",
            Self::BadFrames { .. } => "bad_frames",
            Self::Unwritable { .. } => "unwritable",
            Self::NotObj { .. } => "not_obj",
            Self::UnwritableName { .. } => "unwritable_name",
            Self::UnknownBuiltin { .. } => "unknown_builtin",
            Self::NoLevels { .. } => "no_levels",
            Self::LevelTooHigh { .. } => "level_too_high",
        }
    }

    /// Returns the file to blame, or `None` for an error without one.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::Unreadable { file, .. }
            | Self::NotUtf8 { file, .. }
            | Self::NoFaces { file }
            | Self::TooMany { file, .. }
            | Self::MissingCoordinate { file, .. }
            | Self::BadCoordinate { file, .. }
            | Self::BadIndex { file, .. }
            | Self::IndexOutOfRange { file, .. }
            | Self::TooFewCorners { file, .. }
            | Self::SelfIntersecting { file, .. }
            | Self::DuplicateFace { file, .. }
            | Self::OverlappingFaces { file, .. }
            | Self::MissingName { file, .. }
            | Self::OutsideFolder { file, .. }
            | Self::OutsideMaterial { file, .. }
            | Self::BadMaterialValue { file, .. }
            | Self::ReflectanceOutOfRange { file, .. }
            | Self::ExitanceOutOfRange { file, .. }
            | Self::TooBright { file, .. }
            | Self::TooDim { file, .. }
            | Self::UnknownSurface { file, .. }
            | Self::BadLighting { file, .. }
            | Self::BadFrames { file, .. }
            | Self::Parser { file, .. }
            | Self::Unwritable { file, .. }
            | Self::NotObj { file } => Some(file),
            Self::BadCamera { file, .. } => file.as_deref(),
            Self::UnwritableName { .. }
            | Self::UnknownBuiltin { .. }
            | Self::NoLevels { .. }
            | Self::LevelTooHigh { .. } => None,
        }
    }

    /// Returns the line to blame, counted from 1, or `None` for an error that is not about one line.
    #[must_use]
    pub fn line(&self) -> Option<u32> {
        match self {
            Self::NotUtf8 { line, .. }
            | Self::MissingCoordinate { line, .. }
            | Self::BadCoordinate { line, .. }
            | Self::BadIndex { line, .. }
            | Self::IndexOutOfRange { line, .. }
            | Self::TooFewCorners { line, .. }
            | Self::SelfIntersecting { line, .. }
            | Self::DuplicateFace { line, .. }
            | Self::OverlappingFaces { line, .. }
            | Self::MissingName { line, .. }
            | Self::OutsideFolder { line, .. }
            | Self::OutsideMaterial { line, .. }
            | Self::BadMaterialValue { line, .. }
            | Self::ReflectanceOutOfRange { line, .. }
            | Self::ExitanceOutOfRange { line, .. }
            | Self::TooBright { line, .. }
            | Self::TooDim { line, .. } => Some(*line),
            Self::BadCamera { line, .. } | Self::BadLighting { line, .. } | Self::BadFrames { line, .. } => *line,
            _ => None,
        }
    }
}

fn colon_line(line: Option<u32>) -> String {
    line.map(|line| format!(":{line}")).unwrap_or_default()
}

fn builtin_list() -> String {
    let mut list = String::new();
    for name in builtin::names() {
        let comma = if list.is_empty() { "" } else { ", " };
        // Writing to a String cannot fail.
        let _ = write!(list, "{comma}{name}");
    }
    list
}
