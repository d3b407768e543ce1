//! Reads tables that users write: a line of names, then one line per row, separated by commas.
//!
//! Lines that begin with `#` and unused columns are ignored.

use std::path::{Path, PathBuf};

use super::ReportError;
use crate::input_file;
use crate::printable::quoted;

/// The greatest size of a table, in bytes.
const LIMIT: u64 = 1 << 30;

/// The text of a table.
pub(super) struct TextFile {
    path: PathBuf,
    /// The [`ReportError::kind`] of its errors.
    kind: &'static str,
    text: String,
}

/// The rows of a table.
pub(super) struct Table<'a> {
    file: &'a TextFile,
    names: Vec<&'a str>,
    head_line: usize,
    rows: Vec<(usize, &'a str)>,
}

/// One row of a table.
pub(super) struct Row<'a> {
    table: &'a Table<'a>,
    /// The index of the line, from 0.
    line: usize,
    cells: Vec<&'a str>,
}

impl TextFile {
    /// Reads a table.
    ///
    /// # Errors
    /// [`ReportError::Unreadable`], and [`ReportError::BadTable`] for bytes that are not text.
    pub(super) fn read(path: &Path, kind: &'static str) -> Result<Self, ReportError> {
        let bytes = input_file::read(path, LIMIT).map_err(|source| ReportError::unreadable(path, source))?;
        let decoded = String::from_utf8(bytes);
        let file = |text| Self {
            path: path.to_owned(),
            kind,
            text,
        };
        decoded
            .map(file)
            .map_err(|_| file(String::new()).bad(0, "not UTF-8 text; convert the file to UTF-8".into()))
    }

    /// Returns the rows; `first` is the expected start of the line of names.
    pub(super) fn table(&self, first: &str) -> Result<Table<'_>, ReportError> {
        let text = self.text.trim_start_matches('\u{feff}');
        let mut lines = text.lines().enumerate().filter(|(_, line)| {
            let line = line.trim();
            !line.is_empty() && !line.starts_with('#')
        });
        let (head_line, head) = lines
            .next()
            .ok_or_else(|| self.bad(0, format!("no line of names; begin with {first}")))?;
        let names: Vec<&str> = head.split(',').map(|name| name.trim().trim_matches('"')).collect();
        let is_again = |(k, name): &(usize, &&str)| names[..*k].iter().any(|own| own.eq_ignore_ascii_case(name));
        let again = names
            .iter()
            .enumerate()
            .filter(|(_, name)| !name.is_empty())
            .find(is_again);
        if let Some((_, name)) = again {
            let wrong = format!("two columns are called `{}`; rename one", quoted(name));
            return Err(self.bad(head_line, wrong));
        }
        Ok(Table {
            file: self,
            names,
            head_line,
            rows: lines.collect(),
        })
    }

    fn bad(&self, line: usize, reason: String) -> ReportError {
        ReportError::BadTable {
            path: self.path.clone(),
            kind: self.kind,
            line: line + 1,
            reason,
        }
    }
}

impl Table<'_> {
    /// Returns the indices of columns, ignoring case.
    pub(super) fn find<const N: usize>(&self, wanted: [&str; N]) -> [Option<usize>; N] {
        wanted.map(|name| self.names.iter().position(|own| own.eq_ignore_ascii_case(name)))
    }

    /// Returns the rows.
    pub(super) fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|&(line, text)| Row {
            table: self,
            line,
            cells: text.split(',').map(|cell| cell.trim().trim_matches('"')).collect(),
        })
    }

    /// Returns the error of a line of names.
    pub(super) fn bad_head(&self, reason: &str) -> ReportError {
        self.file.bad(self.head_line, reason.into())
    }
}

impl Row<'_> {
    /// Returns the line, from 1.
    pub(super) fn line(&self) -> usize {
        self.line + 1
    }

    /// Returns a cell, empty if the row ends before it.
    pub(super) fn text(&self, column: usize) -> &str {
        self.cells.get(column).copied().unwrap_or_default()
    }

    /// Returns the finite numbers in some cells.
    pub(super) fn numbers<const N: usize>(&self, columns: [usize; N]) -> Result<[f64; N], ReportError> {
        // A name with a comma would shift the following cells.
        let n_named = self.table.names.len();
        if self.cells.iter().skip(n_named).any(|cell| !cell.is_empty()) {
            let wrong = "cells, but the line of names has";
            return Err(self.bad(format!(
                "{} {wrong} {n_named}; take out commas inside of cells",
                self.cells.len()
            )));
        }
        let mut found = [0.0; N];
        for (value, column) in found.iter_mut().zip(columns) {
            let cell = self.text(column);
            let number = cell.parse().ok().filter(|number: &f64| number.is_finite());
            *value = number.ok_or_else(|| {
                let name = quoted(self.table.names[column]);
                self.bad(format!(
                    "`{}` in column `{name}` is no finite number; correct it",
                    quoted(cell)
                ))
            })?;
        }
        Ok(found)
    }

    /// Returns the error of a row.
    pub(super) fn bad(&self, reason: String) -> ReportError {
        self.table.file.bad(self.line, reason)
    }
}
