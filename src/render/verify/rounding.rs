//! The rounding of a layer.

use crate::render::exr::Pixels;

/// The greatest rounding of a layer's number.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounding {
    /// The relative part: half the distance between two numbers of size 1.
    pub(super) relative: f64,
    /// The absolute part: at least half the distance between numbers near 0.
    pub(super) absolute: f64,
}

impl Rounding {
    pub(super) const F32: Self = Self {
        relative: 1.0 / (1 << 24) as f64,
        absolute: f32::MIN_POSITIVE as f64,
    };
    /// The rounding of f16: 11 bits, and steps of 2^−24 near 0.
    pub(super) const F16: Self = Self {
        relative: 1.0 / (1 << 11) as f64,
        absolute: 1.0 / (1 << 25) as f64,
    };

    pub(super) fn of(pixels: Pixels) -> Self {
        match pixels {
            Pixels::F32 => Self::F32,
            Pixels::F16 => Self::F16,
        }
    }

    /// Returns true if a layer's value is the given number after a few roundings.
    pub(super) fn allows(self, value: f64, exact: f64, slack: f64) -> bool {
        (value - exact).abs() <= 4.0 * (self.relative * exact.abs() + self.absolute) + slack
    }
}
