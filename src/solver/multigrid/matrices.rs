//! Matrices of the coarse levels: rows that channels share where they can.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use crate::matrix::operator::{Block, RowAccess};
use crate::matrix::{Aligned, product, products};
use crate::mesh::hierarchy::Coarsening;
use crate::threads;

/// The share of entries that are not zero from which a row is kept in full: then it takes as much memory as with its columns.
const DENSE_FROM: f64 = 2.0 / 3.0;

/// Columns of a row below which choosing an instruction set takes longer than adding up.
const SHORT: usize = 32;

/// Rows that are multiplied at a time, so that their sums do not wait for one another.
const AT_ONCE: usize = 4;

/// One row: all of its numbers, or those that are not zero with their columns.
struct Row {
    columns: Option<Box<[u32]>>,
    values: Aligned<f64>,
}

impl Row {
    fn new(values: Aligned<f64>) -> Self {
        let n_used = values.iter().filter(|value| value.abs() > 0.0).count();
        if n_used as f64 >= DENSE_FROM * values.len() as f64 {
            return Self { columns: None, values };
        }
        let used = (0..).zip(values.iter()).filter(|(_, value)| value.abs() > 0.0);
        let (columns, numbers): (Vec<u32>, Vec<f64>) = used.unzip();
        Self {
            columns: Some(columns.into()),
            values: Aligned::copied(&numbers),
        }
    }

    /// Returns all numbers of a row that is kept in full and worth an instruction set.
    fn full(&self, x: &[f64]) -> Option<&[f64]> {
        (self.columns.is_none() && x.len() >= SHORT).then_some(&*self.values)
    }

    fn dot(&self, x: &[f64]) -> f64 {
        match &self.columns {
            None if x.len() < SHORT => short_product(&self.values, x),
            None => product(&self.values, x),
            Some(columns) => {
                let terms = columns.iter().zip(self.values.iter());
                terms.map(|(&j, value)| value * x[j as usize]).sum()
            }
        }
    }

    fn for_each(&self, mut visit: impl FnMut(usize, f64)) {
        match &self.columns {
            None => self.values.iter().enumerate().for_each(|(j, &value)| visit(j, value)),
            Some(columns) => {
                for (&j, &value) in columns.iter().zip(self.values.iter()) {
                    visit(j as usize, value);
                }
            }
        }
    }

    fn at(&self, column: usize) -> f64 {
        match &self.columns {
            None => self.values[column],
            Some(columns) => {
                let found = columns.binary_search_by_key(&column, |&j| j as usize);
                found.map_or(0.0, |place| self.values[place])
            }
        }
    }
}

/// Returns Σ a x in sums that do not wait for one another.
fn short_product(a: &[f64], x: &[f64]) -> f64 {
    let ((a, a_rest), (x, x_rest)) = (a.as_chunks::<AT_ONCE>(), x.as_chunks::<AT_ONCE>());
    let mut sums = [0.0; AT_ONCE];
    for (a, x) in a.iter().zip(x) {
        for k in 0..AT_ONCE {
            sums[k] += a[k] * x[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(x_rest).map(|(a, x)| a * x).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Where the row of one channel is.
#[derive(Clone, Copy)]
struct Slot {
    row: u32,
    factor: f64,
    /// Whether the row holds ρ already, for this channel alone; else it is a row of F, and `factor` is ρ.
    own: bool,
}

/// A matrix K of n rows for each of c channels.
///
/// Where the reflectance of a channel is the same for all that a row was made of, the row is ρ times a row of F, which all such channels share;
/// elsewhere the channel has a row of its own. What a channel's row is made of never depends on the other channels.
pub(super) struct Matrix {
    n_channels: usize,
    rows: Vec<Row>,
    /// \[n, c\].
    slots: Vec<Slot>,
}

/// What making a matrix took.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cost {
    /// Entries added.
    pub(super) n_entries: usize,
    /// Entries of the matrix that it was made of.
    pub(super) n_of_source: usize,
}

impl Cost {
    fn of(n_entries: usize) -> Self {
        Self {
            n_entries,
            n_of_source: n_entries,
        }
    }
}

impl Matrix {
    /// Returns R diag(ρ) F for the finest F: row I is the mean of the rows of its children.
    pub(super) fn restrict_form_factors(
        rows: &dyn RowAccess,
        reflectance: &Block,
        coarsening: &Coarsening,
    ) -> (Self, Cost) {
        let slot = |i: usize, c: usize| Slot {
            row: 0,
            factor: reflectance.row(i)[c],
            own: false,
        };
        let add = |i: usize, _: usize, factor: f64, sum: &mut [f64]| rows.add_row(i, factor, sum);
        let (n, n_channels) = (reflectance.n_rows(), reflectance.n_channels());
        Self::restrict(coarsening, n, n_channels, slot, add)
    }

    /// Returns R K.
    pub(super) fn restricted(&self, coarsening: &Coarsening) -> (Self, Cost) {
        let n_channels = self.n_channels;
        let add = |i: usize, c: usize, factor: f64, sum: &mut [f64]| {
            let row = self.row(i, c);
            row.for_each(|j, value| sum[j] += factor * value);
            row.values.len()
        };
        let n = coarsening.n_fine();
        Self::restrict(coarsening, n, n_channels, |i, c| self.slot(i, c), add)
    }

    /// Makes the rows of a coarse level; `slot(i, c)` tells of ρ in row i, `add(i, c, factor, sum)` adds the row and returns how many entries it has.
    fn restrict(
        coarsening: &Coarsening,
        n_columns: usize,
        n_channels: usize,
        slot: impl Fn(usize, usize) -> Slot + Sync,
        add: impl Fn(usize, usize, f64, &mut [f64]) -> usize + Sync,
    ) -> (Self, Cost) {
        let mut slots = Vec::with_capacity(coarsening.n_coarse() * n_channels);
        // The rows to be made: coarse patch, a channel that it is for, and whether for that alone.
        let mut jobs: Vec<(usize, usize, bool)> = Vec::new();
        for coarse in 0..coarsening.n_coarse() {
            let children = coarsening.children(coarse);
            let mut shared = None;
            for c in 0..n_channels {
                let first = slot(children[0] as usize, c);
                let as_first = |&i: &u32| {
                    let other = slot(i as usize, c);
                    !other.own && other.factor.to_bits() == first.factor.to_bits()
                };
                let own = !children.iter().all(as_first);
                let row = match shared {
                    Some(row) if !own => row,
                    _ => {
                        jobs.push((coarse, c, own));
                        let row = u32::try_from(jobs.len() - 1).expect("fewer rows than fine patches and channels");
                        if !own {
                            shared = Some(row);
                        }
                        row
                    }
                };
                let factor = if own { 1.0 } else { first.factor };
                slots.push(Slot { row, factor, own });
            }
        }
        let make = |k: usize| {
            let (coarse, c, own) = jobs[k];
            let mut sum = Aligned::filled(n_columns, 0.0);
            let mut n_entries = 0;
            for &i in coarsening.children(coarse) {
                let rho = if own { slot(i as usize, c).factor } else { 1.0 };
                let weight = coarsening.shares()[i as usize] * rho;
                n_entries += add(i as usize, c, weight, &mut sum);
            }
            (Row::new(sum), n_entries)
        };
        let n_terms = coarsening.n_fine() * n_columns;
        let (rows, counts): (Vec<Row>, Vec<usize>) = threads::map(n_terms, jobs.len(), make).into_iter().unzip();
        let matrix = Self {
            n_channels,
            rows,
            slots,
        };
        // Where channels have rows of their own the source is read once for each.
        let is_first = |k: &usize| *k == 0 || jobs[k - 1].0 != jobs[*k].0;
        let cost = Cost {
            n_entries: counts.iter().sum(),
            n_of_source: (0..counts.len()).filter(is_first).map(|k| counts[k]).sum(),
        };
        (matrix, cost)
    }

    /// Returns K P for injection P: the columns of each coarse patch added up.
    pub(super) fn merge_columns(&self, coarsening: &Coarsening) -> (Self, Cost) {
        let merged = |k: usize| {
            let row = &self.rows[k];
            let mut sum = Aligned::filled(coarsening.n_coarse(), 0.0);
            row.for_each(|j, value| sum[coarsening.parents()[j] as usize] += value);
            Row::new(sum)
        };
        let n_entries: usize = self.rows.iter().map(|row| row.values.len()).sum();
        let rows = threads::map(n_entries, self.rows.len(), merged);
        let matrix = Self {
            n_channels: self.n_channels,
            rows,
            slots: self.slots.clone(),
        };
        (matrix, Cost::of(n_entries))
    }

    /// Returns diag(ρ) F for form factors of a coarse level.
    pub(super) fn from_form_factors(rows: &dyn RowAccess, reflectance: &Block) -> (Self, Cost) {
        let (n, n_channels) = (reflectance.n_rows(), reflectance.n_channels());
        let make = |i: usize| {
            let mut sum = Aligned::filled(n, 0.0);
            let n_entries = rows.add_row(i, 1.0, &mut sum);
            (Row::new(sum), n_entries)
        };
        let (stored, counts): (Vec<Row>, Vec<usize>) = threads::map(n * n, n, make).into_iter().unzip();
        let slot = |(i, rho): (u32, &[f64])| -> Vec<Slot> {
            let slots = rho.iter().map(|&factor| Slot {
                row: i,
                factor,
                own: false,
            });
            slots.collect()
        };
        let slots = (0..).zip(reflectance.values().chunks(n_channels)).flat_map(slot);
        let matrix = Self {
            n_channels,
            slots: slots.collect(),
            rows: stored,
        };
        let n_entries: usize = counts.iter().sum();
        (matrix, Cost::of(n_entries))
    }

    pub(super) fn n_rows(&self) -> usize {
        self.slots.len() / self.n_channels
    }

    fn slot(&self, i: usize, c: usize) -> Slot {
        self.slots[i * self.n_channels + c]
    }

    fn row(&self, i: usize, c: usize) -> &Row {
        &self.rows[self.slot(i, c).row as usize]
    }

    /// Returns K_ij in channel c.
    pub(super) fn at(&self, i: usize, j: usize, c: usize) -> f64 {
        self.slot(i, c).factor * self.row(i, c).at(j)
    }

    /// Subtracts K x from y, channel by channel.
    pub(super) fn subtract_product(&self, x: &[Vec<f64>], y: &mut [Vec<f64>]) {
        let n_terms = x.iter().map(|x| self.n_rows() * x.len()).sum();
        let mut products = vec![[0.0; AT_ONCE]; self.n_rows().div_ceil(AT_ONCE) * self.n_channels];
        let tasks = products.chunks_mut(self.n_channels).enumerate().collect();
        threads::for_each(n_terms, tasks, |(k, of_channels): (usize, &mut [[f64; AT_ONCE]])| {
            for (c, of_rows) in of_channels.iter_mut().enumerate() {
                *of_rows = self.dots(AT_ONCE * k, c, &x[c]);
            }
        });
        for (c, y) in y.iter_mut().enumerate() {
            let of_rows = products.iter().skip(c).step_by(self.n_channels).flatten();
            y.iter_mut().zip(of_rows).for_each(|(y, product)| *y -= product);
        }
    }

    /// Subtracts K x of channel c from y.
    pub(super) fn subtract_channel(&self, c: usize, x: &[f64], y: &mut [f64]) {
        let tasks = y.chunks_mut(AT_ONCE).enumerate().collect();
        threads::for_each(self.n_rows() * x.len(), tasks, |(k, y): (usize, &mut [f64])| {
            let products = self.dots(AT_ONCE * k, c, x);
            y.iter_mut().zip(products).for_each(|(y, product)| *y -= product);
        });
    }

    /// Returns (K x)_i in channel c for the rows from `first` on, as many as there are, each the same bytes as by itself.
    fn dots(&self, first: usize, c: usize, x: &[f64]) -> [f64; AT_ONCE] {
        let place = |k: usize| (first + k).min(self.n_rows() - 1);
        let rows = std::array::from_fn(|k| self.row(place(k), c));
        let products = match rows.map(|row| row.full(x)) {
            [Some(a), Some(b), Some(c), Some(d)] => products([a, b, c, d], x),
            _ => rows.map(|row| row.dot(x)),
        };
        std::array::from_fn(|k| self.slot(place(k), c).factor * products[k])
    }

    /// Makes one sweep of Gauss-Seidel over u = f + K u in channel c.
    ///
    /// Four rows at a time are multiplied with u as it was before the four; to each product is then added what the rows before it, of the same four, have changed.
    pub(super) fn sweep(&self, c: usize, u: &mut [f64], f: &[f64]) {
        let n = u.len();
        for first in (0..n).step_by(AT_ONCE) {
            let products = self.dots(first, c, u);
            let mut changes = [0.0; AT_ONCE];
            for k in 0..AT_ONCE.min(n - first) {
                let i = first + k;
                let (slot, row) = (self.slot(i, c), self.row(i, c));
                let k_ii = slot.factor * row.at(i);
                let diagonal = 1.0 - k_ii;
                if diagonal > 0.0 {
                    let changed: f64 = (0..k).map(|m| row.at(first + m) * changes[m]).sum();
                    let gathered = products[k] + slot.factor * changed - k_ii * u[i];
                    let new = (f[i] + gathered) / diagonal;
                    changes[k] = new - u[i];
                    u[i] = new;
                }
            }
        }
    }

    /// Returns the multiplications that K x takes, the mean over the channels.
    pub(super) fn multiply_adds(&self) -> f64 {
        let entries: usize = self
            .slots
            .iter()
            .map(|slot| self.rows[slot.row as usize].values.len())
            .sum();
        entries as f64 / self.n_channels as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_do_not_depend_on_how_a_row_is_kept() {
        let values: Vec<f64> = (0..37)
            .map(|j| if j % 3 == 0 { 0.0 } else { 1.0 / f64::from(j) })
            .collect();
        let x: Vec<f64> = (0..37).map(|j| f64::from(j) - 3.5).collect();
        let expected: f64 = values.iter().zip(&x).map(|(a, x)| a * x).sum();
        let sparse = Row::new(Aligned::copied(&values));
        assert!(sparse.columns.is_some());
        // 37 terms of up to 33: rounding stays below 37 · 33 · 1.1e-16.
        assert!((product(&values, &x) - expected).abs() < 2e-13 && (sparse.dot(&x) - expected).abs() < 2e-13);
        assert!((0..37).all(|j| sparse.at(j).to_bits() == values[j].to_bits()));
    }
    /// Row i of K has entries at all columns, or at every third one, and factors differ from row to row.
    fn small_matrix(n: usize) -> Matrix {
        let entry = |i: usize, j: usize| {
            if i % 2 == 1 && !j.is_multiple_of(3) {
                0.0
            } else {
                1.0 / (1.0 + i.abs_diff(j) as f64) / n as f64
            }
        };
        let row = |i: usize| Aligned::copied(&(0..n).map(|j| entry(i, j)).collect::<Vec<_>>());
        Matrix {
            n_channels: 1,
            rows: (0..n).map(|i| Row::new(row(i))).collect(),
            slots: (0..)
                .take(n)
                .map(|row| Slot {
                    row,
                    factor: 0.5 + 0.4 / f64::from(row + 1),
                    own: false,
                })
                .collect(),
        }
    }

    #[test]
    fn a_sweep_by_fours_is_one_of_gauss_seidel() {
        // Below and above the length from which rows take wide instructions, with 0 to 3 rows left over.
        for n in [1, 5, 14, 31, 36, 37, 38, 39] {
            let k = small_matrix(n);
            assert!(n < 5 || k.rows.iter().any(|row| row.columns.is_some()));
            let f: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64).sin()).collect();
            let mut u: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let mut expected = u.clone();
            for i in 0..n {
                let others: f64 = (0..n).filter(|&j| j != i).map(|j| k.at(i, j, 0) * expected[j]).sum();
                expected[i] = (f[i] + others) / (1.0 - k.at(i, i, 0));
            }
            k.sweep(0, &mut u, &f);
            let error = u.iter().zip(&expected).map(|(u, e)| (u - e).abs()).fold(0.0, f64::max);
            // Numbers up to 3, sums of up to 39 terms of which ρF makes less than one: roundings of 1e-15 each, which no later row adds to.
            assert!(error < 2e-14, "{n}: {error:e}");
        }
    }
}
