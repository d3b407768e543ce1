//! Files of form factors, as they are and with their checksums made right: `.npz` if they begin as a ZIP file does, `.mtx` if with `%`, else `.npy`.
#![no_main]

use std::io::{Cursor, Read as _, Write as _};
use std::path::Path;

use libfuzzer_sys::fuzz_target;
use radiosity::report::form_factors::FormFactorFile;
use radiosity_fuzz::{MESH, described, put, refused};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// The description of a `.npy` file.
const DESCRIPTION: &[u8] = include_bytes!("../seeds/F.npy.json");

fuzz_target!(|data: &[u8]| {
    if data.starts_with(b"PK") {
        attempt(&put("F.npz", data));
        if let Some(repaired) = repaired_npz(data) {
            attempt(&put("F.npz", &repaired));
        }
    } else if data.starts_with(b"%") {
        attempt(&put("F.mtx", data));
        if let Some(repaired) = repaired_mtx(data) {
            attempt(&put("F.mtx", &repaired));
        }
    } else if let Some(description) = described(DESCRIPTION, Some(data)) {
        let _ = put("F.npy.json", description.as_bytes());
        attempt(&put("F.npy", data));
    }
});

fn attempt(path: &Path) {
    let read = FormFactorFile::open(path).and_then(|file| file.read(&MESH));
    match read {
        Ok(factors) => {
            assert_eq!(factors.n_rows(), MESH.n_patches());
            let sums = factors.row_sums();
            assert!(sums.iter().all(|sum| sum.is_finite()), "{sums:?}");
            // Whatever passed as form factors can be repaired or is refused.
            if let Ok(symmetric) = factors.symmetrised() {
                let _ = symmetric.balanced(factors.row_targets(true), 1e-12, 20);
            }
        }
        Err(error) => refused(path, &error.to_string()),
    }
}

/// Returns an archive with the same members, each with the CRC-32 of its content.
fn repaired_npz(data: &[u8]) -> Option<Vec<u8>> {
    let mut found = ZipArchive::new(Cursor::new(data)).ok()?;
    let mut made = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for k in 0..found.len().min(16) {
        let member = found.by_index_raw(k).ok()?;
        let mut name = member.name().ok()?.into_owned();
        let mut content = Vec::new();
        member.take(1 << 16).read_to_end(&mut content).ok()?;
        // As a member that is no array the description may have any length.
        if name == "meta.npy" {
            let head = 10 + usize::from(u16::from_le_bytes([*content.get(8)?, *content.get(9)?]));
            let characters = content.get(head..)?.as_chunks().0.iter();
            let text = characters.filter_map(|b| char::from_u32(u32::from_le_bytes(*b)));
            content = text.collect::<String>().into_bytes();
            name = "meta.json".to_owned();
        }
        if name == "meta.json" {
            content = described(&content, None).map_or(content, String::into_bytes);
        }
        made.start_file(name, options).ok()?;
        made.write_all(&content).ok()?;
    }
    Some(made.finish().ok()?.into_inner())
}

/// Returns the text with a description that has length and checksum of what follows the comments.
fn repaired_mtx(data: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(data).ok()?;
    let (banner, mut rest) = text.split_once('\n')?;
    let mut description = String::new();
    while let Some((line, after)) = rest.strip_prefix('%').and_then(|rest| rest.split_once('\n')) {
        description.push_str(line);
        description.push('\n');
        rest = after;
    }
    let description = described(description.as_bytes(), Some(rest.as_bytes()))?;
    let mut made = format!("{banner}\n");
    for line in description.lines() {
        made.push_str("% ");
        made.push_str(line);
        made.push('\n');
    }
    made.push_str(rest);
    Some(made.into_bytes())
}
