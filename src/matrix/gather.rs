//! The inner loops over sorted lists of entries, compiled as those of [`lanes`](super::lanes).
//!
//! Several channels are taken four at a time: the channels of two rows of x fill one register, so that entries are loaded, widened
//! and placed once for all of them, in hardly more instructions than for one channel.
//!
//! Places are checked at every access on purpose: without that the compiler gathers with one instruction for eight entries, which took twice as
//! long (1.11 ns an entry, 0.52 with checks, x in the first-level cache, on a processor with AVX-512).

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]
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

use super::lanes::{InnerLoop, LANES, Lanes, Wide, dispatch, total};
use super::planes::{FOUR, Planes};
use super::prefetch::prefetch;
use super::store::Scalar;

/// Compressed sparse rows: row k holds the places `begins[k]..begins[k + 1]`.
#[derive(Clone, Copy)]
pub(super) struct SparseRows<'a, T> {
    pub(super) begins: &'a [usize],
    pub(super) columns: &'a [u32],
    pub(super) values: &'a [T],
}

/// Sets `y` (row-major, one entry per channel) to the products of the rows with `x`.
///
/// Every sum is kept in [`LANES`] partial sums over entries 0, 1, 2, ... mod 8 of the row; each channel is the same bytes as if it
/// were alone.
pub(super) fn multiply_sparse_rows<T: Scalar>(rows: SparseRows<'_, T>, x: &Planes, y: &mut [f64]) {
    let n_channels = x.n_channels();
    if n_channels == 1 {
        return dispatch(One(rows, x.channel(0), y));
    }
    for (group, fours) in x.fours().enumerate() {
        let first = group * FOUR;
        dispatch(Four(rows, fours, first..n_channels.min(first + FOUR), n_channels, y));
    }
}

/// Rows that go through the panels of x together.
const ROWS_AT_ONCE: usize = 16;

/// Bytes of a panel of x, which stays in the first-level cache while all rows take what they need of it.
const PANEL_BYTE: usize = 1 << 14;

/// Entries of a row in a panel, on average, below which panels are not worth their bounds.
const PANEL_ENTRIES: usize = 64;

/// Calls `add(row, columns, values, ahead)` for the entries of up to [`ROWS_AT_ONCE`] rows, as many whole chunks of eight at a time as begin in one panel of x,
/// of which there are `n` numbers of `byte` bytes.
///
/// The entries of each row come in order: where panels end makes no difference to any sum. `ahead` entries further is what comes next but for the other rows: the row's
/// entries in the next panel, or those of the next rows in the first one.
#[inline(always)]
fn by_panels<T: Copy>(
    rows: SparseRows<'_, T>,
    (n, byte): (usize, usize),
    mut add: impl FnMut(usize, &[[u32; LANES]], &[[T; LANES]], usize),
) {
    let n_rows = rows.begins.len() - 1;
    let n_entries = rows.begins[n_rows] - rows.begins[0];
    let width = (PANEL_BYTE / byte).max(PANEL_ENTRIES * n_rows * n / n_entries.max(1));
    let in_panel = n_entries * width / (n_rows * n).max(1);
    let mut done = [0; ROWS_AT_ONCE];
    for begin in (0..n).step_by(width) {
        let ahead = if begin + width < n {
            in_panel
        } else {
            (n_entries + in_panel).saturating_sub(n_entries / n_rows.max(1))
        };
        for (row, (ends, done)) in rows.begins.windows(2).zip(&mut done).enumerate() {
            let columns = &rows.columns[ends[0]..ends[1]].as_chunks().0[*done..];
            let values = &rows.values[ends[0]..ends[1]].as_chunks().0[*done..];
            let inside = columns
                .iter()
                .take_while(|j: &&[u32; LANES]| (j[0] as usize) < begin + width);
            let n_chunks = inside.count();
            add(row, &columns[..n_chunks], &values[..n_chunks], ahead);
            *done += n_chunks;
        }
    }
}

impl<'a, T> SparseRows<'a, T> {
    /// Returns the rows in groups that go through the panels together.
    fn groups(self) -> impl Iterator<Item = Self> {
        let n_rows = self.begins.len() - 1;
        (0..n_rows).step_by(ROWS_AT_ONCE).map(move |first| Self {
            begins: &self.begins[first..=n_rows.min(first + ROWS_AT_ONCE)],
            columns: self.columns,
            values: self.values,
        })
    }

    /// Returns the columns and values of each row that do not fill a chunk of eight.
    fn rests(self) -> impl Iterator<Item = (&'a [u32], &'a [T])> {
        self.begins.windows(2).map(move |ends| {
            let places = ends[0]..ends[1];
            let columns = self.columns[places.clone()].as_chunks::<LANES>().1;
            (columns, self.values[places].as_chunks::<LANES>().1)
        })
    }
}

/// The loop of [`multiply_sparse_rows`] for one channel.
struct One<'a, T>(SparseRows<'a, T>, &'a [f64], &'a mut [f64]);

impl<T: Scalar> InnerLoop for One<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        let Self(rows, x, y) = self;
        for (rows, y) in rows.groups().zip(y.chunks_mut(ROWS_AT_ONCE)) {
            let mut sums = [[0.0; LANES]; ROWS_AT_ONCE];
            by_panels(rows, (x.len(), size_of::<f64>()), |row, columns, values, ahead| {
                let mut sum = Wide::<S, N>::load(&sums[row]);
                for (j, a) in columns.iter().zip(values) {
                    prefetch(j, ahead);
                    prefetch(a, ahead);
                    let gathered = j.map(|j| x[j as usize]);
                    sum = sum.plus_product(simd, Wide::load(a), Wide::load(&gathered));
                }
                sum.store(&mut sums[row]);
            });
            for ((y_i, lanes), (columns, values)) in y.iter_mut().zip(&mut sums).zip(rows.rests()) {
                for (lane, (j, a)) in lanes.iter_mut().zip(columns.iter().zip(values)) {
                    *lane = a.to_f64().mul_add(x[*j as usize], *lane);
                }
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
            // If it knew the places, the compiler would take the numbers apart before it widens them, in twice as many instructions.
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
    /// Does it with the function that repeats each of eight numbers four times.
    #[inline(always)]
    fn by_pairs<S: Simd, const N: usize>(self, simd: S, four_times: impl Fn(Lanes) -> [Lanes; PAIRS]) {
        let Self(rows, x, channels, n_channels, y) = self;
        for (rows, y) in rows.groups().zip(y.chunks_mut(ROWS_AT_ONCE * n_channels)) {
            // Two entries of a row share a register.
            let mut sums = [[[0.0; LANES]; PAIRS]; ROWS_AT_ONCE];
            by_panels(
                rows,
                (x.len(), size_of::<[f64; FOUR]>()),
                |row, columns, values, ahead| {
                    let mut parts: [Wide<S, N>; PAIRS] = sums[row].each_ref().map(Wide::load);
                    for (j, a) in columns.iter().zip(values) {
                        prefetch(j, ahead);
                        prefetch(a, ahead);
                        let repeated = four_times(a.map(T::to_f64));
                        for p in 0..PAIRS {
                            let [b, c, d, e] = x[j[2 * p] as usize];
                            let [f, g, h, i] = x[j[2 * p + 1] as usize];
                            let x_pair = Wide::load(&[b, c, d, e, f, g, h, i]);
                            parts[p] = parts[p].plus_product(simd, Wide::load(&repeated[p]), x_pair);
                        }
                    }
                    for (sum, part) in sums[row].iter_mut().zip(parts) {
                        part.store(sum);
                    }
                },
            );
            let y = y.chunks_exact_mut(n_channels).zip(&mut sums);
            for ((y_i, pairs), (columns, values)) in y.zip(rows.rests()) {
                let parts = pairs.as_flattened_mut().as_chunks_mut::<FOUR>().0;
                for (part, (j, a)) in parts.iter_mut().zip(columns.iter().zip(values)) {
                    add_product(part, a.to_f64(), &x[*j as usize]);
                }
                for (k, y_ic) in y_i[channels.clone()].iter_mut().enumerate() {
                    let lanes: [f64; LANES] = std::array::from_fn(|l| parts[l][k]);
                    *y_ic = total(&lanes);
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
    use super::super::lanes::tests::{bits, numbers};
    use super::super::operator::Block;
    use super::*;

    /// More rows than go together, and more columns than a panel has: full rows, empty ones, and a few entries near the end.
    #[test]
    fn rows_in_panels_are_summed_in_the_order_that_is_promised() {
        let (n, n_rows) = (4 * PANEL_BYTE / size_of::<f64>() + 5, ROWS_AT_ONCE + 3);
        let (mut begins, mut columns) = (vec![0], Vec::new());
        for i in 0..n_rows {
            let wanted = |j: &usize| match i % 4 {
                0 => true,
                1 => false,
                2 => (j * 7919 + i) % 5 < 2,
                _ => *j > n - 30 && j.is_multiple_of(3),
            };
            columns.extend((0..).zip(0..n).filter(|(_, j)| wanted(j)).map(|(j, _): (u32, usize)| j));
            begins.push(columns.len());
        }
        let values = numbers(columns.len(), 1);
        let rows = SparseRows {
            begins: &begins,
            columns: &columns,
            values: &values,
        };
        for n_channels in [1, 3, 5] {
            let x = numbers(n * n_channels, 2);
            let expected: Vec<f64> = begins
                .windows(2)
                .flat_map(|ends| (0..n_channels).map(|c| (ends[0]..ends[1], c)))
                .map(|(places, c)| {
                    let mut lanes = [0.0; LANES];
                    for (k, at) in places.enumerate() {
                        let x_j = x[columns[at] as usize * n_channels + c];
                        lanes[k % LANES] = values[at].mul_add(x_j, lanes[k % LANES]);
                    }
                    total(&lanes)
                })
                .collect();
            let planes = Planes::of(&Block::from_values(x.clone(), n_channels));
            let mut y = vec![f64::NAN; n_rows * n_channels];
            multiply_sparse_rows(rows, &planes, &mut y);
            assert_eq!(bits(&y), bits(&expected), "{n_channels} channels");
        }
    }
}
