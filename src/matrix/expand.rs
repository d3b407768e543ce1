//! Numbers put where bits say, with zeros between them: the row of a strip from its entries.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

#[cfg(target_arch = "x86_64")]
use std::{arch::x86_64::__m512, hint::black_box};

#[cfg(target_arch = "x86_64")]
use pulp::{cast, x86::V4};

use super::lanes::{LANES, Lanes};
use super::places::{STRIP, ones};
use super::store::Scalar;

/// The row of a strip.
pub(super) type Row = [Lanes; STRIP / LANES];

/// Puts the first of `values` at the bits of `mask` that are set, in their order, and 0 elsewhere.
pub(super) trait Expander<T>: Copy {
    fn expand(self, mask: u16, values: &[T; STRIP]) -> Row;
}

/// Without instructions for it.
#[derive(Clone, Copy)]
pub(super) struct OneByOne;

impl<T: Scalar> Expander<T> for OneByOne {
    #[inline(always)]
    fn expand(self, mask: u16, values: &[T; STRIP]) -> Row {
        let mut row = [[0.0; LANES]; STRIP / LANES];
        for (lane, value) in ones(mask.into()).zip(values) {
            row.as_flattened_mut()[lane] = value.to_f64();
        }
        row
    }
}

/// With AVX-512, which has an instruction for it.
///
/// Numbers are put into a register of zeros that the compiler does not know to be zeros. If it did, it would take the form of the instruction that makes zeros itself, which on Zen 4
/// waits for what its register held before, most often the row before: 17 cycles a row in place of 7.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(super) struct WithV4 {
    simd: V4,
    zeros: __m512,
}

#[cfg(target_arch = "x86_64")]
impl WithV4 {
    #[inline(always)]
    pub(super) fn new(simd: V4) -> Self {
        let zeros = cast(black_box([0.0_f32; STRIP]));
        Self { simd, zeros }
    }
}

#[cfg(target_arch = "x86_64")]
impl<T: Scalar> Expander<T> for WithV4 {
    #[inline(always)]
    fn expand(self, mask: u16, values: &[T; STRIP]) -> Row {
        T::expand(self, mask, values)
    }
}

/// What [`WithV4`] does.
pub(super) trait Expand: Sized {
    #[cfg(target_arch = "x86_64")]
    fn expand(with: WithV4, mask: u16, values: &[Self; STRIP]) -> Row;
}

impl Expand for f32 {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn expand(with: WithV4, mask: u16, values: &[Self; STRIP]) -> Row {
        let row = with.simd.avx512f._mm512_mask_expand_ps(with.zeros, mask, cast(*values));
        let halves: [[Self; LANES]; 2] = cast(row);
        halves.map(|half| cast(with.simd.avx512f._mm512_cvtps_pd(cast(half))))
    }
}

impl Expand for f64 {
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn expand(with: WithV4, mask: u16, values: &[Self; STRIP]) -> Row {
        let [low, high] = mask.to_le_bytes();
        let half = |bits: u8, first: usize| {
            let from: &[Self; LANES] = values[first..].first_chunk().expect("at most eight are before these");
            cast(
                with.simd
                    .avx512f
                    ._mm512_mask_expand_pd(cast(with.zeros), bits, cast(*from)),
            )
        };
        [half(low, 0), half(high, low.count_ones() as usize)]
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::tests::{bits, numbers};
    use super::*;

    #[test]
    fn every_instruction_set_puts_numbers_in_the_same_places() {
        let values: [f64; STRIP] = *numbers(STRIP, 1).first_chunk().expect("as many");
        let narrow = values.map(f32::from_f64);
        for mask in 0..=u16::MAX {
            let (mut expected, mut expected_narrow) = ([0.0; STRIP], [0.0; STRIP]);
            for (k, lane) in ones(mask.into()).enumerate() {
                (expected[lane], expected_narrow[lane]) = (values[k], narrow[k].to_f64());
            }
            assert_eq!(bits(OneByOne.expand(mask, &values).as_flattened()), bits(&expected));
            assert_eq!(
                bits(OneByOne.expand(mask, &narrow).as_flattened()),
                bits(&expected_narrow)
            );
            #[cfg(target_arch = "x86_64")]
            if let Some(with) = V4::try_new() {
                assert_eq!(
                    bits(WithV4::new(with).expand(mask, &values).as_flattened()),
                    bits(&expected)
                );
                assert_eq!(
                    bits(WithV4::new(with).expand(mask, &narrow).as_flattened()),
                    bits(&expected_narrow)
                );
            }
        }
    }
}
