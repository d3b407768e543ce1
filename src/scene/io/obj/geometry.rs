//! Reads the geometry of a checked OBJ file through tobj.

use std::path::Path;

use glam::DVec3;

use super::super::polygons::Polygons;
use crate::scene::{Origin, SceneError, SceneErrorKind};

/// Sets the vertices and corners of `polygons`, whose faces are already counted, from `geometry`: the checked `v` and `f` lines of the file.
pub(super) fn parse(geometry: &str, polygons: &mut Polygons, file: &Path) -> Result<(), SceneError> {
    let disagree = |message: String| SceneError::new(Origin::file(file.to_owned()), SceneErrorKind::Parser { message });
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj_buf(&mut geometry.as_bytes(), &options, |_| {
        Err(tobj::LoadError::OpenFileFailed)
    })
    .map_err(|error| disagree(error.to_string()))?;
    let expected = (polygons.corners.len(), polygons.faces.len());
    polygons.vertices.clear();
    polygons.corners.clear();
    let mut ends = Vec::with_capacity(polygons.faces.len());
    for model in models {
        let mesh = model.mesh;
        // Numbers beyond u32 are refused below.
        let first = u32::try_from(polygons.vertices.len()).unwrap_or(u32::MAX);
        let positions = mesh.positions.as_chunks::<3>().0.iter();
        polygons
            .vertices
            .extend(positions.map(|&position| DVec3::from_array(position)));
        let mut end = polygons.corners.len();
        polygons
            .corners
            .extend(mesh.indices.iter().map(|v| first.saturating_add(*v)));
        // The parser omits the arities where all faces are triangles.
        let n_faces = if mesh.face_arities.is_empty() {
            mesh.indices.len() / 3
        } else {
            mesh.face_arities.len()
        };
        for k in 0..n_faces {
            end += mesh.face_arities.get(k).map_or(3, |&n| n as usize);
            ends.push(end);
        }
    }
    let found = (polygons.corners.len(), ends.len());
    let is_sound = found == expected
        && polygons.faces.iter().zip(&ends).all(|(face, end)| face.end == *end)
        && u32::try_from(polygons.vertices.len()).is_ok();
    if !is_sound {
        return Err(disagree(format!("{} faces, not {}", found.1, expected.1)));
    }
    Ok(())
}
