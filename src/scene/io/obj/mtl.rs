//! Material libraries: `Kd` is the reflectance and `Ke` the exitance; a diffuse scene needs no other statement.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::super::LoadOptions;
use super::index::NamedLine;
use crate::input_file::DESCRIPTION_LIMIT;
use crate::scene::bright::{MIN_EXITANCE, is_too_dim};
use crate::scene::lines::{Statement, for_each_statement, read_named_text};
use crate::scene::{Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind};

/// A material as its library defines it.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    /// The library.
    pub(super) file: PathBuf,
    /// The line of the `newmtl`.
    pub(super) line: u32,
    /// The reflectance `Kd`, if stated.
    pub(super) reflectance: Option<[f64; 3]>,
    /// The exitance `Ke`, or zero.
    pub(super) exitance: [f64; 3],
    /// The line of the `Ke`, or of the `newmtl` without one.
    pub(super) exitance_line: u32,
    /// The line of the first texture of the diffuse or emitted colour, and the keyword whose value is used in its place.
    pub(super) texture: Option<(u32, &'static str)>,
    /// The line and the keyword of the first statement that makes the material specular or transparent.
    pub(super) not_diffuse: Option<(u32, &'static str)>,
    /// True if an earlier definition has the same name.
    pub(super) repeated: bool,
}

/// All materials of the libraries of one scene, by name.
#[derive(Debug, Default)]
pub(super) struct Definitions {
    by_name: HashMap<String, Definition>,
}

impl Definitions {
    /// Reads the libraries that a scene file names; one that does not exist, or another in its place, causes a warning.
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
                    let kind = if is_there {
                        SceneWarningKind::LibraryOutside { name: name_there, used }
                    } else {
                        SceneWarningKind::LibraryElsewhere { name: name_there, used }
                    };
                    warnings.push(SceneWarning::new(Origin::line(own, line), kind));
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
        self.add(&read_named_text(file, DESCRIPTION_LIMIT)?, file, max_exitance)
    }

    /// Returns the materials of one library.
    pub(super) fn of_text(text: &str, file: &Path, max_exitance: f64) -> Result<Self, SceneError> {
        let mut definitions = Self::default();
        definitions.add(text, file, max_exitance)?;
        Ok(definitions)
    }

    fn add(&mut self, text: &str, file: &Path, max_exitance: f64) -> Result<(), SceneError> {
        for (name, mut definition) in scan(text, file, max_exitance)? {
            definition.repeated = self.by_name.contains_key(&name);
            self.by_name.insert(name, definition);
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

/// Returns the libraries of one `mtllib`, whose names may contain blanks.
///
/// The text is one name unless every word names a file, or some words do and all look like libraries. Separators of Windows
/// are replaced by the system's where a file of that name exists, and a `#` after a blank begins a comment unless a file has such a name.
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

/// Returns the name before the last `#` that may begin a comment; `None` without such a sign, or without a name.
fn without_comment(text: &str) -> Option<&str> {
    let mut signs = text.rmatch_indices('#').map(|(at, _)| &text[..at]);
    let name = signs.find(|name| name.ends_with(char::is_whitespace))?.trim_end();
    (!name.is_empty()).then_some(name)
}

/// Returns the words of a text; a quoted part is one word, without its quotes.
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

/// Returns the folder of a file as a part of its path.
fn folder_of(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// Returns the folder of a file as a path that the system accepts.
fn plain_folder_of(file: &Path) -> &Path {
    let folder = folder_of(file);
    if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    }
}

/// Returns whether a word alone looks like the name of a library.
fn is_library(name: &str) -> bool {
    Path::new(name)
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("mtl"))
}

/// Returns whether a file is in the folder of the scene file or below it, with links resolved.
pub(in crate::scene::io) fn lies_beside(library: &Path, scene_file: &Path) -> bool {
    match (plain_folder_of(scene_file).canonicalize(), library.canonicalize()) {
        (Ok(folder), Ok(library)) => library.starts_with(folder),
        _ => false,
    }
}

/// Returns a known keyword in its usual case: some programs write `kd`, and no other keyword differs only in case.
fn spelt(keyword: &str) -> &str {
    let known = ["newmtl", "Kd", "Ke", "map_Kd", "map_Ke"];
    let found = known.into_iter().find(|known| known.eq_ignore_ascii_case(keyword));
    found.unwrap_or(keyword)
}

/// Reads the materials of a library, in file order.
fn scan(text: &str, file: &Path, max_exitance: f64) -> Result<Vec<(String, Definition)>, SceneError> {
    let mut materials: Vec<(String, Definition)> = Vec::new();
    for_each_statement(text, |s| {
        let refused = |kind| Err(SceneError::new(Origin::line(file.to_owned(), s.line), kind));
        let last = materials.last_mut().map(|(_, definition)| definition);
        match (spelt(s.keyword), last) {
            ("newmtl", _) if s.rest.is_empty() => return refused(SceneErrorKind::MissingName { keyword: "newmtl" }),
            ("newmtl", _) => materials.push((s.rest.to_owned(), Definition::begun(file, s.line))),
            ("Kd", last) => {
                let (value, last) = rgb(&s, "Kd", file, last)?;
                if let Some(value) = value.into_iter().find(|x| !(0.0..=1.0).contains(x)) {
                    return refused(SceneErrorKind::ReflectanceOutOfRange { keyword: "Kd", value });
                }
                last.reflectance = Some(value);
            }
            ("Ke", last) => {
                let (value, last) = rgb(&s, "Ke", file, last)?;
                if let Some(value) = value.into_iter().find(|x| !x.is_finite() || *x < 0.0) {
                    return refused(SceneErrorKind::ExitanceOutOfRange { keyword: "Ke", value });
                }
                if let Some(value) = value.into_iter().find(|x| *x > max_exitance) {
                    let limit = max_exitance;
                    return refused(SceneErrorKind::TooBright {
                        keyword: "Ke",
                        value,
                        limit,
                    });
                }
                if let Some(value) = value.into_iter().find(|x| is_too_dim(*x)) {
                    let limit = MIN_EXITANCE;
                    return refused(SceneErrorKind::TooDim {
                        keyword: "Ke",
                        value,
                        limit,
                    });
                }
                last.exitance = value;
                last.exitance_line = s.line;
            }
            (map @ ("map_Kd" | "map_Ke"), Some(last)) => {
                let counts = if map == "map_Kd" { "Kd" } else { "Ke" };
                last.texture.get_or_insert((s.line, counts));
            }
            (_, Some(last)) => {
                if let Some(keyword) = not_diffuse(&s) {
                    last.not_diffuse.get_or_insert((s.line, keyword));
                }
            }
            (_, None) => {}
        }
        Ok(())
    })?;
    Ok(materials)
}

impl Definition {
    /// Returns a material with its name alone.
    fn begun(file: &Path, line: u32) -> Self {
        Self {
            file: file.to_owned(),
            line,
            reflectance: None,
            exitance: [0.0; 3],
            exitance_line: line,
            texture: None,
            not_diffuse: None,
            repeated: false,
        }
    }
}

/// Returns the keyword of a statement that makes a surface specular (`Ks`) or transparent (`d`, `Tr`).
fn not_diffuse(s: &Statement) -> Option<&'static str> {
    let mut numbers = s.words().filter_map(|word| word.parse::<f64>().ok());
    match s.keyword {
        "Ks" => numbers.any(|x| x > 0.0).then_some("Ks"),
        // Options precede the number.
        "d" => numbers.last().is_some_and(|x| x < 1.0).then_some("d"),
        "Tr" => numbers.last().is_some_and(|x| x > 0.0).then_some("Tr"),
        _ => None,
    }
}

/// Returns the three numbers of a `Kd` or `Ke`, and its material; one number stands for three.
fn rgb<'d>(
    s: &Statement,
    keyword: &'static str,
    file: &Path,
    material: Option<&'d mut Definition>,
) -> Result<([f64; 3], &'d mut Definition), SceneError> {
    let refused = |kind| SceneError::new(Origin::line(file.to_owned(), s.line), kind);
    let material = material.ok_or_else(|| refused(SceneErrorKind::OutsideMaterial { keyword }))?;
    let numbers: Option<Vec<f64>> = s.words().map(|word| word.parse().ok()).collect();
    let value = match numbers.as_deref() {
        Some(&[grey]) => [grey; 3],
        Some(&[r, g, b]) => [r, g, b],
        _ => {
            let value = s.words().collect::<Vec<_>>().join(" ");
            return Err(refused(SceneErrorKind::BadMaterialValue { keyword, value }));
        }
    };
    Ok((value, material))
}
