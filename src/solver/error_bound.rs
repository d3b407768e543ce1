//! How far radiosities can be from the solution, given their residual.

use super::scaled::{Scaled, TrueResidual, l2};
use crate::matrix::operator::Block;
use crate::matrix::roundings;

/// Passes over F that may be spent on finding a vector that proves a bound.
const MAX_PASSES: usize = 16;

/// A slack below which (G v)_i may be rounding error.
const RESOLVED_FROM: f64 = 1e-12;

/// Returns a bound of ‖B − B*‖ / ‖B‖ in the norm sqrt(Σ A x²), the worst channel, or `None` if none can be proved.
///
/// Let G = I − diag(ρ) F with F ≥ 0, r = E − G B, and v > 0 any vector with G v > 0. Then G⁻¹ ≥ 0 (G is an M-matrix) and,
/// because |r| ≤ m G v with m = max_j |r_j| / (G v)_j,
///
/// |B − B*|_i = |G⁻¹ r|_i ≤ m v_i, so ‖B − B*‖ ≤ m ‖v‖.
///
/// Where A_i F_ij is symmetric, diag(ρ)F has the eigenvalues of the symmetric S = diag(ρ)^½ F diag(ρ)^½, which are at most
/// λ = max_i (ρ F v)_i / v_i (Collatz and Wielandt), ‖F‖ is at most the greatest row sum s, and
/// G⁻¹ r = r + diag(ρ)^½ (I − S)⁻¹ diag(ρ)^½ F r, so
///
/// ‖B − B*‖ ≤ ‖r‖ (1 + ρ_max s / (1 − λ)).
///
/// The smaller of the two counts. v = 1 costs nothing, as row sums are known: λ = max_i ρ_i s_i. Where that proves nothing,
/// because some patch reflects everything, v ← 1 + diag(ρ) F v looks one reflection further, one pass over F each.
/// To |r| is added what rounding can make of it, (max(16 n^½, n / 8) + 70) 2⁻⁵³ (|E| + |B| + ρ |H|) (see the operator of
/// [`FormFactors`](crate::matrix::FormFactors)), so that the bound also holds where 1 − ρ is near rounding. Accuracy: rigorous but for form factors that are negative. It bounds
/// the error of solving, not that of the form factors.
/// Source: Berman and Plemmons, "Nonnegative Matrices in the Mathematical Sciences", chapter 6, theorem 2.3, for the M-matrix.
/// Departures: none.
pub(super) fn relative(scaled: &Scaled, radiosity: &Block, truth: &TrueResidual) -> Option<f64> {
    let system = scaled.system;
    let lit: Vec<usize> = (0..system.n_channels()).filter(|&c| !scaled.is_dark(c)).collect();
    let (Some(proof), _) = Proof::find(scaled, &lit) else {
        return lit.is_empty().then_some(0.0);
    };
    let reciprocal = system.operator().reciprocal_areas().is_some_and(|areas| {
        let pairs = areas.iter().zip(system.areas());
        pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits())
    });
    let row_sum_max = system.row_sums().iter().copied().fold(0.0, f64::max);
    let residual = with_rounding(scaled, radiosity, truth);
    let (norm_r, norm_b) = (l2(&scaled.areas, &residual), l2(&scaled.areas, radiosity));
    let norm_v = l2(&scaled.areas, &proof.v);
    let mut worst: f64 = 0.0;
    for c in lit {
        let (mut m, mut lambda, mut rho_max) = (0.0_f64, 0.0_f64, 0.0_f64);
        for i in 0..system.n_patches() {
            let (v, g_v) = (proof.v.row(i)[c], proof.g_v.row(i)[c]);
            m = m.max(residual.row(i)[c] / g_v);
            lambda = lambda.max(1.0 - g_v / v);
            rho_max = rho_max.max(system.reflectance().row(i)[c]);
        }
        let mut bound = m * norm_v[c];
        if reciprocal {
            bound = bound.min(norm_r[c] * (1.0 + rho_max * row_sum_max / (1.0 - lambda)));
        }
        worst = worst.max(bound / norm_b[c]);
        if !(bound / norm_b[c]).is_finite() {
            return None;
        }
    }
    Some(worst)
}

/// Returns for each channel a bound of the eigenvalues of diag(ρ) F in absolute value, λ = max_i (ρ F v)_i / v_i with the vector v above, and the
/// passes over F that it took. A channel without light has 0, and where nothing below 1 can be proved it is 1.
pub(super) fn spectral_radius(scaled: &Scaled) -> (Vec<f64>, usize) {
    let n_channels = scaled.system.n_channels();
    let lit: Vec<usize> = (0..n_channels).filter(|&c| !scaled.is_dark(c)).collect();
    let mut radii = vec![0.0; n_channels];
    let (proof, n_passes) = Proof::find(scaled, &lit);
    for c in lit {
        radii[c] = proof.as_ref().map_or(1.0, |proof| {
            let lambda = |i: usize| 1.0 - proof.g_v.row(i)[c] / proof.v.row(i)[c];
            (0..scaled.system.n_patches()).map(lambda).fold(0.0, f64::max)
        });
    }
    (radii, n_passes)
}

/// Returns |r| and what rounding can have taken from it.
fn with_rounding(scaled: &Scaled, radiosity: &Block, truth: &TrueResidual) -> Block {
    let unit = roundings(scaled.areas.len()) * 0.5 * f64::EPSILON;
    let mut sum = scaled.exitance.clone();
    let terms = radiosity.values().iter().zip(truth.irradiance.values());
    let factors = scaled.system.reflectance().values().iter().zip(truth.residual.values());
    for ((value, (b, h)), (rho, r)) in sum.values_mut().iter_mut().zip(terms).zip(factors) {
        *value = r.abs() + unit * (value.abs() + b.abs() + rho * h.abs());
    }
    sum
}

/// A vector v > 0 with G v > 0 in every lit channel.
struct Proof {
    v: Block,
    g_v: Block,
}

impl Proof {
    /// Looks for a proof; tells also how many passes over F that took.
    fn find(scaled: &Scaled, lit: &[usize]) -> (Option<Self>, usize) {
        if lit.is_empty() {
            return (None, 0);
        }
        let system = scaled.system;
        let reflectances = system.reflectance().values();
        let products = |f_v: &Block| -> Vec<f64> {
            let pairs = reflectances.iter().zip(f_v.values());
            pairs.map(|(rho, f)| rho * f).collect()
        };
        let mut v = scaled.zeros();
        v.values_mut().fill(1.0);
        let mut f_v = scaled.zeros();
        for (i, sum) in system.row_sums().iter().enumerate() {
            f_v.row_mut(i).fill(*sum);
        }
        for n_passes in 0..MAX_PASSES {
            let mut g_v = v.clone();
            for (g, rho_f_v) in g_v.values_mut().iter_mut().zip(products(&f_v)) {
                *g -= rho_f_v;
            }
            let proves = |i: usize| lit.iter().all(|&c| g_v.row(i)[c] > RESOLVED_FROM * v.row(i)[c]);
            if (0..system.n_patches()).all(proves) {
                return (Some(Self { v, g_v }), n_passes);
            }
            for (next, rho_f_v) in v.values_mut().iter_mut().zip(products(&f_v)) {
                *next = 1.0 + rho_f_v;
            }
            system.operator().apply(&v, &mut f_v);
        }
        (None, MAX_PASSES)
    }
}
