//! The room of Lewis 1992, section 4: the model problem of the multigrid paper.
//!
//! A unit cube whose walls reflect 0.2 (x = 0), 0.6 (x = 1), 0.4 (y = 0), 0.8 (y = 1) and 1 (floor and ceiling); light enters
//! through the hole [1/4, 3/4]² of the ceiling with density 1. Walls in the order x0, x1, y0, y1, z0, z1; face
//! index = wall m² + ia m + ib with m = 2^level, (a, b) the two free axes in ascending order.
//!
//! Departures: a face's exitance is its mean, not the "integral" that section 3 speaks of: the covered fraction (0.25) at levels 0 and 1, exact from
//! level 2. The hole reflects like the ceiling, which is what reproduces the paper's table 2.

use glam::DVec3;

use super::{Assembly, Levels};
use crate::scene::{MaterialId, SceneError};

/// The greatest level has 6 · 4^10 = 6.3 million faces, a few hundred times as many as a matrix of form factors can hold.
pub(super) const LEVELS: Levels = Levels { default: 3, max: 10 };

const SIDES: [&str; 6] = ["x0", "x1", "y0", "y1", "z0", "z1"];

const REFLECTANCE: [f64; 6] = [0.2, 0.6, 0.4, 0.8, 1.0, 1.0];

pub(super) fn build(assembly: &mut Assembly, level: u32) -> Result<(), SceneError> {
    let m = 1_u32 << level;
    let at = |i: u32| f64::from(i) / f64::from(m);
    let mut fraction_of_hole = HoleMaterial { m, material: None };
    for (wall, name) in SIDES.into_iter().enumerate() {
        let surface = assembly.surface(name)?;
        let material = assembly.grey(name, REFLECTANCE[wall], 0.0)?;
        let (axis, upper) = (wall / 2, wall % 2 == 1);
        let (a, b) = if axis == 0 {
            (1, 2)
        } else {
            (0, if axis == 1 { 2 } else { 1 })
        };
        // a × b is +x, −y, +z: it points inward at x0, y1 and z0.
        let a_then_b = upper == (axis == 1);
        for (ia, ib) in (0..m).flat_map(|ia| (0..m).map(move |ib| (ia, ib))) {
            let corner = |da: u32, db: u32| {
                let mut v = DVec3::ZERO;
                v[axis] = if upper { 1.0 } else { 0.0 };
                v[a] = at(ia + da);
                v[b] = at(ib + db);
                v
            };
            let corners = if a_then_b {
                [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
            } else {
                [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)]
            };
            let hole = if name == "z1" {
                fraction_of_hole.of(assembly, ia, ib)?
            } else {
                None
            };
            assembly.face(corners, surface, hole.unwrap_or(material))?;
        }
    }
    Ok(())
}

/// The material of faces that the hole covers by the same fraction.
struct HoleMaterial {
    m: u32,
    material: Option<MaterialId>,
}

impl HoleMaterial {
    fn of(&mut self, assembly: &mut Assembly, ia: u32, ib: u32) -> Result<Option<MaterialId>, SceneError> {
        let fraction = self.covered(ia) * self.covered(ib);
        if fraction <= 0.0 {
            return Ok(None);
        }
        if self.material.is_none() {
            self.material = Some(assembly.grey("hole", 1.0, fraction)?);
        }
        Ok(self.material)
    }

    /// Returns the part of [i, i + 1] / m within [1/4, 3/4].
    fn covered(&self, i: u32) -> f64 {
        let m = f64::from(self.m);
        let (from, to) = (f64::from(i), f64::from(i) + 1.0);
        (to.min(0.75 * m) - from.max(0.25 * m)).max(0.0)
    }
}
