//! Logical lines of an OBJ or MTL file: numbered, joined at continuations, free of comments.

use std::borrow::Cow;
use std::path::Path;

use super::{Origin, SceneError, SceneErrorKind};
use crate::input_file;

/// One statement of a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Statement<'a> {
    /// The number of its first line, from 1.
    pub(super) line: u32,
    /// The first word.
    pub(super) keyword: &'a str,
    /// The text after the first word, without blanks at the ends; a `#` may be part of it.
    pub(super) rest: &'a str,
}

impl<'a> Statement<'a> {
    /// Returns the words after the keyword, up to a comment.
    pub(super) fn words(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        let end = self.rest.find('#').unwrap_or(self.rest.len());
        self.rest[..end].split_whitespace()
    }
}

/// Reads a whole file of at most `limit` bytes as UTF-8.
pub(super) fn read_text(file: &Path, limit: u64) -> Result<String, SceneError> {
    let bytes = input_file::read(file, limit)
        .map_err(|source| SceneError::new(Origin::file(file.to_owned()), SceneErrorKind::Unreadable { source }))?;
    String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        SceneError::new(
            Origin::line(file.to_owned(), line_after(&String::from_utf8_lossy(before))),
            SceneErrorKind::NotUtf8,
        )
    })
}

/// Reads a file as [`read_text`] does, and refuses pipes and devices: the name comes from another file.
pub(super) fn read_named_text(file: &Path, limit: u64) -> Result<String, SceneError> {
    input_file::expect_plain(file)
        .map_err(|source| SceneError::new(Origin::file(file.to_owned()), SceneErrorKind::Unreadable { source }))?;
    read_text(file, limit)
}

/// Calls `visit` with every statement of `text` in turn, until one fails.
///
/// Lines end in LF, CRLF or CR; a byte order mark is skipped; a line that ends in `\` goes on in the next one,
/// unless it is a comment (comments often end in a path or a drawing). A `#` begins a comment at the start of a line,
/// and after numbers ([`Statement::words`]), but not in a name: `Material #25` is one.
pub(super) fn for_each_statement<E>(text: &str, mut visit: impl FnMut(Statement) -> Result<(), E>) -> Result<(), E> {
    let mut rest = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut number = 0_u32;
    while !rest.is_empty() {
        number = number.saturating_add(1);
        let line = number;
        let mut content = Cow::Borrowed(take_line(&mut rest).trim());
        if content.starts_with('#') {
            continue;
        }
        while let Some(begun) = content.strip_suffix('\\') {
            number = number.saturating_add(1);
            content = Cow::Owned(format!("{begun} {}", take_line(&mut rest).trim()).trim().to_owned());
        }
        let (keyword, tail) = content.split_once(char::is_whitespace).unwrap_or((&content, ""));
        if !keyword.is_empty() {
            visit(Statement {
                line,
                keyword,
                rest: tail.trim(),
            })?;
        }
    }
    Ok(())
}

/// Returns the number of the line on which `before` ends, from 1.
pub(super) fn line_after(before: &str) -> u32 {
    let n_breaks = before.matches('\n').count();
    u32::try_from(n_breaks).unwrap_or(u32::MAX).saturating_add(1)
}

fn take_line<'a>(rest: &mut &'a str) -> &'a str {
    let end = rest.find(['\n', '\r']).unwrap_or(rest.len());
    let (line, tail) = rest.split_at(end);
    *rest = tail
        .strip_prefix("\r\n")
        .or_else(|| tail.strip_prefix(['\n', '\r']))
        .unwrap_or(tail);
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &str) -> Vec<(u32, String, String)> {
        let mut all = Vec::new();
        for_each_statement::<()>(text, |s| {
            all.push((s.line, s.keyword.to_owned(), s.words().collect::<Vec<_>>().join(",")));
            Ok(())
        })
        .expect("the visitor never fails");
        all
    }

    fn statement(line: u32, keyword: &str, words: &str) -> (u32, String, String) {
        (line, keyword.to_owned(), words.to_owned())
    }

    #[test]
    fn every_line_end_counts_as_one_line() {
        let expected = vec![statement(1, "v", "1"), statement(3, "v", "2"), statement(4, "f", "1")];
        assert_eq!(statements("v 1\n\nv 2\nf 1"), expected);
        assert_eq!(statements("v 1\r\n\r\nv 2\r\nf 1\r\n"), expected);
        assert_eq!(statements("v 1\r\rv 2\rf 1\r"), expected);
        assert_eq!(statements("\u{feff}v 1\n\n\tv\t2 # two\nf 1#one"), expected);
    }

    #[test]
    fn a_continued_line_has_the_number_of_its_first_line() {
        assert_eq!(
            statements("f 1 \\\n 2\\ \n3\nv 1\n"),
            vec![statement(1, "f", "1,2,3"), statement(4, "v", "1")]
        );
        assert_eq!(statements("f 1 \\"), vec![statement(1, "f", "1")]);
    }

    #[test]
    fn a_comment_does_not_continue() {
        assert_eq!(statements("# C:\\scenes\\\nv 1\n"), vec![statement(2, "v", "1")]);
    }

    #[test]
    fn a_name_keeps_its_number_sign() {
        let mut name = String::new();
        for_each_statement::<()>("usemtl  Material #25 \n", |s| {
            s.rest.clone_into(&mut name);
            Ok(())
        })
        .expect("the visitor never fails");
        assert_eq!(name, "Material #25");
    }
}
