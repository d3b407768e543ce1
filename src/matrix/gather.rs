//! The inner loops over sorted lists of entries, compiled as those of [`lanes`](super::lanes).
//!
//! Several channels are taken four at a time: the channels of a row of x fill one register, so that an entry is loaded, widened
//! and placed once for all of them, in no more instructions than for one channel.
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

use std::ops::Range;

use pulp::Simd;

use super::lanes::{InnerLoop, LANES, Wide, dispatch, total};
use super::planes::{FOUR, Planes};
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

/// Calls `add(row, columns, values)` for the entries of up to [`ROWS_AT_ONCE`] rows, as many whole chunks of eight at a time as begin in one panel of x,
/// of which there are `n` numbers of `byte` bytes.
///
/// The entries of each row come in order: where panels end makes no difference to any sum.
#[inline(always)]
fn by_panels<T: Copy>(
    rows: SparseRows<'_, T>,
    (n, byte): (usize, usize),
    mut add: impl FnMut(usize, &[[u32; LANES]], &[[T; LANES]]),
) {
    let n_rows = rows.begins.len() - 1;
    let n_entries = rows.begins[n_rows] - rows.begins[0];
    let width = (PANEL_BYTE / byte).max(PANEL_ENTRIES * n_rows * n / n_entries.max(1));
    let mut done = [0; ROWS_AT_ONCE];
    for begin in (0..n).step_by(width) {
        for (row, (ends, done)) in rows.begins.windows(2).zip(&mut done).enumerate() {
            let columns = &rows.columns[ends[0]..ends[1]].as_chunks().0[*done..];
            let values = &rows.values[ends[0]..ends[1]].as_chunks().0[*done..];
            let inside = columns
                .iter()
                .take_while(|j: &&[u32; LANES]| (j[0] as usize) < begin + width);
            let n_chunks = inside.count();
            add(row, &columns[..n_chunks], &values[..n_chunks]);
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
            by_panels(rows, (x.len(), size_of::<f64>()), |row, columns, values| {
                let mut sum = Wide::<S, N>::load(&sums[row]);
                for (j, a) in columns.iter().zip(values) {
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
    fn run<S: Simd, const N: usize>(self, _: S) {
        let Self(rows, x, channels, n_channels, y) = self;
        for (rows, y) in rows.groups().zip(y.chunks_mut(ROWS_AT_ONCE * n_channels)) {
            let mut sums = [[[0.0; FOUR]; LANES]; ROWS_AT_ONCE];
            by_panels(rows, (x.len(), size_of::<[f64; FOUR]>()), |row, columns, values| {
                let mut parts = sums[row];
                for (j, a) in columns.iter().zip(values) {
                    for l in 0..LANES {
                        add_product(&mut parts[l], a[l].to_f64(), &x[j[l] as usize]);
                    }
                }
                sums[row] = parts;
            });
            let y = y.chunks_exact_mut(n_channels).zip(&mut sums);
            for ((y_i, parts), (columns, values)) in y.zip(rows.rests()) {
                for (part, (j, a)) in parts.iter_mut().zip(columns.iter().zip(values)) {
                    add_product(part, a.to_f64(), &x[*j as usize]);
                }
                for (k, y_ic) in y_i[channels.clone()].iter_mut().enumerate() {
                    *y_ic = total(&parts.map(|part| part[k]));
                }
            }
        }
    }
}

/// Adds a times x to the sum, each channel rounded once.
#[inline(always)]
fn add_product(sum: &mut [f64; FOUR], a: f64, x: &[f64; FOUR]) {
    for c in 0..FOUR {
        sum[c] = a.mul_add(x[c], sum[c]);
    }
}

/// The entries of a square tile T in the order of rows, then columns.
#[derive(Clone, Copy)]
pub(super) struct SquareEntries<'a, T> {
    pub(super) rows: &'a [u8],
    pub(super) columns: &'a [u8],
    pub(super) values: &'a [T],
}

/// Partial sums of a row of a square tile.
const PARTS: usize = 4;

/// Adds T `x_columns` to `rows`, and T^T `x_rows` to `y_columns`, for one channel.
pub(super) fn add_both_listed<T: Scalar>(
    entries: SquareEntries<'_, T>,
    [x_rows, x_columns]: [&[f64]; 2],
    rows: &mut [f64],
    y_columns: &mut [f64],
) {
    dispatch(OneListed(entries, [x_rows, x_columns], rows, y_columns));
}

/// The loop of [`add_both_listed`].
struct OneListed<'a, T>(SquareEntries<'a, T>, [&'a [f64]; 2], &'a mut [f64], &'a mut [f64]);

impl<T: Scalar> InnerLoop for OneListed<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, _: S) {
        let Self(entries, [x_rows, x_columns], rows, y_columns) = self;
        for_each_row(entries, |row, columns, values| {
            let x_row = x_rows[row];
            let mut parts = [0.0; PARTS];
            in_turns(columns, values, &mut parts, |part, j, a| {
                let (j, a) = (usize::from(j), a.to_f64());
                *part = a.mul_add(x_columns[j], *part);
                y_columns[j] = a.mul_add(x_row, y_columns[j]);
            });
            rows[row] += (parts[0] + parts[1]) + (parts[2] + parts[3]);
        });
    }
}

/// Does what [`add_both_listed`] does for up to four channels, each as if it were alone; `rows` holds the sum of each channel.
pub(super) fn add_both_listed_four<T: Scalar>(
    entries: SquareEntries<'_, T>,
    [x_rows, x_columns]: [&[[f64; FOUR]]; 2],
    rows: &mut [[f64; FOUR]],
    y_columns: &mut [[f64; FOUR]],
) {
    dispatch(FourListed(entries, [x_rows, x_columns], rows, y_columns));
}

/// The loop of [`add_both_listed_four`].
struct FourListed<'a, T>(
    SquareEntries<'a, T>,
    [&'a [[f64; FOUR]]; 2],
    &'a mut [[f64; FOUR]],
    &'a mut [[f64; FOUR]],
);

impl<T: Scalar> InnerLoop for FourListed<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, _: S) {
        let Self(entries, [x_rows, x_columns], rows, y_columns) = self;
        for_each_row(entries, |row, columns, values| {
            let x_row = x_rows[row];
            let mut parts = [[0.0; FOUR]; PARTS];
            in_turns(columns, values, &mut parts, |part, j, a| {
                let (j, a) = (usize::from(j), a.to_f64());
                add_product(part, a, &x_columns[j]);
                let mut y = y_columns[j];
                add_product(&mut y, a, &x_row);
                y_columns[j] = y;
            });
            for (c, sum) in rows[row].iter_mut().enumerate() {
                *sum += (parts[0][c] + parts[1][c]) + (parts[2][c] + parts[3][c]);
            }
        });
    }
}

/// Calls `add(sum, column, value)` for the entries of a row, one after the other for each of `sums` and then again from the first.
#[inline(always)]
fn in_turns<P, J: Copy, T: Copy, const K: usize>(
    columns: &[J],
    values: &[T],
    sums: &mut [P; K],
    mut add: impl FnMut(&mut P, J, T),
) {
    let (columns, columns_rest) = columns.as_chunks::<K>();
    let (values, values_rest) = values.as_chunks::<K>();
    for (j, a) in columns.iter().zip(values) {
        for l in 0..K {
            add(&mut sums[l], j[l], a[l]);
        }
    }
    for (sum, (j, a)) in sums.iter_mut().zip(columns_rest.iter().zip(values_rest)) {
        add(sum, *j, *a);
    }
}

/// Calls `visit(row, columns, values)` for every row that has entries.
#[inline(always)]
fn for_each_row<T: Copy>(entries: SquareEntries<'_, T>, mut visit: impl FnMut(usize, &[u8], &[T])) {
    let SquareEntries { rows, columns, values } = entries;
    let mut begin = 0;
    while let Some(&row) = rows.get(begin) {
        let end = begin + run_length(&rows[begin..]);
        visit(row.into(), &columns[begin..end], &values[begin..end]);
        begin = end;
    }
}

/// Returns how many bytes are equal to the first, eight at a time.
#[inline(always)]
fn run_length(bytes: &[u8]) -> usize {
    let (words, rest) = bytes.as_chunks::<8>();
    let first = bytes[0];
    for (k, word) in words.iter().enumerate() {
        let differing = u64::from_le_bytes(*word) ^ u64::from_le_bytes([first; 8]);
        if differing != 0 {
            return 8 * k + differing.trailing_zeros() as usize / 8;
        }
    }
    let in_rest = rest.iter().take_while(|&&byte| byte == first).count();
    8 * words.len() + in_rest
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

    #[test]
    fn runs_end_where_the_bytes_change() {
        for length in 1..30 {
            for after in [0, 1, 20] {
                let bytes = [vec![5; length], vec![6; after]].concat();
                assert_eq!(run_length(&bytes), length);
            }
        }
    }
}
