//! The pages of reports in a real browser: skipped, with a word, where there is none.

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
    for attribute in ["src=\"http", "href=\"http", "url(", "@import", "<script"] {
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
    assert!(dom.contains("<title>exact, tolerance 1e-6: "), "{dom}");
    // The paper's figure is a picture, in the page itself.
    assert!(
        lewis.contains("<img alt=\"figure-1.png\" src=\"data:image/png;base64,"),
        "{lewis}"
    );
    // A page that does complain is heard.
    let broken = directory.path().join("broken.html");
    let with_request = html.replace("<main>", "<main><img src=\"http://127.0.0.1:9/x.png\">");
    std::fs::write(&broken, with_request).unwrap();
    let complained = browser(&profile, &["--dump-dom"], &broken).unwrap();
    assert!(String::from_utf8_lossy(&complained.stderr).contains("CONSOLE"));
}
