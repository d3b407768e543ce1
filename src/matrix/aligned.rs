//! Numbers that begin on a cache line, so that no register is loaded from two of them.

use std::ops::{Deref, DerefMut};

/// The size of a cache line, and of the widest registers.
pub(super) const LINE_BYTE: usize = 64;

/// A slice that begins on a cache line.
#[derive(Debug)]
pub(crate) struct Aligned<T> {
    values: Vec<T>,
    /// Where the slice begins.
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
