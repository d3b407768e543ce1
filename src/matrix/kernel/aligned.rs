//! Numbers that begin on a cache line, so that no register is loaded from two of them.

use std::ops::{Deref, DerefMut};

/// The size of a cache line, and of the widest registers.
pub(in crate::matrix) const LINE_BYTE: usize = 64;

/// The distance in bytes at which addresses alias in a processor's check of reads against recent writes.
///
/// A read at this distance from a write, or at a multiple, waits for it.
const PAGE_BYTE: usize = 4096;

/// Returns the least distance of slices of at least `n_values` numbers in f64 that are read and written at the same place by turns.
///
/// It is a whole number of cache lines, and a third of [`PAGE_BYTE`] beyond a multiple of that, since there are mostly three slices. With a multiple of it passes of three channels took twice as long on Zen 4, not always.
pub(in crate::matrix) const fn apart(n_values: usize) -> usize {
    let page = PAGE_BYTE / size_of::<f64>();
    let beyond = (page / 3).next_multiple_of(LINE_BYTE / size_of::<f64>());
    let least = n_values.next_multiple_of(LINE_BYTE / size_of::<f64>());
    least + (page + beyond - least % page) % page
}

/// A slice that begins on a cache line.
#[derive(Debug)]
pub(crate) struct Aligned<T> {
    values: Vec<T>,
    /// The first value of the slice.
    first: usize,
    n_values: usize,
}

impl<T: Clone> Aligned<T> {
    /// Returns `n_values` times the same value.
    pub(crate) fn filled(n_values: usize, value: T) -> Self {
        let values = vec![value; n_values + LINE_BYTE / size_of::<T>()];
        let first = values.as_ptr().align_offset(LINE_BYTE).min(values.len() - n_values);
        Self {
            values,
            first,
            n_values,
        }
    }

    /// Returns a copy of a slice.
    pub(crate) fn copied(from: &[T]) -> Self {
        let Some(value) = from.first() else {
            return Self {
                values: Vec::new(),
                first: 0,
                n_values: 0,
            };
        };
        let mut copy = Self::filled(from.len(), value.clone());
        copy.clone_from_slice(from);
        copy
    }
}

impl<T: Clone> Clone for Aligned<T> {
    fn clone(&self) -> Self {
        Self::copied(self)
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.values[self.first..self.first + self.n_values]
    }
}

impl<T> DerefMut for Aligned<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values[self.first..self.first + self.n_values]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_apart_have_room_and_do_not_look_alike() {
        for n_values in 0..2000 {
            let distance = apart(n_values);
            assert!(distance >= n_values && distance < n_values + 520, "{n_values}");
            for k in 1..3 {
                let byte = k * distance * size_of::<f64>();
                assert!(byte.is_multiple_of(LINE_BYTE) && byte % PAGE_BYTE > 1024, "{n_values}");
            }
        }
    }

    #[test]
    fn slices_begin_on_a_cache_line() {
        for n in 0..40_u8 {
            let numbers: Vec<f32> = (0..n).map(f32::from).collect();
            let mut aligned = Aligned::copied(&numbers);
            assert_eq!(*aligned, *numbers);
            assert!(aligned.is_empty() || aligned.as_ptr().align_offset(LINE_BYTE) == 0);
            let copy = aligned.clone();
            aligned.iter_mut().for_each(|value| *value += 1.0);
            assert_eq!(*copy, *numbers);
            assert!(copy.is_empty() || copy.as_ptr().align_offset(LINE_BYTE) == 0);
        }
    }
}
