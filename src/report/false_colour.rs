//! Images of a quantity in false colour, with a scale.

use std::io::{self, Write as _};
use std::path::Path;

use plotters::element::{Rectangle, Text};
use plotters::prelude::{Color, RGBColor};
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::frame::{self, Area, DrawResult, Frame, PlotError, text};
use super::{ReportError, file};

/// An image of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct FalseColour {
    /// The heading.
    pub title: String,
    /// A line below the heading.
    pub subtitle: String,
    /// The quantity and its unit, beside the scale.
    pub label: String,
    /// Pixels in a row.
    pub width: usize,
    /// The values of all pixels, row by row from the top; `None` for background.
    pub values: Vec<Option<f64>>,
}

/// The position of the image: its left edge, its width and its height.
const LEFT: i32 = 24;
const BOX: [f64; 2] = [720.0, 508.0];

/// The scale: top, height and width in the part of the sheet for the legend.
const SCALE: [i32; 3] = [40, 400, 26];

/// The number of labels of the scale.
const N_LABELS: i32 = 6;

/// The colour of the background.
const BACKGROUND: RGBColor = RGBColor(235, 235, 235);

/// Nine colours of viridis, from the least value to the greatest (S. van der Walt and N. Smith, 2015; public domain).
const VIRIDIS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 44.0, 122.0],
    [59.0, 81.0, 139.0],
    [44.0, 113.0, 142.0],
    [33.0, 144.0, 141.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

/// Returns the colour at a position on the scale, from 0 to 1.
fn colour(place: f64) -> RGBColor {
    // NaN counts as 0.
    let along = if place > 0.0 { place.min(1.0) } else { 0.0 } * (VIRIDIS.len() - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 8")]
    let k = (along as usize).min(VIRIDIS.len() - 2);
    let t = along - k as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between two bytes"
    )]
    let byte = |c: usize| (VIRIDIS[k][c] + t * (VIRIDIS[k + 1][c] - VIRIDIS[k][c])).round() as u8;
    RGBColor(byte(0), byte(1), byte(2))
}

impl FalseColour {
    /// Draws the image as a PNG of 1920 × 1200 pixels, with a scale from its least value to its greatest; equal input gives equal bytes.
    ///
    /// # Errors
    /// [`PlotError`] if the drawing library fails.
    pub fn to_png(&self) -> Result<Vec<u8>, PlotError> {
        frame::to_png(&self.title, &self.subtitle, |frame| self.draw(frame))
    }

    /// Writes the PNG, atomically.
    ///
    /// # Errors
    /// [`ReportError::Unwritable`].
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        file::write(path, |writer| {
            writer.write_all(&self.to_png().map_err(io::Error::other)?)
        })
    }

    /// Returns the least and the greatest value.
    fn range(&self) -> (f64, f64) {
        let seen = self.values.iter().flatten();
        seen.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
            (low.min(v), high.max(v))
        })
    }

    fn draw(&self, frame: &mut Frame<'_>) -> DrawResult {
        let (low, high) = self.range();
        self.draw_pixels(&frame.plot, (low, high))?;
        if low <= high {
            self.draw_scale(frame.legend.area(), (low, high))?;
        }
        Ok(())
    }

    fn draw_pixels(&self, area: &Area<'_>, (low, high): (f64, f64)) -> DrawResult {
        let height = self.values.len() / self.width.max(1);
        let unit = (BOX[0] / self.width.max(1) as f64).min(BOX[1] / height.max(1) as f64);
        let spread = (high - low).max(f64::MIN_POSITIVE);
        #[expect(clippy::cast_possible_truncation, reason = "places on the sheet")]
        let [columns, rows] = [self.width, height].map(|n| (n as f64 * unit).floor() as i32);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a place in the picture"
        )]
        let pixel = |k: i32, n: usize| ((f64::from(k) + 0.5) / unit).min(n as f64 - 1.0) as usize;
        let shade = |x: i32, y: i32| {
            let value = self.values[pixel(y, height) * self.width + pixel(x, self.width)];
            value.map_or(BACKGROUND, |value| colour((value - low) / spread))
        };
        for y in 0..rows {
            let mut from = 0;
            for x in 1..=columns {
                if x == columns || shade(x, y) != shade(from, y) {
                    let corners = [(LEFT + from, y), (LEFT + x, y + 1)];
                    area.draw(&Rectangle::new(corners, shade(from, y).filled()))?;
                    from = x;
                }
            }
        }
        Ok(())
    }

    fn draw_scale(&self, area: &Area<'_>, (low, high): (f64, f64)) -> DrawResult {
        let [top, height, width] = SCALE;
        for k in 0..height {
            let place = 1.0 - (f64::from(k) + 0.5) / f64::from(height);
            let corners = [(4, top + k), (4 + width, top + k + 1)];
            area.draw(&Rectangle::new(corners, colour(place).filled()))?;
        }
        let style = || text(14.0).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw(&Text::new(self.label.clone(), (4, top - 18), style()))?;
        for k in 0..N_LABELS {
            let place = f64::from(k) / f64::from(N_LABELS - 1);
            let y = top + (N_LABELS - 1 - k) * height / (N_LABELS - 1);
            let value = low + place * (high - low);
            area.draw(&Text::new(rounded(value, high - low), (12 + width, y), style()))?;
        }
        Ok(())
    }
}

/// Returns a value with as many decimals as distinguish a thousandth of a spread.
fn rounded(value: f64, spread: f64) -> String {
    let digits = if spread > 0.0 {
        2.0 - spread.log10().floor()
    } else {
        3.0
    };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 12")]
    let n_decimals = digits.clamp(0.0, 12.0) as usize;
    format!("{value:.n_decimals$}")
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_the_scale_are_those_of_viridis() {
        assert_eq!(
            (colour(0.0), colour(1.0)),
            (RGBColor(68, 1, 84), RGBColor(253, 231, 37))
        );
        assert_eq!(colour(f64::NAN), colour(0.0));
        assert_eq!(rounded(177.4213, 12.0), "177.4");
        assert_eq!(rounded(177.4213, 0.0), "177.421");
    }

    /// Tests the colours: the middle of the left half has the least colour, that of the right the greatest, and the gap has neither.
    #[test]
    fn pixels_have_the_colours_of_their_values() {
        let picture = FalseColour {
            title: "Two values".into(),
            subtitle: String::new(),
            label: "K".into(),
            width: 3,
            values: vec![Some(1.0), None, Some(2.0)],
        };
        let bytes = picture.to_png().unwrap();
        assert_eq!(bytes, picture.to_png().unwrap());
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let at = |x: usize, y: usize| {
            let first = 3 * (y * 1920 + x);
            RGBColor(pixels[first], pixels[first + 1], pixels[first + 2])
        };
        // One unit is two pixels; the heading is 66 units high.
        let y = 2 * (66 + 120);
        let seen = [144, 384, 624].map(|x| at(2 * x, y));
        assert_eq!(seen, [colour(0.0), BACKGROUND, colour(1.0)]);
    }
}
