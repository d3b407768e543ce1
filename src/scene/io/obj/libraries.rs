//! Finds the libraries of a scene without reading the scene.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use super::mtl::{by_file_name, files_of};

/// The greatest number of bytes of a line that are read.
const LONGEST_LINE: u64 = 1 << 16;

/// Returns the existing libraries that a scene file names, without reading the scene; none for a pipe.
pub(super) fn libraries_of(scene_file: &Path) -> Vec<PathBuf> {
    let is_file = std::fs::metadata(scene_file).is_ok_and(|data| data.is_file());
    let Some(file) = is_file.then(|| File::open(scene_file).ok()).flatten() else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let (mut reader, mut line) = (BufReader::new(file), Vec::new());
    // A file without line ends is no scene, and need not fit in memory.
    while (&mut reader)
        .take(LONGEST_LINE)
        .read_until(b'\n', &mut line)
        .is_ok_and(|n_read| n_read > 0)
    {
        let (keyword, rest) = line.trim_ascii().split_at_checked(6).unwrap_or_default();
        let is_named = keyword.eq_ignore_ascii_case(b"mtllib") && matches!(rest.first(), Some(b' ' | b'\t'));
        if let Some(name) = is_named.then(|| std::str::from_utf8(rest.trim_ascii()).ok()).flatten() {
            let named = files_of(name, scene_file).into_iter();
            found.extend(named.filter_map(|library| library.file.or_else(|| by_file_name(library.name, scene_file))));
        }
        line.clear();
    }
    found
}
