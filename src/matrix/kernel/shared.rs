//! Slices that follow one another in shared memory.

use std::ops::Deref;
use std::sync::Arc;

/// A slice of values that others may follow.
///
/// A sequential read is faster from one piece of memory than from many: a processor prefetches the bytes behind it.
#[derive(Clone, Debug)]
pub(in crate::matrix) struct Shared<T> {
    /// Without a second pointer: sweeps would wait for each.
    all: Arc<[T]>,
    first: usize,
    n_values: usize,
}

impl<T: Clone> Shared<T> {
    /// Returns a slice of values, with `n_behind` more behind it.
    pub(in crate::matrix) fn new(values: impl Iterator<Item = T>, n_behind: usize, value: T) -> Self {
        // One allocation, where the length is known.
        let all: Arc<[T]> = values.chain(std::iter::repeat_n(value, n_behind)).collect();
        let n_values = all.len() - n_behind;
        Self {
            all,
            first: 0,
            n_values,
        }
    }

    /// Moves slices into one piece of memory, in order, with `n_behind` more values behind the last.
    pub(in crate::matrix) fn join<'a>(slices: impl Iterator<Item = &'a mut Self>, n_behind: usize, value: T)
    where
        T: 'a,
    {
        let slices: Vec<&mut Self> = slices.collect();
        let mut all: Vec<T> = slices.iter().flat_map(|slice| slice.iter().cloned()).collect();
        all.resize(all.len() + n_behind, value);
        let all: Arc<[T]> = all.into();
        let mut first = 0;
        for slice in slices {
            let n_own = slice.n_values;
            *slice = Self {
                all: Arc::clone(&all),
                first,
                n_values: n_own,
            };
            first += n_own;
        }
    }
}

impl<T> Shared<T> {
    /// Returns the slice with all values behind it.
    #[expect(
        clippy::inline_always,
        reason = "what is not inlined is not compiled for the instruction set"
    )]
    #[inline(always)]
    pub(in crate::matrix) fn with_what_follows(&self) -> &[T] {
        &self.all[self.first..]
    }
}

impl<T> Deref for Shared<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.all[self.first..self.first + self.n_values]
    }
}

impl<T: PartialEq> PartialEq for Shared<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_are_joined_in_order() {
        let mut slices = [[1, 2, 3].as_slice(), &[], &[4, 5]].map(|from| Shared::new(from.iter().copied(), 1, 9));
        assert_eq!(slices[0].with_what_follows(), [1, 2, 3, 9]);
        let before = slices.clone();
        Shared::join(slices.iter_mut(), 2, 0);
        assert_eq!(slices, before);
        assert_eq!(slices[0].with_what_follows(), [1, 2, 3, 4, 5, 0, 0]);
        assert_eq!(slices[2].with_what_follows(), [4, 5, 0, 0]);
        Shared::join(std::iter::empty::<&mut Shared<u8>>(), 1, 0);
    }
}
