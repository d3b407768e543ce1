//! Errors of writing reports, and of reading form factors and tables.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::matrix::{DiskError, MatrixError};
use crate::parameter::{Named, Parameter};
use crate::printable::{printable_message, quoted};

/// A reason why a report could not be written, or a file not be read.
#[derive(Debug, Error, strum::IntoStaticStr)]
#[strum(serialize_all = "snake_case")]
#[non_exhaustive]
pub enum ReportError {
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}", .path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The operating system's message.
        source: io::Error,
    },
    /// The file cannot be read.
    #[error("{}: {source}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's message.
        source: io::Error,
    },
    /// A table that cannot be understood.
    #[error("{}:{line}: {}", .path.display(), printable_message(.reason))]
    BadTable {
        /// The file.
        path: PathBuf,
        /// The kind of the error, see [`kind`](Self::kind).
        kind: &'static str,
        /// The line, from 1.
        line: usize,
        /// The fault, and the remedy.
        reason: String,
    },
    /// A setting of a table that is out of its range, or does not fit its rows.
    #[error("{}: {reason}", .parameter.name())]
    BadSetting {
        /// The file of the table.
        path: PathBuf,
        /// The setting.
        parameter: Parameter,
        /// The fault, and the remedy.
        reason: String,
    },
    /// An array of a wrong shape, or with wrong values.
    #[error("{}: {}", .path.display(), printable_message(.reason))]
    BadArray {
        /// The file.
        path: PathBuf,
        /// The fault, and the remedy.
        reason: String,
    },
    /// The ending of the name is that of no format for this content.
    #[error("{}: the ending names no format for {content}; use one of {known}", .path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The content to be written or read.
        content: &'static str,
        /// The supported endings.
        known: String,
    },
    /// The file has no description: another program wrote it, or the description beside it is missing.
    #[error("{}: {what} is missing, so the file cannot be matched with a scene; write it with `radiosity form-factors`", .path.display())]
    NoDescription {
        /// The file.
        path: PathBuf,
        /// The part of the file, or the file beside it, that is missing.
        what: String,
    },
    /// The layout of the file is newer than this program.
    #[error("{}: holds \"{}\", and this program reads \"{expected}\"", .path.display(), quoted(.found))]
    Version {
        /// The file.
        path: PathBuf,
        /// The version in the file.
        found: String,
        /// The supported version.
        expected: &'static str,
    },
    /// The file is cut off, changed, or contradicts itself.
    #[error("{}: damaged: {}; write it again with `radiosity form-factors`", .path.display(), printable_message(.reason))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The fault.
        reason: String,
    },
    /// The form factors belong to other patches than the given ones.
    #[error("{}: holds form factors of another geometry; compute them for this scene with `radiosity form-factors`", .path.display())]
    OtherGeometry {
        /// The file.
        path: PathBuf,
    },
    /// The form factors are on a disk, and could not be read or written there.
    #[error("{}: {source}", .path.display())]
    Scratch {
        /// The file to be written or read.
        path: PathBuf,
        /// The error of the scratch file.
        source: DiskError,
    },
    /// The numbers are not form factors.
    #[error("{}: {source}; write it again with `radiosity form-factors`", .path.display())]
    #[strum(serialize = "damaged")]
    Matrix {
        /// The file.
        path: PathBuf,
        /// The error in them.
        source: MatrixError,
    },
}

impl ReportError {
    pub(super) fn unwritable(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        Self::Unwritable { path, source }
    }

    pub(super) fn unreadable(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        Self::Unreadable { path, source }
    }

    pub(super) fn damaged(path: &Path, reason: impl Into<String>) -> Self {
        let (path, reason) = (path.to_owned(), reason.into());
        Self::Damaged { path, reason }
    }

    /// Returns the error as one line, with parameters as `named` writes them.
    #[must_use]
    pub fn text(&self, named: Named<'_>) -> String {
        match self {
            Self::Scratch { path, source } => format!("{}: {}", path.display(), source.text(named)),
            Self::BadSetting { parameter, reason, .. } => format!("{}: {reason}", named(*parameter, None)),
            other => other.to_string(),
        }
    }

    /// Returns the file at fault.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Unwritable { path, .. }
            | Self::Unreadable { path, .. }
            | Self::BadTable { path, .. }
            | Self::BadSetting { path, .. }
            | Self::BadArray { path, .. }
            | Self::UnknownFormat { path, .. }
            | Self::NoDescription { path, .. }
            | Self::Version { path, .. }
            | Self::Damaged { path, .. }
            | Self::OtherGeometry { path }
            | Self::Scratch { path, .. }
            | Self::Matrix { path, .. } => path,
        }
    }

    /// Returns a stable name of the kind, in snake case.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::BadTable { kind, .. } => kind,
            _ => self.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_file_says_stays_on_one_line() {
        let path = PathBuf::from("F.mtx");
        let version = ReportError::Version {
            path: path.clone(),
            found: "radiosity\nform factors 9".into(),
            expected: "radiosity form factors 2",
        };
        let text =
            "F.mtx: holds \"radiosity\u{fffd}form factors 9\", and this program reads \"radiosity form factors 2\"";
        assert_eq!(version.to_string(), text);
        let reason = "unknown field `a\nb`".into();
        let damaged = ReportError::Damaged { path, reason }.to_string();
        assert!(damaged.contains("`a\u{fffd}b`; write it again"), "{damaged}");
    }
}
