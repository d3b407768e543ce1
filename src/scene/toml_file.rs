//! TOML files that describe additions to a scene: read whole, parsed strictly, with the line of every mistake.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use super::lines::{line_after, read_text};
use super::{Origin, SceneError, SceneErrorKind};
use crate::input_file::DESCRIPTION_LIMIT;
use crate::printable::quoted;

/// A TOML file with its text, and the kind of its errors.
pub(crate) struct TomlFile {
    path: PathBuf,
    text: String,
    kind: fn(String) -> SceneErrorKind,
    /// The start and the name of each part of a text that a program made.
    parts: Vec<(usize, PathBuf)>,
}

impl TomlFile {
    /// Reads the text of a file; `kind` makes an error of a message.
    ///
    /// # Errors
    /// A file that cannot be read, is too long or is not UTF-8.
    pub(crate) fn read(path: &Path, kind: fn(String) -> SceneErrorKind) -> Result<Self, SceneError> {
        Ok(Self {
            path: path.to_owned(),
            text: read_text(path, DESCRIPTION_LIMIT)?,
            kind,
            parts: Vec::new(),
        })
    }

    /// Returns a text in memory as if it were read from a file of that name.
    pub(crate) fn of_text(name: PathBuf, text: String, kind: fn(String) -> SceneErrorKind) -> Self {
        Self {
            path: name,
            text,
            kind,
            parts: Vec::new(),
        }
    }

    /// Returns named parts as one text; errors name the part, as the lines are not those of a file.
    pub(crate) fn of_parts(
        name: PathBuf,
        parts: impl IntoIterator<Item = (PathBuf, String)>,
        kind: fn(String) -> SceneErrorKind,
    ) -> Self {
        let mut file = Self::of_text(name, String::new(), kind);
        for (part, text) in parts {
            file.parts.push((file.text.len(), part));
            file.text.push_str(&text);
        }
        file
    }

    /// Parses the text; `what` completes "correct the ...".
    ///
    /// # Errors
    /// An error of the TOML, with its line.
    pub(crate) fn parsed<T: DeserializeOwned>(&self, what: &str) -> Result<T, SceneError> {
        toml::from_str(&self.text).map_err(|error| {
            let message = plain(error.message().trim());
            self.bad(
                error.span().map(|span| span.start),
                format!("{message}; correct the {what}"),
            )
        })
    }

    /// Returns an error about the line, or the part, that contains the byte `start`.
    pub(crate) fn bad(&self, start: impl Into<Option<usize>>, message: String) -> SceneError {
        let start = start.into();
        let part = start.and_then(|start| self.parts.iter().rfind(|(begin, _)| *begin <= start));
        let line = start.map(|start| self.line(start)).filter(|line| *line > 0);
        let path = part.map_or(&self.path, |(_, name)| name);
        SceneError::new(Origin::line(path.clone(), line), (self.kind)(message))
    }

    /// Returns the line that contains the byte `start`, from 1; 0 for a text in parts.
    pub(crate) fn line(&self, start: usize) -> u32 {
        if !self.parts.is_empty() {
            return 0;
        }
        line_after(self.text.get(..start).unwrap_or(&self.text))
    }
}

/// Returns a parser's message as one line, without the names of its own types.
fn plain(message: &str) -> String {
    const WORDS: [(&str, &str); 6] = [
        ("\n", ", "),
        (
            "invalid type: map, expected a sequence",
            "one table where several may stand; write its name in two brackets, as in [[name]]",
        ),
        ("invalid type: sequence", "invalid type: list"),
        ("invalid type: map", "invalid type: table"),
        ("expected a sequence", "expected a list"),
        ("expected f64", "expected a number"),
    ];
    WORDS.iter().fold(message.to_owned(), |message, (words, plain)| {
        message.replace(words, plain)
    })
}

/// Returns the first of many names, formatted for a message.
pub(crate) fn first_names<'a>(names: impl ExactSizeIterator<Item = &'a str>) -> String {
    const SHOWN: usize = 12;
    let n = names.len();
    let mut shown: Vec<String> = names.take(SHOWN).map(quoted).collect();
    if n > SHOWN {
        shown.push(format!("{} more", n - SHOWN));
    }
    shown.join(", ")
}

/// Returns whether a text matches a pattern, in which `*` stands for any text.
pub(crate) fn fits(pattern: &str, text: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| text.strip_prefix(first)) else {
        return false;
    };
    let Some(last) = parts.next_back() else {
        return rest.is_empty();
    };
    for part in parts {
        let Some(at) = rest.find(part) else {
            return false;
        };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::fits;

    #[test]
    fn a_name_fits_exactly_or_by_what_is_beside_the_stars() {
        for (pattern, text, expected) in [
            ("*", "", true),
            ("*", "wall", true),
            ("wall*", "wall", true),
            ("wall*", "wall_1", true),
            ("wall*", "a wall", false),
            ("*wall", "a wall", true),
            ("a*b*c", "aXbYc", true),
            ("a*b*c", "abc", true),
            ("a*b*c", "acb", false),
            ("a*a", "a", false),
            ("a**a", "aa", true),
            ("w*l", "wall", true),
            ("w*ll*l", "wall", false),
            ("a*b*a", "aba", true),
            ("*a*b*", "xbxa", false),
            ("*a*b*", "xaxb", true),
            ("lamp", "lamp", true),
            ("lamp", "lamps", false),
        ] {
            assert_eq!(fits(pattern, text), expected, "{pattern} {text}");
        }
    }
}
