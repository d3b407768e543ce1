//! The inner loops over dense numbers, compiled for several instruction sets, of which the best is chosen at run time.
//!
//! Every sum is kept in [`LANES`] partial sums, whatever the width of the registers, and every product is added with one rounding
//! (a fused multiply-add): the result is the same bytes on all processors. Those without such an instruction, older than 2013,
//! take much longer.

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

use std::sync::OnceLock;

use pulp::{Arch, Simd, WithSimd};

use super::operator::Block;
use super::store::Scalar;

/// Partial sums of each sum: one register of AVX-512, two of AVX2, four of SSE2.
pub(super) const LANES: usize = 8;

/// The partial sums of one sum.
pub(super) type Lanes = [f64; LANES];

/// Rows of a tile that [`add_both`] takes at a time, so that the sums over columns are loaded and stored once for all of them.
const ROWS_AT_ONCE: usize = 4;

/// Channels that a loop over dense numbers takes at once: as many as the registers of AVX-512 hold sums for.
const CHANNELS_AT_ONCE: usize = 3;

/// A block of vectors, each channel in one piece.
#[derive(Debug)]
pub(super) struct Planes {
    n_rows: usize,
    values: Vec<f64>,
    /// The same row by row, eight channels at a time, where that has been asked for.
    eights: OnceLock<Vec<Vec<Lanes>>>,
}

impl Planes {
    pub(super) fn of(x: &Block) -> Self {
        let n_channels = x.n_channels();
        let channel = |c| x.values().iter().skip(c).step_by(n_channels).copied();
        Self {
            n_rows: x.n_rows(),
            values: (0..n_channels).flat_map(channel).collect(),
            eights: OnceLock::new(),
        }
    }

    /// Returns the number of channels.
    pub(super) fn n_channels(&self) -> usize {
        self.values.len() / self.n_rows
    }

    /// Returns the values of channels 0 to 7, 8 to 15 and so on of every row, filled up with zeros.
    ///
    /// What gathers rows finds all channels of one in the same cache line.
    pub(super) fn eights(&self) -> &[Vec<Lanes>] {
        let of_group = |planes: &[f64]| {
            let mut rows = vec![[0.0; LANES]; self.n_rows];
            for (c, plane) in planes.chunks_exact(self.n_rows).enumerate() {
                for (row, value) in rows.iter_mut().zip(plane) {
                    row[c] = *value;
                }
            }
            rows
        };
        self.eights
            .get_or_init(|| self.values.chunks(LANES * self.n_rows).map(of_group).collect())
    }

    /// Returns the values of one channel.
    pub(super) fn channel(&self, c: usize) -> &[f64] {
        &self.values[c * self.n_rows..(c + 1) * self.n_rows]
    }

    /// Returns all channels in order.
    pub(super) fn channels(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.values.chunks_exact(self.n_rows)
    }
}

/// Returns the sum of the partial sums.
pub(super) fn total(lanes: &Lanes) -> f64 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// [`Lanes`] in N registers. Explicit, because the compiler gives up on loops over many arrays of lanes.
#[derive(Clone, Copy)]
pub(super) struct Wide<S: Simd, const N: usize>([S::f64s; N]);

impl<S: Simd, const N: usize> Wide<S, N> {
    #[inline(always)]
    pub(super) fn zero(simd: S) -> Self {
        Self([simd.splat_f64s(0.0); N])
    }

    #[inline(always)]
    pub(super) fn splat(simd: S, value: f64) -> Self {
        Self([simd.splat_f64s(value); N])
    }

    #[inline(always)]
    pub(super) fn load<T: Scalar>(values: &[T; LANES]) -> Self {
        let values = values.map(T::to_f64);
        let registers = S::as_simd_f64s(&values).0;
        Self(std::array::from_fn(|k| registers[k]))
    }

    #[inline(always)]
    pub(super) fn store(self, values: &mut Lanes) {
        S::as_mut_simd_f64s(values).0.copy_from_slice(&self.0);
    }

    #[inline(always)]
    pub(super) fn plus(self, simd: S, other: Self) -> Self {
        Self(std::array::from_fn(|k| simd.add_f64s(self.0[k], other.0[k])))
    }

    /// Returns the sum with a product, rounded once.
    #[inline(always)]
    pub(super) fn plus_product(self, simd: S, a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|k| simd.mul_add_f64s(a.0[k], b.0[k], self.0[k])))
    }
}

/// A loop for N registers of each [`Lanes`].
pub(super) trait InnerLoop {
    fn run<S: Simd, const N: usize>(self, simd: S);
}

/// An [`InnerLoop`] that takes N from the instruction set.
pub(super) struct Widest<L>(pub(super) L);

impl<L: InnerLoop> WithSimd for Widest<L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F64_LANES {
            8 => self.0.run::<S, 1>(simd),
            4 => self.0.run::<S, 2>(simd),
            2 => self.0.run::<S, 4>(simd),
            _ => self.0.run::<S, 8>(simd),
        }
    }
}

/// Runs a loop as compiled for the best instruction set that this processor has.
pub(super) fn dispatch(inner_loop: impl InnerLoop) {
    Arch::new().dispatch(Widest(inner_loop));
}

/// Sets row i of `y` (row-major, one entry per channel) to the product of row i of `values` (row-major) with `x`.
pub(super) fn multiply_rows<T: Scalar>(values: &[T], n_columns: usize, x: &Planes, y: &mut [f64]) {
    let n_channels = x.channels().len();
    let mut first_channel = 0;
    while first_channel < n_channels {
        let plane = |k: usize| x.channel(first_channel + k);
        let to = (first_channel, n_channels);
        let n_done = (n_channels - first_channel).min(CHANNELS_AT_ONCE);
        match n_done {
            1 => dispatch(Rows([plane(0)], values, n_columns, to, y)),
            2 => dispatch(Rows([plane(0), plane(1)], values, n_columns, to, y)),
            _ => dispatch(Rows([plane(0), plane(1), plane(2)], values, n_columns, to, y)),
        }
        first_channel += n_done;
    }
}

/// The loop of [`multiply_rows`] for C channels.
///
/// Holds the channels, the matrix, its number of columns, the first channel and the number of channels in y, and y.
struct Rows<'a, T, const C: usize>([&'a [f64]; C], &'a [T], usize, (usize, usize), &'a mut [f64]);

impl<T: Scalar, const C: usize> InnerLoop for Rows<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        // As many rows at once as there are registers for their sums: 32 registers with AVX-512, 16 with the others.
        match (N, C) {
            (1, _) | (_, 1) => self.by_rows::<S, N, 4>(simd),
            _ => self.by_rows::<S, N, 1>(simd),
        }
    }
}

impl<T: Scalar, const C: usize> Rows<'_, T, C> {
    /// Takes R rows at a time.
    #[inline(always)]
    fn by_rows<S: Simd, const N: usize, const R: usize>(self, simd: S) {
        let Self(x, values, n_columns, (first_channel, n_channels), y) = self;
        let n_rows = y.len() / n_channels;
        let row = |i: usize| &values[i * n_columns..(i + 1) * n_columns];
        let mut put = |i: usize, sums: [f64; C]| {
            let begin = i * n_channels + first_channel;
            y[begin..begin + C].copy_from_slice(&sums);
        };
        let n_whole = n_rows - n_rows % R;
        for i in (0..n_whole).step_by(R) {
            let products = dot::<S, T, N, R, C>(simd, std::array::from_fn(|r| row(i + r)), x);
            for (r, sums) in products.into_iter().enumerate() {
                put(i + r, sums);
            }
        }
        for i in n_whole..n_rows {
            let [sums] = dot::<S, T, N, 1, C>(simd, [row(i)], x);
            put(i, sums);
        }
    }
}

/// Returns the products of R rows with C channels. The order of the additions depends on the number of columns alone.
#[inline(always)]
fn dot<S: Simd, T: Scalar, const N: usize, const R: usize, const C: usize>(
    simd: S,
    rows: [&[T]; R],
    x: [&[f64]; C],
) -> [[f64; C]; R] {
    let n_columns = x[0].len();
    let n_whole = n_columns / LANES;
    let split = rows.map(|row| row[..n_columns].as_chunks::<LANES>());
    let x_split = x.map(|x| x[..n_columns].as_chunks::<LANES>());
    let (whole, x_whole) = (split.map(|s| &s.0[..n_whole]), x_split.map(|s| &s.0[..n_whole]));
    let mut sums = [[Wide::<S, N>::zero(simd); C]; R];
    for k in 0..n_whole {
        let x_k = x_whole.map(|plane| Wide::load(&plane[k]));
        for r in 0..R {
            let a = Wide::load(&whole[r][k]);
            for c in 0..C {
                sums[r][c] = sums[r][c].plus_product(simd, a, x_k[c]);
            }
        }
    }
    let mut totals = [[0.0; C]; R];
    for r in 0..R {
        for c in 0..C {
            let mut lanes = [0.0; LANES];
            sums[r][c].store(&mut lanes);
            for (lane, (a, x_k)) in lanes.iter_mut().zip(split[r].1.iter().zip(x_split[c].1)) {
                *lane = a.to_f64().mul_add(*x_k, *lane);
            }
            totals[r][c] = total(&lanes);
        }
    }
    totals
}

/// Adds `values` times x to `sum`, where row k of `x` (row-major, one entry per channel; as many rows as values) belongs to number k.
///
/// The order of the additions depends on the number of values alone, and each channel is summed as if it were alone.
pub(super) fn add_row<T: Scalar>(values: &[T], x: &[f64], sum: &mut [f64]) {
    match sum.len() {
        1 => dispatch(Single(values, x, sum)),
        2 => dispatch(Row::<T, 2>(values, x, sum)),
        3 => dispatch(Row::<T, 3>(values, x, sum)),
        4 => dispatch(Row::<T, 4>(values, x, sum)),
        n_channels => {
            for (c, channel_sum) in sum.iter_mut().enumerate() {
                let mut lanes = [0.0; LANES];
                for (k, value) in values.iter().enumerate() {
                    lanes[k % LANES] = value.to_f64().mul_add(x[k * n_channels + c], lanes[k % LANES]);
                }
                *channel_sum += total(&lanes);
            }
        }
    }
}

/// Returns Σ a x, in the order of additions of [`add_row`].
pub(crate) fn product(a: &[f64], x: &[f64]) -> f64 {
    let mut sum = [0.0];
    add_row(a, x, &mut sum);
    sum[0]
}

/// The loop of [`add_row`] for one channel.
struct Single<'a, T>(&'a [T], &'a [f64], &'a mut [f64]);

impl<T: Scalar> InnerLoop for Single<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        let Self(values, x, sum) = self;
        let [[product]] = dot::<S, T, N, 1, 1>(simd, [values], [&x[..values.len()]]);
        sum[0] += product;
    }
}

/// The loop of [`add_row`] for C channels.
struct Row<'a, T, const C: usize>(&'a [T], &'a [f64], &'a mut [f64]);

impl<T: Scalar, const C: usize> InnerLoop for Row<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, _: S) {
        let Self(values, x, sum) = self;
        let (whole, rest) = values.as_chunks::<LANES>();
        let (x_whole, x_rest) = x.as_chunks::<C>().0.as_chunks::<LANES>();
        let mut lanes = [[0.0; C]; LANES];
        for (a, x_k) in whole.iter().zip(x_whole) {
            for l in 0..LANES {
                for c in 0..C {
                    lanes[l][c] = a[l].to_f64().mul_add(x_k[l][c], lanes[l][c]);
                }
            }
        }
        for (l, (a, x_k)) in rest.iter().zip(x_rest).enumerate() {
            for c in 0..C {
                lanes[l][c] = a.to_f64().mul_add(x_k[c], lanes[l][c]);
            }
        }
        for (c, channel_sum) in sum.iter_mut().enumerate() {
            *channel_sum += total(&lanes.map(|lane| lane[c]));
        }
    }
}

/// One channel of a tile T: x in its rows and columns, the partial sums of its rows, and y in its columns.
pub(super) struct Meeting<'a> {
    pub(super) x_rows: &'a [f64],
    pub(super) x_columns: &'a [f64],
    pub(super) rows: &'a mut [Lanes],
    pub(super) y_columns: &'a mut [f64],
}

/// Adds T `x_columns` to the partial sums `rows`, and T^T `x_rows` to `y_columns`, for every channel, reading T once.
///
/// `values` are the rows of T one after another. The order of the additions depends on the shape of T alone.
pub(super) fn add_both<'a, T: Scalar>(values: &[T], mut channels: impl Iterator<Item = Meeting<'a>>) {
    while let Some(first) = channels.next() {
        match (channels.next(), channels.next()) {
            (None, _) => dispatch(Both(values, [first])),
            (Some(second), None) => dispatch(Both(values, [first, second])),
            (Some(second), Some(third)) => dispatch(Both(values, [first, second, third])),
        }
    }
}

/// The loop of [`add_both`] for C channels.
struct Both<'a, 'b, T, const C: usize>(&'a [T], [Meeting<'b>; C]);

impl<T: Scalar, const C: usize> InnerLoop for Both<'_, '_, T, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        let Self(values, channels) = self;
        if N == 1 {
            both::<S, T, N, C>(simd, values, channels);
        } else {
            // There are no registers for the sums of several channels.
            for channel in channels {
                both::<S, T, N, 1>(simd, values, [channel]);
            }
        }
    }
}

/// Does what [`add_both`] does, four rows at a time: one from each quarter of the tile, since memory is read faster in four streams
/// than in one.
#[inline(always)]
fn both<S: Simd, T: Scalar, const N: usize, const C: usize>(simd: S, values: &[T], mut channels: [Meeting<'_>; C]) {
    let quarter = channels[0].x_rows.len() / ROWS_AT_ONCE;
    for i in 0..quarter {
        let rows: [usize; ROWS_AT_ONCE] = std::array::from_fn(|r| i + r * quarter);
        both_rows::<S, T, N, C, ROWS_AT_ONCE>(simd, values, rows, &mut channels);
    }
    for i in ROWS_AT_ONCE * quarter..channels[0].x_rows.len() {
        both_rows::<S, T, N, C, 1>(simd, values, [i], &mut channels);
    }
}

/// Does with R rows what [`add_both`] does with all.
#[inline(always)]
#[expect(clippy::needless_range_loop, reason = "arrays that closures fill go through memory")]
fn both_rows<S: Simd, T: Scalar, const N: usize, const C: usize, const R: usize>(
    simd: S,
    values: &[T],
    rows: [usize; R],
    channels: &mut [Meeting<'_>; C],
) {
    let n_columns = channels[0].x_columns.len();
    let n_whole = n_columns / LANES;
    let split = rows.map(|i| values[i * n_columns..(i + 1) * n_columns].as_chunks::<LANES>());
    let whole = split.map(|s| &s.0[..n_whole]);
    let mut x_rows = [[Wide::<S, N>::zero(simd); R]; C];
    let mut sums = [[Wide::<S, N>::zero(simd); R]; C];
    for c in 0..C {
        for r in 0..R {
            x_rows[c][r] = Wide::splat(simd, channels[c].x_rows[rows[r]]);
        }
    }
    let mut ends = channels.each_mut().map(|channel| {
        let (x_whole, x_rest) = channel.x_columns[..n_columns].as_chunks::<LANES>();
        let (y_whole, y_rest) = channel.y_columns[..n_columns].as_chunks_mut::<LANES>();
        let (x_whole, y_whole) = (&x_whole[..n_whole], &mut y_whole[..n_whole]);
        (x_whole, y_whole, x_rest, y_rest, channel.x_rows, &mut *channel.rows)
    });
    for k in 0..n_whole {
        let mut x_k = [Wide::<S, N>::zero(simd); C];
        let mut y_k = [Wide::<S, N>::zero(simd); C];
        for c in 0..C {
            (x_k[c], y_k[c]) = (Wide::load(&ends[c].0[k]), Wide::load(&ends[c].1[k]));
        }
        for r in 0..R {
            let a = Wide::load(&whole[r][k]);
            for c in 0..C {
                sums[c][r] = sums[c][r].plus_product(simd, a, x_k[c]);
                y_k[c] = y_k[c].plus_product(simd, a, x_rows[c][r]);
            }
        }
        for c in 0..C {
            y_k[c].store(&mut ends[c].1[k]);
        }
    }
    for c in 0..C {
        let (_, _, x_rest, y_rest, x_of_rows, lanes_of_rows) = &mut ends[c];
        for r in 0..R {
            let lanes = &mut lanes_of_rows[rows[r]];
            Wide::load(lanes).plus(simd, sums[c][r]).store(lanes);
            for l in 0..x_rest.len() {
                let a = split[r].1[l].to_f64();
                lanes[l] = a.mul_add(x_rest[l], lanes[l]);
                y_rest[l] = a.mul_add(x_of_rows[rows[r]], y_rest[l]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers whose sums depend on the order of the additions.
    fn numbers(n: usize, seed: usize) -> Vec<f64> {
        (0..n).map(|k| (((k + seed) * 7919) % 1009) as f64 / 1009.0).collect()
    }

    /// The sum that is promised, written out.
    fn by_hand(values: &[f64], x: &[f64]) -> f64 {
        let mut lanes = [0.0; LANES];
        for (k, (a, x)) in values.iter().zip(x).enumerate() {
            lanes[k % LANES] = a.mul_add(*x, lanes[k % LANES]);
        }
        total(&lanes)
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    #[test]
    fn rows_are_the_same_bytes_with_every_instruction_set() {
        for n in [1, 7, 8, 9, 63, 64, 65] {
            let (n_rows, values) = (5, numbers(5 * n, 1));
            let x = Planes::of(&Block::from_values(numbers(3 * n, 2), 3));
            let planes = [x.channel(0), x.channel(1), x.channel(2)];
            let expected: Vec<f64> = values
                .chunks_exact(n)
                .flat_map(|row| planes.map(|plane| by_hand(row, plane)))
                .collect();
            let mut y = vec![f64::NAN; 3 * n_rows];
            multiply_rows(&values, n, &x, &mut y);
            assert_eq!(bits(&y), bits(&expected), "{n}");
            y.fill(f64::NAN);
            Widest(Rows(planes, &values, n, (0, 3), &mut y)).with_simd(pulp::Scalar::new());
            assert_eq!(bits(&y), bits(&expected), "{n}");
            for n_channels in 1..=5 {
                let x = numbers(n * n_channels, 3);
                let mut sum = vec![0.0; n_channels];
                add_row(&values[..n], &x, &mut sum);
                let channel = |c: usize| x.iter().skip(c).step_by(n_channels).copied().collect::<Vec<_>>();
                let expected: Vec<f64> = (0..n_channels).map(|c| by_hand(&values[..n], &channel(c))).collect();
                assert_eq!(bits(&sum), bits(&expected), "{n}, {n_channels} channels");
            }
        }
    }

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
                    Widest(Both(&values, [meeting])).with_simd(pulp::Scalar::new());
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
