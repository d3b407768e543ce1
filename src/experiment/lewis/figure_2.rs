//! Figure 2 as read: the algorithm in its variants, in as few lines as in the paper.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use serde::Serialize;

use super::TOLERANCE;
use super::model::Room;
use crate::experiment::ExperimentError;
use crate::matrix::Precision;

/// A change of the algorithm that works.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Variant {
    /// Nothing: Gauss-Seidel smoothing, v = 0 before the loop, u − P v.
    Repaired,
    /// Line 12 as printed: u = f + K u.
    JacobiSmoothing,
    /// u + P v: the sign that the usual defect would have.
    PlusSign,
    /// v set to 0 before the second recursive call too.
    RestartedSecondCall,
    /// K of the coarse levels by equation (5) without α: rows do not sum to 1.
    CoarseRowsNotNormalised,
}

/// All of them.
pub const VARIANTS: [Variant; 5] = [
    Variant::Repaired,
    Variant::JacobiSmoothing,
    Variant::PlusSign,
    Variant::RestartedSecondCall,
    Variant::CoarseRowsNotNormalised,
];

impl Variant {
    /// Returns a description in a few words.
    #[must_use]
    pub fn description(self) -> &'static str {
        match self {
            Self::Repaired => "repaired",
            Self::JacobiSmoothing => "line 12 as printed: u = f + K u",
            Self::PlusSign => "u + P v",
            Self::RestartedSecondCall => "v = 0 before each recursive call",
            Self::CoarseRowsNotNormalised => "coarse K not normalised",
        }
    }
}

/// The run of a variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct VariantRun {
    /// The level.
    pub level: u32,
    /// Cycles until max |r| < 2.5e-5; `None` if it diverges.
    pub n_cycles: Option<usize>,
    /// max |r| after each of the first eight cycles.
    pub residuals: Vec<f64>,
}

/// The number of cycles after which a variant counts as divergent.
const MAX_CYCLES: usize = 100;

/// Runs a variant at a level, with plain matrices, sequentially, and without code of the solver `multigrid`.
///
/// Prolongation is injection (the solver's runs of table 2 use the bilinear one), the coarsest level has 20 sweeps of Gauss-Seidel, and first recursive calls have no smoothing.
///
/// # Errors
/// [`ExperimentError::Matrix`] if form factors cannot be stored.
pub fn run_variant(variant: Variant, level: u32) -> Result<VariantRun, ExperimentError> {
    let mut matrices = Vec::new();
    for l in 0..=level {
        let room = Room { level: l };
        let normalise = l == level || variant != Variant::CoarseRowsNotNormalised;
        let factors = room.rows(Precision::F64, normalise)?;
        let (n, rho) = (room.n_patches(), room.reflectance());
        let mut k = vec![0.0; n * n];
        for i in 0..n {
            factors.for_each_in_row(i, |j, value, _| k[i * n + j] = rho.row(i)[0] * value);
        }
        matrices.push(k);
    }
    let algorithm = Algorithm { variant, matrices };
    let room = Room { level };
    let f = room.exitance().values().to_vec();
    let mut u = f.clone();
    let mut run = VariantRun {
        level,
        n_cycles: None,
        residuals: Vec::new(),
    };
    for cycle in 1..=MAX_CYCLES {
        algorithm.mg(level as usize, &mut u, &f, true);
        let residual = algorithm.defect(level as usize, &u, &f);
        let max = residual.iter().fold(0.0_f64, |max, r| max.max(r.abs()));
        if run.residuals.len() < 8 {
            run.residuals.push(max);
        }
        if max < TOLERANCE {
            run.n_cycles.get_or_insert(cycle);
        }
        if !max.is_finite() || run.n_cycles.is_some() && run.residuals.len() == 8 {
            break;
        }
    }
    Ok(run)
}

struct Algorithm {
    variant: Variant,
    /// The matrix K of each level, row by row.
    matrices: Vec<Vec<f64>>,
}

impl Algorithm {
    fn mg(&self, l: usize, u: &mut [f64], f: &[f64], smooth: bool) {
        if l == 0 {
            (0..20).for_each(|_| self.gauss_seidel(0, u, f));
            return;
        }
        if smooth && self.variant == Variant::JacobiSmoothing {
            let mean: Vec<f64> = (0..u.len()).map(|i| f[i] + self.product(l, i, u)).collect();
            u.copy_from_slice(&mean);
        } else if smooth {
            self.gauss_seidel(l, u, f);
        }
        let m = 1 << l;
        let parent = |i: usize| {
            let (wall, ia, ib) = (i / (m * m), i / m % m, i % m);
            wall * m * m / 4 + ia / 2 * (m / 2) + ib / 2
        };
        let mut d = vec![0.0; u.len() / 4];
        for (i, r) in self.defect(l, u, f).iter().enumerate() {
            d[parent(i)] += 0.25 * r;
        }
        let mut v = vec![0.0; d.len()];
        self.mg(l - 1, &mut v, &d, false);
        if self.variant == Variant::RestartedSecondCall {
            v.fill(0.0);
        }
        self.mg(l - 1, &mut v, &d, true);
        let sign = if self.variant == Variant::PlusSign { 1.0 } else { -1.0 };
        for (i, u) in u.iter_mut().enumerate() {
            *u += sign * v[parent(i)];
        }
    }

    fn product(&self, l: usize, i: usize, u: &[f64]) -> f64 {
        let row = &self.matrices[l][i * u.len()..(i + 1) * u.len()];
        row.iter().zip(u).map(|(k, u)| k * u).sum()
    }

    fn gauss_seidel(&self, l: usize, u: &mut [f64], f: &[f64]) {
        for i in 0..u.len() {
            u[i] = f[i] + self.product(l, i, u);
        }
    }

    /// Returns u − K u − f.
    fn defect(&self, l: usize, u: &[f64], f: &[f64]) -> Vec<f64> {
        (0..u.len()).map(|i| u[i] - self.product(l, i, u) - f[i]).collect()
    }
}
