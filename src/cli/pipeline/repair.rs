//! What is done to form factors before they are used: which rows sum to 1, the repair, the checks.

use serde_json::json;

use super::factors::{Computed, Promised, code};
use super::{Prepared, Run};
use crate::audit::{self, Claims, Repair};
use crate::cli::args::{BalanceName, MethodArgs};
use crate::cli::failure::Failure;
use crate::form_factor::{self, Closure, Enclosed, MAX_ESCAPED};
use crate::matrix::{BalanceReport, Closed, FormFactors, Need, RepairKind, RowTally, Sampling};

/// Row sums are restored to far below the noise, or as far as so many passes go.
pub(in crate::cli) const BALANCE_TOLERANCE: f64 = 1e-10;
const BALANCE_PASSES: usize = 200;

impl Run {
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
            may_escape: &enclosed.may_escape,
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
        // What states no error has nothing else that could tell of it. A gap in a scene that was stated to be closed is no noise, to be spread over all entries of a row; one by rounding is.
        let believed = if prepared.plan.watertight {
            claims(Repair::Not)
        } else {
            Claims {
                may_escape: &[],
                ..claims(Repair::Not)
            }
        };
        let doubted = if wanted || !promised.errors_known {
            self.doubted_rows(prepared, &raw, believed)?
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
    pub(super) fn is_net(&self) -> bool {
        let of_file = || self.settings.get("form_factors")?.get("sequence");
        let sequence = self.settings.get("sequence");
        sequence.or_else(of_file).is_some_and(|name| name == "sobol")
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
