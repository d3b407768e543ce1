//! Every relative link and anchor of the pages that people read.

use std::collections::{BTreeSet, HashMap};
use std::path::{Component, Path, PathBuf};

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

use super::{in_repository, markdown, pages, read};

/// The links of a page, and the anchors of its headings.
struct Page {
    links: Vec<String>,
    anchors: BTreeSet<String>,
}

/// Returns the anchor of a heading, as GitHub and mdBook make it.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter_map(|c| match c {
        c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
        c if c.is_whitespace() => Some('-'),
        _ => None,
    });
    kept.flat_map(char::to_lowercase).collect()
}

fn page(text: &str) -> Page {
    let mut links = Vec::new();
    let mut anchors = BTreeSet::new();
    let mut times: HashMap<String, usize> = HashMap::new();
    let mut heading = None;
    for event in Parser::new_ext(text, Options::ENABLE_TABLES) {
        match event {
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => links.push(dest_url.to_string()),
            Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
            Event::Text(part) | Event::Code(part) => {
                if let Some(heading) = &mut heading {
                    heading.push_str(&part);
                }
            }
            Event::End(TagEnd::Heading(_)) => {
                let name = anchor(&heading.take().unwrap());
                let before = times.entry(name.clone()).or_default();
                let again = if *before == 0 { name } else { format!("{name}-{before}") };
                *before += 1;
                anchors.insert(again);
            }
            _ => {}
        }
    }
    Page { links, anchors }
}

/// Returns where a link of a page leads, without `.` and `..`.
fn target(page: &Path, link: &str) -> PathBuf {
    let mut path = PathBuf::new();
    for part in page.parent().unwrap().join(link).components() {
        match part {
            Component::ParentDir => assert!(path.pop(), "{}: {link} leaves the repository", page.display()),
            Component::CurDir => {}
            part => path.push(part),
        }
    }
    path
}

/// Returns the defects of a page's links.
fn defects(path: &Path) -> Vec<String> {
    let own = page(&read(path));
    let is_in_book = path.starts_with("docs");
    let mut defects = Vec::new();
    let relative = own
        .links
        .iter()
        .filter(|link| !link.contains("://") && !link.starts_with("mailto:"));
    for link in relative {
        let (file, name) = link.split_once('#').unwrap_or((link, ""));
        let target = if file.is_empty() {
            path.to_path_buf()
        } else {
            target(path, file)
        };
        let is_page = target.extension().is_some_and(|suffix| suffix == "md");
        if !in_repository(&target).exists() {
            defects.push(format!("{}: {link} does not exist", path.display()));
        } else if is_in_book && is_page && !target.starts_with("docs") {
            defects.push(format!("{}: {link} is not a page of the manual", path.display()));
        } else if !(name.is_empty() || is_page && page(&read(&target)).anchors.contains(name)) {
            defects.push(format!("{}: {link} has no such heading", path.display()));
        }
    }
    defects
}

#[test]
fn every_link_leads_somewhere() {
    let mut pages = pages();
    pages.push(PathBuf::from("python/README.md"));
    for scene in std::fs::read_dir(in_repository("scenes")).unwrap() {
        pages.extend(markdown(&format!("scenes/{}", scene.unwrap().file_name().display())));
    }
    assert!(pages.len() > 20, "{pages:?}");
    let found: Vec<String> = pages.iter().flat_map(|path| defects(path)).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn the_summary_lists_every_page_once() {
    let mut listed = page(&read("docs/SUMMARY.md")).links;
    listed.push("SUMMARY.md".to_owned());
    listed.sort();
    let there: Vec<String> = markdown("docs")
        .iter()
        .map(|path| path.file_name().unwrap().to_str().unwrap().to_owned())
        .collect();
    assert_eq!(listed, there);
}

#[test]
fn links_that_lead_nowhere_are_found() {
    let own = page("# A `b`, c\n[x](y.md#z) ![p](p.png)\n## Again\n## Again\n`[no](link)`\n");
    assert_eq!(own.links, ["y.md#z", "p.png"]);
    assert_eq!(own.anchors.iter().collect::<Vec<_>>(), ["a-b-c", "again", "again-1"]);
}
