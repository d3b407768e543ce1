//! The test model of Baranoski, Bramley and Shirley 1995: a cubic room around a faceted sphere.
//!
//! Walls of 6 m with 12 × 12 squares; a sphere of 8 latitudes × 16 longitudes of flat faces with all corners on it, triangles at the
//! poles: 992 faces. The light is the squares 4 to 7 each way of the ceiling, E = 50. Each wall reflects `rho_avg` times its own factor,
//! divided by the factors' area mean, so that `rho_avg` is the mean over the whole scene.
//!
//! Departures: the origin is the centre of the room and the sphere (the paper's room is [0, 6]³). The paper gives neither the emission nor the reflectances of
//! single walls; E = 50 and the factors below bring the passes near those inferred from it. r = 1 has the 69.5 % density of its
//! cases E and F, r = 2 the 53.1 % of A to D; `rho_avg` is that of case E (0.78) for r = 1 and of case C (0.77) for r = 2.

use glam::DVec3;

use super::{Assembly, SIDES};
use crate::geometry::polygon;
use crate::scene::{Camera, SceneError};

/// One of the paper's two rooms.
pub(super) struct Variant {
    radius: f64,
    rho_avg: f64,
}

pub(super) const R1: Variant = Variant {
    radius: 1.0,
    rho_avg: 0.78,
};
pub(super) const R2: Variant = Variant {
    radius: 2.0,
    rho_avg: 0.77,
};

const N: u32 = 12;
const HALF: f64 = 3.0;
const EXITANCE: f64 = 50.0;

/// A wall: the corner that it starts from, the axis of its slow index and that of its fast one (slow × fast points inward), and its factor of `rho_avg`.
struct Wall {
    from: [f64; 3],
    slow: [f64; 3],
    fast: [f64; 3],
    factor: f64,
}

const WALLS: [Wall; 6] = [
    Wall {
        from: [-HALF, HALF, -HALF],
        slow: [0.0, 0.0, 1.0],
        fast: [0.0, -1.0, 0.0],
        factor: 0.92,
    },
    Wall {
        from: [HALF, -HALF, HALF],
        slow: [0.0, 1.0, 0.0],
        fast: [0.0, 0.0, -1.0],
        factor: 1.06,
    },
    Wall {
        from: [-HALF, -HALF, HALF],
        slow: [1.0, 0.0, 0.0],
        fast: [0.0, 0.0, -1.0],
        factor: 0.96,
    },
    Wall {
        from: [HALF, HALF, -HALF],
        slow: [0.0, 0.0, 1.0],
        fast: [-1.0, 0.0, 0.0],
        factor: 1.04,
    },
    Wall {
        from: [HALF, -HALF, -HALF],
        slow: [0.0, 1.0, 0.0],
        fast: [-1.0, 0.0, 0.0],
        factor: 0.94,
    },
    Wall {
        from: [-HALF, HALF, HALF],
        slow: [1.0, 0.0, 0.0],
        fast: [0.0, -1.0, 0.0],
        factor: 1.06,
    },
];

const SPHERE_FACTOR: f64 = 1.0;

pub(super) fn build(assembly: &mut Assembly, variant: &Variant) -> Result<Option<Camera>, SceneError> {
    let sphere = sphere_faces(variant.radius);
    let sphere_area: f64 = sphere.iter().map(|face| polygon::area_vector(face).length()).sum();
    let wall_area = 4.0 * HALF * HALF;
    let weighted: f64 = WALLS.iter().map(|wall| wall.factor * wall_area).sum();
    let mean = (weighted + SPHERE_FACTOR * sphere_area) / (6.0 * wall_area + sphere_area);
    let reflectance = |factor: f64| variant.rho_avg * factor / mean;

    for (name, wall) in SIDES.into_iter().zip(&WALLS) {
        let surface = assembly.surface(name)?;
        let plain = assembly.grey(name, reflectance(wall.factor), 0.0)?;
        let light = if name == "z1" {
            assembly.grey("light", reflectance(wall.factor), EXITANCE)?
        } else {
            plain
        };
        for (ia, ib) in (0..N).flat_map(|ia| (0..N).map(move |ib| (ia, ib))) {
            let emits = (4..8).contains(&ia) && (4..8).contains(&ib);
            let material = if emits { light } else { plain };
            assembly.face(wall.square(ia, ib), surface, material)?;
        }
    }
    let surface = assembly.surface("sphere")?;
    let material = assembly.grey("sphere", reflectance(SPHERE_FACTOR), 0.0)?;
    for face in sphere {
        assembly.face(face, surface, material)?;
    }
    Ok(None)
}

impl Wall {
    fn square(&self, ia: u32, ib: u32) -> [DVec3; 4] {
        let size = 2.0 * HALF / f64::from(N);
        let at = |slow: u32, fast: u32| {
            DVec3::from_array(self.from)
                + f64::from(slow) * size * DVec3::from_array(self.slow)
                + f64::from(fast) * size * DVec3::from_array(self.fast)
        };
        [at(ia, ib), at(ia + 1, ib), at(ia + 1, ib + 1), at(ia, ib + 1)]
    }
}

/// cos(kπ/8) for k = 0 to 4: all angles of the sphere are multiples of π/8, and a cosine function may differ between machines.
const COSINE: [f64; 5] = [
    1.0,
    0.923_879_532_511_286_7,
    std::f64::consts::FRAC_1_SQRT_2,
    0.382_683_432_365_089_8,
    0.0,
];

/// Returns (cos, sin) of k · π/8.
fn cos_sin(k: usize) -> (f64, f64) {
    let cos = |step: usize| match step % 16 {
        first @ 0..=4 => COSINE[first],
        second @ 5..=8 => -COSINE[8 - second],
        third @ 9..=12 => -COSINE[third - 8],
        fourth => COSINE[16 - fourth],
    };
    (cos(k), cos(k + 12))
}

/// Returns the faces of the sphere, normals outward, from the north pole down.
fn sphere_faces(radius: f64) -> Vec<Vec<DVec3>> {
    let at = |latitude: usize, longitude: usize| {
        let (cos_theta, sin_theta) = cos_sin(latitude);
        let (cos_phi, sin_phi) = cos_sin(longitude);
        radius * DVec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
    };
    let mut faces = Vec::new();
    for (t, p) in (0..8).flat_map(|t| (0..16).map(move |p| (t, p))) {
        faces.push(match t {
            0 => vec![at(0, 0), at(1, p), at(1, p + 1)],
            7 => vec![at(7, p), at(8, 0), at(7, p + 1)],
            _ => vec![at(t, p), at(t + 1, p), at(t + 1, p + 1), at(t, p + 1)],
        });
    }
    faces
}
