//! Reads Wavefront OBJ with its MTL libraries: lines are checked and indexed here, and tobj reads the geometry.

use std::path::Path;
#[cfg(feature = "cli")]
use std::path::PathBuf;

mod geometry;
mod index;
#[cfg(feature = "cli")]
mod libraries;
pub(super) mod mtl;
pub(super) mod write;

use super::polygons::{FileMaterial, Polygons};
use super::reader::{Head, Reader};
use super::source::Source;
use super::{Counts, LoadOptions};
use crate::scene::{MAX_EXITANCE, Origin, SceneError, SceneWarning, SceneWarningKind};
use index::{NamedLine, ObjIndex, Unread, scan};
use mtl::Definitions;

/// The format.
pub(super) struct Obj;

impl Reader for Obj {
    fn name(&self) -> &'static str {
        "obj"
    }

    fn summary(&self) -> &'static str {
        "Wavefront OBJ with MTL"
    }

    fn suffixes(&self) -> &'static [&'static str] {
        &["obj"]
    }

    fn recognises(&self, head: &Head<'_>) -> bool {
        let is_statement = |line: &str| {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => words.clone().count() >= 3 && words.all(|word| word.parse::<f64>().is_ok()),
                Some("mtllib" | "usemtl") => true,
                _ => false,
            }
        };
        head.lines().any(is_statement)
    }

    fn read(&self, source: &Source<'_>, options: &LoadOptions) -> Result<Polygons, SceneError> {
        let file = &source.path;
        let text = source.text()?;
        source.expect(counts(text))?;
        let ObjIndex {
            mut polygons,
            materials,
            libraries,
            unread,
            geometry,
        } = scan(text, file)?;
        geometry::parse(&geometry, &mut polygons, file)?;
        drop(geometry);
        for (what, &(line, count)) in &unread {
            polygons.warnings.push(unread_warning(file, *what, line, count));
        }
        let definitions = Definitions::read_all(&libraries, file, options, &mut polygons.warnings)?;
        polygons.materials = materials
            .iter()
            .map(|named| material(named, &definitions, file))
            .collect();
        Ok(polygons)
    }

    #[cfg(feature = "cli")]
    fn companions(&self, path: &Path) -> Vec<PathBuf> {
        libraries::libraries_of(path)
    }
}

/// Returns the polygons of a valid scene and of its one library.
pub(super) fn of_texts(obj: &str, library: &str, name: &Path) -> Result<Polygons, SceneError> {
    let ObjIndex {
        mut polygons,
        materials,
        geometry,
        ..
    } = scan(obj, name)?;
    geometry::parse(&geometry, &mut polygons, name)?;
    let definitions = Definitions::of_text(library, name, MAX_EXITANCE)?;
    let materials = materials.iter();
    polygons.materials = materials.map(|named| material(named, &definitions, name)).collect();
    Ok(polygons)
}

/// Returns upper bounds of the numbers of elements in a file, by the first letters of its lines.
fn counts(text: &str) -> Counts {
    let mut counts = Counts::default();
    // The first letter of the line, if reached, and the previous byte.
    let (mut keyword, mut last) = (None, b'\n');
    for byte in text.bytes() {
        let is_end = matches!(byte, b'\n' | b'\r');
        if is_end && last != b'\\' {
            keyword = None;
        } else if !byte.is_ascii_whitespace() && last.is_ascii_whitespace() {
            match keyword {
                None => {
                    keyword = Some(byte);
                    counts.vertices += u64::from(matches!(byte, b'v' | b'V'));
                    counts.faces += u64::from(matches!(byte, b'f' | b'F'));
                }
                Some(b'f' | b'F') => counts.corners += 1,
                Some(_) => {}
            }
        }
        last = byte;
    }
    counts
}

/// Returns the warning about statements that were not read, or not as written.
fn unread_warning(file: &Path, what: Unread, line: u32, count: usize) -> SceneWarning {
    let skipped = |in_words| SceneWarningKind::SkippedStatements { count, what: in_words };
    let kind = match what {
        Unread::NamelessLibrary => SceneWarningKind::NamelessLibrary,
        Unread::Capitals => SceneWarningKind::Capitals { count },
        Unread::LinesAndPoints => skipped("lines or points"),
        Unread::FreeForm => skipped("free-form curves or surfaces"),
        Unread::Calls => skipped("calls of other files or programs"),
        Unread::Unknown => skipped("unknown keywords"),
    };
    SceneWarning::new(Origin::line(file, line), kind)
}

/// Returns a material as its library defines it, with the warnings about it.
fn material(named: &NamedLine, definitions: &Definitions, file: &Path) -> FileMaterial {
    let name = || named.name.clone();
    let Some(definition) = definitions.get(&named.name) else {
        let at = Origin::line(file, named.line);
        let kind = SceneWarningKind::UnknownMaterial { name: name() };
        return FileMaterial {
            name: name(),
            reflectance: None,
            exitance: [0.0; 3],
            exitance_keyword: "Ke",
            doubts: vec![SceneWarning::new(at.clone(), kind)],
            at,
        };
    };
    let mut doubts = Vec::new();
    let mut doubt = |line: u32, kind| doubts.push(SceneWarning::new(Origin::line(&definition.file, line), kind));
    if definition.repeated {
        doubt(definition.line, SceneWarningKind::RepeatedMaterial { name: name() });
    }
    if definition.reflectance.is_none() {
        doubt(
            definition.line,
            SceneWarningKind::MissingReflectance {
                keyword: "Kd",
                name: name(),
            },
        );
    }
    if let Some((line, keyword)) = definition.texture {
        doubt(line, SceneWarningKind::IgnoredTexture { keyword, name: name() });
    }
    if let Some((line, keyword)) = definition.not_diffuse {
        doubt(line, SceneWarningKind::NotDiffuse { keyword, count: 1 });
    }
    FileMaterial {
        name: name(),
        reflectance: definition.reflectance,
        exitance: definition.exitance,
        exitance_keyword: "Ke",
        at: Origin::line(&definition.file, definition.exitance_line),
        doubts,
    }
}
