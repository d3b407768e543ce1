//! Scenes from arrays in memory, divided into surfaces as those of files are.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::polygons::{FileMaterial, NONE, Polygons};
use super::{Counts, LoadOptions, Loaded, assemble};
use crate::scene::{MAX_COORDINATE, Numbering, Origin, SceneError, SceneErrorKind, Written};

/// The name of a scene from arrays in messages that name no face.
pub(crate) const NAME: &str = "scene";

/// Faces in memory, with their surfaces and materials.
#[derive(Clone, Copy, Debug)]
pub struct Arrays<'a> {
    /// The vertices, in the unit and axes of the options.
    pub vertices: &'a [[f64; 3]],
    /// The vertices of all faces, one face after another, counter-clockwise seen from the front.
    pub corners: &'a [u32],
    /// Where the corners of each face end.
    pub ends: &'a [usize],
    /// The names of the surfaces; empty to divide faces at creases, as in a file without names.
    pub surface_names: &'a [String],
    /// The surface of each face; empty where there are no names.
    pub surfaces: &'a [u32],
    /// ρ of each face, or of all.
    pub reflectance: &'a [[f64; 3]],
    /// E of each face, or of all, W·m⁻².
    pub exitance: &'a [[f64; 3]],
}

impl Arrays<'_> {
    /// Returns an upper bound of the memory needed to make a scene of the arrays, in bytes.
    pub(crate) fn needed_bytes(&self) -> u64 {
        let counts = Counts {
            vertices: self.vertices.len() as u64,
            corners: self.corners.len() as u64,
            faces: self.ends.len() as u64,
        };
        counts.bytes()
    }
}

/// Makes a scene of arrays as [`load_with`](super::load_with) does of a file; faces are numbered from 0.
///
/// Every f64 of a coordinate survives. Faces with the same reflectance and exitance share a material. Options about files have no effect.
///
/// # Errors
/// As [`load`](super::load), with the number of the face or vertex.
///
/// # Panics
/// If the arrays do not fit each other.
#[track_caller]
pub fn from_arrays(arrays: &Arrays<'_>, options: &LoadOptions) -> Result<Loaded, SceneError> {
    let n_faces = arrays.ends.len();
    assert_eq!(arrays.ends.last().copied().unwrap_or(0), arrays.corners.len());
    assert!(arrays.ends.is_sorted(), "one face after another");
    for of_faces in [arrays.reflectance.len(), arrays.exitance.len()] {
        assert!([1, n_faces].contains(&of_faces), "one for each face, or for all");
    }
    if !arrays.surface_names.is_empty() {
        assert_eq!(arrays.surfaces.len(), n_faces, "one surface for each face");
        let n_surfaces = arrays.surface_names.len();
        assert!(arrays.surfaces.iter().all(|&surface| (surface as usize) < n_surfaces));
    }
    expect_sound(arrays)?;
    let mut polygons = Polygons {
        vertices: arrays
            .vertices
            .iter()
            .map(|&vertex| DVec3::from_array(vertex))
            .collect(),
        groups: arrays.surface_names.to_vec(),
        written: Written::new(),
        ..Polygons::default()
    };
    for value in arrays.vertices.as_flattened() {
        polygons.written.see_binary(*value);
    }
    let mut known = HashMap::new();
    let mut start = 0;
    for (k, (&end, number)) in arrays.ends.iter().zip(0_u32..).enumerate() {
        let [rho, e] = [arrays.reflectance, arrays.exitance].map(|all| all[if all.len() == 1 { 0 } else { k }]);
        let key = [rho, e].map(|rgb| rgb.map(f64::to_bits));
        let n_materials = u32::try_from(polygons.materials.len()).unwrap_or(NONE - 1);
        let material = *known.entry(key).or_insert(n_materials);
        if material == n_materials {
            polygons.materials.push(FileMaterial {
                name: format!("material{n_materials}"),
                reflectance: Some(rho),
                exitance: e,
                exitance_keyword: "Ke",
                at: at_face(number),
                doubts: Vec::new(),
            });
        }
        let surface = arrays.surfaces.get(k).copied().unwrap_or(NONE);
        polygons.face(arrays.corners[start..end].iter().copied(), surface, material, number);
        start = end;
    }
    assemble::assemble(polygons, Path::new(NAME), options)
}

fn at_face(number: u32) -> Origin {
    Numbering::Memory.origin("", number)
}

/// Refuses invalid coordinates and faces.
fn expect_sound(arrays: &Arrays<'_>) -> Result<(), SceneError> {
    let is_bad = |x: &&f64| x.is_nan() || x.abs() > MAX_COORDINATE;
    for (k, vertex) in arrays.vertices.iter().enumerate() {
        if let Some(bad) = vertex.iter().find(is_bad) {
            let at = Origin::Memory {
                element: format!("vertex {k}"),
            };
            let token = bad.to_string();
            return Err(SceneError::new(at, SceneErrorKind::BadCoordinate { token }));
        }
    }
    let mut start = 0;
    for (number, &end) in (0_u32..).zip(arrays.ends) {
        let count = end - start;
        if count < 3 {
            return Err(SceneError::new(
                at_face(number),
                SceneErrorKind::TooFewCorners { count },
            ));
        }
        start = end;
    }
    Ok(())
}
