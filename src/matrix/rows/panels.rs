//! The storage order of the entries of a tile of rows: by panels of columns, and row by row in each.
//!
//! The part of x that several rows read in a panel stays in the first-level cache, and the entries are read in one stream.

use std::ops::Range;

use crate::matrix::kernel::sizes::SIDE;
use crate::matrix::tile::{Entry, RowTile};

/// The fewest columns of a panel.
///
/// x in them takes 24 kB with three channels, and 32 kB where lists fill them up to four, which fits a first-level cache. Fewer columns slow sweeps by rows down, because
/// these begin anew in each panel.
const MIN_COLUMNS: usize = 1024;

/// The order of the entries of a tile.
#[derive(Clone, Copy, Debug)]
pub(in crate::matrix) struct Panels {
    n_rows: usize,
    /// Columns of a panel; the last one has the rest.
    width: usize,
    number: usize,
}

impl Panels {
    /// Returns panels of a tile for `n_columns` columns, in each of which a row has about `n_least` entries or blocks, or more.
    ///
    /// The tile has `n_items` of them in all. Beginning with a row takes time, too.
    pub(in crate::matrix) fn new(n_rows: usize, n_columns: usize, n_items: usize, n_least: usize) -> Self {
        let for_least = (n_least * n_rows * n_columns).checked_div(n_items).unwrap_or(n_columns);
        Self::of_width(n_rows, n_columns, for_least.max(MIN_COLUMNS))
    }

    /// Returns panels of at least `width` columns.
    pub(in crate::matrix) fn of_width(n_rows: usize, n_columns: usize, width: usize) -> Self {
        let width = width.clamp(1, n_columns.max(1)).next_multiple_of(SIDE);
        Self {
            n_rows,
            width,
            number: n_columns.div_ceil(width).max(1),
        }
    }

    /// Returns the numbers of the panels.
    pub(in crate::matrix) fn all(&self) -> Range<usize> {
        0..self.number
    }

    /// Returns the panel of a column.
    pub(in crate::matrix) fn of(&self, column: usize) -> usize {
        (column / self.width).min(self.number - 1)
    }

    /// Returns the numbers of the panels with some of the columns.
    pub(in crate::matrix) fn with(&self, columns: &Range<usize>) -> Range<usize> {
        if columns.is_empty() {
            return 0..0;
        }
        self.of(columns.start)..self.of(columns.end - 1) + 1
    }

    /// Returns the position in the order of the part of a row in a panel.
    pub(in crate::matrix) fn place(&self, panel: usize, row: usize) -> usize {
        panel * self.n_rows + row
    }

    /// Returns (row, its entries in a panel), in order; entries beyond the columns are in the last panel, where they are refused.
    pub(in crate::matrix) fn parts<'a>(&'a self, tile: &'a RowTile) -> impl Iterator<Item = (usize, &'a [Entry])> {
        self.all().flat_map(move |panel| {
            (0..self.n_rows).map(move |row| {
                let entries = tile.row(row);
                let [begin, end] =
                    [panel, panel + 1].map(|panel| entries.partition_point(|entry| self.of(entry.0 as usize) < panel));
                (row, &entries[begin..end])
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::tile::RowTally;

    #[test]
    fn every_entry_is_in_the_panel_of_its_column() {
        let mut tile = RowTile::new(4);
        for i in 0..3 {
            let row: Vec<Entry> = (i..300).step_by(7).map(|j| (j, 1.0, 0.0)).collect();
            tile.push_row(&row, RowTally::default());
        }
        for (width, n_panels) in [(1, 5), (64, 5), (65, 3), (300, 1), (1000, 1)] {
            let panels = Panels::of_width(3, 300, width);
            assert_eq!(panels.all(), 0..n_panels, "{width}");
            let parts: Vec<_> = panels.parts(&tile).collect();
            assert_eq!(parts.len(), 3 * n_panels);
            for (place, &(row, part)) in parts.iter().enumerate() {
                let panel = place / 3;
                assert_eq!(panels.place(panel, row), place);
                assert!(part.iter().all(|entry| panels.of(entry.0 as usize) == panel));
            }
            for row in 0..3 {
                let own = parts.iter().filter(|part| part.0 == row).flat_map(|part| part.1);
                assert!(own.eq(tile.row(row)));
            }
            assert_eq!(panels.with(&(0..300)), 0..n_panels);
            assert_eq!(panels.with(&(17..17)), 0..0);
            assert_eq!(panels.with(&(299..300)), n_panels - 1..n_panels);
        }
    }

    #[test]
    fn panels_grow_where_there_is_little() {
        let width = |n_items| Panels::new(16, 10_000, n_items, 64).width;
        assert_eq!(width(16 * 10_000), MIN_COLUMNS);
        assert_eq!(width(16 * 500), 1280_usize.next_multiple_of(SIDE));
        assert_eq!([width(16), width(0)], [10_000_usize.next_multiple_of(SIDE); 2]);
    }
}
