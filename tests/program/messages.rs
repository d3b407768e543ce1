//! The length of every text that the library and the program can print: warnings, refusals and result lines.
//!
//! `cargo test --release --test program -- --ignored --nocapture list_messages` lists the longest texts with their numbers of words.

use std::path::{Path, PathBuf};

/// The most words of one text; a placeholder counts as one.
const MAX_WORDS: usize = 30;

/// A text in the source: its file, its line and its words.
struct Message {
    place: String,
    n_words: usize,
    text: String,
}

/// Returns the string literals of a Rust source without those of comments, each with its line.
fn literals(source: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut rest = source;
    let line = |rest: &str| source[..source.len() - rest.len()].matches('\n').count() + 1;
    let mut before = ' ';
    while let Some(c) = rest.chars().next() {
        let is_word = before.is_alphanumeric() || before == '_';
        before = c;
        if rest.starts_with("//") {
            rest = rest.find('\n').map_or("", |end| &rest[end..]);
        } else if let Some(body) = raw_start(rest).filter(|_| !is_word) {
            let (hashes, body) = body;
            let end = body.find(&format!("\"{hashes}")).unwrap();
            found.push((line(rest), body[..end].to_owned()));
            rest = &body[end + 1 + hashes.len()..];
        } else if c == '"' {
            let end = closing_quote(&rest[1..]);
            found.push((line(rest), rest[1..=end].to_owned()));
            rest = &rest[end + 2..];
        } else if let Some(after) = rest.strip_prefix("'\\") {
            rest = &after[after[1..].find('\'').unwrap() + 2..];
        } else if rest.starts_with("'\"'") {
            rest = &rest[3..];
        } else {
            rest = &rest[c.len_utf8()..];
        }
    }
    found
}

/// Returns the hashes of a raw string that begins here, and the text behind its first quote.
fn raw_start(rest: &str) -> Option<(&str, &str)> {
    let after = rest.strip_prefix('r')?;
    let n_hashes = after.len() - after.trim_start_matches('#').len();
    let body = after[n_hashes..].strip_prefix('"')?;
    Some((&after[..n_hashes], body))
}

/// Returns the length of a string up to the quote that closes it.
fn closing_quote(body: &str) -> usize {
    let mut is_escaped = false;
    let end = body.char_indices().find(|&(_, c)| {
        let closes = c == '"' && !is_escaped;
        is_escaped = c == '\\' && !is_escaped;
        closes
    });
    end.unwrap().0
}

/// Returns a text without the line breaks of the source, and with `1` for each placeholder.
fn plain(literal: &str) -> String {
    let mut lines = literal.split("\\\n");
    let mut joined = lines.next().unwrap().to_owned();
    lines.for_each(|line| joined.push_str(line.trim_start()));
    let mut text = String::new();
    let mut depth = 0;
    for c in joined.replace("{{", "(").replace("}}", ")").chars() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => {
                depth -= 1;
                text.push('1');
            }
            c if depth == 0 => text.push(c),
            _ => {}
        }
    }
    text
}

fn n_words(text: &str) -> usize {
    text.split_whitespace()
        .filter(|word| word.contains(char::is_alphanumeric))
        .count()
}

/// Adds the texts of a directory, without those of tests and of the pages of experiments, which are prose.
fn collect(directory: &Path, messages: &mut Vec<Message>) {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap();
        if path.is_dir() {
            if name != "experiment" {
                collect(&path, messages);
            }
        } else if path.extension().is_some_and(|suffix| suffix == "rs") && name != "tests.rs" {
            let source = std::fs::read_to_string(&path).unwrap();
            let source = source.split("\nmod tests {").next().unwrap();
            messages.extend(literals(source).into_iter().map(|(line, literal)| {
                let text = plain(&literal);
                Message {
                    place: format!("{}:{line}", path.display()),
                    n_words: n_words(&text),
                    text,
                }
            }));
        }
    }
}

/// Returns all texts, the longest first.
fn messages() -> Vec<Message> {
    let mut messages = Vec::new();
    collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut messages);
    messages.sort_by_key(|message| std::cmp::Reverse(message.n_words));
    messages
}

#[test]
fn no_message_has_more_than_thirty_words() {
    let messages = messages();
    assert!(messages.len() > 1000, "{}", messages.len());
    let long = messages.iter().filter(|message| message.n_words > MAX_WORDS);
    let long: Vec<String> = long
        .map(|m| format!("{}: {} words: {}", m.place, m.n_words, m.text))
        .collect();
    assert!(long.is_empty(), "{}", long.join("\n"));
}

/// Prints the texts of ten words or more.
#[test]
#[ignore = "it prints a list"]
#[expect(clippy::print_stdout, reason = "the list is what it is for")]
fn list_messages() {
    for message in messages().iter().filter(|message| message.n_words >= 10) {
        println!("{:3} {} {}", message.n_words, message.place, message.text);
    }
}

#[test]
fn words_are_counted_in_literals_alone() {
    let source = "/// \"no\"\nf('\"', '\\'', \"a {b:?} c \\\n   d\", r#\"raw \"q\" x\"#); // \"no\"\n";
    let found: Vec<(usize, String)> = literals(source)
        .into_iter()
        .map(|(line, text)| (line, plain(&text)))
        .collect();
    assert_eq!(found, [(2, "a 1 c d".to_owned()), (3, "raw \"q\" x".to_owned())]);
    assert_eq!(n_words("a 1 - c; d"), 4);
    assert_eq!(closing_quote("a\\\"b\" c"), 4);
}
