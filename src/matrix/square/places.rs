//! The occupancy bitmap of a square tile.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::{Arch, cast};

use crate::matrix::kernel::aligned::LINE_BYTE;
use crate::matrix::kernel::prefetch::prefetch;
use crate::matrix::kernel::shared::Shared;
use crate::matrix::kernel::sizes::{SIDE, STRIP, ones};

const _: () = assert!(SIDE == u64::BITS as usize, "a bit for each row of a strip");
const _: () = assert!(STRIP == u16::BITS as usize, "a bit for each column of a strip");

/// The places with an entry, of at most [`SIDE`] by [`SIDE`], in strips of [`STRIP`] columns.
///
/// Entries are counted strip by strip, and row by row in each. Memory: 16 bytes for each strip with an entry, and 2 for each of its rows with one.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::matrix) struct Places {
    /// The strips with entries, in order.
    strips: Shared<Strip>,
    /// For each row with entries of each strip in turn, the bits of its columns.
    masks: Shared<u16>,
}

/// Some columns of a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Strip {
    /// Bit i is set where row i has an entry.
    rows: u64,
    /// The number of the strip's first entry.
    first: u16,
    /// The number of the strip's first mask.
    first_mask: u16,
    /// The first column, by [`STRIP`].
    number: u32,
}

/// The entries of one strip.
pub(in crate::matrix) struct StripPlaces<'a> {
    /// The first column, by [`STRIP`].
    pub(in crate::matrix) number: usize,
    /// Bit i is set where row i has an entry.
    pub(in crate::matrix) rows: u64,
    /// For each such row in order, the bits of the columns with an entry.
    pub(in crate::matrix) masks: &'a [u16],
    /// The number of the first entry.
    pub(in crate::matrix) first: usize,
}

/// The entries of one row or column, in order.
pub(in crate::matrix) struct Line {
    n: usize,
    places: [u8; SIDE],
    numbers: [u16; SIDE],
}

impl Line {
    fn empty() -> Self {
        Self {
            n: 0,
            places: [0; SIDE],
            numbers: [0; SIDE],
        }
    }

    /// Adds an entry, or a placeholder that the next one replaces.
    #[inline(always)]
    fn push(&mut self, is_one: bool, place: usize, number: usize) {
        let slot = self.n % SIDE;
        self.places[slot] = narrow(place);
        self.numbers[slot] = narrow(number);
        self.n += usize::from(is_one);
    }

    /// Returns (column, number) of each entry of a row, or (row, number) of each of a column.
    pub(in crate::matrix) fn entries(&self) -> impl Iterator<Item = (usize, usize)> {
        let pairs = self.places.iter().zip(&self.numbers).take(self.n);
        pairs.map(|(&place, &number)| (place.into(), number.into()))
    }

    /// Returns the columns of a row's entries, or the rows of a column's.
    pub(in crate::matrix) fn places(&self) -> &[u8] {
        &self.places[..self.n]
    }
}

/// The most masks of a tile.
const N_MASKS: usize = SIDE / STRIP * SIDE;

impl Places {
    /// Makes places from (row, column) in the order in which entries are counted.
    pub(in crate::matrix) fn new(places: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let (mut strips, mut masks) = (Vec::<Strip>::new(), Vec::<u16>::new());
        for (n_before, (row, column)) in places.into_iter().enumerate() {
            let number = narrow(column / STRIP);
            if strips.last().is_none_or(|strip| strip.number != number) {
                debug_assert!(
                    strips.last().is_none_or(|strip| strip.number < number),
                    "strips in order"
                );
                strips.push(Strip {
                    rows: 0,
                    first: narrow(n_before),
                    first_mask: narrow(masks.len()),
                    number,
                });
            }
            let strip = strips.last_mut().expect("the strip was added");
            if strip.rows >> row & 1 == 0 {
                strip.rows |= 1 << row;
                masks.push(0);
            }
            let mask = masks.last_mut().expect("the row was added");
            debug_assert!(
                strip.rows >> row == 1 && *mask >> (column % STRIP) == 0,
                "places in order"
            );
            *mask |= 1 << (column % STRIP);
        }
        Self::of(strips.into_iter(), masks.into_iter())
    }

    fn of(strips: impl Iterator<Item = Strip>, masks: impl Iterator<Item = u16>) -> Self {
        Self {
            strips: Shared::new(strips, 0, Strip::default()),
            masks: Shared::new(masks, 0, 0),
        }
    }

    /// Moves places into one piece of memory, in order.
    pub(in crate::matrix) fn join<'a>(places: impl Iterator<Item = &'a mut Self>) {
        let (strips, masks): (Vec<_>, Vec<_>) = places.map(|of| (&mut of.strips, &mut of.masks)).unzip();
        Shared::join(strips.into_iter(), 0, Strip::default());
        Shared::join(masks.into_iter(), 0, 0);
    }

    /// Returns the strips that have entries.
    #[inline(always)]
    pub(in crate::matrix) fn strips(&self) -> impl Iterator<Item = StripPlaces<'_>> {
        let masks: &[u16] = &self.masks;
        self.strips.iter().map(|strip| StripPlaces {
            number: strip.number as usize,
            rows: strip.rows,
            masks: &masks[strip.first_mask.into()..],
            first: strip.first.into(),
        })
    }

    /// Prefetches the bytes about one tile behind these places.
    #[inline(always)]
    pub(in crate::matrix) fn ask_behind(&self) {
        prefetch(&self.strips, 2 * SIDE / STRIP);
        for line in (0..N_MASKS).step_by(LINE_BYTE / size_of::<u16>()) {
            prefetch(&self.masks, N_MASKS + line);
        }
    }

    /// Returns the columns and the numbers of the entries in a row.
    pub(in crate::matrix) fn row(&self, row: usize) -> Line {
        // Counting bits is one instruction on all but the oldest processors.
        Arch::new().dispatch(|| self.find_row(row))
    }

    /// Returns the rows and the numbers of the entries in a column.
    pub(in crate::matrix) fn column(&self, column: usize) -> Line {
        Arch::new().dispatch(|| self.find_column(column))
    }

    #[inline(always)]
    fn find_row(&self, row: usize) -> Line {
        let mut found = Line::empty();
        for strip in self.strips().filter(|strip| strip.rows >> row & 1 == 1) {
            let (before, own) = strip.masks.split_at(below(strip.rows, row));
            let first = strip.first + count(before);
            for (number, lane) in (first..).zip(ones(own[0].into())) {
                found.push(true, strip.number * STRIP + lane, number);
            }
        }
        found
    }

    #[inline(always)]
    fn find_column(&self, column: usize) -> Line {
        let mut found = Line::empty();
        let lane = column % STRIP;
        for strip in self.strips().filter(|strip| strip.number == column / STRIP) {
            let mut first = strip.first;
            // Whether a row has an entry here is as good as random: a placeholder is written over, without a branch.
            for (row, &mask) in ones(strip.rows).zip(strip.masks) {
                found.push(mask >> lane & 1 == 1, row, first + below(mask.into(), lane));
                first += mask.count_ones() as usize;
            }
        }
        found
    }

    /// Returns (row, column) of all entries in order.
    pub(in crate::matrix) fn all(&self) -> impl Iterator<Item = (usize, usize)> {
        self.strips().flat_map(|strip| {
            let of_rows = ones(strip.rows).zip(strip.masks);
            of_rows.flat_map(move |(row, &mask)| ones(mask.into()).map(move |lane| (row, strip.number * STRIP + lane)))
        })
    }

    /// Returns the number of strips with entries, and of their rows with entries.
    pub(in crate::matrix) fn size(&self) -> [usize; 2] {
        [self.strips.len(), self.masks.len()]
    }

    /// Returns the bytes, in memory and in a file, of places of a [`size`](Self::size).
    pub(in crate::matrix) fn byte([n_strips, n_masks]: [usize; 2]) -> usize {
        n_strips * size_of::<Strip>() + n_masks * size_of::<u16>()
    }

    /// Appends the bytes of [`from_bytes`](Self::from_bytes).
    pub(in crate::matrix) fn push_bytes(&self, bytes: &mut Vec<u8>) {
        for strip in self.strips.iter() {
            bytes.extend(strip.rows.to_ne_bytes());
            bytes.extend(strip.first.to_ne_bytes());
            bytes.extend(strip.first_mask.to_ne_bytes());
            bytes.extend(strip.number.to_ne_bytes());
        }
        bytes.extend(self.masks.iter().flat_map(|mask| mask.to_ne_bytes()));
    }

    /// Returns the places of a [`size`](Self::size) from their bytes, and the bytes that follow.
    pub(in crate::matrix) fn from_bytes(size: [usize; 2], bytes: &[u8]) -> (Self, &[u8]) {
        let (own, rest) = bytes.split_at(Self::byte(size));
        let (strips, masks) = own.split_at(Self::byte([size[0], 0]));
        let strips = strips.as_chunks::<{ size_of::<Strip>() }>().0.iter();
        let strip = |&[a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p]: &[u8; size_of::<Strip>()]| Strip {
            rows: u64::from_ne_bytes([a, b, c, d, e, f, g, h]),
            first: u16::from_ne_bytes([i, j]),
            first_mask: u16::from_ne_bytes([k, l]),
            number: u32::from_ne_bytes([m, n, o, p]),
        };
        let masks = masks.as_chunks().0.iter().map(|mask| u16::from_ne_bytes(*mask));
        (Self::of(strips.map(strip), masks), rest)
    }
}

/// Returns a number of at most a tile's places in a narrower type.
#[inline(always)]
fn narrow<T: TryFrom<usize>>(number: usize) -> T {
    T::try_from(number).unwrap_or_else(|_| unreachable!("a tile has at most 4096 places"))
}

/// Returns the number of set bits.
#[inline(always)]
fn count(masks: &[u16]) -> usize {
    let (fours, rest) = masks.as_chunks::<4>();
    let of_fours = fours.iter().map(|four| cast::<_, u64>(*four).count_ones());
    let of_rest = rest.iter().map(|mask| mask.count_ones());
    of_fours.chain(of_rest).sum::<u32>() as usize
}

/// Returns the number of set bits below bit `end`, which is at most 63.
#[inline(always)]
fn below(bits: u64, end: usize) -> usize {
    (bits & ((1 << end) - 1)).count_ones() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_found_by_rows_and_by_columns() {
        let somewhere = |&(row, column): &(usize, usize)| {
            row % 7 != 3 && column / STRIP != 2 && (31 * row + 17 * column).is_multiple_of(5)
        };
        let everywhere = || {
            let strip =
                |first: usize| (0..64).flat_map(move |row| (first..first + STRIP).map(move |column| (row, column)));
            (0..64).step_by(STRIP).flat_map(strip)
        };
        for listed in [
            everywhere().filter(somewhere).collect::<Vec<_>>(),
            everywhere().collect(),
            vec![(63, 63)],
            Vec::new(),
        ] {
            let places = Places::new(listed.iter().copied());
            assert!(places.all().eq(listed.iter().copied()));
            let [n_strips, n_masks] = places.size();
            assert_eq!(n_strips, listed.chunk_by(|a, b| a.1 / STRIP == b.1 / STRIP).count());
            let same_row = |a: &(usize, usize), b: &(usize, usize)| (a.0, a.1 / STRIP) == (b.0, b.1 / STRIP);
            assert_eq!(n_masks, listed.chunk_by(same_row).count());
            for k in 0..64 {
                let numbered = || listed.iter().enumerate();
                let in_row = numbered().filter(|(_, place)| place.0 == k);
                assert!(places.row(k).entries().eq(in_row.map(|(at, place)| (place.1, at))));
                let in_column = numbered().filter(|(_, place)| place.1 == k);
                assert!(
                    places
                        .column(k)
                        .entries()
                        .eq(in_column.map(|(at, place)| (place.0, at)))
                );
                assert_eq!(places.row(k).places().len(), places.row(k).entries().count());
            }
            let mut bytes = Vec::new();
            places.push_bytes(&mut bytes);
            assert_eq!(bytes.len(), Places::byte([n_strips, n_masks]));
            bytes.push(7);
            assert_eq!(Places::from_bytes([n_strips, n_masks], &bytes), (places, &[7_u8][..]));
        }
    }
}
