//! Tiles as bytes and back. The bytes are those of this machine: they never leave the process that wrote them.

use super::places::Places;
use super::tile::{Full, List, Square, Values, listed};
use crate::matrix::kernel::aligned::Aligned;
use crate::matrix::kernel::scalar::Scalar;

/// The properties of a tile that reading its bytes requires.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::matrix) struct Form {
    /// Whether none of the numbers is stored, all, or some with their places.
    entries: Entries,
    with_errors: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Entries {
    None,
    All,
    /// Their number, and the [`Places::size`].
    Some {
        n: u16,
        places: [u16; 2],
    },
}

impl Form {
    /// Returns the bytes that the numbers and their places take in a tile of `size` places, and those of the standard errors.
    pub(in crate::matrix) fn byte<T: Scalar>(self, size: usize) -> [usize; 2] {
        let (n, places) = match self.entries {
            Entries::None => (0, 0),
            Entries::All => (size, 0),
            Entries::Some { n, places } => (n.into(), Places::byte(places.map(usize::from))),
        };
        let errors = if self.with_errors { n * size_of::<f32>() } else { 0 };
        [places + n * size_of::<T>(), errors]
    }
}

impl<T: Scalar> Square<T> {
    pub(in crate::matrix) fn form(&self) -> Form {
        let (entries, std_errors) = match self {
            Self::Empty => {
                let (entries, with_errors) = (Entries::None, false);
                return Form { entries, with_errors };
            }
            Self::Full(full) => (Entries::All, &full.numbers.std_errors),
            Self::List(list) => {
                let narrow = |n: usize| u16::try_from(n).expect("a tile has at most 4096 places");
                let (n, places) = (narrow(list.numbers.values.len()), list.places.size().map(narrow));
                (Entries::Some { n, places }, &list.numbers.std_errors)
            }
        };
        let with_errors = !std_errors.is_empty();
        Form { entries, with_errors }
    }

    /// Appends the numbers, and the places where these are listed.
    pub(in crate::matrix) fn push_numbers(&self, bytes: &mut Vec<u8>) {
        match self {
            Self::Empty => {}
            Self::Full(full) => T::push_bytes(&full.numbers.values, bytes),
            Self::List(list) => {
                list.places.push_bytes(bytes);
                T::push_bytes(&list.numbers.values, bytes);
            }
        }
    }

    /// Appends the standard errors.
    pub(in crate::matrix) fn push_errors(&self, bytes: &mut Vec<u8>) {
        match self {
            Self::Empty => {}
            Self::Full(full) => f32::push_bytes(&full.numbers.std_errors, bytes),
            Self::List(list) => f32::push_bytes(&list.numbers.std_errors, bytes),
        }
    }

    /// Returns a tile of `n_columns` columns from its bytes; without those of the errors they read as zero.
    pub(in crate::matrix) fn from_bytes(form: Form, n_columns: usize, of_numbers: &[u8], of_errors: &[u8]) -> Self {
        let std_errors = f32::from_bytes(of_errors).collect();
        match form.entries {
            Entries::None => Self::Empty,
            Entries::All => {
                let values = Aligned::copied(&T::from_bytes(of_numbers).collect::<Vec<_>>());
                let numbers = Values { values, std_errors };
                Self::Full(Box::new(Full { n_columns, numbers }))
            }
            Entries::Some { places, .. } => {
                let (places, values) = Places::from_bytes(places.map(usize::from), of_numbers);
                let values = listed(T::from_bytes(values));
                let numbers = Values { values, std_errors };
                Self::List(Box::new(List { places, numbers }))
            }
        }
    }
}
