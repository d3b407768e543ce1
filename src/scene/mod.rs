//! A validated scene: vertices, flat faces that see along their normal, named surfaces, materials.
//!
//! [`load`] reads files of any [`Format`], [`builtin::build`] makes the scenes of the literature, [`write_obj`] writes either,
//! and a [`Camera`] is the view of a scene.

pub mod topology;

use std::ops::{Deref, DerefMut};

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::geometry::polygon;

mod bright;
mod builder;
pub mod builtin;
mod camera;
mod cut_out;
mod default_view;
mod error;
mod far_parts;
pub mod frames;
pub(crate) mod hash;
mod io;
mod lighting;
mod lines;
mod misses;
mod motion;
mod overlap;
mod rounding;
mod split;
pub(crate) mod table;
pub(crate) mod toml_file;
mod warning;
mod written;

pub(crate) use bright::too_bright_patch;
pub use bright::{MAX_EXITANCE, MIN_EXITANCE};
pub use builder::{Added, SceneBuilder};
pub use camera::{Camera, IMAGE_SIDES};
pub use error::{Earlier, Numbering, Origin, SceneError, SceneErrorKind};
#[cfg(feature = "cli")]
pub(crate) use io::companions_of;
pub(crate) use io::{ARRAYS_NAME, load_within};
pub use io::{
    Arrays, DEFAULT_CREASE_ANGLE, DEFAULT_REFLECTANCE, Flip, Format, LengthUnit, LoadOptions, Loaded, USUAL_ARRAYS,
    UpAxis, from_arrays, load, load_with, write_obj,
};
pub use lighting::Lighting;
pub use motion::{Motion, MotionError, Names, Pose};
pub(crate) use rounding::{SLACK_PER_CORNER, slack_of};
pub use warning::{SceneWarning, SceneWarningKind};
pub use written::Written;

/// The greatest number of faces in a scene, 2³¹ − 1: a hit stores a face and a side in 32 bits
/// (see [`HitBatch`](crate::visibility::HitBatch)).
pub const MAX_FACES: u32 = u32::MAX / 2;

/// The greatest number of corners of one face of a file.
pub const MAX_CORNERS: u32 = 1 << 20;

/// The greatest |coordinate| in a scene, in m: beyond it, products of lengths leave the range of f32, in which rays are traced.
pub const MAX_COORDINATE: f64 = 1e15;

/// Index of a face in [`Scene::faces`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FaceId(pub u32);

/// Index of a surface in [`Scene::surfaces`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct SurfaceId(pub u32);

/// Index of a material in [`Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MaterialId(pub u32);

/// The corners of a face: three or four vertex indices, counter-clockwise seen from the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Corners {
    /// A triangle.
    Triangle([u32; 3]),
    /// A planar, convex quadrilateral.
    Quad([u32; 4]),
}

impl Corners {
    /// Returns the vertex indices as a slice of three or four.
    #[must_use]
    pub fn as_slice(&self) -> &[u32] {
        match self {
            Self::Triangle(v) => v,
            Self::Quad(v) => v,
        }
    }
}

/// One flat face: a triangle or a planar convex quad that sees along its normal and occludes from both sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Indices into [`Scene::vertices`].
    pub corners: Corners,
    /// The named group that owns the face.
    pub surface: SurfaceId,
    /// The face's material.
    pub material: MaterialId,
    /// The line of the scene file that contains the face; for binary files and scenes in memory its number (see [`Scene::numbering`]).
    pub line: u32,
}

/// A named group of faces (an OBJ `o` or `g`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Surface {
    /// The name in the scene file.
    pub name: String,
}

/// A diffuse material with three channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the material file.
    pub name: String,
    /// ρ, in \[0, 1\] per channel (`Kd`).
    pub reflectance: [f64; 3],
    /// E, self-emitted, W·m⁻² per channel (`Ke`).
    pub exitance: [f64; 3],
}

/// A validated scene; lengths in metres.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Vertices, shared between faces (bit-identical positions are one vertex).
    pub vertices: Vec<DVec3>,
    /// Faces in file order.
    pub faces: Vec<Face>,
    /// Surfaces in file order.
    pub surfaces: Vec<Surface>,
    /// Materials in the order of first use.
    pub materials: Vec<Material>,
    /// The precision of the coordinates in the file; `None` for a scene made in memory, whose coordinates are exact.
    pub written: Option<Written>,
    /// The things that the numbers of faces count.
    pub numbering: Numbering,
}

/// The corner positions of a face without heap memory, for the many tests of pairs of faces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Positions {
    at: [DVec3; 4],
    n: usize,
}

impl Positions {
    /// Returns the least and the greatest corner of the box around the face.
    pub(crate) fn bounding_box(&self) -> (DVec3, DVec3) {
        polygon::bounds(self.iter())
    }
}

impl Deref for Positions {
    type Target = [DVec3];

    fn deref(&self) -> &[DVec3] {
        &self.at[..self.n]
    }
}

impl DerefMut for Positions {
    fn deref_mut(&mut self) -> &mut [DVec3] {
        &mut self.at[..self.n]
    }
}

impl Scene {
    /// Returns the surface of a name.
    #[must_use]
    pub fn surface_named(&self, name: &str) -> Option<SurfaceId> {
        let place = self.surfaces.iter().position(|surface| surface.name == name);
        place.and_then(|k| u32::try_from(k).ok()).map(SurfaceId)
    }

    /// Returns the corner positions of a face without heap memory.
    pub(crate) fn positions(&self, face: &Face) -> Positions {
        let vertices = face.corners.as_slice();
        Positions {
            at: std::array::from_fn(|k| self.vertices[vertices[k.min(vertices.len() - 1)] as usize]),
            n: vertices.len(),
        }
    }

    /// Returns the corner positions of a face.
    #[must_use]
    pub fn polygon(&self, face: FaceId) -> Vec<DVec3> {
        self.faces[face.0 as usize]
            .corners
            .as_slice()
            .iter()
            .map(|&v| self.vertices[v as usize])
            .collect()
    }

    /// Returns area times unit normal of a face, in m².
    #[must_use]
    pub fn area_vector(&self, face: FaceId) -> DVec3 {
        polygon::area_vector(&self.positions(&self.faces[face.0 as usize]))
    }

    /// Returns the place of a face in the file that the scene was read from.
    #[must_use]
    pub fn origin(&self, file: impl Into<std::path::PathBuf>, face: FaceId) -> Origin {
        self.numbering.origin(file, self.faces[face.0 as usize].line)
    }

    /// Iterates over all face ids in file order.
    pub fn face_ids(&self) -> impl ExactSizeIterator<Item = FaceId> + use<> {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the number of faces is checked against u32 when a scene is built"
        )]
        let n = self.faces.len() as u32;
        (0..n).map(FaceId)
    }

    /// Returns the least and greatest corner of the box around all vertices in use.
    #[must_use]
    pub fn bounding_box(&self) -> (DVec3, DVec3) {
        let used = self.faces.iter().flat_map(|face| face.corners.as_slice());
        polygon::bounds(used.map(|&v| &self.vertices[v as usize]))
    }

    /// Renames different materials of one name: each gets the name of the first surface that has it appended.
    pub(crate) fn name_materials_apart(&mut self) {
        let mut surface_of = vec![None; self.materials.len()];
        for face in &self.faces {
            surface_of[face.material.0 as usize].get_or_insert(face.surface);
        }
        let mut taken = std::collections::HashSet::new();
        for (material, surface) in self.materials.iter_mut().zip(surface_of) {
            if !taken.contains(&material.name) {
                taken.insert(material.name.clone());
                continue;
            }
            let surface = surface.map_or("", |surface| &self.surfaces[surface.0 as usize].name);
            let mut name = format!("{} {surface}", material.name);
            while !taken.insert(name.clone()) {
                name.push('_');
            }
            material.name = name;
        }
    }

    /// Returns whether any face emits light: some channel of E of its material is positive.
    #[must_use]
    pub fn is_emitting(&self) -> bool {
        self.materials_in_use().any(|m| m.exitance.iter().any(|&e| e > 0.0))
    }

    /// Returns whether any face reflects light: some channel of ρ of its material is positive.
    #[must_use]
    pub fn is_reflecting(&self) -> bool {
        self.materials_in_use()
            .any(|m| m.reflectance.iter().any(|&rho| rho > 0.0))
    }

    /// Returns the greatest reflectance of all faces and channels.
    #[must_use]
    pub fn reflectance_max(&self) -> f64 {
        let reflectances = self.materials_in_use().flat_map(|m| m.reflectance);
        reflectances.fold(0.0, f64::max)
    }

    /// Returns how many channels a solution needs: 1 if every material in use is grey in both ρ and E, otherwise 3.
    #[must_use]
    pub fn n_channels_needed(&self) -> usize {
        let grey = |v: [f64; 3]| v.iter().all(|x| x.to_bits() == v[0].to_bits());
        if self.materials_in_use().all(|m| grey(m.reflectance) && grey(m.exitance)) {
            1
        } else {
            3
        }
    }

    fn materials_in_use(&self) -> impl Iterator<Item = &Material> {
        self.faces.iter().map(|f| &self.materials[f.material.0 as usize])
    }
}

#[cfg(test)]
impl Scene {
    /// Returns a scene of grey quads, each a surface of its own.
    pub(crate) fn of_quads(outlines: &[[DVec3; 4]]) -> Self {
        let mut scene = Self::default();
        scene.materials.push(Material {
            name: "grey".into(),
            reflectance: [0.5; 3],
            exitance: [0.0; 3],
        });
        for (k, outline) in (0..).zip(outlines) {
            scene.vertices.extend(outline);
            scene.surfaces.push(Surface {
                name: format!("face{k}"),
            });
            scene.faces.push(Face {
                corners: Corners::Quad([0, 1, 2, 3].map(|corner| 4 * k + corner)),
                surface: SurfaceId(k),
                material: MaterialId(0),
                line: 0,
            });
        }
        scene
    }
}
