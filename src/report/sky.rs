//! Sky and back factors as columns of files.

use crate::form_factor::{Fraction, SkyFactors};

/// Four numbers for each patch or surface, with their names.
pub(crate) type SkyColumns = [(&'static str, Vec<f64>); 4];

/// Returns the names and values of the sky and back factors in files.
pub(crate) fn sky_columns(sky: &SkyFactors) -> SkyColumns {
    let values = |of: &[Fraction]| of.iter().map(|fraction| fraction.value).collect();
    let errors = |of: &[Fraction]| of.iter().map(|fraction| fraction.error()).collect();
    [
        ("sky_factor", values(&sky.sky)),
        ("sky_factor_error", errors(&sky.sky)),
        ("back_factor", values(&sky.back)),
        ("back_factor_error", errors(&sky.back)),
    ]
}
