//! Output files, with errors as the user sees them.

use std::io::{self, Write};
use std::path::Path;

use super::failure::Failure;
use crate::whole_file;

/// Writes a file whole or not at all.
pub(super) fn write(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    whole_file::write(path, |writer| content(writer)).map_err(|error| unwritable(path, &error))
}

/// Refuses an output that cannot be written before any work is done for it.
pub(super) fn expect_possible(path: &Path) -> Result<(), Failure> {
    let possible = whole_file::expect_possible(path);
    possible.map(drop).map_err(|error| unwritable(path, &error))
}

fn unwritable(path: &Path, error: &io::Error) -> Failure {
    Failure::new("unwritable", format!("{}: cannot be written: {error}", path.display())).in_file(path)
}

/// Makes a directory for outputs, and those above it, unless it is there.
pub(super) fn make_directory(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|error| {
        Failure::new("unwritable", format!("{}: cannot be made: {error}", path.display())).in_file(path)
    })
}
