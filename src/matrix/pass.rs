//! What a few rows of tiles of a symmetric matrix add to y.

use std::ops::Range;

use super::gather::{SquareEntries, add_both_listed, add_both_listed_eight};
use super::lanes::{LANES, Lanes, Meeting, Planes, total};
use super::square::{SIDE, Square};
use super::store::Scalar;

/// The sums of one piece of a pass, from its first row on.
///
/// Tiles stored in full and listed ones have sums of their own, since they take the channels in different ways.
pub(super) struct PassSums {
    first: usize,
    n_left: usize,
    n_channels: usize,
    /// Of the rows of one row of tiles: partial sums, channel by channel.
    rows: Vec<[Lanes; SIDE]>,
    /// Channel by channel.
    columns: Vec<f64>,
    listed: Listed,
}

/// The sums of listed tiles, where there are any.
enum Listed {
    None,
    /// One channel: as below.
    One {
        rows: Box<[Lanes; SIDE]>,
        columns: Vec<f64>,
    },
    /// Eight channels at a time: of the rows of one row of tiles, and of the columns.
    Eights {
        rows: Vec<[Lanes; SIDE]>,
        columns: Vec<Vec<Lanes>>,
    },
}

impl PassSums {
    /// Returns sums for the rows from `first` on of a matrix with `n` of them.
    pub(super) fn new(first: usize, n: usize, n_channels: usize) -> Self {
        Self {
            first,
            n_left: n - first,
            n_channels,
            rows: vec![[[0.0; LANES]; SIDE]; n_channels],
            columns: vec![0.0; (n - first) * n_channels],
            listed: Listed::None,
        }
    }

    /// Adds what a tile on the diagonal, stored whole, makes of `x`.
    pub(super) fn add_diagonal<T: Scalar>(&mut self, tile: &Square<T>, x: &Planes, rows: &Range<usize>) {
        for (plane, sums) in x.channels().zip(&mut self.rows) {
            tile.apply_diagonal(&plane[rows.clone()], &mut sums[..rows.len()]);
        }
    }

    /// Calls `work` with what the tile of `rows` and `columns` needs of every channel.
    pub(super) fn with_channels(
        &mut self,
        x: &Planes,
        rows: Range<usize>,
        columns: Range<usize>,
        work: impl FnOnce(&mut dyn Iterator<Item = Meeting<'_>>),
    ) {
        let y_columns = columns.start - self.first..columns.end - self.first;
        let sums = self.rows.iter_mut().zip(self.columns.chunks_exact_mut(self.n_left));
        let mut channels = x.channels().zip(sums).map(|(plane, (lanes, y))| Meeting {
            x_rows: &plane[rows.clone()],
            x_columns: &plane[columns.clone()],
            rows: &mut lanes[..rows.len()],
            y_columns: &mut y[y_columns.clone()],
        });
        work(&mut channels);
    }

    /// Adds what the listed entries of the tile of `rows` and `columns` and of its transpose make of `x`.
    pub(super) fn add_listed<T: Scalar>(
        &mut self,
        entries: SquareEntries<'_, T>,
        x: &Planes,
        rows: Range<usize>,
        columns: Range<usize>,
    ) {
        let n_left = self.n_left;
        if let Listed::None = self.listed {
            self.listed = if self.n_channels == 1 {
                Listed::One {
                    rows: Box::new([[0.0; LANES]; SIDE]),
                    columns: vec![0.0; n_left],
                }
            } else {
                let n_groups = self.n_channels.div_ceil(LANES);
                Listed::Eights {
                    rows: vec![[[0.0; LANES]; SIDE]; n_groups],
                    columns: vec![vec![[0.0; LANES]; n_left]; n_groups],
                }
            };
        }
        let y_columns = columns.start - self.first..columns.end - self.first;
        match &mut self.listed {
            Listed::None => {}
            Listed::One {
                rows: row_sums,
                columns: y,
            } => {
                let plane = x.channel(0);
                add_both_listed(
                    entries,
                    [&plane[rows], &plane[columns]],
                    &mut **row_sums,
                    &mut y[y_columns],
                );
            }
            Listed::Eights {
                rows: row_sums,
                columns: y,
            } => {
                for ((eights, sums), y_eights) in x.eights().iter().zip(row_sums).zip(y) {
                    let parts = [&eights[rows.clone()], &eights[columns.clone()]];
                    add_both_listed_eight(entries, parts, sums, &mut y_eights[y_columns.clone()]);
                }
            }
        }
    }

    /// Ends a row of tiles: its rows' sums go to y.
    pub(super) fn end_rows(&mut self, rows: Range<usize>) {
        let own = rows.start - self.first..rows.end - self.first;
        for (c, (y, of_channel)) in self.columns.chunks_exact_mut(self.n_left).zip(&self.rows).enumerate() {
            for (k, (y_i, lanes)) in y[own.clone()].iter_mut().zip(of_channel).enumerate() {
                *y_i += total(lanes);
                *y_i += match &self.listed {
                    Listed::None => 0.0,
                    Listed::One { rows: sums, .. } => sums[k][0],
                    Listed::Eights { rows: sums, .. } => sums[c / LANES][k][c % LANES],
                };
            }
        }
        self.rows.fill([[0.0; LANES]; SIDE]);
        match &mut self.listed {
            Listed::None => {}
            Listed::One { rows: sums, .. } => sums.fill([0.0; LANES]),
            Listed::Eights { rows: sums, .. } => sums.fill([[0.0; LANES]; SIDE]),
        }
    }

    /// Makes all sums NaN.
    pub(super) fn spoil(&mut self) {
        self.columns.fill(f64::NAN);
    }

    /// Returns what is to be added to y from the first row on, channel by channel.
    pub(super) fn finish(mut self) -> Vec<f64> {
        for (c, y) in self.columns.chunks_exact_mut(self.n_left).enumerate() {
            match &self.listed {
                Listed::None => {}
                Listed::One { columns, .. } => y.iter_mut().zip(columns).for_each(|(y_i, sum)| *y_i += sum),
                Listed::Eights { columns, .. } => {
                    let of_channel = columns[c / LANES].iter().map(|sums| sums[c % LANES]);
                    y.iter_mut().zip(of_channel).for_each(|(y_i, sum)| *y_i += sum);
                }
            }
        }
        self.columns
    }
}
