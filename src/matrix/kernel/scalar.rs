//! A number as it is stored, and the operations on it that depend on the instruction set.

#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use std::fmt::Debug;
#[cfg(target_arch = "x86_64")]
use std::{arch::x86_64::__m512, hint::black_box};

use pulp::Simd;
use pulp::bytemuck::{Pod, cast_slice, pod_read_unaligned};
#[cfg(target_arch = "x86_64")]
use pulp::{cast, x86::V4};

use super::sizes::{LANES, Lanes, STRIP};
use crate::matrix::error::MatrixError;
use crate::matrix::tile::Entry;

/// The row of a strip.
pub(in crate::matrix) type Row = [Lanes; STRIP / LANES];

/// A number as it is stored: f32 or f64.
pub(in crate::matrix) trait Scalar: Pod + Send + Sync + Debug {
    /// Rounds to the nearest number that can be stored.
    fn from_f64(value: f64) -> Self;
    /// Returns the number; exact.
    fn to_f64(self) -> f64;
    /// Calls `then` with the numbers as f64; f64 numbers are not copied, since a copy would go through memory.
    fn with_widened<R>(numbers: &[Self; LANES], then: impl FnOnce(&Lanes) -> R) -> R;
    /// Returns the first [`LANES`] numbers as f64 in N registers, with zeros in place of missing ones.
    fn widen_some<S: Simd, const N: usize>(simd: S, numbers: &[Self]) -> [S::f64s; N];
    /// Appends numbers as bytes of this machine.
    fn push_bytes(numbers: &[Self], bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(cast_slice(numbers));
    }
    /// Returns the numbers that [`push_bytes`](Self::push_bytes) wrote.
    fn from_bytes(bytes: &[u8]) -> impl Iterator<Item = Self> {
        bytes.chunks_exact(size_of::<Self>()).map(pod_read_unaligned)
    }
    /// Puts the first of `values` at the bits of `mask` that are set, in their order, and 0 elsewhere.
    #[cfg(target_arch = "x86_64")]
    fn expand(with: WithV4, mask: u16, values: &[Self; STRIP]) -> Row;
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
    #[inline(always)]
    fn with_widened<R>(numbers: &[Self; LANES], then: impl FnOnce(&Lanes) -> R) -> R {
        then(numbers)
    }
    #[inline(always)]
    fn widen_some<S: Simd, const N: usize>(simd: S, numbers: &[Self]) -> [S::f64s; N] {
        std::array::from_fn(|k| simd.partial_load_f64s(numbers.chunks(S::F64_LANES).nth(k).unwrap_or_default()))
    }
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
    #[inline(always)]
    fn with_widened<R>(numbers: &[Self; LANES], then: impl FnOnce(&Lanes) -> R) -> R {
        then(&numbers.map(f64::from))
    }
    #[inline(always)]
    fn widen_some<S: Simd, const N: usize>(simd: S, numbers: &[Self]) -> [S::f64s; N] {
        let mut eight = [0.0; LANES];
        for (k, part) in eight.chunks_mut(S::F32_LANES).enumerate() {
            let register = simd.partial_load_f32s(numbers.chunks(S::F32_LANES).nth(k).unwrap_or_default());
            let values: &[Self] = cast_slice(std::slice::from_ref(&register));
            part.copy_from_slice(&values[..part.len()]);
        }
        let widened = eight.map(f64::from);
        let registers = S::as_simd_f64s(&widened).0;
        std::array::from_fn(|k| registers[k])
    }
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    fn expand(with: WithV4, mask: u16, values: &[Self; STRIP]) -> Row {
        let row = with.simd.avx512f._mm512_mask_expand_ps(with.zeros, mask, cast(*values));
        let halves: [[Self; LANES]; 2] = cast(row);
        halves.map(|half| cast(with.simd.avx512f._mm512_cvtps_pd(cast(half))))
    }
}

/// With AVX-512, which has an instruction for it.
///
/// Numbers are put into a register of zeros whose values are hidden from the compiler. Otherwise it would use the form of the instruction that makes zeros itself, which on Zen 4
/// waits for the former value of its register, most often the row before: 17 cycles a row in place of 7.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy)]
pub(in crate::matrix) struct WithV4 {
    simd: V4,
    zeros: __m512,
}

#[cfg(target_arch = "x86_64")]
impl WithV4 {
    #[inline(always)]
    pub(in crate::matrix) fn new(simd: V4) -> Self {
        let zeros = cast(black_box([0.0_f32; STRIP]));
        Self { simd, zeros }
    }
}

/// Rounds an entry of row `row` to the stored precision, and refuses a number that is not usable there.
pub(in crate::matrix) fn rounded<T: Scalar>(
    row: usize,
    (column, value, std_error): Entry,
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
