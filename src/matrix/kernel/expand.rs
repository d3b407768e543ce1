//! Numbers put at the set bits of a mask, with zeros between them: the row of a strip from its entries.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

#[cfg(target_arch = "x86_64")]
use super::scalar::WithV4;
use super::scalar::{Row, Scalar};
use super::sizes::{LANES, STRIP, ones};

/// Puts the first of `values` at the bits of `mask` that are set, in their order, and 0 elsewhere.
pub(in crate::matrix) trait Expander<T>: Copy {
    fn expand(self, mask: u16, values: &[T; STRIP]) -> Row;
}

/// Without instructions for it.
#[derive(Clone, Copy)]
pub(in crate::matrix) struct OneByOne;

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

#[cfg(target_arch = "x86_64")]
impl<T: Scalar> Expander<T> for WithV4 {
    #[inline(always)]
    fn expand(self, mask: u16, values: &[T; STRIP]) -> Row {
        T::expand(self, mask, values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::kernel::lanes::tests::{bits, numbers};

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
            if let Some(with) = pulp::x86::V4::try_new() {
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
