//! Other emitters and reflectances for a scene with the same geometry.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use super::bright::{MIN_EXITANCE, exitance_limit, is_too_dim};
use super::table::{Content, Table};
use super::toml_file::{TomlFile, first_names, fits};
use super::{MAX_EXITANCE, Material, MaterialId, Scene, SceneError, SceneErrorKind, SurfaceId};
use crate::printable::quoted;

/// The changes that one lighting makes to a scene's materials.
///
/// ```toml
/// [surface.lamp]
/// exitance = [10.0, 9.0, 8.0]
/// [surface."wall*"]
/// reflectance = 0.7
/// [material.wall]
/// reflectance = 0.8
/// ```
///
/// A number counts for all three channels. In a name, `*` stands for any text; an equal name takes precedence over one with `*`, and of these the one with more letters.
/// All other values are those of the scene. Where both a surface and its material are named, the surface takes precedence.
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

/// New values, each with the closeness of the name that sets it.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    exitance: Option<(usize, [f64; 3])>,
    reflectance: Option<(usize, [f64; 3])>,
}

/// Replaces a value by that of a name that fits more closely.
fn take_closer(old: &mut Option<(usize, [f64; 3])>, closeness: usize, value: Option<[f64; 3]>) {
    if let Some(value) = value
        && old.is_none_or(|(known, _)| closeness > known)
    {
        *old = Some((closeness, value));
    }
}

/// Returns the numbers of the names that match a pattern, and its closeness: `usize::MAX` for an equal name, else the number of letters beside `*`.
fn meant(name: &str, known: &[&str]) -> (usize, Vec<u32>) {
    let those = |fits: &dyn Fn(&str) -> bool| {
        let all = (0_u32..).zip(known).filter(|(_, one)| fits(one));
        all.map(|(id, _)| id).collect::<Vec<_>>()
    };
    let equal = those(&|one| one == name);
    if !equal.is_empty() || !name.contains('*') {
        return (usize::MAX, equal);
    }
    (
        name.chars().filter(|&c| c != '*').count(),
        those(&|one| fits(name, one)),
    )
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
    /// A file that cannot be read; [`BadLighting`](crate::scene::SceneErrorKind::BadLighting), with the line, for text that is no such TOML, a name that the scene does not have, a reflectance
    /// outside \[0, 1\], or an exitance that is negative, between 0 and [`MIN_EXITANCE`], above [`MAX_EXITANCE`], or overflows with the area that emits it.
    pub fn load(file: impl AsRef<Path>, scene: &Scene) -> Result<Self, SceneError> {
        Self::load_up_to(file, scene, MAX_EXITANCE)
    }

    /// Reads a lighting as [`load`](Self::load) does, with another limit of exitances, in W·m⁻².
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_up_to(file: impl AsRef<Path>, scene: &Scene, max_exitance: f64) -> Result<Self, SceneError> {
        let file = TomlFile::read(file.as_ref(), |message| SceneErrorKind::BadLighting { message })?;
        let bad = |start: Option<usize>, message: String| file.bad(start, message);
        let parsed: LightingFile = file.parsed("lighting")?;
        let surfaces: Vec<&str> = scene.surfaces.iter().map(|s| s.name.as_str()).collect();
        let materials: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
        let [surface_areas, material_areas] = areas_of(scene);
        let all = parsed.surface.values().chain(parsed.material.values());
        let reflectances = all.filter_map(|change| change.get_ref().0.reflectance.as_ref());
        let reflectance_max = reflectances
            .flat_map(|given| given.get_ref().rgb())
            .fold(scene.reflectance_max(), f64::max);
        let read = |kind: &str,
                    known: &[&str],
                    areas: &[f64],
                    changes: BTreeMap<String, Spanned<Table<ChangeInFile>>>| {
            let mut found: BTreeMap<u32, Found> = BTreeMap::new();
            for (name, change) in changes {
                let (closeness, ids) = meant(&name, known);
                if ids.is_empty() {
                    let message = format!(
                        "{kind}.{}: the scene has no {kind} of that name; it has {}",
                        quoted(&name),
                        first_names(known.iter().copied())
                    );
                    return Err(bad(Some(change.span().start), message));
                }
                let Table(change) = change.into_inner();
                let area: f64 = ids.iter().map(|id| areas[*id as usize]).sum();
                let limit = max_exitance.min(exitance_limit(area, reflectance_max));
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
                let exitance_start = change.exitance.as_ref().map(|given| given.span().start);
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
                if let Some(greatest) = exitance.map(|rgb| rgb.into_iter().fold(0.0, f64::max))
                    && greatest > limit
                {
                    let message = format!(
                        "{kind}.{name}.exitance: {greatest:e} is above {limit:.1e} W/m², beyond which light overflows here; lower it"
                    );
                    return Err(bad(exitance_start, message));
                }
                if let Some(dim) = exitance.into_iter().flatten().find(|e| is_too_dim(*e)) {
                    let message = format!(
                        "{kind}.{name}.exitance: {dim:e} is below {MIN_EXITANCE:.0e} W/m², where numbers lose their digits; write 0, or a greater one"
                    );
                    return Err(bad(exitance_start, message));
                }
                for id in ids {
                    let own = found.entry(id).or_default();
                    take_closer(&mut own.exitance, closeness, exitance);
                    take_closer(&mut own.reflectance, closeness, reflectance);
                }
            }
            let change = |own: Found| Change {
                exitance: own.exitance.map(|(_, value)| value),
                reflectance: own.reflectance.map(|(_, value)| value),
            };
            Ok(found.into_iter().map(|(id, own)| (id, change(own))).collect())
        };
        Ok(Self {
            by_surface: read("surface", &surfaces, &surface_areas, parsed.surface)?,
            by_material: read("material", &materials, &material_areas, parsed.material)?,
        })
    }

    /// Returns the greatest reflectance that it sets, 0 if none.
    #[must_use]
    pub fn reflectance_max(&self) -> f64 {
        let changes = self.by_surface.values().chain(self.by_material.values());
        let reflectances = changes.filter_map(|change| change.reflectance).flatten();
        reflectances.fold(0.0, f64::max)
    }

    /// Returns the greatest reflectance that any of the lightings sets, 0 if none.
    pub fn greatest_reflectance<'a>(lightings: impl IntoIterator<Item = &'a Self>) -> f64 {
        lightings.into_iter().map(Self::reflectance_max).fold(0.0, f64::max)
    }

    /// Returns whether it sets the reflectance of faces of a surface and a material.
    pub(super) fn states_reflectance(&self, surface: SurfaceId, material: MaterialId) -> bool {
        let changes = [self.by_surface.get(&surface.0), self.by_material.get(&material.0)];
        changes.iter().flatten().any(|change| change.reflectance.is_some())
    }

    /// Returns whether any face of a scene emits light in this lighting.
    #[must_use]
    pub fn is_emitting(&self, scene: &Scene) -> bool {
        let mut exitances = scene
            .faces
            .iter()
            .map(|face| self.of(scene, face.surface, face.material).1);
        exitances.any(|exitance| exitance.iter().any(|&e| e > 0.0))
    }

    /// Returns the scene in this lighting: each face has a material of its own surface and old material.
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
                // There are no more pairs than faces, which have 32-bit ids.
                MaterialId(u32::try_from(lit.materials.len() - 1).unwrap_or(u32::MAX))
            });
            face.material = id;
        }
        lit
    }

    /// Returns ρ and E, W·m⁻², of faces of a surface and a material.
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

/// Returns the areas of the surfaces of a scene, then those of its materials, in m².
fn areas_of(scene: &Scene) -> [Vec<f64>; 2] {
    let mut areas = [vec![0.0; scene.surfaces.len()], vec![0.0; scene.materials.len()]];
    for (id, face) in scene.face_ids().zip(&scene.faces) {
        let area = scene.area_vector(id).length();
        areas[0][face.surface.0 as usize] += area;
        areas[1][face.material.0 as usize] += area;
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_equal_name_counts_before_one_with_a_star() {
        let known = ["wall*", "wall_1", "lamp", "wall_1"];
        assert_eq!(meant("wall*", &known), (usize::MAX, vec![0]));
        assert_eq!(meant("wall_*", &known), (5, vec![1, 3]));
        assert_eq!(meant("lamp", &known), (usize::MAX, vec![2]));
        assert!(meant("floor", &known).1.is_empty());
        // Letters, not bytes.
        assert_eq!(meant("wände*", &["wände_2"]), (5, vec![0]));
    }
}
