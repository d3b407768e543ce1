//! A file of finished pieces of long work, which a later run reuses.
//!
//! A file is a head of 56 bytes (a name of the layout, then a key of the work) and records in the order in which pieces were
//! finished: the piece's number and the length of its content (u64 each), the content, and the CRC-32 of all these (u32); little-endian. Bytes after the
//! last complete record are those that a killed run was writing, and are dropped.
//!
//! Work of several stages stores each of them in a part of its own, with a key of its own: the upper 24 bits of a piece's number are those of its part, and the last
//! piece of a part is its key. A part that begins anew with another key has none of the earlier pieces.
//!
//! Each of several ranks writes a file of its own, `FILE.0`, `FILE.1` and so on, and reads those of all ranks of earlier runs, of any number; they have to be on a disk that all ranks share.

mod others;
mod records;

use std::collections::BTreeSet;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use thiserror::Error;

use crate::ranks::Ranks;
use others::{Other, file_of_rank, ranks_beside};
use records::{HEAD, LAYOUT, PART_KEY, PIECE_BITS, Pieces, checksum, content, in_part, insert, whole_records};

/// A reason why a checkpoint cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file system refuses access.
    #[error("{}: the checkpoint cannot be used: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's message.
        source: io::Error,
    },
    /// The file is not a checkpoint.
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
    /// Returns the reason as text, without the file's name for errors of the file system.
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

#[derive(Debug)]
struct State {
    file: File,
    /// The files of other ranks.
    others: Vec<Other>,
    /// The place of the next record.
    end: u64,
    pieces: Pieces,
    /// The current part.
    part: u32,
    /// The first error of storing a piece; no piece is stored after it.
    failed: Option<io::Error>,
}

impl Checkpoint {
    /// Opens the checkpoint of one of several ranks, `path` with the rank's number, and reads the pieces of all ranks of earlier runs.
    ///
    /// A single rank opens `path` itself.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_of_rank(path: &Path, key: &[u8; 32], ranks: &dyn Ranks) -> Result<Self, CheckpointError> {
        let (n, rank) = (ranks.size(), ranks.rank());
        let own = if n == 1 {
            path.to_owned()
        } else {
            file_of_rank(path, rank)
        };
        let checkpoint = Self::open(&own, key)?;
        let written = |other: usize| n > 1 && other < n;
        let of_ranks = ranks_beside(path)
            .into_iter()
            .map(|other| (file_of_rank(path, other), !written(other)));
        let of_one = std::iter::once((path.to_owned(), true));
        let others = of_one.chain(of_ranks).filter(|(other, _)| *other != own);
        checkpoint.state().others = others
            .filter_map(|(other, is_left)| Other::open(other, key, is_left))
            .collect();
        Ok(checkpoint)
    }

    /// Opens the checkpoint of the work with a `key` (a hash of its whole input), or begins one.
    ///
    /// # Errors
    /// [`CheckpointError`]: the file cannot be opened or written, is not a checkpoint, belongs to other work, or is in use.
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
            // The file is new, or its run was killed at once.
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
                others: Vec::new(),
                end,
                pieces,
                part: 0,
                failed: None,
            }),
        })
    }

    /// Returns the number of its pieces.
    #[must_use]
    pub fn n_pieces(&self) -> usize {
        let state = self.state();
        let others = state.others.iter().flat_map(|other| other.pieces.keys());
        let all = state.pieces.keys().chain(others).filter(|&k| k & PART_KEY != PART_KEY);
        all.collect::<BTreeSet<_>>().len()
    }

    /// Switches to another part, to which later pieces belong.
    ///
    /// Pieces of this part with another `key` are dropped.
    ///
    /// # Panics
    /// If `part` is not below 2^24.
    #[track_caller]
    pub fn begin_part(&self, part: u32, key: &[u8; 32]) {
        assert!(part < 1 << (64 - PIECE_BITS), "a number of 24 bits");
        let mut state = self.state();
        state.part = part;
        let k = in_part(part, PART_KEY);
        for Other { file, pieces, .. } in &mut state.others {
            if content(file, pieces, k).as_deref() != Some(key) {
                pieces.retain(|other, _| other >> PIECE_BITS != u64::from(part));
            }
        }
        let State { file, pieces, .. } = &mut *state;
        let is_known = content(file, pieces, k).as_deref() == Some(key);
        drop(state);
        if !is_known {
            self.keep(PART_KEY, key);
        }
    }

    /// Returns the current part; 0 at first.
    #[must_use]
    pub fn part(&self) -> u32 {
        self.state().part
    }

    /// Returns the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the content of a piece, or `None` if it is not stored or damaged.
    pub(crate) fn piece(&self, k: u64) -> Option<Vec<u8>> {
        self.contents(k).next()
    }

    /// Returns the contents of a piece in the files of all ranks that have one, this rank's first.
    pub(crate) fn contents(&self, k: u64) -> impl Iterator<Item = Vec<u8>> {
        let k = in_part(self.part(), k);
        (0..)
            .map_while(move |number| {
                let mut state = self.state();
                let State {
                    file, pieces, others, ..
                } = &mut *state;
                match number {
                    0 => Some(content(file, pieces, k)),
                    _ => others
                        .get_mut(number - 1)
                        .map(|other| content(&mut other.file, &other.pieces, k)),
                }
            })
            .flatten()
    }

    /// Returns whether a piece is stored.
    pub(crate) fn has(&self, k: u64) -> bool {
        let state = self.state();
        let k = in_part(state.part, k);
        let mut others = state.others.iter();
        state.pieces.contains_key(&k) || others.any(|other| other.pieces.contains_key(&k))
    }

    /// Stores a finished piece; a failure, such as a full disk, does not stop the work: see [`failure`](Self::failure).
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
                // The next run would drop an incomplete record, so its space is freed.
                let _ = state.file.set_len(end);
                state.failed = Some(error);
            }
        }
    }

    /// Returns the reason if pieces could not be stored.
    #[must_use]
    pub fn failure(&self) -> Option<String> {
        self.state().failed.as_ref().map(ToString::to_string)
    }

    /// Removes the file of finished work; the first rank also removes those that ranks of earlier runs left.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn remove(self, is_first: bool) -> Result<(), CheckpointError> {
        let state = self.state();
        let left = state.others.iter().filter(|other| is_first && other.is_left);
        let all: Vec<PathBuf> = std::iter::once(&self.path)
            .chain(left.map(|other| &other.path))
            .cloned()
            .collect();
        drop(state);
        for path in all {
            std::fs::remove_file(&path).map_err(|source| CheckpointError::Io { path, source })?;
        }
        Ok(())
    }

    fn state(&self) -> std::sync::MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
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
            // Pieces written after a cut are found again.
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

    /// A rank with a number of ranks, for which no other one waits.
    #[derive(Debug)]
    struct Rank(usize, usize);

    impl Ranks for Rank {
        fn size(&self) -> usize {
            self.1
        }
        fn rank(&self) -> usize {
            self.0
        }
        fn all_gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
            vec![own.to_vec(); self.1]
        }
    }

    #[test]
    fn ranks_find_what_others_kept_and_the_first_one_tidies_up() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("c");
        let open = |rank, n| Checkpoint::open_of_rank(&path, &KEY, &Rank(rank, n)).unwrap();
        for rank in 0..3 {
            let checkpoint = open(rank, 3);
            checkpoint.keep(10 + rank as u64, &[u8::try_from(rank).unwrap()]);
            checkpoint.begin_part(1, &[9; 32]);
            checkpoint.keep(rank as u64, b"part 1");
        }
        // A file that is no checkpoint, and a checkpoint of other work, belong to no rank.
        std::fs::write(directory.path().join("c.txt"), "v 0 0 0\n").unwrap();
        drop(Checkpoint::open(&directory.path().join("c.7"), &[8; 32]).unwrap());
        for (rank, n) in [(1, 2), (0, 1), (4, 5)] {
            let checkpoint = open(rank, n);
            assert_eq!(checkpoint.n_pieces(), 6);
            for k in 0..3 {
                assert_eq!(checkpoint.piece(10 + k), Some(vec![u8::try_from(k).unwrap()]));
                assert!(checkpoint.has(10 + k) && !checkpoint.has(k));
            }
            assert_eq!(checkpoint.contents(13).count(), 0);
            checkpoint.begin_part(1, &[9; 32]);
            assert_eq!(checkpoint.piece(2), Some(b"part 1".to_vec()));
        }
        // A part with another key also drops the pieces of other ranks.
        let checkpoint = open(1, 2);
        checkpoint.begin_part(1, &[7; 32]);
        assert_eq!(checkpoint.piece(2), None);
        drop(checkpoint);
        let (first, second) = (open(0, 2), open(1, 2));
        first.keep(10, b"again");
        assert_eq!(first.contents(10).collect::<Vec<_>>(), [b"again".to_vec()]);
        second.remove(false).unwrap();
        first.remove(true).unwrap();
        let entries = std::fs::read_dir(directory.path()).unwrap();
        let mut left: Vec<_> = entries.map(|e| e.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["c.7", "c.txt"]);
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
        Checkpoint::open(&own, &KEY).unwrap().remove(true).unwrap();
        assert!(!own.exists());
    }
}
