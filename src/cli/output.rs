//! Output files, with errors for the user.

use std::io::{self, Write as _};
use std::path::Path;

use super::failure::Failure;
use crate::experiment::findings::{Files, text_file};
use crate::report::Machine;
use crate::report::page::{Figure, Page};
use crate::whole_file;
use crate::workflow::Settings;

/// Refuses an output that cannot be written, before any work.
pub(super) fn expect_possible(path: &Path) -> Result<(), Failure> {
    let possible = whole_file::expect_possible(path);
    possible.map(drop).map_err(|error| unwritable(path, &error))
}

fn unwritable(path: &Path, error: &io::Error) -> Failure {
    Failure::new("unwritable", format!("{}: cannot be written: {error}", path.display())).in_file(path)
}

/// Makes a directory for outputs, and its parents, unless it exists.
pub(super) fn make_directory(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|error| {
        Failure::new("unwritable", format!("{}: cannot be made: {error}", path.display())).in_file(path)
    })
}

/// Adds `index.html`: a report with the plots and images among `files`, and the settings; like the report it shows times.
///
/// Each of `captions` is the name of an image and what it shows.
pub(super) fn add_page(files: &mut Files, captions: &[(String, String)], report: &str, settings: &Settings) {
    let title = report.lines().next().unwrap_or_default().trim_start_matches('#').trim();
    // A plot that is also there as PNG is shown once.
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let is_shown = |name: &str| match name.rsplit_once('.') {
        Some((_, "svg")) => true,
        Some((stem, "png")) => !names.contains(&format!("{stem}.svg").as_str()),
        _ => false,
    };
    let shown = files.iter().filter(|(name, _)| is_shown(name));
    let figures = shown.map(|(name, content)| Figure {
        name,
        content,
        caption: captions
            .iter()
            .find(|(of, _)| of == name)
            .map(|(_, text)| text.as_str()),
    });
    let page = Page {
        title,
        report,
        figures: figures.collect(),
        settings: &settings.record().into(),
        machine: &Machine::here(),
    };
    let html = page.to_html();
    files.push(text_file("index.html", html));
}

/// Writes files, all or none, and locked against other processes; returns their names, and a line about them.
pub(super) fn write_all<'a>(directory: &Path, files: &'a Files) -> Result<(Vec<&'a str>, String), Failure> {
    let mut prepared = Vec::new();
    for (name, content) in files {
        let path = directory.join(name);
        let file = whole_file::prepare(&path, |writer| writer.write_all(content));
        let file = file.map_err(|error| unwritable(&path, &error))?;
        prepared.push((path, file));
    }
    let turn = whole_file::turn(directory);
    for (path, file) in prepared {
        file.put().map_err(|error| unwritable(&path, &error))?;
    }
    drop(turn);
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    let first = names.first().map(|name| directory.join(name).display().to_string());
    let line = match names.len() {
        0 | 1 => format!("wrote {}", first.unwrap_or_default()),
        2 => format!("wrote {} and 1 more file", first.unwrap_or_default()),
        n => format!("wrote {} and {} more files", first.unwrap_or_default(), n - 1),
    };
    Ok((names, line))
}
