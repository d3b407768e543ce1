//! The Cornell box with its two blocks: a real box that was built, measured and photographed.
//!
//! Source: Cornell University Program of Computer Graphics, "Cornell Box Data",
//! <https://www.graphics.cornell.edu/online/box/data.html>: geometry and camera as measured there.
//!
//! Departures:
//! - metres, not millimetres; y is up, the camera looks along +z, and the front is open, as in the source.
//! - The light lies in the plane of the ceiling, as in the source, and the ceiling is a ring of four quads around it, so that no faces overlap.
//! - The measured left wall is not flat (its lower edge leans by 3.2 mm): two triangles.
//! - The source gives spectra. The reflectances are the RGB triples that renderers commonly use for them (Mitsuba among others):
//!   white (0.725, 0.71, 0.68), red (0.63, 0.065, 0.05), green (0.14, 0.45, 0.091); 0.78 for the light is the source's. The light's
//!   radiance is (18.4, 15.6, 8.0) W·m⁻²·sr⁻¹, the source's emission at 700, 600 and 500 nm read as red, green and blue; its unit is
//!   arbitrary there. The exitance is π times that.

use std::f64::consts::PI;

use glam::DVec3;

use super::Assembly;
use crate::scene::{Camera, MaterialId, SceneError};

const WHITE: [f64; 3] = [0.725, 0.71, 0.68];
const RED: [f64; 3] = [0.63, 0.065, 0.05];
const GREEN: [f64; 3] = [0.14, 0.45, 0.091];
const LIGHT: f64 = 0.78;
const RADIANCE: [f64; 3] = [18.4, 15.6, 8.0];

const HEIGHT: f64 = 0.5488;
const DEPTH: f64 = 0.5592;

/// 2 atan(0.025 / (2 · 0.035)) in degrees, from the source's film height and focal length.
const VERTICAL_FOV: f64 = 39.307_648_116_106_62;

/// (x, z) of the upper corners, counter-clockwise from above, and the height.
type Block = ([(f64, f64); 4], f64);
const SHORT: Block = ([(0.130, 0.065), (0.082, 0.225), (0.240, 0.272), (0.290, 0.114)], 0.165);
const TALL: Block = ([(0.423, 0.247), (0.265, 0.296), (0.314, 0.456), (0.472, 0.406)], 0.330);

pub(super) fn build(assembly: &mut Assembly, _level: u32) -> Result<Option<Camera>, SceneError> {
    let white = assembly.material("white", WHITE, [0.0; 3])?;
    let red = assembly.material("red", RED, [0.0; 3])?;
    let green = assembly.material("green", GREEN, [0.0; 3])?;
    let light = assembly.material("light", [LIGHT; 3], RADIANCE.map(|l| PI * l))?;

    let floor = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let ceiling = |(x, z): (f64, f64)| DVec3::new(x, HEIGHT, z);
    // Clockwise from above, so that a face of the ceiling sees down; the ring's quads share its corners with walls and light.
    let outer = [(0.556, 0.0), (0.556, DEPTH), (0.0, DEPTH), (0.0, 0.0)].map(ceiling);
    let inner = [(0.343, 0.227), (0.343, 0.332), (0.213, 0.332), (0.213, 0.227)].map(ceiling);
    let [left_front, left_back, right_back, right_front] = [
        floor(0.5528, 0.0),
        floor(0.5496, DEPTH),
        floor(0.0, DEPTH),
        floor(0.0, 0.0),
    ];

    let ring = [0, 1, 2, 3].map(|k| {
        let next = (k + 1) % 4;
        [outer[k], outer[next], inner[next], inner[k]]
    });
    let [above_left_front, above_left_back, above_right_back, above_right_front] = outer;
    assembly.surface_of("floor", white, [[left_front, right_front, right_back, left_back]])?;
    assembly.surface_of("ceiling", white, ring)?;
    assembly.surface_of(
        "back",
        white,
        [[left_back, right_back, above_right_back, above_left_back]],
    )?;
    assembly.surface_of(
        "right",
        green,
        [[right_back, right_front, above_right_front, above_right_back]],
    )?;
    assembly.surface_of(
        "left",
        red,
        [[left_front, left_back, above_left_back, above_left_front]],
    )?;
    assembly.surface_of("light", light, [inner])?;
    block(assembly, "short_block", &SHORT, white)?;
    block(assembly, "tall_block", &TALL, white)?;

    let eye = DVec3::new(0.278, 0.273, -0.8);
    let camera = Camera::new(eye, DVec3::Z, DVec3::Y, VERTICAL_FOV)?;
    Ok(Some(camera.with_image_size(Some(512), Some(512))))
}

/// Adds the top and the four sides of a block, normals outward; its bottom stands on the floor.
fn block(
    assembly: &mut Assembly,
    name: &str,
    (outline, height): &Block,
    material: MaterialId,
) -> Result<(), SceneError> {
    let top = outline.map(|(x, z)| DVec3::new(x, *height, z));
    let bottom = outline.map(|(x, z)| DVec3::new(x, 0.0, z));
    let sides = [0, 1, 2, 3].map(|k| {
        let next = (k + 1) % 4;
        [top[next], top[k], bottom[k], bottom[next]]
    });
    let [a, b, c, d] = sides;
    assembly.surface_of(name, material, [top, a, b, c, d])
}
