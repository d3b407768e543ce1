//! The bytes of a scene file, read as text or as binary numbers, with the place of whatever is wrong.

use std::cell::OnceCell;
use std::fs::File;
use std::io::{BufReader, Read, Seek as _, SeekFrom};
use std::path::Path;
use std::str::FromStr;

use super::Counts;
use super::reader::{HEAD, Head};
use crate::input_file;
use crate::scene::lines::line_after;
use crate::scene::{Origin, SceneError, SceneErrorKind};

/// Returns an error if there is no memory for so many bytes more.
pub(crate) type Room<'a> = &'a dyn Fn(u64) -> Result<(), SceneErrorKind>;

/// Bytes that are read at once where a file is read as a stream.
const BUFFER: usize = 1 << 20;

/// A scene file: its start is read at once, the rest when a reader asks for it.
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    room: Room<'a>,
    start: Vec<u8>,
    length: u64,
    /// `None` of what can be read only once, and has been.
    file: Option<File>,
    bytes: OnceCell<Vec<u8>>,
}

impl<'a> Source<'a> {
    /// Opens a file and reads its start; a pipe is read whole.
    pub(super) fn open(path: &'a Path, room: Room<'a>) -> Result<Self, SceneError> {
        let refused = |source| SceneError::new(Origin::file(path), SceneErrorKind::Unreadable { source });
        let file = input_file::open_to_look(path).map_err(refused)?;
        let mut source = Self {
            path,
            room,
            start: Vec::new(),
            length: 0,
            file: None,
            bytes: OnceCell::new(),
        };
        if let Some(file) = file {
            source.length = file.metadata().map_err(refused)?.len();
            (&file)
                .take(HEAD as u64)
                .read_to_end(&mut source.start)
                .map_err(refused)?;
            source.file = Some(file);
        } else {
            let all = input_file::read(path, u64::MAX).map_err(refused)?;
            source.length = all.len() as u64;
            source.start = all[..all.len().min(HEAD)].to_vec();
            source.bytes = all.into();
        }
        Ok(source)
    }

    /// Returns the start of the file, and how long all is.
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
        self.expect_room(self.length)?;
        let mut all = Vec::new();
        let mut stream = self.stream()?;
        stream
            .read_to_end(&mut all)
            .map_err(|source| self.error(SceneErrorKind::Unreadable { source }))?;
        Ok(self.bytes.get_or_init(|| all))
    }

    /// Returns the bytes of the file one after another, from its start, without the whole of it in memory; none that come after its length when it was opened.
    pub(super) fn stream(&self) -> Result<Box<dyn Read + '_>, SceneError> {
        let (None, Some(mut file)) = (self.bytes.get(), self.file.as_ref()) else {
            let known = self.bytes.get().map_or(&[][..], Vec::as_slice);
            return Ok(Box::new(known));
        };
        let at_start = file.seek(SeekFrom::Start(0));
        at_start.map_err(|source| self.error(SceneErrorKind::Unreadable { source }))?;
        Ok(Box::new(BufReader::with_capacity(BUFFER, file.take(self.length))))
    }

    /// Refuses what would take more memory than there is, before it is made.
    pub(super) fn expect_room(&self, n_bytes: u64) -> Result<(), SceneError> {
        (self.room)(n_bytes).map_err(|kind| self.error(kind))
    }

    /// Refuses a scene of so many things, if there is no memory for it.
    pub(super) fn expect(&self, counts: Counts) -> Result<(), SceneError> {
        self.expect_room(counts.bytes())
    }

    /// Returns an error about the file as a whole.
    pub(super) fn error(&self, kind: SceneErrorKind) -> SceneError {
        SceneError::new(Origin::file(self.path), kind)
    }

    /// Returns the whole file as text.
    pub(super) fn text(&self) -> Result<&str, SceneError> {
        text_of(self.path, self.bytes()?)
    }

    /// Begins to read the whole file.
    pub(super) fn cursor(&self) -> Result<Cursor<'_>, SceneError> {
        Ok(Cursor::of_bytes(self.path, self.bytes()?, true))
    }
}

/// Returns bytes as text, or the line that is none.
pub(super) fn text_of<'t>(path: &Path, bytes: &'t [u8]) -> Result<&'t str, SceneError> {
    std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let line = line_after(&String::from_utf8_lossy(before));
        SceneError::new(Origin::line(path, line), SceneErrorKind::NotUtf8)
    })
}

/// A number as binary files have it.
pub(super) trait Binary: Sized {
    /// Its bytes.
    const BYTES: usize;

    /// Returns the number of so many bytes.
    fn of(bytes: &[u8], is_little: bool) -> Self;
}

macro_rules! binary {
    ($($number:ty),*) => {$(
        impl Binary for $number {
            const BYTES: usize = size_of::<$number>();

            fn of(bytes: &[u8], is_little: bool) -> Self {
                let mut own = [0; size_of::<$number>()];
                own.copy_from_slice(bytes);
                if is_little { Self::from_le_bytes(own) } else { Self::from_be_bytes(own) }
            }
        }
    )*};
}

binary!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

/// A place in a scene file, from which it is read on.
#[derive(Clone)]
pub(super) struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    /// The line of the place, from 1; of no meaning behind binary numbers.
    line: u32,
    /// True if the least byte of a binary number comes first.
    pub(super) is_little: bool,
    /// Bytes of the file that come after these.
    beyond: u64,
}

impl<'a> Cursor<'a> {
    /// Reads on in other bytes of the same file.
    pub(super) fn of_bytes(path: &'a Path, bytes: &'a [u8], is_little: bool) -> Self {
        Self {
            path,
            bytes,
            at: 0,
            line: 1,
            is_little,
            beyond: 0,
        }
    }

    /// Notes how many bytes of the file come after these.
    pub(super) fn before(self, beyond: u64) -> Self {
        Self { beyond, ..self }
    }

    /// Returns how many bytes of the file are left.
    pub(super) fn left(&self) -> u64 {
        self.rest().len() as u64 + self.beyond
    }

    /// Returns the bytes that are left.
    pub(super) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// Returns the file.
    pub(super) fn path(&self) -> &'a Path {
        self.path
    }

    /// Returns the line of the place, from 1.
    pub(super) fn line(&self) -> u32 {
        self.line
    }

    /// Returns an error at the line of the place.
    pub(super) fn error(&self, kind: SceneErrorKind) -> SceneError {
        SceneError::new(Origin::line(self.path, self.line), kind)
    }

    /// Returns an error about a part of a binary file.
    pub(super) fn error_in(&self, element: impl Into<String>, kind: SceneErrorKind) -> SceneError {
        let (path, element) = (self.path.to_owned(), element.into());
        SceneError::new(Origin::Element { path, element }, kind)
    }

    fn step(&mut self, n: usize) -> &'a [u8] {
        let (before, _) = self.rest().split_at(n);
        self.at += n;
        before
    }

    /// Returns the rest of the line, without its end and blanks at both; `None` at the end of the file.
    pub(super) fn next_line(&mut self) -> Result<Option<&'a str>, SceneError> {
        if self.rest().is_empty() {
            return Ok(None);
        }
        let length = self.rest().iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let content = self.step(length.unwrap_or(self.rest().len()));
        let line = self.line;
        if self.rest().starts_with(b"\r\n") {
            self.step(2);
        } else if !self.rest().is_empty() {
            self.step(1);
        }
        self.line = self.line.saturating_add(1);
        let text = std::str::from_utf8(content)
            .map_err(|_| SceneError::new(Origin::line(self.path, line), SceneErrorKind::NotUtf8))?;
        Ok(Some(text.trim()))
    }

    /// Returns the next line that has something in it, and its number.
    pub(super) fn next_full_line(&mut self) -> Result<Option<(u32, &'a str)>, SceneError> {
        loop {
            let line = self.line;
            match self.next_line()? {
                Some("") => {}
                Some(text) => return Ok(Some((line, text))),
                None => return Ok(None),
            }
        }
    }

    fn skip_blanks(&mut self) {
        while let Some(&byte) = self.rest().first() {
            if !byte.is_ascii_whitespace() {
                return;
            }
            self.at += 1;
            let is_end = byte == b'\n' || (byte == b'\r' && self.rest().first() != Some(&b'\n'));
            self.line = self.line.saturating_add(u32::from(is_end));
        }
    }

    /// Returns the next word, on whatever line it stands; a replacement character for what is no text.
    pub(super) fn word(&mut self) -> Option<&'a str> {
        self.skip_blanks();
        let length = self.rest().iter().position(u8::is_ascii_whitespace);
        let word = self.step(length.unwrap_or(self.rest().len()));
        let text = std::str::from_utf8(word).unwrap_or("\u{fffd}");
        (!text.is_empty()).then_some(text)
    }

    /// Returns the next word, which is to be what `expected` says.
    pub(super) fn expect_word(&mut self, expected: &str) -> Result<&'a str, SceneError> {
        self.word()
            .ok_or_else(|| self.malformed(expected, "the end of the file"))
    }

    /// Returns the error that something else was expected than what was found.
    pub(super) fn malformed(&self, expected: &str, found: &str) -> SceneError {
        self.error(SceneErrorKind::malformed(expected, found))
    }

    /// Returns the next word as a number.
    pub(super) fn number<T: FromStr>(&mut self, expected: &str) -> Result<T, SceneError> {
        let word = self.expect_word(expected)?;
        word.parse().map_err(|_| self.malformed(expected, word))
    }

    /// Returns a count that a file states of things that take at least so many bytes each, if there is room for them.
    pub(super) fn count(&self, n: u64, least_bytes: u64, what: &'static str) -> Result<usize, SceneError> {
        let room = self.left() / least_bytes.max(1);
        match usize::try_from(n) {
            Ok(count) if n <= room => Ok(count),
            _ => Err(self.error(SceneErrorKind::Truncated { what, n, room })),
        }
    }

    /// Returns the next bytes.
    pub(super) fn take(&mut self, n: usize, what: &'static str) -> Result<&'a [u8], SceneError> {
        if n > self.rest().len() {
            return Err(SceneError::new(
                Origin::file(self.path),
                SceneErrorKind::CutShort { what },
            ));
        }
        Ok(self.step(n))
    }

    /// Returns the next binary number.
    pub(super) fn binary<T: Binary>(&mut self, what: &'static str) -> Result<T, SceneError> {
        let is_little = self.is_little;
        self.take(T::BYTES, what).map(|bytes| T::of(bytes, is_little))
    }

    /// Goes on behind the line of some text alone, such as `$EndNodes`; false if there is none.
    pub(super) fn skip_past_line(&mut self, text: &str) -> bool {
        loop {
            if self.rest().is_empty() {
                return false;
            }
            let length = self.rest().iter().position(|byte| *byte == b'\n');
            let line = self.step(length.map_or(self.rest().len(), |at| at + 1));
            self.line = self.line.saturating_add(1);
            if line.trim_ascii() == text.as_bytes() {
                return true;
            }
        }
    }
}
