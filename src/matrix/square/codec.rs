//! Tiles as bytes and back. The bytes are those of this machine: they never leave the process that wrote them.

use super::super::aligned::Aligned;
use super::super::store::Scalar;
use super::{Full, List, Square, Values};

/// What must be known of a tile to read its bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) struct Form {
    /// None of the numbers is stored, all, or so many of them with their places.
    entries: Entries,
    with_errors: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Entries {
    None,
    All,
    Some(u16),
}

impl Form {
    /// Returns the bytes that the numbers and their places take in a tile of `size` places, and those of the standard errors.
    pub(in super::super) fn byte<T: Scalar>(self, size: usize) -> [usize; 2] {
        let (n, places) = match self.entries {
            Entries::None => (0, 0),
            Entries::All => (size, 0),
            Entries::Some(n) => (usize::from(n), 4),
        };
        let errors = if self.with_errors { n * size_of::<f32>() } else { 0 };
        [n * (places + size_of::<T>()), errors]
    }
}

impl<T: Scalar> Square<T> {
    pub(in super::super) fn form(&self) -> Form {
        let (entries, numbers) = match self {
            Self::Empty => {
                let (entries, with_errors) = (Entries::None, false);
                return Form { entries, with_errors };
            }
            Self::Full(full) => (Entries::All, &full.numbers),
            Self::List(list) => {
                let n = u16::try_from(list.rows.len()).expect("a tile has at most 4096 places");
                (Entries::Some(n), &list.numbers)
            }
        };
        let with_errors = !numbers.std_errors.is_empty();
        Form { entries, with_errors }
    }

    /// Appends the numbers, and the places where these are listed.
    pub(in super::super) fn push_numbers(&self, bytes: &mut Vec<u8>) {
        let numbers = match self {
            Self::Empty => return,
            Self::Full(full) => &full.numbers,
            Self::List(list) => {
                bytes.extend_from_slice(&list.rows);
                bytes.extend_from_slice(&list.columns);
                bytes.extend(list.by_column.iter().flat_map(|at| at.to_ne_bytes()));
                &list.numbers
            }
        };
        T::push_bytes(&numbers.values, bytes);
    }

    /// Appends the standard errors.
    pub(in super::super) fn push_errors(&self, bytes: &mut Vec<u8>) {
        match self {
            Self::Empty => {}
            Self::Full(full) => f32::push_bytes(&full.numbers.std_errors, bytes),
            Self::List(list) => f32::push_bytes(&list.numbers.std_errors, bytes),
        }
    }

    /// Returns a tile of `n_columns` columns from its bytes; without those of the errors they read as zero.
    pub(in super::super) fn from_bytes(form: Form, n_columns: usize, numbers: &[u8], errors: &[u8]) -> Self {
        let of_values = |bytes| Values {
            values: Aligned::copied(&T::from_bytes(bytes)),
            std_errors: f32::from_bytes(errors),
        };
        match form.entries {
            Entries::None => Self::Empty,
            Entries::All => Self::Full(Box::new(Full {
                n_columns,
                numbers: of_values(numbers),
            })),
            Entries::Some(n) => {
                let n = usize::from(n);
                let (rows, rest) = numbers.split_at(n);
                let (columns, after) = rest.split_at(n);
                let (order, values) = after.split_at(2 * n);
                let (pairs, _) = order.as_chunks::<2>();
                Self::List(Box::new(List {
                    rows: rows.into(),
                    columns: columns.into(),
                    by_column: pairs.iter().map(|&pair| u16::from_ne_bytes(pair)).collect(),
                    numbers: of_values(values),
                }))
            }
        }
    }
}
