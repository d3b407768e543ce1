//! The even light of each component, taken out of a Krylov method's way.

use super::RadiositySystem;
use super::scaled::Scaled;
use crate::matrix::operator::Block;

/// The vectors z_K = ρ^½ on component K, 0 elsewhere (an even irradiance on K), with K z_K of the symmetric matrix
/// K = I − diag(ρ)^½ F diag(ρ)^½. Light does not pass between components, so that ⟨z_K, K z_L⟩ = 0 for K ≠ L.
pub(super) struct Deflation {
    labels: Vec<u32>,
    weights: Vec<f64>,
    z: Block,
    kz: Block,
    /// 1 / ⟨z_K, K z_K⟩, \[components, c\]; 0 where the component is left alone.
    factors: Block,
    /// True if some ⟨z_K, K z_K⟩ is negative: K is not positive definite.
    pub(super) indefinite: bool,
}

/// ⟨z, K z⟩ below this share of ⟨z, z⟩ is rounding: a white, closed component, whose even light is undetermined.
const RESOLVED_FROM: f64 = 1e-14;

impl Deflation {
    /// Sets up the vectors with one pass over F. `root`: ρ^½; `weights`: A.
    pub(super) fn new(scaled: &Scaled, weights: &[f64], root: &Block) -> Self {
        let system = scaled.system;
        let components = system.components();
        let mut kz = scaled.zeros();
        system.operator().apply(system.reflectance(), &mut kz);
        for (value, z) in kz.values_mut().iter_mut().zip(root.values()) {
            *value = z * (1.0 - *value);
        }
        let mut factors = Block::zeros(components.n_components, root.n_channels());
        let mut lengths = factors.clone();
        for (i, &label) in components.labels.iter().enumerate() {
            for c in 0..root.n_channels() {
                let z = root.row(i)[c];
                factors.row_mut(label as usize)[c] += weights[i] * z * kz.row(i)[c];
                lengths.row_mut(label as usize)[c] += weights[i] * z * z;
            }
        }
        let mut indefinite = false;
        for (curvature, length) in factors.values_mut().iter_mut().zip(lengths.values()) {
            indefinite |= *curvature < -RESOLVED_FROM * length;
            let resolved = *curvature > RESOLVED_FROM * length;
            *curvature = if resolved { curvature.recip() } else { 0.0 };
        }
        Self {
            labels: components.labels.clone(),
            weights: weights.to_vec(),
            z: root.clone(),
            kz,
            factors,
            indefinite,
        }
    }

    /// Takes the even part out of the residual, and puts what it stands for into x: x ← x + Z μ, r ← r − K Z μ, ⟨z_K, r⟩ = 0.
    pub(super) fn solve(&self, x: &mut Block, residual: &mut Block) {
        let amounts = self.amounts(&self.z, residual);
        self.add(x, &self.z, &amounts, 1.0);
        self.add(residual, &self.kz, &amounts, -1.0);
    }

    /// Makes a direction conjugate to the vectors: p ← p − Σ z_K ⟨K z_K, u⟩ / ⟨z_K, K z_K⟩, u the part of p that is not yet.
    pub(super) fn project(&self, direction: &mut Block, of: &Block) {
        let amounts = self.amounts(&self.kz, of);
        self.add(direction, &self.z, &amounts, -1.0);
    }

    /// Returns ⟨v_K, u⟩ / ⟨z_K, K z_K⟩.
    fn amounts(&self, vectors: &Block, u: &Block) -> Block {
        let mut sums = Block::zeros(self.factors.n_rows(), self.factors.n_channels());
        for (i, (&label, weight)) in self.labels.iter().zip(&self.weights).enumerate() {
            let terms = vectors.row(i).iter().zip(u.row(i));
            for (sum, (a, b)) in sums.row_mut(label as usize).iter_mut().zip(terms) {
                *sum += weight * a * b;
            }
        }
        super::vectors::scale(&mut sums, &self.factors);
        sums
    }

    fn add(&self, to: &mut Block, vectors: &Block, amounts: &Block, sign: f64) {
        for (i, &label) in self.labels.iter().enumerate() {
            let terms = vectors.row(i).iter().zip(amounts.row(label as usize));
            for (value, (v, amount)) in to.row_mut(i).iter_mut().zip(terms) {
                *value += sign * amount * v;
            }
        }
    }
}

/// Returns the greatest area-weighted mean reflectance of the components that emit.
pub(super) fn greatest_mean_reflectance(system: &RadiositySystem) -> f64 {
    let (components, n_channels) = (system.components(), system.n_channels());
    let mut reflecting = vec![0.0; components.n_components * n_channels];
    let mut emits = vec![false; components.n_components * n_channels];
    let mut areas = vec![0.0; components.n_components];
    // A power of two, so that areas in any unit can be summed.
    let per_unit = system.area_unit().recip();
    let rows = system.reflectance().values().chunks_exact(n_channels);
    let rows = rows.zip(system.exitance().values().chunks_exact(n_channels));
    for ((&label, area), (rho, exitance)) in components.labels.iter().zip(system.areas()).zip(rows) {
        areas[label as usize] += area * per_unit;
        for c in 0..n_channels {
            reflecting[label as usize * n_channels + c] += area * per_unit * rho[c];
            emits[label as usize * n_channels + c] |= exitance[c].abs() > 0.0;
        }
    }
    let mean = |(k, sum): (usize, &f64)| sum / areas[k / n_channels];
    let lit = reflecting.iter().enumerate().filter(|(k, _)| emits[*k]);
    lit.map(mean).fold(0.0, f64::max)
}
