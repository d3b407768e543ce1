//! Two long walls and a low partition between them: one occluder with two sides.

use glam::DVec3;

use super::Assembly;
use crate::scene::{Camera, SceneError};

pub(super) fn build(assembly: &mut Assembly, _level: u32) -> Result<Option<Camera>, SceneError> {
    let wall = assembly.grey("wall", 0.5, 0.0)?;
    let light = assembly.grey("light", 0.5, 1.0)?;
    // Upright rectangles of 10 m at some x, facing +x; reversed, they face −x.
    let upright = |x: f64, height: f64| {
        [(0.0, 0.0), (10.0, 0.0), (10.0, height), (0.0, height)].map(|(y, z)| DVec3::new(x, y, z))
    };
    let reversed = |[a, b, c, d]: [DVec3; 4]| [a, d, c, b];
    let faces = [
        ("A", upright(0.0, 1.0), light),
        ("B", reversed(upright(2.0, 1.0)), wall),
        ("partition", reversed(upright(1.0, 0.5)), wall),
        ("partition_back", upright(1.0, 0.5), wall),
    ];
    for (name, corners, material) in faces {
        assembly.surface_of(name, material, [corners])?;
    }
    Ok(None)
}
