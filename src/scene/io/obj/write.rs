//! Writes scenes to OBJ and MTL files.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::Path;

use glam::DVec3;

use crate::scene::{Origin, Scene, SceneError, SceneErrorKind};
use crate::whole_file::{self, Prepared};

/// Writes a scene to `path`, which ends in `.obj`, and its materials to the `.mtl` beside it.
///
/// Numbers are the shortest text that reads back as the same f64, so [`load`](crate::scene::load) returns a scene with the same
/// [`content_hash`](Scene::content_hash). The bytes depend only on the scene and the file's name. Each file is replaced atomically,
/// the materials first.
///
/// # Errors
/// A path that does not end in `.obj`; names that the format cannot hold; errors of the file system.
pub fn write_obj(scene: &Scene, path: impl AsRef<Path>) -> Result<(), SceneError> {
    let obj_file = path.as_ref();
    let is_obj = obj_file.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    let mtl_file = obj_file.with_extension("mtl");
    let (true, Some(mtl_name)) = (is_obj, mtl_file.file_name().and_then(OsStr::to_str)) else {
        return Err(SceneError::new(
            Origin::file(obj_file.to_owned()),
            SceneErrorKind::NotObj,
        ));
    };
    check_names("surface", scene.surfaces.iter().map(|s| s.name.as_str()))?;
    check_names("material", scene.materials.iter().map(|m| m.name.as_str()))?;
    let materials = prepare(&mtl_file, &mtl_text(scene))?;
    let faces = prepare(obj_file, &obj_text(scene, mtl_name))?;
    // The lock keeps other processes from writing one of the two files in between.
    let _turn = whole_file::turn(whole_file::directory_of(obj_file));
    materials.put().map_err(|source| unwritable(&mtl_file, source))?;
    faces.put().map_err(|source| unwritable(obj_file, source))
}

fn prepare(file: &Path, text: &str) -> Result<Prepared, SceneError> {
    whole_file::prepare(file, |writer| writer.write_all(text.as_bytes())).map_err(|source| unwritable(file, source))
}

fn unwritable(file: &Path, source: io::Error) -> SceneError {
    SceneError::new(Origin::file(file.to_owned()), SceneErrorKind::Unwritable { source })
}

/// Writes a file atomically.
pub(in crate::scene) fn write_whole(file: &Path, text: &str) -> Result<(), SceneError> {
    prepare(file, text)?.put().map_err(|source| unwritable(file, source))
}

fn check_names<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), SceneError> {
    let mut seen = HashSet::new();
    for name in names {
        let sound = !name.is_empty()
            && name.trim() == name
            && !name.ends_with('\\')
            && !name.contains(['\n', '\r'])
            && seen.insert(name);
        if !sound {
            return Err(SceneError::new(
                Origin::Asked,
                SceneErrorKind::UnwritableName {
                    what,
                    name: name.to_owned(),
                },
            ));
        }
    }
    Ok(())
}

fn mtl_text(scene: &Scene) -> String {
    let mut text = String::new();
    for material in &scene.materials {
        let _ = writeln!(text, "newmtl {}", material.name);
        for (keyword, [r, g, b]) in [("Kd", material.reflectance), ("Ke", material.exitance)] {
            let _ = writeln!(text, "{keyword} {r:?} {g:?} {b:?}");
        }
    }
    text
}

fn obj_text(scene: &Scene, mtl_name: &str) -> String {
    let mut text = format!("mtllib {mtl_name}\n");
    for DVec3 { x, y, z } in &scene.vertices {
        let _ = writeln!(text, "v {x:?} {y:?} {z:?}");
    }
    if !surfaces_are_in_order(scene) {
        for surface in &scene.surfaces {
            let _ = writeln!(text, "o {}", surface.name);
        }
    }
    let mut last_surface = None;
    let mut last_material = None;
    for face in &scene.faces {
        if last_surface.replace(face.surface) != Some(face.surface) {
            let _ = writeln!(text, "o {}", scene.surfaces[face.surface.0 as usize].name);
        }
        if last_material.replace(face.material) != Some(face.material) {
            let _ = writeln!(text, "usemtl {}", scene.materials[face.material.0 as usize].name);
        }
        text.push('f');
        for &v in face.corners.as_slice() {
            let _ = write!(text, " {}", u64::from(v) + 1);
        }
        text.push('\n');
    }
    text
}

/// Returns whether the first faces of the surfaces are in the order of the surfaces; if not, all names are written before the first face.
fn surfaces_are_in_order(scene: &Scene) -> bool {
    let mut n_seen = 0;
    for face in &scene.faces {
        if face.surface.0 > n_seen {
            return false;
        }
        n_seen = n_seen.max(face.surface.0 + 1);
    }
    true
}
