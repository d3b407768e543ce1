//! The preparation of form factors: enclosure rows, repair, and checks.

use super::form_factors::{Balance, FormFactorRequest, FormFactorStudy, Raw};
use super::settings::{Balanced, StatedClosure, VarianceRepair};
use super::{Context, Model, Warning, WorkflowError};
use crate::audit::{self, Claims, Repair};
use crate::form_factor::{self, Closure, Enclosed, SEQUENCE};
use crate::matrix::{BalanceReport, Closed, FormFactors, Need, RepairKind, RowTally, Sampling};
use crate::progress::Forecast;
use crate::setting::Value;

/// The tolerance of restored row sums, far below the noise, and the limit of passes.
pub(super) const BALANCE_TOLERANCE: f64 = 1e-10;
const BALANCE_PASSES: usize = 200;

impl Context {
    /// Warns of rays that met no front in rows with known sum 1.
    fn warn_of_slipped_rays(&self, raw: &FormFactors, closed_rows: &[bool]) {
        let n_rays: u64 = raw.tallies().iter().map(|tally| tally.n_rays).sum();
        let tallies = raw.tallies().iter().zip(closed_rows);
        let of_closed = tallies.filter(|(_, is_closed)| **is_closed);
        let n_lost: u64 = of_closed.map(|(tally, _)| tally.n_escaped + tally.n_absorbed).sum();
        if n_lost > 0 {
            self.warn(Warning::SlippedRays { n_lost, n_rays });
        }
    }

    /// Stores the expected run time of long work among the warnings; an observer of progress has already received it.
    pub(super) fn note_forecast(&self, forecast: Option<Forecast>) {
        if let Some(forecast) = forecast.filter(|forecast| forecast.asked.1 > Forecast::LONG) {
            self.note(Warning::LongWork(forecast));
        }
    }

    /// Returns whether a method between pairs may trace rays; form factors from a file have no method among the settings, and trace none.
    fn may_ask_rays(&self) -> bool {
        self.settings.method.as_ref().is_some_and(|name| name != "exact")
    }

    /// Returns whether the rays of rows are low-discrepancy points.
    pub(super) fn is_net(&self) -> bool {
        let of_file = || Some(self.settings.form_factors.as_ref()?.get("sequence")? == "sobol");
        let own = self
            .settings
            .own
            .get(&SEQUENCE)
            .map(|name| name == Value::Choice("sobol"));
        own.or_else(of_file).unwrap_or(false)
    }
}

impl Model {
    /// Repairs form factors as requested, and checks them.
    ///
    /// # Errors
    /// [`WorkflowError::NotClosed`] and [`WorkflowError::Matrix`].
    pub fn repaired(
        &mut self,
        found: Raw,
        request: &FormFactorRequest,
        need: Need,
        cx: &mut Context,
    ) -> Result<FormFactorStudy, WorkflowError> {
        let Raw {
            computed: result,
            promised,
        } = found;
        let (raw, asked) = (result.factors, request.balance);
        let enclosed = self.enclosed(raw.tallies(), request.closure, cx)?;
        let closed_rows = &enclosed.rows;
        cx.warn_of_slipped_rays(&raw, closed_rows);
        let sampling = if raw.is_symmetric() {
            Sampling::of_pairs(promised.noisy_pairs && !raw.has_rays() && closed_rows.contains(&true))
        } else {
            Sampling::of_rows(raw.has_rays(), cx.is_net())
        };
        let kind = repair_kind(asked, need, sampling);
        let wanted = matches!(kind, RepairKind::Closed | RepairKind::Rescaled);
        cx.settings.balance = Some(match kind {
            RepairKind::Closed => Balanced::ByVariance(VarianceRepair::Closure),
            RepairKind::Pooled => Balanced::ByVariance(VarianceRepair::Pooled),
            RepairKind::Rescaled | RepairKind::Nothing => Balanced::Rescaled(wanted),
        });
        let claims = |repair| Claims {
            closed: Closed::Where(closed_rows),
            may_escape: &enclosed.may_escape,
            reciprocity: promised.reciprocity,
            errors_known: promised.errors_known,
            repair,
            by_rule: promised.by_rule,
        };
        if self.plan.convex_and_empty && result.pairs.is_some() && cx.may_ask_rays() {
            self.plan
                .left_out
                .push("rays between patches: nothing can block".into());
        }
        if asked == Balance::Closure
            && !closed_rows.contains(&true)
            && raw.tallies().iter().all(|tally| tally.n_rays == 0)
        {
            cx.warn(Warning::NothingToClose);
        }
        // Without stated errors, the row sum is the only check. A gap in a scene that was stated to be closed is not noise to be spread over a row's entries; one by rounding is.
        let believed = if self.plan.watertight {
            claims(Repair::Not)
        } else {
            Claims {
                may_escape: &[],
                ..claims(Repair::Not)
            }
        };
        let doubted = if wanted || !promised.errors_known {
            self.doubted_rows(&raw, believed, cx)?
        } else {
            Vec::new()
        };
        let (factors, balance) = self.mended(raw, kind, asked, (closed_rows, &doubted), cx)?;
        if let Some(report) = balance.filter(|report| !report.converged) {
            cx.settings.balance_converged = Some(false);
            cx.warn(Warning::NotBalanced {
                row_error_max: report.row_error_max,
                n_passes: report.n_passes,
            });
        }
        let checks = cx.time("checks", || factors.checks(closed_rows.as_slice()));
        let sky = cx.time("sky", || {
            form_factor::sky_factors(self.input(), &factors, promised.reciprocity, &enclosed)
        });
        factors.if_readable(())?;
        let repair = match balance {
            Some(report) if report.converged => Repair::Within(BALANCE_TOLERANCE),
            Some(_) => Repair::GaveUp,
            None => promised.repair,
        };
        let audit::FormFactorAudit { audit, gain } =
            cx.time("audit", || audit::form_factors(&factors, claims(repair)))?;
        cx.audited(audit);
        Ok(FormFactorStudy {
            gain,
            factors,
            checks,
            balance,
            closed: enclosed.closed,
            pairs: result.pairs,
            tolerance_met: result.tolerance_met,
            errors_known: promised.errors_known,
            sky,
            closed_rows: enclosed.rows,
        })
    }

    /// Repairs form factors, and records the repair and its reason.
    fn mended(
        &mut self,
        raw: FormFactors,
        kind: RepairKind,
        asked: Balance,
        (closed_rows, doubted): (&[bool], &[usize]),
        cx: &Context,
    ) -> Result<(FormFactors, Option<BalanceReport>), WorkflowError> {
        let how = match kind {
            RepairKind::Nothing => {
                let reason = if raw.is_symmetric() && asked == Balance::Auto {
                    "they are symmetric as they are"
                } else {
                    "no symmetric system is needed"
                };
                let left_out = format!("balancing of the form factors: {reason}");
                self.plan.left_out.push(left_out);
                return Ok((raw, None));
            }
            RepairKind::Pooled => "by their variances; rows keep the sums that their rays count",
            RepairKind::Closed => "the defect of the row sums spread by the entries' variances",
            RepairKind::Rescaled => "rows rescaled symmetrically",
        };
        let is_symmetric = raw.is_symmetric();
        let (factors, report) = cx.time("balance", || {
            let mut targets = raw.row_targets(closed_rows);
            let row_sums = if doubted.is_empty() { Vec::new() } else { raw.row_sums() };
            for &i in doubted {
                targets.keep(i, row_sums[i]);
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
        self.plan.decide("reciprocity", result, why);
        Ok((factors, report))
    }

    /// Returns the numbers of enclosure rows that do not sum to 1, and warns of them.
    fn doubted_rows(&self, raw: &FormFactors, claims: Claims<'_>, cx: &Context) -> Result<Vec<usize>, WorkflowError> {
        let is_doubted = cx.time("checks", || audit::doubted_rows(raw, claims))?;
        let doubted: Vec<usize> = (0..raw.n_rows()).filter(|&i| is_doubted[i]).collect();
        let n = doubted.len();
        if let Some(&first) = doubted.first() {
            let id = self.mesh.patches[first].face;
            let face = &self.scene.faces[id.0 as usize];
            cx.warn(Warning::DoubtedRows {
                at: self.scene.origin(&self.file, id),
                surface: self.scene.surfaces[face.surface.0 as usize].name.clone(),
                count: n,
            });
        }
        Ok(doubted)
    }

    /// Decides whether light leaves the scene, and which rows sum to 1.
    pub(super) fn enclosed(
        &mut self,
        tallies: &[RowTally],
        closure: Closure,
        cx: &mut Context,
    ) -> Result<Enclosed, WorkflowError> {
        let watertight = self.plan.watertight;
        let found = cx.time("checks", || {
            form_factor::enclosed(self.input(), watertight, tallies, closure)
        });
        let enclosed = found.map_err(|leak| WorkflowError::NotClosed {
            file: self.file.clone(),
            leak,
        })?;
        match closure {
            Closure::Detect => {}
            Closure::Closed => {
                cx.settings.closure = Some(StatedClosure::Closed);
                self.plan.revise("closure", "closed", "as asked for");
            }
            Closure::Open => {
                cx.settings.closure = Some(StatedClosure::Open);
                self.plan.revise("closure", "open", "as asked for");
            }
        }
        let (n, n_closed) = (
            enclosed.rows.len(),
            enclosed.rows.iter().filter(|closed| **closed).count(),
        );
        if n_closed < n && (n_closed > 0 || enclosed.closed) {
            self.plan.decide(
                "row sums",
                format!("1 for {n_closed} of {n} patches"),
                "the others are reached by another piece of the scene, or lie where backs can be seen or light escapes",
            );
        }
        Ok(enclosed)
    }

    /// Records whether the scene is stated to be closed, if no form factors are stored.
    ///
    /// # Errors
    /// [`WorkflowError::NotClosed`].
    pub fn state_closure(&mut self, closure: Closure, cx: &mut Context) -> Result<(), WorkflowError> {
        if closure != Closure::Detect {
            self.plan.watertight = self.enclosed(&[], closure, cx)?.closed;
        }
        Ok(())
    }
}

/// Returns how form factors are repaired.
pub(super) fn repair_kind(asked: Balance, need: Need, sampling: Sampling) -> RepairKind {
    match asked {
        Balance::On => RepairKind::Rescaled,
        Balance::Closure => RepairKind::Closed,
        Balance::Off => RepairKind::Nothing,
        Balance::Auto => need.repair(sampling),
    }
}
