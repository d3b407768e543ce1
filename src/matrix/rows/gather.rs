//! The inner loops over sorted lists of entries, compiled as those of [`lanes`](crate::matrix::kernel::lanes).
//!
//! Several channels are taken four at a time: the channels of two rows of x fill one register, so that entries are loaded, widened
//! and placed once for all of them, in hardly more instructions than for one channel.
//!
//! Positions are checked at every access on purpose: without that the compiler gathers eight entries with one instruction, which is
//! much slower on some processors with AVX-512 and hardly faster on others.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

#[cfg(target_arch = "x86_64")]
use std::hint::black_box;
use std::ops::Range;

use pulp::Simd;
#[cfg(target_arch = "x86_64")]
use pulp::{cast, x86::V4};

use super::panels::Panels;
use crate::matrix::kernel::lanes::{InnerLoop, Wide, dispatch, total};
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::prefetch::prefetch;
use crate::matrix::kernel::scalar::Scalar;
use crate::matrix::kernel::sizes::{FOUR, LANES, Lanes};

/// Some rows of a tile in compressed sparse rows: part k of its [`Panels`] holds the places `begins[k]..begins[k + 1]`.
#[derive(Clone, Copy)]
pub(in crate::matrix) struct SparseRows<'a, T> {
    pub(in crate::matrix) panels: Panels,
    pub(in crate::matrix) first_row: usize,
    pub(in crate::matrix) begins: &'a [usize],
    pub(in crate::matrix) columns: &'a [u32],
    pub(in crate::matrix) values: &'a [T],
}

/// Sets `y` (row-major, one entry per channel) to the products of the rows with `x`.
///
/// Every sum is kept in [`LANES`] partial sums over entries 0, 1, 2, ... mod 8 of each part of the row; each channel is the same bytes as if it
/// were alone.
pub(in crate::matrix) fn multiply_sparse_rows<T: Scalar>(rows: SparseRows<'_, T>, x: &Planes, y: &mut [f64]) {
    let n_channels = x.n_channels();
    if n_channels == 1 {
        return dispatch(One(rows, x.channel(0), y));
    }
    for (group, fours) in x.fours().enumerate() {
        let first = group * FOUR;
        dispatch(Four(rows, fours, first..n_channels.min(first + FOUR), n_channels, y));
    }
}

/// The prefetch distance in entries: those that memory delivers in its latency. Parts follow one another in memory.
const AHEAD: usize = 1024;

/// Rows that are visited in turn in each panel.
const ROWS_AT_ONCE: usize = 16;

/// A part of a row of [`SparseRows`], eight entries at a time, and the rest that does not fill a chunk.
struct Chunks<'a, T> {
    whole: (&'a [[u32; LANES]], &'a [[T; LANES]]),
    rest: (&'a [u32], &'a [T]),
}

impl<'a, T> SparseRows<'a, T> {
    /// Calls `add` with the part of row k of `n_rows` that is in each panel, for all of them, and with k.
    #[inline(always)]
    fn for_each_part(self, n_rows: usize, mut add: impl FnMut(usize, Chunks<'a, T>)) {
        for panel in self.panels.all() {
            for k in 0..n_rows {
                let part = self.panels.place(panel, self.first_row + k);
                let places = self.begins[part]..self.begins[part + 1];
                let (columns, last_columns) = self.columns[places.clone()].as_chunks();
                let (values, last_values) = self.values[places].as_chunks();
                let whole = (columns, values);
                let rest = (last_columns, last_values);
                add(k, Chunks { whole, rest });
            }
        }
    }

    /// Returns the rows from row k of these on.
    #[inline(always)]
    fn from(self, k: usize) -> Self {
        let first_row = self.first_row + k;
        Self { first_row, ..self }
    }
}

impl<'a, T> Chunks<'a, T> {
    /// Calls `add` with the columns and values of each eight entries.
    #[inline(always)]
    fn for_each(&self, mut add: impl FnMut(&'a [u32; LANES], &'a [T; LANES])) {
        for (j, a) in self.whole.0.iter().zip(self.whole.1) {
            prefetch(j, AHEAD);
            prefetch(a, AHEAD);
            add(j, a);
        }
    }
}

/// The loop of [`multiply_sparse_rows`] for one channel.
struct One<'a, T>(SparseRows<'a, T>, &'a [f64], &'a mut [f64]);

impl<T: Scalar> InnerLoop for One<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        let Self(rows, x, y) = self;
        for (group, y_rows) in y.chunks_mut(ROWS_AT_ONCE).enumerate() {
            let mut partial = [[0.0; LANES]; ROWS_AT_ONCE];
            rows.from(group * ROWS_AT_ONCE).for_each_part(y_rows.len(), |k, part| {
                let lanes = &mut partial[k];
                let mut sum = Wide::<S, N>::load(lanes);
                part.for_each(|j, a| {
                    let gathered = j.map(|j| x[j as usize]);
                    sum = sum.plus_product(simd, Wide::load(a), Wide::load(&gathered));
                });
                sum.store(lanes);
                for (lane, (j, a)) in lanes.iter_mut().zip(part.rest.0.iter().zip(part.rest.1)) {
                    *lane = a.to_f64().mul_add(x[*j as usize], *lane);
                }
            });
            for (y_i, lanes) in y_rows.iter_mut().zip(&partial) {
                *y_i = total(lanes);
            }
        }
    }
}

/// The loop of [`multiply_sparse_rows`] for up to four channels; which of how many in y.
struct Four<'a, T>(SparseRows<'a, T>, &'a [[f64; FOUR]], Range<usize>, usize, &'a mut [f64]);

impl<T: Scalar> InnerLoop for Four<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        #[cfg(target_arch = "x86_64")]
        if N == 1
            && let Some(with) = V4::try_new()
        {
            // If it knew the positions, the compiler would separate the numbers before it widens them, in twice as many instructions.
            let of_pairs = black_box([0, 2, 4, 6].map(|k: u64| [k, k, k, k, k + 1, k + 1, k + 1, k + 1]));
            return self.by_pairs::<S, N>(simd, |a| {
                of_pairs.map(|of_pair| cast(with.avx512f._mm512_permutexvar_pd(cast(of_pair), cast(a))))
            });
        }
        self.by_pairs::<S, N>(simd, |a| {
            std::array::from_fn(|p| {
                let (first, second) = (a[2 * p], a[2 * p + 1]);
                [first, first, first, first, second, second, second, second]
            })
        });
    }
}

impl<T: Scalar> Four<'_, T> {
    /// Computes the products, with the function that repeats each of eight numbers four times.
    #[inline(always)]
    fn by_pairs<S: Simd, const N: usize>(self, simd: S, four_times: impl Fn(Lanes) -> [Lanes; PAIRS]) {
        let Self(rows, x, channels, n_channels, y) = self;
        for (group, y_rows) in y.chunks_mut(ROWS_AT_ONCE * n_channels).enumerate() {
            // Two entries of a row share a register.
            let mut partial = [[[0.0; LANES]; PAIRS]; ROWS_AT_ONCE];
            let n_rows = y_rows.len() / n_channels;
            rows.from(group * ROWS_AT_ONCE).for_each_part(n_rows, |k, part| {
                let pairs = &mut partial[k];
                let mut sums = [Wide::<S, N>::zero(simd); PAIRS];
                for p in 0..PAIRS {
                    sums[p] = Wide::load(&pairs[p]);
                }
                part.for_each(|j, a| {
                    let repeated = four_times(a.map(T::to_f64));
                    for p in 0..PAIRS {
                        let [b, c, d, e] = x[j[2 * p] as usize];
                        let [f, g, h, i] = x[j[2 * p + 1] as usize];
                        let x_pair = Wide::load(&[b, c, d, e, f, g, h, i]);
                        sums[p] = sums[p].plus_product(simd, Wide::load(&repeated[p]), x_pair);
                    }
                });
                for p in 0..PAIRS {
                    sums[p].store(&mut pairs[p]);
                }
                let lanes = pairs.as_flattened_mut().as_chunks_mut::<FOUR>().0;
                for (lane, (j, a)) in lanes.iter_mut().zip(part.rest.0.iter().zip(part.rest.1)) {
                    add_product(lane, a.to_f64(), &x[*j as usize]);
                }
            });
            for (y_i, pairs) in y_rows.chunks_exact_mut(n_channels).zip(&partial) {
                let lanes = pairs.as_flattened().as_chunks::<FOUR>().0;
                for (c, y_ic) in y_i[channels.clone()].iter_mut().enumerate() {
                    *y_ic = total(&std::array::from_fn(|l| lanes[l][c]));
                }
            }
        }
    }
}

/// Registers with the sums of a row, each those of [`FOUR`] channels over two of the [`LANES`] entries.
const PAIRS: usize = LANES / 2;

const _: () = assert!(2 * FOUR == LANES, "two rows of x in a register");

/// Adds a times x to the sum, each channel rounded once.
#[inline(always)]
fn add_product(sum: &mut [f64; FOUR], a: f64, x: &[f64; FOUR]) {
    for c in 0..FOUR {
        sum[c] = a.mul_add(x[c], sum[c]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::kernel::lanes::tests::{bits, numbers};
    use crate::matrix::operator::Block;

    /// Full rows, empty ones, and a few entries near the end.
    #[test]
    fn rows_are_summed_in_the_order_that_is_promised() {
        for width in [1029, 300] {
            check_rows(width);
        }
    }

    fn check_rows(width: usize) {
        let (n, n_rows, first_row) = (1029, 39, 2);
        let panels = Panels::of_width(n_rows, n, width);
        let wanted = |i: usize, j: usize| match i % 4 {
            0 => true,
            1 => false,
            2 => (j * 7919 + i) % 5 < 2,
            _ => j > n - 30 && j.is_multiple_of(3),
        };
        let (mut begins, mut columns) = (vec![0], Vec::<u32>::new());
        for (panel, i) in panels.all().flat_map(|panel| (0..n_rows).map(move |i| (panel, i))) {
            let in_panel = (0..).zip(0..n).filter(|&(_, j)| panels.of(j) == panel && wanted(i, j));
            columns.extend(in_panel.map(|(j, _)| j));
            begins.push(columns.len());
        }
        let values = numbers(columns.len(), 1);
        let rows = SparseRows {
            panels,
            first_row,
            begins: &begins,
            columns: &columns,
            values: &values,
        };
        for n_channels in [1, 3, 5] {
            let x = numbers(n * n_channels, 2);
            let sum = |i: usize, c: usize| {
                let mut lanes = [0.0; LANES];
                for part in panels.all().map(|panel| panels.place(panel, i)) {
                    for (k, at) in (begins[part]..begins[part + 1]).enumerate() {
                        let x_j = x[columns[at] as usize * n_channels + c];
                        lanes[k % LANES] = values[at].mul_add(x_j, lanes[k % LANES]);
                    }
                }
                total(&lanes)
            };
            let expected: Vec<f64> = (first_row..n_rows)
                .flat_map(|i| (0..n_channels).map(move |c| (i, c)))
                .map(|(i, c)| sum(i, c))
                .collect();
            let planes = Planes::of(&Block::from_values(x.clone(), n_channels));
            let mut y = vec![f64::NAN; (n_rows - first_row) * n_channels];
            multiply_sparse_rows(rows, &planes, &mut y);
            assert_eq!(bits(&y), bits(&expected), "{n_channels} channels");
        }
    }
}
