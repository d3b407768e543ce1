//! The page of sources and departures of the implementations, from the doc comments of the code.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use super::{cell, in_repository, read};

/// Returns the page.
pub(super) fn page() -> String {
    let sources = sources();
    let mut page = "# Sources and departures\n\nThis page is generated from the doc comments of the code, which `cargo doc --open` shows beside each item.\n\n\
        ## Sources\n\n"
        .to_owned();
    for (name, text) in sources.values() {
        let text = text.replace(['<', '>'], "");
        let _ = writeln!(page, "- **{name}.** {}", plain(&text, &sources));
    }
    page.push_str(
        "\n## Departures\n\nEach row is one place where the implementation differs from its source. An implementation without a row follows its source.\n\n\
        | file | source | departure |\n|---|---|---|\n",
    );
    let mut files = Vec::new();
    collect(&in_repository("src"), &mut files);
    files.sort();
    for file in files {
        let path = file
            .strip_prefix(in_repository(""))
            .unwrap()
            .to_str()
            .unwrap()
            .to_owned();
        for paragraph in paragraphs(&read(&path)) {
            if let Some((source, departure)) = departure(&paragraph) {
                let (source, departure) = (plain(source, &sources), plain(departure, &sources));
                let _ = writeln!(page, "| `{path}` | {source} | {departure} |");
            }
        }
    }
    page
}

/// Returns the documented constants of `references`: by the name of the constant, its text and its description.
fn sources() -> BTreeMap<String, (String, String)> {
    let text = read("src/references.rs");
    let mut sources = BTreeMap::new();
    let mut description = String::new();
    for line in text.lines() {
        if let Some(part) = line.strip_prefix("///") {
            description.push_str(part);
        } else if let Some(constant) = line.strip_prefix("pub const ") {
            let (name, value) = constant.split_once(": &str = ").unwrap();
            let value = value.trim_matches(['"', ';']);
            sources.insert(name.to_owned(), (value.to_owned(), std::mem::take(&mut description)));
        }
    }
    sources
}

fn collect(directory: &Path, files: &mut Vec<std::path::PathBuf>) {
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, files);
        } else if path.extension().is_some_and(|suffix| suffix == "rs") {
            files.push(path);
        }
    }
}

/// Returns the paragraphs of the doc comments of a file.
fn paragraphs(text: &str) -> Vec<String> {
    let mut paragraphs = vec![String::new()];
    for line in text.lines().map(str::trim_start) {
        let comment = line.strip_prefix("///").or_else(|| line.strip_prefix("//!"));
        match comment.map(str::trim) {
            Some(part) if !part.is_empty() => {
                let last = paragraphs.last_mut().unwrap();
                last.push_str(part);
                last.push(' ');
            }
            _ => paragraphs.push(String::new()),
        }
    }
    paragraphs
}

/// Returns the source and the departures that a paragraph states, if there are any.
fn departure(paragraph: &str) -> Option<(&str, &str)> {
    let start = paragraph.find("Departures")?;
    let (before, after) = paragraph.split_at(start);
    let (from, departure) = after.trim_start_matches("Departures").split_once(": ")?;
    let source = before
        .rfind("Source")
        .map_or(from.trim_start_matches(" from "), |at| &before[at..]);
    let source = source.trim_start_matches("Sources: ").trim_start_matches("Source: ");
    let is_none = departure.starts_with("none.");
    (!is_none).then_some((source.trim(), departure.trim()))
}

/// Returns a text without links to items of the code; constants of `references` become their names.
fn plain(text: &str, sources: &BTreeMap<String, (String, String)>) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, link)) = rest.split_once("[`") {
        plain.push_str(before);
        let (name, after) = link.split_once("`]").unwrap();
        rest = if after.starts_with('(') {
            after.split_once(')').unwrap().1
        } else {
            after
        };
        match sources.get(name.trim_start_matches("crate::references::")) {
            Some((known, _)) => plain.push_str(known),
            None => {
                let _ = write!(plain, "`{name}`");
            }
        }
    }
    plain.push_str(rest);
    cell(&without_links(&plain))
}

/// Returns a text with the words of its links alone.
fn without_links(text: &str) -> String {
    let mut plain = text.to_owned();
    while let Some(middle) = plain.find("](") {
        let open = plain[..middle].rfind('[').unwrap();
        let close = middle + plain[middle..].find(')').unwrap();
        plain = format!("{}{}{}", &plain[..open], &plain[open + 1..middle], &plain[close + 1..]);
    }
    plain
}

#[test]
fn the_page_has_departures_and_no_link_to_the_code() {
    let page = page();
    assert!(page.matches("\n| `src/").count() > 20);
    assert!(!page.contains("crate::"), "{page}");
    assert_eq!(departure("Source: X. Departures: none. "), None);
    assert_eq!(
        departure("A b. Source: X, p. 3. Departures: a, b. "),
        Some(("X, p. 3.", "a, b."))
    );
}

#[test]
fn the_citation_file_has_every_source() {
    let citation = read("CITATION.cff");
    for (name, description) in sources().values() {
        let year = name.rsplit(' ').next().filter(|year| year.parse::<u32>().is_ok());
        let title = description.split('"').nth(1);
        for part in year.into_iter().chain(title) {
            assert!(citation.contains(part), "CITATION.cff has no `{part}` of {name}");
        }
    }
}
