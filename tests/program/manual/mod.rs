//! The manual in `docs/`: its links, its commands, and the pages that are generated from the code.
//!
//! `cargo test --release --test program -- --ignored write_manual` writes the generated pages, after a flag or a document has changed.

mod commands;
mod flags;
mod json;
mod links;
mod sources;
mod vocabulary;

use std::path::{Path, PathBuf};

/// A page and the function that makes it.
type Generated = (&'static str, fn() -> String);

/// The generated pages.
const GENERATED: [Generated; 4] = [
    ("docs/flags.md", flags::page),
    ("docs/json.md", json::page),
    ("docs/sources.md", sources::page),
    ("docs/vocabulary.md", vocabulary::page),
];

/// Returns a path in the repository.
fn in_repository(path: impl AsRef<Path>) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn read(path: impl AsRef<Path>) -> String {
    let path = in_repository(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns the Markdown files of a directory of the repository.
fn markdown(directory: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(in_repository(directory)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name());
    let mut pages: Vec<PathBuf> = names.map(|name| Path::new(directory).join(name)).collect();
    pages.retain(|path| path.extension().is_some_and(|suffix| suffix == "md"));
    pages.sort();
    pages
}

/// Returns the pages of the top level and of the manual.
fn pages() -> Vec<PathBuf> {
    let mut pages = markdown("");
    pages.extend(markdown("docs"));
    pages
}

/// Returns a text as the cell of a Markdown table: on one line, `<` as a character but in code.
fn cell(text: &str) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let line = words.join(" ").replace('|', "\\|");
    let parts = line.split('`').enumerate();
    let escaped: Vec<String> = parts
        .map(|(i, part)| {
            if i % 2 == 0 {
                part.replace('<', "&lt;")
            } else {
                part.to_owned()
            }
        })
        .collect();
    escaped.join("`")
}

/// Returns a text as code in a cell of a Markdown table.
fn code(text: &str) -> String {
    cell(&format!("`{text}`"))
}

#[test]
fn the_committed_pages_are_the_generated_ones() {
    for (path, page) in GENERATED {
        assert!(
            read(path) == page(),
            "{path} is not what the code generates; write it: cargo test --release --test program -- --ignored write_manual"
        );
    }
}

/// Writes the generated pages.
#[test]
#[ignore = "it writes files of the repository"]
fn write_manual() {
    for (path, page) in GENERATED {
        std::fs::write(in_repository(path), page()).unwrap();
    }
}
