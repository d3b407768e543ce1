//! Decodes the bytes of VTK's XML arrays while they are read: raw or in base64, plain or in blocks compressed by zlib.

use std::io::{self, BufRead, Read, Take};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use quick_xml::events::BytesStart;

use super::super::scalar::Binary as _;
use super::super::source::Source;
use super::xml_array::Content;
use crate::scene::{SceneError, SceneErrorKind};

const CUT_SHORT: SceneErrorKind = SceneErrorKind::CutShort { what: "an array" };

/// The counted things in error messages.
const BYTES: &str = "bytes of an array";

/// The greatest ratio of decompressed to compressed bytes of zlib.
const MAX_RATIO: u64 = 1032;

/// The encoding of the arrays of a file.
#[derive(Default)]
pub(super) struct Encoding {
    pub(super) is_little: bool,
    /// True if the numbers of headers have 8 bytes, else 4.
    pub(super) has_wide_headers: bool,
    pub(super) compressor: Option<String>,
    /// The offsets of appended arrays, in order.
    pub(super) offsets: Vec<u64>,
    /// The start of the appended data in the file.
    appended: Option<u64>,
    is_base64: bool,
}

impl Encoding {
    /// Records the start of the appended data, after a `_` behind the tag.
    pub(super) fn append(&mut self, source: &Source<'_>, tag: &BytesStart<'_>, from: u64) -> Result<(), SceneError> {
        self.is_base64 = tag.contains("base64");
        let before = source.stream(from, u64::MAX).skip_until(b'_');
        let n_before = before.map_err(|error| source.unreadable(error))?;
        self.appended = Some(from + n_before as u64);
        Ok(())
    }

    /// Reads a number of a header.
    fn header(&self, stream: &mut impl Read) -> Result<u64, SceneErrorKind> {
        let mut own = [0; 8];
        let own = &mut own[..self.header_bytes()];
        stream.read_exact(own).map_err(kind_of)?;
        Ok(if self.has_wide_headers {
            u64::of(own, self.is_little)
        } else {
            u32::of(own, self.is_little).into()
        })
    }

    fn header_bytes(&self) -> usize {
        if self.has_wide_headers { 8 } else { 4 }
    }

    /// Returns a stream of the bytes of an array; compressed ones are limited to `limit` decoded bytes.
    pub(super) fn bytes<'s>(
        &self,
        source: &'s Source<'_>,
        content: &Content,
        limit: u64,
    ) -> Result<Box<dyn Read + 's>, SceneErrorKind> {
        let (from, to, is_base64) = match content {
            Content::Ascii(place) | Content::Base64(place) => (place.start, place.end, true),
            Content::Appended(offset) => {
                let start = self.appended.unwrap_or(u64::MAX);
                let next = self.offsets.iter().find(|next| **next > *offset);
                let next = next.filter(|_| self.is_base64).copied().unwrap_or(u64::MAX);
                let [from, to] = [*offset, next].map(|at| start.saturating_add(at));
                (from, to, self.is_base64)
            }
        };
        let mut stream: Box<dyn Read + 's> = if is_base64 {
            Box::new(Base64::new(source.stream(from, to)))
        } else {
            Box::new(source.stream(from, to))
        };
        let Some(compressor) = &self.compressor else {
            let n = self.header(&mut stream)?;
            let room = source.span(from, to).left().saturating_sub(self.header_bytes() as u64);
            if n > room {
                // The amount of base64 data is known once all is decoded.
                let room = if is_base64 {
                    io::copy(&mut stream, &mut io::sink()).map_err(kind_of)?
                } else {
                    room
                };
                return Err(SceneErrorKind::Truncated { what: BYTES, n, room });
            }
            return Ok(Box::new(Whole { stream, n, n_read: 0 }));
        };
        if compressor != "vtkZLibDataCompressor" {
            let message = format!("arrays of `{compressor}` are not read; save with zlib or without compression");
            return Err(SceneErrorKind::unsupported(message));
        }
        let n = self.header(&mut stream)?;
        let [whole, last] = [self.header(&mut stream)?, self.header(&mut stream)?];
        let mut sizes = Vec::new();
        while (sizes.len() as u64) < n {
            match self.header(&mut stream) {
                Ok(size) => sizes.push(size),
                Err(SceneErrorKind::CutShort { .. }) => {
                    let (what, room) = ("blocks of an array", sizes.len() as u64);
                    return Err(SceneErrorKind::Truncated { what, n, room });
                }
                Err(error) => return Err(error),
            }
        }
        let blocks = Blocks {
            sizes: sizes.into_iter(),
            whole,
            last,
            limit,
            place: Place::Between(stream),
        };
        Ok(Box::new(blocks))
    }
}

/// Returns the kind of an error of decoding, or of the file.
pub(super) fn kind_of(error: io::Error) -> SceneErrorKind {
    match error.downcast() {
        Ok(kind) => kind,
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => CUT_SHORT,
        Err(source) => SceneErrorKind::Unreadable { source },
    }
}

/// A stream of as many bytes as a header states.
struct Whole<R> {
    stream: R,
    n: u64,
    n_read: u64,
}

impl<R: Read> Read for Whole<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n_left = self.n - self.n_read;
        let n_more = self.stream.by_ref().take(n_left).read(buffer)?;
        if n_more == 0 && n_left > 0 {
            let (what, n, room) = (BYTES, self.n, self.n_read);
            return Err(io::Error::other(SceneErrorKind::Truncated { what, n, room }));
        }
        self.n_read += n_more as u64;
        Ok(n_more)
    }
}

/// Decoded base64 text, in one or more runs that `=` ends.
struct Base64<R> {
    text: R,
    is_ended: bool,
    /// Signs that are not yet decoded.
    signs: Vec<u8>,
    bytes: Vec<u8>,
    at: usize,
}

impl<R: BufRead> Base64<R> {
    fn new(text: R) -> Self {
        Self {
            text,
            is_ended: false,
            signs: Vec::new(),
            bytes: Vec::new(),
            at: 0,
        }
    }

    /// Reads at least one group of four signs, if there is one.
    fn fill(&mut self) -> io::Result<()> {
        let is_sign = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'/' | b'=');
        while !self.is_ended && self.signs.len() < 4 {
            let text = self.text.fill_buf()?;
            let n_read = text.len();
            let end = text
                .iter()
                .position(|byte| !is_sign(byte) && !byte.is_ascii_whitespace());
            self.is_ended = n_read == 0 || end.is_some();
            let own = &text[..end.unwrap_or(n_read)];
            self.signs.extend(own.iter().filter(|byte| is_sign(byte)));
            self.text.consume(n_read);
        }
        if self.is_ended {
            // An incomplete last group is reported as bytes missing from the array.
            self.signs.truncate(self.signs.len() / 4 * 4);
        }
        Ok(())
    }

    fn decode(&mut self) -> io::Result<()> {
        self.at = 0;
        self.bytes.clear();
        let mut rest = &self.signs[..];
        while !rest.is_empty() {
            let first = rest.iter().position(|byte| *byte == b'=').unwrap_or(rest.len());
            let n_ends = rest[first..].iter().take_while(|byte| **byte == b'=').count();
            let mut length = first + n_ends;
            if length == rest.len() && !self.is_ended {
                // The run continues.
                length -= length % 4;
            }
            let (run, behind) = rest.split_at(length);
            STANDARD
                .decode_vec(run, &mut self.bytes)
                .map_err(|_| io::Error::other(SceneErrorKind::malformed("base64", String::from_utf8_lossy(run))))?;
            rest = behind;
            if length == 0 {
                break;
            }
        }
        let n_left = rest.len();
        self.signs.drain(..self.signs.len() - n_left);
        Ok(())
    }
}

impl<R: BufRead> Read for Base64<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.at == self.bytes.len() {
            self.fill()?;
            if self.signs.is_empty() {
                return Ok(0);
            }
            self.decode()?;
        }
        let n = (&self.bytes[self.at..]).read(buffer)?;
        self.at += n;
        Ok(n)
    }
}

/// The decompressed bytes of zlib blocks.
struct Blocks<'s> {
    /// The compressed sizes of the remaining blocks.
    sizes: std::vec::IntoIter<u64>,
    /// The decompressed size of a block, and that of the last one, if that is not 0.
    whole: u64,
    last: u64,
    /// The number of bytes needed.
    limit: u64,
    place: Place<'s>,
}

enum Place<'s> {
    Between(Box<dyn Read + 's>),
    Within(Take<ZlibDecoder<Take<Box<dyn Read + 's>>>>),
    Ended,
}

impl Read for Blocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            match std::mem::replace(&mut self.place, Place::Ended) {
                Place::Ended => return Ok(0),
                Place::Between(stream) => {
                    let Some(n_own) = self.sizes.next() else {
                        return Ok(0);
                    };
                    let is_last = self.sizes.len() == 0 && self.last > 0;
                    let length = if is_last { self.last } else { self.whole };
                    // At most the stated size, the bytes needed, and the greatest output of zlib.
                    let most = length.min(self.limit).min(n_own.saturating_mul(MAX_RATIO));
                    self.place = Place::Within(ZlibDecoder::new(stream.take(n_own)).take(most));
                }
                Place::Within(mut block) => {
                    let read = block.read(buffer);
                    if let Ok(n @ 1..) = read {
                        self.limit -= n as u64;
                        self.place = Place::Within(block);
                        return Ok(n);
                    }
                    let mut own = block.into_inner().into_inner();
                    io::copy(&mut own, &mut io::sink())?;
                    if own.limit() > 0 {
                        return Err(io::Error::other(CUT_SHORT));
                    }
                    read.map_err(told)?;
                    self.place = Place::Between(own.into_inner());
                }
            }
        }
    }
}

/// Returns errors of the file and of base64 unchanged, and errors of zlib in words.
fn told(error: io::Error) -> io::Error {
    let own = error.get_ref().and_then(|inner| inner.downcast_ref::<SceneErrorKind>());
    if own.is_some() || error.raw_os_error().is_some() {
        return error;
    }
    io::Error::other(SceneErrorKind::malformed("data that zlib compressed", "others"))
}
