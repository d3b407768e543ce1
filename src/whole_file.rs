//! Writes files atomically.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempPath;

/// Writes a file under a temporary name in its own directory, and renames it once all of it is on the disk.
///
/// `content` writes the bytes; it may seek. An existing file stays as it is until then, and on any failure the temporary
/// file is removed. A symbolic link stays, and the file to which it points is replaced. The permissions are those of any new
/// file, within the umask.
///
/// # Errors
/// Those of `content` and of the file system; `path` names something that is not a regular file, such as a directory or a device.
pub(crate) fn write(path: &Path, content: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>) -> io::Result<()> {
    prepare(path, content)?.put()
}

/// True if another rank writes all files.
static LEFT: AtomicBool = AtomicBool::new(false);

/// Makes this process write no more files: the first rank writes those of all.
#[cfg(feature = "cli")]
pub(crate) fn leave_to_first_rank() {
    LEFT.store(true, Ordering::Relaxed);
}

fn is_left() -> bool {
    LEFT.load(Ordering::Relaxed)
}

/// The temporary files that this process is writing.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes all temporary files, for an end of the process without destructors.
#[cfg(feature = "cli")]
pub(crate) fn abandon() {
    for path in unfinished().drain(..) {
        // A file that has just been renamed no longer has this name.
        let _ = std::fs::remove_file(path);
    }
}

/// A temporary file that is listed until this is dropped.
struct Listed(PathBuf);

impl Listed {
    fn new(path: &Path) -> Self {
        unfinished().push(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        unfinished().retain(|path| *path != self.0);
    }
}

/// A complete file on the disk, under a temporary name in its directory; it is removed unless it is [`put`](Self::put).
pub(crate) struct Prepared {
    /// The file; `None` if the first rank writes it.
    written: Option<(TempPath, Listed)>,
    target: PathBuf,
}

impl Prepared {
    /// Renames the file to its target.
    pub(crate) fn put(self) -> io::Result<()> {
        let Some((temporary, _listed)) = self.written else {
            return Ok(());
        };
        temporary.persist(&self.target)?;
        #[cfg(unix)]
        File::open(directory_of(&self.target))?.sync_all()?;
        Ok(())
    }
}

/// Waits for the lock under which processes put files that belong together into this directory; it is held until the result is dropped.
///
/// Returns `None` without waiting if the file system has no locks.
pub(crate) fn turn(directory: &Path) -> Option<File> {
    let opened = File::open(directory).ok()?;
    opened.lock().ok()?;
    Some(opened)
}

/// Writes a file as [`write`] does, without its final name, which [`Prepared::put`] gives: files that belong together appear together, or none does.
///
/// # Errors
/// As [`write`].
pub(crate) fn prepare(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> io::Result<Prepared> {
    let target = expect_possible(path)?;
    if is_left() {
        let written = None;
        return Ok(Prepared { written, target });
    }
    let directory = directory_of(&target);
    let written = if let Some(mut file) = unnamed_file(directory) {
        fill(&mut file, content)?;
        named(&file, directory)?
    } else {
        let mut temporary = builder().tempfile_in(directory)?;
        let listed = Listed::new(temporary.path());
        fill(temporary.as_file_mut(), content)?;
        (temporary.into_temp_path(), listed)
    };
    Ok(Prepared {
        written: Some(written),
        target,
    })
}

/// Writes all of a file to the disk.
fn fill(file: &mut File, content: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>) -> io::Result<()> {
    let mut writer = BufWriter::new(&mut *file);
    content(&mut writer)?;
    writer.flush()?;
    drop(writer);
    // Without this, a crash soon after the rename may leave an empty file under the new name.
    file.sync_all()
}

/// Returns the builder of temporary files.
fn builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // A temporary file is private by default; the umask removes the permissions that the user does not want.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.prefix(".radiosity-");
    builder
}

/// The directory of the files that a process has open, by their numbers.
#[cfg(target_os = "linux")]
const OPEN_FILES: &str = "/proc/self/fd";

/// Makes a file without a name, of which nothing remains if the process is killed; `None` if the file system has no such files.
#[cfg(target_os = "linux")]
fn unnamed_file(directory: &Path) -> Option<File> {
    use rustix::fs::{Mode, OFlags, open};
    let flags = OFlags::TMPFILE | OFlags::RDWR | OFlags::CLOEXEC;
    let opened = open(directory, flags, Mode::from_raw_mode(0o666)).ok()?;
    Path::new(OPEN_FILES).is_dir().then(|| opened.into())
}

#[cfg(not(target_os = "linux"))]
fn unnamed_file(_directory: &Path) -> Option<File> {
    None
}

/// Gives an unnamed file a temporary name.
#[cfg(target_os = "linux")]
fn named(file: &File, directory: &Path) -> io::Result<(TempPath, Listed)> {
    use std::os::fd::AsRawFd as _;

    use rustix::fs::{AtFlags, CWD, linkat};
    let from = Path::new(OPEN_FILES).join(file.as_raw_fd().to_string());
    let linked = builder().make_in(directory, |path| {
        linkat(CWD, &from, CWD, path, AtFlags::SYMLINK_FOLLOW).map_err(Into::into)
    })?;
    let listed = Listed::new(linked.path());
    Ok((linked.into_temp_path(), listed))
}

#[cfg(not(target_os = "linux"))]
fn named(_file: &File, _directory: &Path) -> io::Result<(TempPath, Listed)> {
    Err(io::ErrorKind::Unsupported.into())
}

/// Returns the file that `path` names for writing, with links resolved.
///
/// # Errors
/// The directory does not exist, or `path` names something that is not a regular file.
pub(crate) fn expect_possible(path: &Path) -> io::Result<PathBuf> {
    if is_left() {
        return Ok(path.to_owned());
    }
    let target = match path.canonicalize() {
        Ok(target) => target,
        // The path is new, or a link to nothing, which the new file replaces.
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    let refuse = |kind, reason| Err(io::Error::new(kind, reason));
    match target.metadata() {
        Ok(found) if found.is_dir() => refuse(io::ErrorKind::IsADirectory, "it is a directory; name a file"),
        Ok(found) if !found.is_file() => refuse(io::ErrorKind::InvalidInput, "it is not a regular file; name a file"),
        _ if target.file_name().is_none() => refuse(io::ErrorKind::InvalidInput, "it names no file; name one"),
        _ if !directory_of(&target).is_dir() => {
            refuse(io::ErrorKind::NotFound, "its directory does not exist; make it first")
        }
        _ => Ok(target),
    }
}

/// Returns the directory in which a file is.
pub(crate) fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(directory) if !directory.as_os_str().is_empty() => directory,
        _ => Path::new("."),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use std::io::Seek as _;

    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(directory).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        for text in ["a longer first text", "second"] {
            write(&path, |w| {
                w.write_all(text.as_bytes())?;
                w.rewind()?;
                w.write_all(b"S")
            })
            .unwrap();
            assert_eq!(std::fs::read_to_string(&path).unwrap(), format!("S{}", &text[1..]));
        }
        assert_eq!(names(directory.path()), ["a.txt"]);
    }

    #[test]
    fn a_failure_leaves_the_old_file_and_no_other() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        std::fs::write(&path, "old").unwrap();
        let result = write(&path, |w| {
            w.write_all(b"new")?;
            Err(io::Error::other("no more"))
        });
        assert_eq!(result.unwrap_err().to_string(), "no more");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(directory.path()), ["a.txt"]);
    }

    #[test]
    fn what_is_no_place_for_a_file_is_refused() {
        let directory = tempfile::tempdir().unwrap();
        let refused = |path: &Path| write(path, |_| Ok(())).unwrap_err();
        assert_eq!(refused(directory.path()).kind(), io::ErrorKind::IsADirectory);
        let nowhere = directory.path().join("no/such/a.txt");
        assert!(refused(&nowhere).to_string().contains("does not exist"));
        assert!(names(directory.path()).is_empty());
    }

    #[cfg(unix)]
    #[test]
    fn devices_stay_and_links_are_followed() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let refused = write(Path::new("/dev/null"), |_| Ok(())).unwrap_err();
        assert!(refused.to_string().contains("not a regular file"));

        let directory = tempfile::tempdir().unwrap();
        let (real, link) = (directory.path().join("real"), directory.path().join("link"));
        std::fs::write(&real, "old").unwrap();
        symlink(&real, &link).unwrap();
        write(&link, |w| w.write_all(b"new")).unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read_to_string(&real).unwrap(), "new");

        // The permissions equal those of an ordinary file.
        let ordinary = directory.path().join("ordinary");
        std::fs::write(&ordinary, "").unwrap();
        let mode = |path: &Path| path.metadata().unwrap().permissions().mode();
        assert_eq!(mode(&real), mode(&ordinary));
    }
}
