//! Results within a piece of work, stored one by one, as a piece may take hours.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::checkpoint::Checkpoint;
use crate::progress::Progress;

/// The first number of a journal's records, above those of all pieces.
const FIRST: u64 = 1 << 39;

/// The time above which a result is stored at once.
const DEAR: Duration = Duration::from_millis(1);

/// The number of quicker results that are stored together, which are a quarter of a second of work.
const CHEAP_AT_ONCE: usize = 256;

/// The layout mark at the beginning of every record.
const LAYOUT: u64 = u64::from_le_bytes(*b"journal2");

/// Numbers of one result: its place in the piece, then four of its own.
const NUMBERS: usize = 5;

/// The four numbers of a result.
pub(super) type Record = [u64; NUMBERS - 1];

/// The results of the current piece, stored in the checkpoint after all finished pieces.
pub(super) struct Journal<'a> {
    checkpoint: Option<&'a Checkpoint>,
    piece: u64,
    /// False before the first piece.
    begun: bool,
    /// The part of the piece that an earlier run finished.
    found: HashMap<u64, Record>,
    /// The remainder of other pieces, on which other ranks worked.
    of_others: HashMap<u64, HashMap<u64, Record>>,
    /// The number of the next record, and its results.
    pending: Mutex<(u64, Vec<(u64, Record)>)>,
}

impl<'a> Journal<'a> {
    /// Returns a journal of no piece; it stores nothing without a checkpoint.
    pub(super) fn new(progress: &'a dyn Progress) -> Self {
        Self {
            checkpoint: progress.checkpoint(),
            piece: 0,
            begun: false,
            found: HashMap::new(),
            of_others: HashMap::new(),
            pending: Mutex::default(),
        }
    }

    /// Begins a piece. Pieces are computed one after the other: an earlier run left one unfinished piece for each of its ranks.
    pub(super) fn begin(&mut self, piece: u64) {
        self.piece = piece;
        self.found = self.of_others.remove(&piece).unwrap_or_default();
        let pending = self.pending.get_mut().unwrap_or_else(PoisonError::into_inner);
        pending.1.clear();
        if std::mem::replace(&mut self.begun, true) {
            return;
        }
        let Some(checkpoint) = self.checkpoint else { return };
        let mut next = FIRST;
        while checkpoint.has(next) {
            for (of_piece, results) in checkpoint.contents(next).filter_map(|bytes| decode(&bytes)) {
                if !checkpoint.has(of_piece) {
                    self.of_others.entry(of_piece).or_default().extend(results);
                }
            }
            next += 1;
        }
        pending.0 = next;
        self.found = self.of_others.remove(&piece).unwrap_or_default();
    }

    /// Returns the result at a place of the piece, if an earlier run stored it.
    pub(super) fn get(&self, place: usize) -> Option<Record> {
        self.found.get(&(place as u64)).copied()
    }

    /// Stores a result that took `took`.
    pub(super) fn keep(&self, place: usize, record: Record, took: Duration) {
        let Some(checkpoint) = self.checkpoint else { return };
        let mut pending = self.pending.lock().unwrap_or_else(PoisonError::into_inner);
        let (next, results) = &mut *pending;
        results.push((place as u64, record));
        if took < DEAR && results.len() < CHEAP_AT_ONCE {
            return;
        }
        let mut bytes = Vec::with_capacity(8 * (2 + NUMBERS * results.len()));
        let mut number = |n: u64| bytes.extend(n.to_le_bytes());
        number(LAYOUT);
        number(self.piece);
        for (place, record) in results.drain(..) {
            number(place);
            record.into_iter().for_each(&mut number);
        }
        checkpoint.keep(*next, &bytes);
        *next += 1;
    }
}

/// Returns the piece of a record and the results in it; `None` for any other record.
fn decode(bytes: &[u8]) -> Option<(u64, Vec<(u64, Record)>)> {
    let (numbers, []) = bytes.as_chunks::<8>() else {
        return None;
    };
    let numbers: Vec<u64> = numbers.iter().map(|&number| u64::from_le_bytes(number)).collect();
    let [LAYOUT, of_piece, results @ ..] = numbers.as_slice() else {
        return None;
    };
    let (results, []) = results.as_chunks::<NUMBERS>() else {
        return None;
    };
    let results = results.iter().map(|&[place, ref own @ ..]| (place, *own));
    Some((*of_piece, results.collect()))
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    struct Kept(Checkpoint);

    impl Progress for Kept {
        fn begin(&self, _stage: &str, _total: u64) {}
        fn advance(&self, _steps: u64) {}
        fn checkpoint(&self) -> Option<&Checkpoint> {
            Some(&self.0)
        }
    }

    #[test]
    fn results_of_the_piece_come_back_and_no_others() {
        let directory = tempfile::tempdir().unwrap();
        let open = || Kept(Checkpoint::open(&directory.path().join("c"), &[3; 32]).unwrap());
        let kept = open();
        let mut journal = Journal::new(&kept);
        journal.begin(5);
        journal.keep(0, [1, 2, 3, 4], DEAR);
        for place in 1..=CHEAP_AT_ONCE + 1 {
            journal.keep(place, [place as u64; 4], Duration::ZERO);
        }
        // The record belongs to another piece, and the unwritten results of the last one are gone.
        journal.begin(6);
        journal.keep(7, [7; 4], DEAR);
        drop(journal);
        drop(kept);
        let again = open();
        let mut journal = Journal::new(&again);
        journal.begin(5);
        assert_eq!(journal.get(0), Some([1, 2, 3, 4]));
        let of = |journal: &Journal<'_>| (0..=CHEAP_AT_ONCE + 1).filter(|&k| journal.get(k).is_some()).count();
        assert_eq!(of(&journal), 1 + CHEAP_AT_ONCE);
        journal.keep(9999, [9; 4], DEAR);
        journal.begin(6);
        assert_eq!(
            (of(&journal), journal.get(7)),
            (1, Some([7; 4])),
            "another unfinished piece"
        );
        // A piece that is finished needs no results of its own.
        again.0.keep(6, b"finished");
        drop(journal);
        drop(again);
        let last = open();
        let mut journal = Journal::new(&last);
        journal.begin(6);
        assert_eq!(of(&journal), 0);
        journal.begin(5);
        assert_eq!((of(&journal), journal.get(9999)), (1 + CHEAP_AT_ONCE, Some([9; 4])));
    }

    #[test]
    fn what_is_no_record_is_left() {
        let record: Vec<u8> = [LAYOUT, 5, 1, 2, 3, 4, 5]
            .iter()
            .flat_map(|n| n.to_le_bytes())
            .collect();
        assert_eq!(decode(&record), Some((5, vec![(1, [2, 3, 4, 5])])));
        for cut in 17..record.len() {
            assert_eq!(decode(&record[..cut]), None, "{cut}");
        }
        assert_eq!(decode(&record[8..]), None);
    }
}
