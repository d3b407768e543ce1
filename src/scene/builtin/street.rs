//! Six houses on both sides of a street, for sun and sky; nothing emits.
//!
//! The street runs along x and is 8 m wide. Houses are blocks of 11 m × 10 m, 2 m apart, with flat roofs; each has the surfaces `house_1` to `house_6` (walls) and `roof_1` to `roof_6`. The ground is cut along the lines of their walls, and is none
//! below them: `street` between the rows, `yard` around.

use glam::DVec3;

use super::Assembly;
use crate::scene::{Camera, SceneError};

/// The lines along which the ground is cut, m.
const X: [f64; 8] = [-22.0, -18.0, -7.0, -5.0, 6.0, 8.0, 19.0, 23.0];
const Y: [f64; 6] = [-18.0, -14.0, -4.0, 4.0, 14.0, 18.0];

/// The heights of the houses, m: the row at negative y, then that at positive y, each along x.
const HEIGHTS: [[f64; 3]; 2] = [[6.0, 10.0, 8.0], [9.0, 12.0, 7.0]];

pub(super) fn build(assembly: &mut Assembly, _level: u32) -> Result<Option<Camera>, SceneError> {
    let asphalt = assembly.grey("asphalt", 0.1, 0.0)?;
    let grass = assembly.material("grass", [0.12, 0.22, 0.08], [0.0; 3])?;
    let plaster = assembly.material("plaster", [0.6, 0.55, 0.45], [0.0; 3])?;
    let tiles = assembly.material("tiles", [0.4, 0.22, 0.15], [0.0; 3])?;
    let [street, yard] = [assembly.surface("street")?, assembly.surface("yard")?];
    let level = |x: [f64; 2], y: [f64; 2], z: f64| {
        [[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]].map(|[x, y]| DVec3::new(x, y, z))
    };
    for (row, y) in Y.windows(2).enumerate() {
        for (column, x) in X.windows(2).enumerate() {
            // Houses stand in the second and fourth row, in each second column.
            if row % 2 == 1 && column % 2 == 1 {
                continue;
            }
            let (surface, material) = if row == 2 { (street, asphalt) } else { (yard, grass) };
            assembly.face(level([x[0], x[1]], [y[0], y[1]], 0.0), surface, material)?;
        }
    }
    let houses = HEIGHTS.iter().enumerate().flat_map(|(row, heights)| {
        heights
            .iter()
            .enumerate()
            .map(move |(column, &height)| (row, column, height))
    });
    for (number, (row, column, height)) in (1..).zip(houses) {
        let (x, y) = ([X[2 * column + 1], X[2 * column + 2]], [Y[2 * row + 1], Y[2 * row + 2]]);
        let [foot, top] = [0.0, height].map(|z| level(x, y, z));
        let wall = |k: usize| [foot[k], foot[(k + 1) % 4], top[(k + 1) % 4], top[k]];
        assembly.surface_of(
            &format!("house_{number}"),
            plaster,
            [wall(0), wall(1), wall(2), wall(3)],
        )?;
        assembly.surface_of(&format!("roof_{number}"), tiles, [top])?;
    }
    let camera = Camera::new(
        DVec3::new(46.0, -43.0, 33.0),
        DVec3::new(-46.0, 43.0, -31.0),
        DVec3::Z,
        36.0,
    )?;
    Ok(Some(camera.with_image_size(Some(720), Some(508))))
}
