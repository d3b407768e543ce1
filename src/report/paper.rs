//! The drawing surface of plots: SVG text, or the pixels of a PNG with the same layout.

use std::io;

use ab_glyph::{Font as _, FontRef, ScaleFont as _};
use plotters::prelude::{DrawingBackend, SVGBackend};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind, FontStyle};
use png::{ColorType, EncodingError};

use crate::render::png::encode_bytes;

/// The width of a plot in its unit of length, the pixel of an SVG.
pub(super) const WIDTH: u32 = 960;
/// Height of a plot.
pub(super) const HEIGHT: u32 = 600;
/// The pixels of a PNG per unit of length.
const SCALE: usize = 2;
/// The samples along a side of a pixel, for smooth edges.
const SAMPLES: usize = 2;
/// The samples per unit of length.
const FINE: usize = SCALE * SAMPLES;
const COLUMNS: usize = WIDTH as usize * FINE;
const ROWS: usize = HEIGHT as usize * FINE;

type Result = std::result::Result<(), DrawingErrorKind<io::Error>>;

/// A sheet for the drawing library.
pub(super) enum Paper<'a> {
    /// An SVG.
    Svg(SVGBackend<'a>),
    /// Pixels.
    Pixels(&'a mut Canvas),
}

/// RGB samples, row by row from the top.
pub(super) struct Canvas(Vec<[u8; 3]>);

impl Canvas {
    /// Returns a white sheet.
    pub(super) fn new() -> Self {
        Self(vec![[255; 3]; COLUMNS * ROWS])
    }

    /// Returns the PNG: each pixel is the mean of its samples.
    pub(super) fn to_png(&self) -> std::result::Result<Vec<u8>, EncodingError> {
        let (width, height) = (COLUMNS / SAMPLES, ROWS / SAMPLES);
        let mut pixels = Vec::with_capacity(3 * width * height);
        for (y, x, channel) in (0..height).flat_map(|y| (0..width).flat_map(move |x| (0..3).map(move |c| (y, x, c)))) {
            let first = SAMPLES * (y * COLUMNS + x);
            let block = [first, first + 1, first + COLUMNS, first + COLUMNS + 1];
            let sum: u32 = block.iter().map(|&k| u32::from(self.0[k][channel])).sum();
            pixels.push(u8::try_from((sum + 2) / 4).unwrap_or(u8::MAX));
        }
        encode_bytes([width, height], ColorType::Rgb, None, &pixels)
    }

    fn blend(&mut self, sample: usize, color: BackendColor) {
        let (r, g, b) = color.rgb;
        for (old, new) in self.0[sample].iter_mut().zip([r, g, b]) {
            let mixed = f64::from(*old) + color.alpha * (f64::from(new) - f64::from(*old));
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "between two bytes, as alpha is in [0, 1]"
            )]
            {
                *old = mixed.round() as u8;
            }
        }
    }

    /// Blends each sample that is inside, within the box around `points` extended by `margin`.
    fn fill(&mut self, points: &[BackendCoord], margin: f64, color: BackendColor, inside: impl Fn(f64, f64) -> bool) {
        for k in samples(points, margin, inside) {
            self.blend(k, color);
        }
    }

    /// Draws a line through points, no darker where it crosses itself.
    fn stroke<S: BackendStyle>(&mut self, points: &[BackendCoord], style: &S) {
        let half = 0.5 * f64::from(style.stroke_width());
        let on_line = |ends: &[BackendCoord]| {
            let (a, b) = (centre(ends[0]), centre(ends[1]));
            let along = (b.0 - a.0, b.1 - a.1);
            let length = along.0.hypot(along.1);
            samples(ends, half, move |x, y| {
                let (dx, dy) = (x - a.0, y - a.1);
                let t = dx * along.0 + dy * along.1;
                length > 0.0
                    && (0.0..=length * length).contains(&t)
                    && (dx * along.1 - dy * along.0).abs() <= half * length
            })
        };
        let mut covered: Vec<usize> = points.windows(2).flat_map(on_line).collect();
        covered.sort_unstable();
        covered.dedup();
        for k in covered {
            self.blend(k, style.color());
        }
    }

    /// Draws text with the size, the anchor and the baseline that a browser gives that of an SVG.
    fn text<S: BackendTextStyle>(&mut self, text: &str, style: &S, pos: BackendCoord) -> Result {
        let bytes = match style.style() {
            FontStyle::Bold => dejavu::sans::bold(),
            _ => dejavu::sans::regular(),
        };
        let font = FontRef::try_from_slice(bytes).map_err(|error| DrawingErrorKind::FontError(Box::new(error)))?;
        // The drawing library's size of a font is 1.24 em.
        #[expect(clippy::cast_possible_truncation, reason = "the size of a font")]
        let em = (FINE as f64 * style.size() / 1.24) as f32;
        let units = font.units_per_em().unwrap_or(1000.0);
        let font = font.as_scaled(em * font.height_unscaled() / units);
        let mut width = 0.0;
        let mut glyphs: Vec<_> = text.chars().map(|c| font.scaled_glyph(c)).collect();
        for glyph in &mut glyphs {
            glyph.position.x = width;
            width += font.h_advance(glyph.id);
        }
        let left = match style.anchor().h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * width,
            HPos::Right => -width,
        };
        let baseline = match style.anchor().v_pos {
            VPos::Top => 0.76 * em,
            VPos::Center => 0.25 * em,
            VPos::Bottom => -0.25 * em,
        };
        for mut glyph in glyphs {
            glyph.position += ab_glyph::point(left, baseline);
            let Some(outline) = font.outline_glyph(glyph) else {
                continue;
            };
            let corner = outline.px_bounds().min;
            outline.draw(|dx, dy, coverage| {
                #[expect(clippy::cast_possible_truncation, reason = "a place on the sheet")]
                let place = |edge: f32, d: u32| (edge + d as f32) as i32;
                let (x, y) = style.transform().transform(place(corner.x, dx), place(corner.y, dy));
                let fine = |k: i32, d: i32| usize::try_from(k * i32::try_from(FINE).unwrap_or(1) + d).ok();
                if let (Some(x), Some(y)) = (fine(pos.0, x), fine(pos.1, y))
                    && x < COLUMNS
                    && y < ROWS
                {
                    self.blend(y * COLUMNS + x, style.color().mix(f64::from(coverage.min(1.0))));
                }
            });
        }
        Ok(())
    }
}

fn centre((x, y): BackendCoord) -> (f64, f64) {
    (f64::from(x), f64::from(y))
}

/// Returns the samples that are inside, within the box around `points` extended by `margin`.
fn samples(points: &[BackendCoord], margin: f64, inside: impl Fn(f64, f64) -> bool) -> Vec<usize> {
    let range = |value: fn(&BackendCoord) -> i32, n: usize| {
        let values = || points.iter().map(|p| f64::from(value(p)));
        let low = values().fold(f64::INFINITY, f64::min) - margin;
        let high = values().fold(f64::NEG_INFINITY, f64::max) + margin;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` stops at zero, which is the edge of the sheet"
        )]
        let fine = |v: f64| ((v * FINE as f64).round() as usize).min(n);
        fine(low)..fine(high)
    };
    let (columns, rows) = (range(|p| p.0, COLUMNS), range(|p| p.1, ROWS));
    let place = |k: usize| (k as f64 + 0.5) / FINE as f64;
    rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
        .filter(|&(x, y)| inside(place(x), place(y)))
        .map(|(x, y)| y * COLUMNS + x)
        .collect()
}

impl DrawingBackend for Paper<'_> {
    type ErrorType = io::Error;

    fn get_size(&self) -> (u32, u32) {
        (WIDTH, HEIGHT)
    }

    fn ensure_prepared(&mut self) -> Result {
        match self {
            Self::Svg(svg) => svg.ensure_prepared(),
            Self::Pixels(_) => Ok(()),
        }
    }

    fn present(&mut self) -> Result {
        match self {
            Self::Svg(svg) => svg.present(),
            Self::Pixels(_) => Ok(()),
        }
    }

    fn draw_pixel(&mut self, point: BackendCoord, color: BackendColor) -> Result {
        self.draw_rect(point, (point.0 + 1, point.1 + 1), &color, true)
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Result {
        match self {
            Self::Svg(svg) => return svg.draw_line(from, to, style),
            Self::Pixels(canvas) => canvas.stroke(&[from, to], style),
        }
        Ok(())
    }

    fn draw_rect<S: BackendStyle>(&mut self, a: BackendCoord, b: BackendCoord, style: &S, fill: bool) -> Result {
        match self {
            Self::Svg(svg) => return svg.draw_rect(a, b, style, fill),
            Self::Pixels(canvas) if fill => canvas.fill(&[a, b], 0.0, style.color(), |_, _| true),
            Self::Pixels(canvas) => canvas.stroke(&[a, (b.0, a.1), b, (a.0, b.1), a], style),
        }
        Ok(())
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, path: I, style: &S) -> Result {
        match self {
            Self::Svg(svg) => return svg.draw_path(path, style),
            Self::Pixels(canvas) => canvas.stroke(&path.into_iter().collect::<Vec<_>>(), style),
        }
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(&mut self, at: BackendCoord, radius: u32, style: &S, fill: bool) -> Result {
        match self {
            Self::Svg(svg) => return svg.draw_circle(at, radius, style, fill),
            Self::Pixels(canvas) => {
                let (x0, y0) = centre(at);
                let half = 0.5 * f64::from(style.stroke_width());
                let outer = f64::from(radius) + if fill { 0.0 } else { half };
                let inner = if fill { 0.0 } else { f64::from(radius) - half };
                canvas.fill(&[at], outer, style.color(), |x, y| {
                    (inner..=outer).contains(&(x - x0).hypot(y - y0))
                });
            }
        }
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, path: I, style: &S) -> Result {
        match self {
            Self::Svg(svg) => return svg.fill_polygon(path, style),
            Self::Pixels(canvas) => {
                let corners: Vec<BackendCoord> = path.into_iter().collect();
                let from = corners.iter().cycle().skip(1);
                let edges: Vec<_> = corners
                    .iter()
                    .zip(from)
                    .map(|(&a, &b)| (centre(a), centre(b)))
                    .collect();
                canvas.fill(&corners, 0.0, style.color(), |x, y| {
                    // A ray to the right crosses the outline an odd number of times.
                    let crosses = |(a, b): &&((f64, f64), (f64, f64))| {
                        (a.1 > y) != (b.1 > y) && x < a.0 + (y - a.1) / (b.1 - a.1) * (b.0 - a.0)
                    };
                    edges.iter().filter(crosses).count() % 2 == 1
                });
            }
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, pos: BackendCoord) -> Result {
        match self {
            Self::Svg(svg) => svg.draw_text(text, style, pos),
            Self::Pixels(canvas) => canvas.text(text, style, pos),
        }
    }
}
