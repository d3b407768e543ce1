//! Form factors in the Matrix Market format (`.mtx`), which SciPy, MATLAB, Julia and most solvers read.
//!
//! Source: Boisvert, Pozo and Remington 1996, "The Matrix Market Exchange Formats". Departures: of what the format can hold, only what
//! [`write()`] writes is read.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use super::description::FileCheck;
use super::file::Hashed;
use super::{Description, ReportError};
use crate::input_file;
use crate::matrix::FormFactors;
use crate::scene::hash::hexadecimal;

/// The first line.
const BANNER: &str = "%%MatrixMarket matrix coordinate real general";

/// The limit of a line's length, which no line written here reaches.
const LINE_LIMIT: u64 = 1 << 16;

/// Writes F as coordinates: a line `i j F_ij` for every entry that is not zero, i and j from 1, row by row.
///
/// The description is in comments, with length and checksum of all that follows. Numbers have the fewest digits that read back
/// as the same f64. The format has no place for errors.
pub(super) fn write(writer: &mut dyn Write, factors: &FormFactors, mut description: Description) -> io::Result<()> {
    let mut n_entries = 0_u64;
    for i in 0..factors.n_rows() {
        factors.for_each_in_row(i, |_, value, _| n_entries += u64::from(value.abs() > 0.0));
    }
    let mut hashed = Hashed::new(io::sink());
    write_entries(&mut io::BufWriter::new(&mut hashed), factors, n_entries)?;
    description.file = Some(hashed.check());
    writeln!(writer, "{BANNER}")?;
    for line in description.to_json().lines() {
        writeln!(writer, "% {line}")?;
    }
    write_entries(writer, factors, n_entries)
}

fn write_entries(writer: &mut dyn Write, factors: &FormFactors, n_entries: u64) -> io::Result<()> {
    let n = factors.n_rows();
    writeln!(writer, "{n} {n} {n_entries}")?;
    for i in 0..n {
        let mut written = Ok(());
        factors.for_each_in_row(i, |j, value, _| {
            if written.is_ok() && value.abs() > 0.0 {
                written = writeln!(writer, "{} {} {value:?}", i + 1, j + 1);
            }
        });
        written?;
    }
    writer.flush()
}

/// The lines of a file, counted and hashed.
struct Lines {
    path: PathBuf,
    reader: BufReader<File>,
    line: String,
    byte: u64,
    hasher: Sha256,
}

impl Lines {
    fn open(path: &Path) -> Result<Self, ReportError> {
        let opened = input_file::open(path).map_err(|source| ReportError::unreadable(path, source))?;
        Ok(Self {
            path: path.to_owned(),
            reader: BufReader::with_capacity(1 << 20, opened),
            line: String::new(),
            byte: 0,
            hasher: Sha256::new(),
        })
    }

    /// Returns the next line without its end, or `None` at the end of the file.
    fn next(&mut self) -> Result<Option<&str>, ReportError> {
        self.line.clear();
        // A file with other content may have no line ends at all.
        let read = io::Read::take(&mut self.reader, LINE_LIMIT).read_line(&mut self.line);
        match read {
            Ok(n) => self.byte += n as u64,
            Err(error) if error.kind() == io::ErrorKind::InvalidData => return Err(self.error("it is no text")),
            Err(source) => return Err(ReportError::unreadable(&self.path, source)),
        }
        self.hasher.update(self.line.as_bytes());
        Ok((!self.line.is_empty()).then(|| self.line.trim_end()))
    }

    fn error(&self, reason: impl Into<String>) -> ReportError {
        ReportError::damaged(&self.path, reason)
    }
}

/// Returns the text of the description in a file, and the lines after it.
fn open(path: &Path) -> Result<(String, Lines), ReportError> {
    let mut lines = Lines::open(path)?;
    if lines.next()? != Some(BANNER) {
        return Err(lines.error(format!("it does not begin with `{BANNER}`")));
    }
    let mut text = String::new();
    // Only comments begin with a percent sign, and looking at the first byte consumes no line.
    while lines.reader.fill_buf().is_ok_and(|bytes| bytes.first() == Some(&b'%')) {
        let line = lines.next()?.unwrap_or_default();
        text.push_str(line.trim_start_matches('%'));
        text.push('\n');
    }
    (lines.byte, lines.hasher) = (0, Sha256::new());
    Ok((text, lines))
}

/// Returns the text of the description in a file.
pub(super) fn description(path: &Path) -> Result<String, ReportError> {
    open(path).map(|(text, _)| text)
}

/// The entries of a file, row by row.
pub(super) struct MtxRows {
    lines: Lines,
    check: FileCheck,
    n: usize,
    n_left: u64,
    /// An entry of a later row that has been read ahead.
    ahead: Option<(usize, usize, f64)>,
}

impl MtxRows {
    /// Opens the rows of an n by n matrix at the first.
    pub(super) fn open(path: &Path, n: usize, check: FileCheck) -> Result<Self, ReportError> {
        let (_, mut lines) = open(path)?;
        let size: Option<Vec<u64>> = lines
            .next()?
            .and_then(|line| line.split(' ').map(|number| number.parse().ok()).collect());
        let n_left = match size.as_deref() {
            Some(&[rows, columns, n_entries]) if [rows, columns] == [n as u64; 2] => n_entries,
            _ => return Err(lines.error(format!("the line of its size is not `{n} {n}` and a number of entries"))),
        };
        Ok(Self {
            lines,
            check,
            n,
            n_left,
            ahead: None,
        })
    }

    /// Replaces `columns` and `values` by the entries of row i, the next one.
    pub(super) fn read_row(
        &mut self,
        i: usize,
        columns: &mut Vec<u64>,
        values: &mut Vec<f64>,
    ) -> Result<(), ReportError> {
        columns.clear();
        values.clear();
        loop {
            if self.ahead.is_none() && self.n_left > 0 {
                self.ahead = Some(self.next_entry()?);
            }
            let Some((row, column, value)) = self.ahead.filter(|entry| entry.0 <= i) else {
                return Ok(());
            };
            if row < i || columns.last().is_some_and(|&last| last >= column as u64) {
                return Err(self.lines.error(format!(
                    "its entries are not in the order of rows and columns in row {}",
                    i + 1
                )));
            }
            columns.push(column as u64);
            values.push(value);
            self.ahead = None;
        }
    }

    fn next_entry(&mut self) -> Result<(usize, usize, f64), ReportError> {
        let n = self.n;
        let parsed = self.lines.next()?.and_then(|line| {
            let mut parts = line.split(' ');
            let row: usize = parts.next()?.parse().ok()?;
            let column: usize = parts.next()?.parse().ok()?;
            let value: f64 = parts.next()?.parse().ok()?;
            let in_matrix = (1..=n).contains(&row) && (1..=n).contains(&column) && parts.next().is_none();
            in_matrix.then(|| (row - 1, column - 1, value))
        });
        self.n_left -= 1;
        parsed.ok_or_else(|| {
            let line: String = self.lines.line.trim_end().chars().take(60).collect();
            self.lines.error(format!(
                "`{line}` is no entry of {n} by {n} form factors, or entries are missing"
            ))
        })
    }

    /// Checks that all entries are read and match length and checksum.
    pub(super) fn finish(mut self) -> Result<(), ReportError> {
        if self.n_left > 0 || self.ahead.is_some() || self.lines.next()?.is_some() {
            return Err(self.lines.error("it does not have as many entries as it says"));
        }
        if self.lines.byte != self.check.byte || hexadecimal(&self.lines.hasher.clone().finalize()) != self.check.sha256
        {
            return Err(self.lines.error("its checksum does not match"));
        }
        Ok(())
    }
}
