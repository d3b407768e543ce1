//! Form factors from a file instead of a method.

use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::form_factors::{FormFactorRequest, FormFactorStudy, Promised, Raw, spent_budget};
use super::repair::{BALANCE_TOLERANCE, repair_kind};
use super::storage::{self, MatrixDemand};
use super::{Context, Model, Unsuited, Warning, WorkflowError};
use crate::audit::Repair;
use crate::form_factor::{Computed, MethodSettings, NORMALISE, Reciprocity, registry};
use crate::matrix::{Need, RepairKind, Sampling};
use crate::mesh::{MeshOptions, Subdivision};
use crate::report::ReportError;
use crate::report::form_factors::FormFactorFile;

/// Returns the subdivision of the patches of a file, or `default` if the file does not state it.
///
/// # Errors
/// [`Unsuited::OtherPatches`] for options that request other patches: a `subdivision`, or whole faces.
pub fn mesh_options(
    file: &FormFactorFile,
    subdivision: Option<Subdivision>,
    is_whole: bool,
    default: MeshOptions,
) -> Result<MeshOptions, WorkflowError> {
    let Some(options) = file.description().mesh_options() else {
        return Ok(default);
    };
    if subdivision.is_none_or(|asked| asked == options.subdivision) && !(is_whole && options.cut_at_walls) {
        return Ok(options);
    }
    Err(WorkflowError::Unsuited(Unsuited::OtherPatches {
        file: file.path().to_owned(),
        subdivision: options.subdivision,
        is_whole,
    }))
}

impl Model {
    /// Reads the form factors of the patches from a file, then repairs and checks them like computed ones.
    ///
    /// # Errors
    /// [`WorkflowError::OtherGeometry`], [`WorkflowError::Report`], and those of [`form_factors`](Self::form_factors).
    pub fn form_factors_of(
        &mut self,
        file: &FormFactorFile,
        request: &FormFactorRequest,
        need: Need,
        cx: &mut Context,
    ) -> Result<FormFactorStudy, WorkflowError> {
        let need = cx.memory.or_symmetry(request.balance, need)?;
        let promised = promised(file);
        let sequence = file.description().settings.get("sequence");
        let sampling = if file.description().symmetric {
            Sampling::of_pairs(promised.noisy_pairs)
        } else {
            Sampling::of_rows(sequence.is_some(), sequence.is_some_and(|name| name == "sobol"))
        };
        let kind = repair_kind(request.balance, need, sampling);
        let computed = self.read(file, kind, cx)?;
        self.repaired(Raw { computed, promised }, request, need, cx)
    }

    /// Reads the form factors of the patches, for a kind of repair.
    fn read(&mut self, file: &FormFactorFile, kind: RepairKind, cx: &mut Context) -> Result<Computed, WorkflowError> {
        let matrix = MatrixDemand {
            by_rows: !file.description().symmetric,
            repaired: matches!(kind, RepairKind::Closed | RepairKind::Rescaled),
            n_entries: u64::MAX,
            n_beside: u32::from(kind == RepairKind::Pooled),
            working_byte: 0,
        };
        let chosen = storage::choose_storage(cx, self, matrix)?;
        cx.expect_same("file of form factors", &Sha256::digest(file.fingerprint()?))?;
        let read = cx.time("form_factors", || file.read_into(&self.mesh, chosen.choice()));
        let factors = read.map_err(|error| match error {
            ReportError::OtherGeometry { path } => WorkflowError::OtherGeometry {
                file: path,
                scene: self.file.clone(),
            },
            other => other.into(),
        })?;
        let description = file.description();
        let path = || file.path().to_owned();
        let rounded = description.pairs.and_then(|pairs| pairs.doubted(&self.scene));
        if !description.tolerance_met && (rounded.is_none() || spent_budget(description.pairs)) {
            cx.warn(Warning::FileAboveTolerance { file: path() });
        }
        if let Some(doubt) = rounded {
            cx.warn(Warning::FileRounded { file: path(), doubt });
        }
        cx.settings.form_factors = Some(description.settings.clone());
        self.plan
            .left_out
            .push("computing form factors: they are read from a file".into());
        Ok(Computed {
            factors,
            pairs: description.pairs,
            tolerance_met: description.tolerance_met,
        })
    }
}

/// Returns the guarantees of a file's form factors, by the method among its settings.
fn promised(file: &FormFactorFile) -> Promised {
    let settings = &file.description().settings;
    let is_set = |name: &str| settings.get(name).is_some_and(|value| value.as_bool() != Some(false));
    let normalise = is_set("normalise");
    let method = settings.get("method").and_then(Value::as_str).and_then(|name| {
        let given = MethodSettings::default().with(&NORMALISE, normalise);
        registry::method(name, &given).ok()
    });
    let by_rule = method.as_ref().is_some_and(|method| method.errs_by_rule());
    let noisy_pairs = file.has_errors() && method.as_ref().is_some_and(|method| method.has_noisy_pairs());
    Promised {
        reciprocity: method.map_or(Reciprocity::NotPromised, |method| method.reciprocity()),
        errors_known: file.has_errors(),
        repair: match (is_set("balance"), settings.contains_key("balance_converged")) {
            (false, _) => Repair::Not,
            (true, false) => Repair::Within(BALANCE_TOLERANCE),
            (true, true) => Repair::GaveUp,
        },
        by_rule,
        noisy_pairs,
    }
}
