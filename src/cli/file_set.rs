//! Checks that the files that a command writes differ from all others that it writes, reads or continues from.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::args::ReadingArgs;
use super::failure::Failure;
use super::output;
use crate::report::form_factors::files_of;
use crate::scene::{Format, companions_of};
use crate::whole_file;

/// The files of a command, each with its description.
#[derive(Default)]
pub(super) struct FileSet {
    written: Vec<(String, PathBuf)>,
    kept: Vec<(String, PathBuf)>,
    read: Vec<(String, PathBuf)>,
}

impl FileSet {
    /// Adds a file that is written at the end.
    pub(super) fn writes(&mut self, what: impl Into<String>, path: &Path) -> &mut Self {
        self.written.push((what.into(), path.to_owned()));
        self
    }

    /// Adds an image and its preview as written files; `what` as in "output".
    pub(super) fn writes_picture(&mut self, what: &str, path: &Path) -> &mut Self {
        let preview = path.with_extension("png");
        self.writes(format!("the {what}"), path)
            .writes(format!("the preview of the {what}"), &preview)
    }

    /// Adds a file of written form factors, with the description beside some formats.
    pub(super) fn writes_form_factors(&mut self, path: &Path) -> &mut Self {
        for (file, what) in files_of(path)
            .iter()
            .zip(["the output", "the description beside the output"])
        {
            self.writes(what, file);
        }
        self
    }

    /// Adds a file that stores work for a later run.
    pub(super) fn keeps(&mut self, what: &str, path: Option<&Path>) -> &mut Self {
        self.kept.extend(path.map(|path| (what.to_owned(), path.to_owned())));
        self
    }

    /// Adds a file that is read.
    pub(super) fn reads(&mut self, what: &str, path: Option<&Path>) -> &mut Self {
        self.read.extend(path.map(|path| (what.to_owned(), path.to_owned())));
        self
    }

    /// Adds a scene, with the material libraries and buffers that it names, and the file of its materials.
    pub(super) fn reads_scene(&mut self, path: &Path, reading: &ReadingArgs) -> &mut Self {
        self.reads("the scene", Some(path));
        let format = reading.format.as_deref().and_then(Format::named);
        for companion in companions_of(path, format) {
            let is_library = companion.extension().is_none_or(|suffix| suffix != "bin");
            let what = if is_library {
                "a material library of the scene"
            } else {
                "a buffer of the scene"
            };
            self.reads(what, Some(&companion));
        }
        self.reads("the materials of the scene", reading.materials.as_deref())
    }

    /// Refuses, before any work, files that cannot be written or that would replace one another.
    pub(super) fn check<'a>(&'a self) -> Result<(), Failure> {
        for (_, path) in &self.written {
            output::expect_possible(path)?;
        }
        let mut taken: HashMap<PathBuf, &'a (String, PathBuf)> = HashMap::new();
        let mut take = |file: &'a (String, PathBuf), stays: bool| {
            let Some(place) = place(&file.1) else {
                return Ok(());
            };
            match taken.get(&place) {
                Some(other) => return Err(one_file(other, file)),
                None if stays => taken.insert(place, file),
                None => None,
            };
            Ok(())
        };
        self.written.iter().try_for_each(|file| take(file, true))?;
        // A read file may be the same as one that stores work: opening the latter refuses other content.
        self.read.iter().try_for_each(|file| take(file, false))?;
        self.kept.iter().try_for_each(|file| take(file, true))
    }
}

/// Returns the canonical path of an existing or future file.
fn place(path: &Path) -> Option<PathBuf> {
    let new = || {
        let directory = std::fs::canonicalize(whole_file::directory_of(path)).ok()?;
        Some(directory.join(path.file_name()?))
    };
    std::fs::canonicalize(path).ok().or_else(new)
}

fn one_file((what, path): &(String, PathBuf), (other, _): &(String, PathBuf)) -> Failure {
    let path = path.display();
    Failure::usage(format!(
        "{path}: {what} and {other} are one file; give them different names"
    ))
}
