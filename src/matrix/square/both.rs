//! A tile applied together with its transpose.
//!
//! Its channels are processed a few at a time; the loops over a tile in full are compiled as the loops of [`lanes`](crate::matrix::kernel::lanes).

#![cfg_attr(
    test,
    expect(
        clippy::shadow_unrelated,
        reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
    )
)]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::Simd;

use crate::matrix::kernel::aligned::LINE_BYTE;
use crate::matrix::kernel::lanes::{InnerLoop, Wide, dispatch};
use crate::matrix::kernel::prefetch::prefetch;
use crate::matrix::kernel::scalar::Scalar;
use crate::matrix::kernel::sizes::{CHANNELS_AT_ONCE, LANES, Lanes, SIDE};

const _: () = assert!(CHANNELS_AT_ONCE == 3, "as `by_channels` has it");

/// Parts of a tile from which rows are read in turn.
const QUARTERS: usize = 4;

/// One channel of a tile T: x in its rows and columns, the partial sums of its rows, and y in its columns.
pub(in crate::matrix) struct Meeting<'a> {
    pub(in crate::matrix) x_rows: &'a [f64],
    pub(in crate::matrix) x_columns: &'a [f64],
    pub(in crate::matrix) rows: &'a mut [Lanes],
    pub(in crate::matrix) y_columns: &'a mut [f64],
}

/// The preconditions of [`Meeting::of_full_size`].
const FULL_SIZE: &str = "a tile of the full size";

/// A [`Meeting`] of [`SIDE`] rows and columns.
pub(in crate::matrix) type FullMeeting<'a> = (
    &'a [f64; SIDE],
    &'a [Lanes; CHUNKS],
    &'a mut [Lanes; CHUNKS],
    &'a mut [Lanes; SIDE],
);

impl<'a> Meeting<'a> {
    /// Returns x in the rows and in the columns, y in the columns, and the partial sums of the rows, as arrays: their lengths need no check at every access.
    #[inline(always)]
    pub(in crate::matrix) fn of_full_size(self) -> FullMeeting<'a> {
        (
            self.x_rows.try_into().expect(FULL_SIZE),
            self.x_columns.as_chunks().0.try_into().expect(FULL_SIZE),
            self.y_columns.as_chunks_mut().0.try_into().expect(FULL_SIZE),
            self.rows.try_into().expect(FULL_SIZE),
        )
    }
}

/// A loop for C channels of a tile.
pub(in crate::matrix) trait ByChannels {
    fn run<S: Simd, const N: usize, const C: usize>(&self, simd: S, channels: [Meeting<'_>; C]);
}

/// Runs a loop for all channels, [`CHANNELS_AT_ONCE`] at a time.
pub(in crate::matrix) fn by_channels<'a>(mut channels: impl Iterator<Item = Meeting<'a>>, tile_loop: &impl ByChannels) {
    while let Some(first) = channels.next() {
        match (channels.next(), channels.next()) {
            (None, _) => dispatch(Channels(tile_loop, [first])),
            (Some(second), None) => dispatch(Channels(tile_loop, [first, second])),
            (Some(second), Some(third)) => dispatch(Channels(tile_loop, [first, second, third])),
        }
    }
}

/// A [`ByChannels`] with its channels.
struct Channels<'a, 'b, L, const C: usize>(&'a L, [Meeting<'b>; C]);

impl<L: ByChannels, const C: usize> InnerLoop for Channels<'_, '_, L, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        self.0.run::<S, N, C>(simd, self.1);
    }
}

/// Adds T `x_columns` to the partial sums `rows`, and T^T `x_rows` to `y_columns`, for every channel, reading T once.
///
/// `values` are the rows of T one after another. The order of the additions depends on the shape of T alone.
pub(in crate::matrix) fn add_both<'a, T: Scalar>(values: &[T], channels: impl Iterator<Item = Meeting<'a>>) {
    by_channels(channels, &Both(values));
}

/// The loop of [`add_both`].
struct Both<'a, T>(&'a [T]);

impl<T: Scalar> ByChannels for Both<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize, const C: usize>(&self, simd: S, channels: [Meeting<'_>; C]) {
        if N == 1 {
            both::<S, T, N, C, 4>(simd, self.0, channels);
        } else {
            // There are no registers for the sums of several channels, or of four rows.
            for channel in channels {
                both::<S, T, N, 1, 2>(simd, self.0, [channel]);
            }
        }
    }
}

/// Does the work of [`add_both`], R rows at a time, one from each quarter of the tile, since memory is read faster in four streams than in one.
///
/// R divides 4, and does not change the order of the additions.
#[inline(always)]
fn both<S: Simd, T: Scalar, const N: usize, const C: usize, const R: usize>(
    simd: S,
    values: &[T],
    mut channels: [Meeting<'_>; C],
) {
    if channels[0].x_rows.len() == SIDE && channels[0].x_columns.len() == SIDE {
        return whole_tile::<S, T, N, C, R>(simd, values, channels);
    }
    for channel in &mut channels {
        part_of_tile::<S, T, N, R>(simd, values, channel);
    }
}

/// Does the work of [`both`] for one channel of a tile of any size, such as one at the end of a row of tiles.
#[inline(always)]
fn part_of_tile<S: Simd, T: Scalar, const N: usize, const R: usize>(simd: S, values: &[T], channel: &mut Meeting<'_>) {
    let quarter = channel.x_rows.len() / QUARTERS;
    for i in 0..quarter {
        for first in (0..QUARTERS).step_by(R) {
            let rows: [usize; R] = std::array::from_fn(|r| i + (first + r) * quarter);
            both_rows::<S, T, N, R>(simd, values, rows, channel);
        }
    }
    for i in QUARTERS * quarter..channel.x_rows.len() {
        both_rows::<S, T, N, 1>(simd, values, [i], channel);
    }
}

/// Registers' worth of [`Lanes`] in a row of a tile with all its columns.
const CHUNKS: usize = SIDE / LANES;

/// Does the work of [`both`] for a tile of the full size: as all lengths are known, only the products remain.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "arrays that closures fill go through memory")]
fn whole_tile<S: Simd, T: Scalar, const N: usize, const C: usize, const R: usize>(
    simd: S,
    values: &[T],
    channels: [Meeting<'_>; C],
) {
    let chunks = values.as_chunks::<LANES>().0.as_chunks::<CHUNKS>().0;
    let tile: &[[[T; LANES]; CHUNKS]; SIDE] = chunks.try_into().expect(FULL_SIZE);
    let ends = channels.map(Meeting::of_full_size);
    for i in 0..SIDE / QUARTERS {
        for first in (0..QUARTERS).step_by(R) {
            let row = |r: usize| (i + (first + r) * (SIDE / QUARTERS)) % SIDE;
            let mut x_rows = [[Wide::<S, N>::zero(simd); R]; C];
            let mut sums = [[Wide::<S, N>::zero(simd); R]; C];
            for c in 0..C {
                for r in 0..R {
                    x_rows[c][r] = Wide::splat(simd, ends[c].0[row(r)]);
                    sums[c][r] = Wide::load(&ends[c].3[row(r)]);
                }
            }
            for k in 0..CHUNKS {
                let mut x_k = [Wide::<S, N>::zero(simd); C];
                let mut y_k = [Wide::<S, N>::zero(simd); C];
                for c in 0..C {
                    (x_k[c], y_k[c]) = (Wide::load(&ends[c].1[k]), Wide::load(&ends[c].2[k]));
                }
                for r in 0..R {
                    if (k * LANES * size_of::<T>()).is_multiple_of(LINE_BYTE) {
                        // The same position of the next one: tiles of the full size mostly follow one another in memory.
                        prefetch(&tile[row(r)][k], SIDE * SIDE);
                    }
                    let a = Wide::load(&tile[row(r)][k]);
                    for c in 0..C {
                        sums[c][r] = sums[c][r].plus_product(simd, a, x_k[c]);
                        y_k[c] = y_k[c].plus_product(simd, a, x_rows[c][r]);
                    }
                }
                for c in 0..C {
                    y_k[c].store(&mut ends[c].2[k]);
                }
            }
            for c in 0..C {
                for r in 0..R {
                    sums[c][r].store(&mut ends[c].3[row(r)]);
                }
            }
        }
    }
}

/// Does the work of [`add_both`] for R rows of one channel.
///
/// Several channels at once, and numbers that are copied before they are loaded, went through the stack in every step. Where that had a store across two cache lines, which depends on the position of the stack, small
/// systems took 1.4 times as long.
#[inline(always)]
fn both_rows<S: Simd, T: Scalar, const N: usize, const R: usize>(
    simd: S,
    values: &[T],
    rows: [usize; R],
    channel: &mut Meeting<'_>,
) {
    let n_columns = channel.x_columns.len();
    let n_whole = n_columns / LANES;
    let split = rows.map(|i| values[i * n_columns..(i + 1) * n_columns].as_chunks::<LANES>());
    let whole = split.map(|s| &s.0[..n_whole]);
    let (x_whole, x_rest) = channel.x_columns.as_chunks::<LANES>();
    let (y_whole, y_rest) = channel.y_columns[..n_columns].as_chunks_mut::<LANES>();
    let x_rows = rows.map(|i| channel.x_rows[i]);
    let mut x_splat = [Wide::<S, N>::zero(simd); R];
    let mut sums = [Wide::<S, N>::zero(simd); R];
    for r in 0..R {
        x_splat[r] = Wide::splat(simd, x_rows[r]);
        sums[r] = Wide::load(&channel.rows[rows[r]]);
    }
    for (k, (x, y)) in x_whole.iter().zip(y_whole).enumerate() {
        let (x_k, mut y_k) = (Wide::load(x), Wide::load(y));
        for r in 0..R {
            let a = Wide::load(&whole[r][k]);
            sums[r] = sums[r].plus_product(simd, a, x_k);
            y_k = y_k.plus_product(simd, a, x_splat[r]);
        }
        y_k.store(y);
    }
    for r in 0..R {
        let lanes = &mut channel.rows[rows[r]];
        sums[r].store(lanes);
        for l in 0..x_rest.len() {
            let a = split[r].1[l].to_f64();
            lanes[l] = a.mul_add(x_rest[l], lanes[l]);
            y_rest[l] = a.mul_add(x_rows[r], y_rest[l]);
        }
    }
}

#[cfg(test)]
mod tests {
    use pulp::WithSimd;

    use super::*;
    use crate::matrix::kernel::lanes::tests::{bits, numbers};
    use crate::matrix::kernel::lanes::{Widest, total};

    #[test]
    fn a_tile_and_its_transpose_are_the_same_bytes_with_every_instruction_set() {
        for (n_rows, n_columns) in [(1, 1), (3, 9), (4, 8), (63, 65), (64, 64), (64, 5)] {
            let values = numbers(n_rows * n_columns, 1);
            let (x_rows, x_columns) = (numbers(n_rows, 2), numbers(n_columns, 3));
            let run = |portable: bool| {
                let (mut rows, mut columns) = (vec![[0.5; LANES]; n_rows], vec![0.25; n_columns]);
                let meeting = Meeting {
                    x_rows: &x_rows,
                    x_columns: &x_columns,
                    rows: &mut rows,
                    y_columns: &mut columns,
                };
                if portable {
                    Widest(Channels(&Both(&values), [meeting])).with_simd(pulp::Scalar::new());
                } else {
                    add_both(&values, std::iter::once(meeting));
                }
                (rows, columns)
            };
            let (rows, columns) = run(false);
            let (portable_rows, portable_columns) = run(true);
            assert_eq!(bits(rows.as_flattened()), bits(portable_rows.as_flattened()));
            assert_eq!(bits(&columns), bits(&portable_columns));
            // Terms of one sign: n roundings of at most 1.1e-16 of the sum each.
            let tolerance = 65.0 * f64::EPSILON;
            for (i, lanes) in rows.iter().enumerate() {
                let row = &values[i * n_columns..(i + 1) * n_columns];
                let expected = 0.5 * LANES as f64 + row.iter().zip(&x_columns).map(|(a, x)| a * x).sum::<f64>();
                assert!((total(lanes) - expected).abs() <= tolerance * expected);
            }
            for (j, sum) in columns.iter().enumerate() {
                let column = values.iter().skip(j).step_by(n_columns);
                let expected = 0.25 + column.zip(&x_rows).map(|(a, x)| a * x).sum::<f64>();
                assert!((sum - expected).abs() <= tolerance * expected);
            }
        }
    }

    #[test]
    fn every_channel_of_a_tile_is_summed_as_if_it_were_alone() {
        let (n_rows, n_columns) = (63, 61);
        let values = numbers(n_rows * n_columns, 1);
        for n_channels in 1..=5 {
            let x: Vec<_> = (0..n_channels)
                .map(|c| (numbers(n_rows, c), numbers(n_columns, 7 + c)))
                .collect();
            let run = |channels: std::ops::Range<usize>| {
                let n = channels.len();
                let (mut rows, mut columns) = (vec![[0.5; LANES]; n * n_rows], vec![0.25; n * n_columns]);
                let sums = rows.chunks_mut(n_rows).zip(columns.chunks_mut(n_columns));
                let meetings = x[channels]
                    .iter()
                    .zip(sums)
                    .map(|((x_rows, x_columns), (rows, y_columns))| Meeting {
                        x_rows,
                        x_columns,
                        rows,
                        y_columns,
                    });
                add_both(&values, meetings);
                (bits(rows.as_flattened()), bits(&columns))
            };
            let alone: Vec<_> = (0..n_channels).map(|c| run(c..c + 1)).collect();
            let (rows, columns): (Vec<_>, Vec<_>) = alone.into_iter().unzip();
            assert_eq!(run(0..n_channels), (rows.concat(), columns.concat()), "{n_channels}");
        }
    }
}
