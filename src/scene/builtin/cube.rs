//! The unit cube from inside: the scene whose form factors everybody knows.

use glam::DVec3;

use super::{Assembly, SIDES, box_sides};
use crate::scene::{Camera, SceneError};

pub(super) fn build(assembly: &mut Assembly, _level: u32) -> Result<Option<Camera>, SceneError> {
    let wall = assembly.grey("wall", 0.0, 0.0)?;
    let light = assembly.grey("light", 0.0, 1.0)?;
    for (side, corners) in SIDES.into_iter().zip(box_sides(DVec3::ZERO, DVec3::ONE)) {
        assembly.surface_of(side, if side == "z1" { light } else { wall }, [corners])?;
    }
    Ok(None)
}
