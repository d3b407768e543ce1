//! Plots as SVG: error against run time, both logarithmic.

use plotters::element::{Circle, EmptyElement, PathElement, Polygon, Rectangle, Text};
use plotters::prelude::{ChartBuilder, Color, IntoDrawingArea, RGBColor, SVGBackend, ShapeStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, FontTransform, IntoTextStyle, TextStyle, register_font};

use super::log_axis::LogAxis;

/// A measured value with the range in which repeated measurements lay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranged {
    /// What is marked: the median.
    pub middle: f64,
    /// The least value measured.
    pub low: f64,
    /// The greatest value measured.
    pub high: f64,
}

/// One setting of a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotPoint {
    /// Run time, s.
    pub time_s: Ranged,
    /// Error.
    pub error: Ranged,
    /// True if no other setting of any method is at least as fast and at least as accurate, and better in one of the two.
    pub on_front: bool,
}

/// A method with its settings in ascending order.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The method's name.
    pub name: String,
    /// The number of its colour and mark: equal numbers look alike in all plots.
    pub style: usize,
    /// Its settings.
    pub points: Vec<PlotPoint>,
}

/// A plot of error against run time.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorTimePlot {
    /// The heading.
    pub title: String,
    /// A line below the heading: what was measured how.
    pub subtitle: String,
    /// What the error is.
    pub error_label: String,
    /// The methods.
    pub series: Vec<Series>,
    /// The error below which the reference itself is not known; drawn as a line.
    pub reference_error: Option<f64>,
}

/// A plot could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the plot cannot be drawn: {0}")]
pub struct PlotError(String);

impl PlotError {
    pub(super) fn new(message: String) -> Self {
        Self(message)
    }
}

/// Colours that people with any colour vision can tell apart (M. Okabe and K. Ito, "Color Universal Design", 2008), without the yellow,
/// which is too faint for lines on white.
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(0, 0, 0),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
];

pub(super) const WIDTH: i32 = 960;
pub(super) const HEIGHT: i32 = 600;
/// The part of the width that the legend takes.
pub(super) const LEGEND: i32 = 200;
pub(super) const FONT: &str = "sans-serif";
pub(super) const GREY: RGBColor = RGBColor(110, 110, 110);
pub(super) const LIGHT: RGBColor = RGBColor(232, 232, 232);

impl ErrorTimePlot {
    /// Draws the plot: bars span the least and the greatest measurement, rings and the dashed line mark the Pareto front.
    ///
    /// Values that are not positive have no place on a logarithmic axis: a point whose middle is none is left out, a bar ends at the axis.
    /// Text is laid out in DejaVu Sans; equal input gives equal bytes.
    ///
    /// # Errors
    /// [`PlotError`] if the drawing library fails.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        register_fonts()?;
        let mut svg = String::new();
        self.draw(&mut svg).map_err(|error| PlotError(error.to_string()))?;
        Ok(svg)
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
        let size = (WIDTH.unsigned_abs(), HEIGHT.unsigned_abs());
        let root = SVGBackend::with_string(svg, size).into_drawing_area();
        root.fill(&RGBColor(255, 255, 255))?;
        let black = text(15.0).color(&RGBColor(0, 0, 0));
        let title = (FONT, 18.0, FontStyle::Bold).into_text_style(&root);
        root.draw(&Text::new(self.title.clone(), (24, 18), title))?;
        root.draw(&Text::new(self.subtitle.clone(), (24, 44), text(13.0).color(&GREY)))?;
        let (_, below) = root.split_vertically(66);
        let (plot, legend) = below.split_horizontally(WIDTH - LEGEND);
        let points = || self.series.iter().flat_map(|s| &s.points).filter(|p| has_place(p));
        let times = LogAxis::covering(points().flat_map(|p| [p.time_s.low, p.time_s.middle, p.time_s.high]));
        let errors = LogAxis::covering(points().flat_map(|p| [p.error.low, p.error.middle, p.error.high]));
        let floor = (times.low(), errors.low());
        let reference_error = self.reference_error.filter(|e| *e > floor.1);
        let mut chart = ChartBuilder::on(&plot)
            .margin_left(14)
            .margin_right(16)
            .margin_bottom(12)
            .x_label_area_size(54)
            .y_label_area_size(80)
            .build_cartesian_2d(times.clone(), errors)?;
        chart
            .configure_mesh()
            .light_line_style(LIGHT.mix(0.6))
            .bold_line_style(RGBColor(200, 200, 200))
            .axis_style(GREY)
            .label_style(text(13.0))
            .axis_desc_style(black.clone())
            .x_desc("run time (s)")
            .y_desc(self.error_label.as_str())
            .draw()?;
        if let Some(error) = reference_error {
            let ends = [
                (floor.0, error),
                (plotters::coord::ranged1d::Ranged::range(&times).end, error),
            ];
            chart.draw_series([PathElement::new(ends, GREY.stroke_width(1))])?;
        }
        let mut best: Vec<(f64, f64)> = points().filter(|p| p.on_front).map(middle).collect();
        best.sort_by(|a, b| a.0.total_cmp(&b.0));
        // More time is needed before less error can be had: the front is a staircase.
        let steps = best.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1)]);
        let front: Vec<(f64, f64)> = steps.chain(best.last().copied()).collect();
        chart.draw_series(plotters::series::DashedLineSeries::new(
            front,
            7,
            5,
            GREY.stroke_width(2),
        ))?;
        for series in &self.series {
            let colour = colour(series.style);
            let shown: Vec<&PlotPoint> = series.points.iter().filter(|p| has_place(p)).collect();
            let line: Vec<(f64, f64)> = shown.iter().map(|p| middle(p)).collect();
            chart.draw_series([PathElement::new(line, colour.mix(0.55).stroke_width(1))])?;
            for point in shown {
                let bars = bars(point, floor).map(|ends| PathElement::new(ends, colour.stroke_width(1)));
                chart.draw_series(bars)?;
                let ring = if point.on_front { RING } else { 0 };
                chart.draw_series([EmptyElement::at(middle(point))
                    + Circle::new((0, 0), ring, GREY.stroke_width(if point.on_front { 2 } else { 0 }))])?;
                let place = chart.backend_coord(&middle(point));
                mark(&root, place, series.style)?;
            }
        }
        self.draw_legend(&legend, reference_error.is_some())?;
        root.present()?;
        Ok(())
    }

    fn draw_legend(
        &self,
        area: &plotters::drawing::DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
        reference: bool,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let label = text(14.0).pos(Pos::new(HPos::Left, VPos::Center));
        let row = |k: usize| 16 + 25 * i32::try_from(k).unwrap_or(i32::MAX / 64);
        let line = |y: i32, style: ShapeStyle, dashes: &[(i32, i32)]| -> Vec<PathElement<(i32, i32)>> {
            dashes
                .iter()
                .map(|&(from, to)| PathElement::new([(from, y), (to, y)], style))
                .collect()
        };
        for (k, series) in self.series.iter().enumerate() {
            let colour = colour(series.style);
            for element in line(row(k), colour.mix(0.55).stroke_width(1), &[(4, 34)]) {
                area.draw(&element)?;
            }
            mark(area, (19, row(k)), series.style)?;
            area.draw(&Text::new(series.name.clone(), (44, row(k)), label.clone()))?;
        }
        let mut y = row(self.series.len()) + 10;
        for element in line(y, GREY.stroke_width(2), &[(4, 11), (27, 34)]) {
            area.draw(&element)?;
        }
        area.draw(&Circle::new((19, y), RING, GREY.stroke_width(2)))?;
        area.draw(&Text::new("Pareto front", (44, y), label.clone()))?;
        if reference {
            y += 25;
            for element in line(y, GREY.stroke_width(1), &[(4, 34)]) {
                area.draw(&element)?;
            }
            area.draw(&Text::new("reference's error", (44, y), label.clone()))?;
        }
        y += 25;
        for element in line(y, GREY.stroke_width(1), &[(9, 29)]) {
            area.draw(&element)?;
        }
        area.draw(&PathElement::new([(19, y - 8), (19, y + 8)], GREY.stroke_width(1)))?;
        area.draw(&Text::new("least to greatest", (44, y), label))?;
        Ok(())
    }
}

/// Makes the font known to the drawing library.
pub(super) fn register_fonts() -> Result<(), PlotError> {
    let font = [
        (FontStyle::Normal, dejavu::sans::regular()),
        (FontStyle::Bold, dejavu::sans::bold()),
    ];
    for (style, bytes) in font {
        register_font(FONT, style, bytes).map_err(|_| PlotError("its font cannot be read".to_owned()))?;
    }
    Ok(())
}

/// The radius of the ring around a point of the Pareto front.
const RING: i32 = 9;

pub(super) fn text(size: f64) -> TextStyle<'static> {
    TextStyle::from((FONT, size)).transform(FontTransform::None)
}

fn middle(point: &PlotPoint) -> (f64, f64) {
    (point.time_s.middle, point.error.middle)
}

fn has_place(point: &PlotPoint) -> bool {
    let place = middle(point);
    place.0.is_finite() && place.0 > 0.0 && place.1.is_finite() && place.1 > 0.0
}

/// Returns the ends of the two bars of a point, cut at the lower ends of the axes.
fn bars(point: &PlotPoint, floor: (f64, f64)) -> impl Iterator<Item = [(f64, f64); 2]> {
    let (x, y) = middle(point);
    let (time, error) = (point.time_s, point.error);
    [
        [(time.low.max(floor.0), y), (time.high, y)],
        [(x, error.low.max(floor.1)), (x, error.high)],
    ]
    .into_iter()
}

pub(super) fn colour(style: usize) -> RGBColor {
    PALETTE[style % PALETTE.len()]
}

/// Draws the mark of a style; the shape changes with the colour, and is another one in the second round of colours.
pub(super) fn mark(
    area: &plotters::drawing::DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    (x, y): (i32, i32),
    style: usize,
) -> Result<(), Box<dyn std::error::Error>> {
    let fill = colour(style).filled();
    let corners = |shape: &[(i32, i32)]| -> Vec<(i32, i32)> { shape.iter().map(|(dx, dy)| (x + dx, y + dy)).collect() };
    match (style + style / PALETTE.len()) % 5 {
        0 => area.draw(&Circle::new((x, y), 4, fill))?,
        1 => area.draw(&Rectangle::new([(x - 4, y - 4), (x + 4, y + 4)], fill))?,
        2 => area.draw(&Polygon::new(corners(&[(0, -5), (5, 4), (-5, 4)]), fill))?,
        3 => area.draw(&Polygon::new(corners(&[(0, -6), (6, 0), (0, 6), (-6, 0)]), fill))?,
        _ => area.draw(&Polygon::new(corners(&[(0, 5), (5, -4), (-5, -4)]), fill))?,
    }
    Ok(())
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::report::png_from_svg;

    fn exactly(middle: f64) -> Ranged {
        Ranged {
            middle,
            low: 0.5 * middle,
            high: 2.0 * middle,
        }
    }

    fn plot(errors: &[f64]) -> ErrorTimePlot {
        let point = |(k, &error): (usize, &f64)| PlotPoint {
            time_s: exactly(0.01 * (k + 1) as f64),
            error: exactly(error),
            on_front: k == 0,
        };
        ErrorTimePlot {
            title: "title".to_owned(),
            subtitle: "a < b & c".to_owned(),
            error_label: "error".to_owned(),
            series: vec![Series {
                name: "some-method".to_owned(),
                style: 9,
                points: errors.iter().enumerate().map(point).collect(),
            }],
            reference_error: Some(1e-9),
        }
    }

    #[test]
    fn every_point_is_marked_and_every_text_is_there() {
        let svg = plot(&[0.1, 1e-3, 1e-9]).to_svg().unwrap();
        for text in [
            "title",
            "a &lt; b &amp; c",
            "error",
            "some-method",
            "Pareto front",
            "run time (s)",
        ] {
            assert!(svg.contains(text), "{text}");
        }
        // Style 9 is a circle in the second round: three points and the legend; rings are outlines.
        assert_eq!(svg.matches("<circle").count(), 4 + 3 + 1);
        assert_eq!(svg, plot(&[0.1, 1e-3, 1e-9]).to_svg().unwrap());
        assert!(png_from_svg(&svg, 0.5).unwrap().starts_with(b"\x89PNG"));
    }

    #[test]
    fn what_has_no_logarithm_is_left_out() {
        let circles = |errors: &[f64]| plot(errors).to_svg().unwrap().matches("<circle").count();
        assert_eq!(circles(&[0.1, 0.0, f64::NAN, f64::INFINITY]), circles(&[0.1]));
        assert!(plot(&[]).to_svg().is_ok());
    }
}
