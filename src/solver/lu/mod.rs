//! Dense LU factorisation, for `direct`, for the coarsest level of `multigrid` and for the oracle
//! of the experiment `stability`.

mod factor;
mod substitution;
#[cfg(test)]
mod tests;
mod update;

use pulp::Arch;

/// A square matrix, its columns one after the other.
pub(crate) struct Dense {
    n: usize,
    values: Vec<f64>,
}

impl Dense {
    /// Returns the matrix of zeros, \[n, n\].
    pub(crate) fn zeros(n: usize) -> Self {
        Self {
            n,
            values: vec![0.0; n * n],
        }
    }

    /// Returns the matrix, \[n, n\], of the entries of each row and column.
    pub(crate) fn from_fn(n: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let entry = &entry;
        Self {
            n,
            values: (0..n).flat_map(|j| (0..n).map(move |i| entry(i, j))).collect(),
        }
    }

    /// Returns the entry of row i and column j.
    pub(crate) fn at_mut(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.values[j * self.n + i]
    }
}

/// Factors P M = L U of a square matrix, with partial pivoting in f64.
///
/// L is unit lower triangular, U upper triangular, and P exchanges rows such that no entry of L is
/// greater than 1. The computed factors fulfil |P M − L U| ≤ n ε |L| |U|, ε = 1.1e-16, entry by
/// entry. Every sum has an order that depends on n alone, and every product is added with one
/// rounding: the bytes are the same at any number of threads and with any instruction set. A pivot
/// of 0 or an entry that is NaN makes solutions that are not finite. Infinite entries do not panic,
/// but the solutions may be finite and wrong.
///
/// Source: Golub and Van Loan, "Matrix Computations", 4th edition, section 3.4.7 (blocks), and
/// algorithm 3.4.1 within a block. Departures: the columns of a block are factored by halves
/// (Toledo, "Locality of reference in LU decomposition with partial pivoting", SIAM J. Matrix Anal.
/// Appl. 18, 1997), and the next block is factored while the columns behind it are updated.
pub(crate) struct Lu {
    /// L below the diagonal, U on and above it.
    packed: Dense,
    /// The row with which each row was exchanged, in turn.
    exchanges: Vec<usize>,
    arch: Arch,
}

impl Lu {
    /// Factors in place of `matrix`, \[n, n\].
    ///
    /// Takes n³ / 3 multiplications and, while it runs, 2300 n bytes beside the matrix.
    pub(crate) fn new(matrix: Dense) -> Self {
        Self::with(matrix, Arch::new())
    }

    /// Factors with a given instruction set.
    fn with(mut matrix: Dense, arch: Arch) -> Self {
        let exchanges = factor::factor(&mut matrix.values, matrix.n, arch);
        Self {
            packed: matrix,
            exchanges,
            arch,
        }
    }

    /// Returns n.
    pub(crate) fn n(&self) -> usize {
        self.packed.n
    }

    /// Replaces x by M⁻¹ x; `x`: \[n, k\], one column after the other.
    ///
    /// Takes n² multiplications for each column, on one thread. Each column has the bytes that it
    /// would have alone.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let n = self.n();
        if n > 0 {
            substitution::solve(&self.packed.values, &self.exchanges, x, self.arch);
        }
    }
}
