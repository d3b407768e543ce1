//! The scenes of the literature, made in memory: the same bits on every machine.

use glam::DVec3;

use super::{Camera, Material, MaterialId, Origin, Scene, SceneBuilder, SceneError, SceneErrorKind, SurfaceId};

mod cornell_box;
mod corridor;
mod crater;
mod cube;
mod lewis_room;
mod living_room;
mod room_box;
mod sphere_room;
mod street;

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

struct Entry {
    name: &'static str,
    levels: Option<Levels>,
    build: fn(&mut Assembly, u32) -> Result<Option<Camera>, SceneError>,
}

/// Every built-in scene, in the order in which they are listed.
const REGISTRY: [Entry; 10] = [
    Entry {
        name: "cube",
        levels: None,
        build: cube::build,
    },
    Entry {
        name: "cornell-box",
        levels: None,
        build: cornell_box::build,
    },
    Entry {
        name: "lewis-room",
        levels: Some(lewis_room::LEVELS),
        build: lewis_room::build,
    },
    Entry {
        name: "sphere-room-r1",
        levels: None,
        build: |assembly, _| sphere_room::build(assembly, &sphere_room::R1),
    },
    Entry {
        name: "sphere-room-r2",
        levels: None,
        build: |assembly, _| sphere_room::build(assembly, &sphere_room::R2),
    },
    Entry {
        name: "corridor",
        levels: None,
        build: corridor::build,
    },
    Entry {
        name: "room-box",
        levels: None,
        build: room_box::build,
    },
    Entry {
        name: "living-room",
        levels: None,
        build: living_room::build,
    },
    Entry {
        name: "crater",
        levels: Some(crater::LEVELS),
        build: crater::build,
    },
    Entry {
        name: "street",
        levels: None,
        build: street::build,
    },
];

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
/// Coordinates and values are literals and what sums, products, quotients and square roots make of them: no function whose last bit depends on the machine.
/// Departures: each scene's `README.md` in `scenes/` says what its source leaves open, and how that was decided.
///
/// # Errors
/// [`UnknownBuiltin`](crate::scene::SceneErrorKind::UnknownBuiltin), [`NoLevels`](crate::scene::SceneErrorKind::NoLevels), [`LevelTooHigh`](crate::scene::SceneErrorKind::LevelTooHigh).
pub fn build(name: &str, level: Option<u32>) -> Result<Builtin, SceneError> {
    let Some(entry) = REGISTRY.iter().find(|entry| entry.name == name) else {
        return Err(SceneError::new(
            Origin::Asked,
            SceneErrorKind::UnknownBuiltin { name: name.to_owned() },
        ));
    };
    let level = match (entry.levels, level) {
        (None, None) => 0,
        (None, Some(_)) => {
            return Err(SceneError::new(
                Origin::Asked,
                SceneErrorKind::NoLevels { name: name.to_owned() },
            ));
        }
        (Some(levels), None) => levels.default,
        (Some(levels), Some(level)) if level <= levels.max => level,
        (Some(levels), Some(level)) => {
            return Err(SceneError::new(
                Origin::Asked,
                SceneErrorKind::LevelTooHigh {
                    name: name.to_owned(),
                    level,
                    max: levels.max,
                },
            ));
        }
    };
    let mut assembly = Assembly {
        builder: SceneBuilder::of_file(name),
    };
    let camera = (entry.build)(&mut assembly, level)?;
    let scene = assembly.builder.build()?.scene;
    Ok(Builtin { scene, camera })
}

/// A scene in the making.
struct Assembly {
    builder: SceneBuilder,
}

impl Assembly {
    fn surface(&mut self, name: &str) -> Result<SurfaceId, SceneError> {
        self.builder.surface(name)
    }

    fn material(&mut self, name: &str, reflectance: [f64; 3], exitance: [f64; 3]) -> Result<MaterialId, SceneError> {
        self.builder.material(Material {
            name: name.to_owned(),
            reflectance,
            exitance,
        })
    }

    fn grey(&mut self, name: &str, reflectance: f64, exitance: f64) -> Result<MaterialId, SceneError> {
        self.material(name, [reflectance; 3], [exitance; 3])
    }

    fn face(
        &mut self,
        corners: impl AsRef<[DVec3]>,
        surface: SurfaceId,
        material: MaterialId,
    ) -> Result<(), SceneError> {
        self.builder.face(corners.as_ref(), surface, material, 0).map(|_| ())
    }

    /// Adds a surface and its faces, all of one material.
    fn surface_of<const N: usize>(
        &mut self,
        name: &str,
        material: MaterialId,
        faces: [[DVec3; 4]; N],
    ) -> Result<(), SceneError> {
        let surface = self.surface(name)?;
        faces
            .iter()
            .try_for_each(|corners| self.face(corners, surface, material))
    }
}

/// Returns the six sides of a box in the order x0, x1, y0, y1, z0, z1, normals inward.
fn box_sides(low: DVec3, high: DVec3) -> [[DVec3; 4]; 6] {
    let at = |x: bool, y: bool, z: bool| {
        let pick = |upper, axis| if upper { high[axis] } else { low[axis] };
        DVec3::new(pick(x, 0), pick(y, 1), pick(z, 2))
    };
    let (o, l) = (false, true);
    [
        [at(o, o, o), at(o, l, o), at(o, l, l), at(o, o, l)],
        [at(l, o, o), at(l, o, l), at(l, l, l), at(l, l, o)],
        [at(o, o, o), at(o, o, l), at(l, o, l), at(l, o, o)],
        [at(o, l, o), at(l, l, o), at(l, l, l), at(o, l, l)],
        [at(o, o, o), at(l, o, o), at(l, l, o), at(o, l, o)],
        [at(o, o, l), at(o, l, l), at(l, l, l), at(l, o, l)],
    ]
}

/// The names of the sides of a box, in the order of [`box_sides`].
const SIDES: [&str; 6] = ["x0", "x1", "y0", "y1", "z0", "z1"];
