//! `auto`: the solver that suits a system, and why.

use std::ops::ControlFlow;

use super::deflation::greatest_mean_reflectance;
use super::direct::{equal_channels, memory_byte};
use super::scaled::Scaled;
use super::stop::Tolerance;
use super::{
    Choice, Direct, GaussSeidel, Gmres, HistoryEntry, Pcg, RadiositySystem, Solution, SolveOptions, Solver, SolverError,
};

/// Looks at the system and takes the solver that will be fastest.
///
/// What it looks at costs no pass over F: whether the exchange areas are symmetric, the number of patches n, of channels, and of distinct reflectances, the tolerance, and
/// from the reflectances and row sums s_i the greatest mean reflectance ρ_avg of a component that emits and bounds of the spectral radius λ of
/// diag(ρ) F: λ ≤ max ρ_i s_i, and λ ≥ min ρ_i s_i (Collatz and Wielandt with the vector 1). Whole estimates of the spectrum, by steps of Lanczos or powers of
/// F, were left out: each costs a pass, as much as a tenth of a solution, and none of the choices below turns on more than these bounds.
///
/// - `direct` where n / [`LU_RATIO`] passes (see [`Direct`]) for each distinct reflectance are less than an iteration takes, for so many channels: many lightings.
/// - `pcg` where the exchange areas are symmetric: the fewest passes at every ρ, and symmetric storage halves each.
/// - else `gauss-seidel` where λ is so small that its sweeps, which need no check before them, are fewer;
/// - else `gmres`.
///
/// The choice and its reason are in [`Solution::choice`]. How far it is from the best: `radiosity reproduce stability` prints the ratios of work and time, case by case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Auto {
    /// What `gmres` would be set to.
    pub gmres: Gmres,
    /// What `direct` would be set to.
    pub direct: Direct,
}

/// Multiplications of a factorisation that take the time of one in a pass: measured on two cores, see [`Direct`].
const LU_RATIO: f64 = 10.0;

/// Passes that conjugate gradients take for each decimal digit, beside the checks before and after.
const PASSES_PER_DIGIT: f64 = 2.0;

impl Solver for Auto {
    fn name(&self) -> &'static str {
        "auto"
    }

    fn solve(
        &self,
        system: &RadiositySystem,
        options: &SolveOptions,
        monitor: &mut dyn FnMut(&HistoryEntry) -> ControlFlow<()>,
    ) -> Result<Solution, SolverError> {
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
    pub fn choose(&self, system: &RadiositySystem, options: &SolveOptions) -> (Box<dyn Solver>, String) {
        let symmetric = system.operator().reciprocal_areas().is_some() || options.allow_nonreciprocal;
        let scaled = Scaled::new(system);
        let mean = greatest_mean_reflectance(&scaled);
        let (low, high) = spectral_radius_bounds(system);
        let digits = match options.tolerance {
            Tolerance::ResidualL2(value) => -value.log10(),
            // What an absolute tolerance amounts to is not known before the first residual: the default's six digits.
            Tolerance::ResidualMaxPower(_) | Tolerance::ResidualMax(_) => 6.0,
        };
        let facts = format!("mean reflectance {mean:.3}, spectral radius within {low:.3} to {high:.3}");
        if let Some(why) = self.direct_pays(system, digits) {
            return (Box::new(self.direct), why);
        }
        if symmetric {
            let why = format!("the exchange areas are symmetric; {facts}");
            return (Box::new(Pcg::default()), why);
        }
        let has_rows = system.operator().rows().is_some();
        // A sweep makes the error λ² times as large; the estimate lags by one sweep, and one check follows where others have two.
        let sweeps = digits / (-2.0 * high.log10()) + 1.0;
        if has_rows && high < 1.0 && sweeps < PASSES_PER_DIGIT * digits {
            let why = format!("the exchange areas are not symmetric, and light dies away fast; {facts}");
            return (Box::new(GaussSeidel), why);
        }
        let why = format!("the exchange areas are not symmetric; {facts}");
        (Box::new(self.gmres), why)
    }

    /// Tells whether a factorisation takes less time than an iteration, and why.
    fn direct_pays(&self, system: &RadiositySystem, digits: f64) -> Option<String> {
        let n = system.n_patches();
        let groups = equal_channels(system.reflectance()).len();
        let fits = memory_byte(n, groups) <= self.direct.memory_limit_byte && system.operator().rows().is_some();
        let factorisations = groups as f64 * n as f64 / LU_RATIO;
        let n_channels = system.n_channels() as f64;
        // Channels beyond the first cost less than the first, which reads the matrix.
        let iteration = (PASSES_PER_DIGIT * digits + 2.0) * (1.0 + CHANNEL_COST * (n_channels - 1.0));
        let solves = 3.0 * (1.0 + CHANNEL_COST * (n_channels - 1.0));
        (fits && factorisations + solves < iteration).then(|| {
            format!("{groups} factorisation(s) of {n} patches serve {n_channels} channel(s) in less time than passes would take")
        })
    }
}

/// What one more channel adds to a pass, as a share of the first.
const CHANNEL_COST: f64 = 0.3;

/// Returns min and max of ρ_i Σ_j F_ij, between which the spectral radius of diag(ρ) F lies; over the worst channel.
fn spectral_radius_bounds(system: &RadiositySystem) -> (f64, f64) {
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for c in 0..system.n_channels() {
        let products = (0..system.n_patches()).map(|i| system.reflectance().row(i)[c] * system.row_sums()[i]);
        let (min, max) = products.fold((f64::INFINITY, 0.0_f64), |(min, max), x| (min.min(x), max.max(x)));
        (low, high) = (low.max(min), high.max(max));
    }
    (low, high)
}
