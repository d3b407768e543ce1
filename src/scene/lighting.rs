//! Other lights and other paints for a scene whose geometry stays.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use super::lines::{line_after, read_text};
use super::table::{Content, Table};
use super::{Material, MaterialId, Scene, SceneError, SurfaceId};
use crate::input_file::DESCRIPTION_LIMIT;

/// What one lighting changes of a scene's materials.
///
/// ```toml
/// [surface.lamp]
/// exitance = [10.0, 9.0, 8.0]
/// [material.wall]
/// reflectance = 0.8
/// ```
///
/// A number counts for all three channels. What is not named stays as the scene has it; where a surface and its material are both named, the surface counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Lighting {
    by_surface: BTreeMap<u32, Change>,
    by_material: BTreeMap<u32, Change>,
}

/// New values; `None` keeps the old one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Change {
    exitance: Option<[f64; 3]>,
    reflectance: Option<[f64; 3]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightingFile {
    #[serde(default)]
    surface: BTreeMap<String, Spanned<Table<ChangeInFile>>>,
    #[serde(default)]
    material: BTreeMap<String, Spanned<Table<ChangeInFile>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChangeInFile {
    exitance: Option<Spanned<Channels>>,
    reflectance: Option<Spanned<Channels>>,
}

impl Content for ChangeInFile {
    const EXPECTED: &'static str = "a table with `exitance` or `reflectance`, as in { exitance = [1.0, 0.9, 0.8] }";
}

#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a number, or three as in [1.0, 0.9, 0.8]")]
enum Channels {
    Grey(f64),
    Rgb([f64; 3]),
}

impl Channels {
    fn rgb(self) -> [f64; 3] {
        match self {
            Self::Grey(value) => [value; 3],
            Self::Rgb(values) => values,
        }
    }
}

impl Lighting {
    /// Reads a lighting of a scene from a TOML file.
    ///
    /// # Errors
    /// A file that cannot be read; [`SceneError::BadLighting`], with the line, for what is no such TOML, a name that the scene does not have, a reflectance
    /// outside \[0, 1\], or an exitance that is negative or not finite.
    pub fn load(file: impl AsRef<Path>, scene: &Scene) -> Result<Self, SceneError> {
        let file = file.as_ref();
        let text = read_text(file, DESCRIPTION_LIMIT)?;
        let bad = |start: Option<usize>, message: String| SceneError::BadLighting {
            file: file.to_owned(),
            line: start.map(|start| line_after(text.get(..start).unwrap_or(&text))),
            message,
        };
        let parsed: LightingFile = toml::from_str(&text).map_err(|error| {
            let message = error.message().trim().replace('\n', ", ");
            bad(
                error.span().map(|span| span.start),
                format!("{message}; correct the lighting"),
            )
        })?;
        let surfaces: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        let materials: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
        let read = |kind: &str, known: &[&str], changes: BTreeMap<String, Spanned<Table<ChangeInFile>>>| {
            let mut found = BTreeMap::new();
            for (name, change) in changes {
                let Some(id) = (0_u32..).zip(known).find(|(_, known)| **known == name) else {
                    let message = format!(
                        "{kind}.{name}: the scene has no {kind} of that name; it has {}",
                        known.join(", ")
                    );
                    return Err(bad(Some(change.span().start), message));
                };
                let Table(change) = change.into_inner();
                let value = |key: &str, given: Option<Spanned<Channels>>, legal: fn(f64) -> bool, rule: &str| {
                    given
                        .map(|given| {
                            let rgb = given.get_ref().rgb();
                            let message = || format!("{kind}.{name}.{key}: {rgb:?} is {rule}; correct it");
                            if rgb.iter().all(|x| legal(*x)) {
                                Ok(rgb)
                            } else {
                                Err(bad(Some(given.span().start), message()))
                            }
                        })
                        .transpose()
                };
                let exitance = value(
                    "exitance",
                    change.exitance,
                    |e| e.is_finite() && e >= 0.0,
                    "negative or not finite",
                )?;
                let reflectance = value(
                    "reflectance",
                    change.reflectance,
                    |r| (0.0..=1.0).contains(&r),
                    "outside of [0, 1]",
                )?;
                found.insert(id.0, Change { exitance, reflectance });
            }
            Ok(found)
        };
        Ok(Self {
            by_surface: read("surface", &surfaces, parsed.surface)?,
            by_material: read("material", &materials, parsed.material)?,
        })
    }

    /// Returns the greatest reflectance that it gives to anything, 0 if none.
    #[must_use]
    pub fn reflectance_max(&self) -> f64 {
        let changes = self.by_surface.values().chain(self.by_material.values());
        let reflectances = changes.filter_map(|change| change.reflectance).flatten();
        reflectances.fold(0.0, f64::max)
    }

    /// Returns the scene as this lighting shows it: each face with a material of its own surface and old material.
    #[must_use]
    pub fn apply(&self, scene: &Scene) -> Scene {
        let mut lit = scene.clone();
        lit.materials.clear();
        let mut known = BTreeMap::new();
        for face in &mut lit.faces {
            let id = *known.entry((face.surface, face.material)).or_insert_with(|| {
                let (reflectance, exitance) = self.of(scene, face.surface, face.material);
                lit.materials.push(Material {
                    name: scene.materials[face.material.0 as usize].name.clone(),
                    reflectance,
                    exitance,
                });
                // No more pairs than faces, which have 32-bit ids.
                MaterialId(u32::try_from(lit.materials.len() - 1).unwrap_or(u32::MAX))
            });
            face.material = id;
        }
        lit
    }

    /// Returns ρ and E, W·m⁻², of what is made of a material and belongs to a surface.
    ///
    /// # Panics
    /// If the scene has no such material.
    #[must_use]
    #[track_caller]
    pub fn of(&self, scene: &Scene, surface: SurfaceId, material: MaterialId) -> ([f64; 3], [f64; 3]) {
        let plain = &scene.materials[material.0 as usize];
        let changes = [self.by_surface.get(&surface.0), self.by_material.get(&material.0)];
        let first = |pick: fn(&Change) -> Option<[f64; 3]>| changes.iter().flatten().find_map(|change| pick(change));
        (
            first(|change| change.reflectance).unwrap_or(plain.reflectance),
            first(|change| change.exitance).unwrap_or(plain.exitance),
        )
    }
}
