//! What reading a scene takes, told before it is read.

use std::io::{self, BufRead as _, BufReader};
use std::path::Path;

use crate::input_file;

/// Bytes for a corner of a face while a scene is read and looked at: in the text's index, in what tobj makes of it, in the scene, and in the tables that find
/// equal vertices, faces that repeat and edges.
const CORNER_BYTE: u64 = 192;

/// Bytes for a vertex, beside its text.
const VERTEX_BYTE: u64 = 48;

/// Returns an upper bound of the memory that it takes to read a scene from an OBJ file, in bytes: its text twice, its vertices and its corners.
///
/// What a pipe will give cannot be told, and counts as nothing.
///
/// # Errors
/// Those of the file system.
pub(crate) fn reading_byte(path: &Path) -> io::Result<u64> {
    let Some(file) = input_file::open_to_look(path)? else {
        return Ok(0);
    };
    let text_byte = file.metadata()?.len();
    let (mut n_vertices, mut n_corners) = (0_u64, 0_u64);
    // The first letter of the line, once there is one, and the byte before.
    let (mut keyword, mut last) = (None, b'\n');
    let mut reader = BufReader::with_capacity(1 << 16, file);
    loop {
        let bytes = reader.fill_buf()?;
        if bytes.is_empty() {
            break;
        }
        for &byte in bytes {
            let is_end = matches!(byte, b'\n' | b'\r');
            if is_end && last != b'\\' {
                keyword = None;
            } else if !byte.is_ascii_whitespace() && last.is_ascii_whitespace() {
                match keyword {
                    None => {
                        keyword = Some(byte);
                        n_vertices += u64::from(matches!(byte, b'v' | b'V'));
                    }
                    Some(b'f' | b'F') => n_corners += 1,
                    Some(_) => {}
                }
            }
            last = byte;
        }
        let n = bytes.len();
        reader.consume(n);
    }
    Ok(2 * text_byte + VERTEX_BYTE * n_vertices + CORNER_BYTE * n_corners)
}
