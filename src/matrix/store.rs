//! How a tile of rows is kept: the interface of the layouts, the precision of the numbers, and the sums over a row.

use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;

use super::blocks::{BlockTile, count_blocks};
use super::dense::DenseTile;
use super::expand::Expand;
use super::lanes::{LANES, Lanes};
use super::operator::Block;
use super::planes::Planes;
use super::sparse::SparseTile;
use super::tile::is_zero;
use super::{Layout, MatrixError, Precision, RowTile, StorageChoice};

/// The share of non-zero entries from which a tile is stored in full, rows as well as squares. At a half, entries alone take 0.53 of the memory and 0.6 to 0.7 of the time of a pass where they lie in runs,
/// 0.8 to 1.0 where they do not (three channels: 0.75 to 0.9 and 1.1); in a cache rows take 1.0 to 1.3 times as long, and sweeps by rows of squares take 2.0 to 2.3 times as long
/// (f32, AVX-512; `cargo bench --bench matrix -- f32 1/2`, with 1536 for a cache).
pub(super) const DENSE_FROM: f64 = 0.5;

/// Entries in each block of sixteen columns that has any, on average, from which rows are stored in blocks. With four a pass takes 1.15 of the time of one over lists where the matrix is in memory and 1.4 in a cache, three
/// channels 1.45 and 1.3; with five 0.7 to 0.85 and 1.0, and 1.0 and 1.0 (f32, AVX-512; `cargo bench --bench matrix -- "sparse f32 rows" 1/4`, with 1536 for a cache).
const BLOCKS_FROM: usize = 6;

/// A number as it is stored: f32 or f64.
pub(super) trait Scalar: Expand + Copy + Send + Sync + Debug + 'static {
    /// Rounds to the nearest number that can be stored.
    fn from_f64(value: f64) -> Self;
    /// Returns the number; exact.
    fn to_f64(self) -> f64;
    /// Calls `then` with the numbers as f64: those that are f64 where they are, since a copy of them would go through memory.
    fn with_widened<R>(numbers: &[Self; LANES], then: impl FnOnce(&Lanes) -> R) -> R;
    /// Appends numbers as bytes of this machine.
    fn push_bytes(numbers: &[Self], bytes: &mut Vec<u8>);
    /// Returns the numbers that [`push_bytes`](Self::push_bytes) wrote.
    fn from_bytes(bytes: &[u8]) -> impl Iterator<Item = Self>;
}

impl Scalar for f64 {
    #[inline]
    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline]
    fn to_f64(self) -> f64 {
        self
    }
    #[expect(
        clippy::inline_always,
        reason = "what is not inlined is not compiled for the instruction set"
    )]
    #[inline(always)]
    fn with_widened<R>(numbers: &[Self; LANES], then: impl FnOnce(&Lanes) -> R) -> R {
        then(numbers)
    }
    fn push_bytes(numbers: &[Self], bytes: &mut Vec<u8>) {
        bytes.reserve(size_of_val(numbers));
        for number in numbers {
            bytes.extend_from_slice(&number.to_ne_bytes());
        }
    }
    fn from_bytes(bytes: &[u8]) -> impl Iterator<Item = Self> {
        let (numbers, _) = bytes.as_chunks::<8>();
        numbers.iter().map(|&number| Self::from_ne_bytes(number))
    }
}

impl Scalar for f32 {
    #[expect(clippy::cast_possible_truncation, reason = "rounding to f32 is what is asked for")]
    #[inline]
    fn from_f64(value: f64) -> Self {
        value as Self
    }
    #[inline]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
    #[expect(
        clippy::inline_always,
        reason = "what is not inlined is not compiled for the instruction set"
    )]
    #[inline(always)]
    fn with_widened<R>(numbers: &[Self; LANES], then: impl FnOnce(&Lanes) -> R) -> R {
        then(&numbers.map(f64::from))
    }
    fn push_bytes(numbers: &[Self], bytes: &mut Vec<u8>) {
        bytes.reserve(size_of_val(numbers));
        for number in numbers {
            bytes.extend_from_slice(&number.to_ne_bytes());
        }
    }
    fn from_bytes(bytes: &[u8]) -> impl Iterator<Item = Self> {
        let (numbers, _) = bytes.as_chunks::<4>();
        numbers.iter().map(|&number| Self::from_ne_bytes(number))
    }
}

/// The numbers of a few consecutive rows, in some layout. Rows are counted from the tile's first.
pub(super) trait Store: Debug + Send + Sync {
    /// Calls `visit(column, number, standard error)` in ascending order for all of `columns` where one of the two is not zero.
    fn for_each(&self, row: usize, columns: Range<usize>, visit: &mut dyn FnMut(usize, f64, f64));

    /// Adds Σ_{j ≠ `diagonal`} a_j x_j over the row to `sum` and returns a_`diagonal`.
    fn dot_off_diagonal(&self, row: usize, diagonal: usize, x: &Block, sum: &mut [f64]) -> f64;

    /// Sets `y` (row-major, one entry per channel) to the products of as many rows with `x`, from the row `row` on, which is row `i`
    /// of the matrix; `planes` are `x` again.
    fn apply(&self, row: usize, i: usize, x: &Block, planes: &Planes, y: &mut [f64]);

    /// Adds `factor` a_j to `sum[j]` over the row, and returns how many numbers of the row are stored.
    fn add_row(&self, row: usize, factor: f64, sum: &mut [f64]) -> usize {
        let mut n_stored = 0;
        self.for_each(row, 0..sum.len(), &mut |j, value, _| {
            sum[j] += factor * value;
            n_stored += 1;
        });
        n_stored
    }

    /// Returns how many numbers are stored, zeros of a dense tile included.
    fn n_stored(&self) -> usize;

    /// Returns how many numbers are not zero.
    fn n_nonzero(&self) -> usize;

    /// Returns the memory in use.
    fn stored_byte(&self) -> usize;

    /// Returns the part of it that [`apply`](Self::apply) reads.
    fn pass_byte(&self) -> usize;
}

/// Stores a tile of an n by n matrix as `choice` says.
pub(super) fn store(tile: &RowTile, n: usize, choice: StorageChoice<'_>) -> Result<Arc<dyn Store>, MatrixError> {
    match choice.precision {
        Precision::F64 => store_as::<f64>(tile, n, choice.layout),
        Precision::F32 => store_as::<f32>(tile, n, choice.layout),
    }
}

fn store_as<T: Scalar>(tile: &RowTile, n: usize, layout: Layout) -> Result<Arc<dyn Store>, MatrixError> {
    let dense = match layout {
        Layout::Dense => true,
        Layout::Sparse => false,
        Layout::Auto => tile.n_entries() as f64 >= DENSE_FROM * tile.n_rows() as f64 * n as f64,
    };
    Ok(if dense {
        Arc::new(DenseTile::<T>::new(tile, n)?)
    } else if tile.n_entries() >= BLOCKS_FROM * count_blocks(tile) {
        Arc::new(BlockTile::<T>::new(tile, n)?)
    } else {
        Arc::new(SparseTile::<T>::new(tile, n)?)
    })
}

/// Rounds an entry of row `row` to what is stored, and refuses what is not a usable number there.
pub(super) fn rounded<T: Scalar>(
    row: usize,
    (column, value, std_error): super::Entry,
    n: usize,
) -> Result<(T, f32), MatrixError> {
    if column as usize >= n {
        return Err(MatrixError::Column { row, column, n_rows: n });
    }
    let (value, std_error) = (T::from_f64(value), f32::from_f64(std_error));
    if value.to_f64().is_finite() && std_error.is_finite() && std_error >= 0.0 {
        Ok((value, std_error))
    } else {
        Err(MatrixError::Value { row, column })
    }
}

/// The numbers of listed entries and their standard errors, entry by entry.
#[derive(Debug)]
pub(super) struct Numbers<T> {
    pub(super) values: Vec<T>,
    /// As `values`, up to the last that is not zero.
    std_errors: Vec<f32>,
    pub(super) n_nonzero: usize,
}

impl<T: Scalar> Numbers<T> {
    /// Returns room for so many.
    pub(super) fn with_capacity(n_values: usize) -> Self {
        Self {
            values: Vec::with_capacity(n_values),
            std_errors: Vec::new(),
            n_nonzero: 0,
        }
    }

    /// Adds an entry of a row of an n by n matrix; tells whether anything is left of it in the precision.
    pub(super) fn push(&mut self, row: usize, entry: super::Entry, n: usize) -> Result<bool, MatrixError> {
        let (value, std_error) = rounded::<T>(row, entry, n)?;
        let (has_value, has_error) = (!is_zero(value.to_f64()), std_error > 0.0);
        if has_error {
            self.std_errors.resize(self.values.len(), 0.0);
            self.std_errors.push(std_error);
        }
        if has_value || has_error {
            self.values.push(value);
            self.n_nonzero += usize::from(has_value);
        }
        Ok(has_value || has_error)
    }

    /// Returns a number and its standard error.
    pub(super) fn at(&self, place: usize) -> (f64, f64) {
        let std_error = self.std_errors.get(place).map_or(0.0, |&error| f64::from(error));
        (self.values[place].to_f64(), std_error)
    }

    /// Returns the memory of the values.
    pub(super) fn value_byte(&self) -> usize {
        size_of_val(self.values.as_slice())
    }

    /// Returns the memory of the standard errors.
    pub(super) fn error_byte(&self) -> usize {
        size_of_val(self.std_errors.as_slice())
    }
}

/// Adds `factor` times Σ_k `values[k]` x[k] to `sum`, where x[k] is the row of `x` (row-major, one entry per channel) that `row_of(k)` names.
///
/// The order of the additions depends on the number of values alone: four sums over k = 0, 1, 2, 3 mod 4, then their sum.
/// A channel's sum is the same bytes whatever the number of channels.
pub(super) fn add_dot<T: Scalar>(
    values: &[T],
    row_of: impl Fn(usize) -> usize,
    factor: f64,
    x: &[f64],
    sum: &mut [f64],
) {
    match sum.len() {
        1 => add_dot_fixed::<T, 1>(values, row_of, factor, x, sum),
        3 => add_dot_fixed::<T, 3>(values, row_of, factor, x, sum),
        n_channels => {
            for c in 0..n_channels {
                let place_of = |k| row_of(k) * n_channels + c;
                add_dot_fixed::<T, 1>(values, place_of, factor, x, &mut sum[c..=c]);
            }
        }
    }
}

fn add_dot_fixed<T: Scalar, const C: usize>(
    values: &[T],
    row_of: impl Fn(usize) -> usize,
    factor: f64,
    x: &[f64],
    sum: &mut [f64],
) {
    let (rows, _) = x.as_chunks::<C>();
    let (fours, rest) = values.as_chunks::<4>();
    let mut lanes = [[0.0; C]; 4];
    let add = |lane: &mut [f64; C], value: T, k: usize| {
        let row = &rows[row_of(k)];
        for c in 0..C {
            lane[c] += value.to_f64() * row[c];
        }
    };
    for (block, four) in fours.iter().enumerate() {
        for l in 0..4 {
            add(&mut lanes[l], four[l], 4 * block + l);
        }
    }
    for (l, &value) in rest.iter().enumerate() {
        add(&mut lanes[l], value, 4 * fours.len() + l);
    }
    for c in 0..C {
        sum[c] += factor * ((lanes[0][c] + lanes[1][c]) + (lanes[2][c] + lanes[3][c]));
    }
}
