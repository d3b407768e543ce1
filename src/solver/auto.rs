//! `auto`: the choice of the fastest solver for a system, with its reason.

use super::choice::ChoiceReason;
use super::deflation::DEFLATED;
use super::entry::{SolverEntry, Symmetry};
use super::gmres::RESTARTED;
use crate::matrix::operator::Block;

use super::choice::Choice;
use super::direct::{Direct, memory_byte};
use super::gauss_seidel::GaussSeidel;
use super::gmres::Gmres;
use super::history::Monitor;
use super::jacobi::Jacobi;
use super::pcg::Pcg;
use super::solution::Solution;
use super::solve::{SolveOptions, SolveResult, Solver};
use super::stop::Tolerance;
use super::system::RadiositySystem;
use super::vectors::equal_channels;

/// Examines the system and uses the solver that will be fastest.
///
/// The choice uses these numbers: whether the exchange areas are symmetric, the number of patches n, of channels, and of distinct reflectances, the tolerance, and
/// from the reflectances and row sums s_i the greatest mean reflectance ρ_avg of a component that emits and bounds of the spectral radius λ of
/// diag(ρ) F: λ ≤ max ρ_i s_i, and λ ≥ min ρ_i s_i (Collatz and Wielandt with the vector 1). They cost no pass over F. Only where λ may be so near 1 that an iteration could take
/// several times as long as a factorisation, one pass over F estimates the mean of the squared eigenvalues: near 0 in a room, where they cluster and
/// iterations are fast whatever λ is, and near 1 between plates that face each other at a small gap, where they do not.
///
/// - `gauss-seidel` for one patch, and `jacobi`, which tests E first, where nothing reflects, and where λ is at most 0.1: a pass takes a digit, and the others compute two more residuals;
/// - `direct` where n / 8 passes, n / 4 over half of a symmetric matrix (measured, see [`Direct`]), for each distinct reflectance take less time than an iteration, for so many channels: few patches,
///   many lightings, or eigenvalues that do not cluster;
/// - `pcg` where the exchange areas are symmetric: the fewest passes at every ρ, and symmetric storage halves each;
/// - `gmres` otherwise.
///
/// `gauss-seidel` is never chosen for more than one patch: a sweep takes longer than a pass, most where the matrix is sparse, and does not gain by further cores.
/// `multigrid` is never chosen, even where there is a hierarchy: in the room of Lewis its setup, 4 cycles and a check are 7.1 passes for the 8 to 10 of `gmres`. But its sweeps
/// run on one core and all of those passes on every core, and the choice must not depend on the number of cores. `chebyshev` takes more passes than conjugate gradients wherever these can be used.
///
/// The choice and its reason are in [`Solution::choice`]. How far it is from the best: `radiosity reproduce stability` prints the ratios of work and time, case by case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Auto {
    /// The settings of `pcg`.
    pub pcg: Pcg,
    /// The settings of `gmres`.
    pub gmres: Gmres,
    /// The settings of `direct`.
    pub direct: Direct,
}

/// The multiplications of a factorisation that take the time of one in a pass: measured, see [`Direct`].
const LU_RATIO: f64 = 8.0;

/// The same where exchange areas are stored: a pass reads half as much.
const LU_RATIO_SYMMETRIC: f64 = 4.0;

/// The spectral radius up to which plain reflections are as fast as anything.
const FADES_FAST: f64 = 0.1;

/// Passes of Krylov methods with deflation for each decimal digit, beside the checks before and after.
const PASSES_PER_DIGIT: f64 = 1.5;

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "auto",
    summary: "The solver that suits the system; reports which, and why",
    settings: &[RESTARTED, DEFLATED],
    symmetry: |_| Symmetry::Helps,
    uses_hierarchy: false,
    goes_by_rows: false,
    make: |s| {
        Some(Box::new(Auto {
            pcg: Pcg::with(s)?,
            gmres: Gmres::with(s)?,
            direct: Direct::with(s),
        }))
    },
};

impl Solver for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let (solver, why) = self.choose(system, options);
        let solution = solver.solve(system, options, monitor)?;
        let choice = Choice {
            solver: solver.name(),
            why,
        };
        Ok(Solution {
            choice: Some(choice),
            ..solution
        })
    }
}

impl Auto {
    /// Returns the solver for a system, and why.
    #[must_use]
    pub fn choose(&self, system: &RadiositySystem, options: &SolveOptions) -> (Box<dyn Solver>, ChoiceReason) {
        if system.n_patches() == 1 && system.operator().has_rows() {
            return (Box::new(GaussSeidel), ChoiceReason::OnePatch);
        }
        let (low, high) = spectral_radius_bounds(system);
        if high <= 0.0 {
            return (Box::new(Jacobi), ChoiceReason::NothingReflects);
        }
        if high <= FADES_FAST {
            return (Box::new(Jacobi), ChoiceReason::FadesFast { spectral_radius: high });
        }
        let digits = match options.tolerance {
            Tolerance::ResidualL2(value) => -value.log10(),
            // The first residual decides how many digits an absolute tolerance needs; until then, the default's six digits.
            Tolerance::ResidualMaxPower(_) | Tolerance::ResidualMax(_) => 6.0,
        };
        if let Some(why) = self.direct_pays(system, digits, high) {
            return (Box::new(self.direct), why);
        }
        let symmetric = system.operator().reciprocal_areas().is_some() || options.allow_nonreciprocal;
        let mean = system.greatest_mean_reflectances().iter().copied().fold(0.0, f64::max);
        let why = ChoiceReason::Passes {
            symmetric,
            mean_reflectance: mean,
            spectral_radius: [low, high],
        };
        if symmetric {
            (Box::new(self.pcg), why)
        } else {
            (Box::new(self.gmres), why)
        }
    }

    /// Returns whether a factorisation takes less time than an iteration, and why.
    fn direct_pays(&self, system: &RadiositySystem, digits: f64, spectral_radius: f64) -> Option<ChoiceReason> {
        let n = system.n_patches();
        let groups = equal_channels(system.reflectance()).len();
        let fits = memory_byte(n, groups) <= self.direct.memory_limit_byte && system.operator().has_rows();
        let ratio = if system.operator().reciprocal_areas().is_some() {
            LU_RATIO_SYMMETRIC
        } else {
            LU_RATIO
        };
        let factorisations = groups as f64 * n as f64 / ratio;
        let n_channels = system.n_channels() as f64;
        // Channels beyond the first cost less than the first, which reads the matrix.
        let iteration = (PASSES_PER_DIGIT * digits + 2.0) * (1.0 + CHANNEL_COST * (n_channels - 1.0));
        let solves = 3.0 * (1.0 + CHANNEL_COST * (n_channels - 1.0));
        let direct = factorisations + solves;
        if !fits {
            return None;
        }
        if direct < iteration {
            return Some(ChoiceReason::FewPatches {
                n_factorisations: groups,
                n_patches: n,
                n_channels: system.n_channels(),
            });
        }
        // Conjugate gradients at worst: sqrt(κ) / 2 ln(2 / tolerance), with κ up to 2 / (1 − λ); with the checks, and in the same units as above.
        let condition = 2.0 / (1.0 - spectral_radius).max(f64::EPSILON);
        let passes = 0.5 * condition.sqrt() * (2.0 * 10_f64.powf(digits)).ln();
        let worst = passes * (1.0 + CHANNEL_COST * (n_channels - 1.0));
        if 2.0 * direct >= worst {
            return None;
        }
        let squares = mean_squared_eigenvalue(system);
        (squares > CLUSTERED_BELOW).then_some(ChoiceReason::SpreadEigenvalues {
            mean_square: squares,
            n_passes_max: passes,
        })
    }
}

/// The mean square below which eigenvalues cluster near 0; rooms have some 2 / n.
const CLUSTERED_BELOW: f64 = 0.2;

/// Returns an estimate of Σ λ² / n over the eigenvalues λ of diag(ρ) F, the worst channel, with one pass over F.
///
/// S = A^½ ρ^½ F ρ^½ A^−½ has the same eigenvalues, and E ‖S z‖² = Σ λ² for random signs z where it is symmetric (Hutchinson 1990); otherwise it is an upper bound.
/// Standard error: at most sqrt(2 / n). The signs are those of a fixed sequence.
fn mean_squared_eigenvalue(system: &RadiositySystem) -> f64 {
    let mut probe = system.reflectance().clone();
    let n_channels = probe.n_channels();
    for (i, area) in system.areas().iter().enumerate() {
        let mixed = (i as u64).wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let sign = if mixed >> 63 == 0 { 1.0 } else { -1.0 };
        for rho in probe.row_mut(i) {
            *rho = (*rho * (system.area_unit() / area)).sqrt() * sign;
        }
    }
    let mut image = Block::zeros(system.n_patches(), n_channels);
    system.operator().apply(&probe, &mut image);
    let mut sums = vec![0.0; n_channels];
    for (i, area) in system.areas().iter().enumerate() {
        let terms = image.row(i).iter().zip(system.reflectance().row(i));
        for (sum, (y, rho)) in sums.iter_mut().zip(terms) {
            *sum += area / system.area_unit() * rho * y * y;
        }
    }
    sums.into_iter().fold(0.0, f64::max) / system.n_patches() as f64
}

/// The cost that one more channel adds to a pass, as a share of the first.
const CHANNEL_COST: f64 = 0.3;

/// Returns min and max of ρ_i Σ_j F_ij, between which the spectral radius of diag(ρ) F lies; over the worst channel.
fn spectral_radius_bounds(system: &RadiositySystem) -> (f64, f64) {
    let n_channels = system.n_channels();
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for c in 0..n_channels {
        let reflectances = system.reflectance().values().iter().skip(c).step_by(n_channels);
        let products = reflectances.zip(system.row_sums()).map(|(rho, sum)| rho * sum);
        let (min, max) = products.fold((f64::INFINITY, 0.0_f64), |(min, max), x| (min.min(x), max.max(x)));
        (low, high) = (low.max(min), high.max(max));
    }
    (low, high)
}
