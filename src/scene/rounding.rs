//! How far the corners of a scene may lie from where they were meant: how many digits its coordinates have.

use super::Scene;
use crate::geometry::polygon;

/// Coordinates with fewer digits are taken as meant: 0.25 is a quarter, 0.333333 a third that was rounded.
const LEAST_DIGITS: usize = 6;

/// What counts, by how far a corner may be off: the height of a rounded corner over the plane of three others is some three times that, and twice as much is safe.
pub(crate) const SLACK_PER_CORNER: f64 = 6.0;

impl Scene {
    /// Returns the height, in m, up to which faces that were meant to touch or to lie in one plane may stand out from each other, as the coordinates' digits tell: six times what the greatest rounding of a
    /// coordinate moves a corner, √3 of it, or twice what a quad is bent, if that is more. About 0 where coordinates have all their digits, or so few that they are meant as they are.
    ///
    /// A file with six decimals has 5e-6. What is thinner than that cannot be told from what touches.
    pub(crate) fn slack(&self) -> f64 {
        let coordinates = self.vertices.iter().flat_map(|v| v.to_array());
        let rounded = coordinates.map(rounding).fold(0.0, f64::max);
        let quads = self
            .face_ids()
            .filter(|face| self.faces[face.0 as usize].corners.as_slice().len() > 3);
        let bent = quads
            .map(|face| polygon::planarity_error(&self.polygon(face)))
            .fold(0.0, f64::max);
        (SLACK_PER_CORNER * 3.0_f64.sqrt() * rounded).max(2.0 * bent)
    }
}

/// Returns by how much a coordinate may have been rounded: half a unit in the last place of its shortest decimal form, or of f32 where it is one that was written in decimals.
fn rounding(x: f64) -> f64 {
    let text = format!("{:e}", x.abs());
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return 0.0;
    };
    let n_digits = mantissa.len() - usize::from(mantissa.contains('.'));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let Ok(n_digits_i32) = i32::try_from(n_digits) else {
        return 0.0;
    };
    if n_digits < LEAST_DIGITS {
        return 0.0;
    }
    let of_decimals = 0.5 * 10_f64.powi(exponent - n_digits_i32 + 1);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "it is asked whether f32 is where the number comes from"
    )]
    let single = x as f32;
    let is_single = (f64::from(single) - x).abs() <= of_decimals * (1.0 + 1e-6);
    if is_single && single.is_finite() {
        let of_single = 0.5 * f64::from(single.next_up() - single).abs();
        return of_decimals.max(of_single);
    }
    of_decimals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_tell_how_far_a_coordinate_may_be_off() {
        for (x, expected) in [
            (0.0, 0.0),
            (0.25, 0.0),
            (-1234.5, 0.0),
            (0.333333, 0.5e-6),
            (-3.560628, 0.5e-6),
            (5.46683, 0.5e-5),
            (500_012.345, 0.5e-3),
            // 1 / 3 in f64, and in f32 as written with nine digits.
            (1.0 / 3.0, 0.5e-16),
            (0.333333343, 2.0_f64.powi(-26)),
        ] {
            let found = rounding(x);
            assert!((found - expected).abs() <= 1e-6 * expected, "{x}: {found:e}");
        }
    }
}
