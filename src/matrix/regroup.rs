//! Rows from tiles of any size, one after the other.

use std::ops::Range;

use super::error::MatrixError;
use super::tile::RowTile;

/// The rows of a sequence of tiles, one by one.
pub(super) struct Regrouped<I> {
    tiles: std::iter::Fuse<I>,
    /// The tile in which the next row may be, and the row's number there.
    current: Option<(RowTile, usize)>,
}

impl<I: Iterator<Item = RowTile>> Regrouped<I> {
    pub(super) fn new(tiles: I) -> Self {
        Self {
            tiles: tiles.fuse(),
            current: None,
        }
    }

    /// Returns the next rows, of n in all.
    pub(super) fn next_rows(&mut self, rows: Range<usize>, n: usize) -> Result<RowTile, MatrixError> {
        let mut block = RowTile::new(rows.start);
        for next in rows {
            if self.current.as_ref().is_none_or(|(tile, k)| *k == tile.n_rows()) {
                self.current = self.tiles.find(|tile| tile.n_rows() > 0).map(|tile| (tile, 0));
                self.current.iter().try_for_each(|(tile, _)| expect_next(next, tile))?;
            }
            let (tile, k) = self.current.as_mut().ok_or(MatrixError::RowCount {
                expected: n,
                found: next,
            })?;
            block.push_row(tile.row(*k), tile.tallies()[*k]);
            *k += 1;
        }
        Ok(block)
    }

    /// Refuses rows after the last of n.
    pub(super) fn expect_end(mut self, n: usize) -> Result<(), MatrixError> {
        let left = self.current.take().map_or(0, |(tile, k)| tile.n_rows() - k);
        let found = n + left + self.tiles.map(|tile| tile.n_rows()).sum::<usize>();
        if found == n {
            Ok(())
        } else {
            Err(MatrixError::RowCount { expected: n, found })
        }
    }
}

/// Refuses a tile that does not begin at row `expected`.
pub(super) fn expect_next(expected: usize, tile: &RowTile) -> Result<(), MatrixError> {
    let found = tile.first_row();
    if found == expected {
        Ok(())
    } else {
        Err(MatrixError::TileOrder { expected, found })
    }
}
