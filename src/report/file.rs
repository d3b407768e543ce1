//! Files: formats by their endings, atomic writes, counts and hashes.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use serde_json::{Map, Value, json};
use sha2::{Digest as _, Sha256};

use super::ReportError;
use super::description::FileCheck;
use crate::mesh::Mesh;
use crate::scene::Scene;
use crate::scene::hash::hexadecimal;
use crate::whole_file;

/// Returns the format of a file's ending, among those `known` for this content.
pub(crate) fn by_ending<F: Copy>(path: &Path, content: &'static str, known: &[(&str, F)]) -> Result<F, ReportError> {
    let ending = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
    let found = known.iter().find(|(name, _)| ending.as_deref() == Some(name.as_ref()));
    found.map(|&(_, format)| format).ok_or_else(|| {
        let endings = known.iter().map(|(name, _)| format!(".{name}"));
        ReportError::UnknownFormat {
            path: path.to_owned(),
            content,
            known: endings.collect::<Vec<_>>().join(", "),
        }
    })
}

/// Writes a file atomically.
pub(super) fn write(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), ReportError> {
    whole_file::write(path, content).map_err(|source| ReportError::unwritable(path, source))
}

/// Returns the members that the descriptions of files with values on patches share.
pub(super) fn described(format: &str, (scene, mesh): (&Scene, &Mesh), settings: &Map<String, Value>) -> Value {
    json!({
        "format": format,
        "n_patches": mesh.n_patches(),
        "geometry_sha256": mesh.geometry_hash(),
        "scene_sha256": scene.content_hash(),
        "surfaces": scene.surfaces.iter().map(|s| &s.name).collect::<Vec<_>>(),
        "settings": settings,
    })
}

/// Writes bytes, counts and hashes them.
pub(super) struct Hashed<W> {
    writer: W,
    hasher: Sha256,
    byte: u64,
}

impl<W: Write> Hashed<W> {
    pub(super) fn new(writer: W) -> Self {
        let hasher = Sha256::new();
        Self {
            writer,
            hasher,
            byte: 0,
        }
    }

    /// Returns the length and the checksum for readers.
    pub(super) fn check(self) -> FileCheck {
        FileCheck {
            byte: self.byte,
            sha256: hexadecimal(&self.hasher.finalize()),
        }
    }
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.writer.write(bytes)?;
        self.hasher.update(&bytes[..n]);
        self.byte += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }
}
