//! What a few rows of tiles of a symmetric matrix add to y.

use std::ops::Range;

use super::aligned::Aligned;
use super::both::Meeting;
use super::lanes::{LANES, Lanes, total};
use super::planes::Planes;
use super::square::{SIDE, Square};
use super::store::Scalar;

/// The sums of one piece of a pass, from its first row on.
pub(super) struct PassSums {
    first: usize,
    n_left: usize,
    /// Of the rows of one row of tiles: partial sums, channel by channel.
    rows: Aligned<f64>,
    /// Channel by channel, each filled up to a multiple of [`SIDE`].
    columns: Aligned<f64>,
}

/// Partial sums of one row of tiles in one channel.
const ROW_SUMS: usize = SIDE * LANES;

impl PassSums {
    /// Returns sums for the rows from `first` on of a matrix with `n` of them.
    pub(super) fn new(first: usize, n: usize, n_channels: usize) -> Self {
        Self {
            first,
            n_left: n - first,
            rows: Aligned::filled(n_channels * ROW_SUMS, 0.0),
            columns: Aligned::filled(n_channels * (n - first).next_multiple_of(SIDE), 0.0),
        }
    }

    fn n_padded(&self) -> usize {
        self.n_left.next_multiple_of(SIDE)
    }

    /// Adds what a tile on the diagonal, stored whole, makes of `x`.
    pub(super) fn add_diagonal<T: Scalar>(&mut self, tile: &Square<T>, x: &Planes, rows: &Range<usize>) {
        for (c, sums) in self.rows.chunks_exact_mut(ROW_SUMS).enumerate() {
            let lanes = sums.as_chunks_mut::<LANES>().0;
            tile.apply_diagonal(&x.channel(c)[rows.clone()], &mut lanes[..rows.len()]);
        }
    }

    /// Calls `work` with what the tile of `rows` and `columns`, which may go on beyond the last of the matrix, needs of every channel.
    pub(super) fn with_channels(
        &mut self,
        x: &Planes,
        rows: Range<usize>,
        columns: Range<usize>,
        work: impl FnOnce(&mut dyn Iterator<Item = Meeting<'_>>),
    ) {
        let y_columns = columns.start - self.first..columns.end - self.first;
        let n_padded = self.n_padded();
        let sums = self.rows.chunks_exact_mut(ROW_SUMS);
        let sums = sums.zip(self.columns.chunks_exact_mut(n_padded));
        let mut channels = sums.enumerate().map(|(c, (lanes, y))| Meeting {
            x_rows: &x.padded(c)[rows.clone()],
            x_columns: &x.padded(c)[columns.clone()],
            rows: &mut lanes.as_chunks_mut::<LANES>().0[..rows.len()],
            y_columns: &mut y[y_columns.clone()],
        });
        work(&mut channels);
    }

    /// Ends a row of tiles: its rows' sums go to y.
    pub(super) fn end_rows(&mut self, rows: Range<usize>) {
        let own = rows.start - self.first..rows.end - self.first;
        let n_padded = self.n_padded();
        let sums = self
            .columns
            .chunks_exact_mut(n_padded)
            .zip(self.rows.chunks_exact(ROW_SUMS));
        for (y, of_channel) in sums {
            let partial: &[Lanes] = of_channel.as_chunks().0;
            for (y_i, lanes) in y[own.clone()].iter_mut().zip(partial) {
                *y_i += total(lanes);
            }
        }
        self.rows.fill(0.0);
    }

    /// Makes all sums NaN.
    pub(super) fn spoil(&mut self) {
        self.columns.fill(f64::NAN);
    }

    /// Returns what is to be added to y.
    pub(super) fn finish(self) -> PieceOfY {
        PieceOfY {
            first: self.first,
            n_padded: self.n_padded(),
            values: self.columns,
        }
    }
}

/// What is to be added to y from row `first` on.
pub(super) struct PieceOfY {
    first: usize,
    n_padded: usize,
    /// Channel by channel.
    values: Aligned<f64>,
}

impl PieceOfY {
    /// Adds the piece to the sums of channel `c` in `rows`.
    pub(super) fn add_to(&self, sums: &mut [f64], rows: &Range<usize>, c: usize) {
        let from = rows.start.max(self.first);
        if from < rows.end {
            let part = &self.values[c * self.n_padded..][from - self.first..rows.end - self.first];
            let into = &mut sums[from - rows.start..];
            into.iter_mut().zip(part).for_each(|(sum, y_i)| *sum += y_i);
        }
    }
}
