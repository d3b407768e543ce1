//! `multigrid`: Gauss-Seidel on the patches, corrected on ever coarser levels.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the letters of the formulas and the names of what they look at"
)]

mod coarsest;
mod levels;
mod matrices;

use std::sync::Arc;
use std::time::Instant;

use super::entry::{SolverEntry, Symmetry};
use super::error::SolverError;
use super::gauss_seidel;
use super::history::Monitor;
use super::history::Setup;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual};
use super::solve::{SolveOptions, SolveResult, Solver};
use super::stop::Norms;
use super::system::RadiositySystem;
use crate::matrix::FormFactors;
use crate::matrix::operator::{Block, RowAccess};
use crate::mesh::hierarchy::Coarsening;
use crate::mesh::{Hierarchy, Prolongation};
use levels::Levels;
use matrices::Swept;

/// The matrices of the coarse levels.
#[derive(Clone, Debug, Default)]
pub enum CoarseMatrices {
    /// K' = R K P with the area-weighted means R and injection P.
    #[default]
    Galerkin,
    /// K' = diag(R ρ) F' with form factors of every coarser level, the finer levels first.
    ///
    /// Rows of a closed room must sum to 1, or the cycles diverge.
    Reevaluated(Vec<FormFactors>),
}

/// The solution of the coarsest level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Coarsest {
    /// By factoring I − K.
    #[default]
    Direct,
    /// By so many sweeps of Gauss-Seidel; Lewis uses 20.
    Sweeps(usize),
}

/// The calculation of the defect d = R (u − K u − f) of a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Defect {
    /// From the changes δ of the last sweep: d = −R U δ, where U is K above its diagonal.
    ///
    /// After its turn the residual of patch i is 0, and only the changes of later patches add to it. That takes half of R K or less, and nothing at all in a recursive call that begins at 0 and does not sweep.
    /// R U is stored in f32 where exitances have one sign: its error is 6e-8 of a correction, and vanishes with it.
    #[default]
    OfChanges,
    /// From the radiosities, with all of R K in f64, as Lewis does: the same numbers but for rounding.
    OfRadiosities,
}

/// The most patches of a coarsest level; where the hierarchy ends with more, one further level joins all that exchange light.
///
/// Factoring n patches takes n³ / 3 multiplications.
const COARSEST_MAX: usize = 1024;

/// Multigrid of the second kind: one sweep of Gauss-Seidel, then a correction from the next coarser level, which is found in the same way.
///
/// With K = diag(ρ) F, the means R over coarse patches, and a prolongation P, one cycle on u = f + K u is
///
/// u ← Gauss-Seidel(u), d = R u − R K u − R f, v ≈ (I − K')⁻¹ d, u ← u − P v,
///
/// where v comes from two recursive calls: the first begins at 0 and does not smooth, the second goes on from its result (a W-cycle). The parts of R K for d on all levels
/// are calculated beforehand: for d from the changes of the sweep ([`Defect`]) they cost a tenth of a pass, for d from the radiosities a quarter. Patches that a coarse one joins may have
/// any reflectances, 1e-12 beside 0.999999, and v is a mean of them: no patch is corrected by more than ρ_i (max |δ| + max |P v|), as the sweep leaves an error
/// |e_i| ≤ ρ_i (max |δ| + max |e|) where rows sum to at most 1. Radiosities that end below 0 are set to 0, which brings them
/// nearer to the solution, unless exitances are negative too.
///
/// The number of cycles does not depend on the number of patches, and with a direct solution of the coarsest level hardly on ρ.
///
/// In the room of Lewis it takes 4 cycles where Gauss-Seidel takes 11 or 12 sweeps, and in his form 1.364, 0.602, 0.507 and 0.454 as many multiplications at l = 1 to 4
/// (counted, `radiosity reproduce lewis --level 4`). Times: `docs/performance.md`.
///
/// Work of a cycle: 1.2 passes over F in the room of Lewis (1.36 from the radiosities), of which 1 is the serial sweep. Setup: F once, and a third of that; it is part of
/// [`Solution::setup_work`](super::Solution::setup_work) and of the first entry of the history.
/// Memory: R U takes at most a sixteenth of F in f64 where four patches make one, a twentieth in the room of Lewis (R K: a quarter), the coarser levels a tenth.
///
/// The history estimates the residual: the sweep finds the residual that the cycle before left. The estimate is that times the factor by which it fell, less a quarter, as a check that comes too early costs less than a cycle.
/// When it meets the tolerance, the true residual is calculated. With [`true_residuals`](Self::true_residuals) that is done after every cycle, at one more pass each.
///
/// Without a hierarchy there are two levels: the patches, and the sets of patches that exchange light.
/// Needs rows, not reciprocity. Where the coarsest level shows that the system multiplies light (row sums above 1), it ends as
/// [`StopReason::Diverged`](super::StopReason::Diverged).
///
/// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), sections 5 and 6. Departures: the algorithm as his program must have had it, which his figure 2 does not say: u − P v with d the negative residual,
/// v = 0 before the first recursive call, K of each level; corrections are bounded; defects from changes, Galerkin K', and a direct solution of the coarsest level, which 20 sweeps do not reach when ρ
/// nears 1; all can be set as he had them.
#[derive(Clone, Debug, Default)]
pub struct Multigrid {
    /// The levels; `None`: patches and sets of patches that exchange light.
    pub hierarchy: Option<Arc<Hierarchy>>,
    /// The prolongation of corrections to the finer level.
    pub prolongation: Prolongation,
    /// The matrices of the coarse levels.
    pub coarse_matrices: CoarseMatrices,
    /// The solution of the coarsest level.
    pub coarsest: Coarsest,
    /// The calculation of the defects.
    pub defect: Defect,
    /// Whether the true residual is calculated after every cycle.
    pub true_residuals: bool,
}

impl Multigrid {
    /// Returns the levels to use for a system.
    fn levels_for(&self, system: &RadiositySystem) -> Result<Hierarchy, SolverError> {
        let by_component = |labels: &[u32]| Hierarchy::of_groups(labels, system.areas());
        let Some(hierarchy) = &self.hierarchy else {
            return Ok(by_component(&system.components().labels));
        };
        if hierarchy.n_patches() != system.n_patches() {
            return Err(SolverError::Shape {
                what: "patches of the hierarchy",
                expected: system.n_patches(),
                found: hierarchy.n_patches(),
            });
        }
        let mut hierarchy = (**hierarchy).clone();
        let n_coarsest = hierarchy.levels().last().map(Coarsening::n_coarse);
        let galerkin = matches!(self.coarse_matrices, CoarseMatrices::Galerkin);
        if n_coarsest.is_none() || (n_coarsest > Some(COARSEST_MAX) && galerkin && self.coarsest == Coarsest::Direct) {
            let mut labels: Vec<u32> = system.components().labels.clone();
            for level in hierarchy.levels() {
                // A union that spans several sets belongs to the set of its first patch.
                let firsts = (0..level.n_coarse()).map(|k| labels[level.children(k)[0] as usize]);
                labels = firsts.collect();
            }
            hierarchy = hierarchy.then(consecutive(&labels), system.areas());
        }
        Ok(hierarchy)
    }
}

/// Renumbers labels from 0 in the order in which they appear.
fn consecutive(labels: &[u32]) -> Vec<u32> {
    let mut numbers = std::collections::HashMap::new();
    labels
        .iter()
        .map(|label| {
            let next = u32::try_from(numbers.len()).expect("fewer labels than patches");
            *numbers.entry(*label).or_insert(next)
        })
        .collect()
}

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "multigrid",
    summary: "Gauss-Seidel, corrected on ever coarser levels of the mesh",
    settings: &[],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: true,
    goes_by_rows: true,
    make: |s| {
        Some(Box::new(Multigrid {
            hierarchy: s.hierarchy.clone(),
            ..Multigrid::default()
        }))
    },
};

impl Solver for Multigrid {
    fn name(&self) -> &'static str {
        "multigrid"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let rows = system.rows_for(self.name())?;
        let scaled = Scaled::new(system);
        let dark = (0..system.n_channels()).all(|c| scaled.is_dark(c));
        let start = Instant::now();
        let hierarchy = self.levels_for(system)?;
        // Without light there is nothing to prepare for.
        let levels = if dark {
            None
        } else {
            Some(Levels::new(self, &hierarchy, rows, system)?)
        };
        let mut cycles = Cycles::new(self, &scaled, rows, &hierarchy, levels, options, start);
        iteration::run(&scaled, options, monitor, &mut cycles)
    }
}

struct Cycles<'a> {
    settings: &'a Multigrid,
    scaled: &'a Scaled<'a>,
    rows: &'a dyn RowAccess,
    hierarchy: &'a Hierarchy,
    levels: Option<Levels<'a>>,
    setup: Setup,
    /// False where the coarsest level shows that the system multiplies light.
    physical: bool,
    radiosity: Block,
    /// The residual that each patch had just before its update.
    before: Block,
    /// f of each channel.
    exitance: Vec<Vec<f64>>,
    /// ρ of each patch that light reaches, 0 of the others, \[c\]\[n\]; where it is 0 the sweep leaves no error.
    reflects: Vec<Vec<f64>>,
    forecast: Forecast,
}

impl<'a> Cycles<'a> {
    fn new(
        settings: &'a Multigrid,
        scaled: &'a Scaled<'a>,
        rows: &'a dyn RowAccess,
        hierarchy: &'a Hierarchy,
        levels: Option<Levels<'a>>,
        options: &SolveOptions,
        start: Instant,
    ) -> Self {
        let lit = lit_patches(scaled);
        let mut reflects = channels(scaled.system.reflectance());
        for (rho, lit) in reflects.iter_mut().flatten().zip(lit.iter().flatten()) {
            *rho *= lit;
        }
        let physical = levels.as_ref().is_none_or(|levels| levels.is_physical(&lit));
        let setup = levels.as_ref().map_or_else(Setup::default, |levels| Setup {
            work: levels.setup_multiply_adds / levels.n_of_f.max(1.0),
            time_s: start.elapsed().as_secs_f64(),
        });
        Self {
            settings,
            scaled,
            rows,
            hierarchy,
            levels,
            setup,
            physical,
            radiosity: options.start.radiosity(scaled),
            before: scaled.zeros(),
            exitance: channels(&scaled.exitance),
            reflects,
            forecast: Forecast::default(),
        }
    }
}

impl Iteration for Cycles<'_> {
    fn needs_residual(&self) -> bool {
        false
    }

    fn setup(&self) -> Setup {
        self.setup
    }

    fn pass(&mut self, _excess: &[f64]) -> Estimate {
        let Some(levels) = self.levels.as_ref().filter(|_| self.physical) else {
            return Estimate::Breakdown;
        };
        let old = self.radiosity.clone();
        gauss_seidel::sweep(self.scaled, self.rows, &mut self.radiosity, &mut self.before);
        let swept = swept(&self.radiosity, old, &self.before);
        let d = match self.settings.defect {
            Defect::OfRadiosities => levels.defect_of_radiosities(&channels(&self.radiosity), &self.exitance),
            Defect::OfChanges => levels.defect_of_changes(&swept),
        };
        let v = levels.correction(&d);
        let step = &self.hierarchy.levels()[0];
        let n_channels = v.len();
        let of_channels = v.iter().zip(&swept).zip(&self.reflects);
        for (c, ((v, swept), reflects)) in of_channels.enumerate() {
            let corrections = step.prolonged(self.settings.prolongation, v);
            // A patch reflects the error of its sweep, from changes after its turn and errors elsewhere.
            let incident = largest(&swept.changes) + largest(&corrections);
            let radiosities = self.radiosity.values_mut().iter_mut().skip(c).step_by(n_channels);
            for ((b, correction), rho) in radiosities.zip(corrections).zip(reflects) {
                if *rho > 0.0 {
                    // Neither `clamp` nor `max`, which would hide NaN.
                    let most = rho * incident;
                    *b -= if correction.abs() > most {
                        most.copysign(correction)
                    } else {
                        correction
                    };
                    if *b < 0.0 && !self.scaled.system.is_signed() {
                        *b = 0.0;
                    }
                }
            }
        }
        if self.settings.true_residuals {
            return Estimate::True(self.scaled.true_residual(&self.radiosity));
        }
        Estimate::Running(self.forecast.after(self.scaled.norms(&self.before)))
    }

    fn radiosity(&self) -> Block {
        self.radiosity.clone()
    }

    fn restart(&mut self, truth: &TrueResidual, _excess: &[f64]) {
        self.forecast.correct(&truth.norms);
    }

    fn work(&self) -> f64 {
        let levels = self.levels.as_ref();
        levels.map_or(0.0, |levels| levels.multiply_adds / levels.n_of_f.max(1.0))
    }
}

/// Returns the largest absolute value.
fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// Returns the effect, in each channel, of a sweep from `old` to `new` that found the residuals `met`.
fn swept(new: &Block, old: Block, met: &Block) -> Vec<Swept> {
    let mut changes = old;
    for (old, new) in changes.values_mut().iter_mut().zip(new.values()) {
        *old = new - *old;
    }
    let n_channels = new.n_channels();
    let mut swept: Vec<Swept> = channels(&changes)
        .into_iter()
        .map(|changes| Swept {
            changes,
            left: Vec::new(),
        })
        .collect();
    for (k, (change, residual)) in changes.values().iter().zip(met.values()).enumerate() {
        // A change of 0 with a residual means that the patch sends all of its light back to itself.
        if *change == 0.0 && *residual != 0.0 {
            swept[k % n_channels].left.push((k / n_channels, *residual));
        }
    }
    swept
}

/// Returns 1 for every patch that light can reach in a channel, otherwise 0.
fn lit_patches(scaled: &Scaled) -> Vec<Vec<f64>> {
    let (system, emits) = (scaled.system, scaled.system.emitting_components());
    let n_channels = system.n_channels();
    let labels = &system.components().labels;
    let lit = |c: usize, label: u32| f64::from(emits[label as usize * n_channels + c]);
    let of_channel = |c: usize| labels.iter().map(|&label| lit(c, label)).collect();
    (0..n_channels).map(of_channel).collect()
}

/// Returns the channels of a block one after the other.
fn channels(block: &Block) -> Vec<Vec<f64>> {
    (0..block.n_channels()).map(|c| block.channel(c)).collect()
}

/// The factor by which residuals after a cycle scatter around the forecast of the cycles before.
///
/// In the room of Lewis forecasts without it are 0.6 to 2.3 times the truth. A check that fails costs less than a cycle, and one that succeeds saves a cycle and a check: it saves time if it succeeds in two of five cases.
const SCATTER: f64 = 1.25;

/// The least likely residual after a cycle, from the residuals that the sweeps of this cycle and the one before found.
#[derive(Default)]
struct Forecast {
    met: Option<Norms>,
    said: Option<Norms>,
    /// The factor by which the last checked forecast was too small.
    correction: f64,
}

impl Forecast {
    /// Records the residual that the sweep of a cycle found, about that left by the cycle before, and forecasts that it goes on falling.
    fn after(&mut self, met: Norms) -> Norms {
        let correction = self.correction.max(1.0);
        let forecast = match &self.met {
            None => met.clone(),
            Some(before) => met.map_with(before, |now, last| {
                let factor = if last > 0.0 { (now / last).min(1.0) } else { 1.0 };
                correction * now * factor / SCATTER
            }),
        };
        self.met = Some(met);
        self.said = Some(forecast.clone());
        forecast
    }

    fn correct(&mut self, truth: &Norms) {
        if let Some(forecast) = &self.said {
            let ratios = truth.map_with(
                forecast,
                |true_norm, norm| if norm > 0.0 { true_norm / norm } else { 1.0 },
            );
            let worst = ratios.l2.iter().chain(&ratios.max).copied().fold(1.0, f64::max);
            self.correction = self.correction.max(1.0) * worst;
        }
    }
}
