//! Section 7: K u with each part of the sum on the coarsest sufficient level, and form factors evaluated on demand.

use std::time::Instant;

use serde::Serialize;

use super::model::Room;
use crate::experiment::ExperimentError;
use crate::matrix::Precision;
use crate::matrix::operator::{Block, LinearOperator};
use crate::threads;

/// One product K u by levels.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ByLevels {
    /// The level of u.
    pub level: u32,
    /// ε, W·m⁻².
    pub epsilon: f64,
    /// Terms of all sums, by N²: 1 is every pair.
    pub terms: f64,
    /// max |K u − its sum by levels|, W·m⁻².
    pub error_max: f64,
    /// Evaluations of (5), accepted and not, by N².
    pub evaluations: f64,
    /// Time by that of all pairs evaluated as they are needed.
    #[serde(skip)]
    pub time_by_direct: f64,
    /// Time by that of a product with the stored matrix.
    #[serde(skip)]
    pub time_by_stored: f64,
}

/// The values of ε, W·m⁻².
pub const EPSILONS: [f64; 4] = [1e-2, 1e-3, 1e-4, 1e-5];

/// Computes K u for the solution u by levels, and compares.
///
/// |K u − Σ_k K^{l_k}_{i_k j_k} u^{l_k}_{j_k}| < ε: from whole walls down, a coarse patch J is one term for patch i where
/// ρ_i F_iJ (max u − min u over J) ≤ ε A_J / 6, and where it is no wider than half its distance from i (at smaller distances the centre rule is invalid). This is our criterion for l_k; otherwise J is split into four. F_iJ is
/// equation (5) between the centres, with α of the finest level, which is known. `u`: \[N\].
///
/// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), section 7. Departures: his criterion is not printed; this one bounds what the spread of u in J can do, not the error of F_iJ.
///
/// # Errors
/// [`ExperimentError::Matrix`] if the matrix to compare with cannot be stored.
pub fn product_by_levels(level: u32, u: &[f64]) -> Result<Vec<ByLevels>, ExperimentError> {
    let room = Room { level };
    let n = room.n_patches();
    let pyramid = Pyramid::new(room, u);
    let rho = room.reflectance();
    let factors = room.form_factors(Precision::F64)?;
    let raw_sum = |i: usize| -> f64 { (0..n).map(|j| room.kernel(i, room, j)).sum() };
    let alpha: Vec<f64> = threads::collect(n, raw_sum);
    let threads_off = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let timed = |work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    let mut exact = Block::zeros(n, 1);
    let x = Block::from_values(u.to_vec(), 1);
    let mut apply = || factors.apply(&x, &mut exact);
    // All three run on one thread, which makes their times comparable.
    let stored_s = match &threads_off {
        Ok(pool) => pool.install(|| timed(&mut apply)),
        Err(_) => timed(&mut apply),
    };
    let mut direct = vec![0.0; n];
    let direct_s = timed(&mut || {
        for (i, sum) in direct.iter_mut().enumerate() {
            *sum = (0..n).map(|j| room.kernel(i, room, j) * u[j]).sum();
        }
    });
    let mut runs = Vec::new();
    for epsilon in EPSILONS {
        let (mut n_terms, mut n_evaluations, mut error_max) = (0_usize, 0_usize, 0.0_f64);
        let mut sums = vec![0.0; n];
        let time_s = timed(&mut || {
            for (i, sum) in sums.iter_mut().enumerate() {
                let mut gather = Gather {
                    pyramid: &pyramid,
                    room,
                    i,
                    centre: room.centre(i),
                    rho: rho.row(i)[0] / alpha[i],
                    epsilon,
                    n_terms: 0,
                    n_evaluations: 0,
                };
                *sum = (0..6).map(|wall| gather.from(0, wall)).sum();
                n_terms += gather.n_terms;
                n_evaluations += gather.n_evaluations;
            }
        });
        for (i, sum) in sums.iter().enumerate() {
            error_max = error_max.max((sum - rho.row(i)[0] * exact.row(i)[0]).abs());
        }
        let pairs = (n * n) as f64;
        runs.push(ByLevels {
            level,
            epsilon,
            terms: n_terms as f64 / pairs,
            error_max,
            evaluations: n_evaluations as f64 / pairs,
            time_by_direct: time_s / direct_s,
            time_by_stored: time_s / stored_s,
        });
    }
    Ok(runs)
}

/// Means and ranges of u on every level, the coarsest first.
struct Pyramid(Vec<Vec<[f64; 3]>>);

impl Pyramid {
    fn new(room: Room, u: &[f64]) -> Self {
        let mut levels = vec![u.iter().map(|&u| [u, u, u]).collect::<Vec<[f64; 3]>>()];
        for l in (0..room.level).rev() {
            let fine = levels.last().map_or(&[][..], Vec::as_slice);
            let coarse = Room { level: l };
            let merge = |k: usize| {
                let children = children(coarse, k).map(|j| fine[j]);
                let mean = children.iter().map(|c| 0.25 * c[0]).sum();
                let low = children.iter().fold(f64::INFINITY, |low, c| low.min(c[1]));
                [mean, low, children.iter().fold(0.0_f64, |high, c| high.max(c[2]))]
            };
            let merged = (0..coarse.n_patches()).map(merge).collect();
            levels.push(merged);
        }
        levels.reverse();
        Self(levels)
    }
}

/// Returns the four patches of the next finer level.
fn children(room: Room, k: usize) -> [usize; 4] {
    let m = room.per_edge();
    let (wall, ia, ib) = (k / (m * m), k / m % m, k % m);
    let fine = |da: usize, db: usize| wall * 4 * m * m + (2 * ia + da) * 2 * m + 2 * ib + db;
    [fine(0, 0), fine(0, 1), fine(1, 0), fine(1, 1)]
}

struct Gather<'a> {
    pyramid: &'a Pyramid,
    room: Room,
    i: usize,
    centre: [f64; 3],
    /// The ratio ρ_i / α_i.
    rho: f64,
    epsilon: f64,
    n_terms: usize,
    n_evaluations: usize,
}

impl Gather<'_> {
    /// Returns the part of (K u)_i by patch j of level l.
    fn from(&mut self, l: u32, j: usize) -> f64 {
        let per_wall = |room: Room| room.per_edge() * room.per_edge();
        let coarse = Room { level: l };
        if self.i / per_wall(self.room) == j / per_wall(coarse) {
            return 0.0;
        }
        let k = self.rho * self.room.kernel(self.i, coarse, j);
        self.n_evaluations += 1;
        let [mean, low, high] = self.pyramid.0[l as usize][j];
        let width = (coarse.per_edge() as f64).recip();
        let centre = coarse.centre(j);
        let squared: f64 = (0..3).map(|a| (centre[a] - self.centre[a]).powi(2)).sum();
        let smooth = k * (high - low) <= self.epsilon * width * width / 6.0;
        if l == self.room.level || (smooth && 4.0 * width * width <= squared) {
            self.n_terms += 1;
            return k * mean;
        }
        children(coarse, j)
            .into_iter()
            .map(|child| self.from(l + 1, child))
            .sum()
    }
}
