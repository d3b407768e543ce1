//! What can go wrong with numbers on a disk.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a scratch file could not be written or read. It has no name, so the directory that it lies in stands for it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DiskError {
    /// The file cannot be made or written: most often the disk is full.
    #[error("{}: cannot write the scratch file in it: {reason}; name a directory with more room: --scratch DIR", .directory.display())]
    Unwritable {
        /// The directory.
        directory: PathBuf,
        /// What kind of error it was.
        kind: io::ErrorKind,
        /// What the operating system said.
        reason: String,
    },
    /// The file cannot be read, or ends too soon.
    #[error("{}: cannot read the scratch file in it: {reason}; name another directory: --scratch DIR", .directory.display())]
    Unreadable {
        /// The directory.
        directory: PathBuf,
        /// What kind of error it was.
        kind: io::ErrorKind,
        /// What the operating system said.
        reason: String,
    },
    /// What is read is not what was written.
    #[error("{}: the scratch file in it is damaged: the checksum of tile ({row}, {column}) does not match; name another directory: --scratch DIR", .directory.display())]
    Damaged {
        /// The directory.
        directory: PathBuf,
        /// The row of tiles.
        row: usize,
        /// The column of tiles.
        column: usize,
    },
}

impl DiskError {
    /// Returns the directory of the file.
    #[must_use]
    pub fn directory(&self) -> &Path {
        match self {
            Self::Unwritable { directory, .. }
            | Self::Unreadable { directory, .. }
            | Self::Damaged { directory, .. } => directory,
        }
    }

    pub(super) fn unwritable(directory: &Path, error: &io::Error) -> Self {
        Self::Unwritable {
            directory: directory.to_owned(),
            kind: error.kind(),
            reason: error.to_string(),
        }
    }

    pub(super) fn unreadable(directory: &Path, error: &io::Error) -> Self {
        Self::Unreadable {
            directory: directory.to_owned(),
            kind: error.kind(),
            reason: error.to_string(),
        }
    }
}
