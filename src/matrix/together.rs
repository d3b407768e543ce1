//! Ranks that work on one matrix: the rows of each rank, and access to those of others.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::backend::{Backend, Sizes};
use super::choice::StorageChoice;
use super::form_factors::FormFactors;
use super::kernel::sizes::SIDE;
use super::operator::Block;
use super::team::{Team, rows_of};
use super::tile::{Entry, RowTally, RowTile, index};
use crate::threads;

/// The rows of a rank of several.
#[derive(Clone, Debug)]
pub(in crate::matrix) struct Share {
    /// The blocks of rows that are this rank's.
    pub(in crate::matrix) blocks: Range<usize>,
    /// The rows of these.
    pub(in crate::matrix) rows: Range<usize>,
    team: Arc<Team>,
}

impl Share {
    /// Returns the rows of an n by n matrix that are this rank's; `None` for a process alone.
    pub(in crate::matrix) fn of(n: usize, choice: StorageChoice<'_>) -> Option<Self> {
        let team = choice.ranks?.0;
        let blocks = team.own_blocks(n);
        Some(Self {
            rows: rows_of(n, &blocks),
            blocks,
            team: Arc::clone(team),
        })
    }

    /// Adds up what the ranks store. Collective.
    pub(in crate::matrix) fn add_up(&self, own: Sizes) -> Sizes {
        let counts = [own.n_nonzero, own.pass_byte, own.stored_byte].map(|count| (count as u64).to_le_bytes());
        let of_ranks = self.team.ranks().all_gather(counts.as_flattened());
        let of_rank = |bytes: &Vec<u8>| {
            let count = |k: usize| usize::try_from(u64::from_le_bytes(bytes.as_chunks().0[k])).unwrap_or(usize::MAX);
            Sizes {
                n_nonzero: count(0),
                pass_byte: count(1),
                stored_byte: count(2),
            }
        };
        of_ranks.iter().map(of_rank).sum()
    }

    /// Fills in the rows of other ranks. Collective.
    pub(in crate::matrix) fn complete(&self, y: &mut Block) {
        let n_channels = y.n_channels();
        let own = self.rows.start * n_channels..self.rows.end * n_channels;
        let all = self.team.ranks().all_gather_numbers(&y.values()[own]);
        y.values_mut().copy_from_slice(&all);
    }

    /// Calls `act` with the rows of blocks of all ranks, some of each rank at a time: `sent` yields this rank's. Collective.
    pub(in crate::matrix) fn exchange(&self, sent: impl Iterator<Item = RowTile>, mut act: impl FnMut(Vec<RowTile>)) {
        let mut sent = sent;
        loop {
            let own = sent.next().map_or_else(Vec::new, |tile| encode(&tile));
            let came = self.team.ranks().all_gather(&own);
            if came.iter().all(Vec::is_empty) {
                return;
            }
            act(threads::collect_flat(came.len(), |rank| decode(&came[rank])));
        }
    }
}

/// The ranks of form factors, and the rows of others that this one has.
#[derive(Debug)]
pub(super) struct Together {
    pub(super) team: Arc<Team>,
    /// All rows, once they were gathered.
    whole: OnceLock<Option<Arc<dyn Backend>>>,
    /// True on the first rank while the others send it the rows that it reads.
    is_served: AtomicBool,
    /// The blocks of rows received last.
    came: Mutex<VecDeque<Arc<RowTile>>>,
}

impl Together {
    pub(super) fn new(team: &Arc<Team>) -> Self {
        Self {
            team: Arc::clone(team),
            whole: OnceLock::new(),
            is_served: AtomicBool::new(false),
            came: Mutex::default(),
        }
    }

    fn is_served(&self) -> bool {
        self.is_served.load(Ordering::Relaxed)
    }

    /// Returns the rows of a block that another rank stores.
    #[track_caller]
    fn fetched(&self, block: usize) -> Arc<RowTile> {
        assert!(
            self.is_served(),
            "rows of block {block} are read on the rank that stores them"
        );
        let first_row = block * SIDE;
        let mut came = self.came.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = came.iter().find(|tile| tile.first_row() == first_row) {
            return Arc::clone(found);
        }
        self.team.ranks().all_gather(&(block as u64).to_le_bytes());
        let sent = self.team.ranks().all_gather(&[]).concat();
        let tile = Arc::new(decode(&sent).expect("the rank that stores the rows sends them"));
        if came.len() > rayon::current_num_threads() {
            came.pop_front();
        }
        came.push_back(Arc::clone(&tile));
        tile
    }
}

/// Joins parts, each behind its length.
pub(in crate::matrix) fn with_lengths(parts: &[Vec<u8>]) -> Vec<u8> {
    let parts = parts.iter();
    let with_lengths = parts.map(|part| [&(part.len() as u64).to_le_bytes(), &part[..]].concat());
    with_lengths.collect::<Vec<_>>().concat()
}

/// Returns the parts that [`with_lengths`] joined.
pub(in crate::matrix) fn parts(mut bytes: &[u8]) -> Vec<&[u8]> {
    let mut parts = Vec::new();
    while let Some((length, after)) = bytes.split_first_chunk() {
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let (part, rest) = after.split_at(length);
        parts.push(part);
        bytes = rest;
    }
    parts
}

/// Returns the bytes of rows.
pub(in crate::matrix) fn encode(tile: &RowTile) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(20 * tile.n_entries() + 8 * tile.n_rows() + 8);
    bytes.extend((tile.first_row() as u64).to_le_bytes());
    for k in 0..tile.n_rows() {
        bytes.extend((tile.row(k).len() as u64).to_le_bytes());
        for &(j, value, error) in tile.row(k) {
            bytes.extend(j.to_le_bytes());
            bytes.extend(value.to_le_bytes());
            bytes.extend(error.to_le_bytes());
        }
    }
    bytes
}

/// Returns rows from their bytes; `None` without bytes.
pub(in crate::matrix) fn decode(bytes: &[u8]) -> Option<RowTile> {
    let (first_row, mut rest) = bytes.split_first_chunk()?;
    let mut tile = RowTile::new(usize::try_from(u64::from_le_bytes(*first_row)).unwrap_or(usize::MAX));
    let mut row: Vec<Entry> = Vec::new();
    while let Some((n, after)) = rest.split_first_chunk() {
        let n = usize::try_from(u64::from_le_bytes(*n)).unwrap_or(usize::MAX);
        let (own, others) = after.as_chunks::<20>().0.split_at(n);
        row.clear();
        row.extend(own.iter().map(entry));
        tile.push_row(&row, RowTally::default());
        rest = &after[20 * n..];
        debug_assert_eq!(rest.len() / 20, others.len());
    }
    Some(tile)
}

fn entry(bytes: &[u8; 20]) -> Entry {
    let (column, numbers) = bytes.split_first_chunk().expect("20 bytes");
    let (value, error) = numbers.split_first_chunk().expect("16 bytes");
    let error = error.first_chunk().expect("8 bytes");
    (
        u32::from_le_bytes(*column),
        f64::from_le_bytes(*value),
        f64::from_le_bytes(*error),
    )
}

/// Returns the stored numbers of some rows in some columns.
pub(in crate::matrix) fn stored_rows(
    entries: &dyn Backend,
    rows: Range<usize>,
    columns: impl Fn(usize) -> Range<usize>,
) -> RowTile {
    let mut tile = RowTile::new(rows.start);
    let mut row = Vec::new();
    for i in rows {
        row.clear();
        entries.for_each(i, columns(i), &mut |j, value, error| row.push((index(j), value, error)));
        tile.push_row(&row, RowTally::default());
    }
    tile
}

impl FormFactors {
    /// Returns the rows that this rank works on: all if it works alone.
    pub(crate) fn own_rows(&self) -> Range<usize> {
        let n = self.n_rows();
        match &self.together {
            Some(together) if !together.is_served() => rows_of(n, &together.team.own_blocks(n)),
            _ => 0..n,
        }
    }

    /// Returns the numbers of all ranks, one rank after the other. Collective.
    pub(crate) fn gathered(&self, own: Vec<f64>) -> Vec<f64> {
        match &self.together {
            Some(together) if !together.is_served() => together.team.ranks().all_gather_numbers(&own),
            _ => own,
        }
    }

    /// Returns N numbers of each row, of which each rank computes those of its own rows. Collective.
    pub(crate) fn numbers_of_rows<const N: usize>(
        &self,
        of_row: impl Fn(usize) -> [f64; N] + Sync + Send,
    ) -> Vec<[f64; N]> {
        let rows = self.own_rows();
        let own: Vec<[f64; N]> = threads::collect(rows.len(), |k| of_row(rows.start + k));
        self.gathered(own.into_flattened()).as_chunks().0.to_vec()
    }

    /// Does work on the first rank that reads rows one after the other; the others send it theirs and return `None`. Collective.
    pub(crate) fn by_first<R>(&self, work: impl FnOnce() -> R) -> Option<R> {
        let Some(together) = &self.together else {
            return Some(work());
        };
        let held = self.held_rows();
        if together.team.ranks().is_first() {
            together.is_served.store(true, Ordering::Relaxed);
            let result = work();
            together.is_served.store(false, Ordering::Relaxed);
            together.came.lock().unwrap_or_else(PoisonError::into_inner).clear();
            if held.is_some() {
                together.team.ranks().all_gather(&[]);
            }
            return Some(result);
        }
        let held = held?;
        let n = self.n_rows();
        // An empty message ends the work.
        while let Some(block) = together.team.ranks().all_gather(&[])[0].first_chunk() {
            let block = usize::try_from(u64::from_le_bytes(*block)).unwrap_or(usize::MAX);
            let rows = rows_of(n, &(block..block + 1));
            let bytes = if held.contains(&rows.start) {
                encode(&stored_rows(&*self.entries, rows, |_| 0..n))
            } else {
                Vec::new()
            };
            together.team.ranks().all_gather(&bytes);
        }
        None
    }

    /// Returns the tiles of all ranks, rank by rank. Collective.
    pub(super) fn sent_by_all(&self, own: &[RowTile]) -> Vec<RowTile> {
        let Some(together) = &self.together else {
            return own.to_vec();
        };
        let own = threads::collect_from(own, encode);
        let came = together.team.ranks().all_gather(&with_lengths(&own));
        let tiles: Vec<&[u8]> = came.iter().flat_map(|bytes| parts(bytes)).collect();
        threads::collect_flat(tiles.len(), |k| decode(tiles[k]))
    }

    /// Gathers all rows on every rank, which stores them as long as the matrix. Collective.
    pub(crate) fn gather_rows(&self) {
        if let Some(together) = &self.together {
            together.whole.get_or_init(|| self.entries.whole());
        }
    }

    /// Returns the rows that this rank stores where it does not store all.
    pub(crate) fn held_rows(&self) -> Option<Range<usize>> {
        let whole = self.together.as_ref().and_then(|together| together.whole.get());
        match whole {
            Some(Some(_)) => None,
            _ => self.entries.held_rows(),
        }
    }

    /// Returns the matrix with all rows where these were gathered, otherwise the stored part.
    pub(super) fn by_rows(&self) -> &dyn Backend {
        let whole = self.together.as_ref().and_then(|together| together.whole.get());
        match whole {
            Some(Some(whole)) => &**whole,
            _ => &*self.entries,
        }
    }

    /// Calls `visit(j, number, standard error)` for the stored numbers of row i in `columns`, without the factor of the row.
    ///
    /// # Panics
    /// If another rank stores the row, and this one does not receive it: see [`by_first`](Self::by_first).
    #[track_caller]
    pub(super) fn for_each_number(&self, i: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        match (&self.together, self.held_rows()) {
            (Some(together), Some(held)) if !held.contains(&i) => {
                let tile = together.fetched(i / SIDE);
                let row = tile.row(i % SIDE);
                let begin = row.partition_point(|entry| (entry.0 as usize) < columns.start);
                let wanted = row[begin..].iter().take_while(|entry| (entry.0 as usize) < columns.end);
                wanted.for_each(|&(j, value, error)| visit(j as usize, value, error));
            }
            _ => self.by_rows().for_each(i, columns, visit),
        }
    }
}
