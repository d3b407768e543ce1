//! A tile of listed entries applied together with its transpose, compiled as the loops of [`lanes`](super::lanes).

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::Simd;

use super::both::{ByChannels, Meeting, add_both, by_channels};
use super::expand::{Written, expand};
use super::lanes::LANES;
use super::places::{Places, ones};
use super::square::SIDE;
use super::store::Scalar;

/// Tiles with one in so many of their entries or more are written out in full: all multiplications of a full tile then take less time than each
/// entry's own.
const WRITTEN_OUT_FROM: usize = 16;

/// Adds T `x_columns` to the partial sums `rows`, and T^T `x_rows` to `y_columns`, for every channel; these are [`SIDE`] rows and columns, whatever T has.
///
/// `values` has one number for each place in order; `written` is room for the tile in full.
pub(super) fn add_both_listed<'a, T: Scalar>(
    places: &Places,
    values: &[T],
    written: &mut Written<T>,
    channels: impl Iterator<Item = Meeting<'a>>,
) {
    if WRITTEN_OUT_FROM * values.len() < SIDE * SIDE {
        return by_channels(channels, &Each(places, values));
    }
    expand(places, values, written);
    add_both(written.numbers(), channels);
}

/// The loop of [`add_both_listed`] for few entries.
struct Each<'a, T>(&'a Places, &'a [T]);

impl<T: Scalar> ByChannels for Each<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize, const C: usize>(&self, _: S, mut channels: [Meeting<'_>; C]) {
        let Self(places, values) = self;
        for (row, in_row) in places.rows() {
            for (column, a) in ones(in_row.columns).zip(&values[in_row.first..]) {
                let a = a.to_f64();
                for channel in &mut channels {
                    let sum = &mut channel.rows[row][column % LANES];
                    *sum = a.mul_add(channel.x_columns[column], *sum);
                    let y = &mut channel.y_columns[column];
                    *y = a.mul_add(channel.x_rows[row], *y);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Lanes, tests::numbers, total};
    use super::*;

    #[test]
    fn a_tile_and_its_transpose_are_applied_however_many_entries_it_has() {
        for (n_rows, n_columns, one_in) in [(64, 64, 2), (64, 64, 13), (64, 64, 19), (64, 13, 1), (9, 64, 50)] {
            let wanted = |&(row, column): &(usize, usize)| (31 * row + 17 * column) % one_in == 0;
            let everywhere = (0..n_rows).flat_map(|row| (0..n_columns).map(move |column| (row, column)));
            let listed: Vec<_> = everywhere.filter(wanted).collect();
            let places = Places::new(listed.iter().copied());
            let values = numbers(listed.len(), 1);
            let is_written_out = [1, 2, 13].contains(&one_in);
            assert_eq!(
                WRITTEN_OUT_FROM * listed.len() >= SIDE * SIDE,
                is_written_out,
                "{one_in}"
            );
            let mut written = Written::new();
            for n_channels in 1..=4 {
                let x = numbers(2 * n_channels * SIDE, 2);
                let (x_rows, x_columns) = x.split_at(n_channels * SIDE);
                let mut sums = vec![[0.5; LANES]; n_channels * SIDE];
                let mut y = vec![0.25; n_channels * SIDE];
                let channels = x_rows
                    .chunks(SIDE)
                    .zip(x_columns.chunks(SIDE))
                    .zip(sums.chunks_mut(SIDE).zip(y.chunks_mut(SIDE)))
                    .map(|((x_rows, x_columns), (sums, y_columns))| Meeting {
                        x_rows,
                        x_columns,
                        rows: sums,
                        y_columns,
                    });
                add_both_listed(&places, &values, &mut written, channels);
                for c in 0..n_channels {
                    for k in 0..SIDE {
                        let (mut row, mut column) = (0.5 * LANES as f64, 0.25);
                        for (&(i, j), a) in listed.iter().zip(&values) {
                            if i == k {
                                row += a * x_columns[c * SIDE + j];
                            }
                            if j == k {
                                column += a * x_rows[c * SIDE + i];
                            }
                        }
                        let lanes: &Lanes = &sums[c * SIDE + k];
                        // Up to 64 products of less than 1 each, and the sums that were there.
                        assert!((total(lanes) - row).abs() < 1e-13, "{n_columns} {one_in} {n_channels}");
                        assert!(
                            (y[c * SIDE + k] - column).abs() < 1e-13,
                            "{n_columns} {one_in} {n_channels}"
                        );
                    }
                }
            }
        }
    }
}
