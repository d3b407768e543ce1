//! Rows from tiles of any size, one after the other.

use super::error::MatrixError;
use super::tile::RowTile;

/// The rows of a sequence of tiles, one by one.
pub(super) struct Regrouped<I> {
    tiles: std::iter::Fuse<I>,
    /// The tile in which the next row may be, and the row's number there.
    current: Option<(RowTile, usize)>,
    next: usize,
}

impl<I: Iterator<Item = RowTile>> Regrouped<I> {
    pub(super) fn new(tiles: I) -> Self {
        Self {
            tiles: tiles.fuse(),
            current: None,
            next: 0,
        }
    }

    /// Returns the tile of the next of n rows, and the row's number in it.
    pub(super) fn next_row(&mut self, n: usize) -> Result<(&RowTile, usize), MatrixError> {
        let (expected, found) = (n, self.next);
        if self.current.as_ref().is_none_or(|(tile, k)| *k == tile.n_rows()) {
            self.current = self.tiles.find(|tile| tile.n_rows() > 0).map(|tile| (tile, 0));
            if let Some((tile, _)) = &self.current
                && tile.first_row() != self.next
            {
                return Err(MatrixError::TileOrder {
                    expected: self.next,
                    found: tile.first_row(),
                });
            }
        }
        let (tile, k) = self.current.as_mut().ok_or(MatrixError::RowCount { expected, found })?;
        self.next += 1;
        *k += 1;
        Ok((tile, *k - 1))
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
