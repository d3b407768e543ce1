//! Sizes of tiles, strips and partial sums, which layouts and inner loops share.

use std::ops::Range;

/// The number of rows and of columns of a tile.
///
/// It takes 32 KiB in f64, so that a tile and the vectors that it meets stay in the second-level cache, and the rows of a strip are the bits of a word.
pub(in crate::matrix) const SIDE: usize = 64;

/// Partial sums of each sum: one register of AVX-512, two of AVX2, four of SSE2.
pub(in crate::matrix) const LANES: usize = 8;

/// The partial sums of one sum.
pub(in crate::matrix) type Lanes = [f64; LANES];

/// Channels that a loop over dense numbers takes at once: as many as the registers of AVX-512 hold sums for.
pub(in crate::matrix) const CHANNELS_AT_ONCE: usize = 3;

/// Columns of a strip: the cost of finding its rows is shared by two registers' worth of entries.
pub(in crate::matrix) const STRIP: usize = 2 * LANES;

/// Channels that loops over listed entries take at once: with four an entry takes as many instructions as with one.
pub(in crate::matrix) const FOUR: usize = 4;

/// Returns the numbers of the bits that are set, in ascending order.
#[expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]
#[inline(always)]
pub(in crate::matrix) fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let next = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        next
    })
}

/// Returns the row ranges that make one row of tiles each.
pub(in crate::matrix) fn block_rows(n: usize) -> impl ExactSizeIterator<Item = Range<usize>> {
    (0..n.div_ceil(SIDE)).map(move |k| k * SIDE..n.min((k + 1) * SIDE))
}

/// Calls `visit(first, part of the block, block)` for the blocks of [`SIDE`] places that `range` meets.
pub(in crate::matrix) fn for_each_block(range: Range<usize>, mut visit: impl FnMut(usize, Range<usize>, usize)) {
    if range.is_empty() {
        return;
    }
    for block in range.start / SIDE..=(range.end - 1) / SIDE {
        let first = block * SIDE;
        let part = range.start.max(first) - first..range.end.min(first + SIDE) - first;
        visit(first, part, block);
    }
}
