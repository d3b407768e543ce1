//! The text that the program prints about form factors between surfaces.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use super::failure::Failure;
use super::{name_width, printable_names};
use crate::scene::{Scene, SurfaceId};
use crate::workflow::{FormFactorStudy, Model, SurfaceTable};

/// Returns the surface of a name; an unknown name is a usage error.
pub(super) fn surface_named(scene: &Scene, name: &str) -> Result<SurfaceId, Failure> {
    scene.surface_named(name).ok_or_else(|| {
        let known: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).take(12).collect();
        Failure::usage(format!(
            "there is no surface `{name}`; the first ones are {}",
            known.join(", ")
        ))
    })
}

/// Adds the table of form factors between surfaces, or a line about where to find them.
///
/// Writing to a String cannot fail; the results of `write!` are dropped for that reason.
pub(super) fn describe_surfaces(text: &mut String, model: &Model, computed: &FormFactorStudy, table: &SurfaceTable) {
    let n = model.scene.surfaces.len();
    let Some(rows) = table.rows().filter(|_| n <= SurfaceTable::MAX_READ) else {
        let _ = writeln!(
            text,
            "the {n} × {n} surface form factors are in what --json{} prints and in the table that -o F.csv writes",
            if n <= SurfaceTable::MAX_PRINTED { "" } else { " --full" }
        );
        return;
    };
    let (names, width) = printable_names(model.scene.surfaces.iter().map(|surface| surface.name.as_str()));
    let _ = writeln!(
        text,
        "\nform factors from row to column; lost: 1 - row sum, sky: the part of it that leaves the scene; error: the largest of the row"
    );
    let column = heads_width(&names);
    let _ = write!(text, "{:width$}", "");
    for name in &names {
        let _ = write!(text, " {:>column$}", shortened(name, column));
    }
    let _ = writeln!(text, " {:>9} {:>9} {:>9}", "lost", "sky", "error");
    let sky_of_each = computed.sky.of_surfaces(&model.mesh, n).sky;
    for ((row, name), sky) in rows.iter().zip(names).zip(sky_of_each) {
        let _ = write!(text, "{name:width$}");
        for value in &row.form_factor {
            let _ = write!(text, " {value:>column$.6}");
        }
        let error = row.error.iter().copied().fold(0.0, f64::max);
        // A complete row may differ from 1 by rounding of either sign.
        let lost = if row.lost_factor.abs() < 5e-7 {
            0.0
        } else {
            row.lost_factor
        };
        let _ = writeln!(text, " {lost:>9.6} {:>9.6} {error:>9.1e}", sky.value);
    }
    let _ = writeln!(text);
}

/// Returns the width of a table's columns: the least that distinguishes the names at their heads, and at least 9.
fn heads_width(names: &[String]) -> usize {
    let all_differ = |width: &usize| {
        let heads: BTreeSet<String> = names.iter().map(|name| shortened(name, *width)).collect();
        heads.len() == names.len()
    };
    let longest = name_width(names.iter().map(String::as_str));
    (9..longest).find(all_differ).unwrap_or(longest.max(9))
}

fn shortened(name: &str, width: usize) -> String {
    name.chars().take(width).collect()
}
