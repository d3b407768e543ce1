//! Reads scene files: one reader per format, behind one trait, and one path from its polygons to a [`Scene`](super::Scene).
//!
//! [`Format`] lists the formats and detects that of a file. A reader returns the polygons of a file, with the names of surfaces and
//! materials. `assemble` scales and turns them, joins vertices, divides faces into surfaces where the file names none, and passes them to a
//! [`SceneBuilder`](super::SceneBuilder), which checks them.
//!
//! The readers are our own. The libraries for these formats do not report the line or element of an error, do not keep all digits of
//! text and their number, and do not bound memory by the length of the file where a header is wrong.

use std::path::Path;

use super::{Scene, SceneError, SceneErrorKind, SceneWarning};

mod arrays;
mod assemble;
mod cells;
mod creases;
mod cursor;
mod format;
mod gltf;
mod msh;
mod obj;
mod options;
mod ply;
mod polygons;
mod reader;
mod scalar;
mod source;
mod stl;
mod vs3;
mod vtk;
mod weld;

pub(crate) use arrays::NAME as ARRAYS_NAME;
pub use arrays::{Arrays, from_arrays};
pub use cells::USUAL_ARRAYS;
pub use format::Format;
pub use obj::write::write_obj;
pub(super) use obj::write::write_whole;
pub use options::{DEFAULT_CREASE_ANGLE, Flip, LengthUnit, LoadOptions, UpAxis};
pub(crate) use source::Room;

use source::Source;

/// A scene from a file, with warnings about it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// The warnings about the file, in the order in which it was found.
    pub warnings: Vec<SceneWarning>,
}

/// The reflectance of a material that states none.
pub const DEFAULT_REFLECTANCE: f64 = 0.5;

/// The numbers of elements of a scene.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    vertices: u64,
    corners: u64,
    faces: u64,
}

/// Bytes per vertex, corner and face while a scene is read and checked.
///
/// They include the polygons of the file, the scene, and the tables that find equal vertices, repeated faces and edges.
const VERTEX_BYTES: u64 = 96;
const CORNER_BYTES: u64 = 96;
const FACE_BYTES: u64 = 160;

impl Counts {
    /// Returns an upper bound of the memory needed to make a scene, without the file's own bytes.
    fn bytes(self) -> u64 {
        let all = [
            (self.vertices, VERTEX_BYTES),
            (self.corners, CORNER_BYTES),
            (self.faces, FACE_BYTES),
        ];
        all.iter()
            .fold(0_u64, |sum, (n, each)| sum.saturating_add(n.saturating_mul(*each)))
    }
}

/// Loads a scene from a file of any [`Format`].
///
/// - Lengths are metres, as written: every f64 survives, no coordinate is moved, and bit-identical positions become one vertex (0 and −0 are the same).
/// - A face sees along the normal of its winding. Flat convex quads stay quads; a quad is flat if no corner is further than
///   1e-6 of its diameter from its plane. Bent or concave quads and larger outlines become triangles of the same outline; beyond 1e-3 there is a warning.
/// - A surface has the name that the file gives a group of faces: `o` or `g` (OBJ), several `solid`s (STL), a physical group, else an elementary entity (gmsh), the value of a cell array
///   ([`LoadOptions::surface_array`], VTK and PLY), a node (glTF), a surface (View3D). A file without such names has one surface per connected piece between creases
///   ([`LoadOptions::crease_angle`]): `faceN` for a piece of one face, `partN` for more, where N is its first face, counted from 1. Surfaces are in the order in which their names appear;
///   names without faces are dropped.
/// - OBJ: the last `o` or `g` above a face names its surface (tools write either, or an `o` for the object and a `g` for a part of it: the finer name
///   counts). A `g` with several names is one surface with all of them in its name. Faces above the first one, or below one without a name, are surface `default`.
/// - Materials: `Kd` is the reflectance ρ, `Ke` the exitance E in W·m⁻²; one number stands for all three channels (OBJ). glTF: ρ is the base colour, E = π × emissive factor × strength. View3D: ρ = 1 − ε.
///   Without a reflectance, without a material, or if the library is missing, ρ is [`DEFAULT_REFLECTANCE`], with a warning. Textures are not read, with a warning. [`LoadOptions::materials`] gives others.
/// - Faces without an area are skipped, with a warning. Faces of opposite winding may coincide.
///   material count as a whole, and of equal ones the later stays whole. Coincident faces of one winding are an error. Overlaps narrower than the rounding of
///   the coordinates as written, or than that of six digits of the scene's size, do not count. Where the file [shows that it was rounded](super::Written::shows_rounding),
///   faces that are not along the axes may stand out of the larger one by a unit of each coordinate's last place.
/// - OBJ: `fo` is read as `f`, and keywords in capitals as in small letters, with a warning. Texture coordinates, normals and attributes are ignored; lines, points, free-form curves and
///   surfaces, calls and unknown statements are skipped, with a warning of each kind. Volume cells of gmsh and VTK are skipped, with a warning; cells of higher order are read as flat, through their corners, with a warning.
/// - A library that does not exist at the path of `mtllib` is searched for by its file name beside the scene file, whatever its case, with a warning.
///
/// Accuracy: coordinates, reflectance and exitance are the nearest f64 to the text, or the numbers of a binary file. [`Scene::written`] holds their possible rounding, by the digits of the text or the
/// 24 bits of a binary f32; it enters the errors of form factors.
///
/// Memory: that of the scene. OBJ, View3D's input, the JSON of glTF and piped files are held in memory as a whole, XML by the text of one array at a time; all others are read as a stream.
/// Counts in a file are limited by its length.
///
/// # Errors
/// [`SceneError`], with file, line or element, and remedy: files that cannot be read, are cut short, or hold less than their header states, invalid coordinates or indices, faces with fewer than three
/// corners, outlines that cross themselves, coincident faces of the same winding, reflectances outside \[0, 1\], exitances that are negative, above [`MAX_EXITANCE`](super::MAX_EXITANCE), or above 0
/// and below [`MIN_EXITANCE`](super::MIN_EXITANCE), power beyond the range of f64, companions outside the scene's folder, and scenes without a usable face.
///
/// Source: Wavefront's OBJ and MTL, 3D Systems' STL, Stanford's PLY, gmsh's MSH 2.2 and 4.1, VTK's file formats (legacy and XML), Khronos' glTF 2.0, View3D's manual (3.3).
/// Departures: only polygons; OBJ: capitals; a vertex must stand above the faces that use it; the weight of a vertex is ignored.
pub fn load(path: impl AsRef<Path>) -> Result<Loaded, SceneError> {
    load_with(path, &LoadOptions::default())
}

/// Loads a scene as [`load`] does, with options.
///
/// # Errors
/// As [`load`].
pub fn load_with(path: impl AsRef<Path>, options: &LoadOptions) -> Result<Loaded, SceneError> {
    load_within(path.as_ref(), options, &|_| Ok(()))
}

/// Loads a scene as [`load_with`] does, within a limit of memory: `room` is called before each allocation.
pub(crate) fn load_within(path: &Path, options: &LoadOptions, room: Room<'_>) -> Result<Loaded, SceneError> {
    let source = Source::open(path, room)?;
    let format = options.format.unwrap_or_else(|| Format::of_start(path, &source.head()));
    let is_guess = options.format.is_none() && !format.is_shown(path, &source.head());
    let polygons = match format.read(&source, options) {
        Ok(polygons) if is_guess && polygons.faces.is_empty() => return Err(unknown_format(&source)),
        Err(error) if is_guess && matches!(error.kind, SceneErrorKind::NotUtf8) => return Err(unknown_format(&source)),
        read => read?,
    };
    if let Some(name) = options.surface_array.as_deref().filter(|_| !format.has_arrays()) {
        return Err(source.error(cells::unknown(name, &[])));
    }
    // Frees the text before the tables of the scene are made.
    drop(source);
    assemble::assemble(polygons, path, options)
}

/// Returns the error of a file whose format neither its content nor its suffix shows.
fn unknown_format(source: &Source<'_>) -> SceneError {
    let message =
        "the format is none of OBJ, STL, PLY, MSH, VTK, glTF and View3D; export one of these, or give --format";
    source.error(SceneErrorKind::unsupported(message))
}

/// Returns the scene of an OBJ file and its library, both as text.
///
/// It counts as made in memory: its coordinates are exact and its faces have no lines.
pub(super) fn of_texts(obj: &str, library: &str, name: &str) -> Result<Scene, SceneError> {
    let name = Path::new(name);
    let polygons = obj::of_texts(obj, library, name)?;
    let mut scene = assemble::assemble(polygons, name, &LoadOptions::default())?.scene;
    scene.written = None;
    scene.faces.iter_mut().for_each(|face| face.line = 0);
    Ok(scene)
}

/// Returns the existing files that a scene file names, without reading the scene; none for a pipe.
#[cfg(feature = "cli")]
pub(crate) fn companions_of(path: &Path, format: Option<Format>) -> Vec<std::path::PathBuf> {
    let is_file = std::fs::metadata(path).is_ok_and(|data| data.is_file());
    let format = format.or_else(|| Format::of(path).ok());
    format
        .filter(|_| is_file)
        .map_or_else(Vec::new, |format| format.companions(path))
}
