//! The contribution of a few rows of tiles of a symmetric matrix to y.

use std::ops::Range;

use crate::matrix::kernel::aligned::{Aligned, apart};
use crate::matrix::kernel::lanes::total;
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::scalar::Scalar;
use crate::matrix::kernel::sizes::{LANES, Lanes, SIDE};
use crate::matrix::square::{Meeting, Square};

/// The sums of one piece of a pass, from its first row on.
pub(in crate::matrix) struct PassSums {
    first: usize,
    n_left: usize,
    /// The partial sums of the rows of one row of tiles, channel by channel.
    rows: Aligned<f64>,
    /// Channel by channel, each filled up to a multiple of [`SIDE`] at least.
    columns: Aligned<f64>,
    /// The sums of the transposes of tiles on the diagonal, channel by channel, which are not used.
    nowhere: Aligned<f64>,
}

/// The distance from the partial sums of one row of tiles in one channel to those in the next.
const ROW_SUMS: usize = apart(SIDE * LANES);

impl PassSums {
    /// Returns sums for the rows from `first` on of a matrix with `n` of them.
    pub(in crate::matrix) fn new(first: usize, n: usize, n_channels: usize) -> Self {
        Self {
            first,
            n_left: n - first,
            rows: Aligned::filled(n_channels * ROW_SUMS, 0.0),
            columns: Aligned::filled(n_channels * apart((n - first).next_multiple_of(SIDE)), 0.0),
            nowhere: Aligned::filled(n_channels * SIDE, 0.0),
        }
    }

    /// Returns the distance from one channel of the columns to the next.
    fn distance(&self) -> usize {
        apart(self.n_left.next_multiple_of(SIDE))
    }

    /// Adds the products of a tile and of its transpose with `x`, reading it once for all channels.
    ///
    /// The tile holds `rows` and `columns` of the matrix; one on the diagonal is stored whole, and its transpose is not added.
    pub(in crate::matrix) fn add<T: Scalar>(
        &mut self,
        tile: &Square<T>,
        x: &Planes,
        rows: Range<usize>,
        columns: Range<usize>,
    ) {
        let is_diagonal = rows.start == columns.start;
        let (rows, columns) = (tile.gone_by(rows), tile.gone_by(columns));
        let distance = self.distance();
        let (y, y_side, y_first) = if is_diagonal {
            (&mut self.nowhere, SIDE, columns.start)
        } else {
            (&mut self.columns, distance, self.first)
        };
        let sums = self.rows.chunks_exact_mut(ROW_SUMS).zip(y.chunks_exact_mut(y_side));
        tile.add_both(sums.enumerate().map(|(c, (lanes, y_c))| Meeting {
            x_rows: &x.padded(c)[rows.clone()],
            x_columns: &x.padded(c)[columns.clone()],
            rows: &mut lanes.as_chunks_mut::<LANES>().0[..rows.len()],
            y_columns: &mut y_c[columns.start - y_first..columns.end - y_first],
        }));
    }

    /// Ends a row of tiles: its rows' sums go to y.
    pub(in crate::matrix) fn end_rows(&mut self, rows: Range<usize>) {
        let own = rows.start - self.first..rows.end - self.first;
        let distance = self.distance();
        let sums = self
            .columns
            .chunks_exact_mut(distance)
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
    pub(in crate::matrix) fn spoil(&mut self) {
        self.columns.fill(f64::NAN);
    }

    /// Returns the sums to be added to y.
    pub(in crate::matrix) fn finish(self) -> PieceOfY {
        PieceOfY {
            first: self.first,
            distance: self.distance(),
            values: self.columns,
        }
    }
}

/// The sums to be added to y from row `first` on.
pub(in crate::matrix) struct PieceOfY {
    first: usize,
    /// The distance from one channel to the next.
    distance: usize,
    values: Aligned<f64>,
}

impl PieceOfY {
    /// Adds the piece to the sums of channel `c` in `rows`.
    pub(in crate::matrix) fn add_to(&self, sums: &mut [f64], rows: &Range<usize>, c: usize) {
        let from = rows.start.max(self.first);
        if from < rows.end {
            let part = &self.values[c * self.distance..][from - self.first..rows.end - self.first];
            let into = &mut sums[from - rows.start..];
            into.iter_mut().zip(part).for_each(|(sum, y_i)| *sum += y_i);
        }
    }
}
