//! The update of columns by a factored block, in which nearly all multiplications of the
//! factorisation are.
//!
//! L is copied in strips of [`ROWS`] rows and U in strips of [`COLUMNS`] columns, so that a tile of
//! the product has its sums in registers and reads both in the order of memory. Strips of L that
//! make [`BLOCK`] remain in the second-level cache while all columns meet them.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::{Simd, WithSimd};

/// The rows of a tile: two registers of AVX-512.
pub(super) const ROWS: usize = 16;

/// The columns of a tile.
pub(super) const COLUMNS: usize = 12;

/// Strips of L that are multiplied with all columns before the next: 600 kB for the widest block.
pub(super) const BLOCK: usize = 24;

/// The entries of one column of L in a strip.
pub(super) type Strip = [f64; ROWS];

type Tile = [[f64; ROWS]; COLUMNS];

/// Copies strips of the columns of L in `panel`, whose first diagonal entry is in row `first`.
///
/// Strip s holds the rows from `first` + s [`ROWS`], for each column of the panel in turn; the
/// first of `strips` is `first_strip`. U, the diagonal and rows below the matrix become 0.
pub(super) fn pack(panel: &[f64], n: usize, first: usize, strips: &mut [Strip], first_strip: usize) {
    let depth = panel.len() / n;
    for (s, strip) in (first_strip..).zip(strips.chunks_exact_mut(depth)) {
        let begin = first + s * ROWS;
        let rows = begin..n.min(begin + ROWS);
        for (k, (to, column)) in strip.iter_mut().zip(panel.chunks_exact(n)).enumerate() {
            let from = &column[rows.clone()];
            if let Ok(whole) = from.try_into() {
                *to = whole;
            } else {
                to.fill(0.0);
                to[..from.len()].copy_from_slice(from);
            }
            let n_above = (k + 1).saturating_sub(s * ROWS).min(ROWS);
            to[..n_above].fill(0.0);
        }
    }
}

/// Updates the columns right of a factored block.
///
/// Exchanges rows, and sets U = L₁₁⁻¹ A₁ and A₂ ← A₂ − L₂₁ U, where A₁ are the rows of the block and
/// A₂ those below. Each sum is over the columns of the block in ascending order.
pub(super) struct Update<'a> {
    /// The block as [`pack`] copied it; a multiple of [`ROWS`] columns.
    pub(super) strips: &'a [Strip],
    /// The row with which each row of the block was exchanged, in turn.
    pub(super) exchanges: &'a [usize],
    /// The first row of the block.
    pub(super) first: usize,
    /// The number of rows of the matrix.
    pub(super) n: usize,
    pub(super) columns: &'a mut [f64],
}

impl WithSimd for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // As many sums as there are registers for: 32 with AVX-512 and NEON, 16 with AVX2.
        match S::F64_LANES {
            8 => self.run::<S, 2, 12>(simd),
            2 => self.run::<S, 4, 6>(simd),
            _ => self.run::<S, 2, 6>(simd),
        }
    }
}

impl Update<'_> {
    /// Keeps the sums of R registers' rows and C columns in registers.
    #[inline(always)]
    fn run<S: Simd, const R: usize, const C: usize>(self, simd: S) {
        let depth = self.exchanges.len();
        for column in self.columns.chunks_exact_mut(self.n) {
            exchange(column, self.first, self.exchanges);
        }
        let mut u = vec![[0.0; COLUMNS]; depth * self.columns.len().div_ceil(COLUMNS * self.n)];
        let strips: Vec<&[Strip]> = self.strips.chunks_exact(depth).collect();
        let (upper, lower) = strips.split_at(depth / ROWS);
        let mut tile = [[0.0; ROWS]; COLUMNS];
        for (u, columns) in u.chunks_exact_mut(depth).zip(self.columns.chunks_mut(COLUMNS * self.n)) {
            for (s, l) in upper.iter().enumerate() {
                let begin = s * ROWS;
                let (solved, unsolved) = u.split_at_mut(begin);
                multiply::<S, R, C>(simd, &l[..begin], solved, &mut tile);
                let rows = self.first + begin..self.first + begin + ROWS;
                for (column, x) in columns.chunks_exact(self.n).zip(&mut tile) {
                    let entries = &column[rows.clone()];
                    for (x, entry) in x.iter_mut().zip(entries) {
                        *x = entry - *x;
                    }
                }
                substitute(&l[begin..begin + ROWS], &mut tile);
                for (k, u) in unsolved[..ROWS].iter_mut().enumerate() {
                    for (u, x) in u.iter_mut().zip(&tile) {
                        *u = x[k];
                    }
                }
                for (column, x) in columns.chunks_exact_mut(self.n).zip(&tile) {
                    column[rows.clone()].copy_from_slice(x);
                }
            }
        }
        let mut begin = self.first + depth;
        for block in lower.chunks(BLOCK) {
            for (u, columns) in u.chunks_exact(depth).zip(self.columns.chunks_mut(COLUMNS * self.n)) {
                for (s, l) in block.iter().enumerate() {
                    multiply::<S, R, C>(simd, l, u, &mut tile);
                    let row = begin + s * ROWS;
                    for (column, product) in columns.chunks_exact_mut(self.n).zip(&tile) {
                        subtract(&mut column[row..self.n.min(row + ROWS)], product);
                    }
                }
            }
            begin += BLOCK * ROWS;
        }
    }
}

/// Exchanges entries of a column from `first` on with others, in turn.
#[inline(always)]
pub(super) fn exchange(column: &mut [f64], first: usize, exchanges: &[usize]) {
    for (k, &other) in (first..).zip(exchanges) {
        column.swap(k, other);
    }
}

/// Subtracts a column of a tile; the last rows of a matrix may be fewer.
#[inline(always)]
fn subtract(rows: &mut [f64], product: &Strip) {
    if let Ok(whole) = <&mut Strip>::try_from(&mut *rows) {
        for (x, product) in whole.iter_mut().zip(product) {
            *x -= product;
        }
    } else {
        for (x, product) in rows.iter_mut().zip(product) {
            *x -= product;
        }
    }
}

/// Solves L x = `tile` in place, where L is a unit triangle with zeros on its diagonal and above.
#[inline(always)]
fn substitute(l: &[Strip], tile: &mut Tile) {
    for (k, l) in l.iter().enumerate() {
        for x in tile.iter_mut() {
            let x_k = -x[k];
            for (x, l) in x.iter_mut().zip(l) {
                *x = l.mul_add(x_k, *x);
            }
        }
    }
}

/// Sets a tile to the product of a strip of L with a strip of U.
///
/// Takes parts of R registers by C columns, whose sums remain in registers.
#[inline(always)]
fn multiply<S: Simd, const R: usize, const C: usize>(simd: S, l: &[Strip], u: &[[f64; COLUMNS]], tile: &mut Tile) {
    for column in (0..COLUMNS).step_by(C) {
        for register in (0..ROWS / S::F64_LANES).step_by(R) {
            let mut sums = [[simd.splat_f64s(0.0); R]; C];
            for (l, u) in l.iter().zip(u) {
                let l = &S::as_simd_f64s(l).0[register..register + R];
                let u = &u[column..column + C];
                for c in 0..C {
                    let u = simd.splat_f64s(u[c]);
                    for r in 0..R {
                        sums[c][r] = simd.mul_add_f64s(l[r], u, sums[c][r]);
                    }
                }
            }
            for (x, sums) in tile[column..column + C].iter_mut().zip(&sums) {
                S::as_mut_simd_f64s(x).0[register..register + R].copy_from_slice(sums);
            }
        }
    }
}
