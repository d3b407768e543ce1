//! The coarse levels: their matrices, and their corrections.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use super::coarsest::Factored;
use super::matrices::{Matrix, Restricted, Swept, Wanted};
use super::{COARSEST_MAX, CoarseMatrices, Coarsest, Defect, Multigrid};
use crate::matrix::operator::{Block, LinearOperator, RowAccess};
use crate::mesh::Hierarchy;
use crate::mesh::hierarchy::Coarsening;
use crate::solver::error::SolverError;
use crate::solver::system::RadiositySystem;

/// A coarse level with more below it.
struct Level {
    /// K, \[m, m\].
    matrix: Matrix,
    /// R K or R U, \[m', m\].
    restricted: Matrix,
}

/// Sweeps on a coarsest level that has too many patches for a direct solution; Lewis makes as many.
const SWEEPS_OF_MANY: usize = 20;

enum Bottom {
    /// One for each channel.
    Direct(Vec<Factored>),
    Sweeps(Matrix, usize),
}

/// All coarse levels. Vectors are one channel each.
pub(super) struct Levels<'a> {
    settings: &'a Multigrid,
    hierarchy: &'a Hierarchy,
    /// R K or R U of the finest level, where U is K above its diagonal.
    restricted: Matrix,
    /// The levels below the finest one and above the coarsest one.
    between: Vec<Level>,
    bottom: Bottom,
    /// Entries of F.
    pub(super) n_of_f: f64,
    /// The multiplications of the setup.
    pub(super) setup_multiply_adds: f64,
    /// Multiplications of one cycle, the finest sweep included, the mean over the channels.
    pub(super) multiply_adds: f64,
}

impl<'a> Levels<'a> {
    pub(super) fn new(
        settings: &'a Multigrid,
        hierarchy: &'a Hierarchy,
        rows: &dyn RowAccess,
        system: &RadiositySystem,
    ) -> Result<Self, SolverError> {
        let reflectance = system.reflectance();
        let steps = hierarchy.levels();
        let mut total = 0.0;
        let mut counted = |made: Restricted| {
            total += made.n_added as f64;
            (made.rows, made.merged)
        };
        let wanted = Wanted {
            upper: settings.defect == Defect::OfChanges,
            // Exitances of both signs can balance, so that no part of the mode that hardly loses light remains: in a white room the rounding of that would count without end.
            rounded: !system.is_signed(),
            merged: matches!(settings.coarse_matrices, CoarseMatrices::Galerkin),
        };
        let finest = Matrix::restrict_form_factors(rows, reflectance, &steps[0], wanted);
        let n_of_f = finest.n_of_source as f64;
        let (restricted, mut merged) = counted(finest);
        let mut n_evaluated = 0;
        let mut between: Vec<Level> = Vec::new();
        let mut coarse_reflectance = reflectance.clone();
        let mut bottom = None;
        for (k, step) in steps.iter().enumerate() {
            let matrix = match &settings.coarse_matrices {
                CoarseMatrices::Galerkin => merged.take().expect("was wanted"),
                CoarseMatrices::Reevaluated(form_factors) => {
                    let found = form_factors.get(k).map_or(0, LinearOperator::n_rows);
                    let expected = step.n_coarse();
                    let form_factors = form_factors.get(k).filter(|_| found == expected);
                    let form_factors = form_factors.ok_or(SolverError::Shape {
                        what: "rows of the form factors of a coarse level",
                        expected,
                        found,
                    })?;
                    coarse_reflectance = restricted_block(step, &coarse_reflectance);
                    let (matrix, n_entries) = Matrix::from_form_factors(form_factors, &coarse_reflectance);
                    n_evaluated += n_entries;
                    matrix
                }
            };
            match steps.get(k + 1) {
                Some(next) => {
                    let (restricted, next_merged) = counted(matrix.restricted(next, wanted));
                    merged = next_merged;
                    between.push(Level { matrix, restricted });
                }
                None => bottom = Some(matrix),
            }
        }
        total += n_evaluated as f64;
        let matrix = bottom.expect("a hierarchy has at least one step here");
        let n_channels = reflectance.n_channels();
        let bottom = match settings.coarsest {
            Coarsest::Sweeps(n_sweeps) => Bottom::Sweeps(matrix, n_sweeps),
            // Unions of the level above that span several sets of patches can leave more than a direct solution is worth.
            Coarsest::Direct if matrix.n_rows() > COARSEST_MAX && wanted.merged && !matrix.is_diagonal() => {
                Bottom::Sweeps(matrix, SWEEPS_OF_MANY)
            }
            Coarsest::Direct => Bottom::Direct((0..n_channels).map(|c| Factored::new(&matrix, c)).collect()),
        };
        if let Bottom::Direct(channels) = &bottom {
            total += channels.iter().map(Factored::setup_multiply_adds).sum::<f64>();
        }
        let mut levels = Self {
            settings,
            hierarchy,
            restricted,
            between,
            bottom,
            n_of_f,
            setup_multiply_adds: total,
            multiply_adds: 0.0,
        };
        levels.multiply_adds = n_of_f + levels.restricted.multiply_adds() + levels.twice_multiply_adds(0);
        Ok(levels)
    }

    /// Returns d = R (u − K u − f) of the finest level, minus the restricted residual, from the radiosities: \[c\]\[m\] from \[c\]\[n\]. Needs R K.
    pub(super) fn defect_of_radiosities(&self, u: &[Vec<f64>], f: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let step = &self.hierarchy.levels()[0];
        let means = |(u, f): (&Vec<f64>, &Vec<f64>)| step.restricted(&difference(u, f));
        let mut d: Vec<Vec<f64>> = u.iter().zip(f).map(means).collect();
        let u: Vec<&[f64]> = u.iter().map(Vec::as_slice).collect();
        self.restricted.subtract_product(&u, &mut d);
        d
    }

    /// Returns the same from the changes and remainders of the sweep. Needs R U.
    pub(super) fn defect_of_changes(&self, swept: &[Swept]) -> Vec<Vec<f64>> {
        let step = &self.hierarchy.levels()[0];
        let mut d: Vec<Vec<f64>> = swept.iter().map(|swept| minus_left(step, swept)).collect();
        let changes: Vec<&[f64]> = swept.iter().map(|swept| &*swept.changes).collect();
        self.restricted.subtract_product(&changes, &mut d);
        d
    }

    /// Returns v with which the correction of the finest level is −P v: an approximate solution of the coarse system whose right-hand side is d, \[c\]\[m\].
    pub(super) fn correction(&self, d: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let channels = d.iter().enumerate();
        channels.map(|(c, d)| self.twice(0, c, d)).collect()
    }

    /// Solves the system of coarse level `k` by two recursive calls: the first does not smooth, the second continues from its result.
    fn twice(&self, k: usize, c: usize, f: &[f64]) -> Vec<f64> {
        let mut v = vec![0.0; f.len()];
        self.improve(k, c, &mut v, f, false);
        if k < self.between.len() || matches!(self.bottom, Bottom::Sweeps(..)) {
            self.improve(k, c, &mut v, f, true);
        }
        v
    }

    fn improve(&self, k: usize, c: usize, u: &mut [f64], f: &[f64], smooth: bool) {
        let Some(level) = self.between.get(k) else {
            match &self.bottom {
                Bottom::Direct(channels) => {
                    u.copy_from_slice(f);
                    channels[c].solve(u);
                }
                Bottom::Sweeps(matrix, n_sweeps) => {
                    for _ in 0..*n_sweeps {
                        matrix.sweep(c, u, f);
                    }
                }
            }
            return;
        };
        let step = &self.hierarchy.levels()[k + 1];
        let swept = smooth.then(|| level.matrix.sweep(c, u, f));
        let d = match (self.settings.defect, swept) {
            (Defect::OfRadiosities, _) => {
                let mut d = step.restricted(&difference(u, f));
                level.restricted.subtract_channel(c, u, &mut d);
                d
            }
            (Defect::OfChanges, Some(swept)) => {
                let mut d = minus_left(step, &swept);
                level.restricted.subtract_channel(c, &swept.changes, &mut d);
                d
            }
            // The first call begins at 0, whose residual is f.
            (Defect::OfChanges, None) => step.restricted(&difference(u, f)),
        };
        let v = self.twice(k + 1, c, &d);
        let corrections = step.prolonged(self.settings.prolongation, &v);
        u.iter_mut()
            .zip(corrections)
            .for_each(|(u, correction)| *u -= correction);
    }

    /// Returns whether the coarsest level answers light on the patches of `lit` (1 or 0, \[c\]\[n\]) without negative numbers.
    ///
    /// It does if I − K has a non-negative inverse there, as for every system that loses light.
    pub(super) fn is_physical(&self, lit: &[Vec<f64>]) -> bool {
        let Bottom::Direct(channels) = &self.bottom else {
            return true;
        };
        channels.iter().zip(lit).all(|(solver, lit)| {
            let mut x = lit.clone();
            for step in self.hierarchy.levels() {
                x = step.restricted(&x);
            }
            solver.solve(&mut x);
            let greatest = x.iter().copied().fold(0.0, f64::max);
            // Rounding may leave values a little below zero where no light arrives.
            x.iter().all(|&x| x >= -1e-12 * greatest && x.is_finite())
        })
    }

    /// Returns the multiplications of two recursive calls at coarse level `k`.
    fn twice_multiply_adds(&self, k: usize) -> f64 {
        let Some(level) = self.between.get(k) else {
            return match &self.bottom {
                Bottom::Direct(channels) => channels.first().map_or(0.0, Factored::multiply_adds),
                Bottom::Sweeps(matrix, n_sweeps) => 2.0 * *n_sweeps as f64 * matrix.multiply_adds(),
            };
        };
        let n_defects = match self.settings.defect {
            Defect::OfChanges => 1.0,
            Defect::OfRadiosities => 2.0,
        };
        level.matrix.multiply_adds()
            + n_defects * level.restricted.multiply_adds()
            + 2.0 * self.twice_multiply_adds(k + 1)
    }
}

fn difference(u: &[f64], f: &[f64]) -> Vec<f64> {
    u.iter().zip(f).map(|(u, f)| u - f).collect()
}

/// Returns −R x of the residuals x that a sweep has left.
fn minus_left(step: &Coarsening, swept: &Swept) -> Vec<f64> {
    let mut d = vec![0.0; step.n_coarse()];
    for &(i, residual) in &swept.left {
        d[step.parents()[i] as usize] -= step.shares()[i] * residual;
    }
    d
}

/// Returns the area-weighted means of each channel over the coarse patches.
fn restricted_block(step: &Coarsening, fine: &Block) -> Block {
    let mut coarse = Block::zeros(step.n_coarse(), fine.n_channels());
    for (i, (&parent, share)) in step.parents().iter().zip(step.shares()).enumerate() {
        for (sum, value) in coarse.row_mut(parent as usize).iter_mut().zip(fine.row(i)) {
            *sum += share * value;
        }
    }
    coarse
}
