//! A bound of the distance of radiosities from the solution, by their residual.

use super::scaled::{Scaled, TrueResidual, l2};
use crate::matrix::operator::Block;
use crate::matrix::roundings;

/// The most passes over F that are spent on a vector that proves a bound.
const MAX_PASSES: usize = 16;

/// Returns for each channel a bound of ‖B − B*‖ / ‖B*‖ in the norm sqrt(Σ A x²); `None` if none can be proved.
///
/// Let G = I − diag(ρ) F with F ≥ 0, r = E − G B, and v > 0 any vector with G v > 0. Then G⁻¹ ≥ 0 (G is an M-matrix) and,
/// because |r| ≤ m G v with m = max_j |r_j| / (G v)_j,
///
/// |B − B*|_i = |G⁻¹ r|_i ≤ m v_i, so ‖B − B*‖ ≤ m ‖v‖ = β, and relative to ‖B*‖ at most β / (‖B‖ − β).
///
/// Where A_i F_ij is symmetric, diag(ρ)F has the eigenvalues of the symmetric S = diag(ρ)^½ F diag(ρ)^½, which are at most
/// λ = max_i (ρ F v)_i / v_i = 1 − min_i (G v)_i / v_i (Collatz and Wielandt), ‖F‖ is at most the greatest row sum s, and
/// G⁻¹ r = r + diag(ρ)^½ (I − S)⁻¹ diag(ρ)^½ F r, so
///
/// ‖B − B*‖ ≤ ‖r‖ (1 + ρ_max s / (1 − λ)).
///
/// The smaller of the two counts. v = 1 costs nothing, as row sums are known: λ = max_i ρ_i s_i. Where that proves nothing,
/// because some patch reflects everything, v ← 1 + diag(ρ) F v adds one more reflection, one pass over F each.
/// Their rounding errors are added to |r| and taken from G v, (max(16 n^½, n / 8) + 70) 2⁻⁵³ times |E| + |B| + ρ F |B| and v + ρ F v (see the operator of
/// [`FormFactors`](crate::matrix::FormFactors)), so that the bound also holds where 1 − ρ is near rounding. Where B has both signs, F |B| is taken as the row sum times the greatest |B|.
/// Accuracy: rigorous but for negative form factors. It bounds
/// the error of solving, not that of the form factors.
/// Source: Berman and Plemmons, "Nonnegative Matrices in the Mathematical Sciences", chapter 6, theorem 2.3, for the M-matrix.
/// Departures: none.
pub(super) fn relative(scaled: &Scaled, radiosity: &Block, truth: &TrueResidual) -> Vec<Option<f64>> {
    let system = scaled.system;
    let mut bounds: Vec<_> = (0..system.n_channels())
        .map(|c| scaled.is_dark(c).then_some(0.0))
        .collect();
    let lit: Vec<usize> = (0..system.n_channels()).filter(|&c| !scaled.is_dark(c)).collect();
    let (Some(proof), _) = Proof::find(scaled, &lit) else {
        return bounds;
    };
    let reciprocal = system.operator().reciprocal_areas().is_some_and(|areas| {
        let pairs = areas.iter().zip(system.areas());
        pairs.into_iter().all(|(a, b)| a.to_bits() == b.to_bits())
    });
    let row_sum_max = system.row_sums().iter().copied().fold(0.0, f64::max);
    let residual = with_rounding(scaled, radiosity, truth);
    let (norm_r, norm_b) = (l2(&scaled.areas, &residual), l2(&scaled.areas, radiosity));
    let norm_v = l2(&scaled.areas, &proof.v);
    for c in lit {
        // 1 − λ itself: after it was subtracted from 1, the rest may be rounding.
        let (mut m, mut gap, mut rho_max) = (0.0_f64, 1.0_f64, 0.0_f64);
        for i in 0..system.n_patches() {
            // 0 by 0, where no light arrives, does not count.
            let (v, g_v) = (proof.v.row(i)[c], proof.g_v.row(i)[c]);
            m = m.max(residual.row(i)[c] / g_v);
            gap = gap.min(g_v / v);
            rho_max = rho_max.max(system.reflectance().row(i)[c]);
        }
        let mut bound = m * norm_v[c];
        if reciprocal {
            bound = bound.min(norm_r[c] * (1.0 + rho_max * row_sum_max / gap));
        }
        // ‖B*‖ ≥ ‖B‖ − ‖B − B*‖.
        let relative = bound / (norm_b[c] - bound);
        bounds[c] = (relative.is_finite() && relative >= 0.0).then_some(relative);
    }
    bounds
}

/// Returns for each channel a bound λ of the absolute eigenvalues of diag(ρ) F, and the passes over F spent on it.
///
/// λ = max_i (ρ F v)_i / v_i with the vector v above. A channel without light has 0, and one for which no bound below 1 can be proved has 1.
pub(super) fn spectral_radius(scaled: &Scaled) -> (Vec<f64>, usize) {
    let n_channels = scaled.system.n_channels();
    let lit: Vec<usize> = (0..n_channels).filter(|&c| !scaled.is_dark(c)).collect();
    let mut radii = vec![0.0; n_channels];
    let (proof, n_passes) = Proof::find(scaled, &lit);
    for c in lit {
        radii[c] = proof.as_ref().map_or(1.0, |proof| {
            let gap = |i: usize| proof.g_v.row(i)[c] / proof.v.row(i)[c];
            1.0 - (0..scaled.system.n_patches()).map(gap).fold(1.0, f64::min)
        });
    }
    (radii, n_passes)
}

/// Returns |r| with its possible rounding added.
fn with_rounding(scaled: &Scaled, radiosity: &Block, truth: &TrueResidual) -> Block {
    let unit = rounding(scaled);
    let mut sum = scaled.sizes(radiosity, &truth.irradiance);
    for (value, r) in sum.values_mut().iter_mut().zip(truth.residual.values()) {
        *value = r.abs() + unit * *value;
    }
    sum
}

/// Returns the possible rounding of a sum of products with F, relative to the sum of their sizes.
fn rounding(scaled: &Scaled) -> f64 {
    roundings(scaled.areas.len()) * 0.5 * f64::EPSILON
}

/// A vector v > 0 with G v > 0 in every lit channel.
///
/// In enclosures without light, which do not affect the others, both are 0: a residual there is beyond all bounds.
struct Proof {
    v: Block,
    /// A lower bound of G v.
    g_v: Block,
}

impl Proof {
    /// Searches for a proof, and also returns the number of passes over F that it took.
    fn find(scaled: &Scaled, lit: &[usize]) -> (Option<Self>, usize) {
        if lit.is_empty() {
            return (None, 0);
        }
        let (system, unit) = (scaled.system, rounding(scaled));
        let reflectances = system.reflectance().values();
        let products = |f_v: &Block| -> Vec<f64> {
            let pairs = reflectances.iter().zip(f_v.values());
            pairs.map(|(rho, f)| rho * f).collect()
        };
        let mut v = scaled.zeros();
        v.values_mut().fill(1.0);
        // A white enclosure, which proves nothing, may be one without light.
        let brightest = |i: usize| system.reflectance().row(i).iter().copied().fold(0.0, f64::max);
        let any_white = system
            .row_sums()
            .iter()
            .enumerate()
            .any(|(i, sum)| brightest(i) * sum >= 1.0);
        let emits = any_white.then(|| system.emitting_components());
        let is_lit = |i: usize, c: usize| {
            let place = || system.components().labels[i] as usize * system.n_channels() + c;
            emits.as_ref().is_none_or(|emits| emits[place()])
        };
        let mut f_v = scaled.zeros();
        for (i, sum) in system.row_sums().iter().enumerate() {
            f_v.row_mut(i).fill(*sum);
        }
        for n_passes in 0..MAX_PASSES {
            let mut g_v = v.clone();
            for (g, rho_f_v) in g_v.values_mut().iter_mut().zip(products(&f_v)) {
                *g = (*g - rho_f_v) - unit * (*g + rho_f_v);
            }
            let proves = |i: usize| lit.iter().all(|&c| g_v.row(i)[c] > 0.0 || !is_lit(i, c));
            if (0..system.n_patches()).all(proves) {
                for (i, c) in (0..system.n_patches()).flat_map(|i| lit.iter().map(move |&c| (i, c))) {
                    if !is_lit(i, c) {
                        (v.row_mut(i)[c], g_v.row_mut(i)[c]) = (0.0, 0.0);
                    }
                }
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
