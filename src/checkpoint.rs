//! Finished pieces of long work, in a file from which a later run takes them up.
//!
//! A file is a head of 56 bytes (a name of the layout, then a key that tells one piece of work from another) and records in the order in which pieces were
//! finished: the piece's number and the length of its content (u64 each), the content, and the CRC-32 of all that (u32); little-endian. What follows the
//! last record that is whole is what a killed run was writing, and is dropped.
//!
//! Work of several stages keeps each of them in a part of its own, with a key of its own: the upper 24 bits of a piece's number are those of its part, and the last
//! piece of a part is its key. A part that begins anew with another key has none of the pieces before.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use thiserror::Error;

const LAYOUT: &[u8; 24] = b"radiosity checkpoint 02\n";

/// Bytes of a file before its records.
const HEAD: u64 = 56;

/// Bytes of a record beside its content.
const RECORD: u64 = 20;

/// The bits of a piece's number within its part.
const PIECE_BITS: u32 = 40;

/// The piece that is the key of a part.
const PART_KEY: u64 = (1 << PIECE_BITS) - 1;

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file system refuses.
    #[error("{}: the checkpoint cannot be used: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is no checkpoint.
    #[error("{}: it is no checkpoint, and is left as it is; name another file", .path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
    },
    /// The file is the checkpoint of other work.
    #[error("{}: it is the checkpoint of another scene, of other settings or of another version of the program; name another file or remove it", .path.display())]
    OtherWork {
        /// The file.
        path: PathBuf,
    },
    /// Another process writes to the file.
    #[error("{}: another process is using this checkpoint; name another file or wait", .path.display())]
    InUse {
        /// The file.
        path: PathBuf,
    },
}

impl CheckpointError {
    /// Returns why the file system refuses, or why the file is refused.
    #[must_use]
    pub fn reason(&self) -> String {
        match self {
            Self::Io { source, .. } => source.to_string(),
            other => other.to_string(),
        }
    }

    /// Returns the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::Io { path, .. } | Self::NotACheckpoint { path } | Self::OtherWork { path } | Self::InUse { path } => {
                path
            }
        }
    }
}

/// An open checkpoint; no other process can open it meanwhile.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    state: Mutex<State>,
}

/// Where the content of each piece begins, and its length.
type Pieces = BTreeMap<u64, (u64, u64)>;

#[derive(Debug)]
struct State {
    file: File,
    /// Where the next record goes.
    end: u64,
    pieces: Pieces,
    /// The part that pieces belong to now.
    part: u32,
    /// What went wrong first when a piece was to be kept; from then on none is.
    failed: Option<io::Error>,
}

impl Checkpoint {
    /// Opens the checkpoint of the work that `key` (a hash of all that its results depend on) stands for, or begins one.
    ///
    /// # Errors
    /// [`CheckpointError`]: the file cannot be opened or written, is something else, belongs to other work, or is in use.
    pub fn open(path: &Path, key: &[u8; 32]) -> Result<Self, CheckpointError> {
        let failed = |source| CheckpointError::Io {
            path: path.to_owned(),
            source,
        };
        if path.metadata().is_ok_and(|found| !found.is_file()) {
            return Err(CheckpointError::NotACheckpoint { path: path.to_owned() });
        }
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(CheckpointError::InUse { path: path.to_owned() }),
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let head = [&LAYOUT[..], key].concat();
        let mut found = Vec::new();
        (&mut file).take(HEAD).read_to_end(&mut found).map_err(failed)?;
        if found.len() < head.len() && LAYOUT.starts_with(&found[..found.len().min(LAYOUT.len())]) {
            // New, or killed at once.
            file.set_len(0).and_then(|()| file.rewind()).map_err(failed)?;
            file.write_all(&head).map_err(failed)?;
        } else if !found.starts_with(LAYOUT) {
            return Err(CheckpointError::NotACheckpoint { path: path.to_owned() });
        } else if found != head {
            return Err(CheckpointError::OtherWork { path: path.to_owned() });
        }
        let (pieces, end) = whole_records(&mut file).map_err(failed)?;
        file.set_len(end).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            state: Mutex::new(State {
                file,
                end,
                pieces,
                part: 0,
                failed: None,
            }),
        })
    }

    /// Returns how many pieces it holds.
    #[must_use]
    pub fn n_pieces(&self) -> usize {
        let state = self.state();
        state.pieces.keys().filter(|&k| k & PART_KEY != PART_KEY).count()
    }

    /// Goes over to another part: pieces are its own from now on. What was kept of it for another `key` is forgotten.
    ///
    /// # Panics
    /// If `part` is not below 2^24.
    #[track_caller]
    pub fn begin_part(&self, part: u32, key: &[u8; 32]) {
        assert!(part < 1 << (64 - PIECE_BITS), "a number of 24 bits");
        self.state().part = part;
        if self.piece(PART_KEY).as_deref() != Some(key) {
            self.keep(PART_KEY, key);
        }
    }

    /// Returns the part that pieces belong to now; 0 at first.
    #[must_use]
    pub fn part(&self) -> u32 {
        self.state().part
    }

    /// Returns the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the content of a piece, or `None` if it has not been kept or cannot be read as it was written.
    pub(crate) fn piece(&self, k: u64) -> Option<Vec<u8>> {
        let mut state = self.state();
        let k = in_part(state.part, k);
        let (start, length) = *state.pieces.get(&k)?;
        // The length has been checked against the file's.
        let mut content = vec![0; usize::try_from(length).ok()?];
        let mut sum = [0; 4];
        let file = &mut state.file;
        file.seek(SeekFrom::Start(start)).ok()?;
        file.read_exact(&mut content).ok()?;
        file.read_exact(&mut sum).ok()?;
        drop(state);
        (checksum(k, &content) == u32::from_le_bytes(sum)).then_some(content)
    }

    /// Keeps a finished piece. A failure, such as a full disk, does not stop the work: see [`failure`](Self::failure).
    pub(crate) fn keep(&self, k: u64, content: &[u8]) {
        let mut state = self.state();
        if state.failed.is_some() {
            return;
        }
        let k = in_part(state.part, k);
        let length = content.len() as u64;
        let mut record = Vec::with_capacity(content.len() + 20);
        record.extend(k.to_le_bytes());
        record.extend(length.to_le_bytes());
        record.extend_from_slice(content);
        record.extend(checksum(k, content).to_le_bytes());
        let end = state.end;
        let written = state
            .file
            .seek(SeekFrom::Start(end))
            .and_then(|_| state.file.write_all(&record));
        match written {
            Ok(()) => {
                insert(&mut state.pieces, k, (end + 16, length));
                state.end = end + record.len() as u64;
            }
            Err(error) => {
                // Half a record would be dropped by the next run; the disk has better use for the room.
                let _ = state.file.set_len(end);
                state.failed = Some(error);
            }
        }
    }

    /// Returns why pieces could not be kept, if so.
    #[must_use]
    pub fn failure(&self) -> Option<String> {
        self.state().failed.as_ref().map(ToString::to_string)
    }

    /// Removes the file: the work is done.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn remove(self) -> Result<(), CheckpointError> {
        std::fs::remove_file(&self.path).map_err(|source| CheckpointError::Io {
            path: self.path.clone(),
            source,
        })
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the number of piece k of a part.
fn in_part(part: u32, k: u64) -> u64 {
    u64::from(part) << PIECE_BITS | k
}

/// Notes a record; the key of a part ends all that was known of it.
fn insert(pieces: &mut Pieces, k: u64, place: (u64, u64)) {
    if k & PART_KEY == PART_KEY {
        let part = k >> PIECE_BITS;
        pieces.retain(|other, _| other >> PIECE_BITS != part);
    }
    pieces.insert(k, place);
}

fn checksum(k: u64, content: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&k.to_le_bytes());
    hasher.update(&(content.len() as u64).to_le_bytes());
    hasher.update(content);
    hasher.finalize()
}

/// Returns where the content of every whole record begins and how long it is, and where the last one ends.
fn whole_records(file: &mut File) -> io::Result<(Pieces, u64)> {
    let file_byte = file.metadata()?.len();
    let mut pieces = Pieces::new();
    let mut end = HEAD;
    file.seek(SeekFrom::Start(HEAD))?;
    let mut reader = io::BufReader::with_capacity(1 << 16, file);
    while file_byte - end >= RECORD {
        let mut head = [0; 16];
        reader.read_exact(&mut head)?;
        let [k, length] = [0, 8].map(|at| {
            let mut number = [0; 8];
            number.copy_from_slice(&head[at..at + 8]);
            u64::from_le_bytes(number)
        });
        if length > file_byte - end - RECORD {
            break;
        }
        // Read through, not into memory: a record may be long, and a damaged one may claim to be.
        let mut hasher = crc32fast::Hasher::new();
        hasher.update(&head);
        let mut left = length;
        let mut buffer = [0; 1 << 14];
        while left > 0 {
            let n = usize::try_from(left.min(buffer.len() as u64)).unwrap_or(buffer.len());
            reader.read_exact(&mut buffer[..n])?;
            hasher.update(&buffer[..n]);
            left -= n as u64;
        }
        let mut sum = [0; 4];
        reader.read_exact(&mut sum)?;
        if hasher.finalize() != u32::from_le_bytes(sum) {
            break;
        }
        insert(&mut pieces, k, (end + 16, length));
        end += RECORD + length;
    }
    Ok((pieces, end))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    const KEY: [u8; 32] = [7; 32];

    fn filled(path: &Path) -> u64 {
        let checkpoint = Checkpoint::open(path, &KEY).unwrap();
        for k in [3, 0, 8] {
            checkpoint.keep(k, &vec![u8::try_from(k).unwrap(); 100 * usize::try_from(k).unwrap()]);
        }
        assert_eq!(checkpoint.failure(), None);
        path.metadata().unwrap().len()
    }

    #[test]
    fn pieces_come_back_and_a_file_that_is_cut_anywhere_keeps_the_whole_ones() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("c");
        let size = filled(&path);
        let whole = std::fs::read(&path).unwrap();
        for cut in (0..=size).step_by(7).chain([size]) {
            std::fs::write(&path, &whole[..usize::try_from(cut).unwrap()]).unwrap();
            let checkpoint = Checkpoint::open(&path, &KEY).unwrap();
            let expected = [376, 396, 1216].iter().filter(|&&end| cut >= end).count();
            assert_eq!(checkpoint.n_pieces(), expected, "{cut}");
            assert_eq!(checkpoint.piece(3), (expected > 0).then(|| vec![3; 300]));
            assert_eq!(checkpoint.piece(8), (expected > 2).then(|| vec![8; 800]));
            // What is written after a cut is found again.
            checkpoint.keep(9, b"nine");
            drop(checkpoint);
            let again = Checkpoint::open(&path, &KEY).unwrap();
            assert_eq!(
                (again.n_pieces(), again.piece(9).unwrap()),
                (expected + 1, b"nine".to_vec())
            );
        }
    }

    #[test]
    fn parts_do_not_mix_and_one_with_another_key_begins_anew() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("c");
        for is_second in [false, true] {
            let checkpoint = Checkpoint::open(&path, &KEY).unwrap();
            checkpoint.keep(7, b"first");
            checkpoint.begin_part(1, &[1; 32]);
            checkpoint.keep(7, b"second");
            checkpoint.begin_part(2, &[2; 32]);
            assert_eq!(checkpoint.piece(7).is_some(), is_second);
            checkpoint.keep(7, b"third");
            checkpoint.begin_part(1, &[1; 32]);
            assert_eq!(
                (checkpoint.piece(7).unwrap(), checkpoint.part()),
                (b"second".to_vec(), 1)
            );
            assert_eq!(checkpoint.n_pieces(), 3);
        }
        let checkpoint = Checkpoint::open(&path, &KEY).unwrap();
        checkpoint.begin_part(1, &[9; 32]);
        assert_eq!((checkpoint.piece(7), checkpoint.n_pieces()), (None, 2));
        drop(checkpoint);
        let again = Checkpoint::open(&path, &KEY).unwrap();
        assert_eq!((again.piece(7).unwrap(), again.n_pieces()), (b"first".to_vec(), 2));
        again.begin_part(1, &[9; 32]);
        assert_eq!(again.piece(7), None);
        again.begin_part(2, &[2; 32]);
        assert_eq!(again.piece(7).unwrap(), b"third");
    }

    #[test]
    fn a_flipped_bit_costs_a_piece_and_is_never_believed() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("c");
        let size = filled(&path);
        let whole = std::fs::read(&path).unwrap();
        for place in (0..usize::try_from(size).unwrap()).step_by(3) {
            let mut damaged = whole.clone();
            damaged[place] ^= 1 << (place % 8);
            std::fs::write(&path, &damaged).unwrap();
            match Checkpoint::open(&path, &KEY) {
                Ok(checkpoint) => {
                    assert!(place >= 56 && checkpoint.n_pieces() < 3, "{place}");
                    assert!(checkpoint.piece(3).is_none_or(|piece| piece == vec![3; 300]));
                }
                Err(error) => {
                    assert!(place < 56, "{place}: {error}");
                    assert_eq!(std::fs::read(&path).unwrap(), damaged, "left as it is");
                }
            }
        }
    }

    #[test]
    fn what_is_no_checkpoint_is_left_alone_and_one_process_has_it() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("scene.obj");
        std::fs::write(&path, "v 0 0 0\n").unwrap();
        let error = Checkpoint::open(&path, &KEY).unwrap_err();
        assert!(matches!(error, CheckpointError::NotACheckpoint { .. }));
        assert_eq!(std::fs::read(&path).unwrap(), b"v 0 0 0\n");
        assert!(matches!(
            Checkpoint::open(directory.path(), &KEY),
            Err(CheckpointError::NotACheckpoint { .. })
        ));
        let own = directory.path().join("c");
        let open = Checkpoint::open(&own, &KEY).unwrap();
        assert!(matches!(
            Checkpoint::open(&own, &KEY),
            Err(CheckpointError::InUse { .. })
        ));
        drop(open);
        assert!(matches!(
            Checkpoint::open(&own, &[8; 32]),
            Err(CheckpointError::OtherWork { .. })
        ));
        Checkpoint::open(&own, &KEY).unwrap().remove().unwrap();
        assert!(!own.exists());
    }
}
