//! Exact solutions, and the allowed errors of others.

use crate::matrix::operator::{Block, LinearOperator};
use crate::solver::RadiositySystem;
use crate::solver::lu::{Dense, Lu};

/// The exact solution of a system, by a factorisation and refinement with residuals in twice the precision.
pub(super) struct Oracle {
    /// The radiosities B*, W·m⁻², \[n, c\].
    pub(super) radiosity: Block,
    /// The factor sqrt(Σ A v²) for each channel, v = G⁻¹ 1: with |r| ≤ m the error is at most m times that, if G is an M-matrix.
    pub(super) amplification: Vec<f64>,
    /// True if G⁻¹ 1 ≥ 0 in every channel: otherwise G is not an M-matrix, and the system not one of light.
    pub(super) of_light: bool,
}

/// The steps of refinement; each gains as many digits as the factorisation has, at least four at 1 − ρ = 1e-12.
const STEPS: usize = 6;

impl Oracle {
    /// Solves a system whose operator has rows and whose solution is unique, or has the mean zero in a single component that is `white`.
    pub(super) fn new(system: &RadiositySystem, white: bool) -> Self {
        let (n, n_channels) = (system.n_patches(), system.n_channels());
        let rows = dense(system.operator());
        let total: f64 = system.areas().iter().sum();
        let mut radiosity = Block::zeros(n, n_channels);
        let (mut amplification, mut of_light) = (Vec::new(), true);
        for c in 0..n_channels {
            let rho = |i: usize| system.reflectance().row(i)[c];
            let even = |j: usize| if white { system.areas()[j] / total } else { 0.0 };
            let entry = |i: usize, j: usize| f64::from(u8::from(i == j)) - rho(i) * rows[i][j] + even(j);
            let lu = Lu::new(Dense::from_fn(n, entry));
            let solve = |exitance: &dyn Fn(usize) -> f64| {
                let mut b = vec![0.0; n];
                for _ in 0..STEPS {
                    let residual = |i: usize| {
                        let mut sum = Precise::default();
                        sum.add(exitance(i));
                        sum.add(-b[i]);
                        for (j, f) in rows[i].iter().enumerate() {
                            // The product ρ F is rounded in `entry`, but not here: only the factorisation is less accurate for it.
                            sum.add_product3(rho(i), *f, b[j]);
                        }
                        for (j, value) in b.iter().enumerate().filter(|_| white) {
                            sum.add_product(-even(j), *value);
                        }
                        sum.value()
                    };
                    let mut step: Vec<f64> = (0..n).map(residual).collect();
                    lu.solve(&mut step);
                    b.iter_mut().zip(step).for_each(|(b, d)| *b += d);
                }
                b
            };
            let b = solve(&|i| system.exitance().row(i)[c]);
            let v = solve(&|_| 1.0);
            of_light &= v.iter().all(|v| *v >= 0.0);
            let squares: f64 = system.areas().iter().zip(&v).map(|(a, v)| a * v * v).sum();
            amplification.push(squares.sqrt());
            (0..n).for_each(|i| radiosity.row_mut(i)[c] = b[i]);
        }
        Self {
            radiosity,
            amplification,
            of_light,
        }
    }
}

/// Returns all entries of F.
pub(super) fn dense(operator: &dyn LinearOperator) -> Vec<Vec<f64>> {
    let n = operator.n_rows();
    let row = |i: usize| {
        let mut row = vec![0.0; n];
        if let Some(rows) = operator.rows() {
            rows.visit_row(i, &mut |j, f| row[j] = f);
        }
        row
    };
    (0..n).map(row).collect()
}

/// A sum in twice the precision (Ogita, Rump and Oishi, "Accurate sum and dot product", SIAM J. Sci. Comput. 26, 2005, algorithm 5.3).
#[derive(Default)]
struct Precise {
    high: f64,
    low: f64,
}

impl Precise {
    fn add(&mut self, x: f64) {
        let sum = self.high + x;
        let part = sum - self.high;
        self.low += (self.high - (sum - part)) + (x - part);
        self.high = sum;
    }

    fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.low += a.mul_add(b, -product);
        self.add(product);
    }

    fn add_product3(&mut self, a: f64, b: f64, c: f64) {
        let product = a * b;
        let rest = a.mul_add(b, -product);
        self.low += rest * c;
        self.add_product(product, c);
    }

    fn value(&self) -> f64 {
        self.high + self.low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_that_cancel_keep_their_digits() {
        let mut sum = Precise::default();
        sum.add(1.0);
        sum.add_product3(-0.1, 0.1, 100.0);
        // 1 − 100 fl(0.1)², exactly: fl(0.1) = 0.1 (1 + 5.551e-17).
        assert!(
            (sum.value() + 1.110_223_024_625_156_5e-16).abs() < 1e-30,
            "{:e}",
            sum.value()
        );
    }
}
