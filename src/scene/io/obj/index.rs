//! The statements of an OBJ file: its vertices and faces, the names of surfaces, materials and libraries, and those that are not read.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::path::Path;

use super::super::polygons::{NONE, Names, Polygons};
use crate::scene::lines::{Statement, for_each_statement};
use crate::scene::{MAX_COORDINATE, Numbering, Origin, SceneError, SceneErrorKind, Written};
use glam::DVec3;

/// A name and the first line that contains it.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct NamedLine {
    pub(super) line: u32,
    pub(super) name: String,
}

/// The content of an OBJ file, in file order.
#[derive(Debug, Default)]
pub(super) struct ObjIndex {
    /// Its faces, with the names of the `o` and `g` statements, of which some may own no face.
    pub(super) polygons: Polygons,
    /// The names of the `usemtl` statements.
    pub(super) materials: Vec<NamedLine>,
    /// The names of the `mtllib` statements.
    pub(super) libraries: Vec<NamedLine>,
    /// Statements that were not read, or not as written, with the first line and the number of each kind.
    pub(super) unread: BTreeMap<Unread, (u32, usize)>,
    /// The checked `v` and `f` lines, with indices that count from the first vertex.
    pub(super) geometry: String,
}

/// A kind of statement that is of no use to a diffuse scene, or departs from the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Unread {
    /// A statement `mtllib` without a name.
    NamelessLibrary,
    /// A keyword in capitals, read as in small letters.
    Capitals,
    /// The statements `l` and `p`.
    LinesAndPoints,
    /// Free-form curves and surfaces.
    FreeForm,
    /// The statements `call` and `csh`, which stand for statements of another file or program.
    Calls,
    /// No keyword of the format.
    Unknown,
}

impl Unread {
    /// Returns the kind of an unread statement; `None` for statements that are read or do not concern diffuse faces.
    fn of(keyword: &str) -> Option<Self> {
        match keyword {
            "v" | "f" | "fo" | "o" | "g" | "usemtl" | "mtllib" => None,
            "l" | "p" => Some(Self::LinesAndPoints),
            // The elements alone; their attributes (`cstype`, `deg`, `parm`, ...) have no effect without them.
            "curv" | "curv2" | "surf" | "bsp" | "bzp" | "cdc" | "cdp" => Some(Self::FreeForm),
            "call" | "csh" => Some(Self::Calls),
            _ if SILENT.contains(&keyword) => None,
            _ => Some(Self::Unknown),
        }
    }
}

/// Keywords without effect on a diffuse scene: normals and texture coordinates, smoothing, display, and the attributes of free-form elements.
#[rustfmt::skip]
const SILENT: [&str; 33] = [
    "vt", "vn", "vp", "s", "mg", "bevel", "c_interp", "d_interp", "lod", "maplib", "usemap",
    "shadow_obj", "trace_obj", "ctech", "stech", "cstype", "deg", "bmat", "step", "parm", "trim", "hole",
    "scrv", "sp", "end", "con", "res", "part", "tex", "vc", "vw", "usemat", "g_interp",
];

/// The surface of faces above the first `o` or `g`, or below one without a name.
const DEFAULT_GROUP: &str = "default";

struct Scan<'a> {
    file: &'a Path,
    index: ObjIndex,
    groups: Names,
    /// The surface of the faces that follow, or [`NONE`].
    group: u32,
    /// The material of the faces that follow, or [`NONE`].
    material: u32,
    material_of_name: HashMap<String, u32>,
}

/// Reads and checks the text of an OBJ file.
pub(super) fn scan(text: &str, file: &Path) -> Result<ObjIndex, SceneError> {
    let mut scan = Scan {
        file,
        index: ObjIndex {
            polygons: Polygons {
                numbering: Numbering::Lines,
                written: Written::new(),
                ..Polygons::default()
            },
            ..ObjIndex::default()
        },
        groups: Names::default(),
        group: NONE,
        material: NONE,
        material_of_name: HashMap::new(),
    };
    let mut has_groups = false;
    for_each_statement::<SceneError>(text, |s| {
        has_groups |= matches!(s.keyword, "o" | "g" | "O" | "G");
        Ok(())
    })?;
    for_each_statement(text, |s| {
        let has_capitals = s.keyword.bytes().any(|byte| byte.is_ascii_uppercase());
        let small = if has_capitals {
            Cow::Owned(s.keyword.to_ascii_lowercase())
        } else {
            Cow::Borrowed(s.keyword)
        };
        if has_capitals && !matches!(Unread::of(&small), Some(Unread::Unknown)) {
            scan.unread(Unread::Capitals, s.line);
        }
        match &*small {
            "v" => scan.vertex(&s),
            // Before version 2.11 of the format, `fo` meant a face.
            "f" | "fo" => scan.face(&s, has_groups),
            "o" | "g" => {
                let name = if s.rest.is_empty() { DEFAULT_GROUP } else { s.rest };
                scan.group = scan.groups.number(name);
                Ok(())
            }
            "usemtl" => scan.use_material(&s),
            "mtllib" => {
                scan.library(&s);
                Ok(())
            }
            other => {
                if let Some(unread) = Unread::of(other) {
                    scan.unread(unread, s.line);
                }
                Ok(())
            }
        }
    })?;
    scan.index.polygons.groups = scan.groups.all;
    Ok(scan.index)
}

impl Scan<'_> {
    fn unread(&mut self, what: Unread, line: u32) {
        self.index.unread.entry(what).or_insert((line, 0)).1 += 1;
    }

    fn vertex(&mut self, s: &Statement) -> Result<(), SceneError> {
        // The words after the third coordinate are a weight for curves, or a colour.
        let tokens: Vec<&str> = s.words().take(3).collect();
        let [x, y, z] = tokens[..] else {
            return Err(SceneError::new(
                Origin::line(self.file.to_owned(), s.line),
                SceneErrorKind::MissingCoordinate { count: tokens.len() },
            ));
        };
        let mut position = [0.0; 3];
        // Writing to a String cannot fail.
        let _ = writeln!(self.index.geometry, "v {x} {y} {z}");
        for (place, token) in position.iter_mut().zip([x, y, z]) {
            // A NaN is in no range.
            let number = token.parse::<f64>().ok().filter(|value| value.abs() <= MAX_COORDINATE);
            *place = number.ok_or_else(|| {
                SceneError::new(
                    Origin::line(self.file.to_owned(), s.line),
                    SceneErrorKind::BadCoordinate {
                        token: token.to_owned(),
                    },
                )
            })?;
            self.index.polygons.written.see_value(token, *place);
        }
        self.index.polygons.vertices.push(DVec3::from_array(position));
        Ok(())
    }

    fn face(&mut self, s: &Statement, has_groups: bool) -> Result<(), SceneError> {
        let start = self.index.polygons.corners.len();
        self.index.geometry.push('f');
        for token in s.words() {
            let vertex = self.vertex_number(s.line, token)?;
            let _ = write!(self.index.geometry, " {}", u64::from(vertex) + 1);
            self.index.polygons.corners.push(vertex);
        }
        self.index.geometry.push('\n');
        let count = self.index.polygons.corners.len() - start;
        if count < 3 {
            return Err(SceneError::new(
                Origin::line(self.file.to_owned(), s.line),
                SceneErrorKind::TooFewCorners { count },
            ));
        }
        let group = if self.group == NONE && has_groups {
            self.groups.number(DEFAULT_GROUP)
        } else {
            self.group
        };
        self.index.polygons.face([], group, self.material, s.line);
        Ok(())
    }

    /// Returns the index, from 0, of the vertex that `12`, `12/3`, `12//4`, `12/3/4` or `-1` names, counted from 1.
    fn vertex_number(&self, line: u32, token: &str) -> Result<u32, SceneError> {
        let refused = |kind| SceneError::new(Origin::line(self.file.to_owned(), line), kind);
        let digits = token.split('/').next().unwrap_or(token);
        let index: i64 = digits.parse().map_err(|_| {
            refused(SceneErrorKind::BadIndex {
                token: token.to_owned(),
            })
        })?;
        let n_vertices = self.index.polygons.vertices.len();
        let magnitude = usize::try_from(index.unsigned_abs()).unwrap_or(usize::MAX);
        let number = if index < 0 {
            // The index −1 is the last vertex so far.
            (n_vertices + 1).checked_sub(magnitude)
        } else {
            Some(magnitude)
        };
        number
            .filter(|number| (1..=n_vertices).contains(number))
            .and_then(|number| u32::try_from(number - 1).ok())
            .ok_or_else(|| refused(SceneErrorKind::IndexOutOfRange { index, n_vertices }))
    }

    fn use_material(&mut self, s: &Statement) -> Result<(), SceneError> {
        let name = self.name_of(s, "usemtl")?;
        let material = self.material_of_name.get(&name).copied().unwrap_or_else(|| {
            self.index.materials.push(NamedLine {
                line: s.line,
                name: name.clone(),
            });
            u32::try_from(self.index.materials.len() - 1).unwrap_or(NONE - 1)
        });
        self.material_of_name.insert(name, material);
        self.material = material;
        Ok(())
    }

    fn library(&mut self, s: &Statement) {
        let name = s.rest;
        if name.is_empty() {
            self.unread(Unread::NamelessLibrary, s.line);
        } else if self.index.libraries.iter().all(|known| known.name != name) {
            let (line, name) = (s.line, name.to_owned());
            self.index.libraries.push(NamedLine { line, name });
        }
    }

    fn name_of(&self, s: &Statement, keyword: &'static str) -> Result<String, SceneError> {
        if s.rest.is_empty() {
            return Err(SceneError::new(
                Origin::line(self.file.to_owned(), s.line),
                SceneErrorKind::MissingName { keyword },
            ));
        }
        Ok(s.rest.to_owned())
    }
}
