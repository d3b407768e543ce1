//! Matrices of the coarse levels: rows that channels share where they can.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use crate::matrix::operator::{Block, RowAccess};
use crate::matrix::{Coefficients, ROWS_AT_ONCE, products};
use crate::mesh::hierarchy::Coarsening;
use crate::threads;

/// The share of nonzero entries from which on a row is stored in full: then it takes as much memory as with its columns.
const DENSE_FROM: f64 = 2.0 / 3.0;

/// Rows in full begin at a multiple of so many columns, mostly the same one for rows that are multiplied together.
const LINE: usize = 8;

/// The stored numbers of a row.
enum Columns {
    /// All of them from this column on.
    From(usize),
    /// Those that are not zero, in these columns.
    Listed(Box<[u32]>),
}

/// One row.
struct Row {
    columns: Columns,
    values: Coefficients,
}

impl Row {
    fn new(values: &[f64]) -> Self {
        Self::from(0, values, Coefficients::exact)
    }

    /// Returns a row of numbers that are 0 up to the diagonal, and perhaps beyond it.
    fn above_diagonal(values: &[f64], rounded: bool) -> Self {
        let n_zeros = values.iter().take_while(|value| value.abs() <= 0.0).count();
        let kept = if rounded {
            Coefficients::rounded
        } else {
            Coefficients::exact
        };
        Self::from(n_zeros / LINE * LINE, values, kept)
    }

    fn from(begin: usize, values: &[f64], kept: impl Fn(&[f64]) -> Coefficients) -> Self {
        let is_used = |value: &f64| value.abs() > 0.0;
        let rest = &values[begin..];
        let n_used = rest.iter().filter(|&value| is_used(value)).count();
        if n_used as f64 >= DENSE_FROM * rest.len() as f64 {
            return Self {
                columns: Columns::From(begin),
                values: kept(rest),
            };
        }
        let used = (0..).zip(values).filter(|(_, value)| is_used(value));
        let (columns, numbers): (Vec<u32>, Vec<f64>) = used.unzip();
        Self {
            columns: Columns::Listed(columns.into()),
            values: kept(&numbers),
        }
    }

    /// Returns the first column of a row that is stored in full and long enough for [`products`].
    fn begin_of_many(&self) -> Option<usize> {
        match self.columns {
            Columns::From(begin) if self.values.is_long() => Some(begin),
            _ => None,
        }
    }

    fn dot(&self, x: &[f64]) -> f64 {
        match &self.columns {
            &Columns::From(begin) => self.values.product(0..self.values.len(), &x[begin..]),
            Columns::Listed(columns) => {
                let mut sum = 0.0;
                self.values.for_each(|k, value| sum += value * x[columns[k] as usize]);
                sum
            }
        }
    }

    /// Returns the numbers of some columns from `first` on; 0 beyond the last one.
    fn near(&self, first: usize) -> [f64; ROWS_AT_ONCE] {
        std::array::from_fn(|k| self.at(first + k))
    }

    fn for_each(&self, mut visit: impl FnMut(usize, f64)) {
        match &self.columns {
            &Columns::From(begin) => self.values.for_each(|k, value| visit(begin + k, value)),
            Columns::Listed(columns) => self.values.for_each(|k, value| visit(columns[k] as usize, value)),
        }
    }

    fn at(&self, column: usize) -> f64 {
        let place = match &self.columns {
            &Columns::From(begin) => column.checked_sub(begin),
            Columns::Listed(columns) => columns.binary_search_by_key(&column, |&j| j as usize).ok(),
        };
        place.and_then(|place| self.values.get(place)).unwrap_or(0.0)
    }
}

/// The position of one channel's row.
#[derive(Clone, Copy)]
struct Slot {
    row: u32,
    factor: f64,
    /// Whether the row is this channel's own and includes ρ; otherwise it is a row of F, and `factor` is ρ.
    own: bool,
}

/// A matrix K of n rows for each of c channels.
///
/// Where a channel has one reflectance for all sources of a row, the row is ρ times a row of F, which all such channels share;
/// elsewhere the channel has a row of its own. A channel's row never depends on the other channels.
pub(super) struct Matrix {
    n_channels: usize,
    rows: Vec<Row>,
    /// \[n, c\].
    slots: Vec<Slot>,
    /// The multiplications of K x, all channels together.
    n_terms: usize,
}

/// The requested part of R K.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    /// Whether only R U is stored, where U is K above its diagonal.
    pub(super) upper: bool,
    /// Whether R U is stored in f32.
    pub(super) rounded: bool,
    /// Whether R K P is needed too.
    pub(super) merged: bool,
}

/// The coarse form of a matrix K.
pub(super) struct Restricted {
    /// R K, or R U.
    pub(super) rows: Matrix,
    /// R K P for injection P: the columns of each coarse patch added up.
    pub(super) merged: Option<Matrix>,
    /// Entries added.
    pub(super) n_added: usize,
    /// Entries of K.
    pub(super) n_of_source: usize,
}

/// The effect of a sweep of u = f + K u.
pub(super) struct Swept {
    /// The correction of each u.
    pub(super) changes: Vec<f64>,
    /// The patches that a sweep cannot correct, as K_ii ≥ 1, with their residuals at their turn.
    pub(super) left: Vec<(usize, f64)>,
}

impl Matrix {
    fn new(n_channels: usize, rows: Vec<Row>, slots: Vec<Slot>) -> Self {
        let terms = slots.iter().map(|slot| rows[slot.row as usize].values.len());
        Self {
            n_channels,
            n_terms: terms.sum(),
            rows,
            slots,
        }
    }

    /// Returns R K of K = diag(ρ) F for the finest F: row I is the mean of the rows of its children.
    pub(super) fn restrict_form_factors(
        rows: &dyn RowAccess,
        reflectance: &Block,
        coarsening: &Coarsening,
        wanted: Wanted,
    ) -> Restricted {
        let slot = |i: usize, c: usize| Slot {
            row: 0,
            factor: reflectance.row(i)[c],
            own: false,
        };
        let add = |i: usize, _: usize, factor: f64, sum: &mut [f64]| rows.add_row(i, factor, sum);
        restrict(coarsening, reflectance.n_channels(), wanted, slot, add)
    }

    /// Returns R K.
    pub(super) fn restricted(&self, coarsening: &Coarsening, wanted: Wanted) -> Restricted {
        let add = |i: usize, c: usize, factor: f64, sum: &mut [f64]| {
            let row = self.row(i, c);
            row.for_each(|j, value| sum[j] += factor * value);
            row.values.len()
        };
        restrict(coarsening, self.n_channels, wanted, |i, c| self.slot(i, c), add)
    }

    /// Returns diag(ρ) F for form factors of a coarse level, and the number of entries read.
    pub(super) fn from_form_factors(rows: &dyn RowAccess, reflectance: &Block) -> (Self, usize) {
        let (n, n_channels) = (reflectance.n_rows(), reflectance.n_channels());
        let make = |i: usize| {
            let mut sum = vec![0.0; n];
            let n_entries = rows.add_row(i, 1.0, &mut sum);
            (Row::new(&sum), n_entries)
        };
        let (stored, counts): (Vec<Row>, Vec<usize>) = threads::map(threads::pay(n * n), n, make).into_iter().unzip();
        let slot = |(i, rho): (u32, &[f64])| -> Vec<Slot> {
            let slots = rho.iter().map(|&factor| Slot {
                row: i,
                factor,
                own: false,
            });
            slots.collect()
        };
        let slots = (0..).zip(reflectance.values().chunks(n_channels)).flat_map(slot);
        (Self::new(n_channels, stored, slots.collect()), counts.iter().sum())
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

    /// Returns whether all entries off the diagonal are zero.
    pub(super) fn is_diagonal(&self) -> bool {
        let mut slots = self.slots.iter().enumerate();
        slots.all(|(k, slot)| {
            let mut is_diagonal = true;
            self.rows[slot.row as usize].for_each(|j, value| {
                is_diagonal &= j == k / self.n_channels || value.abs() <= 0.0;
            });
            is_diagonal
        })
    }

    /// Returns K_ij in channel c.
    pub(super) fn at(&self, i: usize, j: usize, c: usize) -> f64 {
        self.slot(i, c).factor * self.row(i, c).at(j)
    }

    /// Subtracts K x from y, channel by channel.
    pub(super) fn subtract_product(&self, x: &[&[f64]], y: &mut [Vec<f64>]) {
        let mut products = vec![0.0; self.slots.len()];
        threads::for_each_chunk(
            threads::pay(self.n_terms),
            &mut products,
            ROWS_AT_ONCE * self.n_channels,
            |k, of_rows| {
                for (c, x) in x.iter().enumerate() {
                    let products = self.dots(ROWS_AT_ONCE * k, c, x);
                    for (of_row, product) in of_rows.chunks_exact_mut(self.n_channels).zip(products) {
                        of_row[c] = product;
                    }
                }
            },
        );
        for (c, y) in y.iter_mut().enumerate() {
            let of_channel = products.iter().skip(c).step_by(self.n_channels);
            y.iter_mut().zip(of_channel).for_each(|(y, product)| *y -= product);
        }
    }

    /// Subtracts K x of channel c from y.
    pub(super) fn subtract_channel(&self, c: usize, x: &[f64], y: &mut [f64]) {
        threads::for_each_chunk(threads::pay(self.n_terms / self.n_channels), y, ROWS_AT_ONCE, |k, y| {
            let products = self.dots(ROWS_AT_ONCE * k, c, x);
            y.iter_mut().zip(products).for_each(|(y, product)| *y -= product);
        });
    }

    /// Returns (K x)_i in channel c for the rows from `first` on, as many as there are.
    fn dots(&self, first: usize, c: usize, x: &[f64]) -> [f64; ROWS_AT_ONCE] {
        let place = |k: usize| (first + k).min(self.n_rows() - 1);
        let rows = std::array::from_fn(|k| self.row(place(k), c));
        for next in first + ROWS_AT_ONCE..self.n_rows().min(first + 2 * ROWS_AT_ONCE) {
            self.row(next, c).values.announce();
        }
        let products = match rows.map(Row::begin_of_many) {
            [Some(a), Some(b), Some(c), Some(d)] => {
                let (begins, all) = ([a, b, c, d], a.max(b).max(c).max(d));
                let mut sums = products(std::array::from_fn(|k| (&rows[k].values, all - begins[k])), &x[all..]);
                for k in 0..ROWS_AT_ONCE {
                    sums[k] += rows[k].values.product(0..all - begins[k], &x[begins[k]..all]);
                }
                sums
            }
            _ => rows.map(|row| row.dot(x)),
        };
        std::array::from_fn(|k| self.slot(place(k), c).factor * products[k])
    }

    /// Makes one sweep of Gauss-Seidel over u = f + K u in channel c.
    ///
    /// Four rows at a time are multiplied with u from before the four; the changes by the earlier rows of the four are then added to each product.
    pub(super) fn sweep(&self, c: usize, u: &mut [f64], f: &[f64]) -> Swept {
        let n = u.len();
        let mut swept = Swept {
            changes: vec![0.0; n],
            left: Vec::new(),
        };
        for first in (0..n).step_by(ROWS_AT_ONCE) {
            let products = self.dots(first, c, u);
            let changes = &mut swept.changes[first..n.min(first + ROWS_AT_ONCE)];
            for k in 0..ROWS_AT_ONCE.min(n - first) {
                let i = first + k;
                let (slot, row) = (self.slot(i, c), self.row(i, c));
                let near = row.near(first);
                let k_ii = slot.factor * near[k];
                let diagonal = 1.0 - k_ii;
                let changed: f64 = near[..k].iter().zip(&*changes).map(|(a, change)| a * change).sum();
                let gathered = products[k] + slot.factor * changed - k_ii * u[i];
                if diagonal > 0.0 {
                    let new = (f[i] + gathered) / diagonal;
                    changes[k] = new - u[i];
                    u[i] = new;
                } else {
                    swept.left.push((i, f[i] + gathered - diagonal * u[i]));
                }
            }
        }
        swept
    }

    /// Returns the multiplications of K x, the mean over the channels.
    pub(super) fn multiply_adds(&self) -> f64 {
        self.n_terms as f64 / self.n_channels as f64
    }
}

/// Makes the rows of a coarse level.
///
/// `slot(i, c)` is the position of ρ in row i; `add(i, c, factor, sum)` adds the row and returns its number of entries.
fn restrict(
    coarsening: &Coarsening,
    n_channels: usize,
    wanted: Wanted,
    slot: impl Fn(usize, usize) -> Slot + Sync,
    add: impl Fn(usize, usize, f64, &mut [f64]) -> usize + Sync,
) -> Restricted {
    let mut slots = Vec::with_capacity(coarsening.n_coarse() * n_channels);
    // The rows to make: coarse patch, a channel that uses it, and whether for that alone.
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
    let n_fine = coarsening.n_fine();
    let make = |k: usize| {
        let (coarse, c, own) = jobs[k];
        let mut sum = vec![0.0; n_fine];
        let mut upper = vec![0.0; if wanted.upper { n_fine } else { 0 }];
        let mut n_entries = 0;
        let children = coarsening.children(coarse);
        for (m, &i) in children.iter().enumerate() {
            let rho = if own { slot(i as usize, c).factor } else { 1.0 };
            let weight = coarsening.shares()[i as usize] * rho;
            n_entries += add(i as usize, c, weight, &mut sum);
            if wanted.upper {
                // Up to the next child, these columns are above the diagonal for all children so far and for no other.
                let end = children.get(m + 1).map_or(n_fine, |&next| next as usize + 1);
                let above = i as usize + 1..end;
                upper[above.clone()].copy_from_slice(&sum[above]);
            }
        }
        let merged = wanted.merged.then(|| {
            let mut merged = vec![0.0; coarsening.n_coarse()];
            for (&parent, value) in coarsening.parents().iter().zip(&sum) {
                merged[parent as usize] += value;
            }
            Row::new(&merged)
        });
        let row = if wanted.upper {
            Row::above_diagonal(&upper, wanted.rounded)
        } else {
            Row::new(&sum)
        };
        (row, merged, n_entries)
    };
    let made = threads::map(threads::pay(n_fine * n_fine), jobs.len(), make);
    // Where channels have rows of their own, the source is read once for each.
    let is_first = |k: &usize| *k == 0 || jobs[k - 1].0 != jobs[*k].0;
    let n_of_source = (0..made.len()).filter(is_first).map(|k| made[k].2).sum();
    let n_restricted: usize = made.iter().map(|row| row.2).sum();
    let (mut rows, mut merged) = (Vec::with_capacity(made.len()), Vec::new());
    for (row, of_merged, _) in made {
        rows.push(row);
        merged.extend(of_merged);
    }
    let matrix = |rows| Matrix::new(n_channels, rows, slots.clone());
    Restricted {
        n_added: n_restricted + merged.len() * n_fine,
        n_of_source,
        rows: matrix(rows),
        merged: wanted.merged.then(|| matrix(merged)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::hierarchy::{FaceShape, Hierarchy};

    #[test]
    fn sums_do_not_depend_on_how_a_row_is_kept() {
        let values: Vec<f64> = (0..37)
            .map(|j| if j % 3 == 0 { 0.0 } else { 1.0 / f64::from(j) })
            .collect();
        let x: Vec<f64> = (0..37).map(|j| f64::from(j) - 3.5).collect();
        let expected: f64 = values.iter().zip(&x).map(|(a, x)| a * x).sum();
        let sparse = Row::new(&values);
        assert!(matches!(sparse.columns, Columns::Listed(_)));
        // 37 terms of up to 33: rounding stays below 37 · 33 · 1.1e-16.
        assert!((sparse.dot(&x) - expected).abs() < 2e-13);
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
        let row = |i: usize| (0..n).map(|j| entry(i, j)).collect::<Vec<_>>();
        let slot = |row: u32| Slot {
            row,
            factor: 0.5 + 0.4 / f64::from(row + 1),
            own: false,
        };
        let rows = (0..n).map(|i| Row::new(&row(i))).collect();
        Matrix::new(1, rows, (0..).take(n).map(slot).collect())
    }

    #[test]
    fn a_sweep_by_fours_is_one_of_gauss_seidel() {
        // Below and above the length from which rows take wide instructions, with 0 to 3 rows left over.
        for n in [1, 5, 14, 31, 36, 37, 38, 39] {
            let k = small_matrix(n);
            assert!(n < 5 || k.rows.iter().any(|row| matches!(row.columns, Columns::Listed(_))));
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

    #[test]
    fn what_a_sweep_leaves_comes_from_what_later_rows_change() {
        for n in [5, 38] {
            let mut k = small_matrix(n);
            // This row cannot be mended: its diagonal is 2.
            k.slots[3].factor = 2.0 * n as f64;
            let f: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64).sin()).collect();
            let mut u: Vec<f64> = (0..n).map(|i| (i as f64).cos()).collect();
            let Swept { changes, left } = k.sweep(0, &mut u, &f);
            let unmended: Vec<usize> = left.iter().map(|&(i, _)| i).collect();
            // Rows 1, 3, 5 ... have entries at every third column only: row 3 has one at 3.
            assert_eq!(unmended, [3]);
            for i in 0..n {
                let product: f64 = (0..n).map(|j| k.at(i, j, 0) * u[j]).sum();
                let later: f64 = (i + 1..n).map(|j| k.at(i, j, 0) * changes[j]).sum();
                let own = if i == 3 { left[0].1 } else { 0.0 };
                let error = f[i] + product - u[i] - later - own;
                // Row 3 has factors of up to 2 and up to 13 terms of 1 or less; the rest as above.
                assert!(error.abs() < 1e-13, "{n}, {i}: {error:e}");
            }
        }
    }

    #[test]
    fn restricted_rows_are_means_of_all_or_of_what_is_above_the_diagonal() {
        // Coarse patches of 4, 6, 2 and 1 patches, whose rows in a grid lie apart.
        let shapes = [
            FaceShape::Quad { n_u: 5, n_v: 3 },
            FaceShape::Quad { n_u: 4, n_v: 1 },
            FaceShape::Quad { n_u: 1, n_v: 1 },
        ];
        let areas: Vec<f64> = (0..20).map(|i| 1.0 + f64::from(i % 5)).collect();
        let hierarchy = Hierarchy::of_faces(&shapes, &areas);
        let step = &hierarchy.levels()[0];
        let k = small_matrix(20);
        for (upper, rounded) in [(false, false), (true, false), (true, true)] {
            let wanted = Wanted {
                upper,
                rounded,
                merged: true,
            };
            let Restricted { rows, merged, .. } = k.restricted(step, wanted);
            let merged = merged.expect("wanted");
            for coarse in 0..step.n_coarse() {
                let mean = |j: usize, above: bool| -> f64 {
                    let children = step.children(coarse).iter().map(|&i| i as usize);
                    let of_child = |i: usize| step.shares()[i] * k.at(i, j, 0);
                    children.filter(|&i| !above || j > i).map(of_child).sum()
                };
                for j in 0..20 {
                    let (found, expected) = (rows.at(coarse, j, 0), mean(j, upper));
                    let tolerance = if rounded { 6e-8 * expected } else { 0.0 };
                    assert!((found - expected).abs() < tolerance + 1e-16, "{coarse} {j}");
                }
                for parent in 0..step.n_coarse() {
                    let columns = step.children(parent).iter();
                    let sum: f64 = columns.map(|&j| mean(j as usize, false)).sum();
                    assert!((merged.at(coarse, parent, 0) - sum).abs() < 1e-16, "{coarse} {parent}");
                }
            }
        }
    }
}
