//! Scenes of the literature, bit-identical on every machine.

use glam::DVec3;

use super::{Camera, Material, MaterialId, Origin, Scene, SceneBuilder, SceneError, SceneErrorKind, SurfaceId, io};

mod crater;
mod lewis_room;

/// A built-in scene.
#[derive(Clone, Debug)]
pub struct Builtin {
    /// The scene.
    pub scene: Scene,
    /// The camera that belongs to the scene, where its source states one.
    pub camera: Option<Camera>,
}

/// The levels of refinement of a scene.
#[derive(Clone, Copy)]
struct Levels {
    default: u32,
    max: u32,
}

/// The source of a scene's faces.
enum Source {
    /// Its files in `scenes/`: the faces, and their materials.
    Files { obj: &'static str, mtl: &'static str },
    /// A function that makes them for a level.
    Levels(Levels, fn(&mut Assembly, u32) -> Result<(), SceneError>),
}

struct Entry {
    name: &'static str,
    source: Source,
}

macro_rules! files {
    ($name:literal) => {
        Entry {
            name: $name,
            source: Source::Files {
                obj: include_str!(concat!("../../../scenes/", $name, "/scene.obj")),
                mtl: include_str!(concat!("../../../scenes/", $name, "/scene.mtl")),
            },
        }
    };
}

/// Every built-in scene, in the order in which they are listed.
static REGISTRY: [Entry; 10] = [
    files!("cube"),
    files!("cornell-box"),
    Entry {
        name: "lewis-room",
        source: Source::Levels(lewis_room::LEVELS, lewis_room::build),
    },
    files!("sphere-room-r1"),
    files!("sphere-room-r2"),
    files!("corridor"),
    files!("room-box"),
    files!("living-room"),
    Entry {
        name: "crater",
        source: Source::Levels(crater::LEVELS, crater::build),
    },
    files!("street"),
];

/// Returns the camera that belongs to a scene, where its source states one.
fn camera_of(name: &str) -> Result<Option<Camera>, SceneError> {
    let (eye, direction, up, vertical_fov, [width, height]) = match name {
        // 2 atan(0.025 / (2 · 0.035)) in degrees, from the source's film height and focal length.
        "cornell-box" => (
            [0.278, 0.273, -0.8],
            DVec3::Z,
            DVec3::Y,
            39.307_648_116_106_62,
            [512, 512],
        ),
        "living-room" => (
            [5.7, 0.5, 1.75],
            DVec3::new(-0.72, 0.75, -0.16),
            DVec3::Z,
            68.0,
            [960, 720],
        ),
        "street" => (
            [46.0, -43.0, 33.0],
            DVec3::new(-46.0, 43.0, -31.0),
            DVec3::Z,
            36.0,
            [720, 508],
        ),
        _ => return Ok(None),
    };
    let camera = Camera::new(DVec3::from_array(eye), direction, up, vertical_fov)?;
    Ok(Some(camera.with_image_size(Some(width), Some(height))))
}

/// Iterates over the names of all built-in scenes.
#[must_use]
pub fn names() -> impl ExactSizeIterator<Item = &'static str> {
    REGISTRY.iter().map(|entry| entry.name)
}

/// Builds a built-in scene; `level` refines those that have levels.
///
/// - `cube`: the unit cube from inside; walls `x0`, `x1`, `y0`, `y1`, `z0`, `z1`; black, E = 1 on `z1`. Form factors in closed form.
/// - `cornell-box`: the measured Cornell box ([`CORNELL_BOX`](crate::references::CORNELL_BOX)) with its two blocks and its camera, in metres, y up, open at the front.
/// - `lewis-room`: the unit room of [`LEWIS_1992`](crate::references::LEWIS_1992), section 4, with 2^level × 2^level faces a wall (default 3, at most 10).
/// - `sphere-room-r1`, `sphere-room-r2`: the room of [`BARANOSKI_1995`](crate::references::BARANOSKI_1995) around a sphere of radius 1 or 2, 992 faces.
/// - `corridor`: two walls with a partition of half their height between them, a coincident two-sided sheet.
/// - `room-box`: a room with a floating box, twelve rectangles.
/// - `living-room`: a furnished room with more than 600 objects and its camera, at the scale of [`MALGOUYRES_2002`](crate::references::MALGOUYRES_2002).
/// - `crater`: a spherical cap in 4^(level + 1) faces (default 3, at most 8), for sunlight; nothing emits.
/// - `street`: six houses along a street and its camera, for sun and sky; nothing emits.
///
/// Scenes without levels are the files in `scenes/`. The coordinates of the others come from sums, products, quotients and square roots, whose last bit does not depend on the machine.
/// Departures: each scene's `README.md` there says what its source leaves open, and how that was decided.
///
/// # Errors
/// [`UnknownBuiltin`](crate::scene::SceneErrorKind::UnknownBuiltin), [`NoLevels`](crate::scene::SceneErrorKind::NoLevels), [`LevelTooHigh`](crate::scene::SceneErrorKind::LevelTooHigh).
pub fn build(name: &str, level: Option<u32>) -> Result<Builtin, SceneError> {
    let refused = |kind| Err(SceneError::new(Origin::Asked, kind));
    let own = || name.to_owned();
    let Some(entry) = REGISTRY.iter().find(|entry| entry.name == name) else {
        let known = names().collect::<Vec<_>>().join(", ");
        return refused(SceneErrorKind::UnknownBuiltin { name: own(), known });
    };
    let scene = match entry.source {
        Source::Files { .. } if level.is_some() => return refused(SceneErrorKind::NoLevels { name: own() }),
        Source::Files { obj, mtl } => io::of_texts(obj, mtl, entry.name)?,
        Source::Levels(levels, build) => {
            let (level, max) = (level.unwrap_or(levels.default), levels.max);
            if level > max {
                return refused(SceneErrorKind::LevelTooHigh {
                    name: own(),
                    level,
                    max,
                });
            }
            let builder = SceneBuilder::of_file(name);
            let mut assembly = Assembly { builder };
            build(&mut assembly, level)?;
            assembly.builder.build()?.scene
        }
    };
    let camera = camera_of(name)?;
    Ok(Builtin { scene, camera })
}

/// A scene under construction.
struct Assembly {
    builder: SceneBuilder,
}

impl Assembly {
    fn surface(&mut self, name: &str) -> Result<SurfaceId, SceneError> {
        self.builder.surface(name)
    }

    fn grey(&mut self, name: &str, reflectance: f64, exitance: f64) -> Result<MaterialId, SceneError> {
        self.builder.material(Material {
            name: name.to_owned(),
            reflectance: [reflectance; 3],
            exitance: [exitance; 3],
        })
    }

    fn face(
        &mut self,
        corners: impl AsRef<[DVec3]>,
        surface: SurfaceId,
        material: MaterialId,
    ) -> Result<(), SceneError> {
        self.builder.face(corners.as_ref(), surface, material, 0).map(|_| ())
    }
}
