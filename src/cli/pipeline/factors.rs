//! Form factors: method, computation, repair, checks.

#![expect(
    clippy::shadow_unrelated,
    reason = "inner scopes reuse the names of what they look at"
)]

use std::time::{Duration, Instant};

use serde_json::json;

use super::{Prepared, Run};
use crate::audit::{self, Claims, Repair};
use crate::cli::args::{BalanceName, MethodArgs, StorageName};
use crate::cli::exit_code::ExitCode;
use crate::cli::failure::Failure;
use crate::cli::storage;
use crate::form_factor::MAX_ESCAPED;
use crate::form_factor::registry::{self, MethodEntry, Setting};
use crate::form_factor::{
    self, Before, Closure, Enclosed, ExactMethod, FormFactorError, FormFactorMethod, MethodSettings, PairCounts,
    Reciprocity, SkyFactors,
};
use crate::matrix::{BalanceReport, Checks, Closed, FormFactors, Need, RepairKind, RowTally, Sampling};
use crate::printable::counted;
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
            format!("exact clipping against {n} blockers"),
            "a vertex lies behind the plane of a face: something may block; flat neighbours count as one blocker",
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
fn code(tolerance_met: bool, pairs: Option<PairCounts>) -> ExitCode {
    if tolerance_met || !spent_budget(pairs) {
        ExitCode::Done
    } else {
        ExitCode::NotConverged
    }
}

/// The share of a limited time that form factors get, where something follows that takes as long.
const FORM_FACTORS_OF_TIME: [(&str, f64); 3] = [("form-factors", 0.9), ("solve", 0.7), ("render", 0.4)];

/// Row sums are restored to far below the noise, or as far as so many passes go.
pub(in crate::cli) const BALANCE_TOLERANCE: f64 = 1e-10;
const BALANCE_PASSES: usize = 200;

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
        // No ray is traced between patches that nothing can stand between.
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

    /// Warns of rays of rows that are known to sum to 1 which met no front all the same.
    fn warn_of_slipped_rays(&mut self, raw: &FormFactors, closed_rows: &[bool]) {
        let n_rays: u64 = raw.tallies().iter().map(|tally| tally.n_rays).sum();
        let tallies = raw.tallies().iter().zip(closed_rows);
        let of_closed = tallies.filter(|(_, is_closed)| **is_closed);
        let n_lost: u64 = of_closed.map(|(tally, _)| tally.n_escaped + tally.n_absorbed).sum();
        if n_lost > 0 {
            self.warn(&format!(
                "{n_lost} of {n_rays} rays slipped out of a closed scene, or behind its faces where two of them touch; the row sums show what that amounts to"
            ));
        }
    }

    /// Tells whether a method between pairs may ask rays; form factors from a file have no method among the settings, and ask none.
    fn may_ask_rays(&self) -> bool {
        self.settings.get("method").is_some_and(|name| name != "exact")
    }

    /// Makes form factors symmetric where that is asked for, and checks them.
    pub(in crate::cli) fn repaired(
        &mut self,
        prepared: &mut Prepared,
        result: form_factor::Computed,
        args: &MethodArgs,
        need: Need,
        promised: Promised,
    ) -> Result<Computed, Failure> {
        let (raw, asked) = (result.factors, args.balance);
        let enclosed = self.enclosed(prepared, raw.tallies(), args.closure.closure())?;
        let closed_rows = &enclosed.rows;
        self.warn_of_slipped_rays(&raw, closed_rows);
        let sampling = if raw.is_symmetric() {
            Sampling::of_pairs(promised.noisy_pairs && !raw.has_rays() && closed_rows.contains(&true))
        } else {
            Sampling::of_rows(raw.has_rays(), self.is_net())
        };
        let kind = repair(asked, need, sampling);
        let wanted = matches!(kind, RepairKind::Closed | RepairKind::Rescaled);
        self.set(
            "balance",
            match kind {
                RepairKind::Closed => json!("closure"),
                RepairKind::Pooled => json!("pooled"),
                RepairKind::Rescaled | RepairKind::Nothing => json!(wanted),
            },
        );
        let claims = |repair| Claims {
            closed: Closed::Where(closed_rows),
            reciprocity: promised.reciprocity,
            errors_known: promised.errors_known,
            repair,
            by_rule: promised.by_rule,
        };
        if prepared.plan.convex_and_empty && result.pairs.is_some() && self.may_ask_rays() {
            prepared
                .plan
                .left_out
                .push("rays between patches: nothing can block".into());
        }
        if asked == BalanceName::Closure
            && !closed_rows.contains(&true)
            && raw.tallies().iter().all(|tally| tally.n_rays == 0)
        {
            self.warn(
                "--balance closure changes nothing: no row is known to sum to 1, as the scene is not known to be closed; state it with --closed",
            );
        }
        // What states no error has nothing else that could tell of it.
        let doubted = if wanted || !promised.errors_known {
            self.doubted_rows(prepared, &raw, claims(Repair::Not))?
        } else {
            Vec::new()
        };
        let (factors, balance) = self.mended(prepared, raw, kind, asked, (closed_rows, &doubted))?;
        if let Some(report) = balance.filter(|report| !report.converged) {
            self.set("balance_converged", false);
            self.warn(&format!(
                "rebalancing left row sums off by up to {:.1e} after {} passes",
                report.row_error_max, report.n_passes
            ));
        }
        let checks = self.times.time("checks", || factors.checks(closed_rows.as_slice()));
        let sky = self.times.time("sky", || {
            form_factor::sky_factors(prepared.input(), &factors, promised.reciprocity, &enclosed)
        });
        factors.if_readable(())?;
        let repair = match balance {
            Some(report) if report.converged => Repair::Within(BALANCE_TOLERANCE),
            Some(_) => Repair::GaveUp,
            None => promised.repair,
        };
        let audit::FormFactorAudit { audit, gain } = self
            .times
            .time("audit", || audit::form_factors(&factors, claims(repair)))?;
        self.audited(audit);
        Ok(Computed {
            gain,
            factors,
            checks,
            balance,
            closed: enclosed.closed,
            pairs: result.pairs,
            tolerance_met: result.tolerance_met,
            code: code(result.tolerance_met, result.pairs),
            errors_known: promised.errors_known,
            sky,
            closed_rows: enclosed.rows,
        })
    }

    /// Repairs form factors, and says what was done and why.
    fn mended(
        &mut self,
        prepared: &mut Prepared,
        raw: FormFactors,
        kind: RepairKind,
        asked: BalanceName,
        (closed_rows, doubted): (&[bool], &[usize]),
    ) -> Result<(FormFactors, Option<BalanceReport>), Failure> {
        let how = match kind {
            RepairKind::Nothing => {
                let reason = if raw.is_symmetric() && asked == BalanceName::Auto {
                    "they are symmetric as they are"
                } else {
                    "no symmetric system is needed"
                };
                let left_out = format!("balancing of the form factors: {reason}");
                prepared.plan.left_out.push(left_out);
                return Ok((raw, None));
            }
            RepairKind::Pooled => "by their variances; rows keep the sums that their rays count",
            RepairKind::Closed => "the defect of the row sums spread by the entries' variances",
            RepairKind::Rescaled => "rows rescaled symmetrically",
        };
        let is_symmetric = raw.is_symmetric();
        let (factors, report) = self.times.time("balance", || {
            let mut targets = raw.row_targets(closed_rows);
            for &i in doubted {
                targets.keep(i, raw.row_sum(i));
            }
            raw.repaired(kind, &targets, BALANCE_TOLERANCE, BALANCE_PASSES)
        })?;
        let passes = report.map_or_else(String::new, |report| format!(" in {} passes", report.n_passes));
        let average = if is_symmetric {
            ""
        } else {
            "each pair averaged with its reverse, "
        };
        let why = format!("{average}{how}{passes}");
        let result = if report.is_some() { "restored" } else { "to the noise" };
        prepared.plan.decide("reciprocity", result, why);
        Ok((factors, report))
    }

    /// Returns the numbers of rows that ought to sum to 1 and do not, and warns of them.
    fn doubted_rows(
        &mut self,
        prepared: &Prepared,
        raw: &FormFactors,
        claims: Claims<'_>,
    ) -> Result<Vec<usize>, Failure> {
        let is_doubted = self.times.time("checks", || audit::doubted_rows(raw, claims))?;
        let doubted: Vec<usize> = (0..raw.n_rows()).filter(|&i| is_doubted[i]).collect();
        let n = doubted.len();
        if let Some(&first) = doubted.first() {
            let face = &prepared.scene.faces[prepared.mesh.patches[first].face.0 as usize];
            self.warn(&format!(
                "{}:{}: the rows of {n} patches, first of `{}`, are off 1 by more than the error that they state (0.1 where they state none), and are left as they are; look for gaps and faces that are wound the wrong way",
                self.scene_file.display(),
                face.line,
                prepared.scene.surfaces[face.surface.0 as usize].name
            ));
        }
        Ok(doubted)
    }

    /// Decides whether light leaves the scene, and which rows sum to 1.
    pub(in crate::cli) fn enclosed(
        &mut self,
        prepared: &mut Prepared,
        tallies: &[RowTally],
        closure: Closure,
    ) -> Result<Enclosed, Failure> {
        let watertight = prepared.plan.watertight;
        let found = self.times.time("checks", || {
            form_factor::enclosed(prepared.input(), watertight, tallies, closure)
        });
        let enclosed = found.map_err(|leak| {
            let file = &self.scene_file;
            let message = format!(
                "{}: {leak}, and --closed allows {MAX_ESCAPED:e}: close the gap, or leave --closed out",
                file.display()
            );
            Failure::new("not_closed", message).in_file(file)
        })?;
        match closure {
            Closure::Detect => {}
            Closure::Closed => {
                self.set("closure", "closed");
                prepared.plan.revise("closure", "closed", "as asked for");
            }
            Closure::Open => {
                self.set("closure", "open");
                prepared.plan.revise("closure", "open", "as asked for");
            }
        }
        let (n, n_closed) = (
            enclosed.rows.len(),
            enclosed.rows.iter().filter(|closed| **closed).count(),
        );
        if n_closed < n && (n_closed > 0 || enclosed.closed) {
            prepared.plan.decide(
                "row sums",
                format!("1 for {n_closed} of {n} patches"),
                "the others are reached by another piece of the scene, or lie where backs can be seen or light escapes",
            );
        }
        Ok(enclosed)
    }

    /// Takes over what is stated of whether the scene is closed, where no form factors are stored that would be judged by it.
    pub(in crate::cli) fn state_closure(&mut self, prepared: &mut Prepared, closure: Closure) -> Result<(), Failure> {
        if closure != Closure::Detect {
            prepared.plan.watertight = self.enclosed(prepared, &[], closure)?.closed;
        }
        Ok(())
    }

    /// Tells whether rows are shot by low-discrepancy points.
    fn is_net(&self) -> bool {
        let of_file = || self.settings.get("form_factors")?.get("sequence");
        let sequence = self.settings.get("sequence");
        sequence.or_else(of_file).is_some_and(|name| name == "sobol")
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

/// Returns how form factors are repaired.
pub(in crate::cli) fn repair(asked: BalanceName, need: Need, sampling: Sampling) -> RepairKind {
    match asked {
        BalanceName::On => RepairKind::Rescaled,
        BalanceName::Closure => RepairKind::Closed,
        BalanceName::Off => RepairKind::Nothing,
        BalanceName::Auto => need.repair(sampling),
    }
}
