//! Scenes from OBJ and MTL files, through tobj.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DVec3;

use super::bright::{MAX_EXITANCE, too_bright};
use super::builder::{Added, FirstAndCount, SceneBuilder};
use super::lines::read_text;
use super::mtl::{Definition, Definitions};
use super::obj_lines::{ObjIndex, Unread, scan};
use super::{Material, MaterialId, Origin, Scene, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind};

/// A scene from a file, and what was doubtful about it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// What was left open in the file, in the order in which it was found.
    pub warnings: Vec<SceneWarning>,
}

/// How a scene file is read.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LoadOptions {
    /// True if the material libraries that a file names may lie outside the file's folder. A scene from elsewhere should not make
    /// the program read whatever its author knows the path of, so that this is off by default.
    pub allow_outside: bool,
    /// The faces whose winding is reversed: their normals were inverted.
    pub flip: Flip,
    /// The greatest exitance that a material may have, in W·m⁻²: [`MAX_EXITANCE`], or less for what is to be stored with less range.
    pub max_exitance: f64,
}

/// Faces whose winding is reversed while a scene is read, before anything else is made of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Flip {
    /// None.
    #[default]
    Nothing,
    /// All faces.
    All,
    /// The faces of surfaces, by their names.
    Surfaces(Vec<String>),
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            allow_outside: false,
            flip: Flip::Nothing,
            max_exitance: MAX_EXITANCE,
        }
    }
}

impl LoadOptions {
    /// Returns the options with libraries outside the scene's folder allowed, or not.
    #[must_use]
    pub fn allow_outside(self, allow_outside: bool) -> Self {
        Self { allow_outside, ..self }
    }

    /// Returns the options with the winding of faces reversed.
    #[must_use]
    pub fn flip(self, flip: Flip) -> Self {
        Self { flip, ..self }
    }

    /// Returns the options with another limit of exitances, in W·m⁻².
    #[must_use]
    pub fn max_exitance(self, max_exitance: f64) -> Self {
        Self { max_exitance, ..self }
    }
}

/// The reflectance of a material that states none.
pub const DEFAULT_REFLECTANCE: f64 = 0.5;

/// Loads a scene from an OBJ file and the MTL files that it names.
///
/// - Lengths are metres, as written: every f64 survives, no coordinate is moved, and bit-identical positions become one vertex (0 and −0 are the same).
/// - A face sees along the normal of its winding. Flat convex quads stay quads; a quad is flat if no corner is further than
///   1e-6 of its diameter from its plane. Bent or concave quads and larger outlines become triangles of the same outline; beyond 1e-3 there is a warning.
/// - The last `o` or `g` above a face names its surface (tools write either, or an `o` for the object and a `g` for a part of it: the finer name
///   counts). A `g` with several names is one surface with all of them in its name. Faces above the first one, or below one without a name, are surface `default`.
///   A file without any `o` or `g` has one surface per face, `face1`... Surfaces are in the order in which their names appear;
///   names without faces are dropped.
/// - `Kd` is the reflectance ρ, `Ke` the exitance E in W·m⁻²; one number stands for all three channels. Without `Kd`, without a
///   material, or if the library is missing, ρ is [`DEFAULT_REFLECTANCE`], with a warning. Textures are not read, with a warning.
/// - Faces without an area are skipped, with a warning. Faces of opposite winding may coincide.
/// - Where faces of the same winding overlap in one plane, as a door that is drawn on its wall, the smaller one is cut out of the larger one, with a warning: flat parts of one surface and
///   material count as a whole, and of equal ones the later stays whole. Faces of which one equals the other are an error. What is narrower than the rounding of
///   the coordinates as they are written is no overlap, nor is what is narrower than that of six digits of the scene's size. Where the file [shows that it was rounded](super::Written::shows_rounding),
///   faces that are not along the axes may stand out of the larger one by a unit of each coordinate's last place.
/// - `fo` is read as `f`, and keywords in capitals as in small letters, with a warning. Texture coordinates, normals and attributes are ignored; lines, points, free-form curves and
///   surfaces, calls and unknown statements are skipped, with a warning of each kind.
/// - A library that is not where `mtllib` says is looked for by its file name beside the scene file, whatever its case, with a warning.
///
/// Accuracy: coordinates, reflectance and exitance are the nearest f64 to the text. How far the text may be off what was meant, by its digits, is in [`Scene::written`], and is part of the errors of form factors.
///
/// # Errors
/// [`SceneError`], with file, line and remedy: files that cannot be read, coordinates or indices that are none, faces with fewer than three
/// corners, outlines that cross themselves, faces of the same winding that coincide, `Kd` outside \[0, 1\], `Ke` that is negative, above [`MAX_EXITANCE`], or above 0 and below [`MIN_EXITANCE`](super::MIN_EXITANCE),
/// power beyond the range of f64, libraries outside the scene's folder, and scenes without a usable face.
///
/// Source: Wavefront's OBJ and MTL formats. Departures: only polygons; capitals; a vertex must stand above the faces that use it; the weight of a vertex is ignored.
pub fn load(path: impl AsRef<Path>) -> Result<Loaded, SceneError> {
    load_with(path, &LoadOptions::default())
}

/// Loads a scene as [`load`] does, with options.
///
/// # Errors
/// As [`load`].
pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Loaded, SceneError> {
    let file = path.as_ref();
    let index = scan(&read_text(file, u64::MAX)?, file)?;
    let mut warnings = Vec::new();
    for (what, &(line, count)) in &index.unread {
        warnings.push(unread(file, *what, line, count));
    }
    let definitions = Definitions::read_all(&index.libraries, file, options, &mut warnings)?;
    let outlines = Outlines::parse(&index, file)?;
    let scene = Assembly {
        file,
        index: &index,
        definitions: &definitions,
        flipped: flipped(&index, file, &options.flip)?,
        builder: SceneBuilder::of_file(file),
        warnings: &mut warnings,
    }
    .assemble(&outlines)?;
    if let Some((material, value, limit)) = too_bright(&scene)
        && let Some(definition) = definitions.get(&material.name)
    {
        let at = Origin::line(definition.file.clone(), definition.exitance_line);
        return Err(SceneError::new(at, SceneErrorKind::TooBright { value, limit }));
    }
    if !scene.is_emitting() {
        warnings.push(SceneWarning::new(
            Origin::file(file.to_owned()),
            SceneWarningKind::NoEmission,
        ));
    }
    Ok(Loaded { scene, warnings })
}

/// Returns whether the faces of each group of a file are to be reversed.
fn flipped(index: &ObjIndex, file: &Path, flip: &Flip) -> Result<Vec<bool>, SceneError> {
    let names = match flip {
        Flip::Nothing => return Ok(vec![false; index.groups.len()]),
        Flip::All => return Ok(vec![true; index.groups.len()]),
        Flip::Surfaces(names) => names,
    };
    if let Some(name) = names.iter().find(|name| !index.groups.contains(name)) {
        const SHOWN: usize = 12;
        let known: Vec<&str> = index.groups.iter().map(String::as_str).take(SHOWN).collect();
        return Err(SceneError::new(
            Origin::file(file.to_owned()),
            SceneErrorKind::UnknownSurface {
                name: name.clone(),
                known: known.join("`, `"),
            },
        ));
    }
    Ok(index.groups.iter().map(|group| names.contains(group)).collect())
}

/// Returns the warning about statements that were not read, or not as they are written.
fn unread(file: &Path, what: Unread, line: u32, count: usize) -> SceneWarning {
    let file = file.to_owned();
    let skipped = |in_words| {
        SceneWarning::new(
            Origin::line(file.clone(), line),
            SceneWarningKind::SkippedStatements { count, what: in_words },
        )
    };
    match what {
        Unread::NamelessLibrary => SceneWarning::new(Origin::line(file, line), SceneWarningKind::NamelessLibrary),
        Unread::Capitals => SceneWarning::new(Origin::line(file, line), SceneWarningKind::Capitals { count }),
        Unread::LinesAndPoints => skipped("lines or points"),
        Unread::FreeForm => skipped("free-form curves or surfaces"),
        Unread::Calls => skipped("calls of other files or programs"),
        Unread::Unknown => skipped("unknown keywords"),
    }
}

/// The corners of all faces of a file, in file order.
struct Outlines {
    corners: Vec<DVec3>,
    /// Where each face ends in `corners`.
    ends: Vec<usize>,
}

impl Outlines {
    fn parse(index: &ObjIndex, file: &Path) -> Result<Self, SceneError> {
        let disagree =
            |message: String| SceneError::new(Origin::file(file.to_owned()), SceneErrorKind::Parser { message });
        let options = tobj::LoadOptions::default();
        let (models, _) = tobj::load_obj_buf(&mut index.geometry.as_bytes(), &options, |_| {
            Err(tobj::LoadError::OpenFileFailed)
        })
        .map_err(|error| disagree(error.to_string()))?;
        let mut outlines = Self {
            corners: Vec::new(),
            ends: Vec::new(),
        };
        for model in models {
            let mesh = model.mesh;
            let positions = mesh.positions.as_chunks::<3>().0;
            outlines
                .corners
                .extend(mesh.indices.iter().map(|&v| DVec3::from_array(positions[v as usize])));
            let mut end = outlines.ends.last().copied().unwrap_or(0);
            // The parser leaves the arities out where all faces are triangles.
            let n_faces = if mesh.face_arities.is_empty() {
                mesh.indices.len() / 3
            } else {
                mesh.face_arities.len()
            };
            for k in 0..n_faces {
                end += mesh.face_arities.get(k).map_or(3, |&n| n as usize);
                outlines.ends.push(end);
            }
        }
        let (n, expected) = (outlines.ends.len(), index.faces.len());
        if n != expected || outlines.ends.last().copied().unwrap_or(0) != outlines.corners.len() {
            return Err(disagree(format!("{n} faces, not {expected}")));
        }
        Ok(outlines)
    }

    fn iter(&self) -> impl Iterator<Item = &[DVec3]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts
            .zip(&self.ends)
            .map(|(start, &end)| self.corners.get(start..end).unwrap_or(&[]))
    }
}

struct Assembly<'a> {
    file: &'a Path,
    index: &'a ObjIndex,
    definitions: &'a Definitions,
    /// Whether the faces of each group are reversed.
    flipped: Vec<bool>,
    builder: SceneBuilder,
    warnings: &'a mut Vec<SceneWarning>,
}

impl Assembly<'_> {
    fn assemble(mut self, outlines: &Outlines) -> Result<Scene, SceneError> {
        let index = self.index;
        self.builder.written(index.written);
        let surfaces = index
            .groups
            .iter()
            .map(|name| self.builder.surface(name.as_str()))
            .collect::<Result<Vec<_>, _>>()?;
        let mut materials: HashMap<Option<usize>, MaterialId> = HashMap::new();
        let mut in_use = HashSet::new();
        let mut without_material = FirstAndCount::default();
        for (face, corners) in index.faces.iter().zip(outlines.iter()) {
            let material = match materials.entry(face.material) {
                Entry::Occupied(known) => *known.get(),
                Entry::Vacant(free) => *free.insert(self.material(face.material)?),
            };
            let reversed: Vec<DVec3>;
            let corners = if self.flipped[face.group] {
                reversed = corners.iter().rev().copied().collect();
                &reversed
            } else {
                corners
            };
            if self.builder.face(corners, surfaces[face.group], material, face.line)? == Added::ZeroArea {
                continue;
            }
            if face.material.is_none() {
                without_material.count(face.line);
            }
            if in_use.insert(face.material) {
                self.warn_about(face.material);
            }
        }
        if let Some((line, count)) = without_material.0 {
            self.warnings.push(SceneWarning::new(
                Origin::line(self.file.to_owned(), line),
                SceneWarningKind::NoMaterial { count },
            ));
        }
        let Loaded { scene, warnings } = self.builder.build()?;
        self.warnings.extend(warnings);
        Ok(scene)
    }

    fn material(&mut self, material: Option<usize>) -> Result<MaterialId, SceneError> {
        let name = material.map_or_else(|| self.free_name(), |k| self.index.materials[k].name.clone());
        let definition = material.and_then(|_| self.definitions.get(&name));
        self.builder.material(Material {
            reflectance: definition
                .and_then(|d| d.reflectance)
                .unwrap_or([DEFAULT_REFLECTANCE; 3]),
            exitance: definition.map(|d| d.exitance).unwrap_or_default(),
            name,
        })
    }

    /// Returns a name for the material of faces without one that no other material has.
    fn free_name(&self) -> String {
        let mut name = "unassigned".to_owned();
        while self.index.materials.iter().any(|m| m.name == name) {
            name.push('_');
        }
        name
    }

    fn warn_about(&mut self, material: Option<usize>) {
        let Some(named) = material.map(|k| &self.index.materials[k]) else {
            return;
        };
        let name = || named.name.clone();
        let Some(definition) = self.definitions.get(&named.name) else {
            self.warnings.push(SceneWarning::new(
                Origin::line(self.file.to_owned(), named.line),
                SceneWarningKind::UnknownMaterial { name: name() },
            ));
            return;
        };
        let Definition { file, line, .. } = definition;
        if definition.repeated {
            self.warnings.push(SceneWarning::new(
                Origin::line(file.clone(), *line),
                SceneWarningKind::RepeatedMaterial { name: name() },
            ));
        }
        if definition.reflectance.is_none() {
            self.warnings.push(SceneWarning::new(
                Origin::line(file.clone(), *line),
                SceneWarningKind::MissingReflectance { name: name() },
            ));
        }
        if let Some((texture_line, keyword)) = definition.texture {
            self.warnings.push(SceneWarning::new(
                Origin::line(file.clone(), texture_line),
                SceneWarningKind::IgnoredTexture { keyword, name: name() },
            ));
        }
        if let Some((not_diffuse_line, keyword)) = definition.not_diffuse {
            let told = self.warnings.iter_mut().find_map(|warning| match &mut warning.kind {
                SceneWarningKind::NotDiffuse { count, .. } => Some(count),
                _ => None,
            });
            match told {
                Some(count) => *count += 1,
                None => self.warnings.push(SceneWarning::new(
                    Origin::line(file.clone(), not_diffuse_line),
                    SceneWarningKind::NotDiffuse { keyword, count: 1 },
                )),
            }
        }
    }
}
