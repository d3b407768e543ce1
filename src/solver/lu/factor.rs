//! The factorisation, block by block.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]
#![expect(
    clippy::inline_always,
    reason = "what is not inlined is not compiled for the instruction set"
)]

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::update::{ROWS, Strip, Update, exchange, pack};

/// The columns of a block; a multiple of [`ROWS`] and of the columns of a tile, as is its half.
///
/// Fewer make more passes over the matrix, more leave more work to the thread that factors a block.
pub(super) const PANEL: usize = 192;

/// Columns that a thread updates at once: their part of U stays in the second-level cache.
pub(super) const WIDTH: usize = 96;

/// Strips that a thread copies at once.
const COPIED: usize = 32;

/// Factors the columns of a matrix, \[n, n\], in place.
///
/// Returns the row with which each row is exchanged, in turn.
pub(super) fn factor(values: &mut [f64], n: usize, arch: Arch) -> Vec<usize> {
    let factoring = Factoring { n, arch };
    let mut exchanges = vec![0; n];
    if n <= PANEL {
        factoring.panel(values, 0, &mut exchanges, &mut Vec::new());
    } else {
        // All in one scope: it is entered once, not for each block.
        rayon::scope(|_| factoring.all(values, &mut exchanges));
    }
    exchanges
}

/// What is the same for all blocks of a matrix.
struct Factoring {
    n: usize,
    arch: Arch,
}

impl Factoring {
    /// Factors more than one block.
    fn all(&self, values: &mut [f64], exchanges: &mut [usize]) {
        let n = self.n;
        let (mut strips, mut inner_strips) = (Vec::new(), Vec::new());
        self.panel(&mut values[..PANEL * n], 0, &mut exchanges[..PANEL], &mut inner_strips);
        for end in (PANEL..n).step_by(PANEL) {
            let first = end - PANEL;
            let (done, trailing) = values.split_at_mut(end * n);
            self.copy(&done[first * n..], first, &mut strips);
            let (known, unknown) = exchanges.split_at_mut(end);
            let known = &known[first..];
            let width = PANEL.min(n - end);
            let (next, rest) = trailing.split_at_mut(width * n);
            rayon::join(
                || {
                    self.update(&strips, known, first, next);
                    self.panel(next, end, &mut unknown[..width], &mut inner_strips);
                },
                || self.update(&strips, known, first, rest),
            );
        }
        let panels = values.par_chunks_mut(PANEL * n).enumerate();
        panels.for_each(|(p, panel)| {
            let end = n.min((p + 1) * PANEL);
            for column in panel.chunks_exact_mut(n) {
                exchange(column, end, &exchanges[end..]);
            }
        });
    }

    /// Factors columns whose diagonal begins in row `first`, by halves.
    ///
    /// Sets `exchanges`, of which there is one for each column.
    fn panel(&self, panel: &mut [f64], first: usize, exchanges: &mut [usize], strips: &mut Vec<Strip>) {
        let n = self.n;
        let width = exchanges.len();
        if width <= ROWS {
            return self.arch.dispatch(Narrow {
                n,
                panel,
                first,
                exchanges,
            });
        }
        let half = (width / 2).next_multiple_of(ROWS);
        let (left, right) = panel.split_at_mut(half * n);
        let (left_exchanges, right_exchanges) = exchanges.split_at_mut(half);
        self.panel(left, first, left_exchanges, strips);
        self.copy(left, first, strips);
        self.update(strips, left_exchanges, first, right);
        self.panel(right, first + half, right_exchanges, strips);
        for column in left.chunks_exact_mut(n) {
            exchange(column, first + half, right_exchanges);
        }
    }

    /// Sets `strips` to those of factored columns.
    fn copy(&self, panel: &[f64], first: usize, strips: &mut Vec<Strip>) {
        let n = self.n;
        let depth = panel.len() / n;
        strips.resize((n - first).div_ceil(ROWS) * depth, [0.0; ROWS]);
        if strips.len() <= COPIED * depth {
            return pack(panel, n, first, strips, 0);
        }
        let parts = strips.par_chunks_mut(COPIED * depth).enumerate();
        parts.for_each(|(part, strips)| pack(panel, n, first, strips, part * COPIED));
    }

    /// Updates columns by a factored block.
    fn update(&self, strips: &[Strip], exchanges: &[usize], first: usize, columns: &mut [f64]) {
        let n = self.n;
        let update = |columns: &mut [f64]| {
            self.arch.dispatch(Update {
                strips,
                exchanges,
                first,
                n,
                columns,
            });
        };
        if columns.len() <= WIDTH * n {
            return update(columns);
        }
        columns.par_chunks_mut(WIDTH * n).for_each(update);
    }
}

/// At most [`ROWS`] columns, to be factored column by column.
struct Narrow<'a> {
    n: usize,
    panel: &'a mut [f64],
    first: usize,
    exchanges: &'a mut [usize],
}

impl WithSimd for Narrow<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self {
            n,
            panel,
            first,
            exchanges,
        } = self;
        for (k, exchanged) in exchanges.iter_mut().enumerate() {
            let row = first + k;
            let other = row + greatest(&panel[k * n + row..(k + 1) * n]);
            *exchanged = other;
            for column in panel.chunks_exact_mut(n) {
                column.swap(row, other);
            }
            let (left, right) = panel.split_at_mut((k + 1) * n);
            let (pivot, l) = left[k * n + row..].split_at_mut(1);
            for l in &mut *l {
                *l /= pivot[0];
            }
            for column in right.chunks_exact_mut(n) {
                let u = -column[row];
                for (x, l) in column[row + 1..].iter_mut().zip(&*l) {
                    *x = l.mul_add(u, *x);
                }
            }
        }
    }
}

/// Returns the index of the first number of the greatest magnitude, or 0 if all are NaN.
///
/// NaN is skipped.
#[inline(always)]
fn greatest(values: &[f64]) -> usize {
    let greater = |a: f64, b: f64| if b.abs() > a { b.abs() } else { a };
    let (whole, rest) = values.as_chunks::<ROWS>();
    let mut lanes = [0.0; ROWS];
    for chunk in whole {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane = greater(*lane, *value);
        }
    }
    let greatest = lanes.iter().chain(rest).fold(0.0, |a, b| greater(a, *b));
    values.iter().position(|value| value.abs() >= greatest).unwrap_or(0)
}
