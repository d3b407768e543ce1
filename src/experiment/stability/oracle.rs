//! Exact solutions, and the allowed errors of others.

use crate::matrix::operator::Block;
use crate::solver::RadiositySystem;
use crate::solver::lu::{Dense, Lu};
use crate::solver::twofold::Twofold;

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
        let rows = system.operator().rows().expect("all cases have rows");
        let total: f64 = system.areas().iter().sum();
        let mut radiosity = Block::zeros(n, n_channels);
        let (mut amplification, mut of_light) = (Vec::new(), true);
        for c in 0..n_channels {
            let rho = |i: usize| system.reflectance().row(i)[c];
            let even = |j: usize| if white { system.areas()[j] / total } else { 0.0 };
            let mut matrix = Dense::from_fn(n, |i, j| f64::from(u8::from(i == j)) + even(j));
            for i in 0..n {
                rows.visit_row(i, &mut |j, f| *matrix.at_mut(i, j) -= rho(i) * f);
            }
            let lu = Lu::new(matrix);
            let solve = |exitance: &[f64]| {
                let mut b = vec![0.0; n];
                for _ in 0..STEPS {
                    let mean: f64 = b.iter().enumerate().map(|(j, b)| even(j) * b).sum();
                    let mut step = residuals(system, c, exitance, &b);
                    for r in &mut step {
                        *r -= mean;
                    }
                    lu.solve(&mut step);
                    b.iter_mut().zip(step).for_each(|(b, d)| *b += d);
                }
                b
            };
            let b = solve(&system.exitance().channel(c));
            let v = solve(&vec![1.0; n]);
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

/// Returns E − B + ρ F B of one channel, in twice the precision: in f64 it may be 0 by rounding alone.
pub(super) fn residuals(system: &RadiositySystem, c: usize, exitance: &[f64], radiosity: &[f64]) -> Vec<f64> {
    let rows = system.operator().rows().expect("all cases have rows");
    let of_row = |i: usize| {
        let mut irradiance = Twofold::default();
        rows.visit_row(i, &mut |j, f| irradiance.add_product(f, radiosity[j]));
        let mut residual = Twofold::default();
        residual.add_multiple(system.reflectance().row(i)[c], &irradiance);
        residual.add(exitance[i]);
        residual.add(-radiosity[i]);
        residual.value()
    };
    (0..system.n_patches()).map(of_row).collect()
}
