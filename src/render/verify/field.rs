//! Converts fields of form factors to irradiances.

use super::error::VerifyError;
use crate::render::attributes::Attributes;
use crate::render::field::FieldRecord;

/// Returns the description of the scene in which the field's surface alone emits, 1 W·m⁻², and nothing reflects.
pub(super) fn lit_by(attributes: &Attributes, record: &FieldRecord) -> Result<Attributes, VerifyError> {
    let mut lit = attributes.clone();
    let mut is_known = false;
    for surface in &mut lit.surfaces {
        let emits = surface.name == record.surface;
        is_known |= emits;
        for polygon in &mut surface.polygons {
            polygon.exitance = [f64::from(u8::from(emits)); 3];
            polygon.reflectance = [0.0; 3];
        }
    }
    if is_known {
        Ok(lit)
    } else {
        Err(VerifyError::NoSuchSurface(record.surface.clone()))
    }
}
