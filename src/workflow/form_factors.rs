//! Form factors with their guarantees: method, computation, repair, checks.

use std::time::{Duration, Instant};

use super::repair::repair_kind;
use super::storage::{self, MatrixDemand};
use super::{Context, Model, Parameter, Storage, Unsuited, Warning, WorkflowError};
use crate::audit::Repair;
use crate::form_factor::registry::{self, MethodEntry};
use crate::form_factor::{
    self, Before, Closure, Computed, ExactMethod, FormFactorError, FormFactorMethod, MethodSettings, NORMALISE,
    PairCounts, RAYS, ROW_TOLERANCE, Reciprocity, SEQUENCE, SkyFactors, TOLERANCE, waiting_byte, worst_row,
};
use crate::matrix::{BalanceReport, Checks, FormFactors, Need, RepairKind, Sampling};
use crate::progress::Progress as _;
use crate::scene::Scene;
use crate::visibility::occluders::OccluderIndex;

/// The default number of rays that shooting traces for each patch.
pub const DEFAULT_RAYS: u64 = 4096;

/// Whether form factors are made symmetric and their rows made to sum to what they should.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Balance {
    /// For light: rows of low-discrepancy rays are averaged with their reverse and keep their sums, random rays and noisy pairs get closure, other rows only what the solver needs.
    ///
    /// See [`Need::repair`].
    #[default]
    Auto,
    /// Always: each pair averaged with its reverse, rows rescaled symmetrically.
    On,
    /// Always, but each entry is moved by its own error variance instead (least squares): what is known stays.
    Closure,
    /// Never.
    Off,
}

/// The steps after form factors, for a time limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Afterwards {
    /// Checks alone.
    Nothing,
    /// A solution.
    Light,
    /// A solution and an image.
    Image,
}

impl Afterwards {
    /// Returns the share of the time for form factors; the steps after them use the rest.
    fn share(self) -> f64 {
        match self {
            Self::Nothing => 0.9,
            Self::Light => 0.7,
            Self::Image => 0.4,
        }
    }
}

/// The request for form factors.
#[derive(Clone, Debug)]
pub struct FormFactorRequest {
    /// The name of the method.
    pub method: String,
    /// Its settings, as far as they are set.
    pub settings: MethodSettings,
    /// The default number of rays for each patch of a method that shoots.
    pub default_rays: u64,
    /// The default tolerance of a method that has one.
    pub default_tolerance: f64,
    /// True if the error of the mesh has set [`default_tolerance`](Self::default_tolerance).
    pub tolerance_is_by_mesh: bool,
    /// The parameter of the tolerance.
    pub tolerance_parameter: Parameter,
    /// True if [`SEQUENCE`] has another use too, so that a method without use for it ignores it.
    pub is_sequence_shared: bool,
    /// The repair of reciprocity and row sums.
    pub balance: Balance,
    /// The user's statement whether the scene is closed.
    pub closure: Closure,
    /// The time limit of the whole study, from the creation of the context; form factors use a share of it.
    pub time_limit: Option<(Duration, Afterwards)>,
    /// True if the plan lists occluders and tolerance.
    pub explain: bool,
}

impl Default for FormFactorRequest {
    /// Returns the request for `exact` at its default tolerance.
    fn default() -> Self {
        Self {
            method: "exact".to_owned(),
            settings: MethodSettings::default(),
            default_rays: DEFAULT_RAYS,
            default_tolerance: ExactMethod::DEFAULT_TOLERANCE,
            tolerance_is_by_mesh: false,
            tolerance_parameter: Parameter::Tolerance,
            is_sequence_shared: false,
            balance: Balance::Auto,
            closure: Closure::Detect,
            time_limit: None,
            explain: false,
        }
    }
}

/// Form factors with their checks and guarantees.
#[derive(Debug)]
pub struct FormFactorStudy {
    /// F, with a standard error for each entry.
    pub factors: FormFactors,
    /// Row sums, reciprocity, rays.
    pub checks: Checks,
    /// The effect of a repair.
    pub balance: Option<BalanceReport>,
    /// True if light cannot leave the scene.
    pub closed: bool,
    /// The numbers of pairs, by their treatment.
    pub pairs: Option<PairCounts>,
    /// True if all errors are within the tolerance.
    pub tolerance_met: bool,
    /// True if the entries have errors.
    pub errors_known: bool,
    /// The rows that are known to sum to 1, \[n\].
    pub closed_rows: Vec<bool>,
    /// The power gained per unit of radiosity where form factors lack reciprocity, m², \[n\].
    pub gain: Vec<f64>,
    /// The fractions of the light of each patch that escape and that black backs absorb, \[n\].
    pub sky: SkyFactors,
}

impl FormFactorStudy {
    /// Returns whether the work achieved the request.
    ///
    /// Uncertainty by rounded coordinates is not a failure. In ordinary files of rotated scenes with six decimals, form factors have errors of 1e-5, above the
    /// default tolerance of 1e-6, which no further work reduces. A warning reports it, as does [`tolerance_met`](Self::tolerance_met).
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.tolerance_met || !spent_budget(self.pairs)
    }
}

/// Returns whether form factors above their tolerance spent a budget, which is assumed if their pairs are unknown.
pub(super) fn spent_budget(pairs: Option<PairCounts>) -> bool {
    pairs.is_none_or(|pairs| pairs.n_above_tolerance > 0)
}

/// Form factors from a method or a file, before any repair.
#[derive(Debug)]
pub struct Raw {
    /// The computed form factors.
    pub computed: Computed,
    /// The guarantees of these form factors.
    pub(super) promised: Promised,
}

/// Guarantees of form factors beyond those stored with them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Promised {
    pub(super) reciprocity: Reciprocity,
    /// True if the entries have errors.
    pub(super) errors_known: bool,
    /// The effect of an earlier repair on the row sums.
    pub(super) repair: Repair,
    /// True if entries have the bias of a quadrature rule.
    pub(super) by_rule: bool,
    /// True if they are symmetric, with known noise of each entry.
    pub(super) noisy_pairs: bool,
}

/// A method with known properties of its matrix.
pub(super) struct Chosen {
    pub(super) method: Box<dyn FormFactorMethod>,
    /// True if it computes whole rows.
    by_rows: bool,
    /// The greatest number of entries of a row, if the settings determine it.
    n_entries: Option<u64>,
}

impl Model {
    /// Computes form factors, repairs them as requested, and checks them.
    ///
    /// # Errors
    /// [`WorkflowError::FormFactor`] for settings that the method does not use, [`WorkflowError::Storage`], [`WorkflowError::Matrix`], [`WorkflowError::NotClosed`] and [`WorkflowError::Interrupted`].
    pub fn form_factors(
        &mut self,
        request: &FormFactorRequest,
        need: Need,
        cx: &mut Context,
    ) -> Result<FormFactorStudy, WorkflowError> {
        let need = cx.memory.or_symmetry(request.balance, need)?;
        let raw = self.raw_form_factors(request, need, None, cx)?;
        self.repaired(raw, request, need, cx)
    }

    /// Computes form factors, reusing those from `before` a change that stay the same.
    ///
    /// # Errors
    /// As [`form_factors`](Self::form_factors).
    pub fn raw_form_factors(
        &mut self,
        request: &FormFactorRequest,
        need: Need,
        before: Option<Before<'_>>,
        cx: &mut Context,
    ) -> Result<Raw, WorkflowError> {
        let chosen_for_time;
        let request = match request.time_limit {
            Some((limit, afterwards)) => {
                chosen_for_time = self.chosen_for_time(request, limit, afterwards.share(), cx);
                &chosen_for_time
            }
            None => request,
        };
        let chosen = request.chosen(cx)?;
        let method = &*chosen.method;
        let is_exact = method.name() == "exact";
        if is_exact && request.explain {
            self.explain_exact(request);
        }
        // Pairs without occluders need no rays.
        let has_noisy_pairs = method.has_noisy_pairs() && !self.input().unoccluded;
        let sampling = if chosen.by_rows {
            Sampling::of_rows(chosen.n_entries.is_some(), cx.is_net())
        } else {
            Sampling::of_pairs(has_noisy_pairs)
        };
        let kind = repair_kind(request.balance, need, sampling);
        let n_patches = self.mesh.n_patches();
        let working_byte = method.working_byte(n_patches);
        let matrix = MatrixDemand {
            by_rows: chosen.by_rows,
            repaired: matches!(kind, RepairKind::Closed | RepairKind::Rescaled),
            n_entries: chosen.n_entries.unwrap_or(u64::MAX),
            n_beside: u32::from(kind == RepairKind::Pooled).max(method.matrices_beside()),
            working_byte: working_byte + waiting_byte(n_patches, cx.ranks.size(), working_byte),
        };
        let place = storage::choose_storage(cx, self, matrix)?;
        storage::open_checkpoint(cx, self)?;
        let (result, forecast) = {
            let watch = cx.progress();
            let input = self.input();
            let result = cx.time("form_factors", || match before {
                Some(before) => method.update(input, before, place.choice(), &watch),
                None => method.compute(input, place.choice(), &watch),
            });
            (result?, watch.heard())
        };
        cx.note_forecast(forecast);
        cx.progress().begin("checks", 0);
        match request.time_limit {
            Some((limit, _)) => cx.end_within(limit),
            None => cx.deadline = None,
        }
        cx.warn_of_checkpoint();
        let of_pairs = result.pairs.map_or(0, |pairs| pairs.n_rays);
        if is_exact && of_pairs == 0 {
            let nothing = "rays between patches: nothing here is sampled".into();
            self.plan.left_out.push(nothing);
        }
        // The rays of `exact` are traced in f64, and pass through no gap.
        if (of_pairs > 0 && !is_exact) || result.factors.tallies().iter().any(|tally| tally.n_rays > 0) {
            self.warn_of_narrow_gaps(cx);
        }
        warn_above_tolerance(&self.scene, &result, request.tolerance_parameter, cx);
        let of_rows = request.settings.values.get(&ROW_TOLERANCE);
        if of_rows.is_some() && !result.tolerance_met {
            let worst = worst_row(&result.factors);
            cx.warn(Warning::RowsAboveTolerance { worst });
        }
        let promised = Promised {
            reciprocity: method.reciprocity(),
            errors_known: true,
            repair: Repair::Not,
            by_rule: method.errs_by_rule(),
            noisy_pairs: has_noisy_pairs,
        };
        Ok(Raw {
            computed: result,
            promised,
        })
    }

    /// Describes visibility by exact clipping in the plan.
    fn explain_exact(&mut self, request: &FormFactorRequest) {
        let asked = request.settings.tolerance();
        let tolerance = asked.unwrap_or(request.default_tolerance);
        if !self.plan.convex_and_empty {
            let n = OccluderIndex::new(&self.scene).n_occluders();
            self.plan.revise(
                "visibility",
                format!("exact clipping against {n} occluders"),
                "a vertex lies behind the plane of a face: something may block; flat neighbours count as one occluder",
            );
            if let Some(of_rows) = request.settings.values.get(&ROW_TOLERANCE) {
                self.plan
                    .decide("tolerance of rows", of_rows.to_string(), "as asked for");
                return;
            }
            let reason = if asked.is_some() {
                "as asked for"
            } else if request.tolerance_is_by_mesh {
                "a tenth of the error that the mesh has at least"
            } else if tolerance > ExactMethod::DEFAULT_TOLERANCE {
                "the size of the patches weighs more in a picture than this"
            } else {
                "the default"
            };
            self.plan
                .decide("form-factor tolerance", format!("{tolerance:e}"), reason);
        }
    }

    /// Chooses method and tolerance for a time limit of the whole study, of which form factors use a share.
    fn chosen_for_time(
        &mut self,
        request: &FormFactorRequest,
        limit: Duration,
        share: f64,
        cx: &mut Context,
    ) -> FormFactorRequest {
        let left = limit.saturating_sub(cx.elapsed()).mul_f64(share);
        let end = Instant::now().checked_add(left);
        let tolerance = request.settings.tolerance().unwrap_or(request.default_tolerance);
        let (choice, forecast) = {
            let watch = cx.progress();
            let choice = cx.time("forecast", || {
                form_factor::within(self.input(), tolerance, left, &watch)
            });
            (choice, watch.heard())
        };
        cx.note_forecast(forecast);
        cx.deadline = end;
        cx.settings.time_limit_s = Some(limit.as_secs_f64());
        self.plan.decide(
            "method",
            choice.method,
            format!(
                "expected to take {:.1} of {:.1} s",
                choice.expected_s,
                left.as_secs_f64()
            ),
        );
        FormFactorRequest {
            method: choice.method.to_owned(),
            settings: choice.settings(&request.settings),
            ..request.clone()
        }
    }
}

/// Warns of pairs above the tolerance, by the cause.
fn warn_above_tolerance(scene: &Scene, result: &Computed, tolerance: Parameter, cx: &Context) {
    let Some(pairs) = result.pairs else {
        return;
    };
    if pairs.n_above_tolerance > 0 {
        cx.warn(Warning::AboveTolerance {
            n_pairs: pairs.n_above_tolerance,
            worst: worst_error(&result.factors),
            tolerance,
        });
    }
    if let Some(doubt) = pairs.doubted(scene) {
        cx.warn(Warning::Rounded { doubt, tolerance });
    }
}

/// Returns the greatest error of A_i F_ij / min(A_i, A_j).
fn worst_error(factors: &FormFactors) -> f64 {
    let areas = factors.areas();
    let of_row = |i: usize| {
        let mut worst = 0.0_f64;
        factors.for_each_in_row(i, |j, _, error| {
            worst = worst.max(error * areas[i] / areas[i].min(areas[j]));
        });
        [worst]
    };
    factors
        .numbers_of_rows(of_row)
        .into_flattened()
        .into_iter()
        .fold(0.0, f64::max)
}

impl super::Memory {
    /// Returns the need, or that of symmetric form factors if the requested storage is symmetric.
    ///
    /// # Errors
    /// [`Unsuited::SymmetricUnbalanced`].
    pub fn or_symmetry(&self, balance: Balance, need: Need) -> Result<Need, WorkflowError> {
        let wanted = self.storage == Storage::Symmetric;
        if wanted && balance == Balance::Off {
            return Err(WorkflowError::Unsuited(Unsuited::SymmetricUnbalanced));
        }
        Ok(if wanted { Need::Symmetry } else { need })
    }
}

impl FormFactorRequest {
    /// Records the settings that the method uses.
    fn note_settings(&self, entry: &MethodEntry, settings: &MethodSettings, cx: &mut Context) {
        let noted = &mut cx.settings;
        noted.method = Some(entry.name.to_owned());
        noted.seed = Some(settings.seed);
        let tolerance = match self.tolerance_parameter {
            Parameter::FormFactorTolerance => &mut noted.form_factor_tolerance,
            _ => &mut noted.tolerance,
        };
        // A tolerance of rows replaces that of entries, which is then no setting of the results.
        let of_entries = settings
            .tolerance()
            .filter(|_| settings.values.get(&ROW_TOLERANCE).is_none());
        *tolerance = of_entries.or(*tolerance);
        noted.own.extend(&settings.values);
        noted.own.remove(&TOLERANCE);
    }

    /// Returns the given settings, completed by this request's own defaults for the method.
    fn given(&self, entry: &MethodEntry) -> MethodSettings {
        let mut given = self.settings.clone();
        let values = &mut given.values;
        if entry.shoots() && values.get(&RAYS).is_none() {
            values.set(&RAYS, self.default_rays);
        }
        if entry.uses(&TOLERANCE) && values.get(&TOLERANCE).is_none() {
            values.set(&TOLERANCE, self.default_tolerance);
        }
        if self.is_sequence_shared && !entry.uses(&SEQUENCE) {
            values.remove(&SEQUENCE);
        }
        given
    }

    /// Builds the method, and records its settings.
    pub(super) fn chosen(&self, cx: &mut Context) -> Result<Chosen, WorkflowError> {
        let entry = registry::by_name(&self.method)?;
        let is_given = |setting| self.settings.values.get(setting).is_some();
        if entry.uses(&ROW_TOLERANCE) && is_given(&ROW_TOLERANCE) && is_given(&TOLERANCE) {
            let reason = "one tolerance is given for rows and one for entries; give one of them".to_owned();
            let method = entry.name;
            return Err(FormFactorError::NotApplicable { method, reason }.into());
        }
        let settings = entry.resolve(&self.given(entry)).map_err(|error| match error {
            // If the solver has a tolerance too, that of form factors has a longer name.
            FormFactorError::UnusedSetting {
                parameter: Parameter::Of(setting),
                method,
                used_by,
            } if *setting == TOLERANCE => FormFactorError::UnusedSetting {
                parameter: self.tolerance_parameter,
                method,
                used_by,
            },
            other => other,
        })?;
        self.note_settings(entry, &settings, cx);
        let by_rows = entry.by_rows() || settings.values.is_on(&NORMALISE);
        // With one or two points a side, errors are stated even for patches that no ray hit.
        let is_sparse = settings.points().is_none_or(|points| points.get() > 2);
        let n_entries = settings.rays().filter(|_| entry.shoots() && is_sparse);
        Ok(Chosen {
            method: entry.build(&settings),
            by_rows,
            n_entries,
        })
    }
}
