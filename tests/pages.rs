//! The pages of reports in a real browser: skipped, with a word, where there is none.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "support/program.rs"]
mod program;

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

#[test]
#[expect(clippy::print_stderr, reason = "says that it was skipped")]
fn a_page_opens_without_a_complaint() {
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
    program::succeed(directory.path(), &arguments);
    let page = directory.path().join("out/index.html");
    let html = std::fs::read_to_string(&page).unwrap();
    // What a page can ask for stands in such attributes; the name space of SVG is no address that anybody asks.
    for attribute in ["src=\"http", "href=\"http", "url(", "@import", "<script"] {
        assert!(!html.contains(attribute), "{attribute}");
    }
    let profile = directory.path().join("profile");
    let Some(opened) = browser(&profile, &["--dump-dom"], &page) else {
        eprintln!("skipped: there is no Chromium to open the page with");
        return;
    };
    let (dom, log) = (
        String::from_utf8_lossy(&opened.stdout),
        String::from_utf8_lossy(&opened.stderr),
    );
    assert!(!log.contains("CONSOLE"), "{log}");
    assert!(dom.contains("<h1>cube: form-factor methods side by side</h1>"), "{dom}");
    // Two errors as plots; the points of both methods tell their values.
    assert_eq!(dom.matches("<figure>").count(), 2);
    assert!(dom.contains("<title>exact, tolerance 1e-6: "), "{dom}");
    // A page that does complain is heard.
    let broken = directory.path().join("broken.html");
    let with_request = html.replace("<main>", "<main><img src=\"http://127.0.0.1:9/x.png\">");
    std::fs::write(&broken, with_request).unwrap();
    let complained = browser(&profile, &["--dump-dom"], &broken).unwrap();
    assert!(String::from_utf8_lossy(&complained.stderr).contains("CONSOLE"));
}
