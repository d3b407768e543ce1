//! Maps radiance to an image for the screen.

use super::image::Image;

/// The median of the visible luminances after scaling, before the curve; 1 would be a white wall in plain light.
pub const MIDDLE: f64 = 0.25;

/// The luminance, on the same scale, that becomes white: four stops above [`MIDDLE`], and mostly below light sources.
pub const WHITE: f64 = 4.0;

/// Returns 8-bit sRGB values, three per pixel, of the layers `R,G,B`, or of `Y` where there is no `R`; black where a layer is missing.
///
/// The luminance Y = 0.2126 R + 0.7152 G + 0.0722 B is scaled so that its median over all pixels with light is [`MIDDLE`] (a small
/// bright source hardly moves it), then Y′ = Y (1 + Y / w²)/(1 + Y) with w = [`WHITE`]; the colours keep their ratios and are clipped at 1. Values that are
/// negative or not finite count as 0.
///
/// Source: [`REINHARD_2002`](crate::references::REINHARD_2002), equation (4); sRGB of IEC 61966-2-1.
/// Departures: the median in place of the log-average, and a fixed white.
#[must_use]
pub fn tone_map(image: &Image) -> Vec<u8> {
    let channel = |name| image.f32(name).unwrap_or(&[]);
    let names = if image.f32("R").is_some() {
        ["R", "G", "B"]
    } else {
        ["Y"; 3]
    };
    let rgb = names.map(channel);
    let clean = |x: Option<&f32>| x.map_or(0.0, |&x| if x.is_finite() { f64::from(x).max(0.0) } else { 0.0 });
    let pixels: Vec<[f64; 3]> = (0..image.width() * image.height())
        .map(|k| rgb.map(|layer| clean(layer.get(k))))
        .collect();
    let luminance = |[r, g, b]: &[f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
    let mut lit: Vec<f64> = pixels.iter().map(luminance).filter(|&y| y > 0.0).collect();
    let exposure = if lit.is_empty() {
        0.0
    } else {
        let middle = lit.len() / 2;
        MIDDLE / *lit.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    pixels
        .iter()
        .flat_map(|pixel| {
            let y = luminance(pixel) * exposure;
            let ratio = exposure * (1.0 + y / (WHITE * WHITE)) / (1.0 + y);
            pixel.map(|x| srgb(x * ratio))
        })
        .collect()
}

/// Returns a linear value as sRGB, 1 as 1 (IEC 61966-2-1).
pub(crate) fn srgb_curve(linear: f64) -> f64 {
    if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// Returns the 8-bit sRGB code of a linear value.
fn srgb(linear: f64) -> u8 {
    let encoded = srgb_curve(linear.min(1.0));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 255 by construction"
    )]
    let code = (255.0 * encoded).round() as u8;
    code
}

#[cfg(test)]
mod tests {
    use super::super::image::Samples;
    use super::*;

    fn grey(values: &[f32]) -> Image {
        let mut image = Image::new(values.len(), 1);
        for name in ["R", "G", "B"] {
            image.insert(name, Samples::F32(values.to_vec()));
        }
        image
    }

    #[test]
    fn srgb_codes() {
        // 0.2159 has code 128, 0.5 has 188.
        for (linear, code) in [
            (0.0, 0),
            (0.002, 7),
            (0.215_861, 128),
            (0.5, 188),
            (1.0, 255),
            (9.0, 255),
        ] {
            assert_eq!(srgb(linear), code, "{linear}");
        }
    }

    #[test]
    fn the_exposure_follows_the_median_and_not_the_lamp() {
        let dim = tone_map(&grey(&[0.0, 0.5, 1.0, 2.0, 1e4, 1.0]));
        let bright = tone_map(&grey(&[0.0, 500.0, 1000.0, 2000.0, 1e7, 1000.0]));
        assert_eq!(dim, bright);
        // 0.25 (1 + 0.25/16)/1.25 = 0.203125, which is code 124.
        assert_eq!(dim[2 * 3], 124);
        assert_eq!((dim[0], dim[4 * 3]), (0, 255));
    }

    #[test]
    fn bad_values_are_black_and_colours_keep_their_ratios() {
        let codes = tone_map(&grey(&[f32::NAN, f32::INFINITY, -1.0, 1.0]));
        assert_eq!(codes[..9], [0; 9]);
        assert_eq!(tone_map(&grey(&[0.0, 0.0])), [0; 6]);
        let mut red = Image::new(1, 1);
        red.insert("R", Samples::F32(vec![3.0]));
        let red_codes = tone_map(&red);
        assert!(red_codes[0] > 200 && red_codes[1..] == [0, 0]);
    }
}
