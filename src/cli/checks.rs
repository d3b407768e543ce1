//! The text that the program prints about form factors.

use std::fmt::Write as _;

use crate::printable::counted;
use crate::workflow::{FormFactorStudy, Model};

/// Adds the line with the number of patches.
pub(super) fn describe_patches(text: &mut String, model: &Model) {
    let (n_patches, n_surfaces) = (model.mesh.n_patches(), model.scene.surfaces.len());
    let _ = writeln!(text, "{n_patches} patches on {}", counted(n_surfaces, "surface"));
}

/// Adds the line of the checks of form factors.
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
}

/// Adds the details of form factors: rays, pairs and the size of the matrix.
pub(super) fn describe_work(text: &mut String, computed: &FormFactorStudy) {
    let checks = &computed.checks;
    if checks.n_rays > 0 {
        let _ = writeln!(
            text,
            "{} rays, {} left the scene, {} hit back faces",
            checks.n_rays, checks.n_escaped, checks.n_absorbed
        );
    }
    if let Some(pairs) = computed.pairs {
        let _ = writeln!(
            text,
            "{} facing pairs: {} fully visible, {} partially visible{}, {} hidden; {} rays traced between them",
            pairs.full + pairs.partial + pairs.hidden,
            pairs.full,
            pairs.partial,
            if pairs.by_rays > 0 {
                format!(" ({} of these by rays)", pairs.by_rays)
            } else {
                String::new()
            },
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
