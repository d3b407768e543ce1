//! The materials of a glTF file: diffuse reflectances and exitances.

use std::collections::HashMap;
use std::f64::consts::PI;

use super::super::polygons::FileMaterial;
use super::super::source::Source;
use super::document::{Document, MaterialOfFile};
use crate::scene::bright::{MIN_EXITANCE, is_too_dim};
use crate::scene::{Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind};

/// The exitance in the keys of the format.
const EXITANCE: &str = "π × emissiveFactor × emissiveStrength";

/// Returns the materials of a file: the base colour as reflectance, π × factor × strength of the emission as exitance.
///
/// Factors out of their range are errors in the keys of the format.
pub(super) fn materials(
    document: &Document,
    source: &Source<'_>,
    max_exitance: f64,
) -> Result<Vec<FileMaterial>, SceneError> {
    let mut names: HashMap<&str, usize> = HashMap::new();
    document
        .materials
        .iter()
        .filter_map(|own| own.name.as_deref())
        .for_each(|name| *names.entry(name).or_default() += 1);
    let stated = document.materials.iter().enumerate();
    stated
        .map(|(k, own)| {
            let given = own.name.as_deref().filter(|name| !name.trim().is_empty());
            let name = match given {
                Some(name) if names[name] == 1 => name.to_owned(),
                Some(name) => format!("{name} {k}"),
                None => format!("material{k}"),
            };
            material(name, own, source, max_exitance)
        })
        .collect()
}

fn material(
    name: String,
    own: &MaterialOfFile,
    source: &Source<'_>,
    max_exitance: f64,
) -> Result<FileMaterial, SceneError> {
    let surface = &own.pbr_metallic_roughness;
    let (path, element) = (source.path.clone(), format!("material `{name}`"));
    let at = Origin::Element { path, element };
    let refused = |kind| SceneError::new(at.clone(), kind);
    let reflectance = surface.base_color_factor.map(|[r, g, b, _]| [r, g, b]);
    if let Some(value) = reflectance.into_iter().flatten().find(|x| !(0.0..=1.0).contains(x)) {
        let keyword = "baseColorFactor";
        return Err(refused(SceneErrorKind::ReflectanceOutOfRange { keyword, value }));
    }
    let exitance = exitance(own, max_exitance).map_err(refused)?;
    let mut doubts = Vec::new();
    let mut doubt = |kind| doubts.push(SceneWarning::new(at.clone(), kind));
    if surface.base_color_factor.is_none() {
        doubt(SceneWarningKind::MissingReflectance {
            keyword: "baseColorFactor",
            name: name.clone(),
        });
    }
    let textures = [
        (surface.base_color_texture.is_some(), "baseColorFactor"),
        (own.emissive_texture.is_some(), "emissiveFactor"),
    ];
    for (_, keyword) in textures.into_iter().filter(|(is_there, _)| *is_there) {
        doubt(SceneWarningKind::IgnoredTexture {
            keyword,
            name: name.clone(),
        });
    }
    let is_clear = own.alpha_mode.as_deref().is_some_and(|mode| mode != "OPAQUE");
    let properties = [
        (
            surface.metallic_factor.is_some_and(|x| x > 0.0),
            "metalness (`metallicFactor`)",
        ),
        (
            surface.roughness_factor.is_some_and(|x| x < 1.0),
            "gloss (`roughnessFactor`)",
        ),
        (is_clear, "transparency (`alphaMode`)"),
        (
            own.extensions.contains_key("KHR_materials_transmission"),
            "transmission",
        ),
        (own.double_sided, "the light of the back (`doubleSided`)"),
    ];
    for (_, what) in properties.into_iter().filter(|(is_there, _)| *is_there) {
        doubt(SceneWarningKind::IgnoredProperty {
            what,
            name: name.clone(),
        });
    }
    Ok(FileMaterial {
        name,
        reflectance,
        exitance,
        exitance_keyword: EXITANCE,
        at,
        doubts,
    })
}

/// Returns π × factor × strength, W·m⁻².
fn exitance(own: &MaterialOfFile, max_exitance: f64) -> Result<[f64; 3], SceneErrorKind> {
    let extension = own.extensions.get("KHR_materials_emissive_strength");
    let strength = match extension.and_then(|given| given.get("emissiveStrength")) {
        None => 1.0,
        Some(given) => given
            .as_f64()
            .ok_or_else(|| SceneErrorKind::malformed("a number as `emissiveStrength`", given.to_string()))?,
    };
    let factor = own.emissive_factor.unwrap_or_default();
    let stated = factor.into_iter().map(|x| ("emissiveFactor", x));
    for (keyword, value) in stated.chain([("emissiveStrength", strength)]) {
        if !(value.is_finite() && value >= 0.0) {
            return Err(SceneErrorKind::ExitanceOutOfRange { keyword, value });
        }
    }
    let exitance = factor.map(|factor| PI * factor * strength);
    let keyword = EXITANCE;
    if let Some(value) = exitance.into_iter().find(|value| *value > max_exitance) {
        let limit = max_exitance;
        return Err(SceneErrorKind::TooBright { keyword, value, limit });
    }
    if let Some(value) = exitance.into_iter().find(|value| is_too_dim(*value)) {
        let limit = MIN_EXITANCE;
        return Err(SceneErrorKind::TooDim { keyword, value, limit });
    }
    Ok(exitance)
}
