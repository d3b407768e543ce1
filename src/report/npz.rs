//! NumPy's archive of arrays: a ZIP file with one uncompressed array per member.
//!
//! Every member has its length and CRC-32, which are checked when it is read.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read as _, Seek, SeekFrom, Take, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipArchive, ZipWriter};

use super::ReportError;
use super::description::FileCheck;
use super::npy::{Dtype, Element, Header, push_counts, push_reals};
use crate::input_file;
use crate::mesh::Mesh;
use crate::scene::hash::hexadecimal;

/// Writes arrays one after the other.
pub(super) struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<Fused<W>>,
}

/// A writer that fails once and ignores all data after its first error.
///
/// An archive that is dropped after an error still tries to finish, and would print a message if that failed too.
struct Fused<W> {
    writer: W,
    failed: bool,
    /// Its position and its end, had it not failed.
    place: u64,
    end: u64,
}

impl<W> Fused<W> {
    fn noted<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        self.failed |= result
            .as_ref()
            .is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        result
    }

    fn moved(&mut self, place: u64) -> u64 {
        self.place = place;
        self.end = self.end.max(place);
        place
    }
}

impl<W: Write> Write for Fused<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = if self.failed {
            bytes.len()
        } else {
            let written = self.writer.write(bytes);
            self.noted(written)?
        };
        self.moved(self.place + n as u64);
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.failed {
            return Ok(());
        }
        let flushed = self.writer.flush();
        self.noted(flushed)
    }
}

impl<W: Seek> Seek for Fused<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = if self.failed {
            match to {
                SeekFrom::Start(place) => place,
                SeekFrom::End(offset) => self.end.saturating_add_signed(offset),
                SeekFrom::Current(offset) => self.place.saturating_add_signed(offset),
            }
        } else {
            let found = self.writer.seek(to);
            self.noted(found)?
        };
        Ok(self.moved(place))
    }
}

impl<W: Write + Seek> NpzWriter<W> {
    pub(super) fn new(writer: W) -> Self {
        let fused = Fused {
            writer,
            failed: false,
            place: 0,
            end: 0,
        };
        Self {
            zip: ZipWriter::new(fused),
        }
    }

    /// Adds an array; `content` writes its numbers in C order, little-endian.
    pub(super) fn array(
        &mut self,
        name: &str,
        header: &Header,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<()> {
        let head = header.encode();
        let byte = header.data_byte().map(|data| data.saturating_add(head.len() as u64));
        self.begin(&format!("{name}.npy"), byte.unwrap_or(u64::MAX))?;
        self.zip.write_all(&head)?;
        content(&mut self.zip)
    }

    /// Adds `area`, `surface` \[n\] and `centroid` \[n, 3\] of patches.
    pub(super) fn patches(&mut self, mesh: &Mesh) -> io::Result<()> {
        let n = mesh.n_patches();
        self.numbers("area", &[n], &mesh.areas())?;
        let centroids = mesh.patches.iter().flat_map(|patch| patch.centroid.to_array());
        self.numbers("centroid", &[n, 3], &centroids.collect::<Vec<_>>())?;
        let surfaces = mesh.patches.iter().map(|patch| i64::from(patch.surface.0));
        self.numbers("surface", &[n], &surfaces.collect::<Vec<_>>())
    }

    /// Adds an array of numbers in memory.
    pub(super) fn numbers<T: Element>(&mut self, name: &str, shape: &[usize], numbers: &[T]) -> io::Result<()> {
        self.array(name, &Header::new(T::DTYPE, shape), |writer| {
            write_numbers(writer, numbers)
        })
    }

    /// Adds an array of texts.
    pub(super) fn texts(&mut self, name: &str, texts: &[String]) -> io::Result<()> {
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        self.texts_of_shape(name, &[texts.len()], &texts)
    }

    /// Adds one text, an array without dimensions.
    pub(super) fn text(&mut self, name: &str, text: &str) -> io::Result<()> {
        self.texts_of_shape(name, &[], &[text])
    }

    fn texts_of_shape(&mut self, name: &str, shape: &[usize], texts: &[&str]) -> io::Result<()> {
        let length = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        self.array(name, &Header::new(Dtype::Text(length as u64), shape), |writer| {
            for text in texts {
                let characters = text.chars().map(u32::from).chain(std::iter::repeat(0));
                let bytes: Vec<u8> = characters.take(length).flat_map(u32::to_le_bytes).collect();
                writer.write_all(&bytes)?;
            }
            Ok(())
        })
    }

    /// Adds a member that is not an array.
    pub(super) fn bytes(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        self.begin(name, bytes.len() as u64)?;
        self.zip.write_all(bytes)
    }

    pub(super) fn finish(self) -> io::Result<()> {
        self.zip.finish()?;
        Ok(())
    }

    /// Begins a member of `byte` bytes; fixed time and system make equal content give equal bytes.
    fn begin(&mut self, name: &str, byte: u64) -> io::Result<()> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .last_modified_time(DateTime::default())
            .system(System::Unix)
            .unix_permissions(0o644)
            .large_file(byte >= u64::from(u32::MAX));
        Ok(self.zip.start_file(name, options)?)
    }
}

/// Writes numbers in little-endian bytes.
pub(super) fn write_numbers<T: Element>(writer: &mut dyn Write, numbers: &[T]) -> io::Result<()> {
    let mut bytes = Vec::new();
    for chunk in numbers.chunks(8192) {
        bytes.clear();
        for number in chunk {
            number.push_to(&mut bytes);
        }
        writer.write_all(&bytes)?;
    }
    Ok(())
}

/// An archive that is open for reading.
pub(super) struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    file_byte: u64,
}

impl Archive {
    pub(super) fn open(path: &Path) -> Result<Self, ReportError> {
        let unreadable = |source| ReportError::unreadable(path, source);
        let file = input_file::open(path).map_err(unreadable)?;
        let file_byte = file.metadata().map_err(unreadable)?.len();
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|error| ReportError::damaged(path, format!("not a readable .npz archive: {error}")))?;
        Ok(Self {
            path: path.to_owned(),
            zip,
            file_byte,
        })
    }

    /// Returns whether there is an array of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.zip.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// Opens an array.
    pub(super) fn array(&mut self, name: &str) -> Result<Array, ReportError> {
        Array::begin(self.member(&format!("{name}.npy"))?)
    }

    /// Returns the bytes of a member that is not an array, or `None` if there is none of this name.
    pub(super) fn bytes(&mut self, name: &str) -> Result<Option<Vec<u8>>, ReportError> {
        if self.zip.index_for_name(name).is_none() {
            return Ok(None);
        }
        let mut member = self.member(name)?;
        let mut bytes = Vec::new();
        let read = member.read_to_end(&mut bytes);
        read.map_err(|error| member_error(&self.path, name, error.to_string()))?;
        member.finish()?;
        Ok(Some(bytes))
    }

    /// Returns the checksums of all members.
    pub(super) fn checksums(&mut self) -> Result<Vec<u8>, ReportError> {
        let mut bytes = Vec::new();
        for k in 0..self.zip.len() {
            let member = self.zip.by_index_raw(k);
            let member = member.map_err(|error| ReportError::damaged(&self.path, error.to_string()))?;
            bytes.extend(member.crc32().to_le_bytes());
        }
        Ok(bytes)
    }

    /// Opens a member on a file handle of its own, so that several can be read in parallel.
    fn member(&mut self, name: &str) -> Result<Member, ReportError> {
        let damaged = |reason: String| member_error(&self.path, name, reason);
        let index = self.zip.index_for_name(name).ok_or_else(|| damaged("missing".into()))?;
        let found = self
            .zip
            .by_index_raw(index)
            .map_err(|error| damaged(error.to_string()))?;
        if found.compression() != CompressionMethod::Stored || found.encrypted() {
            return Err(damaged("compressed or encrypted; store it with `numpy.savez`".into()));
        }
        let byte = found.size();
        let start = found
            .data_start()
            .ok_or_else(|| damaged("its place is unknown".into()))?;
        let end = start.checked_add(byte);
        if found.compressed_size() != byte || end.is_none_or(|end| end > self.file_byte) {
            return Err(damaged(format!("cut off: {byte} bytes are promised")));
        }
        let crc = found.crc32();
        drop(found);
        let open = || {
            let mut file = File::open(&self.path)?;
            file.seek(SeekFrom::Start(start))?;
            Ok(buffered(file, byte))
        };
        let file = open().map_err(|source| ReportError::unreadable(&self.path, source))?;
        Ok(Member {
            path: self.path.clone(),
            name: name.to_owned(),
            file,
            left: byte,
            check: Check::Crc32(crc32fast::Hasher::new(), crc),
        })
    }
}

/// Returns a reader of `byte` bytes from the file's position.
fn buffered(file: File, byte: u64) -> BufReader<Take<File>> {
    const CAPACITY: usize = 1 << 20;
    let capacity = usize::try_from(byte).map_or(CAPACITY, |byte| byte.min(CAPACITY));
    BufReader::with_capacity(capacity, file.take(byte))
}

fn member_error(path: &Path, name: &str, reason: impl Into<String>) -> ReportError {
    let reason: String = reason.into();
    ReportError::damaged(path, format!("`{}`: {reason}", name.trim_end_matches(".npy")))
}

/// The bytes of one member, checked against its checksum at the end.
struct Member {
    path: PathBuf,
    name: String,
    file: BufReader<Take<File>>,
    left: u64,
    check: Check,
}

/// The hash of the bytes that were read, and the expected one.
enum Check {
    Crc32(crc32fast::Hasher, u32),
    Sha256(Box<Sha256>, String),
}

impl io::Read for Member {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let n = self.file.read(bytes)?;
        match &mut self.check {
            Check::Crc32(seen, _) => seen.update(&bytes[..n]),
            Check::Sha256(seen, _) => seen.update(&bytes[..n]),
        }
        self.left -= n as u64;
        Ok(n)
    }
}

impl Member {
    fn error(&self, reason: impl Into<String>) -> ReportError {
        member_error(&self.path, &self.name, reason)
    }

    fn finish(mut self) -> Result<(), ReportError> {
        let at_end = self.file.fill_buf().map(<[u8]>::is_empty);
        if !at_end.map_err(|error| self.error(error.to_string()))? || self.left > 0 {
            return Err(self.error("its length is not that of its content"));
        }
        let matches = match &self.check {
            Check::Crc32(seen, expected) => seen.clone().finalize() == *expected,
            Check::Sha256(seen, expected) => hexadecimal(&seen.clone().finalize()) == *expected,
        };
        if matches {
            Ok(())
        } else {
            Err(self.error("its checksum does not match"))
        }
    }
}

/// Returns a text of four bytes per character, without trailing zeros; `None` if a number is not a character.
fn decoded(bytes: &[u8]) -> Option<String> {
    let characters = bytes
        .as_chunks()
        .0
        .iter()
        .map(|b| char::from_u32(u32::from_le_bytes(*b)));
    let text: String = characters.collect::<Option<_>>()?;
    Some(text.trim_end_matches('\0').to_owned())
}

/// One array, read from the front.
pub(super) struct Array {
    pub(super) header: Header,
    member: Member,
}

impl Array {
    /// Opens the array of a `.npy` file, whose length and checksum are given.
    pub(super) fn open_npy(path: &Path, expected: &FileCheck) -> Result<Self, ReportError> {
        let unreadable = |source| ReportError::unreadable(path, source);
        let file = input_file::open(path).map_err(unreadable)?;
        let byte = file.metadata().map_err(unreadable)?.len();
        let member = Member {
            path: path.to_owned(),
            name: "F".into(),
            file: buffered(file, byte),
            left: byte,
            check: Check::Sha256(Box::default(), expected.sha256.clone()),
        };
        if byte != expected.byte {
            let reason = format!("{byte} bytes instead of {}", expected.byte);
            return Err(member.error(reason));
        }
        Self::begin(member)
    }

    fn begin(mut member: Member) -> Result<Self, ReportError> {
        let byte = member.left;
        let (header, head_byte) = Header::read(&mut member).map_err(|reason| member.error(reason))?;
        if header.data_byte() != byte.checked_sub(head_byte) {
            return Err(member.error(format!("its shape is {:?} in {byte} bytes", header.shape)));
        }
        Ok(Self { header, member })
    }

    /// Refuses another shape than the expected one.
    pub(super) fn expect_shape(&self, shape: &[u64]) -> Result<(), ReportError> {
        if self.header.shape == shape {
            return Ok(());
        }
        let found = &self.header.shape;
        Err(self.error(format!("its shape is {found:?} instead of {shape:?}")))
    }

    pub(super) fn error(&self, reason: impl Into<String>) -> ReportError {
        self.member.error(reason)
    }

    /// Replaces `numbers` by the next `n` real numbers.
    pub(super) fn next_reals(&mut self, n: usize, numbers: &mut Vec<f64>) -> Result<(), ReportError> {
        numbers.clear();
        self.next_with(n, |dtype, bytes| push_reals(dtype, bytes, numbers))
    }

    /// Replaces `numbers` by the next `n` whole numbers.
    pub(super) fn next_counts(&mut self, n: usize, numbers: &mut Vec<u64>) -> Result<(), ReportError> {
        numbers.clear();
        self.next_with(n, |dtype, bytes| push_counts(dtype, bytes, numbers))
    }

    /// Returns the next string.
    pub(super) fn next_text(&mut self) -> Result<String, ReportError> {
        let mut text = String::new();
        self.next_with(1, |dtype, bytes| {
            let found = match dtype {
                Dtype::Bytes(_) => Some(String::from_utf8_lossy(bytes).into_owned()),
                Dtype::Text(_) => decoded(bytes),
                _ => None,
            };
            let is_text = found.is_some();
            text = found.unwrap_or_default();
            is_text
        })?;
        Ok(text)
    }

    fn next_with(&mut self, n: usize, push: impl FnOnce(Dtype, &[u8]) -> bool) -> Result<(), ReportError> {
        let dtype = self.header.dtype;
        let byte = (n as u64)
            .checked_mul(dtype.byte())
            .filter(|&byte| byte <= self.member.left);
        // The stated size has been checked against the file's length, so nothing larger is allocated.
        let Some(byte) = byte.and_then(|byte| usize::try_from(byte).ok()) else {
            return Err(self.error("it ends too soon"));
        };
        let mut bytes = vec![0; byte];
        let read = self.member.read_exact(&mut bytes);
        read.map_err(|error| self.error(error.to_string()))?;
        if push(dtype, &bytes) {
            Ok(())
        } else {
            Err(self.error(format!("its numbers of type {dtype:?} cannot be used")))
        }
    }

    /// Checks that all bytes are read and match the checksum.
    pub(super) fn finish(self) -> Result<(), ReportError> {
        self.member.finish()
    }
}
