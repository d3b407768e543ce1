//! The interface of the readers of scene files.

#[cfg(feature = "cli")]
use std::path::{Path, PathBuf};

use super::LoadOptions;
use super::polygons::Polygons;
use super::source::Source;
use crate::scene::SceneError;

/// Bytes at the start of a file that show its format.
pub(super) const HEAD: usize = 1 << 16;

/// A format of scene files: its names, its detection, and its reader.
pub(super) trait Reader: Sync {
    /// Returns its name, in small letters.
    fn name(&self) -> &'static str;

    /// Returns its description, for a list.
    fn summary(&self) -> &'static str;

    /// Returns the suffixes of its files, in small letters.
    fn suffixes(&self) -> &'static [&'static str];

    /// Returns whether a file begins like those of the format.
    fn recognises(&self, head: &Head<'_>) -> bool;

    /// Reads the polygons of a file.
    fn read(&self, source: &Source<'_>, options: &LoadOptions) -> Result<Polygons, SceneError>;

    /// Returns whether its files have cell arrays that can name surfaces.
    fn has_arrays(&self) -> bool {
        false
    }

    /// Returns the existing files that a file names, without reading the scene.
    #[cfg(feature = "cli")]
    fn companions(&self, _path: &Path) -> Vec<PathBuf> {
        Vec::new()
    }
}

/// The start of a file.
pub(super) struct Head<'a> {
    /// Its first [`HEAD`] bytes, or all.
    pub(super) bytes: &'a [u8],
    /// The bytes of the whole file.
    pub(super) length: u64,
}

impl Head<'_> {
    /// Returns whether the file begins with some text, after a byte-order mark and blanks.
    pub(super) fn begins_with(&self, text: &str) -> bool {
        let bytes = self.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(self.bytes);
        bytes.trim_ascii_start().starts_with(text.as_bytes())
    }

    /// Returns whether the file begins with some text in capitals or small letters, after a byte-order mark and blanks.
    pub(super) fn begins_with_any_case(&self, text: &str) -> bool {
        let bytes = self.bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(self.bytes);
        let start = bytes.trim_ascii_start().get(..text.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(text.as_bytes()))
    }

    /// Returns whether the head contains the given text in capitals or small letters.
    pub(super) fn contains_any_case(&self, text: &str) -> bool {
        let mut windows = self.bytes.windows(text.len());
        windows.any(|window| window.eq_ignore_ascii_case(text.as_bytes()))
    }

    /// Returns whether the head contains the given text.
    pub(super) fn contains(&self, text: &str) -> bool {
        self.bytes.windows(text.len()).any(|window| window == text.as_bytes())
    }

    /// Returns the lines of the head that are text, without blanks at their ends.
    pub(super) fn lines(&self) -> impl Iterator<Item = &str> {
        let lines = self.bytes.split(|byte| matches!(byte, b'\n' | b'\r'));
        lines.filter_map(|line| std::str::from_utf8(line.trim_ascii()).ok())
    }
}
