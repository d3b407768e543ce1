//! Material libraries: `Kd` is the reflectance, `Ke` the exitance, and nothing else matters to a diffuse scene.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::bright::{MIN_EXITANCE, is_too_dim};
use super::lines::{Statement, for_each_statement, read_named_text};
use super::obj_lines::NamedLine;
use super::{LoadOptions, Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind};
use crate::input_file::DESCRIPTION_LIMIT;

/// A material as its library defines it.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    /// The library.
    pub(super) file: PathBuf,
    /// The line of the `newmtl`.
    pub(super) line: u32,
    /// `Kd`, where there is one.
    pub(super) reflectance: Option<[f64; 3]>,
    /// `Ke`, or zero.
    pub(super) exitance: [f64; 3],
    /// The line of the `Ke`, or of the `newmtl` without one.
    pub(super) exitance_line: u32,
    /// The line of the first texture of the diffuse or emitted colour, and the keyword of what counts in its place.
    pub(super) texture: Option<(u32, &'static str)>,
    /// The line and the keyword of the first statement by which the material would mirror or let light through.
    pub(super) not_diffuse: Option<(u32, &'static str)>,
    /// True if an earlier definition has the same name.
    pub(super) repeated: bool,
}

/// All materials of the libraries of one scene, by name.
#[derive(Debug, Default)]
pub(super) struct Definitions {
    by_name: HashMap<String, Definition>,
}

/// What a material says besides its colours.
struct Beside {
    /// The line of the `newmtl`.
    line: u32,
    /// The line of the last `Ke`, or of the `newmtl`.
    exitance_line: u32,
    /// The line of the first texture, and the keyword of what counts in its place.
    texture: Option<(u32, &'static str)>,
    /// The first statement by which it would not be diffuse and opaque.
    not_diffuse: Option<(u32, &'static str)>,
}

/// What stands in a library besides its numbers.
#[derive(Default)]
struct Scan {
    /// What each material says that the parser does not keep.
    materials: Vec<Beside>,
    /// The checked `newmtl`, `Kd` and `Ke` lines: the parser panics at a `Kd` with fewer than three numbers.
    values: String,
}

impl Definitions {
    /// Reads the libraries that a scene file names, beside the scene file; one that does not exist, or stands elsewhere, is a warning.
    pub(super) fn read_all(
        libraries: &[NamedLine],
        scene_file: &Path,
        options: &LoadOptions,
        warnings: &mut Vec<SceneWarning>,
    ) -> Result<Self, SceneError> {
        let mut definitions = Self::default();
        for library in libraries {
            let line = library.line;
            for Library { name, file: named } in files_of(&library.name, scene_file) {
                let may_read = |file: &PathBuf| options.allow_outside || lies_beside(file, scene_file);
                let is_there = named.is_some();
                let beside = || by_file_name(name, scene_file).filter(may_read);
                let (own, name_there) = (scene_file.to_owned(), name.to_owned());
                let file = if let Some(file) = named.filter(may_read) {
                    file
                } else if let Some(found) = beside() {
                    let used = found.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    warnings.push(SceneWarning::new(
                        Origin::line(own, line),
                        SceneWarningKind::LibraryElsewhere { name: name_there, used },
                    ));
                    found
                } else if is_there {
                    return Err(SceneError::new(
                        Origin::line(own, line),
                        SceneErrorKind::OutsideFolder {
                            name: library.name.clone(),
                        },
                    ));
                } else {
                    warnings.push(SceneWarning::new(
                        Origin::line(own, line),
                        SceneWarningKind::MissingLibrary { name: name_there },
                    ));
                    continue;
                };
                definitions.read(&file, options.max_exitance)?;
            }
        }
        Ok(definitions)
    }

    /// Returns the definition of a material.
    pub(super) fn get(&self, name: &str) -> Option<&Definition> {
        self.by_name.get(name)
    }

    fn read(&mut self, file: &Path, max_exitance: f64) -> Result<(), SceneError> {
        let scan = scan(&read_named_text(file, DESCRIPTION_LIMIT)?, file, max_exitance)?;
        let disagree =
            |message: String| SceneError::new(Origin::file(file.to_owned()), SceneErrorKind::Parser { message });
        let (parsed, _) =
            tobj::load_mtl_buf(&mut scan.values.as_bytes()).map_err(|error| disagree(error.to_string()))?;
        if parsed.len() != scan.materials.len() {
            return Err(disagree(format!(
                "{} materials, not {}",
                parsed.len(),
                scan.materials.len()
            )));
        }
        for (material, beside) in parsed.into_iter().zip(scan.materials) {
            let definition = Definition {
                file: file.to_owned(),
                line: beside.line,
                reflectance: material.diffuse,
                exitance: material.emissive.unwrap_or_default(),
                exitance_line: beside.exitance_line,
                texture: beside.texture,
                not_diffuse: beside.not_diffuse,
                repeated: false,
            };
            match self.by_name.entry(material.name) {
                Entry::Vacant(free) => {
                    free.insert(definition);
                }
                Entry::Occupied(mut taken) => {
                    taken.insert(Definition {
                        repeated: true,
                        ..definition
                    });
                }
            }
        }
        Ok(())
    }
}

/// A library that a scene names.
pub(super) struct Library<'a> {
    /// Its name there, without quotes.
    pub(super) name: &'a str,
    /// The file of that name, if it exists.
    pub(super) file: Option<PathBuf>,
}

/// Returns the libraries of one `mtllib`: one, blanks and all, unless there is a file for every word, or for some and all look like libraries. Separators of Windows
/// are taken for the system's where that helps, and a `#` behind a blank begins a comment where no file has such a name.
pub(super) fn files_of<'a>(text: &'a str, scene_file: &Path) -> Vec<Library<'a>> {
    let existing = |name: &'a str| {
        let spellings = [name.to_owned(), name.replace('\\', "/")];
        let mut files = spellings
            .into_iter()
            .map(|spelling| folder_of(scene_file).join(spelling));
        let file = files.find(|file| file.exists());
        Library { name, file }
    };
    let whole = existing(text);
    if whole.file.is_some() {
        return vec![whole];
    }
    if let Some(name) = without_comment(text) {
        return files_of(name, scene_file);
    }
    let words: Vec<Library> = words_of(text).into_iter().map(existing).collect();
    let is_there = |library: &Library| library.file.is_some();
    let is_beside = |library: &Library| is_there(library) || by_file_name(library.name, scene_file).is_some();
    let are_libraries = words.iter().all(|library| is_library(library.name));
    let is_quoted = !words_of(text).into_iter().eq(text.split_whitespace());
    let whole_is_beside = by_file_name(text, scene_file).is_some();
    let some_are_there = words.iter().any(is_there) || (!whole_is_beside && words.iter().any(is_beside));
    if is_quoted || words.iter().all(is_there) || (some_are_there && are_libraries) {
        words
    } else {
        vec![whole]
    }
}

/// Returns the name before the last `#` that may begin a comment; `None` where there is none, or no name.
fn without_comment(text: &str) -> Option<&str> {
    let mut signs = text.rmatch_indices('#').map(|(at, _)| &text[..at]);
    let name = signs.find(|name| name.ends_with(char::is_whitespace))?.trim_end();
    (!name.is_empty()).then_some(name)
}

/// Returns the words of a text; what stands in quotes is one word, without them.
fn words_of(text: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let quoted = rest.strip_prefix(['"', '\'']).and_then(|inner| inner.split_once(first));
        let (word, tail) = match quoted {
            Some(parts) => parts,
            None => rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())),
        };
        words.push(word);
        rest = tail.trim_start();
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Returns the file beside a scene that has the file name of a path of any system, whatever its case: the same case first, else the first in order.
pub(super) fn by_file_name(path: &str, scene_file: &Path) -> Option<PathBuf> {
    let wanted = path.rsplit(['/', '\\']).next().filter(|name| !name.is_empty())?;
    let entries = std::fs::read_dir(plain_folder_of(scene_file)).ok()?;
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let alike = names.filter(|name| name.to_lowercase() == wanted.to_lowercase());
    let best = alike.min_by_key(|name| (name != wanted, name.clone()))?;
    Some(folder_of(scene_file).join(best))
}

/// Returns the folder of a file, as the file's path has it.
fn folder_of(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// Returns the folder of a file by a name that the system has for it.
fn plain_folder_of(file: &Path) -> &Path {
    let folder = folder_of(file);
    if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    }
}

/// Tells whether a name is that of a library by itself, not a part of one with blanks.
fn is_library(name: &str) -> bool {
    Path::new(name)
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("mtl"))
}

/// Returns whether a file is in the folder of the scene file or below it, links followed.
fn lies_beside(library: &Path, scene_file: &Path) -> bool {
    match (plain_folder_of(scene_file).canonicalize(), library.canonicalize()) {
        (Ok(folder), Ok(library)) => library.starts_with(folder),
        _ => false,
    }
}

/// Returns a keyword as it is written: some programs write `kd`, and nothing else is called so.
fn spelt(keyword: &str) -> &str {
    let known = ["newmtl", "Kd", "Ke", "map_Kd", "map_Ke"];
    let found = known.into_iter().find(|known| known.eq_ignore_ascii_case(keyword));
    found.unwrap_or(keyword)
}

fn scan(text: &str, file: &Path, max_exitance: f64) -> Result<Scan, SceneError> {
    let mut scan = Scan::default();
    for_each_statement(text, |s| {
        match spelt(s.keyword) {
            "newmtl" if s.rest.is_empty() => {
                return Err(SceneError::new(
                    Origin::line(file.to_owned(), s.line),
                    SceneErrorKind::MissingName { keyword: "newmtl" },
                ));
            }
            "newmtl" => {
                scan.materials.push(Beside {
                    line: s.line,
                    exitance_line: s.line,
                    texture: None,
                    not_diffuse: None,
                });
                let _ = writeln!(scan.values, "newmtl {}", s.rest);
            }
            "Kd" => {
                let value = rgb(&s, "Kd", file, &scan)?;
                if let Some(value) = value.into_iter().find(|x| !(0.0..=1.0).contains(x)) {
                    return Err(SceneError::new(
                        Origin::line(file.to_owned(), s.line),
                        SceneErrorKind::ReflectanceOutOfRange { value },
                    ));
                }
                write_rgb(&mut scan.values, "Kd", value);
            }
            "Ke" => {
                let value = rgb(&s, "Ke", file, &scan)?;
                if let Some(value) = value.into_iter().find(|x| !x.is_finite() || *x < 0.0) {
                    return Err(SceneError::new(
                        Origin::line(file.to_owned(), s.line),
                        SceneErrorKind::ExitanceOutOfRange { value },
                    ));
                }
                if let Some(value) = value.into_iter().find(|x| *x > max_exitance) {
                    return Err(SceneError::new(
                        Origin::line(file.to_owned(), s.line),
                        SceneErrorKind::TooBright {
                            value,
                            limit: max_exitance,
                        },
                    ));
                }
                if let Some(value) = value.into_iter().find(|x| is_too_dim(*x)) {
                    return Err(SceneError::new(
                        Origin::line(file.to_owned(), s.line),
                        SceneErrorKind::TooDim {
                            value,
                            limit: MIN_EXITANCE,
                        },
                    ));
                }
                if let Some(material) = scan.materials.last_mut() {
                    material.exitance_line = s.line;
                }
                write_rgb(&mut scan.values, "Ke", value);
            }
            map @ ("map_Kd" | "map_Ke") => {
                if let Some(material) = scan.materials.last_mut() {
                    material
                        .texture
                        .get_or_insert((s.line, if map == "map_Kd" { "Kd" } else { "Ke" }));
                }
            }
            _ => {
                let keyword = not_diffuse(&s);
                if let (Some(keyword), Some(material)) = (keyword, scan.materials.last_mut()) {
                    material.not_diffuse.get_or_insert((s.line, keyword));
                }
            }
        }
        Ok(())
    })?;
    Ok(scan)
}

/// Returns the keyword of a statement by which a surface mirrors (`Ks`) or lets light through (`d`, `Tr`).
fn not_diffuse(s: &Statement) -> Option<&'static str> {
    let mut numbers = s.words().filter_map(|word| word.parse::<f64>().ok());
    match s.keyword {
        "Ks" => numbers.any(|x| x > 0.0).then_some("Ks"),
        // Options come before the number.
        "d" => numbers.last().is_some_and(|x| x < 1.0).then_some("d"),
        "Tr" => numbers.last().is_some_and(|x| x > 0.0).then_some("Tr"),
        _ => None,
    }
}

/// Returns the three numbers of a `Kd` or `Ke`; one number stands for three.
fn rgb(s: &Statement, keyword: &'static str, file: &Path, scan: &Scan) -> Result<[f64; 3], SceneError> {
    if scan.materials.is_empty() {
        return Err(SceneError::new(
            Origin::line(file.to_owned(), s.line),
            SceneErrorKind::OutsideMaterial { keyword },
        ));
    }
    let numbers: Option<Vec<f64>> = s.words().map(|word| word.parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[grey]) => Ok([grey; 3]),
        Some(&[r, g, b]) => Ok([r, g, b]),
        _ => Err(SceneError::new(
            Origin::line(file.to_owned(), s.line),
            SceneErrorKind::BadMaterialValue {
                keyword,
                value: s.words().collect::<Vec<_>>().join(" "),
            },
        )),
    }
}

fn write_rgb(values: &mut String, keyword: &str, [r, g, b]: [f64; 3]) {
    let _ = writeln!(values, "{keyword} {r:?} {g:?} {b:?}");
}
