//! The numbers of the entries of a tile put where they belong, with zeros between them.

#![cfg_attr(
    target_arch = "x86_64",
    expect(
        clippy::inline_always,
        reason = "what is not inlined is not compiled for the instruction set"
    )
)]

use pulp::Arch;
#[cfg(target_arch = "x86_64")]
use pulp::{NullaryFnOnce, cast, x86::V4};

use super::aligned::Aligned;
#[cfg(target_arch = "x86_64")]
use super::places::below;
use super::places::{Places, ones};
use super::square::SIDE;
use super::store::Scalar;

/// Numbers that are put into a row where bits say, in the order of the bits.
pub(super) trait Expand: Sized {
    /// Sets a row to `values` from the number `first` on at the places of the bits that are set, and to 0 elsewhere.
    #[cfg(target_arch = "x86_64")]
    fn expand_row(simd: V4, columns: u64, values: &[Self], first: usize, row: &mut [Self; SIDE]);
}

/// The numbers of a whole tile, row by row.
pub(super) struct Written<T>(Aligned<T>);

impl<T: Scalar> Written<T> {
    /// Returns room for a tile.
    pub(super) fn new() -> Self {
        Self(Aligned::filled(SIDE * SIDE, T::from_f64(0.0)))
    }

    /// Returns the numbers.
    pub(super) fn numbers(&self) -> &[T] {
        &self.0
    }

    /// Returns the rows.
    fn rows_mut(&mut self) -> &mut [[T; SIDE]] {
        self.0.as_chunks_mut().0
    }
}

/// Sets `tile` to `values`, of which there is one for each place in order, and to 0 elsewhere.
pub(super) fn expand<T: Scalar>(places: &Places, values: &[T], tile: &mut Written<T>) {
    match Arch::new() {
        // A single instruction puts a register's numbers in their places.
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => simd.vectorize(WithV4 {
            simd,
            places,
            values,
            tile,
        }),
        _ => one_by_one(places, values, tile),
    }
}

/// [`expand`] without instructions for it.
fn one_by_one<T: Scalar>(places: &Places, values: &[T], tile: &mut Written<T>) {
    let rows = tile.rows_mut();
    rows.fill([T::from_f64(0.0); SIDE]);
    for (row, in_row) in places.rows() {
        for (column, value) in ones(in_row.columns).zip(&values[in_row.first..]) {
            rows[row][column] = *value;
        }
    }
}

/// [`expand`] with AVX-512.
#[cfg(target_arch = "x86_64")]
struct WithV4<'a, T> {
    simd: V4,
    places: &'a Places,
    values: &'a [T],
    tile: &'a mut Written<T>,
}

#[cfg(target_arch = "x86_64")]
impl<T: Scalar> NullaryFnOnce for WithV4<'_, T> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self {
            simd,
            places,
            values,
            tile,
        } = self;
        let rows = tile.rows_mut();
        let mut n_done = 0;
        for (row, in_row) in places.rows() {
            // Rows without entries come in between.
            for empty in &mut rows[n_done..row] {
                *empty = [T::from_f64(0.0); SIDE];
            }
            T::expand_row(simd, in_row.columns, values, in_row.first, &mut rows[row]);
            n_done = row + 1;
        }
        for empty in &mut rows[n_done..] {
            *empty = [T::from_f64(0.0); SIDE];
        }
    }
}

/// Returns the N values from the number `at` on, and anything in place of those that are missing.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn from<T: Copy + Default, const N: usize>(values: &[T], at: usize) -> [T; N] {
    if let Some(found) = values.get(at..at + N) {
        found.try_into().expect("N values")
    } else {
        let mut filled = [T::default(); N];
        let rest = &values[at..];
        filled[..rest.len()].copy_from_slice(rest);
        filled
    }
}

impl Expand for f32 {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the lowest bits are what is meant")]
    fn expand_row(simd: V4, columns: u64, values: &[Self], first: usize, row: &mut [Self; SIDE]) {
        for (k, part) in row.as_chunks_mut::<16>().0.iter_mut().enumerate() {
            let at = first + below(columns, 16 * k);
            let bits = (columns >> (16 * k)) as u16;
            *part = cast(
                simd.avx512f
                    ._mm512_maskz_expand_ps(bits, cast(from::<_, 16>(values, at))),
            );
        }
    }
}

impl Expand for f64 {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the lowest bits are what is meant")]
    fn expand_row(simd: V4, columns: u64, values: &[Self], first: usize, row: &mut [Self; SIDE]) {
        for (k, part) in row.as_chunks_mut::<8>().0.iter_mut().enumerate() {
            let at = first + below(columns, 8 * k);
            let bits = (columns >> (8 * k)) as u8;
            *part = cast(
                simd.avx512f
                    ._mm512_maskz_expand_pd(bits, cast(from::<_, 8>(values, at))),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::tests::{bits, numbers};
    use super::*;

    #[test]
    fn every_instruction_set_puts_numbers_in_the_same_places() {
        for one_in in [1, 2, 3, 19, 500] {
            let everywhere = (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column)));
            let listed: Vec<_> = everywhere
                .filter(|(row, column)| (31 * row + 17 * column) % one_in == 0)
                .collect();
            let places = Places::new(listed.iter().copied());
            let values = numbers(listed.len(), 1);
            let mut expected = vec![0.0; SIDE * SIDE];
            for ((row, column), value) in listed.iter().zip(&values) {
                expected[row * SIDE + column] = *value;
            }
            let mut tile = Written::new();
            tile.rows_mut().fill([f64::NAN; SIDE]);
            expand(&places, &values, &mut tile);
            assert_eq!(bits(tile.numbers()), bits(&expected));
            tile.rows_mut().fill([f64::NAN; SIDE]);
            one_by_one(&places, &values, &mut tile);
            assert_eq!(bits(tile.numbers()), bits(&expected));
            let narrow: Vec<f32> = values.iter().map(|&value| f32::from_f64(value)).collect();
            let mut narrow_tile = Written::new();
            narrow_tile.rows_mut().fill([f32::NAN; SIDE]);
            expand(&places, &narrow, &mut narrow_tile);
            assert!(
                narrow_tile
                    .numbers()
                    .iter()
                    .zip(&expected)
                    .all(|(a, b)| a.to_bits() == f32::from_f64(*b).to_bits())
            );
        }
    }
}
