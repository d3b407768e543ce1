//! Rows stored in blocks of columns, with a bit for each column that has an entry.

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

use super::panels::Panels;
use super::store::{Numbers, Store};
use crate::matrix::backend::Sizes;
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::aligned::LINE_BYTE;
use crate::matrix::kernel::expand::{Expander, OneByOne};
use crate::matrix::kernel::lanes::{InnerLoop, Wide, dispatch, total};
use crate::matrix::kernel::planes::Planes;
use crate::matrix::kernel::prefetch::prefetch;
#[cfg(target_arch = "x86_64")]
use crate::matrix::kernel::scalar::WithV4;
use crate::matrix::kernel::scalar::{Row, Scalar};
use crate::matrix::kernel::sizes::{CHANNELS_AT_ONCE, LANES, SIDE, STRIP, ones};
use crate::matrix::operator::Block;
use crate::matrix::tile::RowTile;

const _: () = assert!(SIDE.is_multiple_of(STRIP), "planes are filled up to whole blocks");

/// A tile whose rows are stored as their blocks of [`STRIP`] columns with an entry.
///
/// Memory: a number for each entry, 6 bytes for each block, and 16 for each row in each of [`Panels`]. A block takes the same few instructions, and no branch, for any number of entries.
#[derive(Debug)]
pub(in crate::matrix) struct BlockTile<T> {
    panels: Panels,
    /// The begin of each part of a row, and the end of the last.
    begins: Vec<Begin>,
    /// The first column of each block, by [`STRIP`].
    blocks: Vec<u32>,
    /// Bit k is set where column k of the block has an entry.
    masks: Vec<u16>,
    /// The numbers of all entries in order; [`STRIP`] zeros follow, so that the most entries of a block can always be read.
    numbers: Numbers<T>,
}

/// The number of the first block of a part of a row, and of its first entry.
#[derive(Clone, Copy, Debug, Default)]
struct Begin {
    block: usize,
    entry: usize,
}

/// The blocks of a part of a row.
#[derive(Clone, Copy)]
struct Blocks<'a, T> {
    numbers: &'a [u32],
    masks: &'a [u16],
    /// The values from the first entry on, and beyond the last one.
    values: &'a [T],
}

/// Returns the number of blocks with entries of a tile.
pub(in crate::matrix) fn count_blocks(tile: &RowTile) -> usize {
    let of_row = |k| tile.row(k).chunk_by(|a, b| block_of(a.0) == block_of(b.0)).count();
    (0..tile.n_rows()).map(of_row).sum()
}

/// Returns the number of the block of a column.
fn block_of(column: u32) -> u32 {
    column >> STRIP.trailing_zeros()
}

impl<T: Scalar> BlockTile<T> {
    pub(in crate::matrix) fn new(tile: &RowTile, n: usize) -> Result<Self, MatrixError> {
        let panels = Panels::new(tile.n_rows(), n, count_blocks(tile), BLOCKS_OF_PART);
        Self::in_panels(tile, n, panels)
    }

    fn in_panels(tile: &RowTile, n: usize, panels: Panels) -> Result<Self, MatrixError> {
        let (size, n_blocks) = (tile.n_entries(), count_blocks(tile));
        let mut stored = Self {
            panels,
            begins: Vec::with_capacity(panels.all().len() * tile.n_rows() + 1),
            blocks: Vec::with_capacity(n_blocks),
            masks: Vec::with_capacity(n_blocks),
            numbers: Numbers::with_capacity(size + STRIP),
        };
        stored.begins.push(Begin::default());
        for (k, part) in panels.parts(tile) {
            let first_block = stored.blocks.len();
            for &entry in part {
                if !stored.numbers.push(tile.first_row() + k, entry, n)? {
                    continue;
                }
                let block = block_of(entry.0);
                if stored.blocks[first_block..].last() != Some(&block) {
                    stored.blocks.push(block);
                    stored.masks.push(0);
                }
                *stored.masks.last_mut().expect("the block was added") |= 1 << (entry.0 as usize % STRIP);
            }
            stored.begins.push(Begin {
                block: stored.blocks.len(),
                entry: stored.numbers.values.len(),
            });
        }
        stored.numbers.values.extend([T::from_f64(0.0); STRIP]);
        Ok(stored)
    }

    /// Returns the part of a row that is in a panel.
    #[inline(always)]
    fn part(&self, panel: usize, row: usize) -> Blocks<'_, T> {
        let place = self.panels.place(panel, row);
        let (begin, end) = (self.begins[place], self.begins[place + 1]);
        Blocks {
            numbers: &self.blocks[begin.block..end.block],
            masks: &self.masks[begin.block..end.block],
            values: &self.numbers.values[begin.entry..],
        }
    }

    /// Returns the parts of a row without the block of a column, and that block, if there is one.
    fn parts_beside(&self, row: usize, column: usize) -> (impl Iterator<Item = Blocks<'_, T>>, Blocks<'_, T>) {
        let panel = self.panels.of(column);
        let [before, beside, behind] = self.part(panel, row).split(column);
        let first = self.panels.all().take(panel).map(move |panel| self.part(panel, row));
        let last = self
            .panels
            .all()
            .skip(panel + 1)
            .map(move |panel| self.part(panel, row));
        (first.chain([before, behind]).chain(last), beside)
    }
}

impl<'a, T: Scalar> Blocks<'a, T> {
    /// Returns the number of the first block from a column on, and the number of entries before it.
    fn find(&self, column: usize) -> (usize, usize) {
        let block = self
            .numbers
            .partition_point(|&number| (number as usize) < column / STRIP);
        (block, count(&self.masks[..block]))
    }

    /// Returns (column, number of the entry) of all entries from a block on, with `first` entries before it.
    fn entries(self, (block, first): (usize, usize)) -> impl Iterator<Item = (usize, usize)> + 'a {
        let blocks = self.numbers[block..].iter().zip(&self.masks[block..]);
        let columns = blocks.flat_map(|(&number, &mask)| ones(mask.into()).map(move |k| number as usize * STRIP + k));
        columns.zip(first..)
    }

    /// Returns the blocks before the one of a column, that block, if there is one, and the blocks behind it.
    fn split(self, column: usize) -> [Self; 3] {
        let (block, _) = self.find(column);
        let part = |range: Range<usize>| Self {
            numbers: &self.numbers[range.clone()],
            masks: &self.masks[range.clone()],
            values: &self.values[count(&self.masks[..range.start])..],
        };
        let is_there = self
            .numbers
            .get(block)
            .is_some_and(|&number| number as usize == column / STRIP);
        let behind = block + usize::from(is_there);
        [part(0..block), part(block..behind), part(behind..self.numbers.len())]
    }

    /// Calls `add` with the number of each block and its row in full, with zeros in place of missing entries.
    #[inline(always)]
    fn for_each(self, expander: impl Expander<T>, mut add: impl FnMut(usize, Row)) {
        let mut rest = self.values;
        let ahead = PARTS_AHEAD * self.numbers.len();
        prefetch(self.numbers, ahead);
        prefetch(self.numbers, ahead + LINE_BYTE / size_of::<u32>());
        prefetch(self.masks, ahead);
        for (&number, &mask) in self.numbers.iter().zip(self.masks) {
            prefetch(rest, AHEAD_BYTE / size_of::<T>());
            let row = expander.expand(mask, rest.first_chunk().expect("as many behind the last"));
            rest = &rest[mask.count_ones() as usize..];
            add(number as usize, row);
        }
    }
}

/// Returns the number of set bits.
fn count(masks: &[u16]) -> usize {
    masks.iter().map(|mask| mask.count_ones() as usize).sum()
}

/// Returns the sum of the partial sums of a row.
#[inline(always)]
fn total_of_halves(lanes: &[f64; STRIP]) -> f64 {
    let [low, high] = std::array::from_fn(|h| total(&std::array::from_fn(|l| lanes[h * LANES + l])));
    low + high
}

/// The prefetch distance in bytes: the numbers that memory delivers in its latency.
const AHEAD_BYTE: usize = 6144;

/// The prefetch distance for blocks, in parts of rows.
const PARTS_AHEAD: usize = 6;

/// The least average number of blocks of a part of a row.
const BLOCKS_OF_PART: usize = 8;

/// Rows that are visited in turn in each panel.
const ROWS_AT_ONCE: usize = 16;

/// Registers' worth of columns in a block.
const HALVES: usize = STRIP / LANES;

impl<T: Scalar> Store for BlockTile<T> {
    fn for_each(&self, row: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64)) {
        for panel in self.panels.with(&columns) {
            let (blocks, begin) = (self.part(panel, row), self.begins[self.panels.place(panel, row)]);
            for (column, k) in blocks.entries(blocks.find(columns.start)) {
                if column >= columns.end {
                    break;
                }
                if column >= columns.start {
                    let (value, std_error) = self.numbers.at(begin.entry + k);
                    visit(column, value, std_error);
                }
            }
        }
    }

    fn dot_off_diagonal(&self, row: usize, diagonal: usize, x: &Block, sum: &mut [f64]) -> f64 {
        match sum.len() {
            1 => dot_of::<T, 1>(self, row, diagonal, x.values(), sum),
            2 => dot_of::<T, 2>(self, row, diagonal, x.values(), sum),
            3 => dot_of::<T, 3>(self, row, diagonal, x.values(), sum),
            4 => dot_of::<T, 4>(self, row, diagonal, x.values(), sum),
            _ => {
                let mut on_diagonal = 0.0;
                for (c, channel_sum) in sum.iter_mut().enumerate() {
                    let mut lanes = [0.0; STRIP];
                    let (others, beside) = self.parts_beside(row, diagonal);
                    for part in others.chain([beside]) {
                        for (column, k) in part.entries((0, 0)) {
                            let value = part.values[k].to_f64();
                            if column == diagonal {
                                on_diagonal = value;
                            } else {
                                let lane = &mut lanes[column % STRIP];
                                *lane = value.mul_add(x.row(column)[c], *lane);
                            }
                        }
                    }
                    *channel_sum += total_of_halves(&lanes);
                }
                on_diagonal
            }
        }
    }

    fn apply(&self, row: usize, planes: &Planes, y: &mut [f64]) {
        let n_channels = planes.n_channels();
        for first in (0..n_channels).step_by(CHANNELS_AT_ONCE) {
            match n_channels - first {
                1 => dispatch(Rows::<T, 1>(self, row, planes, first, y)),
                2 => dispatch(Rows::<T, 2>(self, row, planes, first, y)),
                _ => dispatch(Rows::<T, CHANNELS_AT_ONCE>(self, row, planes, first, y)),
            }
        }
    }

    fn n_stored(&self) -> usize {
        self.numbers.values.len() - STRIP
    }

    fn sizes(&self) -> Sizes {
        let places = size_of_val(self.blocks.as_slice()) + size_of_val(self.masks.as_slice());
        self.numbers.sizes_beside(size_of_val(self.begins.as_slice()) + places)
    }
}

/// The loop of [`Store::apply`] for C channels: the tile, its first row, x, the first of the channels, and y.
struct Rows<'a, T, const C: usize>(&'a BlockTile<T>, usize, &'a Planes, usize, &'a mut [f64]);

impl<T: Scalar, const C: usize> InnerLoop for Rows<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        #[cfg(target_arch = "x86_64")]
        if N == 1
            && let Some(with) = pulp::x86::V4::try_new()
        {
            return self.by_rows::<S, N>(simd, WithV4::new(with));
        }
        self.by_rows::<S, N>(simd, OneByOne);
    }
}

impl<T: Scalar, const C: usize> Rows<'_, T, C> {
    /// Every sum is kept in two times [`LANES`] partial sums, over the columns 0, 1, 2, ... mod 16, in ascending order of the columns.
    #[inline(always)]
    fn by_rows<S: Simd, const N: usize>(self, simd: S, expander: impl Expander<T>) {
        let Self(tile, first_row, planes, first, y) = self;
        let x: [&[[f64; STRIP]]; C] = std::array::from_fn(|c| planes.padded(first + c).as_chunks().0);
        let n_channels = planes.n_channels();
        for (group, y_rows) in y.chunks_mut(ROWS_AT_ONCE * n_channels).enumerate() {
            let rows = first_row + group * ROWS_AT_ONCE..;
            let mut partial = [[[[0.0; LANES]; HALVES]; C]; ROWS_AT_ONCE];
            let partial = &mut partial[..y_rows.len() / n_channels];
            for panel in tile.panels.all() {
                for (row, partial) in rows.clone().zip(&mut *partial) {
                    let mut sums = [[Wide::<S, N>::zero(simd); HALVES]; C];
                    for c in 0..C {
                        for h in 0..HALVES {
                            sums[c][h] = Wide::load(&partial[c][h]);
                        }
                    }
                    tile.part(panel, row).for_each(expander, |number, a| {
                        let a = a.map(|half| Wide::load(&half));
                        for c in 0..C {
                            let x_k = x[c][number].as_chunks::<LANES>().0;
                            for h in 0..HALVES {
                                sums[c][h] = sums[c][h].plus_product(simd, a[h], Wide::load(&x_k[h]));
                            }
                        }
                    });
                    for c in 0..C {
                        for h in 0..HALVES {
                            sums[c][h].store(&mut partial[c][h]);
                        }
                    }
                }
            }
            for (y_i, partial) in y_rows.chunks_exact_mut(n_channels).zip(partial) {
                for c in 0..C {
                    y_i[first + c] = total_of_halves(partial[c].as_flattened().try_into().expect("halves of a strip"));
                }
            }
        }
    }
}

/// Adds the products of a row without its entry on the diagonal, and returns that entry.
fn dot_of<T: Scalar, const C: usize>(
    tile: &BlockTile<T>,
    row: usize,
    diagonal: usize,
    x: &[f64],
    sum: &mut [f64],
) -> f64 {
    let mut on_diagonal = 0.0;
    dispatch(Sweep::<T, C>(tile, row, diagonal, x, sum, &mut on_diagonal));
    on_diagonal
}

/// The loop of [`dot_of`]: the tile, the row, the column of the diagonal, x (row-major, C channels), the sums, and the entry on the diagonal.
struct Sweep<'a, T, const C: usize>(&'a BlockTile<T>, usize, usize, &'a [f64], &'a mut [f64], &'a mut f64);

impl<T: Scalar, const C: usize> InnerLoop for Sweep<'_, T, C> {
    #[inline(always)]
    fn run<S: Simd, const N: usize>(self, simd: S) {
        #[cfg(target_arch = "x86_64")]
        if N == 1
            && let Some(with) = pulp::x86::V4::try_new()
        {
            return self.add::<S, N>(simd, WithV4::new(with));
        }
        self.add::<S, N>(simd, OneByOne);
    }
}

impl<T: Scalar, const C: usize> Sweep<'_, T, C> {
    /// Every sum is kept in as many partial sums as in [`Rows`], each channel as if it were alone; the rest of the diagonal's block comes last.
    ///
    /// Registers hold the channels of one column beside those of the next, as x does.
    #[inline(always)]
    fn add<S: Simd, const N: usize>(self, simd: S, expander: impl Expander<T>) {
        let Self(tile, row, diagonal, x, sum, on_diagonal) = self;
        let rows = x.as_chunks::<C>().0;
        let (whole, rest) = rows.as_chunks::<STRIP>();
        let mut last = [[0.0; C]; STRIP];
        last[..rest.len()].copy_from_slice(rest);
        let (others, beside) = tile.parts_beside(row, diagonal);
        let mut sums = [[Wide::<S, N>::zero(simd); C]; HALVES];
        for part in others {
            part.for_each(expander, |number, a| {
                let x_k = whole.get(number).unwrap_or(&last).as_flattened().as_chunks::<LANES>().0;
                for h in 0..HALVES {
                    for c in 0..C {
                        let of_channels = std::array::from_fn(|l| a[h][(c * LANES + l) / C]);
                        sums[h][c] = sums[h][c].plus_product(simd, Wide::of(&of_channels), Wide::of(&x_k[h * C + c]));
                    }
                }
            });
        }
        let mut stored = [[[0.0; LANES]; C]; HALVES];
        for h in 0..HALVES {
            for c in 0..C {
                sums[h][c].store(&mut stored[h][c]);
            }
        }
        let lanes = stored.as_flattened_mut().as_flattened_mut().as_chunks_mut::<C>().0;
        for (column, k) in beside.entries((0, 0)) {
            let a = beside.values[k].to_f64();
            if column == diagonal {
                *on_diagonal = a;
                continue;
            }
            for (lane, x) in lanes[column % STRIP].iter_mut().zip(&rows[column]) {
                *lane = a.mul_add(*x, *lane);
            }
        }
        for (c, sum) in sum.iter_mut().enumerate() {
            *sum += total_of_halves(&std::array::from_fn(|l| lanes[l][c]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::kernel::lanes::tests::{N_SETS, bits, numbers, run_on};
    use crate::matrix::tile::{Entry, RowTally};

    /// Columns: no whole number of blocks.
    const N: usize = 203;

    /// Rows that are full, empty, in runs, scattered, or have an entry at the end alone.
    fn has(i: usize, j: usize) -> bool {
        match i % 5 {
            0 => true,
            1 => false,
            2 => j / 20 % 3 == i / 5 % 3,
            3 => (31 * i + 17 * j).is_multiple_of(7),
            _ => j == N - 1,
        }
    }

    fn entries(i: usize) -> Vec<Entry> {
        let values = numbers(N, 13 * i + 1);
        let columns = (0..).zip(values).filter(|(j, _): &(u32, f64)| has(i, *j as usize));
        columns
            .map(|(j, value)| (j, value + 0.1, if j.is_multiple_of(3) { 0.25 } else { 0.0 }))
            .collect()
    }

    fn tile<T: Scalar>(first_row: usize, n_rows: usize, width: usize) -> BlockTile<T> {
        let mut tile = RowTile::new(first_row);
        for i in first_row..first_row + n_rows {
            tile.push_row(&entries(i), RowTally::default());
        }
        BlockTile::in_panels(&tile, N, Panels::of_width(n_rows, N, width)).expect("sound rows")
    }

    fn by_hand(entries: &[(usize, f64)], x: impl Fn(usize) -> f64) -> f64 {
        let mut lanes = [0.0; STRIP];
        for (j, a) in entries {
            let lane: &mut f64 = &mut lanes[j % STRIP];
            *lane = a.mul_add(x(*j), *lane);
        }
        total_of_halves(&lanes)
    }

    fn check_sums<T: Scalar>(width: usize) {
        let n_rows = 35;
        let tile = tile::<T>(0, n_rows, width);
        let row = |i: usize| -> Vec<(usize, f64)> {
            let rounded = |(j, value, _): Entry| (j as usize, T::from_f64(value).to_f64());
            entries(i).into_iter().map(rounded).collect()
        };
        for n_channels in 1..=5 {
            let x = Block::from_values(numbers(N * n_channels, 2), n_channels);
            let mut y = vec![f64::NAN; (n_rows - 1) * n_channels];
            tile.apply(1, &Planes::of(&x), &mut y);
            for i in 1..n_rows {
                let sums = (0..n_channels).map(|c| by_hand(&row(i), |j| x.row(j)[c]));
                let own = (i - 1) * n_channels..i * n_channels;
                assert_eq!(bits(&y[own]), bits(&sums.collect::<Vec<_>>()), "{i} {n_channels}");
            }
            for (i, diagonal) in (0..n_rows).flat_map(|i| [0, 37, 38, 100, N - 1].map(|j| (i, j))) {
                let (mut own, mut last) = (row(i), Vec::new());
                own.retain(|(j, a)| {
                    let is_beside = j / STRIP == diagonal / STRIP;
                    if is_beside && *j != diagonal {
                        last.push((*j, *a));
                    }
                    !is_beside
                });
                own.extend(last);
                let mut sum = vec![0.5; n_channels];
                let on_diagonal = tile.dot_off_diagonal(i, diagonal, &x, &mut sum);
                let expected = row(i).iter().find(|(j, _)| *j == diagonal).map_or(0.0, |(_, a)| *a);
                assert_eq!(on_diagonal.to_bits(), expected.to_bits(), "{i} {diagonal}");
                let sums = (0..n_channels).map(|c| 0.5 + by_hand(&own, |j| x.row(j)[c]));
                assert_eq!(
                    bits(&sum),
                    bits(&sums.collect::<Vec<_>>()),
                    "{i} {diagonal} {n_channels}"
                );
                if n_channels == 3 {
                    for set in 0..N_SETS {
                        let (mut of_set, mut found) = ([0.5; 3], 0.0);
                        run_on(
                            set,
                            Sweep::<T, 3>(&tile, i, diagonal, x.values(), &mut of_set, &mut found),
                        );
                        assert_eq!(
                            (bits(&of_set), found.to_bits()),
                            (bits(&sum), expected.to_bits()),
                            "{set}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn rows_are_summed_in_the_order_that_is_promised() {
        for width in [N, 64] {
            check_sums::<f64>(width);
            check_sums::<f32>(width);
        }
    }

    #[test]
    fn entries_come_back_whatever_columns_are_asked_for() {
        for width in [N, 64] {
            check_columns(&tile::<f64>(3, 9, width));
        }
    }

    fn check_columns(tile: &BlockTile<f64>) {
        for (row, columns) in (0..9).flat_map(|row| [0..N, 5..6, 17..100, 48..64, 190..N, 7..7].map(|c| (row, c))) {
            let mut found = Vec::new();
            tile.for_each(row, columns.clone(), &mut |j, value, std_error| {
                found.push((u32::try_from(j).expect("a column"), value, std_error));
            });
            let mut expected = entries(3 + row);
            expected.retain(|entry| columns.contains(&(entry.0 as usize)));
            assert_eq!(found, expected, "{row} {columns:?}");
        }
        let n_entries = (3..12).map(|i| entries(i).len()).sum();
        assert_eq!((tile.n_stored(), tile.sizes().n_nonzero), (n_entries, n_entries));
    }

    #[test]
    fn what_is_too_small_for_the_precision_takes_no_block() {
        let mut tile = RowTile::new(0);
        tile.push_row(
            &[(3, 1e-60, 0.0), (20, 0.5, 0.0), (40, 0.0, 0.125)],
            RowTally::default(),
        );
        let stored = BlockTile::<f32>::new(&tile, 48).expect("a sound row");
        assert_eq!(stored.blocks, [1, 2]);
        assert_eq!((stored.n_stored(), stored.sizes().n_nonzero), (2, 1));
        let mut found = Vec::new();
        stored.for_each(0, 0..48, &mut |j, value, std_error| found.push((j, value, std_error)));
        assert_eq!(found, [(20, 0.5, 0.0), (40, 0.0, 0.125)]);
    }
}
