//! Khronos' glTF 2.0, as JSON with buffers beside it, and as GLB in one file.

mod buffers;
mod document;
mod materials;
mod meshes;

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::LoadOptions;
use super::polygons::Polygons;
use super::reader::{Head, Reader};
use super::source::Source;
use crate::printable::quoted;
use crate::scene::{SceneError, SceneErrorKind};
use buffers::Buffer;
use document::{Document, Header};

/// Extensions that are read, or do not affect the data that is read.
const KNOWN_EXTENSIONS: [&str; 12] = [
    "KHR_mesh_quantization",
    "KHR_materials_emissive_strength",
    "KHR_texture_transform",
    "KHR_materials_unlit",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_lights_punctual",
    "EXT_texture_webp",
];

/// The format.
pub(super) struct Gltf;

impl Reader for Gltf {
    fn name(&self) -> &'static str {
        "gltf"
    }

    fn summary(&self) -> &'static str {
        "glTF 2.0 or GLB"
    }

    fn suffixes(&self) -> &'static [&'static str] {
        &["gltf", "glb"]
    }

    fn recognises(&self, head: &Head<'_>) -> bool {
        head.bytes.starts_with(b"glTF") || head.begins_with("{")
    }

    fn read(&self, source: &Source<'_>, options: &LoadOptions) -> Result<Polygons, SceneError> {
        let (mut document, chunk) = parsed(source)?;
        if let Some(name) = document
            .required
            .iter()
            .find(|name| !KNOWN_EXTENSIONS.contains(&name.as_str()))
        {
            let message = format!("the extension `{name}` is not read; export without it, as without compression");
            return Err(source.error(SceneErrorKind::unsupported(message)));
        }
        let buffers = document
            .buffers
            .iter_mut()
            .enumerate()
            .map(|(k, buffer)| Buffer::find(k, buffer, chunk.clone(), source, options))
            .collect::<Result<Vec<_>, _>>()?;
        meshes::polygons(&document, &buffers, source, options)
    }

    #[cfg(feature = "cli")]
    fn companions(&self, path: &Path) -> Vec<PathBuf> {
        let parsed = Source::open(path, &|_| Ok(())).and_then(|source| parsed(&source));
        let buffers = parsed.map_or_else(|_| Vec::new(), |(document, _)| document.buffers);
        let uris = buffers.into_iter().filter_map(|buffer| buffer.uri);
        let files = uris
            .filter(|uri| !uri.starts_with("data:"))
            .map(|uri| beside(path, &uri));
        files.filter(|file| file.exists()).collect()
    }
}

/// Returns the JSON of a file, and the place of the binary chunk of a GLB.
fn parsed(source: &Source<'_>) -> Result<(Document, Option<Range<u64>>), SceneError> {
    let (json, chunk) = parts(source).map_err(|kind| source.error(kind))?;
    let json = source.part(json.start, json.end - json.start)?;
    let document = serde_json::from_slice::<Document>(&json);
    // Files of other versions differ in all else, and must not be called malformed.
    let version = match &document {
        Ok(own) => Some(own.asset.version.clone()),
        Err(_) => serde_json::from_slice::<Header>(&json)
            .ok()
            .map(|own| own.asset.version),
    };
    if let Some(version) = version.filter(|version| version.split('.').next() != Some("2")) {
        let message = format!("glTF of version {} is not read; export glTF 2.0", quoted(&version));
        return Err(source.error(SceneErrorKind::unsupported(message)));
    }
    let malformed = |error: serde_json::Error| SceneErrorKind::malformed("JSON of glTF 2.0", error.to_string());
    Ok((document.map_err(|error| source.error(malformed(error)))?, chunk))
}

/// Returns the places of the JSON of a file and of the binary chunk of a GLB.
fn parts(source: &Source<'_>) -> Result<(Range<u64>, Option<Range<u64>>), SceneErrorKind> {
    const JSON: u32 = 0x4e4f_534a;
    const BINARY: u32 = 0x004e_4942;
    const HEADER: SceneErrorKind = SceneErrorKind::CutShort {
        what: "the header of the GLB",
    };
    let Head { bytes, length: room } = source.head();
    if !bytes.starts_with(b"glTF") {
        let start = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        return Ok((start..room, None));
    }
    let word = |at: u64| {
        let own = source.part(at, 4).map_err(|error| error.kind)?;
        own.try_into().map(u32::from_le_bytes).map_err(|_| HEADER)
    };
    let version = word(4)?;
    if version != 2 {
        let message = format!("GLB of version {version} is not read; export glTF 2.0");
        return Err(SceneErrorKind::unsupported(message));
    }
    let length = u64::from(word(8)?);
    if length > room {
        let (what, n) = ("bytes", length);
        return Err(SceneErrorKind::Truncated { what, n, room });
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < length {
        let (size, kind) = (word(at)?, word(at + 4)?);
        let chunk = at + 8..at + 8 + u64::from(size);
        if chunk.end > room {
            let what = "a chunk of the GLB";
            return Err(SceneErrorKind::CutShort { what });
        }
        at = chunk.end;
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BINARY if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
    }
    let json = json.ok_or_else(|| SceneErrorKind::malformed("a chunk of JSON", "none"))?;
    Ok((json, binary))
}

/// Returns the file that a relative reference names.
fn beside(scene_file: &Path, uri: &str) -> PathBuf {
    let name = String::from_utf8_lossy(&percent_decoded(uri)).into_owned();
    scene_file.parent().unwrap_or(Path::new("")).join(name)
}

/// Returns a text with its percent-encoded bytes decoded.
pub(super) fn percent_decoded(text: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, tail)) = rest.split_first() {
        let digits = tail.get(..2).and_then(|digits| std::str::from_utf8(digits).ok());
        let code = digits
            .filter(|_| first == b'%')
            .and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(code.unwrap_or(first));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    bytes
}
