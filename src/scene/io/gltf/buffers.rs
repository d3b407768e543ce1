//! The buffers of a glTF file: a file beside the scene, base64 in the JSON, or the chunk of a GLB.

use std::ops::Range;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::super::cursor::Cursor;
use super::super::source::Source;
use super::super::{LoadOptions, obj};
use super::beside;
use super::document;
use crate::input_file;
use crate::scene::{Origin, SceneError, SceneErrorKind};

/// A buffer, read only where it is used.
pub(super) struct Buffer<'s> {
    /// The file of the buffer; `None` for the scene's own.
    source: Option<Source<'s>>,
    place: Range<u64>,
}

impl<'s> Buffer<'s> {
    /// Finds the bytes of a buffer, and drops its text from the JSON; `chunk` is the range of the binary chunk in the scene file.
    pub(super) fn find(
        k: usize,
        buffer: &mut document::Buffer,
        chunk: Option<Range<u64>>,
        source: &Source<'s>,
        options: &LoadOptions,
    ) -> Result<Self, SceneError> {
        let refused = |kind| {
            let (path, element) = (source.path.clone(), format!("buffer {k}"));
            SceneError::new(Origin::Element { path, element }, kind)
        };
        let own = match buffer.uri.take() {
            None => None,
            Some(uri) if uri.starts_with("data:") => {
                let text = uri.split_once(";base64,").map(|(_, text)| text);
                let text = text.ok_or_else(|| refused(SceneErrorKind::malformed("data in base64", uri.as_str())))?;
                let bytes = STANDARD
                    .decode(text)
                    .map_err(|error| refused(SceneErrorKind::malformed("base64", error.to_string())))?;
                Some(source.of_part(bytes))
            }
            Some(uri) => {
                let file = beside(&source.path, &uri);
                if !options.allow_outside && !obj::mtl::lies_beside(&file, &source.path) && file.exists() {
                    return Err(refused(SceneErrorKind::OutsideFolder { name: uri }));
                }
                let unreadable =
                    |error| SceneError::new(Origin::file(&file), SceneErrorKind::Unreadable { source: error });
                input_file::expect_plain(&file).map_err(unreadable)?;
                Some(source.beside(&file)?)
            }
        };
        let place = match &own {
            Some(own) => 0..own.head().length,
            None => chunk.filter(|_| k == 0).ok_or_else(|| {
                refused(SceneErrorKind::malformed(
                    "a `uri`, or the binary chunk of a GLB",
                    "none",
                ))
            })?,
        };
        let (n, room) = (buffer.byte_length, place.end - place.start);
        if n > room {
            return Err(refused(SceneErrorKind::Truncated { what: "bytes", n, room }));
        }
        Ok(Self { source: own, place })
    }

    /// Returns how many bytes there are.
    pub(super) fn len(&self) -> u64 {
        self.place.end - self.place.start
    }

    /// Begins to read at a place of the buffer; `scene` is the scene's own file.
    pub(super) fn cursor<'b>(&'b self, scene: &'b Source<'s>, from: u64) -> Cursor<'b> {
        let source = self.source.as_ref().unwrap_or(scene);
        source.cursor_over(self.place.start.saturating_add(from), self.place.end)
    }
}
