//! `gmres`: the least residual over a Krylov space, for systems without symmetry.

#![cfg_attr(
    test,
    expect(
        clippy::shadow_unrelated,
        reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
    )
)]

use std::num::NonZeroUsize;

use super::deflation::DEFLATED;
use super::deflation::{Deflate, EvenLight, first_pass};
use super::entry::{SolverEntry, Symmetry};
use super::history::Monitor;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual, l2};
use super::settings::SolverSettings;
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use super::vectors::{add_scaled, combine, inner, keep_channels};
use crate::matrix::operator::Block;
use crate::setting::{Kind, Setting, Use, Value};

/// Restarted GMRES on (I − diag(ρ) F) B = E in the inner product ⟨u, v⟩ = Σ A u v, all channels together.
///
/// Without deflation, after k passes from the residual r_0 = E − G B_0, G = I − diag(ρ) F, the radiosities are
///
/// B_k = B_0 + argmin { ‖r_0 − G d‖ : d ∈ span(r_0, G r_0, ..., G^{k−1} r_0) },
///
/// so that the very norm of [`Tolerance::ResidualL2`](super::Tolerance::ResidualL2) never rises, symmetric form factors or not. After
/// m passes the space is emptied and built up again from the residual reached. Needs neither reciprocity nor rows.
///
/// The space is an orthonormal basis by Arnoldi with modified Gram-Schmidt, made twice where the first sweep cancels. The residual vector follows from
/// one recurrence (r_k = φ_{k+1} w_k, w_k = −s_k w_{k−1} + c_k v_{k+1}, with the rotations c, s); its norms are the estimate in the history. When it meets
/// the tolerance, the true residual is calculated, and where that does not meet it, the space is built anew from it. A system that is not an M-matrix
/// is solved like any other; it shows in negative radiosities, and the solver stops as
/// [`StopReason::Diverged`](super::StopReason::Diverged).
///
/// Where a component that emits has a mean reflectance of more than [`DEFLATED_FROM`](super::DEFLATED_FROM), the even light of every component is deflated:
/// even irradiances u_K (ρ on component K, 0 elsewhere) are further directions. The residual and the images of the basis are kept orthogonal to G u_K, which comes from the pass that calculates the first
/// residual, as one more channel for each distinct reflectance; then d is from span(u_K, P r_0, P G P r_0, ...), P the projection orthogonal to all G u_K.
/// Even *radiosities* as directions, of which G is known from the row sums without a pass, save as much, but they light black patches that emit nothing, within the tolerance.
///
/// Memory: m + 4 blocks \[n, c\], and 2 for the even light. Work: one application of F a pass, and about 4 k n c operations in the k-th of a cycle.
///
/// Source: Saad and Schultz, "GMRES: a generalized minimal residual algorithm for solving nonsymmetric linear systems", SIAM J. Sci. Stat. Comput. 7 (1986), algorithm 4.
/// Departures: the inner product is weighted with the areas; the residual vector is kept. Deflation: de Sturler, "Nested Krylov methods based on GCR", J. Comput. Appl. Math. 67 (1996), with a
/// space that is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gmres {
    /// Passes between restarts, m.
    pub restart: NonZeroUsize,
    /// Whether the even light of each component is deflated.
    pub deflation: Deflate,
}

impl Default for Gmres {
    /// m = 30, with deflation where it saves time.
    fn default() -> Self {
        Self {
            restart: const { NonZeroUsize::new(30).expect("positive") },
            deflation: Deflate::default(),
        }
    }
}

/// Passes between restarts.
pub static RESTART: Setting = Setting {
    name: "restart",
    help: "Passes between restarts",
    letter: "M",
    kind: Kind::Count(u64::MAX),
};

/// The setting, and the default.
pub(super) const RESTARTED: Use = RESTART.or(Value::Count(30));

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "gmres",
    summary: "The least residual over a Krylov space; for form factors without symmetry",
    settings: &[RESTARTED, DEFLATED],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: false,
    goes_by_rows: false,
    make: |s| Some(Box::new(Gmres::with(s)?)),
};

impl Gmres {
    pub(super) fn with(settings: &SolverSettings) -> Option<Self> {
        Some(Self {
            restart: settings.values.get(&RESTART)?.size()?,
            deflation: Deflate::with(settings)?,
        })
    }
}

impl Solver for Gmres {
    fn name(&self) -> &'static str {
        "gmres"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let scaled = Scaled::new(system);
        let mut state = State {
            scaled: &scaled,
            restart: self.restart.get(),
            deflate: self.deflation,
            even: None,
            even_shares: Vec::new(),
            base: options.start.radiosity(&scaled),
            basis: Vec::new(),
            least: vec![LeastSquares::default(); system.n_channels()],
            residual: scaled.zeros(),
            image: scaled.zeros(),
        };
        iteration::run(&scaled, options, monitor, &mut state)
    }
}

/// The share of a vector below which a sweep of Gram-Schmidt is made twice (Daniel, Gragg, Kaufman and Stewart 1976).
const CANCELS: f64 = 0.7;

/// The share of its terms below which a basis vector is rounding: the space holds the solution already.
const EXHAUSTED: f64 = 1e-15;

struct State<'a> {
    scaled: &'a Scaled<'a>,
    restart: usize,
    deflate: Deflate,
    even: Option<EvenLight>,
    /// The even part of G v_k, for each column of H: \[components, c\].
    even_shares: Vec<Block>,
    /// B_0, with the even light that fits it best.
    base: Block,
    /// v_1, v_2, ...
    basis: Vec<Block>,
    /// One small problem for each channel.
    least: Vec<LeastSquares>,
    /// The residual of the current radiosities.
    residual: Block,
    image: Block,
}

/// min ‖β e_1 − H y‖ of one channel, kept as R y = g by rotations.
#[derive(Clone, Debug, Default)]
struct LeastSquares {
    /// The columns of R.
    columns: Vec<Vec<f64>>,
    /// (c, s).
    rotations: Vec<(f64, f64)>,
    /// The right-hand side; its last entry is ± the residual's norm.
    rhs: Vec<f64>,
    /// True if the space cannot grow.
    exhausted: bool,
}

impl LeastSquares {
    fn starting_from(norm: f64) -> Self {
        Self {
            rhs: vec![norm],
            exhausted: norm <= 0.0,
            ..Self::default()
        }
    }

    /// Takes in a column of H with its last entry `below` the diagonal; returns the rotation, or `None` if R becomes singular.
    fn push(&mut self, mut column: Vec<f64>, below: f64) -> Option<(f64, f64)> {
        for (k, (c, s)) in self.rotations.iter().enumerate() {
            let (a, b) = (column[k], column[k + 1]);
            column[k] = c * a + s * b;
            column[k + 1] = c * b - s * a;
        }
        let last = column.len() - 1;
        let length = column[last].hypot(below);
        if length <= 0.0 || length.is_nan() {
            return None;
        }
        let (c, s) = (column[last] / length, below / length);
        column[last] = length;
        self.columns.push(column);
        self.rotations.push((c, s));
        let g = self.rhs[last];
        self.rhs[last] = c * g;
        self.rhs.push(-s * g);
        Some((c, s))
    }

    /// Returns y.
    fn solution(&self) -> Vec<f64> {
        let mut y = self.rhs[..self.columns.len()].to_vec();
        for k in (0..y.len()).rev() {
            y[k] /= self.columns[k][k];
            let (above, own) = y.split_at_mut(k);
            for (x, r) in above.iter_mut().zip(&self.columns[k]) {
                *x -= r * own[0];
            }
        }
        y
    }
}

impl State<'_> {
    /// Begins a space from the residual; where the tolerance is not met, even light is taken out first.
    fn begin(&mut self, excess: &[f64]) {
        if let Some(even) = &self.even {
            let mut shares = even.shares(&self.residual);
            keep_channels(&mut shares, |c| excess[c] > 1.0);
            even.take_out(&mut self.residual, &shares);
            even.add(&mut self.base, &shares, 1.0);
        }
        self.even_shares.clear();
        let norms = self.norm(&self.residual);
        self.least = norms.iter().map(|&norm| LeastSquares::starting_from(norm)).collect();
        let mut first = self.scaled.zeros();
        let factors: Vec<f64> = norms.iter().map(|n| if *n > 0.0 { n.recip() } else { 0.0 }).collect();
        add_scaled(&mut first, &factors, &self.residual);
        self.basis.clear();
        self.basis.push(first);
    }

    fn norm(&self, block: &Block) -> Vec<f64> {
        l2(&self.scaled.areas, block)
    }

    /// Orthogonalises `image` once against even light and the basis vectors in the channels that `need` it, and adds the coefficients to `shares`.
    fn orthogonalise(&mut self, shares: &mut [Vec<f64>], need: &[bool]) {
        if let (Some(even), Some(total)) = (&self.even, self.even_shares.last_mut()) {
            let mut found = even.shares(&self.image);
            keep_channels(&mut found, |c| need[c]);
            even.take_out(&mut self.image, &found);
            add_scaled(total, &vec![1.0; need.len()], &found);
        }
        for (k, v) in self.basis.iter().enumerate() {
            let mut product = inner(&self.scaled.areas, v, &self.image);
            for (p, _) in product.iter_mut().zip(need).filter(|(_, need)| !**need) {
                *p = 0.0;
            }
            let minus: Vec<f64> = product.iter().map(|p| -p).collect();
            add_scaled(&mut self.image, &minus, v);
            for (share, p) in shares.iter_mut().zip(&product) {
                share[k] += p;
            }
        }
    }

    /// image ← G v, v the last basis vector, where it `grows`; 0 elsewhere.
    fn apply(&mut self, grows: &[bool]) {
        let last = &self.basis[self.basis.len() - 1];
        self.scaled.system.operator().apply(last, &mut self.image);
        let terms = last.values().iter().zip(self.scaled.system.reflectance().values());
        for (image, (v, rho)) in self.image.values_mut().iter_mut().zip(terms) {
            *image = v - rho * *image;
        }
        keep_channels(&mut self.image, |c| grows[c]);
    }
}

impl Iteration for State<'_> {
    fn never_rises(&self) -> bool {
        true
    }

    fn first_residual(&mut self, scaled: &Scaled) -> TrueResidual {
        let (truth, sent) = first_pass(scaled, &self.base, self.deflate);
        self.even = sent.map(|sent| EvenLight::new(scaled.system, &scaled.areas, sent));
        truth
    }

    fn pass(&mut self, excess: &[f64]) -> Estimate {
        if self.basis.len() > self.restart {
            self.base = self.radiosity();
            self.begin(excess);
        }
        let grows: Vec<bool> = self
            .least
            .iter()
            .zip(excess)
            .map(|(l, e)| *e > 1.0 && !l.exhausted)
            .collect();
        self.apply(&grows);
        let before = self.norm(&self.image);
        self.even_shares
            .extend(self.even.as_ref().map(|even| even.shares_of_none(grows.len())));
        let mut shares = vec![vec![0.0; self.basis.len()]; grows.len()];
        self.orthogonalise(&mut shares, &grows);
        let mut after = self.norm(&self.image);
        let cancelled: Vec<bool> = (0..grows.len())
            .map(|c| grows[c] && after[c] < CANCELS * before[c])
            .collect();
        if cancelled.contains(&true) {
            self.orthogonalise(&mut shares, &cancelled);
            after = self.norm(&self.image);
        }
        let mut factors = vec![0.0; grows.len()];
        let mut turns = vec![(0.0, 1.0); grows.len()];
        for c in (0..grows.len()).filter(|&c| grows[c]) {
            let ends = after[c] <= EXHAUSTED * before[c];
            let below = if ends { 0.0 } else { after[c] };
            let least = &mut self.least[c];
            let column = std::mem::take(&mut shares[c]);
            let Some((cosine, sine)) = least.push(column, below) else {
                return Estimate::Breakdown;
            };
            least.exhausted = ends;
            turns[c] = (cosine, sine);
            factors[c] = if ends { 0.0 } else { below.recip() };
        }
        let mut next = self.scaled.zeros();
        add_scaled(&mut next, &factors, &self.image);
        // r_k = φ_{k+1} (−s w_{k−1} + c v_{k+1}) with φ_{k+1} = −s φ_k: r_k = s² r_{k−1} + φ_{k+1} c v_{k+1}.
        let of_channel = |(c, &(cosine, sine)): (usize, &(f64, f64))| {
            let phi = self.least[c].rhs.last().copied().unwrap_or(0.0);
            if grows[c] {
                (sine * sine, phi * cosine)
            } else {
                (1.0, 0.0)
            }
        };
        let (keep, added): (Vec<f64>, Vec<f64>) = turns.iter().enumerate().map(of_channel).unzip();
        combine(&mut self.residual, &keep, &added, &next);
        self.basis.push(next);
        Estimate::Running(self.scaled.norms(&self.residual))
    }

    fn radiosity(&self) -> Block {
        let mut radiosity = self.base.clone();
        let solutions: Vec<Vec<f64>> = self.least.iter().map(LeastSquares::solution).collect();
        for (k, v) in self.basis.iter().enumerate() {
            let factors: Vec<f64> = solutions.iter().map(|y| y.get(k).copied().unwrap_or(0.0)).collect();
            add_scaled(&mut radiosity, &factors, v);
        }
        // The passes replaced even light by the basis: it must not be added twice.
        if let Some(even) = &self.even {
            let mut total = even.shares_of_none(solutions.len());
            for (k, shares) in self.even_shares.iter().enumerate() {
                let factors: Vec<f64> = solutions.iter().map(|y| y.get(k).copied().unwrap_or(0.0)).collect();
                add_scaled(&mut total, &factors, shares);
            }
            even.add(&mut radiosity, &total, -1.0);
        }
        radiosity
    }

    fn restart(&mut self, truth: &TrueResidual, excess: &[f64]) {
        if !self.basis.is_empty() {
            self.base = self.radiosity();
        }
        self.residual.clone_from(&truth.residual);
        self.begin(excess);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// R y = g against the least squares of a small Hessenberg matrix by hand: columns (1, 1), (0, 2, 0).
    #[test]
    fn rotations_solve_least_squares() {
        let mut least = LeastSquares::starting_from(2.0);
        assert!(least.push(vec![1.0], 1.0).is_some());
        let y = least.solution();
        assert!((y[0] - 1.0).abs() < 1e-15, "argmin |2 − y|² + |y|²");
        assert!(
            (least.rhs[1].abs() - 2.0_f64.sqrt()).abs() < 1e-15,
            "the residual's norm"
        );
        assert!(least.push(vec![0.0, 2.0], 0.0).is_some());
        let y = least.solution();
        assert!((y[0] - 2.0).abs() < 1e-15 && (y[1] + 1.0).abs() < 1e-15);
        assert!(least.push(vec![0.0, 0.0, 0.0], 0.0).is_none(), "singular");
    }
}
