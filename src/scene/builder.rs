//! Puts a scene together: merges vertices, names surfaces, splits outlines, and refuses what no method could use.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::cut_out::{CutOut, Refused, cut_out};
use super::misses::Misses;
use super::split::{Outline, split};
use super::{
    Corners, Face, MAX_CORNERS, MAX_FACES, Material, MaterialId, Scene, SceneError, Surface, SurfaceId, Written,
};
use crate::geometry::polygon;

/// How far from flat an outline may be, in units of the diagonal of its box, before it is doubted: a thousandth is more than any rounding, and
/// where the two ways to cut a quad in two differ by that, so do areas and form factors by as much as a millionth.
const BENT: f64 = 1e-3;

/// Collects faces in the order in which they are given.
pub(super) struct Builder {
    file: PathBuf,
    scene: Scene,
    misses: Misses,
    vertex_of_position: HashMap<[u64; 3], u32>,
    line_of_outline: HashMap<Vec<u32>, u32>,
}

/// What became of an outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Added {
    /// It is part of the scene.
    Faces,
    /// It is part of the scene, and so far from flat that it matters how it was cut into triangles.
    Bent,
    /// It has no area, and was left out.
    ZeroArea,
}

impl Builder {
    /// Begins an empty scene; `file` is named in errors.
    pub(super) fn new(file: &Path) -> Self {
        Self {
            file: file.to_owned(),
            scene: Scene::default(),
            misses: Misses::default(),
            vertex_of_position: HashMap::new(),
            line_of_outline: HashMap::new(),
        }
    }

    /// Says how finely the coordinates are written.
    pub(super) fn written(&mut self, written: Written) {
        self.scene.written = Some(written);
    }

    /// Adds a surface.
    pub(super) fn surface(&mut self, name: impl Into<String>) -> Result<SurfaceId, SceneError> {
        let id = self.id(self.scene.surfaces.len(), "surfaces")?;
        self.scene.surfaces.push(Surface { name: name.into() });
        Ok(SurfaceId(id))
    }

    /// Adds a material.
    pub(super) fn material(&mut self, material: Material) -> Result<MaterialId, SceneError> {
        let id = self.id(self.scene.materials.len(), "materials")?;
        self.scene.materials.push(material);
        Ok(MaterialId(id))
    }

    /// Adds the faces of an outline.
    ///
    /// # Errors
    /// An outline that crosses itself or repeats an earlier one with the same winding; too many faces.
    pub(super) fn face(
        &mut self,
        corners: &[DVec3],
        surface: SurfaceId,
        material: MaterialId,
        line: u32,
    ) -> Result<Added, SceneError> {
        let mut corners = corners.to_vec();
        without_repeats(&mut corners);
        self.below(corners.len().saturating_sub(1), MAX_CORNERS, "corners in one face")?;
        if let Some(written) = &self.scene.written {
            self.misses.see(&corners, written);
        }
        let faces = match split(&corners) {
            Outline::ZeroArea => return Ok(Added::ZeroArea),
            Outline::SelfIntersecting => {
                return Err(SceneError::SelfIntersecting {
                    file: self.file.clone(),
                    line,
                });
            }
            Outline::Faces(faces) => faces,
        };
        let vertices = corners.iter().map(|&v| self.vertex(v)).collect::<Result<Vec<_>, _>>()?;
        if let Some(&first_line) = self.line_of_outline.get(&from_least(&vertices)) {
            return Err(SceneError::DuplicateFace {
                file: self.file.clone(),
                line,
                first_line,
            });
        }
        self.line_of_outline.insert(from_least(&vertices), line);
        let vertex_at = |i: u32| vertices[i as usize];
        for face in faces {
            self.id(self.scene.faces.len(), "faces")?;
            self.scene.faces.push(Face {
                corners: match face {
                    Corners::Triangle(v) => Corners::Triangle(v.map(vertex_at)),
                    Corners::Quad(v) => Corners::Quad(v.map(vertex_at)),
                },
                surface,
                material,
                line,
            });
        }
        Ok(if is_bent(&corners) { Added::Bent } else { Added::Faces })
    }

    /// Ends the scene: what is drawn on larger faces is cut out of them, surfaces and materials without faces are dropped, materials take the order of their first use.
    ///
    /// # Errors
    /// No face, or faces of one winding that coincide.
    pub(super) fn finish(self) -> Result<(Scene, Option<CutOut>), SceneError> {
        let Self {
            file,
            mut scene,
            misses,
            vertex_of_position,
            line_of_outline,
        } = self;
        // What comes has tables of its own, and these are done with.
        drop((vertex_of_position, line_of_outline));
        if scene.faces.is_empty() {
            return Err(SceneError::NoFaces { file });
        }
        // Where the digits show it there is nothing to look for; what is cut out of others misses them no more.
        if let Some(mut written) = scene.written.filter(|written| !written.shows_rounding()) {
            written.misses = misses.show_rounding(&scene, &written);
            scene.written = Some(written);
        }
        let cut = cut_out(&mut scene).map_err(|refused| match refused {
            Refused::Coincident(faces) => {
                let [line, first_line] = faces.map(|face| scene.faces[face.0 as usize].line);
                SceneError::OverlappingFaces { file, line, first_line }
            }
            Refused::TooMany(what) => SceneError::TooMany {
                file,
                what,
                limit: MAX_FACES,
            },
        })?;
        let mut surface_in_use = vec![false; scene.surfaces.len()];
        for face in &scene.faces {
            surface_in_use[face.surface.0 as usize] = true;
        }
        let mut new_surface = HashMap::new();
        let mut surfaces = Vec::new();
        for (id, surface) in (0..).map(SurfaceId).zip(std::mem::take(&mut scene.surfaces)) {
            if surface_in_use[id.0 as usize] {
                new_surface.insert(id, SurfaceId(self_len(&surfaces)));
                surfaces.push(surface);
            }
        }
        let mut new_material = HashMap::new();
        let mut materials = Vec::new();
        for face in &mut scene.faces {
            face.surface = new_surface[&face.surface];
            face.material = *new_material.entry(face.material).or_insert_with(|| {
                let id = MaterialId(self_len(&materials));
                materials.push(scene.materials[face.material.0 as usize].clone());
                id
            });
        }
        scene.surfaces = surfaces;
        scene.materials = materials;
        Ok((scene, cut))
    }

    fn vertex(&mut self, position: DVec3) -> Result<u32, SceneError> {
        // Adding zero turns -0.0 into 0.0: the same place must be the same vertex.
        let position = position + 0.0;
        let key = position.to_array().map(f64::to_bits);
        if let Some(&vertex) = self.vertex_of_position.get(&key) {
            return Ok(vertex);
        }
        let vertex = self.id(self.scene.vertices.len(), "vertices")?;
        self.scene.vertices.push(position);
        self.vertex_of_position.insert(key, vertex);
        Ok(vertex)
    }

    /// Returns the id of the next of `count` things, while there are ids.
    fn id(&self, count: usize, what: &'static str) -> Result<u32, SceneError> {
        self.below(count, MAX_FACES, what)
    }

    fn below(&self, count: usize, limit: u32, what: &'static str) -> Result<u32, SceneError> {
        u32::try_from(count)
            .ok()
            .filter(|n| *n < limit)
            .ok_or_else(|| SceneError::TooMany {
                file: self.file.clone(),
                what,
                limit,
            })
    }
}

/// The number of things of which there are at most as many as of those that already have a u32 id.
#[expect(clippy::cast_possible_truncation, reason = "a subset of things with u32 ids")]
fn self_len<T>(things: &[T]) -> u32 {
    things.len() as u32
}

/// Removes corners that repeat their predecessor, the last before the first among them.
pub(super) fn without_repeats(corners: &mut Vec<DVec3>) {
    corners.dedup();
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
}

/// Tells whether a corner is further than [`BENT`] of the size of an outline from its plane.
fn is_bent(corners: &[DVec3]) -> bool {
    let (low, high) = corners
        .iter()
        .fold((corners[0], corners[0]), |(low, high), &v| (low.min(v), high.max(v)));
    corners.len() > 3 && polygon::planarity_error(corners) > BENT * low.distance(high)
}

/// Turns an outline so that it begins with its least vertex: the same outline from any start.
fn from_least(vertices: &[u32]) -> Vec<u32> {
    let mut turned = vertices.to_vec();
    let least = (0..turned.len()).min_by_key(|&k| turned[k]).unwrap_or(0);
    turned.rotate_left(least);
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_id_is_the_limit_less_one() {
        let builder = Builder::new(Path::new("big.obj"));
        let limit = MAX_FACES as usize;
        assert_eq!(builder.id(limit - 1, "faces").ok(), Some(MAX_FACES - 1));
        let error = builder.id(limit, "faces").expect_err("one too many");
        assert_eq!(
            error.to_string(),
            "big.obj: 2147483647 faces is the limit, and there are more; split the scene"
        );
    }

    #[test]
    fn an_outline_is_the_same_from_any_start_but_not_reversed() {
        assert_eq!(from_least(&[7, 3, 5, 9]), from_least(&[5, 9, 7, 3]));
        assert_ne!(from_least(&[7, 3, 5, 9]), from_least(&[9, 5, 3, 7]));
    }
}
