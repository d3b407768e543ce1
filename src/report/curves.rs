//! Plots of curves over a linear axis as SVG: convergence histories, spectra.

use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::DrawingArea;
use plotters::element::{PathElement, Text};
use plotters::prelude::{ChartBuilder, Color, IntoDrawingArea, RGBColor, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, IntoTextStyle};

use super::log_axis::LogAxis;
use super::plot::{FONT, GREY, HEIGHT, LEGEND, LIGHT, PlotError, WIDTH, colour, register_fonts, text};

/// A named line through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// The number of its colour: equal numbers look alike in all plots; from 7 on lines are thin.
    pub style: usize,
    /// Its points.
    pub points: Vec<(f64, f64)>,
}

/// Several curves over a linear axis.
#[derive(Clone, Debug, PartialEq)]
pub struct CurvePlot {
    /// The heading.
    pub title: String,
    /// A line below the heading.
    pub subtitle: String,
    /// What runs to the right.
    pub x_label: String,
    /// What runs upwards.
    pub y_label: String,
    /// Whether equal ratios, not equal differences, are at equal distances upwards.
    pub log_y: bool,
    /// The curves.
    pub curves: Vec<Curve>,
}

impl CurvePlot {
    /// Draws the plot. Points that are not finite, or not positive where the axis is logarithmic, are left out; equal input gives equal bytes.
    ///
    /// # Errors
    /// [`PlotError`] if the drawing library fails.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        register_fonts()?;
        let mut svg = String::new();
        self.draw(&mut svg).map_err(|error| PlotError::new(error.to_string()))?;
        Ok(svg)
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let size = (WIDTH.unsigned_abs(), HEIGHT.unsigned_abs());
        let root = SVGBackend::with_string(svg, size).into_drawing_area();
        root.fill(&RGBColor(255, 255, 255))?;
        let title = (FONT, 18.0, FontStyle::Bold).into_text_style(&root);
        root.draw(&Text::new(self.title.clone(), (24, 18), title))?;
        root.draw(&Text::new(self.subtitle.clone(), (24, 44), text(13.0).color(&GREY)))?;
        let (_, below) = root.split_vertically(66);
        let (plot, legend) = below.split_horizontally(WIDTH - LEGEND);
        let points = || self.curves.iter().flat_map(|curve| self.shown(curve));
        let x = covering(points().map(|p| p.0));
        if self.log_y {
            self.draw_curves(&plot, x, LogAxis::covering(points().map(|p| p.1)))?;
        } else {
            let y: RangedCoordf64 = covering(points().map(|p| p.1)).into();
            self.draw_curves(&plot, x, y)?;
        }
        let label = text(13.0).pos(Pos::new(HPos::Left, VPos::Center));
        for (k, curve) in self.curves.iter().enumerate() {
            let y = 16 + 23 * i32::try_from(k).unwrap_or(i32::MAX / 64);
            let line = colour(curve.style).stroke_width(width(curve.style));
            legend.draw(&PathElement::new([(0, y), (24, y)], line))?;
            legend.draw(&Text::new(curve.name.clone(), (30, y), label.clone()))?;
        }
        root.present()?;
        Ok(())
    }

    /// Returns the points of a curve that have a place.
    fn shown<'a>(&'a self, curve: &'a Curve) -> impl Iterator<Item = (f64, f64)> + 'a {
        let has_place = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite() && (!self.log_y || p.1 > 0.0);
        curve.points.iter().copied().filter(has_place)
    }

    fn draw_curves<Y>(
        &self,
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        x: Range<f64>,
        y: Y,
    ) -> Result<(), Box<dyn std::error::Error>>
    where
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let mut chart = ChartBuilder::on(area)
            .margin_left(14)
            .margin_right(16)
            .margin_bottom(12)
            .x_label_area_size(54)
            .y_label_area_size(80)
            .build_cartesian_2d::<RangedCoordf64, Y>(x.into(), y)?;
        chart
            .configure_mesh()
            .light_line_style(LIGHT.mix(0.6))
            .bold_line_style(RGBColor(200, 200, 200))
            .axis_style(GREY)
            .label_style(text(13.0))
            .axis_desc_style(text(15.0).color(&RGBColor(0, 0, 0)))
            .x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .draw()?;
        for curve in &self.curves {
            let line: Vec<(f64, f64)> = self.shown(curve).collect();
            let style = colour(curve.style).stroke_width(width(curve.style));
            chart.draw_series([PathElement::new(line, style)])?;
        }
        Ok(())
    }
}

fn width(style: usize) -> u32 {
    if style < 7 { 2 } else { 1 }
}

/// Returns a range that covers values, with a margin.
fn covering(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    });
    if low > high {
        return 0.0..1.0;
    }
    let margin = 0.03 * (high - low).max(1e-12 * high.abs().max(1e-300));
    low - margin..high + margin
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn curves_and_names_are_drawn_on_either_axis() {
        for log_y in [true, false] {
            let plot = CurvePlot {
                title: "title".to_owned(),
                subtitle: "subtitle".to_owned(),
                x_label: "steps".to_owned(),
                y_label: "residual".to_owned(),
                log_y,
                curves: vec![
                    Curve {
                        name: "some-solver".to_owned(),
                        style: 1,
                        points: vec![(0.0, 1.0), (1.0, 0.1), (2.0, 0.0), (3.0, f64::NAN), (4.0, 1e-3)],
                    },
                    Curve {
                        name: "none".to_owned(),
                        style: 8,
                        points: Vec::new(),
                    },
                ],
            };
            let svg = plot.to_svg().unwrap();
            for text in ["title", "subtitle", "steps", "residual", "some-solver", "none"] {
                assert!(svg.contains(text), "{text}");
            }
            // The zero has a place on the linear axis alone.
            let curve = svg
                .lines()
                .find(|line| line.contains("<polyline") && line.contains("#D55E00"))
                .unwrap();
            assert_eq!(curve.matches(',').count(), if log_y { 3 } else { 4 }, "{curve}");
            assert_eq!(svg, plot.to_svg().unwrap());
        }
    }
}
