//! Figures 1 and 5 as images.

use ::png::ColorType;

use super::model::Room;
use crate::experiment::ExperimentError;
use crate::matrix::Precision;
use crate::render::png::encode_bytes;

/// Returns figure 1 as a PNG: |a_ij| of A = I − diag(ρ) F at a level, row i downwards, `scale` pixels a side of an entry.
///
/// An entry is black where it is 1 and white where it is 0.
///
/// Grey is 1 − |a|^½: the entries off the diagonal are at most 0.26, and most of them a hundredth of that.
///
/// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), figure 1 (l = 2). Departures: the square root.
///
/// # Errors
/// [`ExperimentError`] if the form factors cannot be stored, or the image not be encoded.
pub fn density_png(level: u32, scale: usize) -> Result<Vec<u8>, ExperimentError> {
    let room = Room { level };
    let factors = room.form_factors(Precision::F64)?;
    let rho = room.reflectance();
    let n = room.n_patches();
    let grey = |x: usize, y: usize| {
        let (i, j) = (y / scale, x / scale);
        let a = f64::from(u8::from(i == j)) - rho.row(i)[0] * factors.get(i, j);
        1.0 - a.abs().sqrt()
    };
    png(n * scale, n * scale, grey)
}

/// Returns figure 5 as a PNG: the radiosities `values` \[N\] of a level on the unfolded room, `scale` pixels a side of a patch.
///
/// From left to right the walls x = 0, y = 1, x = 1 and y = 0, upright; above and below y = 1 the ceiling and the floor. Grey is (u / max u)^½.
///
/// Source: [`LEWIS_1992`](crate::references::LEWIS_1992), figure 5. Departures: all six walls, flat, where he folds one wall of a cube down.
///
/// # Errors
/// [`ExperimentError`] if the image cannot be encoded.
pub fn unfolded_png(level: u32, values: &[f64], scale: usize) -> Result<Vec<u8>, ExperimentError> {
    let m = Room { level }.per_edge();
    let max = values.iter().copied().fold(0.0, f64::max);
    let side = m * scale;
    let grey = |x: usize, y: usize| {
        // Inside a tile, s runs right and t upwards, in patches.
        let (column, row) = (x / side, y / side);
        let (s, t) = (x % side / scale, m - 1 - y % side / scale);
        let (wall, a, b) = match (column, row) {
            (0, 1) => (0, s, t),
            (1, 1) => (3, s, t),
            (2, 1) => (1, m - 1 - s, t),
            (3, 1) => (2, m - 1 - s, t),
            (1, 0) => (5, s, m - 1 - t),
            (1, 2) => (4, s, t),
            _ => return 1.0,
        };
        (values[wall * m * m + a * m + b] / max).sqrt()
    };
    png(4 * side, 3 * side, grey)
}

fn png(width: usize, height: usize, grey: impl Fn(usize, usize) -> f64) -> Result<Vec<u8>, ExperimentError> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 0..=255; not a number becomes 0"
    )]
    let level = |value: f64| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
    let pixels: Vec<u8> = (0..width * height).map(|k| level(grey(k % width, k / width))).collect();
    let encoded = encode_bytes([width, height], ColorType::Grayscale, None, &pixels);
    encoded.map_err(|error| ExperimentError::Image(error.to_string()))
}
