//! The text that the program prints about a verification.

use std::fmt::Write as _;

use super::name_width;
use crate::printable::printable;
use crate::render::verify::{LayerCheck, LayerReport, VerifyReport};

/// Describes the results.
///
/// Writing to a String cannot fail; the results of `write!` are dropped for that reason.
pub(super) fn describe(report: &VerifyReport) -> String {
    let mut text = String::new();
    let unit = if report.field.is_some() { "" } else { " W/m²" };
    if let Some(surface) = &report.field {
        let _ = writeln!(text, "form factors to {}", printable(surface));
    }
    let tolerance = &report.tolerance;
    let _ = writeln!(
        text,
        "{} of {} pixels compared with the closed form, {} not checkable",
        report.n_checked, report.n_pixels, report.n_not_checkable
    );
    if report.n_drawn > 0 {
        let _ = writeln!(
            text,
            "{} of them see part of an emitter, by the image's own shadow rays, which were traced again",
            report.n_drawn
        );
    }
    if report.n_background + report.n_backs > 0 {
        let _ = writeln!(
            text,
            "beside these {} pixels show the backs of faces and {} nothing: both are black",
            report.n_backs, report.n_background
        );
    }
    let _ = writeln!(
        text,
        "error of a pixel: max {:.3e}, rms {:.3e}{unit}; {} outside their tolerance",
        report.max_error, report.rms_error, report.n_outside
    );
    let _ = writeln!(
        text,
        "tolerance of a pixel: statistical {:.3e} ({} rays) + ray offset {:.1e} + rounding {:.1e}",
        tolerance.max_statistical, tolerance.n_rays, tolerance.max_offset, tolerance.max_rounding
    );
    if let (Some(deviation), Some(most)) = (report.deviation, tolerance.max_deviation) {
        let is_right = if deviation <= most { "right" } else { "WRONG" };
        let _ = writeln!(
            text,
            "all pixels together: the errors are {deviation:.3} times those of independent rays, {most:.3} at most: {is_right}"
        );
    }
    if tolerance.n_rays > 0 {
        let _ = writeln!(
            text,
            "a right picture fails any of the {} comparisons with a chance of {:.0e}",
            tolerance.n_comparisons, tolerance.false_alarm
        );
    }
    describe_faults(&mut text, report);
    describe_layers(&mut text, &report.layers);
    let width = name_width(report.walls.iter().map(|wall| wall.name.as_str())).max(4);
    let _ = writeln!(
        text,
        "\n{:width$} {:>17} {:>17} {:>10} {:>10} {:>10} {:>10}",
        "wall", "mean", "exact", "error", "tolerance", "noise", "quadrature"
    );
    for wall in &report.walls {
        if wall.n_checked == 0 {
            let _ = writeln!(text, "{:width$} not checkable", wall.name);
            continue;
        }
        // The walls of a grey light have three equal channels; the worst is shown.
        let worst = (0..3)
            .max_by(|&a, &b| wall.error[a].abs().total_cmp(&wall.error[b].abs()))
            .unwrap_or(0);
        let exact = wall.exact.unwrap_or(wall.expected)[worst];
        let quadrature = wall.quadrature.map_or("-".to_owned(), |q| format!("{:.1e}", q[worst]));
        let _ = writeln!(
            text,
            "{:width$} {:>17.12} {exact:>17.12} {:>10.1e} {:>10.1e} {:>10.1e} {quadrature:>10} {}",
            wall.name,
            wall.mean[worst],
            wall.error[worst],
            wall.tolerance[worst],
            wall.statistical[worst],
            if wall.passed { "right" } else { "WRONG" }
        );
    }
    let outcome = match report.passed {
        true if report.complete => "passed".to_owned(),
        true => format!(
            "passed in part: {} of {} pixels could not be checked",
            report.n_not_checkable, report.n_pixels
        ),
        false if report.n_checked == 0 => "failed: no pixel could be compared".to_owned(),
        false => "failed".to_owned(),
    };
    let _ = writeln!(text, "\n{outcome}");
    text
}

/// Describes faults other than those of single pixels and walls.
fn describe_faults(text: &mut String, report: &VerifyReport) {
    if report.n_strips_outside > 0 {
        let _ = writeln!(
            text,
            "{} rows and columns of pixels have means outside their tolerance",
            report.n_strips_outside
        );
    }
    if !report.scene_intact {
        let _ = writeln!(text, "the scene in the file is not the one that its hash was made from");
    }
    if report.n_misplaced + report.n_inconsistent > 0 {
        let _ = writeln!(
            text,
            "{} pixels do not show what the view puts there (P, N, Z, patch), {} have layers that contradict each other or the scene",
            report.n_misplaced, report.n_inconsistent
        );
    }
}

/// Describes the check of each layer.
fn describe_layers(text: &mut String, layers: &[LayerReport]) {
    let kinds = [
        (LayerCheck::ClosedForm, "against the closed form"),
        (LayerCheck::Scene, "against the scene and the view"),
        (LayerCheck::OtherLayers, "against other layers"),
        (LayerCheck::Bounds, "by bounds alone, as no closed form describes them"),
        (LayerCheck::Missing, "not in the file"),
    ];
    let of_kind = |(kind, how): (LayerCheck, &str)| {
        let names: Vec<&str> = (layers.iter().filter(|layer| layer.check == kind))
            .map(|layer| layer.name.as_str())
            .collect();
        (!names.is_empty()).then(|| format!("{} {how}", names.join(", ")))
    };
    let parts: Vec<String> = kinds.into_iter().filter_map(of_kind).collect();
    let _ = writeln!(text, "layers: {}", parts.join("; "));
}
