//! `progressive-refinement`: the patch with the most unshot power shoots first (Southwell's relaxation).

use std::num::NonZeroUsize;
use std::time::Instant;

use super::ambient::Ambient;
use super::columns::Columns;
use super::entry::{SolverEntry, Symmetry};
use super::history::Monitor;
use super::history::Setup;
use super::iteration::{self, Estimate, Iteration};
use super::scaled::{Scaled, TrueResidual};
use super::solve::{SolveOptions, SolveResult, Solver};
use super::start::Start;
use super::stop::Tolerance;
use super::system::RadiositySystem;
use super::tournament::Tournament;
use crate::matrix::operator::Block;
use crate::setting::{Kind, Setting, Value};

/// Progressive refinement, all channels together.
///
/// With shot radiosities B̂ and unshot ones ΔB = E − (I − diag(ρ) F) B̂, a step chooses the patch i of the greatest |ΔB_i| A_i, and
///
/// B̂_i ← B̂_i + ΔB_i, then ΔB_i ← 0, then ΔB_j ← ΔB_j + ρ_j F_ji ΔB_i(old) for all j.
///
/// B = B̂ + ΔB is returned and recorded. The powers of several channels are added up, each in units of its greatest exitance, so that all channels
/// share the steps. A tree of winners finds the patch; a step costs O(k log n) where column i has k entries, and O(n) where it is full.
/// Columns come from rows by reciprocity, F_ji = F_ij A_i / A_j, where A_i F_ij is symmetric; of other form factors a transposed copy is made,
/// 12 bytes an entry and two passes, which count as work.
///
/// [`steps_per_pass`](Self::steps_per_pass) steps count as one pass; by default n, the work of one pass over F, and at most 16 n, as the caller can stop it
/// only between passes. The patience of
/// [`SolveOptions::patience`] is in n steps always, and counts those in which the unshot power Σ A |ΔB| has not fallen: each step lowers it, while the
/// residual's norm may rise for long, as power goes from large patches to small ones. A single channel with the tolerance
/// [`Tolerance::ResidualMaxPower`] stops at the very step after which ΔB meets it, other tolerances are tested after each pass. ΔB, updated from step
/// to step, is the estimate in the history: it is the residual of B̂, while B is one reflection further. Where patches differ much in size B may not meet the tolerance
/// then, as a large one collects the rests of many small ones: the steps go on, to a ΔB as much smaller. [`Start::Zero`] is the same as
/// [`Start::Exitance`]: B̂ = 0 and ΔB = E.
///
/// [`Solution::display`](super::Solution::display) is B_i + ρ_i Ambient, with Ambient the final even irradiance of the unshot light: it emits, absorbs and lets out as much power
/// as the solution, at every step. [`Solution::selections`](super::Solution::selections) holds the number of shots of each patch.
///
/// It converges where all ρ_i Σ_j F_ij < 1: every step takes power out of ΔB. It slows down like 1 / (1 − ρ).
///
/// Memory: 3 vectors and the tree. Work: n steps read as much of F as one application. From a disk each step reads a band of 64 rows, up to 64 times as much.
/// Source: Baranoski, Bramley and Shirley 1995, section 1.2 and equation (9). Departures: F_ii ≠ 0 is allowed; the display estimate adds the ambient
/// term times ρ_i, by connected component, and counts openings.
#[derive(Clone, Copy, Debug, Default)]
pub struct ProgressiveRefinement {
    /// Steps that count as one pass, or `None` for n; more than 16 n count as 16 n.
    pub steps_per_pass: Option<NonZeroUsize>,
}

/// Steps that count as one pass where patches shoot one by one.
pub static STEPS_PER_PASS: Setting = Setting {
    name: "steps_per_pass",
    help: "Steps that count as one pass [default: one per patch; at most 16 per patch]",
    letter: "N",
    kind: Kind::Count(u64::MAX),
};

/// Whether an estimate of the unshot light is added: [`Solution::displayed`](super::Solution::displayed).
pub static DISPLAY_AMBIENT: Setting = Setting {
    name: "display_ambient",
    help: "Add an estimate of the unshot light to the radiosity, for an image after few passes",
    letter: "",
    kind: Kind::Flag,
};

pub(super) const ENTRY: SolverEntry = SolverEntry {
    name: "progressive-refinement",
    summary: "The patch with the most unshot power shoots first",
    settings: &[STEPS_PER_PASS.optional(), DISPLAY_AMBIENT.optional()],
    symmetry: |_| Symmetry::Unused,
    uses_hierarchy: false,
    goes_by_rows: true,
    make: |s| {
        let steps_per_pass = s.values.get(&STEPS_PER_PASS).and_then(Value::size);
        Some(Box::new(ProgressiveRefinement { steps_per_pass }))
    },
};

impl Solver for ProgressiveRefinement {
    fn name(&self) -> &'static str {
        "progressive-refinement"
    }

    fn solve(&self, system: &RadiositySystem, options: &SolveOptions, monitor: Monitor<'_>) -> SolveResult {
        let began = Instant::now();
        let scaled = Scaled::new(system);
        let columns = Columns::new(system, self.name())?;
        let ambient = Ambient::new(&scaled);
        let light = Light::new(began, &scaled, &columns, &ambient, options, self.steps_per_pass);
        let mut powers = Tournament::new(system.n_patches());
        for i in 0..system.n_patches() {
            powers.set(i, light.power(i));
        }
        let options = light.options(options);
        iteration::run(&scaled, &options, monitor, &mut Shooting { light, powers })
    }
}

/// The most passes' work in steps that count as one pass, which cannot be interrupted.
const MAX_PASSES_IN_ONE: usize = 16;

/// Light that is shot patch by patch, for this method and [`Overshooting`](super::Overshooting).
pub(super) struct Light<'a> {
    pub(super) scaled: &'a Scaled<'a>,
    pub(super) columns: &'a Columns<'a>,
    pub(super) ambient: &'a Ambient<'a>,
    /// B̂.
    pub(super) shot: Block,
    /// ΔB.
    pub(super) unshot: Block,
    /// The number of shots of each patch.
    pub(super) selections: Vec<u64>,
    pub(super) steps_per_pass: usize,
    /// The power, in solver units, at which a pass ends early: for one channel with a tolerance on power.
    pub(super) enough: Option<f64>,
    /// Steps of the last pass.
    pub(super) n_steps: usize,
    /// The work before the first step.
    pub(super) setup: Setup,
}

impl<'a> Light<'a> {
    /// Prepares the light; `began` is the time at which the columns were begun.
    pub(super) fn new(
        began: Instant,
        scaled: &'a Scaled<'a>,
        columns: &'a Columns<'a>,
        ambient: &'a Ambient<'a>,
        options: &SolveOptions,
        steps_per_pass: Option<NonZeroUsize>,
    ) -> Self {
        let n = scaled.system.n_patches();
        let mut work = columns.setup_work();
        let (shot, unshot) = match options.start {
            Start::Exitance | Start::Zero => (scaled.zeros(), scaled.exitance.clone()),
            Start::Ambient => {
                work += 1.0;
                let shot = options.start.radiosity(scaled);
                let unshot = scaled.true_residual(&shot).residual;
                (shot, unshot)
            }
        };
        let enough = match options.tolerance {
            Tolerance::ResidualMaxPower(power) if scaled.system.n_channels() == 1 => {
                Some(power / scaled.system.area_unit() / scaled.system.exitance_units()[0])
            }
            _ => None,
        };
        Self {
            scaled,
            columns,
            ambient,
            shot,
            unshot,
            selections: vec![0; n],
            steps_per_pass: steps_per_pass.map_or(n, |steps| steps.get().min(n.saturating_mul(MAX_PASSES_IN_ONE))),
            enough,
            n_steps: 0,
            setup: Setup {
                work,
                time_s: began.elapsed().as_secs_f64(),
            },
        }
    }

    /// Returns options with the patience converted from passes of n steps to passes of this method.
    pub(super) fn options<'o>(&self, options: &SolveOptions<'o>) -> SolveOptions<'o> {
        let passes = self.unshot.n_rows().div_ceil(self.steps_per_pass);
        SolveOptions {
            patience: options.patience.saturating_mul(passes),
            ..*options
        }
    }

    /// Returns |ΔB_i| A_i, the sum over the channels.
    pub(super) fn power(&self, i: usize) -> f64 {
        let sum: f64 = self.unshot.row(i).iter().map(|b| b.abs()).sum();
        sum * self.scaled.areas[i]
    }

    /// Shoots `light` (per channel) from patch i and calls `changed(j, F_ji, ΔB_j)` for each patch that receives some.
    pub(super) fn shoot(&mut self, i: usize, light: &[f64], mut changed: impl FnMut(usize, f64, &[f64])) {
        self.selections[i] += 1;
        self.n_steps += 1;
        let shares = self.shot.row_mut(i).iter_mut().zip(self.unshot.row_mut(i)).zip(light);
        for ((shot, unshot), b) in shares {
            *shot += b;
            *unshot -= b;
        }
        let (unshot, reflectance) = (&mut self.unshot, self.scaled.system.reflectance());
        self.columns.visit(i, |j, f_ji| {
            let received = unshot.row_mut(j);
            for ((to, rho), b) in received.iter_mut().zip(reflectance.row(j)).zip(light) {
                *to += rho * f_ji * b;
            }
            changed(j, f_ji, received);
        });
    }

    /// Returns B = B̂ + ΔB.
    pub(super) fn radiosity(&self) -> Block {
        let mut radiosity = self.shot.clone();
        for (b, unshot) in radiosity.values_mut().iter_mut().zip(self.unshot.values()) {
            *b += unshot;
        }
        radiosity
    }

    /// Restarts from B, the radiosities of `truth`: they count as shot, and their residual, `excess` times the tolerance, as unshot.
    pub(super) fn restart(&mut self, truth: &TrueResidual, excess: &[f64]) {
        self.shot = self.radiosity();
        self.unshot.clone_from(&truth.residual);
        if let Some(enough) = &mut self.enough
            && excess[0].is_finite()
        {
            *enough /= excess[0].max(1.0);
        }
    }

    /// Returns B_i + ρ_i Ambient.
    pub(super) fn display(&self) -> Block {
        let mut display = self.ambient.irradiance(&self.unshot);
        let terms = self.radiosity();
        let reflectance = self.scaled.system.reflectance();
        for ((value, b), rho) in display
            .values_mut()
            .iter_mut()
            .zip(terms.values())
            .zip(reflectance.values())
        {
            *value = b + rho * *value;
        }
        display
    }

    /// Returns the work of the last pass.
    pub(super) fn work(&self) -> f64 {
        self.n_steps as f64 / self.unshot.n_rows() as f64
    }
}

struct Shooting<'a> {
    light: Light<'a>,
    /// |ΔB_i| A_i.
    powers: Tournament,
}

impl Iteration for Shooting<'_> {
    fn needs_residual(&self) -> bool {
        false
    }

    fn pass(&mut self, _excess: &[f64]) -> Estimate {
        self.light.n_steps = 0;
        let mut light = vec![0.0; self.light.unshot.n_channels()];
        while self.light.n_steps < self.light.steps_per_pass {
            let (i, power) = self.powers.winner();
            if self.light.enough.is_some_and(|enough| power <= enough) {
                break;
            }
            light.copy_from_slice(self.light.unshot.row(i));
            let (powers, areas) = (&mut self.powers, &self.light.scaled.areas);
            // The patch itself may or may not be among the receivers.
            powers.set(i, 0.0);
            self.light.shoot(i, &light, |j, _, unshot| {
                let sum: f64 = unshot.iter().map(|b| b.abs()).sum();
                powers.set(j, sum * areas[j]);
            });
        }
        Estimate::Running(self.light.scaled.norms(&self.light.unshot))
    }

    fn radiosity(&self) -> Block {
        self.light.radiosity()
    }

    fn restart(&mut self, truth: &TrueResidual, excess: &[f64]) {
        self.light.restart(truth, excess);
        for i in 0..self.light.unshot.n_rows() {
            self.powers.set(i, self.light.power(i));
        }
    }

    fn setup(&self) -> Setup {
        self.light.setup
    }

    fn work(&self) -> f64 {
        self.light.work()
    }

    fn display(&self) -> Option<Block> {
        Some(self.light.display())
    }

    /// Returns Σ A |ΔB|.
    fn under_way(&self) -> Option<f64> {
        Some((0..self.light.unshot.n_rows()).map(|i| self.light.power(i)).sum())
    }

    fn selections(&self) -> Vec<u64> {
        self.light.selections.clone()
    }
}
