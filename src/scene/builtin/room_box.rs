//! A room with a floating box: twelve rectangles, each occluded somewhere.

use glam::DVec3;

use super::{Assembly, SIDES, box_sides};
use crate::scene::{Camera, SceneError};

pub(super) fn build(assembly: &mut Assembly, _level: u32) -> Result<Option<Camera>, SceneError> {
    let wall = assembly.grey("wall", 0.5, 0.0)?;
    let light = assembly.grey("light", 0.5, 1.0)?;
    let room = box_sides(DVec3::ZERO, DVec3::new(4.0, 5.0, 3.0));
    for (side, corners) in SIDES.into_iter().zip(room) {
        let material = if side == "z1" { light } else { wall };
        assembly.surface_of(&format!("room_{side}"), material, [corners])?;
    }
    let inner = box_sides(DVec3::new(1.0, 1.5, 0.5), DVec3::new(2.2, 3.0, 1.7));
    for (side, [a, b, c, d]) in SIDES.into_iter().zip(inner) {
        assembly.surface_of(&format!("box_{side}"), wall, [[a, d, c, b]])?;
    }
    Ok(None)
}
