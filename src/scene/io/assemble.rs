//! Builds a scene from the polygons of a file.

use std::path::Path;

use glam::DVec3;

use super::polygons::{FileFace, FileMaterial, NONE, Polygons};
use super::{DEFAULT_REFLECTANCE, Flip, LoadOptions, Loaded, creases, weld};
use crate::geometry::polygon;
use crate::scene::bright::too_bright;
use crate::scene::builder::{Added, FirstAndCount};
use crate::scene::{
    Lighting, Material, MaterialId, Numbering, Origin, SceneBuilder, SceneError, SceneErrorKind, SceneWarning,
    SceneWarningKind,
};

/// The surface of all faces with [`LoadOptions::one_surface`], and of faces without a surface where others have one.
const DEFAULT_SURFACE: &str = "default";

/// Makes a scene of the polygons of a file.
pub(super) fn assemble(mut polygons: Polygons, file: &Path, options: &LoadOptions) -> Result<Loaded, SceneError> {
    expect_vertices(&polygons, file)?;
    number_apart(&mut polygons);
    place(&mut polygons, options);
    let first = join(&mut polygons, file, options);
    if options.one_surface {
        polygons.groups = vec![DEFAULT_SURFACE.to_owned()];
        polygons.faces.iter_mut().for_each(|face| face.group = 0);
    } else if polygons.groups.is_empty() {
        let first = first.unwrap_or_else(|| weld::equal(&polygons.vertices));
        creases::part(&mut polygons, &first, options.crease_angle);
    } else {
        adopt(&mut polygons);
    }
    let flipped = flipped(&polygons.groups, file, &options.flip)?;
    let (materials, n_drawn) = (polygons.materials.clone(), polygons.n_drawn);
    let unassigned = free_name(&materials);
    let assembly = Assembly {
        file,
        builder: SceneBuilder::of_file(file).numbered(polygons.numbering.clone()),
        warnings: std::mem::take(&mut polygons.warnings),
        flipped,
        unassigned: unassigned.clone(),
        polygons,
    };
    let mut loaded = assembly.build(options)?;
    loaded.warnings.retain(|warning| match warning.kind {
        SceneWarningKind::CutFaces { count, .. } => count > n_drawn,
        _ => true,
    });
    if let Some((material, value, limit)) = too_bright(&loaded.scene)
        && let Some(stated) = materials.iter().find(|stated| stated.name == material.name)
    {
        let keyword = stated.exitance_keyword;
        let kind = SceneErrorKind::TooBright { keyword, value, limit };
        return Err(SceneError::new(stated.at.clone(), kind));
    }
    if let Some(paints) = &options.materials {
        paint(&mut loaded, paints, &unassigned, options.max_exitance)?;
    }
    if !loaded.scene.is_emitting() {
        let at = Origin::file(file);
        loaded
            .warnings
            .push(SceneWarning::new(at, SceneWarningKind::NoEmission));
    }
    Ok(loaded)
}

/// Refuses faces whose vertices do not exist.
fn expect_vertices(polygons: &Polygons, file: &Path) -> Result<(), SceneError> {
    let n_vertices = polygons.vertices.len();
    if polygons.corners.iter().all(|&v| (v as usize) < n_vertices) {
        return Ok(());
    }
    for (face, corners) in polygons.outlines() {
        if let Some(&bad) = corners.iter().find(|v| **v as usize >= n_vertices) {
            let kind = SceneErrorKind::IndexOutOfRange {
                index: bad.into(),
                n_vertices,
            };
            return Err(SceneError::new(polygons.numbering.origin(file, face.number), kind));
        }
    }
    Ok(())
}

/// Numbers the faces instead of the lines where several faces share a line, as faces of one line would be parts of one outline.
fn number_apart(polygons: &mut Polygons) {
    let is_shared = |pair: &[FileFace]| pair[0].number == pair[1].number;
    if polygons.numbering == Numbering::Lines && polygons.faces.windows(2).any(is_shared) {
        polygons.numbering = Numbering::elements("face", 1);
        for (number, face) in (1..).zip(&mut polygons.faces) {
            face.number = number;
        }
    }
}

/// Turns and scales the vertices into the scene's axes and metres.
fn place(polygons: &mut Polygons, options: &LoadOptions) {
    for vertex in &mut polygons.vertices {
        let turned = options.up_axis.turned(*vertex);
        *vertex = DVec3::from_array(turned.to_array().map(|x| options.unit.metres(x)));
    }
    polygons.written.scale(options.unit.metres(1.0));
}

/// Joins or counts nearly equal vertices, as the options require; returns the first vertex at the place of each, if known.
fn join(polygons: &mut Polygons, file: &Path, options: &LoadOptions) -> Option<Vec<u32>> {
    let warn = |kind| SceneWarning::new(Origin::file(file), kind);
    if options.merge_tolerance > 0.0 {
        let welded = weld::within(&polygons.vertices, options.merge_tolerance);
        for corner in &mut polygons.corners {
            *corner = welded.first[*corner as usize];
        }
        if welded.n_moved > 0 {
            polygons.written.join_over(welded.moved);
            polygons.warnings.push(warn(SceneWarningKind::MergedVertices {
                count: welded.n_moved,
                distance: welded.moved,
            }));
        }
        return Some(welded.first);
    }
    if polygons.repeats_vertices && !polygons.vertices.is_empty() {
        let (low, high) = polygon::bounds(&polygons.vertices);
        let tolerance = weld::NEAR * low.distance(high);
        if tolerance > 0.0 {
            let first = weld::equal(&polygons.vertices);
            let count = weld::n_nearly_equal(&polygons.vertices, &first, tolerance);
            if count > 0 {
                let kind = SceneWarningKind::NearlyEqualVertices { count, tolerance };
                polygons.warnings.push(warn(kind));
            }
            return Some(first);
        }
    }
    None
}

/// Gives faces without a surface one, where others have some.
fn adopt(polygons: &mut Polygons) {
    if polygons.faces.iter().all(|face| face.group != NONE) {
        return;
    }
    let known = polygons.groups.iter().position(|name| name == DEFAULT_SURFACE);
    let default = known.unwrap_or_else(|| {
        polygons.groups.push(DEFAULT_SURFACE.to_owned());
        polygons.groups.len() - 1
    });
    let default = u32::try_from(default).unwrap_or(0);
    for face in polygons.faces.iter_mut().filter(|face| face.group == NONE) {
        face.group = default;
    }
}

/// Returns whether the faces of each surface of a file are to be reversed.
fn flipped(groups: &[String], file: &Path, flip: &Flip) -> Result<Vec<bool>, SceneError> {
    let names = match flip {
        Flip::Nothing => return Ok(vec![false; groups.len()]),
        Flip::All => return Ok(vec![true; groups.len()]),
        Flip::Surfaces(names) => names,
    };
    if let Some(name) = names.iter().find(|name| !groups.contains(name)) {
        const SHOWN: usize = 12;
        let known: Vec<&str> = groups.iter().map(String::as_str).take(SHOWN).collect();
        return Err(SceneError::new(
            Origin::file(file),
            SceneErrorKind::UnknownSurface {
                name: name.clone(),
                known: known.join("`, `"),
            },
        ));
    }
    Ok(groups.iter().map(|group| names.contains(group)).collect())
}

/// Gives a scene the reflectances and exitances of a file, and removes the warnings of materials without any.
fn paint(loaded: &mut Loaded, file: &Path, unassigned: &str, max_exitance: f64) -> Result<(), SceneError> {
    let Loaded { scene, warnings } = loaded;
    let paints = Lighting::load_up_to(file, scene, max_exitance)?;
    let is_painted = |name: &str| {
        let mut own = scene
            .faces
            .iter()
            .filter(|face| scene.materials[face.material.0 as usize].name == name);
        own.all(|face| paints.states_reflectance(face.surface, face.material))
    };
    warnings.retain(|warning| match &warning.kind {
        SceneWarningKind::NoMaterial { .. } | SceneWarningKind::NoMaterials => !is_painted(unassigned),
        SceneWarningKind::UnknownMaterial { name } | SceneWarningKind::MissingReflectance { name, .. } => {
            !is_painted(name)
        }
        _ => true,
    });
    *scene = paints.apply(scene);
    scene.name_materials_apart();
    Ok(())
}

struct Assembly<'a> {
    file: &'a Path,
    polygons: Polygons,
    builder: SceneBuilder,
    warnings: Vec<SceneWarning>,
    /// Whether the faces of each surface are reversed.
    flipped: Vec<bool>,
    /// The name of the material of faces without one.
    unassigned: String,
}

impl Assembly<'_> {
    fn build(mut self, options: &LoadOptions) -> Result<Loaded, SceneError> {
        let polygons = std::mem::take(&mut self.polygons);
        self.builder.written(polygons.written);
        let groups = polygons.groups.iter();
        let surfaces = groups
            .map(|name| self.builder.surface(name.as_str()))
            .collect::<Result<Vec<_>, _>>()?;
        let mut materials: Vec<Option<MaterialId>> = vec![None; polygons.materials.len()];
        let mut unassigned = None;
        let mut is_told = vec![false; polygons.materials.len()];
        let mut without_material = FirstAndCount::default();
        let mut outline: Vec<DVec3> = Vec::new();
        for (face, corners) in polygons.outlines() {
            let stated = polygons.materials.get(face.material as usize);
            let known = match stated {
                Some(_) => &mut materials[face.material as usize],
                None => &mut unassigned,
            };
            let material = match *known {
                Some(material) => material,
                None => *known.insert(self.material(stated, options.max_exitance)?),
            };
            outline.clear();
            outline.extend(corners.iter().map(|&v| polygons.vertices[v as usize]));
            if self.flipped[face.group as usize] {
                outline.reverse();
            }
            let surface = surfaces[face.group as usize];
            if self.builder.face(&outline, surface, material, face.number)? == Added::ZeroArea {
                continue;
            }
            match stated {
                None => without_material.count(face.number),
                Some(stated) if !std::mem::replace(&mut is_told[face.material as usize], true) => {
                    self.doubt(&stated.doubts);
                }
                Some(_) => {}
            }
        }
        if let Some((number, count)) = without_material.0 {
            let (at, kind) = if polygons.has_no_materials {
                (Origin::file(self.file), SceneWarningKind::NoMaterials)
            } else {
                let at = polygons.numbering.origin(self.file, number);
                (at, SceneWarningKind::NoMaterial { count })
            };
            self.warnings.push(SceneWarning::new(at, kind));
        }
        drop(polygons);
        let Loaded { scene, warnings } = self.builder.build()?;
        self.warnings.extend(warnings);
        Ok(Loaded {
            scene,
            warnings: self.warnings,
        })
    }

    /// Adds a material, that of faces without one if none is stated.
    fn material(&mut self, stated: Option<&FileMaterial>, max_exitance: f64) -> Result<MaterialId, SceneError> {
        let Some(stated) = stated else {
            return self.builder.material(Material {
                name: self.unassigned.clone(),
                reflectance: [DEFAULT_REFLECTANCE; 3],
                exitance: [0.0; 3],
            });
        };
        let refused = |kind| SceneError::new(stated.at.clone(), kind);
        if let Some(value) = stated.exitance.into_iter().find(|value| *value > max_exitance) {
            let (keyword, limit) = (stated.exitance_keyword, max_exitance);
            return Err(refused(SceneErrorKind::TooBright { keyword, value, limit }));
        }
        let material = Material {
            name: stated.name.clone(),
            reflectance: stated.reflectance.unwrap_or([DEFAULT_REFLECTANCE; 3]),
            exitance: stated.exitance,
        };
        self.builder.material(material).map_err(|error| refused(error.kind))
    }

    /// Adds the warnings about a material; of materials that are not diffuse it keeps the first warning and their number.
    fn doubt(&mut self, doubts: &[SceneWarning]) {
        for doubt in doubts {
            let told = self.warnings.iter_mut().find_map(|warning| match &mut warning.kind {
                SceneWarningKind::NotDiffuse { count, .. } => Some(count),
                _ => None,
            });
            match (&doubt.kind, told) {
                (SceneWarningKind::NotDiffuse { .. }, Some(count)) => *count += 1,
                _ => self.warnings.push(doubt.clone()),
            }
        }
    }
}

/// Returns a name for the material of faces without one that no other material has.
fn free_name(materials: &[FileMaterial]) -> String {
    let mut name = "unassigned".to_owned();
    while materials.iter().any(|material| material.name == name) {
        name.push('_');
    }
    name
}
