//! A binary file whose things are read one after another, without the whole of it in memory.

use std::io::Read;

use super::source::{Cursor, Source};
use crate::scene::{SceneError, SceneErrorKind};

/// Bytes that are read at once.
const WINDOW: usize = 1 << 20;

/// The rest of a file behind some place: a window of it in memory, and what comes behind that.
pub(super) struct Feed<'a> {
    source: &'a Source<'a>,
    stream: Box<dyn Read + 'a>,
    window: Vec<u8>,
    at: usize,
    /// Bytes behind the window.
    beyond: u64,
    is_little: bool,
}

impl<'a> Feed<'a> {
    /// Begins to read at a place.
    pub(super) fn new(source: &'a Source<'a>, place: u64, is_little: bool) -> Result<Self, SceneError> {
        let mut stream = source.stream()?;
        let skipped = std::io::copy(&mut stream.by_ref().take(place), &mut std::io::sink());
        skipped.map_err(|error| source.error(SceneErrorKind::Unreadable { source: error }))?;
        Ok(Self {
            source,
            stream,
            window: Vec::new(),
            at: 0,
            beyond: source.head().length.saturating_sub(place),
            is_little,
        })
    }

    /// Returns a place in the window.
    fn cursor(&self) -> Cursor<'_> {
        Cursor::of_bytes(self.source.path, &self.window[self.at..], self.is_little).before(self.beyond)
    }

    /// Returns how many bytes are left.
    pub(super) fn left(&self) -> u64 {
        self.cursor().left()
    }

    /// Brings so many bytes into the window, or as many as are left.
    fn fill(&mut self, n: usize) -> Result<(), SceneError> {
        let have = self.window.len() - self.at;
        if have >= n || self.beyond == 0 {
            return Ok(());
        }
        self.window.drain(..self.at);
        self.at = 0;
        let more = ((n - have).max(WINDOW) as u64).min(self.beyond);
        let read = self.stream.by_ref().take(more).read_to_end(&mut self.window);
        let read = read.map_err(|error| self.source.error(SceneErrorKind::Unreadable { source: error }))?;
        // A file that has become shorter ends here.
        self.beyond = if (read as u64) < more { 0 } else { self.beyond - more };
        Ok(())
    }

    /// Reads the next thing; `size` returns its bytes, or the least that it has by what is in the window, and `None` where that tells nothing.
    pub(super) fn next<T>(
        &mut self,
        size: impl Fn(Cursor<'_>) -> Option<usize>,
        read: impl FnOnce(&mut Cursor<'_>) -> Result<T, SceneError>,
    ) -> Result<T, SceneError> {
        loop {
            let have = self.window.len() - self.at;
            let needed = size(self.cursor()).unwrap_or(have + 1);
            // What would be longer than the file is refused when it is read.
            if needed <= have || needed as u64 > self.left() {
                break;
            }
            self.fill(needed)?;
        }
        let mut cursor = self.cursor();
        let before = cursor.rest().len();
        let found = read(&mut cursor)?;
        self.at += before - cursor.rest().len();
        Ok(found)
    }
}
