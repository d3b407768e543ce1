//! An interval of the eigenvalues of diag(ρ) F, from a few passes.

use super::scaled::{Scaled, l2};
use super::vectors::{inner, scale};
use crate::matrix::operator::Block;

/// Returns for each channel an interval that very likely holds the eigenvalues of diag(ρ) F, from `n_steps` steps of Lanczos' method.
///
/// Where A_i F_ij is symmetric, T = diag(ρ)^½ F diag(ρ)^½ has the same eigenvalues and is symmetric in ⟨u, v⟩ = Σ A u v. The Ritz
/// values of a Krylov space lie inside the spectrum; each has an eigenvalue within its residual |β y|, y the last component of its vector. The interval reaches from the
/// least Ritz value less its residual to the greatest plus its own. An eigenvalue outside it would need a start vector with next to
/// none of its eigenvector, and the start vector has a share of all. All vectors are kept orthogonal to one another.
///
/// `areas`: the A of the inner product, \[n\]. Memory: `n_steps` vectors. Work: `n_steps` passes.
/// Source: Golub and Van Loan, "Matrix Computations", 4th edition, section 10.1. Departures: none.
pub(super) fn ranges(scaled: &Scaled, areas: &[f64], n_steps: usize) -> Vec<(f64, f64)> {
    let system = scaled.system;
    let n_channels = system.n_channels();
    let weights: Vec<f64> = areas.iter().map(|a| a / system.area_unit()).collect();
    let mut root = system.reflectance().clone();
    root.values_mut().iter_mut().for_each(|rho| *rho = rho.sqrt());
    let mut vectors: Vec<Block> = Vec::new();
    let mut next = root.clone();
    for i in 0..next.n_rows() {
        // Fractions of the golden ratio: a share of everything, the slowest mode foremost.
        let share = 0.5 + (i as f64 * 0.618_033_988_749_894_9).fract();
        next.row_mut(i).iter_mut().for_each(|value| *value *= share);
    }
    let mut norms = l2(&weights, &next);
    let mut tridiagonal = vec![Tridiagonal::default(); n_channels];
    let mut image = scaled.zeros();
    for _ in 0..n_steps {
        for (value, norm) in next.values_mut().iter_mut().zip(norms.iter().cycle()) {
            *value = if *norm > 0.0 { *value / norm } else { 0.0 };
        }
        vectors.push(next);
        let newest = &vectors[vectors.len() - 1];
        let mut scratch = newest.clone();
        scale(&mut scratch, &root);
        system.operator().apply(&scratch, &mut image);
        scale(&mut image, &root);
        let alpha = inner(&weights, newest, &image);
        next = image.clone();
        // Twice is enough to be orthogonal to rounding.
        for vector in vectors.iter().chain(&vectors) {
            let shares = inner(&weights, vector, &next);
            let terms = vector.values().iter().zip(shares.iter().cycle());
            for (value, (v, share)) in next.values_mut().iter_mut().zip(terms) {
                *value -= share * v;
            }
        }
        let lengths = l2(&weights, &next);
        for (c, t) in tridiagonal.iter_mut().enumerate().filter(|(_, t)| !t.is_complete) {
            t.diagonal.push(alpha[c]);
            t.beside.push(lengths[c]);
            // The rest is rounding: the space holds all modes of the start vector.
            t.is_complete = lengths[c] <= 1e-13;
        }
        norms = (0..n_channels)
            .map(|c| if tridiagonal[c].is_complete { 0.0 } else { lengths[c] })
            .collect();
    }
    tridiagonal.iter().map(Tridiagonal::range).collect()
}

/// The tridiagonal matrix in the Krylov space: `beside[k]` is its entry (k, k + 1); the last one leads out of the space.
#[derive(Clone, Debug, Default)]
struct Tridiagonal {
    diagonal: Vec<f64>,
    beside: Vec<f64>,
    is_complete: bool,
}

impl Tridiagonal {
    /// Returns the least and the greatest Ritz value, each with its residual added outwards.
    fn range(&self) -> (f64, f64) {
        let n = self.diagonal.len();
        let (Some(last), true) = (self.beside.last(), n > 0) else {
            return (0.0, 0.0);
        };
        let (least, greatest) = (self.eigenvalue(0), self.eigenvalue(n - 1));
        (
            least - last * self.last_component(least),
            greatest + last * self.last_component(greatest),
        )
    }

    /// Returns the number of eigenvalues below x: the negative pivots of T − x (Sturm).
    fn n_below(&self, x: f64) -> usize {
        let (mut count, mut pivot) = (0, 1.0);
        for (k, d) in self.diagonal.iter().enumerate() {
            let b = if k == 0 { 0.0 } else { self.beside[k - 1] };
            pivot = d - x - b * b / pivot;
            if pivot.abs() < f64::MIN_POSITIVE {
                pivot = -f64::MIN_POSITIVE;
            }
            count += usize::from(pivot < 0.0);
        }
        count
    }

    /// Returns the eigenvalue with `rank` others below it, by bisection.
    fn eigenvalue(&self, rank: usize) -> f64 {
        let inside = &self.beside[..self.beside.len() - 1];
        let size = |values: &[f64]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let bound = size(&self.diagonal) + 2.0 * size(inside);
        let (mut low, mut high) = (-bound, bound);
        while high - low > 1e-15 * bound {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.n_below(middle) > rank {
                high = middle;
            } else {
                low = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Returns the last component, in size, of the unit vector that belongs to an eigenvalue: two steps of inverse iteration.
    fn last_component(&self, eigenvalue: f64) -> f64 {
        let n = self.diagonal.len();
        // A shift a little off, so that the system can be solved.
        let size = self.diagonal.iter().fold(1e-300_f64, |m, d| m.max(d.abs()));
        let shift = eigenvalue + 1e-13 * size;
        let mut x = vec![1.0; n];
        for _ in 0..3 {
            self.solve(shift, &mut x);
            let norm = x.iter().map(|v| v * v).sum::<f64>().sqrt();
            for v in &mut x {
                *v /= norm;
            }
        }
        x[n - 1].abs().min(1.0)
    }

    /// Solves (T − shift) x = x by elimination without pivoting; a zero pivot is replaced by rounding.
    fn solve(&self, shift: f64, x: &mut [f64]) {
        let n = x.len();
        let mut pivots = vec![0.0; n];
        for k in 0..n {
            let factor = if k == 0 {
                0.0
            } else {
                self.beside[k - 1] / pivots[k - 1]
            };
            pivots[k] = self.diagonal[k] - shift;
            if k > 0 {
                pivots[k] -= factor * self.beside[k - 1];
                x[k] -= factor * x[k - 1];
            }
            if pivots[k].abs() < 1e-300 {
                pivots[k] = 1e-300;
            }
        }
        for k in (0..n).rev() {
            let above = if k + 1 < n { self.beside[k] * x[k + 1] } else { 0.0 };
            x[k] = (x[k] - above) / pivots[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extremes_of_a_known_matrix() {
        // The second difference of n points: eigenvalues 2 − 2 cos(k π / (n + 1)).
        let n = 12;
        let t = Tridiagonal {
            diagonal: vec![2.0; n],
            beside: vec![-1.0; n],
            is_complete: false,
        };
        let exact = |k: f64| 2.0 - 2.0 * (k * std::f64::consts::PI / 13.0).cos();
        assert!((t.eigenvalue(0) - exact(1.0)).abs() < 1e-14);
        assert!((t.eigenvalue(n - 1) - exact(12.0)).abs() < 1e-14);
        // Its vectors are sines: the last component is sqrt(2 / 13) sin(π / 13).
        let last = (2.0_f64 / 13.0).sqrt() * (std::f64::consts::PI / 13.0).sin();
        assert!((t.last_component(t.eigenvalue(0)) - last).abs() < 1e-9);
        assert!((t.last_component(t.eigenvalue(n - 1)) - last).abs() < 1e-9);
    }
}
