//! A table that is written as Markdown for people and as CSV for programs.

use std::fmt::Write as _;

use super::csv::quoted;

/// A table of text: a row of column names, and rows of as many cells.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

/// A value as a cell: an f64 with the fewest digits that read back as the same, and an empty cell for none.
pub(crate) trait Cell {
    fn cell(&self) -> String;
}

macro_rules! cells {
    ($($own:ty: $format:literal),*) => {$(
        impl Cell for $own {
            fn cell(&self) -> String {
                format!($format, self)
            }
        }
    )*};
}

cells!(f64: "{:?}", bool: "{}", char: "{}", u8: "{}", u32: "{}", u64: "{}", usize: "{}", &str: "{}", String: "{}");

impl<T: Cell> Cell for Option<T> {
    fn cell(&self) -> String {
        self.as_ref().map_or_else(String::new, Cell::cell)
    }
}

/// Makes a [`Table`] of rows, each column from its name and its cell.
macro_rules! table {
    ($row:pat in $rows:expr; $($name:literal: $cell:expr),* $(,)?) => {{
        let mut table = $crate::report::Table::new([$($name),*]);
        for $row in $rows {
            table.push([$($crate::report::Cell::cell(&$cell)),*]);
        }
        table
    }};
}
pub(crate) use table;

impl Table {
    /// Returns a table without rows.
    #[must_use]
    pub fn new<'a>(columns: impl IntoIterator<Item = &'a str>) -> Self {
        Self {
            columns: columns.into_iter().map(str::to_owned).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it does not have one cell per column.
    #[track_caller]
    pub fn push(&mut self, cells: impl IntoIterator<Item = String>) {
        let row: Vec<String> = cells.into_iter().collect();
        assert_eq!(row.len(), self.columns.len(), "one cell per column");
        self.rows.push(row);
    }

    /// Returns the table without its last `n` columns.
    pub(crate) fn without_last(mut self, n: usize) -> Self {
        for row in std::iter::once(&mut self.columns).chain(&mut self.rows) {
            row.truncate(row.len() - n);
        }
        self
    }

    /// Returns the table in Markdown (GitHub's dialect), the first column aligned left, the others right.
    ///
    /// Columns are padded to one width so that the source reads as a table too. A vertical bar inside a cell is escaped.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let escaped = |row: &Vec<String>| -> Vec<String> { row.iter().map(|cell| cell.replace('|', "\\|")).collect() };
        let header = escaped(&self.columns);
        let rows: Vec<Vec<String>> = self.rows.iter().map(escaped).collect();
        let width_of = |k: usize| {
            let cells = rows.iter().map(|row| row[k].chars().count());
            cells.fold(header[k].chars().count().max(3), usize::max)
        };
        let widths: Vec<usize> = (0..header.len()).map(width_of).collect();
        let mut text = String::new();
        let mut line = |row: &[String]| {
            for (k, (cell, &width)) in row.iter().zip(&widths).enumerate() {
                // Writing to a String cannot fail.
                let _ = if k == 0 {
                    write!(text, "| {cell:<width$} ")
                } else {
                    write!(text, "| {cell:>width$} ")
                };
            }
            text.push_str("|\n");
        };
        line(&header);
        let rule = |(k, &width): (usize, &usize)| "-".repeat(width - usize::from(k > 0)) + if k > 0 { ":" } else { "" };
        line(&widths.iter().enumerate().map(rule).collect::<Vec<_>>());
        for row in &rows {
            line(row);
        }
        text
    }

    /// Returns the table as CSV with a header line; cells are quoted where necessary (RFC 4180, with line feeds alone).
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::new();
        for row in std::iter::once(&self.columns).chain(&self.rows) {
            let cells: Vec<String> = row.iter().map(|cell| quoted(cell)).collect();
            text.push_str(&cells.join(","));
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_is_aligned_and_csv_is_quoted() {
        let mut table = Table::new(["method", "n"]);
        table.push(["sr, \"x\"".to_owned(), "12".to_owned()]);
        table.push(["a|b".to_owned(), "1234".to_owned()]);
        let markdown = "| method  |    n |\n| ------- | ---: |\n| sr, \"x\" |   12 |\n| a\\|b    | 1234 |\n";
        assert_eq!(table.to_markdown(), markdown);
        assert_eq!(table.to_csv(), "method,n\n\"sr, \"\"x\"\"\",12\na|b,1234\n");
    }
}
