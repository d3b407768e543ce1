//! `chebyshev`: the best polynomial for an interval that holds the spectrum.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

use std::num::NonZeroUsize;
use std::time::Instant;

use super::ambient::Ambient;
use super::entry::{SolverEntry, Symmetry};
use super::error::SolverError;
use super::history::Monitor;
use super::history::Setup;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual};
use super::solve::{SolveOptions, SolveResult, Solver};
use super::system::RadiositySystem;
use super::{error_bound, lanczos};
use crate::matrix::operator::Block;
use crate::setting::{Kind, Setting, Value};

/// The source of the interval \[μ, ν\] for the eigenvalues of G = I − diag(ρ) F, channel by channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpectrumBounds {
    /// 1 ± λ with a proved bound λ ≥ max |eigenvalue of diag(ρ) F|: max_i (ρ F v)_i / v_i for a vector v > 0 (Collatz and Wielandt).
    ///
    /// v = 1 gives ρ_max times the greatest row sum without a pass; only where that is 1 or more, v ← 1 + diag(ρ) F v follows, one pass each. It holds for every F ≥ 0. Where no
    /// bound below 1 is proved, λ = 1 is used, which is no bound where row sums are above 1.
    #[default]
    Safe,
    /// 1 ± ρ_avg, ρ_avg = Σ A ρ s / Σ A (the greatest of the connected components), as in the paper.
    ///
    /// It is no bound: eigenvalues outside it slow the method down, and can make it diverge where they are not in (0, 2).
    Average,
    /// \[1 − θ_max, 1 − θ_min\] from so many Lanczos steps, one pass each, with the residuals of the Ritz values θ added.
    ///
    /// It is never wider than `Safe`, and needs symmetric exchange areas.
    Lanczos(NonZeroUsize),
}

impl SpectrumBounds {
    /// [`Lanczos`](Self::Lanczos) with ten steps.
    pub const TEN_LANCZOS_STEPS: Self = Self::Lanczos(NonZeroUsize::MIN.saturating_add(9));

    /// The names, each with its description.
    pub const NAMES: &[(&str, &str)] = &[
        ("safe", "A bound that holds, from reflectances and row sums"),
        ("average", "1 ± the mean reflectance, as in the paper: no bound"),
        ("lanczos", "Ten Lanczos steps"),
    ];

    /// Returns the bounds of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "safe" => Some(Self::Safe),
            "average" => Some(Self::Average),
            "lanczos" => Some(Self::TEN_LANCZOS_STEPS),
            _ => None,
        }
    }
}

/// Chebyshev iteration, all channels together.
///
/// With γ = (ν + μ) / 2, σ = (ν − μ) / 2, r the residual of B:
///
/// D ← r / γ, B ← B + D in the first pass, with ω = 2 / γ; then
/// ω ← 1 / (γ − σ² ω / 4), D ← ω r + (γ ω − 1) D, B ← B + D.
///
/// The residual of pass k is a polynomial of degree k in G times the first one, the smallest in maximum on \[μ, ν\]: it falls by about
/// σ / (γ + sqrt(γ² − σ²)) a pass. No inner products and no rows; reciprocity is needed for [`SpectrumBounds::Lanczos`] alone. For the real spectra of reciprocal form factors any
/// interval inside (0, 2) converges if the spectrum is in (0, 2) too. Noise makes spectra complex, and row sums above 1 push eigenvalues out: it then diverges and
/// reports so. μ is at least 2⁻¹⁰.
///
/// Memory: 4 vectors. Work: one application of F a pass, one before the first, and those of the bounds, which count with the first pass.
/// Source: Baranoski, Bramley and Shirley 1995, section 3.3, equations (18) to (24).
/// Departures: line 17 takes the residual of B^(j+1) (printed B^(j)); line 8 divides by γ (printed: multiplies); D^(0) = r / γ; the default interval is one that holds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Chebyshev {
    /// The source of the interval.
    pub bounds: SpectrumBounds,
}

/// The least μ: with a smaller one, passes are spent on eigenvalues that need not exist.
const MIN_LOW: f64 = 1.0 / 1024.0;

/// The source of the interval of the eigenvalues: a [`SpectrumBounds`].
pub static BOUNDS: Setting = Setting {
    name: "bounds",
    help: "Where the interval of the eigenvalues comes from",
    letter: "BOUNDS",
    kind: Kind::Choice(SpectrumBounds::NAMES),
};

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "chebyshev",
    summary: "The best polynomial for an interval that holds the spectrum",
    settings: &[BOUNDS.or(Value::Choice("safe"))],
    symmetry: |s| match s.values.get(&BOUNDS) {
        // Lanczos steps find the spectrum of a symmetric matrix.
        Some(Value::Choice("lanczos")) => Symmetry::Needed,
        _ => Symmetry::Unused,
    },
    uses_hierarchy: false,
    goes_by_rows: false,
    make: |s| {
        let bounds = SpectrumBounds::named(s.values.get(&BOUNDS)?.choice()?)?;
        Some(Box::new(Chebyshev { bounds }))
    },
};

impl Solver for Chebyshev {
    fn name(&self) -> &'static str {
        "chebyshev"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let began = Instant::now();
        let scaled = Scaled::new(system);
        let (intervals, n_passes) = self.intervals(&scaled)?;
        let mut state = State {
            scaled: &scaled,
            radiosity: options.start.radiosity(&scaled),
            residual: scaled.zeros(),
            step: scaled.zeros(),
            intervals,
            omega: None,
            setup: Setup {
                work: n_passes as f64,
                time_s: began.elapsed().as_secs_f64(),
            },
        };
        iteration::run(&scaled, options, monitor, &mut state)
    }
}

/// [μ, ν] as its middle γ and half its width σ.
#[derive(Clone, Copy, Debug)]
struct Interval {
    middle: f64,
    half_width: f64,
}

impl Interval {
    fn new(low: f64, high: f64) -> Self {
        let low = low.max(MIN_LOW);
        let high = high.max(low);
        Self {
            middle: 0.5 * (high + low),
            half_width: 0.5 * (high - low),
        }
    }
}

impl Chebyshev {
    /// Returns an interval for each channel, and the passes spent on them.
    fn intervals(&self, scaled: &Scaled) -> Result<(Vec<Interval>, usize), SolverError> {
        let around = |radius: &f64| Interval::new(1.0 - radius, 1.0 + radius);
        if self.bounds == SpectrumBounds::Average {
            let means = Ambient::new(scaled).mean_reflectance();
            let of_channel = |c: usize| (0..means.n_rows()).map(|room| means.row(room)[c]).fold(0.0, f64::max);
            let radii: Vec<f64> = (0..means.n_channels()).map(of_channel).collect();
            return Ok((radii.iter().map(around).collect(), 0));
        }
        let (radii, n_safe) = error_bound::spectral_radius(scaled);
        let SpectrumBounds::Lanczos(n_steps) = self.bounds else {
            return Ok((radii.iter().map(around).collect(), n_safe));
        };
        let Some(areas) = scaled.system.operator().reciprocal_areas() else {
            return Err(SolverError::NeedsReciprocity { solver: "chebyshev" });
        };
        let ranges = lanczos::ranges(scaled, areas, n_steps.get());
        let both = ranges.iter().zip(&radii);
        let intervals = both.map(|(range, radius)| {
            let (least, greatest) = (range.0.max(-radius), range.1.min(*radius));
            Interval::new(1.0 - greatest, 1.0 - least)
        });
        Ok((intervals.collect(), n_safe + n_steps.get()))
    }
}

struct State<'a> {
    scaled: &'a Scaled<'a>,
    radiosity: Block,
    /// r of `radiosity`.
    residual: Block,
    /// D.
    step: Block,
    intervals: Vec<Interval>,
    /// ω of each channel; `None` before the first step.
    omega: Option<Vec<f64>>,
    setup: Setup,
}

impl Iteration for State<'_> {
    fn pass(&mut self, _excess: &[f64]) -> Estimate {
        // (factor of r, factor of the step before) of each channel.
        let factors: Vec<(f64, f64)> = if let Some(omega) = &mut self.omega {
            let both = omega.iter_mut().zip(&self.intervals);
            both.map(|(omega, interval)| {
                let (gamma, sigma) = (interval.middle, interval.half_width);
                *omega = 1.0 / (gamma - 0.25 * sigma * sigma * *omega);
                (*omega, gamma * *omega - 1.0)
            })
            .collect()
        } else {
            self.omega = Some(self.intervals.iter().map(|i| 2.0 / i.middle).collect());
            self.intervals.iter().map(|i| (1.0 / i.middle, 0.0)).collect()
        };
        let steps = self.step.values_mut().iter_mut().zip(self.residual.values());
        let all = steps.zip(self.radiosity.values_mut()).zip(factors.iter().cycle());
        for (((d, r), b), (of_residual, of_step)) in all {
            *d = of_residual * r + of_step * *d;
            *b += *d;
        }
        let truth = self.scaled.true_residual(&self.radiosity);
        self.residual.clone_from(&truth.residual);
        Estimate::True(truth)
    }

    fn radiosity(&self) -> Block {
        self.radiosity.clone()
    }

    fn restart(&mut self, truth: &TrueResidual, _excess: &[f64]) {
        self.residual.clone_from(&truth.residual);
        self.omega = None;
    }

    fn setup(&self) -> Setup {
        self.setup
    }
}
