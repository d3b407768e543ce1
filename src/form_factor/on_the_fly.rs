//! Form factors that are not stored.

use std::ops::Range;

use super::{FormFactorMethod, Input};
use crate::matrix::RowTile;
use crate::matrix::operator::{Block, LinearOperator, RowAccess};
use crate::threads;

/// The rows `range` of the form factors, computed anew.
pub(super) type Rows<'a> = Box<dyn Fn(Range<usize>) -> RowTile + Sync + 'a>;

/// The form factors of a scene as an operator that computes them again, row by row, whenever it is applied.
///
/// Memory: 16 rows for each thread instead of n². Time: a pass costs as much as computing all form factors, once for all channels, so that a solver of k passes takes about k + 2 times
/// as long as with stored ones (the row sums take one pass, and the final check another). The bytes are those of the stored form factors in f64: every row has the same numbers in every pass. It works with every solver that needs
/// neither symmetric exchange areas nor a factorisation; `gauss-seidel` computes one row at a time, and so on one thread.
///
/// Source: Lewis 1992, section 6.2. Departures: none.
pub struct OnTheFly<'a> {
    n: usize,
    rows: Rows<'a>,
}

/// The number of rows that are computed as one piece of parallel work.
const ROWS_PER_TILE: usize = 16;

impl<'a> OnTheFly<'a> {
    /// Returns the operator, or `None` for methods that compute pairs of patches rather than rows.
    #[must_use]
    pub fn new(method: &'a dyn FormFactorMethod, input: Input<'a>) -> Option<Self> {
        Some(Self {
            n: input.mesh.n_patches(),
            rows: method.rows(input)?,
        })
    }
}

impl OnTheFly<'_> {
    /// Sets `y` to the products of some rows, from the one `first` on, with x.
    fn apply_from(&self, first: usize, x: &Block, y: &mut [f64]) {
        let n_channels = x.n_channels();
        threads::for_each_chunk(true, y, ROWS_PER_TILE * n_channels, |k, sums| {
            let begin = first + k * ROWS_PER_TILE;
            let tile = (self.rows)(begin..begin + sums.len() / n_channels);
            for (row, sum) in sums.chunks_exact_mut(n_channels).enumerate() {
                sum.fill(0.0);
                for &(j, f, _) in tile.row(row) {
                    for (s, x_j) in sum.iter_mut().zip(x.row(j as usize)) {
                        *s += f * x_j;
                    }
                }
            }
        });
    }
}

impl LinearOperator for OnTheFly<'_> {
    fn n_rows(&self) -> usize {
        self.n
    }

    #[track_caller]
    fn apply(&self, x: &Block, y: &mut Block) {
        let n_channels = x.n_channels();
        assert!(x.n_rows() == self.n, "x has one row per patch");
        assert!(
            y.n_rows() == self.n && y.n_channels() == n_channels,
            "y has the shape of x"
        );
        self.apply_from(0, x, y.values_mut());
    }

    fn share_of_pass(&self, x: &Block, rank: usize, n_ranks: usize) -> Option<Vec<f64>> {
        let n_tiles = self.n.div_ceil(ROWS_PER_TILE);
        let first_of = |number: usize| self.n.min(n_tiles * number / n_ranks * ROWS_PER_TILE);
        let (first, end) = (first_of(rank), first_of(rank + 1));
        let mut sums = vec![0.0; (end - first) * x.n_channels()];
        self.apply_from(first, x, &mut sums);
        Some(sums)
    }

    fn end_pass(&self, shares: &[f64], y: &mut Block) {
        y.values_mut().copy_from_slice(shares);
    }

    fn rows(&self) -> Option<&dyn RowAccess> {
        Some(self)
    }

    fn reciprocal_areas(&self) -> Option<&[f64]> {
        None
    }
}

impl RowAccess for OnTheFly<'_> {
    #[track_caller]
    fn dot_off_diagonal(&self, i: usize, x: &Block, sum: &mut [f64]) -> f64 {
        assert!(
            x.n_rows() == self.n && x.n_channels() == sum.len(),
            "x has one row per patch, and sum one entry per channel"
        );
        let mut diagonal = 0.0;
        self.visit_row(i, &mut |j, f| {
            if i == j {
                diagonal = f;
                return;
            }
            for (s, x_j) in sum.iter_mut().zip(x.row(j)) {
                *s += f * x_j;
            }
        });
        diagonal
    }

    fn visit_row(&self, i: usize, visit: &mut dyn FnMut(usize, f64)) {
        let tile = (self.rows)(i..i + 1);
        for &(j, f, _) in tile.row(0) {
            visit(j as usize, f);
        }
    }
}
