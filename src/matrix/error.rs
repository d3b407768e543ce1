//! Errors of form factors, and of the disk that they are on.

use std::path::{Path, PathBuf};
use std::{fmt, io};

use thiserror::Error;

use crate::parameter::{Named, Parameter, plainly};

/// Why form factors were refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum MatrixError {
    /// There is no patch.
    #[error("a form-factor matrix needs at least one patch")]
    Empty,
    /// More patches than 32-bit column numbers can name.
    #[error("{n_rows} patches are more than 32-bit ids can name")]
    TooManyRows {
        /// The number of patches.
        n_rows: usize,
    },
    /// An area that is not a positive, finite number.
    #[error("patch {row} has the area {area} m²; an area is positive and finite")]
    Area {
        /// The patch.
        row: usize,
        /// Its area, m².
        area: f64,
    },
    /// A tile that does not begin where the one before it ended.
    #[error("a tile begins at row {found}, but row {expected} is next")]
    TileOrder {
        /// The row that is next.
        expected: usize,
        /// The tile's first row.
        found: usize,
    },
    /// Tiles that do not cover all rows, or more than all.
    #[error("the tiles hold {found} rows for {expected} patches")]
    RowCount {
        /// The number of patches.
        expected: usize,
        /// The number of rows in the tiles.
        found: usize,
    },
    /// A column number that names no patch.
    #[error("row {row} has a form factor to patch {column}, but there are only {n_rows} patches")]
    Column {
        /// The row.
        row: usize,
        /// The column.
        column: u32,
        /// The number of patches.
        n_rows: usize,
    },
    /// An entry below the diagonal where the upper triangle alone is asked for.
    #[error(
        "row {row} has an exchange area with patch {column}, which belongs to row {column}: only the upper triangle is given"
    )]
    BelowDiagonal {
        /// The row.
        row: usize,
        /// The column.
        column: u32,
    },
    /// A form factor or standard error that is not finite, also in the precision asked for; or a negative standard error.
    #[error("the form factor from patch {row} to patch {column} or its standard error is not a usable number")]
    Value {
        /// The row.
        row: usize,
        /// The column.
        column: u32,
    },
    /// A form factor below 0 in a file; a method's own rounding is accepted.
    #[error("the form factor from patch {row} to patch {column} is {value:e}; a form factor is at least 0")]
    Negative {
        /// The row.
        row: usize,
        /// The column.
        column: u32,
        /// The form factor.
        value: f64,
    },
    /// A target of a row sum that is negative, infinite or not a number.
    #[error("the row sum asked for at patch {row} is {target}; it must be finite and not negative")]
    Target {
        /// The row.
        row: usize,
        /// The request.
        target: f64,
    },
    /// Form factors to be balanced are not symmetric as exchange areas.
    #[error("only symmetric exchange areas can be balanced: symmetrise the form factors first")]
    NotSymmetric,
    /// Form factors on a disk could not be written or read.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

impl MatrixError {
    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        match self {
            Self::Disk(error) => error.text(named),
            other => other.to_string(),
        }
    }
}

/// Why a scratch file could not be written or read; the file has no name, so that its directory is reported.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DiskError {
    /// The file cannot be made or written: most often the disk is full.
    Unwritable {
        /// The directory.
        directory: PathBuf,
        /// The kind of the error.
        kind: io::ErrorKind,
        /// The operating system's message.
        reason: String,
    },
    /// The file cannot be read, or ends too soon.
    Unreadable {
        /// The directory.
        directory: PathBuf,
        /// The kind of the error.
        kind: io::ErrorKind,
        /// The operating system's message.
        reason: String,
    },
    /// The data read differ from the data written.
    Damaged {
        /// The directory.
        directory: PathBuf,
        /// The row of tiles.
        row: usize,
        /// The column of tiles.
        column: usize,
    },
}

impl std::error::Error for DiskError {}

impl fmt::Display for DiskError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(&plainly))
    }
}

impl DiskError {
    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        let (directory, scratch) = (self.directory().display(), named(Parameter::Scratch, Some("DIR")));
        match self {
            Self::Unwritable { reason, .. } => format!(
                "{directory}: cannot write the scratch file in it: {reason}; name a directory with more room: {scratch}"
            ),
            Self::Unreadable { reason, .. } => {
                format!("{directory}: cannot read the scratch file in it: {reason}; name another directory: {scratch}")
            }
            Self::Damaged { row, column, .. } => format!(
                "{directory}: the scratch file in it is damaged: the checksum of tile ({row}, {column}) does not match; name another directory: {scratch}"
            ),
        }
    }

    /// Returns the directory of the file.
    #[must_use]
    pub fn directory(&self) -> &Path {
        match self {
            Self::Unwritable { directory, .. }
            | Self::Unreadable { directory, .. }
            | Self::Damaged { directory, .. } => directory,
        }
    }

    pub(in crate::matrix) fn unwritable(directory: &Path, error: &io::Error) -> Self {
        Self::Unwritable {
            directory: directory.to_owned(),
            kind: error.kind(),
            reason: error.to_string(),
        }
    }

    pub(in crate::matrix) fn unreadable(directory: &Path, error: &io::Error) -> Self {
        Self::Unreadable {
            directory: directory.to_owned(),
            kind: error.kind(),
            reason: error.to_string(),
        }
    }
}
