//! Pictures that are to be verified: as they are, and a right one whose description is replaced.
//!
//! What begins as an EXR file does is one. All else is names of attributes and their texts, each ended by a NUL, that replace those of a picture that verifies.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use radiosity::render::verify::verify;
use radiosity_fuzz::put;

const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// A picture by rays and one by clipping.
const RIGHT: [&[u8]; 2] = [
    include_bytes!("../seeds/picture/rays.exr"),
    include_bytes!("../seeds/picture/polygons.exr"),
];

fuzz_target!(|data: &[u8]| {
    if data.starts_with(&EXR) {
        attempt(&put("i.exr", data));
        return;
    }
    let mut parts = data.split(|byte| *byte == 0);
    let mut texts = Vec::new();
    while let (Some(name), Some(text)) = (parts.next(), parts.next()) {
        texts.push((name, text));
    }
    for right in RIGHT {
        let described = described(right, &texts).expect("a picture of ours has one part and its attributes first");
        attempt(&put("i.exr", &described));
    }
});

fn attempt(path: &Path) {
    match verify(path) {
        Ok(report) => assert!(report.n_checked <= report.n_pixels),
        Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
    }
}

/// Returns a file of one part with some attributes' texts replaced, and the table of its blocks moved along.
fn described(file: &[u8], texts: &[(&[u8], &[u8])]) -> Option<Vec<u8>> {
    let mut made = file.get(..8)?.to_vec();
    let mut rest = &file[8..];
    while *rest.first()? != 0 {
        let name = until_nul(&mut rest)?;
        let kind = until_nul(&mut rest)?;
        let length = usize::try_from(number(&rest[..4])).ok()?;
        let value = rest.get(4..4 + length)?;
        rest = &rest[4 + length..];
        let value = texts.iter().find(|(known, _)| *known == name && kind == b"string").map_or(value, |(_, text)| text);
        for piece in [name, b"\0", kind, b"\0", &u32::try_from(value.len()).ok()?.to_le_bytes(), value] {
            made.extend_from_slice(piece);
        }
    }
    made.push(0);
    rest = &rest[1..];
    let first = number(rest.get(..8)?);
    let table_at = (file.len() - rest.len()) as u64;
    let n_blocks = usize::try_from((first - table_at) / 8).ok()?;
    let shift = (made.len() as u64).wrapping_sub(table_at);
    for entry in rest.get(..8 * n_blocks)?.chunks(8) {
        made.extend_from_slice(&number(entry).wrapping_add(shift).to_le_bytes());
    }
    made.extend_from_slice(&rest[8 * n_blocks..]);
    Some(made)
}

fn until_nul<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let end = rest.iter().position(|byte| *byte == 0)?;
    let (text, after) = rest.split_at(end);
    *rest = &after[1..];
    Some(text)
}

/// Returns a little-endian number of up to eight bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte))
}
