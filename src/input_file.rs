//! Opens files to read, and refuses directories, devices and files beyond a limit.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

/// The greatest size of a description, in bytes: a TOML file, a material library, the JSON of form factors.
pub(crate) const DESCRIPTION_LIMIT: u64 = 64 << 20;

/// Opens a file to read.
///
/// # Errors
/// Errors of the file system, with their remedy; a directory; a device, which may be endless.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let file = File::open(path).map_err(|error| told(&error))?;
    let found = file.metadata().map_err(|error| told(&error))?;
    if found.is_dir() {
        return Err(told(&io::ErrorKind::IsADirectory.into()));
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let kind = found.file_type();
        if kind.is_char_device() || kind.is_block_device() {
            let reason = "is a device, which may have no end; name a file";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, reason));
        }
    }
    Ok(file)
}

/// Refuses everything but a plain file, before it is opened: a pipe without a writer would block.
///
/// It is for files that are named by a scene, a list of frames or another file, not by the user.
///
/// # Errors
/// Errors of the file system, with their remedy; anything but a plain file.
pub(crate) fn expect_plain(path: &Path) -> io::Result<()> {
    let found = std::fs::metadata(path).map_err(|error| told(&error))?;
    if found.is_file() {
        return Ok(());
    }
    if found.is_dir() {
        return Err(told(&io::ErrorKind::IsADirectory.into()));
    }
    let reason = "is a pipe, a socket or a device; name a plain file";
    Err(io::Error::new(io::ErrorKind::InvalidInput, reason))
}

/// Opens a file to inspect before it is read; `None` unless it is a plain file.
///
/// A pipe is left to its reader: its bytes come only once, and closing it ends its writer.
///
/// # Errors
/// Errors of the file system, with their remedy.
pub(crate) fn open_to_look(path: &Path) -> io::Result<Option<File>> {
    let found = std::fs::metadata(path).map_err(|error| told(&error))?;
    if found.is_file() {
        open(path).map(Some)
    } else {
        Ok(None)
    }
}

/// Reads a whole file of at most `limit` bytes.
///
/// # Errors
/// Errors of [`open`] and of the file system; a longer file.
pub(crate) fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let too_long = || {
        let reason = format!("has more than {limit} bytes, the most for a file of this kind; name another file");
        io::Error::new(io::ErrorKind::InvalidData, reason)
    };
    if file.metadata().map_err(|error| told(&error))?.len() > limit {
        return Err(too_long());
    }
    // A pipe has no length, and a file can grow.
    let mut bytes = Vec::new();
    file.take(limit.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(|error| told(&error))?;
    if bytes.len() as u64 > limit {
        return Err(too_long());
    }
    Ok(bytes)
}

/// Returns an error of the system with its remedy.
fn told(error: &io::Error) -> io::Error {
    let kind = error.kind();
    let reason = match kind {
        io::ErrorKind::NotFound => "no such file; check the path",
        io::ErrorKind::IsADirectory => "is a directory; name the file in it",
        io::ErrorKind::PermissionDenied => "permission denied; make the file readable",
        _ => &format!("cannot be read: {error}"),
    };
    io::Error::new(kind, reason)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_or_too_long_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("f");
        std::fs::write(&file, "12345").unwrap();
        assert_eq!(read(&file, 5).unwrap(), b"12345");
        let refused = |path: &Path, limit| read(path, limit).unwrap_err().to_string();
        assert!(refused(&file, 4).starts_with("has more than 4 bytes"));
        assert_eq!(refused(directory.path(), 5), "is a directory; name the file in it");
        assert_eq!(refused(&file.with_extension("no"), 5), "no such file; check the path");
        #[cfg(unix)]
        assert!(refused(Path::new("/dev/zero"), u64::MAX).starts_with("is a device"));
        assert!(open_to_look(&file).unwrap().is_some());
        let not_plain = |path: &Path| expect_plain(path).unwrap_err().to_string();
        assert!(expect_plain(&file).is_ok());
        assert_eq!(not_plain(directory.path()), "is a directory; name the file in it");
        assert_eq!(not_plain(&file.with_extension("no")), "no such file; check the path");
        #[cfg(unix)]
        assert_eq!(
            not_plain(Path::new("/dev/zero")),
            "is a pipe, a socket or a device; name a plain file"
        );
        #[cfg(unix)]
        assert!(open_to_look(Path::new("/dev/zero")).unwrap().is_none());
    }
}
