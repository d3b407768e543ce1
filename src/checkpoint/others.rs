//! The checkpoints of other ranks, and of ranks of earlier runs.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::records::{HEAD, LAYOUT, Pieces, whole_records};

/// The checkpoint of another rank, as it was when opened.
#[derive(Debug)]
pub(super) struct Other {
    pub(super) path: PathBuf,
    pub(super) file: File,
    pub(super) pieces: Pieces,
    /// True if no rank of this run writes it.
    pub(super) is_left: bool,
}

impl Other {
    /// Opens a file if it is a checkpoint of the work with this `key`.
    pub(super) fn open(path: PathBuf, key: &[u8; 32], is_left: bool) -> Option<Self> {
        let mut file = File::open(&path).ok()?;
        let mut head = Vec::new();
        (&mut file).take(HEAD).read_to_end(&mut head).ok()?;
        if head != [&LAYOUT[..], key].concat() {
            return None;
        }
        let (pieces, _) = whole_records(&mut file).ok()?;
        Some(Self {
            path,
            file,
            pieces,
            is_left,
        })
    }
}

/// Returns the file of one of several ranks.
pub(super) fn file_of_rank(path: &Path, rank: usize) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{rank}"));
    name.into()
}

/// Returns the ranks that have a file beside `path`, in ascending order.
pub(super) fn ranks_beside(path: &Path) -> Vec<usize> {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return Vec::new();
    };
    let entries = std::fs::read_dir(crate::whole_file::directory_of(path))
        .into_iter()
        .flatten();
    let rank = |found: String| found.strip_prefix(name)?.strip_prefix('.')?.parse().ok();
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut ranks: Vec<usize> = names.filter_map(rank).collect();
    ranks.sort_unstable();
    ranks
}
