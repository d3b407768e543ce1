//! Puts a scene together: merges vertices, names surfaces, splits outlines, and refuses faces that no method can use.

use std::collections::hash_map::Entry;
use std::hash::Hash;
use std::path::PathBuf;

use foldhash::{HashMap, HashMapExt as _};
use glam::DVec3;

use super::bright::{is_too_dim, too_bright};
use super::cut_out::{CutOut, Refused, cut_out};
use super::error::Earlier;
use super::misses::Misses;
use super::split::{Outline, split};
use super::{
    Corners, Face, Loaded, MAX_COORDINATE, MAX_CORNERS, MAX_FACES, MIN_EXITANCE, Material, MaterialId, Numbering,
    Origin, Scene, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind, Surface, SurfaceId, Written,
};
use crate::geometry::polygon;

/// The distance from its plane, in units of the diagonal of its box, beyond which an outline causes a warning.
///
/// It is above any rounding. At this distance the two ways to cut a quad into triangles differ in areas and form factors by up to a millionth.
const BENT: f64 = 1e-3;

/// The result of adding an outline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Added {
    /// It is part of the scene.
    Faces,
    /// It has no area, and was left out.
    ZeroArea,
}

/// Builds a [`Scene`] from vertices, faces, surfaces and materials; there is no other way to make one.
///
/// Every f64 of a coordinate survives, and bit-identical positions become one vertex. Faces follow the rules for those of a file ([`load`](super::load)).
///
/// ```
/// use radiosity::scene::{Material, SceneBuilder};
///
/// # fn main() -> Result<(), radiosity::scene::SceneError> {
/// let mut builder = SceneBuilder::new();
/// let floor = builder.surface("floor")?;
/// let grey = builder.material(Material { name: "grey".into(), reflectance: [0.5; 3], exitance: [0.0; 3] })?;
/// let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
/// builder.faces(&vertices, &[[0, 1, 2, 3]], &[floor], &[grey])?;
/// let scene = builder.build()?.scene;
/// assert_eq!(scene.faces.len(), 1);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Default)]
pub struct SceneBuilder {
    /// The file that errors name; `None` for a scene made in memory, whose faces have numbers in place of lines.
    file: Option<PathBuf>,
    scene: Scene,
    misses: Misses,
    vertex_of_position: HashMap<[u64; 3], u32>,
    line_of_outline: OutlineLines,
    bent: FirstAndCount,
    without_area: FirstAndCount,
    n_added: u32,
}

/// The first line of each outline; outlines of up to four corners, the most frequent, need no memory of their own.
#[derive(Debug, Default)]
struct OutlineLines {
    small: HashMap<[u32; 4], u32>,
    large: HashMap<Vec<u32>, u32>,
}

impl OutlineLines {
    /// Adds an outline, or returns the line of an equal one.
    fn insert(&mut self, vertices: &[u32], line: u32) -> Option<u32> {
        fn insert<K: Eq + Hash>(known: &mut HashMap<K, u32>, key: K, line: u32) -> Option<u32> {
            match known.entry(key) {
                Entry::Occupied(known) => Some(*known.get()),
                Entry::Vacant(free) => {
                    free.insert(line);
                    None
                }
            }
        }
        let n = vertices.len();
        if n > 4 {
            let mut key = vertices.to_vec();
            from_least(&mut key);
            return insert(&mut self.large, key, line);
        }
        // A triangle has no fourth vertex, and no vertex has the number `u32::MAX`.
        let mut key = [u32::MAX; 4];
        key[..n].copy_from_slice(vertices);
        from_least(&mut key[..n]);
        insert(&mut self.small, key, line)
    }
}

/// The first line of an event, and the number of events.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FirstAndCount(pub(super) Option<(u32, usize)>);

impl FirstAndCount {
    pub(super) fn count(&mut self, line: u32) {
        let (first, count) = self.0.unwrap_or((line, 0));
        self.0 = Some((first, count + 1));
    }
}

impl SceneBuilder {
    /// Begins an empty scene in memory. Errors and warnings number its faces from 0.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Begins an empty scene of a file, which errors and warnings name.
    #[must_use]
    pub fn of_file(file: impl Into<PathBuf>) -> Self {
        let builder = Self {
            file: Some(file.into()),
            ..Self::default()
        };
        builder.numbered(Numbering::Lines)
    }

    /// Returns the builder with faces numbered by something other than lines.
    #[must_use]
    pub fn numbered(mut self, numbering: Numbering) -> Self {
        self.scene.numbering = numbering;
        self
    }

    /// Returns the place of a face.
    fn at(&self, line: u32) -> Origin {
        self.scene.numbering.origin(self.file.clone().unwrap_or_default(), line)
    }

    fn earlier(&self, line: u32) -> Earlier {
        match &self.scene.numbering {
            Numbering::Lines => Earlier::Line(line),
            Numbering::Memory => Earlier::Number(line),
            numbering @ Numbering::Elements { .. } => Earlier::Element(numbering.label(line)),
        }
    }

    /// Returns the origin of errors about the whole scene.
    fn whole(&self) -> Origin {
        self.file
            .as_ref()
            .map_or_else(|| in_memory("the scene".to_owned()), Origin::file)
    }

    /// Sets the precision with which the coordinates are written.
    pub fn written(&mut self, written: Written) {
        self.scene.written = Some(written);
    }

    /// Adds a surface.
    ///
    /// # Errors
    /// [`SceneErrorKind::TooMany`].
    pub fn surface(&mut self, name: impl Into<String>) -> Result<SurfaceId, SceneError> {
        let id = self.id(self.scene.surfaces.len(), "surfaces")?;
        self.scene.surfaces.push(Surface { name: name.into() });
        Ok(SurfaceId(id))
    }

    /// Adds a material.
    ///
    /// # Errors
    /// [`SceneErrorKind::ReflectanceOutOfRange`], [`SceneErrorKind::ExitanceOutOfRange`], [`SceneErrorKind::TooDim`] and [`SceneErrorKind::TooMany`].
    pub fn material(&mut self, material: Material) -> Result<MaterialId, SceneError> {
        let id = self.id(self.scene.materials.len(), "materials")?;
        let refused = |kind| SceneError::new(in_memory(format!("material `{}`", material.name)), kind);
        if let Some(&value) = material.reflectance.iter().find(|rho| !(0.0..=1.0).contains(*rho)) {
            return Err(refused(SceneErrorKind::ReflectanceOutOfRange { keyword: "Kd", value }));
        }
        if let Some(&value) = material.exitance.iter().find(|e| !(e.is_finite() && **e >= 0.0)) {
            return Err(refused(SceneErrorKind::ExitanceOutOfRange { keyword: "Ke", value }));
        }
        if let Some(&value) = material.exitance.iter().find(|e| is_too_dim(**e)) {
            let limit = MIN_EXITANCE;
            return Err(refused(SceneErrorKind::TooDim {
                keyword: "Ke",
                value,
                limit,
            }));
        }
        self.scene.materials.push(material);
        Ok(MaterialId(id))
    }

    /// Adds faces, each given by the indices of three or more vertices, counter-clockwise seen from the front.
    ///
    /// `surfaces` and `materials` have one element for each face, or one for all.
    ///
    /// # Errors
    /// [`SceneErrorKind::BadCoordinate`], [`SceneErrorKind::IndexOutOfRange`], [`SceneErrorKind::TooFewCorners`], those of [`face`](Self::face), and [`SceneErrorKind::NotOneEach`] of slices that do not fit.
    pub fn faces<F: AsRef<[u32]>>(
        &mut self,
        vertices: &[[f64; 3]],
        faces: &[F],
        surfaces: &[SurfaceId],
        materials: &[MaterialId],
    ) -> Result<(), SceneError> {
        for (what, n) in [("surfaces", surfaces.len()), ("materials", materials.len())] {
            if n != 1 && n != faces.len() {
                let n_faces = faces.len();
                return Err(SceneError::new(
                    self.whole(),
                    SceneErrorKind::NotOneEach { what, n, n_faces },
                ));
            }
        }
        let is_good = |x: &f64| x.abs() <= MAX_COORDINATE;
        for (k, vertex) in vertices.iter().enumerate() {
            if let Some(bad) = vertex.iter().find(|x| !is_good(x)) {
                let token = bad.to_string();
                return Err(SceneError::new(
                    in_memory(format!("vertex {k}")),
                    SceneErrorKind::BadCoordinate { token },
                ));
            }
        }
        for (k, face) in faces.iter().enumerate() {
            let (number, indices) = (self.n_added, face.as_ref());
            let refused = |kind| SceneError::new(in_memory(format!("face {number}")), kind);
            if indices.len() < 3 {
                let count = indices.len();
                return Err(refused(SceneErrorKind::TooFewCorners { count }));
            }
            let corner = |&index: &u32| {
                let vertex = vertices.get(index as usize);
                vertex.copied().map(DVec3::from).ok_or_else(|| {
                    refused(SceneErrorKind::IndexOutOfRange {
                        index: index.into(),
                        n_vertices: vertices.len(),
                    })
                })
            };
            let corners = indices.iter().map(corner).collect::<Result<Vec<_>, _>>()?;
            let of_face = |n: usize| if n == 1 { 0 } else { k };
            let (surface, material) = (surfaces[of_face(surfaces.len())], materials[of_face(materials.len())]);
            self.face(&corners, surface, material, number)?;
        }
        Ok(())
    }

    /// Adds the faces of an outline; `line` is its line in the file, or its number (see [`numbered`](Self::numbered)).
    ///
    /// # Errors
    /// [`SceneErrorKind::SelfIntersecting`], [`SceneErrorKind::DuplicateFace`] of an outline that repeats an earlier one with the same winding, and [`SceneErrorKind::TooMany`].
    pub fn face(
        &mut self,
        corners: &[DVec3],
        surface: SurfaceId,
        material: MaterialId,
        line: u32,
    ) -> Result<Added, SceneError> {
        self.n_added += 1;
        let mut corners = corners.to_vec();
        without_repeats(&mut corners);
        self.below(corners.len().saturating_sub(1), MAX_CORNERS, "corners in one face")?;
        if let Some(written) = &self.scene.written {
            self.misses.see(&corners, written);
        }
        let faces = match split(&corners) {
            Outline::ZeroArea => {
                self.without_area.count(line);
                return Ok(Added::ZeroArea);
            }
            Outline::SelfIntersecting => {
                return Err(SceneError::new(self.at(line), SceneErrorKind::SelfIntersecting));
            }
            Outline::Faces(faces) => faces,
        };
        let vertices = corners.iter().map(|&v| self.vertex(v)).collect::<Result<Vec<_>, _>>()?;
        if let Some(first_line) = self.line_of_outline.insert(&vertices, line) {
            return Err(SceneError::new(
                self.at(line),
                SceneErrorKind::DuplicateFace {
                    first: self.earlier(first_line),
                },
            ));
        }
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
        if is_bent(&corners) {
            self.bent.count(line);
        }
        Ok(Added::Faces)
    }

    /// Finishes the scene.
    ///
    /// Faces drawn on larger ones are cut out of these, surfaces and materials without faces are dropped, and materials take the order of their first use.
    /// Warnings name faces that are not flat, have no area, or lie on others. A scene without emitters causes no warning: callers that need light check for it.
    ///
    /// # Errors
    /// [`SceneErrorKind::NoFaces`], [`SceneErrorKind::OverlappingFaces`] and [`SceneErrorKind::TooBright`].
    pub fn build(mut self) -> Result<Loaded, SceneError> {
        // The next steps build tables of their own; this frees the memory of these.
        self.vertex_of_position = HashMap::new();
        self.line_of_outline = OutlineLines::default();
        if self.scene.faces.is_empty() {
            return Err(SceneError::new(self.whole(), SceneErrorKind::NoFaces));
        }
        // Misses matter only where the digits do not show the rounding, and cutting removes the misses of the faces that it cuts.
        if let Some(mut written) = self.scene.written.filter(|written| !written.shows_rounding()) {
            written.misses = std::mem::take(&mut self.misses).show_rounding(&self.scene, &written);
            self.scene.written = Some(written);
        }
        let mut scene = std::mem::take(&mut self.scene);
        self.scene.numbering = scene.numbering.clone();
        let cut = cut_out(&mut scene).map_err(|refused| match refused {
            Refused::Coincident(faces) => {
                let [line, first_line] = faces.map(|face| scene.faces[face.0 as usize].line);
                SceneError::new(
                    self.at(line),
                    SceneErrorKind::OverlappingFaces {
                        first: self.earlier(first_line),
                    },
                )
            }
            Refused::TooMany(what) => {
                let limit = MAX_FACES;
                SceneError::new(self.whole(), SceneErrorKind::TooMany { what, limit })
            }
        })?;
        let warnings = self.warnings(cut);
        let scene = without_unused(scene);
        if self.file.is_none()
            && let Some((material, value, limit)) = too_bright(&scene)
        {
            let at = in_memory(format!("material `{}`", material.name));
            return Err(SceneError::new(
                at,
                SceneErrorKind::TooBright {
                    keyword: "Ke",
                    value,
                    limit,
                },
            ));
        }
        Ok(Loaded { scene, warnings })
    }

    fn warnings(&self, cut: Option<CutOut>) -> Vec<SceneWarning> {
        let mut warnings = Vec::new();
        let mut warn = |line: u32, kind| warnings.push(SceneWarning::new(self.at(line), kind));
        if let Some((line, count)) = self.bent.0 {
            warn(line, SceneWarningKind::BentFaces { count });
        }
        if let Some((line, count)) = self.without_area.0 {
            warn(line, SceneWarningKind::ZeroAreaFaces { count });
        }
        if let Some(cut) = cut {
            let (count, area, moved) = (cut.count, cut.area, cut.moved);
            warn(cut.line, SceneWarningKind::CutFaces { count, area, moved });
            if let Some((line, n_covered)) = cut.covered {
                warn(line, SceneWarningKind::CoveredFaces { count: n_covered });
            }
        }
        warnings
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

    /// Returns the id of the next thing after `count` others, while ids remain.
    fn id(&self, count: usize, what: &'static str) -> Result<u32, SceneError> {
        self.below(count, MAX_FACES, what)
    }

    fn below(&self, count: usize, limit: u32, what: &'static str) -> Result<u32, SceneError> {
        u32::try_from(count)
            .ok()
            .filter(|n| *n < limit)
            .ok_or_else(|| SceneError::new(self.whole(), SceneErrorKind::TooMany { what, limit }))
    }
}

/// Drops surfaces and materials without faces; materials take the order of their first use.
fn without_unused(mut scene: Scene) -> Scene {
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
    scene
}

fn in_memory(element: String) -> Origin {
    Origin::Memory { element }
}

/// Returns the number of things that are a subset of things with u32 ids.
#[expect(clippy::cast_possible_truncation, reason = "a subset of things with u32 ids")]
fn self_len<T>(things: &[T]) -> u32 {
    things.len() as u32
}

/// Removes corners that repeat their predecessor; the last corner counts as the predecessor of the first.
pub(super) fn without_repeats(corners: &mut Vec<DVec3>) {
    corners.dedup();
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
}

/// Returns whether a corner is further from the plane of an outline than [`BENT`] of its size.
fn is_bent(corners: &[DVec3]) -> bool {
    let (low, high) = polygon::bounds(corners);
    corners.len() > 3 && polygon::planarity_error(corners) > BENT * low.distance(high)
}

/// Rotates an outline so that it begins with its least vertex, which makes equal outlines with different starts identical.
fn from_least(vertices: &mut [u32]) {
    let least = (0..vertices.len()).min_by_key(|&k| vertices[k]).unwrap_or(0);
    vertices.rotate_left(least);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_id_is_the_limit_less_one() {
        let builder = SceneBuilder::of_file("big.obj");
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
        let turned = |mut outline: [u32; 4]| {
            from_least(&mut outline);
            outline
        };
        assert_eq!(turned([7, 3, 5, 9]), turned([5, 9, 7, 3]));
        assert_ne!(turned([7, 3, 5, 9]), turned([9, 5, 3, 7]));
    }
}
