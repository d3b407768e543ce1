//! Pixels of an image against their answers.

use super::points::{PixelAnswer, Reference};
use super::sheet::Sheet;
use super::{Rounding, VerifyError};
use crate::render::image::{Image, channel_names};

/// The layers that verification looks at.
pub(super) struct Layers<'a> {
    width: usize,
    direct: [&'a [f32]; 3],
    /// Irradiance, radiosity and radiance, where the image has them.
    light: Option<[[&'a [f32]; 3]; 3]>,
    position: [&'a [f32]; 3],
}

/// One pixel, judged.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Judged {
    pub(super) outside: bool,
    pub(super) misplaced: bool,
    pub(super) inconsistent: bool,
    /// Image minus exact answer.
    pub(super) error: [f64; 3],
    /// Statistical, offset, rounding.
    pub(super) parts: [[f64; 3]; 3],
}

impl Judged {
    /// Returns whether a channel's error is within its tolerance; NaN is not.
    pub(super) fn is_within(&self, channel: usize) -> bool {
        let tolerance: f64 = self.parts.iter().map(|part| part[channel]).sum();
        self.error[channel].abs() <= tolerance
    }
}

impl<'a> Layers<'a> {
    pub(super) fn new(image: &'a Image) -> Result<Self, VerifyError> {
        let rgb = |prefix| triple(image, channel_names(prefix, ['R', 'G', 'B']));
        Ok(Self {
            width: image.width(),
            direct: rgb("direct")?,
            light: Some([rgb("irradiance")?, rgb("radiosity")?, rgb("")?]),
            position: position(image)?,
        })
    }

    /// The layers of a field of form factors: one channel stands for all three.
    pub(super) fn of_field(image: &'a Image) -> Result<Self, VerifyError> {
        Ok(Self {
            width: image.width(),
            direct: triple(image, ["Y"; 3].map(str::to_owned))?,
            light: None,
            position: position(image)?,
        })
    }

    /// Judges pixel k of a sheet.
    pub(super) fn judge(
        &self,
        sheet: &Sheet,
        k: usize,
        answer: &PixelAnswer,
        reference: &Reference<'_>,
        log_odds: f64,
    ) -> Judged {
        let (column, row) = (k % sheet.width, k / sheet.width);
        let index = (sheet.top + row) * self.width + sheet.left + column;
        let value = |layers: &[&[f32]; 3], c: usize| f64::from(layers[c][index]);
        let mut judged = Judged::default();
        let shown = match answer {
            PixelAnswer::Border => return judged,
            PixelAnswer::Background => {
                judged.outside = (0..3).any(|c| value(&self.direct, c).abs().to_bits() != 0);
                return judged;
            }
            PixelAnswer::Surface(shown) => shown,
        };
        let close = |found: f64, follows: f64| reference.layer_rounding().allows(found, follows, 0.0);
        for c in 0..3 {
            if let Some((point, slack)) = shown.centre {
                judged.misplaced |= !Rounding::F32.allows(value(&self.position, c), point[c], slack);
            }
            let Some([irradiance, radiosity, radiance]) = &self.light else {
                continue;
            };
            let (h, b) = (value(irradiance, c), value(radiosity, c));
            if let Some((exitance, reflectance)) = shown.material {
                judged.inconsistent |= !close(b, exitance[c] + reflectance[c] * h);
            }
            judged.inconsistent |= !close(value(radiance, c), b / std::f64::consts::PI);
            judged.inconsistent |= reference.nothing_reflects() && !close(h, value(&self.direct, c));
        }
        if let Some((exact, offset)) = shown.irradiance {
            for c in 0..3 {
                judged.error[c] = value(&self.direct, c) - exact[c];
                judged.parts[0][c] = reference.statistical(c, exact[c].max(reference.leak(c, answer)), 1.0, log_odds);
                judged.parts[1][c] = offset[c].abs();
                judged.parts[2][c] = reference.rounding(c, exact[c]);
                judged.outside |= !judged.is_within(c);
            }
        }
        judged
    }
}

fn triple(image: &Image, names: [String; 3]) -> Result<[&[f32]; 3], VerifyError> {
    let mut found: [&[f32]; 3] = [&[]; 3];
    for (layer, name) in found.iter_mut().zip(names) {
        *layer = image.f32(&name).ok_or(VerifyError::MissingLayer(name))?;
    }
    Ok(found)
}

fn position(image: &Image) -> Result<[&[f32]; 3], VerifyError> {
    triple(image, channel_names("P", ['X', 'Y', 'Z']))
}
