//! Files are written whole or not at all.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::failure::Failure;

/// Writes a file under a temporary name in the same directory, and gives it its own name when all is written.
///
/// An existing file stays as it is until a complete new one replaces it.
pub(super) fn write(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), Failure> {
    let directory = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let attempt = || -> io::Result<()> {
        let mut file = tempfile::NamedTempFile::new_in(directory)?;
        let mut writer = BufWriter::new(file.as_file_mut());
        content(&mut writer)?;
        writer.flush()?;
        drop(writer);
        file.persist(path)?;
        Ok(())
    };
    attempt().map_err(|error| {
        Failure::new("unwritable", format!("{}: cannot be written: {error}", path.display())).in_file(path)
    })
}

/// Refuses an output that cannot be written before any work is done for it.
pub(super) fn expect_possible(path: &Path) -> Result<(), Failure> {
    let directory = path
        .parent()
        .filter(|p| !p.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let problem = if path.is_dir() {
        "is a directory; name a file"
    } else if !directory.is_dir() {
        "its directory does not exist; make it first"
    } else {
        return Ok(());
    };
    Err(Failure::new(
        "unwritable",
        format!("{}: cannot be written: {problem}", path.display()),
    )
    .in_file(path))
}

/// Makes a directory for outputs, and those above it, unless it is there.
pub(super) fn make_directory(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|error| {
        Failure::new("unwritable", format!("{}: cannot be made: {error}", path.display())).in_file(path)
    })
}
