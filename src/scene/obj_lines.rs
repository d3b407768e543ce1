//! The index of an OBJ file: where each face stands, to which surface and material it belongs, and a checked copy of the geometry.
//!
//! The parser (tobj) reports no lines, takes `l` lines for faces, lets NaN pass, and knows neither continuations
//! nor byte order marks nor comments after numbers. So every number is checked here, where the line is known, and the
//! parser gets a copy of the `v` and `f` lines that it cannot misread.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::path::Path;

use super::lines::{Statement, for_each_statement};
use super::{MAX_COORDINATE, Origin, SceneError, SceneErrorKind, Written};

/// One `f` statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FaceLine {
    /// Its line, from 1.
    pub(super) line: u32,
    /// Its surface, in [`ObjIndex::groups`].
    pub(super) group: usize,
    /// Its material, in [`ObjIndex::materials`].
    pub(super) material: Option<usize>,
}

/// A name and the line where it first stands.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct NamedLine {
    pub(super) line: u32,
    pub(super) name: String,
}

/// What an OBJ file says besides its numbers, in file order.
#[derive(Debug, Default)]
pub(super) struct ObjIndex {
    /// Every `f` statement.
    pub(super) faces: Vec<FaceLine>,
    /// The names of the `o` and `g` statements, or `face1`... if there is none; some may own no face.
    pub(super) groups: Vec<String>,
    /// The names of the `usemtl` statements.
    pub(super) materials: Vec<NamedLine>,
    /// The names of the `mtllib` statements.
    pub(super) libraries: Vec<NamedLine>,
    /// The checked `v` and `f` lines, with absolute vertex indices and nothing else.
    pub(super) geometry: String,
    /// The digits of the coordinates.
    pub(super) written: Written,
    /// What was not read, or not as it is written, with the first line and the number of each kind.
    pub(super) unread: BTreeMap<Unread, (u32, usize)>,
}

/// A kind of statement that a diffuse scene has no use for, or that is not written as the format wants it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Unread {
    /// `mtllib` without a name.
    NamelessLibrary,
    /// A keyword in capitals, read as if it were in small letters.
    Capitals,
    /// `l` and `p`.
    LinesAndPoints,
    /// Free-form curves and surfaces.
    FreeForm,
    /// `call` and `csh`, which stand for statements of another file or program.
    Calls,
    /// No keyword of the format.
    Unknown,
}

impl Unread {
    /// Returns what a statement is that makes neither vertices nor faces; `None` for what says nothing about a diffuse face.
    fn of(keyword: &str) -> Option<Self> {
        match keyword {
            "v" | "f" | "fo" | "o" | "g" | "usemtl" | "mtllib" => None,
            "l" | "p" => Some(Self::LinesAndPoints),
            // The elements; their attributes (`cstype`, `deg`, `parm`, ...) make no light without them.
            "curv" | "curv2" | "surf" | "bsp" | "bzp" | "cdc" | "cdp" => Some(Self::FreeForm),
            "call" | "csh" => Some(Self::Calls),
            _ if SILENT.contains(&keyword) => None,
            _ => Some(Self::Unknown),
        }
    }
}

/// Keywords that a diffuse scene has no use for: normals and texture coordinates, smoothing, display, and the attributes of free-form elements.
const SILENT: [&str; 33] = [
    "vt",
    "vn",
    "vp",
    "s",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "maplib",
    "usemap",
    "shadow_obj",
    "trace_obj",
    "ctech",
    "stech",
    "cstype",
    "deg",
    "bmat",
    "step",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "res",
    "part",
    "tex",
    "vc",
    "vw",
    "usemat",
    "g_interp",
];

/// The surface of faces above the first `o` or `g`, or below one without a name.
const DEFAULT_GROUP: &str = "default";

struct Scan<'a> {
    file: &'a Path,
    index: ObjIndex,
    n_vertices: usize,
    group: Option<usize>,
    group_of_name: HashMap<String, usize>,
    material: Option<usize>,
    material_of_name: HashMap<String, usize>,
}

/// Indexes and checks the text of an OBJ file.
pub(super) fn scan(text: &str, file: &Path) -> Result<ObjIndex, SceneError> {
    let mut scan = Scan {
        file,
        index: ObjIndex {
            written: Written::new(),
            ..ObjIndex::default()
        },
        n_vertices: 0,
        group: None,
        group_of_name: HashMap::new(),
        material: None,
        material_of_name: HashMap::new(),
    };
    scan.index.geometry.reserve(text.len());
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
            // `fo` is what faces were called before version 2.11 of the format.
            "f" | "fo" => scan.face(&s, has_groups),
            "o" | "g" => {
                let name = if s.rest.is_empty() { DEFAULT_GROUP } else { s.rest };
                scan.group = Some(scan.intern_group(name));
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
    Ok(scan.index)
}

impl Scan<'_> {
    fn unread(&mut self, what: Unread, line: u32) {
        self.index.unread.entry(what).or_insert((line, 0)).1 += 1;
    }

    fn vertex(&mut self, s: &Statement) -> Result<(), SceneError> {
        // What follows the third coordinate is a weight for curves, or a colour.
        let tokens: Vec<&str> = s.words().take(3).collect();
        let [x, y, z] = tokens[..] else {
            return Err(SceneError::new(
                Origin::line(self.file.to_owned(), s.line),
                SceneErrorKind::MissingCoordinate { count: tokens.len() },
            ));
        };
        for token in [x, y, z] {
            // A NaN is within no range.
            if !token.parse::<f64>().is_ok_and(|value| value.abs() <= MAX_COORDINATE) {
                return Err(SceneError::new(
                    Origin::line(self.file.to_owned(), s.line),
                    SceneErrorKind::BadCoordinate {
                        token: token.to_owned(),
                    },
                ));
            }
            self.index.written.see(token);
        }
        self.n_vertices += 1;
        let _ = writeln!(self.index.geometry, "v {x} {y} {z}");
        Ok(())
    }

    fn face(&mut self, s: &Statement, has_groups: bool) -> Result<(), SceneError> {
        self.index.geometry.push('f');
        let mut count = 0;
        for token in s.words() {
            let absolute = self.vertex_number(s.line, token)?;
            let _ = write!(self.index.geometry, " {absolute}");
            count += 1;
        }
        self.index.geometry.push('\n');
        if count < 3 {
            return Err(SceneError::new(
                Origin::line(self.file.to_owned(), s.line),
                SceneErrorKind::TooFewCorners { count },
            ));
        }
        let group = match self.group {
            Some(group) => group,
            None if has_groups => self.intern_group(DEFAULT_GROUP),
            None => {
                self.index.groups.push(format!("face{}", self.index.faces.len() + 1));
                self.index.groups.len() - 1
            }
        };
        self.index.faces.push(FaceLine {
            line: s.line,
            group,
            material: self.material,
        });
        Ok(())
    }

    /// Returns the vertex of `12`, `12/3`, `12//4`, `12/3/4` or `-1`, counted from 1.
    fn vertex_number(&self, line: u32, token: &str) -> Result<usize, SceneError> {
        let digits = token.split('/').next().unwrap_or(token);
        let index: i64 = digits.parse().map_err(|_| {
            SceneError::new(
                Origin::line(self.file.to_owned(), line),
                SceneErrorKind::BadIndex {
                    token: token.to_owned(),
                },
            )
        })?;
        let magnitude = usize::try_from(index.unsigned_abs()).unwrap_or(usize::MAX);
        let number = if index < 0 {
            // -1 is the last vertex so far.
            (self.n_vertices + 1).checked_sub(magnitude)
        } else {
            Some(magnitude)
        };
        number
            .filter(|number| (1..=self.n_vertices).contains(number))
            .ok_or_else(|| {
                SceneError::new(
                    Origin::line(self.file.to_owned(), line),
                    SceneErrorKind::IndexOutOfRange {
                        index,
                        n_vertices: self.n_vertices,
                    },
                )
            })
    }

    fn intern_group(&mut self, name: &str) -> usize {
        if let Some(&group) = self.group_of_name.get(name) {
            return group;
        }
        self.index.groups.push(name.to_owned());
        let group = self.index.groups.len() - 1;
        self.group_of_name.insert(name.to_owned(), group);
        group
    }

    fn use_material(&mut self, s: &Statement) -> Result<(), SceneError> {
        let name = self.name_of(s, "usemtl")?;
        let material = self.material_of_name.get(&name).copied().unwrap_or_else(|| {
            self.index.materials.push(NamedLine {
                line: s.line,
                name: name.clone(),
            });
            self.index.materials.len() - 1
        });
        self.material_of_name.insert(name, material);
        self.material = Some(material);
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
