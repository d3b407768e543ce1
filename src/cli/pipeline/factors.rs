//! Form factors: method, computation, repair, checks.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use std::time::{Duration, Instant};

use serde_json::json;

use super::repair::repair;
use super::{Prepared, Run};
use crate::audit::Repair;
use crate::cli::args::{BalanceName, MethodArgs, StorageName};
use crate::cli::exit_code::ExitCode;
use crate::cli::failure::Failure;
use crate::cli::storage;
use crate::form_factor::registry::{self, MethodEntry, Setting};
use crate::form_factor::{
    self, Before, ExactMethod, FormFactorError, FormFactorMethod, MethodSettings, PairCounts, Reciprocity, SkyFactors,
};
use crate::matrix::{BalanceReport, Checks, FormFactors, Need, RepairKind, Sampling};
use crate::printable::counted;
use crate::progress::Progress as _;
use crate::scene::Scene;
use crate::visibility::blockers::BlockerIndex;

/// Form factors with what was found out about them.
pub(in crate::cli) struct Computed {
    pub(in crate::cli) factors: FormFactors,
    pub(in crate::cli) checks: Checks,
    pub(in crate::cli) balance: Option<BalanceReport>,
    pub(in crate::cli) closed: bool,
    pub(in crate::cli) pairs: Option<PairCounts>,
    pub(in crate::cli) tolerance_met: bool,
    /// What the run that uses them is to end with, if all else goes well.
    pub(in crate::cli) code: ExitCode,
    /// True if the entries have errors.
    pub(in crate::cli) errors_known: bool,
    /// The rows that are known to sum to 1, \[n\].
    pub(in crate::cli) closed_rows: Vec<bool>,
    /// The power that form factors without reciprocity make, m², \[n\].
    pub(in crate::cli) gain: Vec<f64>,
    /// The fractions of the light of each patch that escape and that black backs take, \[n\].
    pub(in crate::cli) sky: SkyFactors,
}

/// What is promised of form factors beside what they say themselves.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) struct Promised {
    pub(in crate::cli) reciprocity: Reciprocity,
    /// True if the entries have errors.
    pub(in crate::cli) errors_known: bool,
    /// What a repair did to the row sums before.
    pub(in crate::cli) repair: Repair,
    /// True if entries err by a rule.
    pub(in crate::cli) by_rule: bool,
    /// True if they are symmetric, with noise that is known of each.
    pub(in crate::cli) noisy_pairs: bool,
}

/// A method with what is known of its matrix.
pub(in crate::cli) struct Chosen {
    pub(in crate::cli) method: Box<dyn FormFactorMethod>,
    /// True if it computes whole rows.
    by_rows: bool,
    /// The most entries that a row can have, where the settings tell.
    n_entries: Option<u64>,
}

/// How finely form factors are computed, as far as commands differ in it.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) struct Fineness {
    /// Rays for each patch unless `--rays` says otherwise.
    pub(in crate::cli) default_rays: u64,
    /// The tolerance asked for, or the command's own.
    pub(in crate::cli) tolerance: Option<f64>,
    /// What is taken where none is asked for, by methods that have a tolerance.
    pub(in crate::cli) default_tolerance: f64,
    /// The flag that sets it.
    pub(in crate::cli) tolerance_flag: &'static str,
}

impl Fineness {
    /// Returns what the tolerance is called among the settings.
    fn tolerance_name(self) -> String {
        self.tolerance_flag.trim_start_matches('-').replace('-', "_")
    }

    fn tolerance_for(self, entry: &MethodEntry) -> Option<f64> {
        let has_one = entry.settings.iter().any(|s| matches!(s, Setting::Tolerance(_)));
        self.tolerance.or(has_one.then_some(self.default_tolerance))
    }
}

/// Says how visibility is found by exact clipping.
fn explain_exact(prepared: &mut Prepared, fineness: Fineness) {
    let tolerance = fineness.tolerance.unwrap_or(fineness.default_tolerance);
    let plan = &mut prepared.plan;
    if !plan.convex_and_empty {
        let n = BlockerIndex::new(&prepared.scene).n_blockers();
        plan.revise(
            "visibility",
            format!("exact clipping against {n} occluders"),
            "a vertex lies behind the plane of a face: something may block; flat neighbours count as one occluder",
        );
        let reason = if fineness.tolerance.is_some() {
            "as asked for"
        } else if tolerance > ExactMethod::DEFAULT_TOLERANCE {
            "the size of the patches weighs more in a picture than this"
        } else {
            "the default"
        };
        plan.decide("form-factor tolerance", format!("{tolerance:e}"), reason);
    }
}

/// Returns the greatest error of A_i F_ij / min(A_i, A_j).
fn worst_error(factors: &FormFactors) -> f64 {
    let areas = factors.areas();
    let mut worst = 0.0_f64;
    for (i, area) in areas.iter().enumerate() {
        factors.for_each_in_row(i, |j, _, error| worst = worst.max(error * area / area.min(areas[j])));
    }
    worst
}

fn counted_pairs(n: u64) -> String {
    counted(usize::try_from(n).unwrap_or(usize::MAX), "pair")
}

/// Tells whether form factors that do not meet their tolerance spent a budget before; where nothing is known of their pairs, that is what it was.
pub(in crate::cli) fn spent_budget(pairs: Option<PairCounts>) -> bool {
    pairs.is_none_or(|pairs| pairs.n_above_tolerance > 0)
}

/// Returns the exit code that form factors deserve: that of work which falls short of what was asked for.
///
/// What coordinates that are rounded leave open is no failure of the run: files as ordinary as those turned out of the axes with six decimals know form factors to 1e-5, not to
/// the default of 1e-6, and no work changes that. A warning tells it, and `tolerance_met`.
pub(super) fn code(tolerance_met: bool, pairs: Option<PairCounts>) -> ExitCode {
    if tolerance_met || !spent_budget(pairs) {
        ExitCode::Done
    } else {
        ExitCode::NotConverged
    }
}

/// The share of a limited time that form factors get, where something follows that takes as long.
const FORM_FACTORS_OF_TIME: [(&str, f64); 3] = [("form-factors", 0.9), ("solve", 0.7), ("render", 0.4)];

impl Run {
    /// Computes form factors, makes them symmetric where that is asked for, and checks them.
    pub(in crate::cli) fn form_factors(
        &mut self,
        prepared: &mut Prepared,
        args: &MethodArgs,
        fineness: Fineness,
        need: Need,
    ) -> Result<Computed, Failure> {
        let need = self.or_symmetry(args.balance, need)?;
        let (result, promised) = self.raw_form_factors(prepared, args, fineness, need, None)?;
        self.repaired(prepared, result, args, need, promised)
    }

    /// Computes form factors, with those from `before` a change as far as they stay the same.
    pub(in crate::cli) fn raw_form_factors(
        &mut self,
        prepared: &mut Prepared,
        args: &MethodArgs,
        fineness: Fineness,
        need: Need,
        before: Option<Before<'_>>,
    ) -> Result<(form_factor::Computed, Promised), Failure> {
        let chosen_for_time;
        let (args, fineness) = match args.time_limit {
            Some(limit) => {
                chosen_for_time = self.chosen_for_time(prepared, args, fineness, limit);
                (&chosen_for_time.0, chosen_for_time.1)
            }
            None => (args, fineness),
        };
        let Chosen {
            method,
            by_rows,
            n_entries,
        } = self.method(args, fineness)?;
        if method.name() == "exact" {
            if self.common.explain {
                explain_exact(prepared, fineness);
            }
            let nothing = "rays between patches: nothing here is sampled".into();
            prepared.plan.left_out.push(nothing);
        }
        // Pairs without occluders need no rays.
        let has_noisy_pairs = method.has_noisy_pairs() && !prepared.input().unoccluded;
        let sampling = if by_rows {
            Sampling::of_rows(n_entries.is_some(), self.is_net())
        } else {
            Sampling::of_pairs(has_noisy_pairs)
        };
        let kind = repair(args.balance, need, sampling);
        let matrix = storage::Matrix {
            by_rows,
            repaired: matches!(kind, RepairKind::Closed | RepairKind::Rescaled),
            n_entries: n_entries.unwrap_or(u64::MAX),
            n_beside: u32::from(kind == RepairKind::Pooled),
            working_byte: method.working_byte(prepared.mesh.n_patches()),
        };
        let chosen = storage::choose(self, prepared, matrix)?;
        let input = prepared.input();
        storage::open_checkpoint(self, prepared)?;
        let result = self.times.time("form_factors", || match before {
            Some(before) => method.update(input, before, chosen.choice(), &self.progress),
            None => method.compute(input, chosen.choice(), &self.progress),
        })?;
        self.note_warnings(self.progress.warnings());
        self.progress.begin("checks", 0);
        self.progress.deadline = args.time_limit.map(|limit| self.begun + limit);
        if let Some(checkpoint) = &self.progress.checkpoint
            && let Some(reason) = checkpoint.failure()
        {
            self.warn(&format!(
                "{}: the checkpoint could not be written to its end: {reason}; the work itself went on",
                checkpoint.path().display()
            ));
        }
        let of_pairs = result.pairs.map_or(0, |pairs| pairs.n_rays);
        if of_pairs > 0 || result.factors.tallies().iter().any(|tally| tally.n_rays > 0) {
            self.warn_of_narrow_gaps(prepared);
        }
        self.warn_above_tolerance(&prepared.scene, &result, fineness);
        let promised = Promised {
            reciprocity: method.reciprocity(),
            errors_known: true,
            repair: Repair::Not,
            by_rule: method.errs_by_rule(),
            noisy_pairs: has_noisy_pairs,
        };
        Ok((result, promised))
    }

    /// Chooses method and tolerance for a limit of the whole run's time, of which form factors get a share.
    fn chosen_for_time(
        &mut self,
        prepared: &mut Prepared,
        args: &MethodArgs,
        fineness: Fineness,
        limit: Duration,
    ) -> (MethodArgs, Fineness) {
        let share = FORM_FACTORS_OF_TIME
            .iter()
            .find(|(command, _)| *command == self.command);
        let share = share.map_or(1.0, |(_, share)| *share);
        let left = limit.saturating_sub(self.begun.elapsed()).mul_f64(share);
        let end = Instant::now() + left;
        let tolerance = fineness.tolerance.unwrap_or(fineness.default_tolerance);
        let choice = self.times.time("forecast", || {
            form_factor::within(prepared.input(), tolerance, left, &self.progress)
        });
        self.progress.deadline = Some(end);
        self.set("time_limit_s", limit.as_secs_f64());
        prepared.plan.decide(
            "method",
            choice.method,
            format!(
                "expected to take {:.1} of {:.1} s",
                choice.expected_s,
                left.as_secs_f64()
            ),
        );
        let args = MethodArgs {
            method: choice.method.to_owned(),
            rays: choice.rays,
            sequence: args.sequence.filter(|_| choice.rays.is_some()),
            ..args.clone()
        };
        let tolerance = choice.tolerance;
        (args, Fineness { tolerance, ..fineness })
    }

    /// Warns of pairs above the tolerance, by what makes them so.
    fn warn_above_tolerance(&self, scene: &Scene, result: &form_factor::Computed, fineness: Fineness) {
        let Some(pairs) = result.pairs else {
            return;
        };
        if pairs.n_above_tolerance > 0 {
            self.warn(&format!(
                "{} of patches spent the budget, or the digits of f64, above the tolerance; the worst error of all pairs is {:.1e}; give a greater --budget or {}",
                counted_pairs(pairs.n_above_tolerance),
                worst_error(&result.factors),
                fineness.tolerance_flag
            ));
        }
        if let Some(rounded) = pairs.doubted(scene) {
            self.warn(&format!("{rounded}, or a greater {}", fineness.tolerance_flag));
        }
    }

    /// Returns the need, or that of symmetric form factors if the storage asked for is theirs.
    pub(in crate::cli) fn or_symmetry(&self, balance: BalanceName, need: Need) -> Result<Need, Failure> {
        let wanted = self.storage.args.memory.storage == StorageName::Symmetric;
        if wanted && balance == BalanceName::Off {
            return Err(Failure::usage(
                "--storage symmetric makes form factors symmetric, and --balance off keeps them as they are; leave one of them out",
            ));
        }
        Ok(if wanted { Need::Symmetry } else { need })
    }

    pub(in crate::cli) fn method(&mut self, args: &MethodArgs, fineness: Fineness) -> Result<Chosen, Failure> {
        let entry = registry::by_name(&args.method)?;
        // The direct pass of a render takes its numbers from there too.
        let sequence_is_elsewhere = self.command == "render" && !entry.settings.contains(&Setting::Sequence);
        let resolved = entry.resolve(&MethodSettings {
            rays: args.rays.or(entry.shoots().then_some(fineness.default_rays)),
            points: args.points,
            resolution: args.resolution,
            normalise: args.normalise,
            sequence: args.sequence.filter(|_| !sequence_is_elsewhere).map(Into::into),
            tolerance: fineness.tolerance_for(entry),
            budget: args.budget,
            seed: args.seed,
        });
        let settings = resolved.map_err(|error| match error {
            // Where the solver has a tolerance too, the flag has a longer name.
            FormFactorError::UnusedSetting {
                flag: "--tolerance",
                method,
                used_by,
            } => FormFactorError::UnusedSetting {
                flag: fineness.tolerance_flag,
                method,
                used_by,
            },
            other => other,
        })?;
        self.set("method", entry.name);
        self.set("seed", args.seed);
        if let Some(rays) = settings.rays {
            self.set("rays", rays);
        }
        if let Some(points) = settings.points {
            self.set("points", points.get());
        }
        if let Some(resolution) = settings.resolution {
            self.set("resolution", resolution.get());
        }
        if entry.settings.contains(&Setting::Normalise) {
            self.set("normalise", settings.normalise);
        }
        if let Some(sequence) = settings.sequence {
            self.set("sequence", json!(sequence));
        }
        if let Some(tolerance) = settings.tolerance {
            self.set(&fineness.tolerance_name(), tolerance);
        }
        if let Some(budget) = settings.budget {
            self.set("budget", budget.get());
        }
        let by_rows = entry.by_rows() || settings.normalise;
        // From one and two points a side, errors are stated of patches that no ray hit, too.
        let is_sparse = settings.points.is_none_or(|points| points.get() > 2);
        let n_entries = settings.rays.filter(|_| entry.shoots() && is_sparse);
        Ok(Chosen {
            method: entry.build(&settings),
            by_rows,
            n_entries,
        })
    }
}
