//! The bytes of a scene file, read from any place without holding the whole file in memory.

use std::cell::OnceCell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use super::Counts;
use super::cursor::Cursor;
use super::reader::{HEAD, Head};
use crate::input_file;
use crate::scene::lines::line_after;
use crate::scene::{Origin, SceneError, SceneErrorKind};

/// A function that returns an error unless there is memory for the given number of further bytes.
pub(crate) type Room<'a> = &'a dyn Fn(u64) -> Result<(), SceneErrorKind>;

/// Bytes that are read at once.
pub(super) const WINDOW: usize = 1 << 20;

/// A scene file or a buffer that one names: its start is read at once, the rest on demand.
pub(super) struct Source<'a> {
    pub(super) path: PathBuf,
    room: Room<'a>,
    start: Vec<u8>,
    length: u64,
    /// The file; `None` if it could be read only once.
    file: Option<File>,
    bytes: OnceCell<Vec<u8>>,
    /// Bytes that are read at once.
    pub(super) window: usize,
}

impl<'a> Source<'a> {
    /// Opens a file and reads its start; a pipe is read whole.
    pub(super) fn open(path: &Path, room: Room<'a>) -> Result<Self, SceneError> {
        let refused = |source| SceneError::new(Origin::file(path), SceneErrorKind::Unreadable { source });
        let Some(file) = input_file::open_to_look(path).map_err(refused)? else {
            let all = input_file::read(path, u64::MAX).map_err(refused)?;
            return Ok(Self::of_bytes(path, room, all));
        };
        let mut start = Vec::new();
        let length = file.metadata().map_err(refused)?.len();
        (&file).take(HEAD as u64).read_to_end(&mut start).map_err(refused)?;
        Ok(Self {
            path: path.to_owned(),
            room,
            start,
            length,
            file: Some(file),
            bytes: OnceCell::new(),
            window: WINDOW,
        })
    }

    /// Returns a source of bytes in memory.
    fn of_bytes(path: &Path, room: Room<'a>, all: Vec<u8>) -> Self {
        Self {
            path: path.to_owned(),
            room,
            start: all[..all.len().min(HEAD)].to_vec(),
            length: all.len() as u64,
            file: None,
            bytes: all.into(),
            window: WINDOW,
        }
    }

    /// Opens another file that is read beside this one.
    pub(super) fn beside(&self, path: &Path) -> Result<Self, SceneError> {
        let window = self.window;
        Self::open(path, self.room).map(|own| Self { window, ..own })
    }

    /// Returns a source of decoded bytes.
    pub(super) fn of_part(&self, bytes: Vec<u8>) -> Self {
        let window = self.window;
        Self {
            window,
            ..Self::of_bytes(&self.path, self.room, bytes)
        }
    }

    /// Returns the start of the file, and its length.
    pub(super) fn head(&self) -> Head<'_> {
        Head {
            bytes: &self.start,
            length: self.length,
        }
    }

    /// Returns the whole file, if there is room for it.
    pub(super) fn bytes(&self) -> Result<&[u8], SceneError> {
        if let Some(known) = self.bytes.get() {
            return Ok(known);
        }
        let all = self.part(0, self.length)?;
        Ok(self.bytes.get_or_init(|| all))
    }

    /// Returns up to `n` bytes from a place, if memory suffices; fewer at the end of the file.
    pub(super) fn part(&self, from: u64, n: u64) -> Result<Vec<u8>, SceneError> {
        self.expect_room(n.min(self.length.saturating_sub(from)))?;
        let mut own = Vec::new();
        let read = self.span(from, from.saturating_add(n)).read_to_end(&mut own);
        read.map_err(|error| self.unreadable(error))?;
        Ok(own)
    }

    /// Returns the bytes between two places, within the file's length at its opening.
    pub(super) fn span(&self, from: u64, to: u64) -> Span<'_> {
        let to = to.min(self.length);
        let known = self.bytes.get().map(Vec::as_slice);
        Span {
            file: self.file.as_ref().filter(|_| known.is_none()),
            known: known.unwrap_or_default(),
            at: from.min(to),
            to,
        }
    }

    /// Returns a buffered stream of the bytes between two places.
    pub(super) fn stream(&self, from: u64, to: u64) -> impl BufRead + '_ {
        BufReader::with_capacity(self.window, self.span(from, to))
    }

    /// Begins to read at the start of the file.
    pub(super) fn cursor(&self) -> Cursor<'_> {
        self.cursor_over(0, self.length)
    }

    /// Begins to read between two places; lines are counted from the first place.
    pub(super) fn cursor_over(&self, from: u64, to: u64) -> Cursor<'_> {
        Cursor::new(self, self.span(from, to))
    }

    /// Refuses an allocation beyond the memory limit, before it is made.
    pub(super) fn expect_room(&self, n_bytes: u64) -> Result<(), SceneError> {
        (self.room)(n_bytes).map_err(|kind| self.error(kind))
    }

    /// Refuses a scene of the given numbers of elements, if memory does not suffice.
    pub(super) fn expect(&self, counts: Counts) -> Result<(), SceneError> {
        self.expect_room(counts.bytes())
    }

    /// Returns an error about the file as a whole.
    pub(super) fn error(&self, kind: SceneErrorKind) -> SceneError {
        SceneError::new(Origin::file(&self.path), kind)
    }

    /// Returns the error of a file whose reading failed.
    pub(super) fn unreadable(&self, source: io::Error) -> SceneError {
        self.error(SceneErrorKind::Unreadable { source })
    }

    /// Returns the whole file as text.
    pub(super) fn text(&self) -> Result<&str, SceneError> {
        text_of(&self.path, self.bytes()?)
    }
}

/// Returns bytes as text, or an error with the first line that is not UTF-8.
pub(super) fn text_of<'t>(path: &Path, bytes: &'t [u8]) -> Result<&'t str, SceneError> {
    std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = line_after(&String::from_utf8_lossy(before));
        SceneError::new(Origin::line(path, line), SceneErrorKind::NotUtf8)
    })
}

/// The bytes between two places of a file, read independently of other readers of the file.
pub(super) struct Span<'a> {
    file: Option<&'a File>,
    /// The whole file, if it is in memory.
    known: &'a [u8],
    at: u64,
    to: u64,
}

impl Span<'_> {
    /// Returns how many bytes are left.
    pub(super) fn left(&self) -> u64 {
        self.to - self.at
    }

    /// Skips the given number of bytes.
    pub(super) fn skip(&mut self, n: u64) {
        self.at = self.at.saturating_add(n).min(self.to);
    }
}

impl Read for Span<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = usize::try_from(self.left()).map_or(buffer.len(), |left| left.min(buffer.len()));
        let n = if let Some(mut file) = self.file {
            file.seek(SeekFrom::Start(self.at))?;
            file.read(&mut buffer[..n])?
        } else {
            let from = usize::try_from(self.at).unwrap_or(usize::MAX);
            self.known.get(from..).unwrap_or_default().read(&mut buffer[..n])?
        };
        self.at += n as u64;
        Ok(n)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::super::{Format, LoadOptions};
    use super::*;

    /// Returns the polygons or the error of a file that is read `window` bytes at a time.
    fn outcome(mut source: Source<'_>, window: usize) -> String {
        source.window = window;
        let format = Format::of_start(&source.path, &source.head());
        let polygons = format.read(&source, &LoadOptions::default());
        polygons.map_or_else(|error| error.to_string(), |polygons| format!("{polygons:?}"))
    }

    #[test]
    fn a_file_has_the_same_in_it_however_much_is_read_at_once() {
        let mut n_files = 0;
        for entry in std::fs::read_dir("tests/data/formats").unwrap() {
            let path = entry.unwrap().path();
            let room: Room<'_> = &|_| Ok(());
            let suffix = path.extension().and_then(|suffix| suffix.to_str());
            if !matches!(
                suffix,
                Some("stl" | "ply" | "msh" | "vtk" | "vtu" | "vtp" | "glb" | "gltf")
            ) {
                continue;
            }
            n_files += 1;
            let whole = outcome(Source::open(&path, room).unwrap(), WINDOW);
            assert!(whole.starts_with("Polygons"), "{}: {whole}", path.display());
            for window in [1, 7, 64] {
                let own = outcome(Source::open(&path, room).unwrap(), window);
                assert_eq!(own, whole, "{}, {window} bytes at once", path.display());
            }
            let bytes = std::fs::read(&path).unwrap();
            for n in (0..bytes.len()).step_by(17) {
                let cut = |window| outcome(Source::of_bytes(&path, room, bytes[..n].to_vec()), window);
                assert_eq!(cut(3), cut(WINDOW), "{}, cut after {n} bytes", path.display());
            }
        }
        assert!(n_files > 50, "{n_files}");
    }
}
