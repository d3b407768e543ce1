//! The inner loops over dense numbers, compiled for several instruction sets, of which the best is chosen at run time.
//!
//! Every sum is kept in [`LANES`] partial sums, whatever the width of the registers, and products are rounded before they are
//! added: the result is the same bytes on all processors.

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

use pulp::{Arch, Simd, WithSimd};

use super::operator::Block;
use super::store::Scalar;

/// Partial sums of each sum: one register of AVX-512, two of AVX2, four of SSE2.
pub(super) const LANES: usize = 8;

/// The partial sums of one sum.
pub(super) type Lanes = [f64; LANES];

/// Rows of a tile that [`add_both`] takes at a time, so that the sums over columns are loaded and stored once for all of them.
const ROWS_AT_ONCE: usize = 4;

/// A block of vectors, each channel in one piece.
#[derive(Debug)]
pub(super) struct Planes {
    n_rows: usize,
    values: Vec<f64>,
}

impl Planes {
    pub(super) fn of(x: &Block) -> Self {
        let n_channels = x.n_channels();
        let channel = |c| x.values().iter().skip(c).step_by(n_channels).copied();
        Self {
            n_rows: x.n_rows(),
            values: (0..n_channels).flat_map(channel).collect(),
        }
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
struct Wide<S: Simd, const N: usize>([S::f64s; N]);

impl<S: Simd, const N: usize> Wide<S, N> {
    #[inline(always)]
    fn zero(simd: S) -> Self {
        Self([simd.splat_f64s(0.0); N])
    }

    #[inline(always)]
    fn splat(simd: S, value: f64) -> Self {
        Self([simd.splat_f64s(value); N])
    }

    #[inline(always)]
    fn load<T: Scalar>(values: &[T; LANES]) -> Self {
        let values = values.map(T::to_f64);
        let registers = S::as_simd_f64s(&values).0;
        Self(std::array::from_fn(|k| registers[k]))
    }

    #[inline(always)]
    fn store(self, values: &mut Lanes) {
        S::as_mut_simd_f64s(values).0.copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn plus(self, simd: S, other: Self) -> Self {
        Self(std::array::from_fn(|k| simd.add_f64s(self.0[k], other.0[k])))
    }

    /// Returns the sum with a product, both rounded.
    #[inline(always)]
    fn plus_product(self, simd: S, a: Self, b: Self) -> Self {
        let sum = |k: usize| simd.add_f64s(self.0[k], simd.mul_f64s(a.0[k], b.0[k]));
        Self(std::array::from_fn(sum))
    }
}

/// A loop for N registers of each [`Lanes`].
trait InnerLoop {
    fn run<S: Simd, const N: usize>(self, simd: S);
}

/// An [`InnerLoop`] that takes N from the instruction set.
struct Widest<L>(L);

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
fn dispatch(inner_loop: impl InnerLoop) {
    Arch::new().dispatch(Widest(inner_loop));
}

/// Sets row i of `y` (row-major, one entry per channel) to the product of row i of `values` (row-major) with `x`.
pub(super) fn multiply_rows<T: Scalar>(values: &[T], n_columns: usize, x: &Planes, y: &mut [f64]) {
    let n_channels = x.channels().len();
    let mut first_channel = 0;
    while first_channel < n_channels {
        // As many channels at once as the registers of most processors hold, and in each case as many rows.
        let plane = |k: usize| x.channel(first_channel + k);
        let to = (first_channel, n_channels);
        let n_done = (n_channels - first_channel).min(3);
        match n_done {
            1 => dispatch(Rows::<T, 4, 1>([plane(0)], values, n_columns, to, y)),
            2 => dispatch(Rows::<T, 2, 2>([plane(0), plane(1)], values, n_columns, to, y)),
            _ => dispatch(Rows::<T, 2, 3>(
                [plane(0), plane(1), plane(2)],
                values,
                n_columns,
                to,
                y,
            )),
        }
        first_channel += n_done;
    }
}

/// The loop of [`multiply_rows`] for C channels and R rows at a time.
///
/// Holds the channels, the matrix, its number of columns, the first channel and the number of channels in y, and y.
struct Rows<'a, T, const R: usize, const C: usize>([&'a [f64]; C], &'a [T], usize, (usize, usize), &'a mut [f64]);

impl<T: Scalar, const R: usize, const C: usize> InnerLoop for Rows<'_, T, R, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
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
                *lane += a.to_f64() * x_k;
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
                    lanes[k % LANES] += value.to_f64() * x[k * n_channels + c];
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
                    lanes[l][c] += a[l].to_f64() * x_k[l][c];
                }
            }
        }
        for (l, (a, x_k)) in rest.iter().zip(x_rest).enumerate() {
            for c in 0..C {
                lanes[l][c] += a.to_f64() * x_k[c];
            }
        }
        for (c, channel_sum) in sum.iter_mut().enumerate() {
            *channel_sum += total(&lanes.map(|lane| lane[c]));
        }
    }
}

/// Adds T `x_columns` to the partial sums `rows`, one for each row of T, and T^T `x_rows` to `y_columns`, reading T once.
///
/// `values` are the rows of T one after another. The order of the additions depends on the shape of T alone.
pub(super) fn add_both<T: Scalar>(
    values: &[T],
    x_rows: &[f64],
    x_columns: &[f64],
    rows: &mut [Lanes],
    y_columns: &mut [f64],
) {
    dispatch(Both(values, x_rows, x_columns, rows, y_columns));
}

/// The loop of [`add_both`]; its arguments.
struct Both<'a, T>(&'a [T], &'a [f64], &'a [f64], &'a mut [Lanes], &'a mut [f64]);

impl<T: Scalar> InnerLoop for Both<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        let Self(values, x_rows, x_columns, rows, y_columns) = self;
        let n_columns = x_columns.len();
        let n_whole = x_rows.len() - x_rows.len() % ROWS_AT_ONCE;
        let (x_fours, x_rest) = x_rows.as_chunks::<ROWS_AT_ONCE>();
        let (row_fours, rows_rest) = rows.as_chunks_mut::<ROWS_AT_ONCE>();
        let blocks = values.chunks_exact(ROWS_AT_ONCE * n_columns);
        for (block, (x, sums)) in blocks.zip(x_fours.iter().zip(row_fours)) {
            let of_rows = std::array::from_fn(|r| &block[r * n_columns..(r + 1) * n_columns]);
            both::<S, T, N, ROWS_AT_ONCE>(simd, of_rows, x, x_columns, sums, y_columns);
        }
        let rest = values[n_whole * n_columns..].chunks_exact(n_columns);
        for (row, (x, sums)) in rest.zip(x_rest.iter().zip(rows_rest)) {
            both::<S, T, N, 1>(simd, [row], &[*x], x_columns, std::array::from_mut(sums), y_columns);
        }
    }
}

/// Does with R rows what [`add_both`] does with all.
#[inline(always)]
fn both<S: Simd, T: Scalar, const N: usize, const R: usize>(
    simd: S,
    rows: [&[T]; R],
    x: &[f64; R],
    x_columns: &[f64],
    sums: &mut [Lanes; R],
    y_columns: &mut [f64],
) {
    let n_columns = x_columns.len();
    let n_whole = n_columns / LANES;
    let split = rows.map(|row| row[..n_columns].as_chunks::<LANES>());
    let whole = split.map(|s| &s.0[..n_whole]);
    let (x_whole, x_rest) = x_columns.as_chunks::<LANES>();
    let (y_whole, y_rest) = y_columns[..n_columns].as_chunks_mut::<LANES>();
    let (x_whole, y_whole) = (&x_whole[..n_whole], &mut y_whole[..n_whole]);
    let mut row_sums = sums.map(|lanes| Wide::<S, N>::load(&lanes));
    let x_rows = x.map(|x| Wide::<S, N>::splat(simd, x));
    for k in 0..n_whole {
        let x_k = Wide::load(&x_whole[k]);
        let mut column_sums = Wide::zero(simd);
        for r in 0..R {
            let a = Wide::load(&whole[r][k]);
            row_sums[r] = row_sums[r].plus_product(simd, a, x_k);
            column_sums = column_sums.plus_product(simd, a, x_rows[r]);
        }
        Wide::load(&y_whole[k]).plus(simd, column_sums).store(&mut y_whole[k]);
    }
    for (lanes, row_sum) in sums.iter_mut().zip(row_sums) {
        row_sum.store(lanes);
    }
    for l in 0..x_rest.len() {
        let mut column_sum = 0.0;
        for r in 0..R {
            let a = split[r].1[l].to_f64();
            sums[r][l] += a * x_rest[l];
            column_sum += a * x[r];
        }
        y_rest[l] += column_sum;
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
            lanes[k % LANES] += a * x;
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
            Widest(Rows::<f64, 2, 3>(planes, &values, n, (0, 3), &mut y)).with_simd(pulp::Scalar::new());
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
                if portable {
                    let inner_loop = Both(&values, &x_rows, &x_columns, &mut rows, &mut columns);
                    Widest(inner_loop).with_simd(pulp::Scalar::new());
                } else {
                    add_both(&values, &x_rows, &x_columns, &mut rows, &mut columns);
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
}
