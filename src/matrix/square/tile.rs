//! One square tile of a symmetric matrix: full, or a list of its entries that can be read by rows and by columns.

use std::ops::{Deref, Range};

use super::both::{Meeting, add_both};
use super::listed::add_both_listed;
use super::places::Places;
use crate::matrix::backend::Sizes;
use crate::matrix::choice::Layout;
use crate::matrix::error::MatrixError;
use crate::matrix::kernel::aligned::Aligned;
use crate::matrix::kernel::dot::add_dot;
use crate::matrix::kernel::prefetch::prefetch;
use crate::matrix::kernel::scalar::{Scalar, rounded};
use crate::matrix::kernel::shared::Shared;
use crate::matrix::kernel::sizes::{SIDE, STRIP};
use crate::matrix::tile::{Entry, index, is_zero};

/// A tile of at most [`SIDE`] by [`SIDE`] numbers. Rows and columns are counted from the tile's first.
#[derive(Clone, Debug)]
pub(in crate::matrix) enum Square<T> {
    /// All numbers are zero, for certain.
    Empty,
    /// All numbers, row by row.
    Full(Box<Full<T>>),
    /// The entries alone.
    List(Box<List<T>>),
}

/// Numbers with their standard errors, the latter empty where every one is zero.
#[derive(Clone, Debug)]
pub(super) struct Values<V> {
    pub(super) values: V,
    pub(super) std_errors: Box<[f32]>,
}

#[derive(Clone, Debug)]
pub(in crate::matrix) struct Full<T> {
    pub(super) n_columns: usize,
    pub(super) numbers: Values<Aligned<T>>,
}

/// Entries in the order of [`Places`]; [`STRIP`] numbers or more follow, so that the most entries of a strip's row can always be read.
#[derive(Clone, Debug)]
pub(in crate::matrix) struct List<T> {
    pub(super) places: Places,
    pub(super) numbers: Values<Shared<T>>,
}

/// One entry of a tile that is to be stored: row and column in the matrix, number, standard error.
pub(in crate::matrix) type Placed<T> = (usize, u32, T, f32);

impl<T: Scalar> Square<T> {
    /// Stores entries, sorted by row and column, of the tile that covers `rows` and `columns` of the matrix.
    pub(in crate::matrix) fn new(
        entries: &[Placed<T>],
        rows: &Range<usize>,
        columns: &Range<usize>,
        layout: Layout,
    ) -> Self {
        let size = rows.len() * columns.len();
        let place = |&(row, column, ..): &Placed<T>| (row - rows.start, column as usize - columns.start);
        let with_errors = entries.iter().any(|&(.., std_error)| std_error > 0.0);
        if layout.is_full(entries.len(), size) {
            let mut values = Aligned::filled(size, T::from_f64(0.0));
            let mut std_errors = vec![0.0; if with_errors { size } else { 0 }];
            for entry in entries {
                let (row, column) = place(entry);
                let at = row * columns.len() + column;
                values[at] = entry.2;
                if with_errors {
                    std_errors[at] = entry.3;
                }
            }
            let numbers = Values {
                values,
                std_errors: std_errors.into(),
            };
            let n_columns = columns.len();
            return Self::Full(Box::new(Full { n_columns, numbers }));
        }
        if entries.is_empty() {
            return Self::Empty;
        }
        let mut by_strips: Vec<&Placed<T>> = entries.iter().collect();
        by_strips.sort_by_key(|entry| place(entry).1 / STRIP);
        let std_errors = by_strips.iter().filter(|_| with_errors).map(|entry| entry.3);
        let numbers = Values {
            values: listed(by_strips.iter().map(|entry| entry.2)),
            std_errors: std_errors.collect(),
        };
        Self::List(Box::new(List {
            places: Places::new(by_strips.into_iter().map(place)),
            numbers,
        }))
    }

    /// Returns a tile with the number and the standard error at every place (row, column) multiplied by `factor(row, column)`; the step of a number is added to its error.
    pub(in crate::matrix) fn scaled(
        &self,
        first: (usize, usize),
        n: usize,
        factor: impl Fn(usize, usize) -> f64,
    ) -> Result<Self, MatrixError> {
        let scale = |row: usize, column: usize, (value, std_error): (f64, f64)| {
            let factor = factor(row, column);
            // A smaller number is not more accurate, and the former one may have been right.
            let error = factor.max(1.0) * std_error + (factor - 1.0).abs() * value;
            let entry: Entry = (index(first.1 + column), factor * value, error);
            rounded::<T>(first.0 + row, entry, n)
        };
        // A tile without standard errors stays one.
        let parts = |scaled: Vec<(T, f32)>, with_errors: bool| {
            let (values, mut std_errors): (Vec<T>, Vec<f32>) = scaled.into_iter().unzip();
            std_errors.truncate(if with_errors { values.len() } else { 0 });
            (values, std_errors.into_boxed_slice())
        };
        Ok(match self {
            Self::Empty => Self::Empty,
            Self::Full(full) => {
                let (n_columns, old) = (full.n_columns, &full.numbers);
                let scaled = (0..old.values.len()).map(|at| scale(at / n_columns, at % n_columns, old.at(at)));
                let (values, std_errors) = parts(scaled.collect::<Result<_, _>>()?, !old.std_errors.is_empty());
                let values = Aligned::copied(&values);
                let numbers = Values { values, std_errors };
                Self::Full(Box::new(Full { n_columns, numbers }))
            }
            Self::List(list) => {
                let (places, old) = (list.places.clone(), &list.numbers);
                let scaled = places
                    .all()
                    .enumerate()
                    .map(|(at, (row, column))| scale(row, column, old.at(at)));
                let (values, std_errors) = parts(scaled.collect::<Result<_, _>>()?, !old.std_errors.is_empty());
                let values = listed(values.into_iter());
                let numbers = Values { values, std_errors };
                Self::List(Box::new(List { places, numbers }))
            }
        })
    }

    /// Moves the contents of the lists among tiles into one piece of memory, in order.
    pub(in crate::matrix) fn join_lists(tiles: &mut [Self]) {
        let mut lists: Vec<&mut Box<List<T>>> = tiles
            .iter_mut()
            .filter_map(|tile| match tile {
                Self::List(list) => Some(list),
                Self::Empty | Self::Full(_) => None,
            })
            .collect();
        Places::join(lists.iter_mut().map(|list| &mut list.places));
        Shared::join(
            lists.iter_mut().map(|list| &mut list.numbers.values),
            STRIP,
            T::from_f64(0.0),
        );
        // Consecutive allocations mostly lie in order, which they do not while tiles are made.
        for list in lists {
            *list = list.clone();
        }
    }

    /// Calls `visit(column, number, standard error)` in ascending order for the entries of a row in `columns`.
    pub(in crate::matrix) fn for_each_in_row(
        &self,
        row: usize,
        columns: Range<usize>,
        visit: &mut dyn FnMut(usize, f64, f64),
    ) {
        match self {
            Self::Empty => {}
            Self::Full(full) => {
                for column in columns {
                    full.visit(row, column, column, visit);
                }
            }
            Self::List(list) => {
                for (column, at) in list.places.row(row).entries() {
                    if columns.contains(&column) {
                        let (value, std_error) = list.numbers.at(at);
                        visit(column, value, std_error);
                    }
                }
            }
        }
    }

    /// Calls `visit(row, number, standard error)` in ascending order for the entries of a column in `rows`.
    pub(in crate::matrix) fn for_each_in_column(
        &self,
        column: usize,
        rows: Range<usize>,
        visit: &mut dyn FnMut(usize, f64, f64),
    ) {
        match self {
            Self::Empty => {}
            Self::Full(full) => {
                for row in rows {
                    full.visit(row, column, row, visit);
                }
            }
            Self::List(list) => {
                for (row, at) in list.places.column(column).entries() {
                    if rows.contains(&row) {
                        let (value, std_error) = list.numbers.at(at);
                        visit(row, value, std_error);
                    }
                }
            }
        }
    }

    /// Adds `factor` Σ_{k ≠ `except`} t_k x_k over a row to `sum`, and returns the number at `except`.
    pub(in crate::matrix) fn add_row(
        &self,
        row: usize,
        except: Option<usize>,
        factor: f64,
        x: &[f64],
        sum: &mut [f64],
    ) -> f64 {
        let mut left_out = 0.0;
        match self {
            Self::Empty => {}
            Self::Full(full) => {
                let values = &full.numbers.values[row * full.n_columns..(row + 1) * full.n_columns];
                let Some(diagonal) = except else {
                    add_dot(values, |k| k, factor, x, sum);
                    return 0.0;
                };
                add_dot(&values[..diagonal], |k| k, factor, x, sum);
                add_dot(&values[diagonal + 1..], |k| diagonal + 1 + k, factor, x, sum);
                left_out = values[diagonal].to_f64();
            }
            Self::List(list) => {
                let line = list.places.row(row);
                let (columns, n) = (line.places(), line.places().len());
                let mut values = [T::from_f64(0.0); SIDE];
                gather(&mut values, line.entries().map(|(_, at)| list.numbers.values[at]));
                let (end, begin) = match except {
                    Some(except) => [except, except + 1]
                        .map(|end| columns.partition_point(|&k| usize::from(k) < end))
                        .into(),
                    None => (n, n),
                };
                for part in [0..end, begin..n] {
                    let columns = &columns[part.clone()];
                    add_dot(&values[part], |k| columns[k].into(), factor, x, sum);
                }
                if end < begin {
                    left_out = values[end].to_f64();
                }
            }
        }
        left_out
    }

    /// Adds `factor` Σ_k t_k x_k over a column to `sum`.
    pub(in crate::matrix) fn add_column(&self, column: usize, factor: f64, x: &[f64], sum: &mut [f64]) {
        let mut gathered = [T::from_f64(0.0); SIDE];
        match self {
            Self::Empty => {}
            Self::Full(full) => {
                let values = full.numbers.values.iter().skip(column).step_by(full.n_columns);
                let n = gather(&mut gathered, values.copied());
                add_dot(&gathered[..n], |k| k, factor, x, sum);
            }
            Self::List(list) => {
                let line = list.places.column(column);
                let n = gather(&mut gathered, line.entries().map(|(_, at)| list.numbers.values[at]));
                add_dot(&gathered[..n], |k| line.places()[k].into(), factor, x, sum);
            }
        }
    }

    /// Prefetches the places of the entries of a list.
    pub(in crate::matrix) fn ask(&self) {
        if let Self::List(list) = self {
            prefetch(std::slice::from_ref(&**list), 0);
            prefetch(std::slice::from_ref(&**list), 1);
        }
    }

    /// Adds T `x_columns` and T^T `x_rows` to the sums of each channel, reading the tile once; a list's channels have [`SIDE`] rows and columns
    /// in any case.
    pub(in crate::matrix) fn add_both<'a>(&self, channels: impl Iterator<Item = Meeting<'a>>) {
        match self {
            Self::Empty => {}
            Self::Full(full) => add_both(&full.numbers.values, channels),
            Self::List(list) => add_both_listed(&list.places, list.numbers.values.with_what_follows(), channels),
        }
    }

    /// Returns the rows or columns, given those in the matrix, that [`add_both`](Self::add_both) visits.
    pub(in crate::matrix) fn gone_by(&self, in_matrix: Range<usize>) -> Range<usize> {
        match self {
            Self::Empty | Self::Full(_) => in_matrix,
            Self::List(_) => in_matrix.start..in_matrix.start + SIDE,
        }
    }

    /// Returns what the numbers take; [`add_both`](Self::add_both) is a pass.
    pub(in crate::matrix) fn sizes(&self) -> Sizes {
        let (place_byte, values, std_errors): (usize, &[T], &[f32]) = match self {
            Self::Empty => (0, &[], &[]),
            Self::Full(full) => (0, &full.numbers.values, &full.numbers.std_errors),
            Self::List(list) => {
                let place_byte = Places::byte(list.places.size());
                (place_byte, &list.numbers.values, &list.numbers.std_errors)
            }
        };
        let pass_byte = place_byte + size_of_val(values);
        Sizes {
            n_nonzero: values.iter().filter(|v| !is_zero(v.to_f64())).count(),
            pass_byte,
            stored_byte: size_of::<Self>() + pass_byte + size_of_val(std_errors),
        }
    }
}

/// Returns numbers in the form of a [`List`].
pub(super) fn listed<T: Scalar>(values: impl Iterator<Item = T>) -> Shared<T> {
    Shared::new(values, STRIP, T::from_f64(0.0))
}

impl<T: Scalar, V: Deref<Target = [T]>> Values<V> {
    fn at(&self, at: usize) -> (f64, f64) {
        let std_error = self.std_errors.get(at).map_or(0.0, |&error| f64::from(error));
        (self.values[at].to_f64(), std_error)
    }
}

impl<T: Scalar> Full<T> {
    /// Calls `visit(name, ...)` for a place where the number or its standard error is not zero.
    fn visit(&self, row: usize, column: usize, name: usize, visit: &mut dyn FnMut(usize, f64, f64)) {
        let (value, std_error) = self.numbers.at(row * self.n_columns + column);
        if !is_zero(value) || !is_zero(std_error) {
            visit(name, value, std_error);
        }
    }
}

/// Puts items into the first slots, and returns their number.
fn gather<T>(slots: &mut [T], items: impl Iterator<Item = T>) -> usize {
    let mut n = 0;
    for (slot, item) in slots.iter_mut().zip(items) {
        *slot = item;
        n += 1;
    }
    n
}
