//! The commands of the tutorial and of the README, run as they stand there, and the output that these pages show.

use std::path::Path;

use pulldown_cmark::{CodeBlockKind, Event, Parser, Tag};
use tempfile::TempDir;

use super::{in_repository, read};
use crate::program::succeed;

/// A block of code with its language.
type Block = (String, String);

fn blocks(text: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut is_open = false;
    for event in Parser::new(text) {
        match event {
            Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language))) => {
                blocks.push((language.to_string(), String::new()));
                is_open = true;
            }
            Event::End(_) => is_open = false,
            Event::Text(part) if is_open => blocks.last_mut().unwrap().1.push_str(&part),
            _ => {}
        }
    }
    blocks
}

/// Returns the arguments of each command of the program in a block of shell.
fn commands(shell: &str) -> Vec<Vec<String>> {
    let lines = shell.replace("\\\n", " ");
    let of_program = lines.lines().filter_map(|line| line.strip_prefix("radiosity "));
    let without_comment = of_program.map(|line| line.split('#').next().unwrap());
    without_comment
        .map(|line| line.split_whitespace().map(str::to_owned).collect())
        .collect()
}

/// A directory with the repository's scenes, in which the commands of a page find them where it says.
fn place_with_scenes() -> TempDir {
    let place = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(in_repository("scenes"), place.path().join("scenes")).unwrap();
    place
}

/// Whether two words are the same, numbers to a thousandth, and those of rounding errors at all.
fn is_same(shown: &str, printed: &str) -> bool {
    let number = |word: &str| word.trim_end_matches([',', ':', ';', '%']).parse::<f64>().ok();
    match (number(shown), number(printed)) {
        (Some(a), Some(b)) => (a - b).abs() <= 1e-3 * a.abs() || a.abs().max(b.abs()) < 1e-5,
        _ => shown == printed,
    }
}

fn is_same_line(shown: &str, printed: &str) -> bool {
    let (mut a, mut b) = (shown.split_whitespace(), printed.split_whitespace());
    loop {
        match (a.next(), b.next()) {
            (None, None) => return true,
            (Some(a), Some(b)) if is_same(a, b) => {}
            _ => return false,
        }
    }
}

/// Runs all commands of a page, writes the files that it shows under their name, and holds each shown line against what the command before it printed.
fn run_page(place: &Path, page: &str) -> usize {
    let mut printed = String::new();
    let mut n_commands = 0;
    for (language, code) in blocks(page) {
        match language.as_str() {
            "sh" => {
                for arguments in commands(&code) {
                    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
                    printed = String::from_utf8(succeed(place, &arguments)).unwrap();
                    n_commands += 1;
                }
            }
            "text" => {
                for shown in code.lines().filter(|line| !line.is_empty() && *line != "...") {
                    let is_printed = printed.lines().any(|line| is_same_line(shown, line));
                    assert!(is_printed, "`{shown}` is not in\n{printed}");
                }
            }
            // A file of the page: its first line is a comment with its name.
            "toml" | "csv" => {
                let name = code.lines().next().and_then(|line| line.strip_prefix("# ")).unwrap();
                std::fs::write(place.join(name), &code).unwrap();
            }
            _ => {}
        }
    }
    n_commands
}

#[test]
fn the_tutorial_runs_and_prints_what_it_shows() {
    let place = place_with_scenes();
    assert!(run_page(place.path(), &read("docs/tutorial.md")) > 5);
}

#[test]
fn the_readme_runs_and_prints_what_it_shows() {
    let place = place_with_scenes();
    assert!(run_page(place.path(), &read("README.md")) > 5);
}

#[test]
fn shown_output_is_held_against_the_printed_one() {
    assert!(is_same_line("mean  0.5000 W", "mean 0.50001 W"));
    assert!(is_same_line("error 1.0e-9,", "error 3e-12,"));
    for (shown, printed) in [("mean 0.5", "mean 0.6"), ("mean 0.5", "mean 0.5 W"), ("mean", "means")] {
        assert!(!is_same_line(shown, printed), "{shown}");
    }
    assert_eq!(
        commands("./setup.sh\nradiosity a b # c\nradiosity d \\\n  e\n"),
        [vec!["a", "b"], vec!["d", "e"]]
    );
}
