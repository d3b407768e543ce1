//! The inner loops over dense numbers, compiled for several instruction sets, of which the best is chosen at run time.
//!
//! Every sum is kept in [`LANES`] partial sums, whatever the width of the registers, and every product is added with one rounding
//! (a fused multiply-add): the result is the same bytes on all processors. Processors without such an instruction, older than 2013,
//! take much longer.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::{Arch, Simd, WithSimd};

use super::aligned::LINE_BYTE;
use super::planes::Planes;
use super::prefetch::prefetch;
use super::scalar::Scalar;
use crate::matrix::kernel::sizes::{CHANNELS_AT_ONCE, LANES, Lanes};

/// Returns the sum of the partial sums.
pub(in crate::matrix) fn total(lanes: &Lanes) -> f64 {
    let [a, b, c, d, e, f, g, h] = *lanes;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// [`Lanes`] in N registers; they are explicit, because the compiler gives up on loops over many arrays of lanes.
#[derive(Clone, Copy)]
pub(in crate::matrix) struct Wide<S: Simd, const N: usize>([S::f64s; N]);

impl<S: Simd, const N: usize> Wide<S, N> {
    #[inline(always)]
    pub(in crate::matrix) fn zero(simd: S) -> Self {
        Self([simd.splat_f64s(0.0); N])
    }

    #[inline(always)]
    pub(in crate::matrix) fn splat(simd: S, value: f64) -> Self {
        Self([simd.splat_f64s(value); N])
    }

    #[inline(always)]
    pub(in crate::matrix) fn load<T: Scalar>(values: &[T; LANES]) -> Self {
        T::with_widened(values, Self::of)
    }

    /// Returns fewer numbers than [`LANES`], and zeros.
    #[inline(always)]
    pub(in crate::matrix) fn load_some<T: Scalar>(simd: S, values: &[T]) -> Self {
        Self(T::widen_some(simd, values))
    }

    #[inline(always)]
    pub(in crate::matrix) fn of(values: &Lanes) -> Self {
        let registers = S::as_simd_f64s(values).0;
        Self(std::array::from_fn(|k| registers[k]))
    }

    #[inline(always)]
    pub(in crate::matrix) fn store(self, values: &mut Lanes) {
        S::as_mut_simd_f64s(values).0.copy_from_slice(&self.0);
    }

    /// Returns the sum with a product, rounded once.
    #[inline(always)]
    pub(in crate::matrix) fn plus_product(self, simd: S, a: Self, b: Self) -> Self {
        Self(std::array::from_fn(|k| simd.mul_add_f64s(a.0[k], b.0[k], self.0[k])))
    }
}

/// A loop for N registers of each [`Lanes`].
pub(in crate::matrix) trait InnerLoop {
    fn run<S: Simd, const N: usize>(self, simd: S);
}

/// An [`InnerLoop`] that takes N from the instruction set.
pub(in crate::matrix) struct Widest<L>(pub(in crate::matrix) L);

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
pub(in crate::matrix) fn dispatch(inner_loop: impl InnerLoop) {
    Arch::new().dispatch(Widest(inner_loop));
}

/// Sets row i of `y` (row-major, one entry per channel) to the product of row i of `values` (row-major) with `x`.
pub(in crate::matrix) fn multiply_rows<T: Scalar>(values: &[T], n_columns: usize, x: &Planes, y: &mut [f64]) {
    let n_channels = x.n_channels();
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
            (1, 1) => self.by_rows::<S, N, 8>(simd),
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

/// Returns the distance in bytes at which numbers of a row are prefetched, where so many rows are read at once.
///
/// A row by itself, as in sweeps, is followed by the next, where the prefetched bytes mostly are. Fewer bytes slow sweeps down over matrices of
/// the size of the third-level cache, and more gain nothing.
pub(in crate::matrix) const fn ahead_byte(n_rows: usize) -> usize {
    if n_rows == 1 { 8192 } else { 2048 }
}

/// The length of a row in bytes below which nothing is prefetched: square matrices with shorter rows lie in the second-level cache.
///
/// There, asking for a line takes as long as reading it.
const SHORT_BYTE: usize = 4096;

/// Registers' worth of columns in a step: a cache line of f32.
const STEP: usize = 2;

/// Unrolls a loop over the numbers below one of at most eight that is known at compile time.
///
/// The compiler unrolls a loop too, but one that it finds too long so late that the sums leave the registers: three channels then took 1.7 of the time of one.
macro_rules! unrolled {
    ($i:ident < $n:expr, $body:block) => {
        const { assert!($n <= 8, "no more are written out") }
        unrolled!($i < $n, $body, 0 1 2 3 4 5 6 7)
    };
    ($i:ident < $n:expr, $body:block, $($k:literal)*) => {
        $(if $k < $n {
            let $i: usize = $k;
            $body
        })*
    };
}

/// Returns the products of R rows with C channels. The order of the additions depends on the number of columns alone.
#[inline(always)]
pub(in crate::matrix) fn dot<S: Simd, T: Scalar, const N: usize, const R: usize, const C: usize>(
    simd: S,
    rows: [&[T]; R],
    x: [&[f64]; C],
) -> [[f64; C]; R] {
    let n_columns = x[0].len();
    let split = rows.map(|row| row[..n_columns].as_chunks::<LANES>());
    let x_split = x.map(|x| x[..n_columns].as_chunks::<LANES>());
    let whole = split.map(|s| s.0.as_chunks::<STEP>());
    let x_whole = x_split.map(|s| s.0.as_chunks::<STEP>());
    let (n_steps, n_rest) = (x_whole[0].0.len(), x_whole[0].1.len());
    let (steps, x_steps) = (whole.map(|w| &w.0[..n_steps]), x_whole.map(|w| &w.0[..n_steps]));
    let is_short = n_columns * size_of::<T>() < SHORT_BYTE;
    let mut sums = [[Wide::<S, N>::zero(simd); C]; R];
    for k in 0..n_steps {
        unrolled!(s < STEP, {
            let mut x_s = [Wide::<S, N>::zero(simd); C];
            for c in 0..C {
                x_s[c] = Wide::load(&x_steps[c][k][s]);
            }
            unrolled!(r < R, {
                if !is_short && (s * LANES * size_of::<T>()).is_multiple_of(LINE_BYTE) {
                    prefetch(&steps[r][k][s], const { ahead_byte(R) / size_of::<T>() });
                }
                let a = Wide::load(&steps[r][k][s]);
                for c in 0..C {
                    sums[r][c] = sums[r][c].plus_product(simd, a, x_s[c]);
                }
            });
        });
    }
    for s in 0..n_rest {
        unrolled!(r < R, {
            let a = Wide::load(&whole[r].1[s]);
            for c in 0..C {
                sums[r][c] = sums[r][c].plus_product(simd, a, Wide::load(&x_whole[c].1[s]));
            }
        });
    }
    let mut totals = [[0.0; C]; R];
    for r in 0..R {
        for c in 0..C {
            if !x_split[c].1.is_empty() {
                let (a, x_rest) = (Wide::load_some(simd, split[r].1), Wide::load_some(simd, x_split[c].1));
                sums[r][c] = sums[r][c].plus_product(simd, a, x_rest);
            }
            let mut lanes = [0.0; LANES];
            sums[r][c].store(&mut lanes);
            totals[r][c] = total(&lanes);
        }
    }
    totals
}

/// Adds `values` times x to `sum`, where row k of `x` (row-major, one entry per channel; as many rows as values) belongs to number k.
///
/// The order of the additions depends on the number of values alone, and each channel is summed as if it were alone.
pub(in crate::matrix) fn add_row<T: Scalar>(values: &[T], x: &[f64], sum: &mut [f64]) {
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

/// Returns Σ w_i u_ic v_ic of each channel c (`u` and `v` row-major, one entry per channel).
///
/// The order of the additions depends on the number of rows alone, and each channel is summed as if it were alone.
pub(crate) fn weighted_products(w: &[f64], u: &[f64], v: &[f64]) -> Vec<f64> {
    let n_channels = u.len().checked_div(w.len()).unwrap_or(0);
    let mut sums = vec![0.0; n_channels];
    match n_channels {
        1 => dispatch(Weighted::<1>(w, u, v, &mut sums)),
        2 => dispatch(Weighted::<2>(w, u, v, &mut sums)),
        3 => dispatch(Weighted::<3>(w, u, v, &mut sums)),
        _ => {
            let channel = |x: &[f64], c: usize| x.iter().skip(c).step_by(n_channels).copied().collect::<Vec<f64>>();
            for (c, sum) in sums.iter_mut().enumerate() {
                let (u, v) = (channel(u, c), channel(v, c));
                dispatch(Weighted::<1>(w, &u, &v, std::slice::from_mut(sum)));
            }
        }
    }
    sums
}

/// The loop of [`weighted_products`] for C channels.
struct Weighted<'a, const C: usize>(&'a [f64], &'a [f64], &'a [f64], &'a mut [f64]);

impl<const C: usize> InnerLoop for Weighted<'_, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, _: S) {
        let Self(w, u, v, sums) = self;
        let (u, v) = (u.as_chunks::<C>().0, v.as_chunks::<C>().0);
        let (w_whole, w_rest) = w.as_chunks::<LANES>();
        let ((u_whole, u_rest), (v_whole, v_rest)) = (u.as_chunks::<LANES>(), v.as_chunks::<LANES>());
        let mut lanes = [[0.0; C]; LANES];
        let add = |lane: &mut [f64; C], w: f64, u: &[f64; C], v: &[f64; C]| {
            for c in 0..C {
                lane[c] = (w * u[c]).mul_add(v[c], lane[c]);
            }
        };
        for ((w, u), v) in w_whole.iter().zip(u_whole).zip(v_whole) {
            for l in 0..LANES {
                add(&mut lanes[l], w[l], &u[l], &v[l]);
            }
        }
        for (lane, ((w, u), v)) in lanes.iter_mut().zip(w_rest.iter().zip(u_rest).zip(v_rest)) {
            add(lane, *w, u, v);
        }
        for (c, sum) in sums.iter_mut().enumerate() {
            *sum = total(&lanes.map(|lane| lane[c]));
        }
    }
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

#[cfg(test)]
pub(in crate::matrix) mod tests {
    use super::*;
    use crate::matrix::operator::Block;

    /// Numbers whose sums depend on the order of the additions.
    pub(in crate::matrix) fn numbers(n: usize, seed: usize) -> Vec<f64> {
        (0..n).map(|k| (((k + seed) * 7919) % 1009) as f64 / 1009.0).collect()
    }

    /// The documented sum, written out.
    fn by_hand(values: &[f64], x: &[f64]) -> f64 {
        let mut lanes = [0.0; LANES];
        for (k, (a, x)) in values.iter().zip(x).enumerate() {
            lanes[k % LANES] = a.mul_add(*x, lanes[k % LANES]);
        }
        total(&lanes)
    }

    pub(in crate::matrix) fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    /// Instruction sets that [`run_on`] knows.
    pub(in crate::matrix) const N_SETS: usize = 3;

    /// Runs a loop as compiled for the best instruction set, for AVX2 where the processor has it, or for none.
    pub(in crate::matrix) fn run_on(set: usize, inner_loop: impl InnerLoop) {
        #[cfg(target_arch = "x86_64")]
        if set == 1
            && let Some(simd) = pulp::x86::V3::try_new()
        {
            return Simd::vectorize(simd, Widest(inner_loop));
        }
        if set == 0 {
            dispatch(inner_loop);
        } else {
            Simd::vectorize(pulp::Scalar::new(), Widest(inner_loop));
        }
    }

    #[test]
    fn rows_are_the_same_bytes_with_every_instruction_set() {
        check_rows::<f64>();
        check_rows::<f32>();
    }

    fn check_rows<T: Scalar>() {
        for n in (1..20).chain([63, 64, 65]) {
            let n_rows = 5;
            let stored: Vec<T> = numbers(n_rows * n, 1).into_iter().map(T::from_f64).collect();
            let values: Vec<f64> = stored.iter().map(|value| value.to_f64()).collect();
            let x = Planes::of(&Block::from_values(numbers(3 * n, 2), 3));
            let planes = [x.channel(0), x.channel(1), x.channel(2)];
            let expected: Vec<f64> = values
                .chunks_exact(n)
                .flat_map(|row| planes.map(|plane| by_hand(row, plane)))
                .collect();
            let mut y = vec![f64::NAN; 3 * n_rows];
            multiply_rows(&stored, n, &x, &mut y);
            assert_eq!(bits(&y), bits(&expected), "{n}");
            for set in 0..N_SETS {
                y.fill(f64::NAN);
                run_on(set, Rows(planes, &stored, n, (0, 3), &mut y));
                assert_eq!(bits(&y), bits(&expected), "{n}, {set}");
                let mut sum = [0.0];
                run_on(set, Single(&stored[..n], x.channel(0), &mut sum));
                assert_eq!(bits(&sum), bits(&expected[..1]), "{n}, {set}");
            }
            for n_channels in 1..=5 {
                let x = numbers(n * n_channels, 3);
                let mut sum = vec![0.0; n_channels];
                add_row(&stored[..n], &x, &mut sum);
                let channel = |c: usize| x.iter().skip(c).step_by(n_channels).copied().collect::<Vec<_>>();
                let expected: Vec<f64> = (0..n_channels).map(|c| by_hand(&values[..n], &channel(c))).collect();
                assert_eq!(bits(&sum), bits(&expected), "{n}, {n_channels} channels");
            }
        }
    }

    #[test]
    fn weighted_products_are_the_same_bytes_however_many_there_are() {
        for n in [1, 7, 8, 65, 130] {
            for n_channels in 1..=5 {
                let (w, u, v) = (numbers(n, 3), numbers(n * n_channels, 4), numbers(n * n_channels, 5));
                let of_channel = |c: usize| {
                    let scaled: Vec<f64> = (0..n).map(|i| w[i] * u[i * n_channels + c]).collect();
                    let v: Vec<f64> = (0..n).map(|i| v[i * n_channels + c]).collect();
                    by_hand(&scaled, &v)
                };
                let expected: Vec<f64> = (0..n_channels).map(of_channel).collect();
                assert_eq!(
                    bits(&weighted_products(&w, &u, &v)),
                    bits(&expected),
                    "{n}, {n_channels}"
                );
            }
        }
    }
}
