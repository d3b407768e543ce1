//! A bowl-shaped crater: a spherical cap of 4 m across and 1 m deep, for sunlight and temperatures.
//!
//! The cap is a part of a sphere of radius 2.5 m, from its lowest point to an angle whose sine is 0.8. It has 2^level rings of 2^(level + 2) flat faces that look inwards, triangles in the middle,
//! with all corners on the sphere. Its rim lies in the plane z = 0. Nothing emits; the reflectance is that of the solar band in [`INGERSOLL_1992`](crate::references::INGERSOLL_1992).

use glam::{DVec2, DVec3};

use super::{Assembly, Levels};
use crate::scene::SceneError;

/// The greatest level has 4^9 = 262,144 faces.
pub(super) const LEVELS: Levels = Levels { default: 3, max: 8 };

/// The radius of the sphere and the depth of its lowest point below the rim, m.
const RADIUS: f64 = 2.5;
const DEPTH: f64 = 1.0;

/// The solar reflectance, 1 − 0.88.
const REFLECTANCE: f64 = 0.12;

pub(super) fn build(assembly: &mut Assembly, level: u32) -> Result<(), SceneError> {
    let surface = assembly.surface("crater")?;
    let ground = assembly.grey("ground", REFLECTANCE, 0.0)?;
    let rings = halved(&[DVec2::new(0.0, 1.0), DVec2::new(0.8, 0.6)], level);
    let quarters = [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y, DVec2::X];
    let around = halved(&quarters, level);
    let corner = |ring: DVec2, direction: DVec2| {
        // Adding zero turns a −0 at the lowest point into 0.
        (RADIUS * ring.x * direction).extend(RADIUS * (1.0 - ring.y) - DEPTH) + DVec3::ZERO
    };
    for (k, pair) in rings.windows(2).enumerate() {
        for sides in around.windows(2) {
            let [inner, outer] = [pair[0], pair[1]].map(|ring| [corner(ring, sides[0]), corner(ring, sides[1])]);
            if k == 0 {
                assembly.face([inner[0], outer[0], outer[1]], surface, ground)?;
            } else {
                assembly.face([inner[0], outer[0], outer[1], inner[1]], surface, ground)?;
            }
        }
    }
    Ok(())
}

/// Halves the arcs between unit vectors `n` times, by sums and square roots alone, which are the same on every machine.
fn halved(directions: &[DVec2], n: u32) -> Vec<DVec2> {
    let mut all = directions.to_vec();
    for _ in 0..n {
        let mut finer = vec![all[0]];
        for pair in all.windows(2) {
            finer.extend([(pair[0] + pair[1]).normalize(), pair[1]]);
        }
        all = finer;
    }
    all
}
