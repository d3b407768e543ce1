//! Which places of a square tile have an entry.

use super::square::SIDE;

const _: () = assert!(SIDE == u64::BITS as usize, "a bit for each column");

/// Places of at most [`SIDE`] by [`SIDE`] that have an entry; entries are counted row by row.
///
/// Memory: 8 bytes, and 10 for each row with an entry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Places {
    /// Bit i is set where row i has an entry.
    rows: u64,
    /// For each such row in order, the bits of the columns with an entry.
    columns: Box<[u64]>,
    /// The number of each such row's first entry.
    firsts: Box<[u16]>,
}

/// The entries of one row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RowPlaces {
    /// Bit j is set where column j has an entry.
    pub(super) columns: u64,
    /// The number of the first entry.
    pub(super) first: usize,
}

/// The entries of one column.
pub(super) struct ColumnPlaces {
    n: usize,
    rows: [usize; SIDE],
    numbers: [usize; SIDE],
}

impl ColumnPlaces {
    /// Returns the rows of the entries.
    pub(super) fn rows(&self) -> &[usize] {
        &self.rows[..self.n]
    }

    /// Returns the numbers of the entries.
    pub(super) fn numbers(&self) -> &[usize] {
        &self.numbers[..self.n]
    }
}

impl Places {
    /// Takes places (row, column) in the order of rows, then columns.
    pub(super) fn new(places: impl IntoIterator<Item = (usize, usize)>) -> Self {
        let mut rows = 0;
        let mut columns = Vec::new();
        let mut firsts = Vec::new();
        for (n_before, (row, column)) in (0..).zip(places) {
            if rows & (1 << row) == 0 {
                rows |= 1 << row;
                columns.push(0);
                firsts.push(n_before);
            }
            let in_row: &mut u64 = columns.last_mut().expect("the row was added");
            debug_assert!(rows >> row == 1 && *in_row >> column == 0, "places in order");
            *in_row |= 1 << column;
        }
        Self {
            rows,
            columns: columns.into(),
            firsts: firsts.into(),
        }
    }

    /// Returns a row's entries, none where it has none.
    pub(super) fn row(&self, row: usize) -> RowPlaces {
        if self.rows >> row & 1 == 0 {
            return RowPlaces { columns: 0, first: 0 };
        }
        self.nth(below(self.rows, row))
    }

    /// Returns the rows that have entries.
    pub(super) fn rows(&self) -> impl Iterator<Item = (usize, RowPlaces)> {
        let of_rows = self.columns.iter().zip(&self.firsts);
        ones(self.rows).zip(of_rows).map(|(row, (&columns, &first))| {
            let first = first.into();
            (row, RowPlaces { columns, first })
        })
    }

    /// Returns the rows and the numbers of the entries in a column.
    pub(super) fn column(&self, column: usize) -> ColumnPlaces {
        let mut found = ColumnPlaces {
            n: 0,
            rows: [0; SIDE],
            numbers: [0; SIDE],
        };
        // Whether a row has an entry here is as good as random: what is not one is written over, without a branch.
        for (row, in_row) in self.rows() {
            let slot = found.n % SIDE;
            found.rows[slot] = row;
            found.numbers[slot] = in_row.first + in_row.n_below(column);
            found.n += (in_row.columns >> column & 1) as usize;
        }
        found
    }

    /// Returns (row, column) of all entries in order.
    pub(super) fn all(&self) -> impl Iterator<Item = (usize, usize)> {
        self.rows()
            .flat_map(|(row, places)| ones(places.columns).map(move |column| (row, column)))
    }

    /// Returns how many rows have entries.
    pub(super) fn n_rows(&self) -> usize {
        self.columns.len()
    }

    /// Returns the bytes, in memory and in a file, of places in so many rows.
    pub(super) fn byte(n_rows: usize) -> usize {
        size_of::<u64>() + n_rows * (size_of::<u64>() + size_of::<u16>())
    }

    /// Appends the bytes of [`from_bytes`](Self::from_bytes).
    pub(super) fn push_bytes(&self, bytes: &mut Vec<u8>) {
        bytes.extend(self.rows.to_ne_bytes());
        bytes.extend(self.columns.iter().flat_map(|columns| columns.to_ne_bytes()));
        bytes.extend(self.firsts.iter().flat_map(|first| first.to_ne_bytes()));
    }

    /// Returns the places from the bytes of `n_rows` rows with entries, and the bytes that follow.
    pub(super) fn from_bytes(n_rows: usize, bytes: &[u8]) -> (Self, &[u8]) {
        let (own, rest) = bytes.split_at(Self::byte(n_rows));
        let (words, _) = own[..8 * (1 + n_rows)].as_chunks::<8>();
        let (firsts, _) = own[8 * (1 + n_rows)..].as_chunks::<2>();
        let places = Self {
            rows: u64::from_ne_bytes(words[0]),
            columns: words[1..].iter().map(|&word| u64::from_ne_bytes(word)).collect(),
            firsts: firsts.iter().map(|&first| u16::from_ne_bytes(first)).collect(),
        };
        (places, rest)
    }

    /// Returns the k-th row that has entries.
    fn nth(&self, k: usize) -> RowPlaces {
        RowPlaces {
            columns: self.columns[k],
            first: self.firsts[k].into(),
        }
    }
}

impl RowPlaces {
    /// Returns how many of the entries are in columns below `column`.
    pub(super) fn n_below(self, column: usize) -> usize {
        below(self.columns, column)
    }
}

/// Returns how many bits below bit `end` are set; `end` is at most 64.
#[inline]
pub(super) fn below(bits: u64, end: usize) -> usize {
    let kept = if end < 64 { bits & ((1 << end) - 1) } else { bits };
    kept.count_ones() as usize
}

/// Returns the numbers of the bits that are set, in ascending order.
#[inline]
pub(super) fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let next = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        next
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_found_by_rows_and_by_columns() {
        let somewhere = |&(row, column): &(usize, usize)| row % 7 != 3 && (31 * row + 17 * column).is_multiple_of(5);
        let everywhere = || (0..64).flat_map(|row| (0..64).map(move |column| (row, column)));
        for listed in [
            everywhere().filter(somewhere).collect::<Vec<_>>(),
            everywhere().collect(),
            vec![(63, 63)],
            Vec::new(),
        ] {
            let places = Places::new(listed.iter().copied());
            assert!(places.all().eq(listed.iter().copied()));
            let n_rows = (0..64).filter(|&row| listed.iter().any(|place| place.0 == row)).count();
            assert_eq!(places.n_rows(), n_rows);
            for k in 0..64 {
                let (row, mut in_row) = (
                    places.row(k),
                    listed.iter().enumerate().filter(|(_, place)| place.0 == k),
                );
                assert!(ones(row.columns).eq(in_row.clone().map(|(_, place)| place.1)));
                assert_eq!(row.columns != 0, in_row.clone().next().is_some());
                if let Some((first, _)) = in_row.next() {
                    assert_eq!(row.first, first);
                }
                assert_eq!(row.n_below(40), ones(row.columns).filter(|&column| column < 40).count());
                let in_column = listed.iter().enumerate().filter(|(_, place)| place.1 == k);
                let (rows, numbers): (Vec<usize>, Vec<usize>) = in_column.map(|(at, place)| (place.0, at)).unzip();
                assert_eq!(places.column(k).rows(), rows);
                assert_eq!(places.column(k).numbers(), numbers);
            }
            let mut bytes = Vec::new();
            places.push_bytes(&mut bytes);
            assert_eq!(bytes.len(), Places::byte(n_rows));
            bytes.push(7);
            assert_eq!(Places::from_bytes(n_rows, &bytes), (places, &[7_u8][..]));
        }
    }
}
