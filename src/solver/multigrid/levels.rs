//! The coarse levels: their matrices, and the correction that they give.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use super::coarsest::Factored;
use super::matrices::{Cost, Matrix};
use super::{CoarseMatrices, Coarsest, Multigrid};
use crate::matrix::operator::{Block, LinearOperator, RowAccess};
use crate::mesh::Hierarchy;
use crate::mesh::hierarchy::Coarsening;
use crate::solver::SolverError;

/// A coarse level with more below it.
struct Level {
    /// K, \[m, m\].
    matrix: Matrix,
    /// R K, \[m', m\].
    restricted: Matrix,
}

enum Bottom {
    /// One for each channel.
    Direct(Vec<Factored>),
    Sweeps(Matrix, usize),
}

/// All coarse levels. Vectors are one channel each.
pub(super) struct Levels<'a> {
    settings: &'a Multigrid,
    hierarchy: &'a Hierarchy,
    /// R K of the finest level.
    restricted: Matrix,
    /// The levels below the finest one and above the coarsest one.
    between: Vec<Level>,
    bottom: Bottom,
    /// Entries of F.
    pub(super) n_of_f: f64,
    /// Multiplications that made all this.
    pub(super) setup_multiply_adds: f64,
}

impl<'a> Levels<'a> {
    pub(super) fn new(
        settings: &'a Multigrid,
        hierarchy: &'a Hierarchy,
        rows: &dyn RowAccess,
        reflectance: &Block,
    ) -> Result<Self, SolverError> {
        let steps = hierarchy.levels();
        let mut total = 0.0;
        let mut counted = |(matrix, cost): (Matrix, Cost)| {
            total += cost.n_entries as f64;
            matrix
        };
        let (restricted, cost) = Matrix::restrict_form_factors(rows, reflectance, &steps[0]);
        let n_of_f = cost.n_of_source as f64;
        let restricted = counted((restricted, cost));
        let mut between: Vec<Level> = Vec::new();
        let mut coarse_reflectance = reflectance.clone();
        let mut bottom = None;
        for (k, step) in steps.iter().enumerate() {
            let matrix = match &settings.coarse_matrices {
                CoarseMatrices::Galerkin => {
                    let above = between.last().map_or(&restricted, |level| &level.restricted);
                    counted(above.merge_columns(step))
                }
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
                    counted(Matrix::from_form_factors(form_factors, &coarse_reflectance))
                }
            };
            match steps.get(k + 1) {
                Some(next) => {
                    let restricted = counted(matrix.restricted(next));
                    between.push(Level { matrix, restricted });
                }
                None => bottom = Some(matrix),
            }
        }
        let matrix = bottom.expect("a hierarchy has at least one step here");
        let n_channels = reflectance.n_channels();
        let bottom = match settings.coarsest {
            Coarsest::Direct => Bottom::Direct((0..n_channels).map(|c| Factored::new(&matrix, c)).collect()),
            Coarsest::Sweeps(n_sweeps) => Bottom::Sweeps(matrix, n_sweeps),
        };
        if let Bottom::Direct(channels) = &bottom {
            total += channels.iter().map(Factored::setup_multiply_adds).sum::<f64>();
        }
        Ok(Self {
            settings,
            hierarchy,
            restricted,
            between,
            bottom,
            n_of_f,
            setup_multiply_adds: total,
        })
    }

    /// Returns v with which the correction of the finest level is −P v: an approximate solution of the coarse system whose right-hand side is
    /// d = R (u − K u − f), minus the restricted residual. All shapes are \[c\]\[n\] or \[c\]\[m\].
    pub(super) fn correction(&self, u: &[Vec<f64>], f: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let step = &self.hierarchy.levels()[0];
        let mut d: Vec<Vec<f64>> = u
            .iter()
            .zip(f)
            .map(|(u, f)| step.restricted(&difference(u, f)))
            .collect();
        self.restricted.subtract_product(u, &mut d);
        let channels = d.iter().enumerate();
        channels.map(|(c, d)| self.twice(0, c, d)).collect()
    }

    /// Solves the system of coarse level `k` by two recursive calls: the first does not smooth, the second goes on from what it found.
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
                Bottom::Sweeps(matrix, n_sweeps) => (0..*n_sweeps).for_each(|_| matrix.sweep(c, u, f)),
            }
            return;
        };
        if smooth {
            level.matrix.sweep(c, u, f);
        }
        let step = &self.hierarchy.levels()[k + 1];
        let mut d = step.restricted(&difference(u, f));
        level.restricted.subtract_channel(c, u, &mut d);
        let v = self.twice(k + 1, c, &d);
        let corrections = step.prolonged(self.settings.prolongation, &v);
        u.iter_mut()
            .zip(corrections)
            .for_each(|(u, correction)| *u -= correction);
    }

    /// Tells whether light on the patches of `lit` (1 or 0, \[c\]\[n\]) has an answer without negative numbers on the coarsest level: if I − K has a
    /// non-negative inverse there, as it has for every system that loses light, it does.
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
            // Rounding may leave a little below zero where no light gets.
            x.iter().all(|&x| x >= -1e-12 * greatest && x.is_finite())
        })
    }

    /// Returns the multiplications of one cycle, the finest sweep included, the mean over the channels.
    pub(super) fn multiply_adds(&self) -> f64 {
        self.n_of_f + self.restricted.multiply_adds() + self.twice_multiply_adds(0)
    }

    fn twice_multiply_adds(&self, k: usize) -> f64 {
        let Some(level) = self.between.get(k) else {
            return match &self.bottom {
                Bottom::Direct(channels) => channels.first().map_or(0.0, Factored::multiply_adds),
                Bottom::Sweeps(matrix, n_sweeps) => 2.0 * *n_sweeps as f64 * matrix.multiply_adds(),
            };
        };
        level.matrix.multiply_adds() + 2.0 * (level.restricted.multiply_adds() + self.twice_multiply_adds(k + 1))
    }
}

fn difference(u: &[f64], f: &[f64]) -> Vec<f64> {
    u.iter().zip(f).map(|(u, f)| u - f).collect()
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
