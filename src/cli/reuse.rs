//! Form factors from a file instead of a method.

use std::path::Path;

use serde_json::Value;

use super::args::MeshArgs;
use super::failure::Failure;
use super::pipeline::{BALANCE_TOLERANCE, Prepared, Promised, Run, spent_budget};
use super::storage;
use crate::audit::Repair;
use crate::form_factor::{Computed, MethodSettings, Reciprocity, registry};
use crate::matrix::RepairKind;
use crate::mesh::Subdivision;
use crate::report::ReportError;
use crate::report::form_factors::FormFactorFile;

/// Returns the patches that a file is for; flags that ask for others are an error.
pub(super) fn mesh_args(file: &FormFactorFile, given: MeshArgs) -> Result<MeshArgs, Failure> {
    let Some(options) = file.description().mesh_options() else {
        return Ok(given);
    };
    let (in_file, flags) = match options.subdivision {
        Subdivision::Uniform(n) => ((Some(n), None), format!("--subdivide {n}")),
        Subdivision::MaxEdge(length) => ((None, Some(length)), format!("--max-edge {length:?}")),
    };
    // A flag that is left out asks for nothing.
    let asked = given.options(options.subdivision);
    if asked.subdivision == options.subdivision && !(given.no_cut && options.cut_at_walls) {
        return Ok(MeshArgs {
            subdivide: in_file.0,
            max_edge: in_file.1,
            no_cut: !options.cut_at_walls,
            cut_at_walls: false,
        });
    }
    let without = if given.no_cut { " without --no-cut" } else { "" };
    Err(Failure::usage(format!(
        "{} is for {flags}{without}; leave the flags out, or compute other form factors",
        file.path().display()
    )))
}

/// Reads the form factors of a scene's patches, for a repair of a kind.
pub(super) fn form_factors(
    run: &mut Run,
    prepared: &mut Prepared,
    file: &FormFactorFile,
    scene: &Path,
    kind: RepairKind,
) -> Result<Computed, Failure> {
    let matrix = storage::Matrix {
        by_rows: !file.description().symmetric,
        repaired: matches!(kind, RepairKind::Closed | RepairKind::Rescaled),
        n_entries: u64::MAX,
        n_beside: u32::from(kind == RepairKind::Pooled),
        working_byte: 0,
    };
    let chosen = storage::choose(run, prepared, matrix)?;
    let read = run
        .times
        .time("form_factors", || file.read_into(&prepared.mesh, chosen.choice()));
    let factors = read.map_err(|error| match error {
        ReportError::OtherGeometry { path } => {
            let (path, scene) = (path.display(), scene.display());
            let message = format!(
                "{path}: holds form factors of another geometry than {scene}; compute them again: radiosity form-factors {scene} -o {path}"
            );
            Failure::new("other_geometry", message).in_file(file.path())
        }
        other => other.into(),
    })?;
    let description = file.description();
    let path = file.path().display();
    let rounded = description.pairs.and_then(|pairs| pairs.doubted(&prepared.scene));
    if !description.tolerance_met && (rounded.is_none() || spent_budget(description.pairs)) {
        run.warn(&format!(
            "{path}: these form factors spent their budget above their tolerance; compute them again with a greater --budget or --tolerance"
        ));
    }
    if let Some(rounded) = rounded {
        run.warn(&format!("{path}: {rounded}"));
    }
    run.set("form_factors", Value::Object(description.settings.clone()));
    prepared
        .plan
        .left_out
        .push("computing form factors: they are read from a file".into());
    Ok(Computed {
        factors,
        pairs: description.pairs,
        tolerance_met: description.tolerance_met,
    })
}

/// Returns what a file's form factors promise: what the method does that its settings name.
pub(super) fn promised(file: &FormFactorFile) -> Promised {
    let settings = &file.description().settings;
    let is_set = |name: &str| settings.get(name).is_some_and(|value| value.as_bool() != Some(false));
    let normalise = is_set("normalise");
    let method = settings.get("method").and_then(Value::as_str).and_then(|name| {
        let given = MethodSettings {
            normalise,
            ..MethodSettings::default()
        };
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
