//! The tables and sentences of a comparison.

use std::fmt::Write as _;

use super::{CaseSummary, Comparison, Part};
use crate::experiment::statistics::Spread;
use crate::experiment::{Reference, ReferenceKind, StorageFigures, sweep_by_name};
use crate::matrix::StorageChoice;
use crate::report::{Table, table};
use crate::workflow::place_text;

/// Returns a setting of a method in words.
pub(super) fn setting(method: &str, value: u64) -> String {
    sweep_by_name(method).map_or_else(|| value.to_string(), |sweep| sweep.parameter.setting(value))
}

pub(super) fn short_name(reference: &Reference) -> String {
    match (reference.kind, reference.tolerance) {
        (ReferenceKind::ClosedForm, _) => "closed form".to_owned(),
        (ReferenceKind::Polygons, _) => "exact between polygons".to_owned(),
        (ReferenceKind::Certified, _) => "certified".to_owned(),
        (ReferenceKind::Exact, tolerance) => format!("exact at {:e}", tolerance.unwrap_or(0.0)),
    }
}

pub(super) fn describe(reference: &Reference) -> String {
    let error = reference.error_max;
    match reference.kind {
        ReferenceKind::ClosedForm => {
            format!("Reference: the closed form of every pair of patches, exact to {error:.0e}.")
        }
        ReferenceKind::Polygons => {
            format!("Reference: the exact form factor of every pair of polygons, to {error:.0e}.")
        }
        ReferenceKind::Certified => format!(
            "Reference: certified form factors between the whole surfaces, exact to {error:.0e}; errors are between surfaces."
        ),
        ReferenceKind::Exact => format!(
            "Reference: `exact` at a tolerance of {:e}, two orders tighter than asked for; its own estimate of its error is {:.1e} (root mean square) and {error:.1e} at most.",
            reference.tolerance.unwrap_or(0.0),
            reference.error_rms,
        ),
    }
}

/// Returns one line for each reason.
pub(super) fn left_out(comparison: &Comparison) -> String {
    let mut reasons: Vec<&str> = Vec::new();
    for item in &comparison.left_out {
        if !reasons.contains(&item.reason.as_str()) {
            reasons.push(&item.reason);
        }
    }
    let mut text = String::new();
    for reason in reasons {
        let names = comparison
            .left_out
            .iter()
            .filter(|item| item.reason == reason)
            .map(|item| {
                let shown = |&value: &u64| {
                    let sweep = sweep_by_name(item.method);
                    sweep.map_or_else(|| value.to_string(), |sweep| sweep.parameter.value(value))
                };
                match item.values.iter().map(shown).collect::<Vec<_>>().join(", ") {
                    values if values.is_empty() => item.method.to_owned(),
                    values => format!("{} ({values})", item.method),
                }
            });
        let _ = writeln!(text, "\nLeft out, {reason}: {}.", names.collect::<Vec<_>>().join("; "));
    }
    text
}

pub(super) fn cases_table(comparison: &Comparison) -> Table {
    // A method that is itself the reference has no error against it.
    let error = |error: f64| {
        if error > 0.0 {
            format!("{error:.2e}")
        } else {
            "0".to_owned()
        }
    };
    let with_range = |case: &CaseSummary, s: Spread, show: &dyn Fn(f64) -> String| {
        if case.n_runs == 1 || s.min >= s.max {
            return show(s.median);
        }
        format!("{} [{}, {}]", show(s.median), show(s.min), show(s.max))
    };
    table! { case in &comparison.cases;
        "method": case.method,
        "setting": setting(case.method, case.value),
        "runs": case.n_runs,
        "time (ms)": with_range(case, case.time_s, &milliseconds),
        "max error": with_range(case, case.error_max, &error),
        "rms error": with_range(case, case.error_rms, &error),
        "front": match (case.on_front_max, case.on_front_rms) {
            (true, true) => "max, rms",
            (true, false) => "max",
            (false, true) => "rms",
            (false, false) => "",
        },
    }
}

/// Returns the fastest setting for each bound of the error, from a tenth downwards.
///
/// The bounds end at the least error, or at that of the reference; of bounds with the same answer the least is listed.
pub(super) fn fastest_table(comparison: &Comparison, reference: &Reference) -> Table {
    let mut table = Table::new(["error at most", "max", "time (ms)", "rms", "time (ms)"]);
    let mut last: Option<[String; 5]> = None;
    for exponent in 1..=15 {
        let bound = 10f64.powi(-exponent);
        let cells = [
            fastest(comparison, |case| case.error_max, bound, reference.error_max),
            fastest(comparison, |case| case.error_rms, bound, reference.error_rms),
        ];
        if cells.iter().all(Option::is_none) {
            break;
        }
        let [[max, max_time], [rms, rms_time]] = cells.map(|case| {
            case.map_or_else(
                || ["–".to_owned(), String::new()],
                |case| {
                    let name = format!("{} ({})", case.method, setting(case.method, case.value));
                    [name.replace(" (–)", ""), milliseconds(case.time_s.median)]
                },
            )
        });
        let row = [format!("1e-{exponent}"), max, max_time, rms, rms_time];
        if let Some(last) = last.replace(row.clone())
            && last[1..] != row[1..]
        {
            table.push(last);
        }
    }
    if let Some(last) = last {
        table.push(last);
    }
    table
}

/// Returns the fastest case in which no run had an error above `bound`, unless the bound is below the reference's error.
fn fastest(
    comparison: &Comparison,
    error: fn(&CaseSummary) -> Spread,
    bound: f64,
    resolved: f64,
) -> Option<&CaseSummary> {
    let good = comparison
        .cases
        .iter()
        .filter(|case| bound >= resolved && error(case).max <= bound);
    good.min_by(|a, b| a.time_s.median.total_cmp(&b.time_s.median))
}

/// Returns a time in ms with three digits, or all digits before the point.
fn milliseconds(time_s: f64) -> String {
    let time = 1e3 * time_s;
    let digits = if time < 1.0 {
        4
    } else if time < 10.0 {
        2
    } else {
        usize::from(time < 100.0)
    };
    format!("{time:.digits$}")
}

pub(super) fn runs_table(parts: &[Part]) -> Table {
    let runs = parts
        .iter()
        .flat_map(|part| part.comparison.runs.iter().map(move |run| (part, run)));
    table! { (part, run) in runs;
        "visibility": part.visibility,
        "method": run.method,
        "parameter": run.parameter,
        "value": run.value,
        "seed": run.seed,
        "time_s": run.time_s,
        "error_max": run.error_max,
        "error_rms": run.error_rms,
        "density": run.density,
        "stored_byte": run.stored_bytes,
    }
}

pub(super) fn storage_section(storage: &StorageFigures, choice: StorageChoice<'_>) -> String {
    let layouts = [
        ("dense", storage.dense_bytes),
        (
            "symmetric (one triangle, in squares of 64 × 64)",
            storage.symmetric_bytes,
        ),
        ("sparse", storage.sparse_bytes),
    ];
    let table = table! { (layout, bytes) in layouts;
        "layout": layout,
        "bytes": bytes,
        "of dense": format!("{:.0} %", 100.0 * bytes as f64 / storage.dense_bytes as f64),
    };
    let entries = match storage.tolerance {
        None => "of the reference".to_owned(),
        Some(tolerance) => format!("that `exact` finds at a tolerance of {tolerance:e}"),
    };
    format!(
        "\n## Storage\n\nN = {} patches, N² = {} entries, {:.1} % of them not zero (those {entries}), in {}, without standard errors. For comparison: Lewis 1992 counts \
         N² = 36 · 16^l entries for N = 6 · 4^l patches (table 1) and cites 10 % for a typical cluttered scene; Baranoski et al. 1995 give 53 % and 70 % \
         for a room around a large and a small sphere.\n\n{}",
        storage.n_patches,
        storage.n_entries,
        100.0 * storage.density,
        place_text(choice),
        table.to_markdown()
    )
}
