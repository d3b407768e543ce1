//! What documents and people are told of form factors.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::matrix::{Layout, Place, Precision, StorageChoice};
use crate::workflow::FormFactorStudy;

/// Returns what is said about form factors in every document that has some.
pub(super) fn checks_to_json(computed: &FormFactorStudy) -> Value {
    let checks = &computed.checks;
    json!({
        "closed": computed.closed,
        "row_sum": checks.row_sum,
        "closure_error_max": checks.closure_error_max,
        "reciprocity_error_max": checks.reciprocity_error_max,
        "exchange_ratio_max": checks.exchange_ratio_max,
        "n_rays": checks.n_rays + computed.pairs.map_or(0, |pairs| pairs.n_rays),
        "n_escaped": checks.n_escaped,
        "n_absorbed": checks.n_absorbed,
        "density": computed.factors.density(),
        "stored_byte": computed.factors.stored_byte(),
        "storage": storage_to_json(&computed.factors.storage()),
        "balance": computed.balance,
        "pairs": computed.pairs,
        "tolerance_met": computed.tolerance_met,
    })
}

fn storage_to_json(storage: &StorageChoice<'_>) -> Value {
    json!({
        "layout": match storage.layout {
            Layout::Auto => "auto",
            Layout::Dense => "dense",
            Layout::Sparse => "sparse",
        },
        "precision": match storage.precision {
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        },
        "place": match storage.place {
            Place::Memory { .. } => "memory",
            Place::Disk(_) => "disk",
        },
    })
}

/// Describes the checks of form factors in two or three lines.
pub(super) fn describe_checks(text: &mut String, computed: &FormFactorStudy) {
    let checks = &computed.checks;
    let _ = writeln!(
        text,
        "row sums {:.9} to {:.9}, closure error {}, reciprocity error {:.1e}",
        checks.row_sum.min,
        checks.row_sum.max,
        checks
            .closure_error_max
            .map_or("unknown".to_owned(), |e| format!("{e:.1e}")),
        checks.reciprocity_error_max,
    );
    if checks.n_rays > 0 {
        let _ = writeln!(
            text,
            "{} rays, {} escaped, {} met the back of a face",
            checks.n_rays, checks.n_escaped, checks.n_absorbed
        );
    }
    if let Some(pairs) = computed.pairs {
        let _ = writeln!(
            text,
            "{} pairs face each other: {} see each other whole, {} in part, {} not at all; {} rays between them",
            pairs.full + pairs.partial + pairs.hidden,
            pairs.full,
            pairs.partial,
            pairs.hidden,
            pairs.n_rays
        );
    }
    let _ = writeln!(
        text,
        "matrix {:.1} % filled, {:.1} MB",
        100.0 * computed.factors.density(),
        computed.factors.stored_byte() as f64 / 1e6
    );
}
