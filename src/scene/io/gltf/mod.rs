//! Khronos' glTF 2.0, as JSON with buffers beside it, and as GLB in one file.

mod document;
mod meshes;

use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::LoadOptions;
use super::polygons::Polygons;
use super::reader::{Head, Reader};
use super::source::Source;
use crate::input_file;
use crate::scene::{Origin, SceneError, SceneErrorKind};
use document::{Buffer, Document};

/// Extensions that change nothing that is read, or are read.
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
        let (json, binary) = parts(source.bytes()?).map_err(|kind| source.error(kind))?;
        let document = parse(json).map_err(|kind| source.error(kind))?;
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
            .iter()
            .enumerate()
            .map(|(k, buffer)| bytes_of(k, buffer, binary, source, options))
            .collect::<Result<Vec<_>, _>>()?;
        meshes::polygons(&document, &buffers, source)
    }

    #[cfg(feature = "cli")]
    fn companions(&self, path: &Path) -> Vec<PathBuf> {
        let parsed = input_file::read(path, u64::MAX).ok().and_then(|bytes| {
            let (json, _) = parts(&bytes).ok()?;
            parse(json).ok()
        });
        let buffers = parsed.map_or_else(Vec::new, |document| document.buffers);
        let uris = buffers.into_iter().filter_map(|buffer| buffer.uri);
        let files = uris
            .filter(|uri| !uri.starts_with("data:"))
            .map(|uri| beside(path, &uri));
        files.filter(|file| file.exists()).collect()
    }
}

fn parse(json: &[u8]) -> Result<Document, SceneErrorKind> {
    serde_json::from_slice(json).map_err(|error| SceneErrorKind::malformed("JSON of glTF 2.0", error.to_string()))
}

/// Returns the JSON of a file, and the binary chunk of a GLB.
fn parts(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), SceneErrorKind> {
    const JSON: u32 = 0x4e4f_534a;
    const BINARY: u32 = 0x004e_4942;
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None));
    }
    let word = |at: usize| {
        let own = bytes.get(at..at + 4).and_then(|own| own.try_into().ok());
        own.map(u32::from_le_bytes).ok_or(SceneErrorKind::CutShort {
            what: "the header of the GLB",
        })
    };
    let version = word(4)?;
    if version != 2 {
        let message = format!("GLB of version {version} is not read; export glTF 2.0");
        return Err(SceneErrorKind::unsupported(message));
    }
    let length = word(8)? as usize;
    if length > bytes.len() {
        let (what, n, room) = ("bytes", length as u64, bytes.len() as u64);
        return Err(SceneErrorKind::Truncated { what, n, room });
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    while at < length {
        let (size, kind) = (word(at)? as usize, word(at + 4)?);
        let chunk = bytes
            .get(at + 8..)
            .and_then(|rest| rest.get(..size))
            .ok_or(SceneErrorKind::CutShort {
                what: "a chunk of the GLB",
            })?;
        match kind {
            JSON if json.is_none() => json = Some(chunk),
            BINARY if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at += 8 + size;
    }
    let json = json.ok_or_else(|| SceneErrorKind::malformed("a chunk of JSON", "none"))?;
    Ok((json, binary))
}

/// Returns the bytes of a buffer: a file beside the scene, base64 in the JSON, or the chunk of the GLB.
fn bytes_of(
    k: usize,
    buffer: &Buffer,
    binary: Option<&[u8]>,
    source: &Source<'_>,
    options: &LoadOptions,
) -> Result<Vec<u8>, SceneError> {
    let refused = |kind| {
        let (path, element) = (source.path.to_owned(), format!("buffer {k}"));
        SceneError::new(Origin::Element { path, element }, kind)
    };
    let bytes = match &buffer.uri {
        None => {
            let chunk = binary.filter(|_| k == 0);
            chunk
                .ok_or_else(|| {
                    refused(SceneErrorKind::malformed(
                        "a `uri`, or the binary chunk of a GLB",
                        "none",
                    ))
                })?
                .to_vec()
        }
        Some(uri) if uri.starts_with("data:") => {
            let text = uri.split_once(";base64,").map(|(_, text)| text);
            let text = text.ok_or_else(|| refused(SceneErrorKind::malformed("data in base64", uri.as_str())))?;
            STANDARD
                .decode(text)
                .map_err(|error| refused(SceneErrorKind::malformed("base64", error.to_string())))?
        }
        Some(uri) => {
            let file = beside(source.path, uri);
            if !options.allow_outside && !super::obj::mtl::lies_beside(&file, source.path) && file.exists() {
                return Err(refused(SceneErrorKind::OutsideFolder { name: uri.clone() }));
            }
            let unreadable = |error| SceneError::new(Origin::file(&file), SceneErrorKind::Unreadable { source: error });
            input_file::expect_plain(&file).map_err(unreadable)?;
            source.expect_room(buffer.byte_length)?;
            input_file::read(&file, u64::MAX).map_err(unreadable)?
        }
    };
    let (n, room) = (buffer.byte_length, bytes.len() as u64);
    if n > room {
        return Err(refused(SceneErrorKind::Truncated { what: "bytes", n, room }));
    }
    Ok(bytes)
}

/// Returns the file of a relative reference.
fn beside(scene_file: &Path, uri: &str) -> PathBuf {
    let name = String::from_utf8_lossy(&percent_decoded(uri)).into_owned();
    scene_file.parent().unwrap_or(Path::new("")).join(name)
}

/// Returns a text with the bytes that `%20` and the like stand for.
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
