//! The pages of reports in a real browser: skipped, with a message, where there is none.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Output};

/// Runs a Chromium on a file, or returns `None` where there is none.
fn browser(profile: &Path, arguments: &[&str], page: &Path) -> Option<Output> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let url = format!("file://{}", page.display());
    names.iter().find_map(|name| {
        Command::new(name)
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
                "--enable-logging=stderr",
            ])
            .arg(format!("--user-data-dir={}", profile.display()))
            .args(arguments)
            .arg(&url)
            .output()
            .ok()
    })
}

/// Returns a page as the browser has it after it asked for nothing and complained of nothing, or `None` where there is no browser.
fn quiet_dom(profile: &Path, page: &Path) -> Option<String> {
    let html = std::fs::read_to_string(page).unwrap();
    // What a page can ask for stands in such attributes; the name space of SVG is no address that anybody asks.
    assert_eq!(html.matches("<script>").count(), 1);
    for attribute in ["src=\"http", "href=\"http", "url(", "@import", "<script "] {
        assert!(!html.contains(attribute), "{attribute}");
    }
    let opened = browser(profile, &["--dump-dom"], page)?;
    let log = String::from_utf8_lossy(&opened.stderr);
    assert!(!log.contains("CONSOLE"), "{log}");
    Some(String::from_utf8_lossy(&opened.stdout).into_owned())
}

#[test]
#[expect(clippy::print_stderr, reason = "says that it was skipped")]
fn pages_open_without_a_complaint() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = [
        "compare",
        "cube",
        "--methods",
        "sr,exact",
        "--seeds",
        "2",
        "--visibility",
        "on",
        "-o",
        "out",
    ];
    crate::program::succeed(directory.path(), &arguments);
    crate::program::succeed(
        directory.path(),
        &["reproduce", "lewis", "--tables", "1", "-o", "lewis"],
    );
    let page = directory.path().join("out/index.html");
    let html = std::fs::read_to_string(&page).unwrap();
    let profile = directory.path().join("profile");
    let doms = [&page, &directory.path().join("lewis/index.html")].map(|page| quiet_dom(&profile, page));
    let [Some(dom), Some(lewis)] = doms else {
        eprintln!("skipped: there is no Chromium to open the pages with");
        return;
    };
    assert!(dom.contains("<h1>cube: form-factor methods side by side</h1>"), "{dom}");
    // Two errors as plots; the points of both methods tell their values.
    assert_eq!(dom.matches("<figure>").count(), 2);
    // Each method has one mark: in the key, and in front of its name in tables.
    let marks = |name: &str| -> BTreeSet<String> {
        let parts = dom.split("<svg class=\"mark\"").skip(1);
        let named = parts.filter_map(|part| part.split_once("</svg>"));
        let own = named.filter(|(_, after)| after.split(['<', ' ']).next() == Some(name));
        own.map(|(mark, _)| mark.to_owned()).collect()
    };
    let (sr, exact) = (marks("sr"), marks("exact"));
    assert!(sr.len() == 1 && exact.len() == 1 && sr != exact, "{sr:?} {exact:?}");
    assert!(dom.contains("<button type=\"button\">method</button></th>"), "{dom}");
    // A press on a header sorts, and says so.
    let pressed = directory.path().join("pressed.html");
    let script = "<script>document.querySelector('th button').click()</script></body>";
    let unguarded = html
        .replace("script-src", "script-src-elem 'unsafe-inline'; x-")
        .replace("</body>", script);
    std::fs::write(&pressed, unguarded).unwrap();
    let sorted = browser(&profile, &["--dump-dom"], &pressed).unwrap();
    let sorted = String::from_utf8_lossy(&sorted.stdout).into_owned();
    assert!(sorted.contains("aria-sort=\"ascending\""), "{sorted}");
    let rows = &sorted[sorted.find("<tbody>").unwrap()..];
    assert!(rows.find("exact") < rows.find("rays per patch"), "{rows}");
    assert!(dom.contains("<title>exact, tolerance 1e-6: "), "{dom}");
    // The paper's figure is a picture, in the page itself.
    assert!(
        lewis.contains("<img alt=\"Figure 1 of the paper: each entry of I − diag(ρ) F at l = 2"),
        "{lewis}"
    );
    // A page that does complain is heard.
    let broken = directory.path().join("broken.html");
    let with_request = html.replace("<main>", "<main><img src=\"http://127.0.0.1:9/x.png\">");
    std::fs::write(&broken, with_request).unwrap();
    let complained = browser(&profile, &["--dump-dom"], &broken).unwrap();
    assert!(String::from_utf8_lossy(&complained.stderr).contains("CONSOLE"));
}

#[test]
#[expect(clippy::print_stderr, reason = "says that it was skipped")]
fn a_column_sorts_by_all_the_numbers_of_its_cells_and_empty_ones_come_last() {
    let directory = tempfile::tempdir().unwrap();
    let cells = [
        "1 − ρ = 1e-1",
        "–",
        "SG10",
        "1 − ρ = 1e-10",
        "SG5",
        "−2",
        "0.5",
        "F 1-6",
        "F 1-2",
    ];
    let rows = format!("<tr><td>{}</td></tr>", cells.join("</td></tr><tr><td>"));
    let script = include_str!("../../src/report/page.js");
    for (presses, expected) in [
        (1, "−2|0.5|1 − ρ = 1e-10|1 − ρ = 1e-1|F 1-2|F 1-6|SG5|SG10|–"),
        (2, "SG10|SG5|F 1-6|F 1-2|1 − ρ = 1e-1|1 − ρ = 1e-10|0.5|−2|–"),
    ] {
        let press = "document.querySelector('button').click();".repeat(presses);
        let html = format!(
            "<meta charset=\"utf-8\"><table><thead><tr><th><button>a</button></th></tr></thead>\
             <tbody>{rows}</tbody></table><script>{script}{press}</script>"
        );
        let page = directory.path().join("table.html");
        std::fs::write(&page, html).unwrap();
        let Some(opened) = browser(&directory.path().join("profile"), &["--dump-dom"], &page) else {
            eprintln!("skipped: there is no Chromium to sort a table with");
            return;
        };
        let dom = String::from_utf8_lossy(&opened.stdout).into_owned();
        let body = dom.split("</tbody>").next().unwrap_or_default();
        let sorted: Vec<&str> = body
            .split("<td>")
            .skip(1)
            .filter_map(|part| part.split("</td>").next())
            .collect();
        assert_eq!(sorted.join("|"), expected);
    }
}
