//! Reads text and binary numbers from a scene file, and reports errors with their place.

use std::io::Read as _;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;

use super::scalar::Binary;
use super::source::{Source, Span};
use crate::scene::{Origin, SceneError, SceneErrorKind};

/// A place in a scene file: a window of the file in memory, and the unread rest.
pub(super) struct Cursor<'a> {
    source: &'a Source<'a>,
    behind: Span<'a>,
    window: Vec<u8>,
    /// The place in the window.
    at: usize,
    /// The last word or line, in the window.
    last: Range<usize>,
    /// The line of the place, from 1; meaningless after binary numbers.
    line: u32,
    /// True if the least byte of a binary number comes first.
    pub(super) is_little: bool,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(source: &'a Source<'a>, behind: Span<'a>) -> Self {
        Self {
            source,
            behind,
            window: Vec::new(),
            at: 0,
            last: 0..0,
            line: 1,
            is_little: true,
        }
    }

    /// Returns how many bytes of the file are left.
    pub(super) fn left(&self) -> u64 {
        self.rest().len() as u64 + self.behind.left()
    }

    /// Returns the bytes of the window that are left.
    fn rest(&self) -> &[u8] {
        &self.window[self.at..]
    }

    /// Returns the file.
    pub(super) fn path(&self) -> &'a Path {
        &self.source.path
    }

    /// Returns the line of the place, from 1.
    pub(super) fn line(&self) -> u32 {
        self.line
    }

    /// Returns an error at the line of the place.
    pub(super) fn error(&self, kind: SceneErrorKind) -> SceneError {
        SceneError::new(Origin::line(self.path(), self.line), kind)
    }

    /// Returns an error about a part of a binary file.
    pub(super) fn error_in(&self, element: impl Into<String>, kind: SceneErrorKind) -> SceneError {
        let (path, element) = (self.path().to_owned(), element.into());
        SceneError::new(Origin::Element { path, element }, kind)
    }

    /// Extends the window to the given number of bytes, or as many as are left; returns whether they suffice.
    fn fill(&mut self, n: usize) -> Result<bool, SceneError> {
        let have = self.rest().len();
        if have >= n || self.behind.left() == 0 {
            return Ok(have >= n);
        }
        self.window.drain(..self.at);
        (self.at, self.last) = (0, 0..0);
        let more = (n - have).max(self.source.window) as u64;
        let more = more.min(self.behind.left());
        if n > self.source.window {
            self.source.expect_room(more)?;
        }
        let read = self.behind.by_ref().take(more).read_to_end(&mut self.window);
        if (read.map_err(|error| self.source.unreadable(error))? as u64) < more {
            // A file that has become shorter ends here.
            self.behind.skip(u64::MAX);
        }
        Ok(self.window.len() >= n)
    }

    /// Returns the number of bytes before the first for which `is_end` holds, or before the end of the file.
    fn length_until(&mut self, is_end: impl Fn(u8) -> bool) -> Result<usize, SceneError> {
        let mut n_seen = 0;
        loop {
            if let Some(more) = self.rest()[n_seen..].iter().position(|byte| is_end(*byte)) {
                return Ok(n_seen + more);
            }
            n_seen = self.rest().len();
            if !self.fill(n_seen + 1)? {
                return Ok(n_seen);
            }
        }
    }

    /// Returns the last word or line, until the next read.
    pub(super) fn last(&self) -> &str {
        std::str::from_utf8(&self.window[self.last.clone()]).unwrap_or("\u{fffd}")
    }

    /// Returns the rest of the line, without its end and surrounding blanks; `None` at the end of the file.
    pub(super) fn next_line(&mut self) -> Result<Option<&str>, SceneError> {
        if !self.fill(1)? {
            return Ok(None);
        }
        let length = self.length_until(|byte| matches!(byte, b'\n' | b'\r'))?;
        // A line end of Windows has two bytes.
        self.fill(length + 2)?;
        let line = self.line;
        let n_end = match self.rest()[length..] {
            [b'\r', b'\n', ..] => 2,
            [] => 0,
            _ => 1,
        };
        let start = self.at;
        self.at += length + n_end;
        self.line = self.line.saturating_add(1);
        let text = std::str::from_utf8(&self.window[start..start + length])
            .map_err(|_| SceneError::new(Origin::line(self.path(), line), SceneErrorKind::NotUtf8))?;
        let start = start + length - text.trim_start().len();
        self.last = start..start + text.trim().len();
        Ok(Some(self.last()))
    }

    /// Reads the next line that is not blank, and returns its number.
    pub(super) fn next_full_line(&mut self) -> Result<Option<u32>, SceneError> {
        loop {
            let line = self.line;
            match self.next_line()? {
                Some("") => {}
                Some(_) => return Ok(Some(line)),
                None => return Ok(None),
            }
        }
    }

    /// Returns whether the next line that is not blank begins with the given text, without reading it.
    pub(super) fn is_before(&mut self, text: &str) -> Result<bool, SceneError> {
        // Blanks that fill a window cannot precede a line: in binary files these are numbers.
        self.fill(self.source.window.max(text.len() + 2))?;
        Ok(self.rest().trim_ascii_start().starts_with(text.as_bytes()))
    }

    fn skip_blanks(&mut self) -> Result<(), SceneError> {
        let mut last = 0;
        while self.fill(1)? {
            let rest = &self.window[self.at..];
            let n_blanks = rest.iter().position(|byte| !byte.is_ascii_whitespace());
            let blanks = &rest[..n_blanks.unwrap_or(rest.len())];
            self.at += blanks.len();
            for &byte in blanks {
                let is_end = byte == b'\r' || (byte == b'\n' && last != b'\r');
                self.line = self.line.saturating_add(u32::from(is_end));
                last = byte;
            }
            if n_blanks.is_some() {
                break;
            }
        }
        Ok(())
    }

    /// Returns the next word, on any line; a replacement character for bytes that are not text.
    pub(super) fn word(&mut self) -> Result<Option<&str>, SceneError> {
        self.skip_blanks()?;
        let length = self.length_until(|byte| byte.is_ascii_whitespace())?;
        self.last = self.at..self.at + length;
        self.at += length;
        Ok(Some(self.last()).filter(|text| !text.is_empty()))
    }

    /// Returns the next word; at the end of the file, the error that `expected` is missing.
    pub(super) fn expect_word(&mut self, expected: &str) -> Result<&str, SceneError> {
        if self.word()?.is_none() {
            return Err(self.malformed(expected, "the end of the file"));
        }
        Ok(self.last())
    }

    /// Returns the error that `expected` was required and `found` was read.
    pub(super) fn malformed(&self, expected: &str, found: &str) -> SceneError {
        self.error(SceneErrorKind::malformed(expected, found))
    }

    /// Returns the next word as a number.
    pub(super) fn number<T: FromStr>(&mut self, expected: &str) -> Result<T, SceneError> {
        let number = self.expect_word(expected)?.parse();
        number.map_err(|_| self.malformed(expected, self.last()))
    }

    /// Returns a stated count as a usize if the rest of the file has room for as many things of at least `least_bytes` each.
    pub(super) fn count(&self, n: u64, least_bytes: u64, what: &'static str) -> Result<usize, SceneError> {
        let room = self.left() / least_bytes.max(1);
        match usize::try_from(n) {
            Ok(count) if n <= room => Ok(count),
            _ => Err(self.error(SceneErrorKind::Truncated { what, n, room })),
        }
    }

    fn cut_short(&self, what: &'static str) -> SceneError {
        self.source.error(SceneErrorKind::CutShort { what })
    }

    /// Returns the next bytes.
    pub(super) fn take(&mut self, n: usize, what: &'static str) -> Result<&[u8], SceneError> {
        if self.rest().len() < n && (n as u64 > self.left() || !self.fill(n)?) {
            return Err(self.cut_short(what));
        }
        self.at += n;
        Ok(&self.window[self.at - n..self.at])
    }

    /// Skips the given number of bytes.
    pub(super) fn skip(&mut self, n: u64, what: &'static str) -> Result<(), SceneError> {
        if n > self.left() {
            return Err(self.cut_short(what));
        }
        let in_window = self.rest().len().min(usize::try_from(n).unwrap_or(usize::MAX));
        self.at += in_window;
        self.behind.skip(n - in_window as u64);
        Ok(())
    }

    /// Returns the next binary number.
    pub(super) fn binary<T: Binary>(&mut self, what: &'static str) -> Result<T, SceneError> {
        let is_little = self.is_little;
        self.take(T::BYTES, what).map(|bytes| T::of(bytes, is_little))
    }

    /// Skips to the line after one that consists of the given text, such as `$EndNodes`; returns false if there is none.
    pub(super) fn skip_past_line(&mut self, text: &str) -> Result<bool, SceneError> {
        // Binary numbers may form a line of any length; longer lines than this are skipped part by part.
        let longest = self.source.window.max(text.len() + 2);
        let mut is_start = true;
        while self.left() > 0 {
            self.fill(longest)?;
            let end = self.rest().iter().position(|byte| *byte == b'\n');
            let length = end.map_or(self.rest().len(), |at| at + 1);
            let is_end = end.is_some() || self.behind.left() == 0;
            let is_found = is_start && is_end && self.rest()[..length].trim_ascii() == text.as_bytes();
            self.at += length;
            self.line = self.line.saturating_add(u32::from(is_end));
            is_start = is_end;
            if is_found {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
