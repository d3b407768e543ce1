//! A tile of listed entries applied together with its transpose, compiled as the loops of [`lanes`](crate::matrix::kernel::lanes).

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::Simd;

use super::both::{ByChannels, Meeting, by_channels};
use super::places::Places;
use crate::matrix::kernel::expand::{Expander, OneByOne};
use crate::matrix::kernel::lanes::Wide;
use crate::matrix::kernel::prefetch::prefetch;
use crate::matrix::kernel::scalar::Scalar;
#[cfg(target_arch = "x86_64")]
use crate::matrix::kernel::scalar::WithV4;
use crate::matrix::kernel::sizes::{LANES, SIDE, STRIP, ones};

/// Adds T `x_columns` to the partial sums `rows`, and T^T `x_rows` to `y_columns`, for every channel.
///
/// These are [`SIDE`] rows and columns for a T of any size.
///
/// `values` has one number for each place in order, and [`STRIP`] or more behind them.
pub(in crate::matrix) fn add_both_listed<'a, T: Scalar>(
    places: &Places,
    values: &[T],
    channels: impl Iterator<Item = Meeting<'a>>,
) {
    by_channels(channels, &Listed(places, values));
}

/// The loop of [`add_both_listed`].
struct Listed<'a, T>(&'a Places, &'a [T]);

impl<T: Scalar> ByChannels for Listed<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize, const C: usize>(&self, simd: S, channels: [Meeting<'_>; C]) {
        let Self(places, values) = *self;
        #[cfg(target_arch = "x86_64")]
        if N == 1
            && let Some(with) = pulp::x86::V4::try_new()
        {
            return by_strips::<S, T, N, C>(simd, places, values, channels, WithV4::new(with));
        }
        by_strips::<S, T, N, C>(simd, places, values, channels, OneByOne);
    }
}

/// The prefetch distance in bytes: the numbers that memory delivers in its latency. Lists of a row of tiles follow one another in memory.
const AHEAD_BYTE: usize = 4096;

/// Registers' worth of columns in a strip.
const HALVES: usize = STRIP / LANES;

/// Does the work of [`add_both_listed`], strip by strip, so that x and y of its columns stay in registers.
///
/// The row of a strip is written out in registers, with zeros in place of missing entries: that takes no branch, and the same few instructions for one entry as for
/// sixteen.
#[inline(always)]
fn by_strips<S: Simd, T: Scalar, const N: usize, const C: usize>(
    simd: S,
    places: &Places,
    values: &[T],
    channels: [Meeting<'_>; C],
    expander: impl Expander<T>,
) {
    let ends = channels.map(Meeting::of_full_size);
    places.ask_behind();
    let mut rest = values;
    for strip in places.strips() {
        let first = strip.number % (SIDE / STRIP) * HALVES;
        let mut x_k = [[Wide::<S, N>::zero(simd); HALVES]; C];
        let mut y_k = [[Wide::<S, N>::zero(simd); HALVES]; C];
        for c in 0..C {
            for h in 0..HALVES {
                (x_k[c][h], y_k[c][h]) = (Wide::load(&ends[c].1[first + h]), Wide::load(&ends[c].2[first + h]));
            }
        }
        for (row, &mask) in ones(strip.rows).zip(strip.masks) {
            prefetch(rest, AHEAD_BYTE / size_of::<T>());
            let a = expander.expand(mask, rest.first_chunk().expect("as many behind the last"));
            rest = &rest[mask.count_ones() as usize..];
            for c in 0..C {
                let sums = &mut ends[c].3[row % SIDE];
                let mut sum = Wide::load(sums);
                for h in 0..HALVES {
                    let a = Wide::load(&a[h]);
                    sum = sum.plus_product(simd, a, x_k[c][h]);
                    y_k[c][h] = y_k[c][h].plus_product(simd, a, Wide::splat(simd, ends[c].0[row % SIDE]));
                }
                sum.store(sums);
            }
        }
        for c in 0..C {
            for (h, half) in y_k[c].into_iter().enumerate() {
                half.store(&mut ends[c].2[first + h]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::kernel::lanes::tests::{bits, numbers};

    #[test]
    fn a_tile_and_its_transpose_are_applied_however_many_entries_it_has() {
        for (n_rows, n_columns, one_in) in [(64, 64, 1), (64, 64, 2), (64, 64, 13), (64, 13, 1), (9, 64, 50)] {
            let wanted = |&(row, column): &(usize, usize)| (31 * row + 17 * column) % one_in == 0;
            let everywhere = (0..n_rows).flat_map(|row| (0..n_columns).map(move |column| (row, column)));
            let mut listed: Vec<_> = everywhere.filter(wanted).collect();
            listed.sort_by_key(|place| place.1 / STRIP);
            let places = Places::new(listed.iter().copied());
            let values = numbers(listed.len() + STRIP, 1);
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
                add_both_listed(&places, &values, channels);
                for c in 0..n_channels {
                    // The same with one addition for each entry.
                    let mut expected_sums = vec![[0.5; LANES]; SIDE];
                    let mut expected_y = vec![0.25; SIDE];
                    for (&(row, column), a) in listed.iter().zip(&values) {
                        let sum: &mut f64 = &mut expected_sums[row][column % LANES];
                        *sum = a.mul_add(x_columns[c * SIDE + column], *sum);
                        let in_column: &mut f64 = &mut expected_y[column];
                        *in_column = a.mul_add(x_rows[c * SIDE + row], *in_column);
                    }
                    let own = c * SIDE..(c + 1) * SIDE;
                    assert_eq!(
                        bits(sums[own.clone()].as_flattened()),
                        bits(expected_sums.as_flattened())
                    );
                    assert_eq!(bits(&y[own]), bits(&expected_y), "{n_columns} {one_in} {n_channels}");
                }
            }
        }
    }
}
