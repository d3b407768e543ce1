//! Plots of error against run time as SVG and PNG, with logarithmic axes.

use plotters::element::{Circle, EmptyElement, PathElement};
use plotters::prelude::Color;

pub use super::frame::PlotError;
use super::frame::{self, Area, DrawResult, Frame, GREY, axes, dashes, faint_line};
use super::log_axis::LogAxis;
use super::mark::{colour, mark};

/// A measured value with the range of repeated measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranged {
    /// The marked value: the median.
    pub middle: f64,
    /// The least measured value.
    pub low: f64,
    /// The greatest measured value.
    pub high: f64,
}

impl Ranged {
    /// Returns a value of a single measurement.
    #[must_use]
    pub fn exactly(value: f64) -> Self {
        Self {
            middle: value,
            low: value,
            high: value,
        }
    }

    fn has_range(&self) -> bool {
        self.low < self.high
    }
}

/// One setting of a method.
#[derive(Clone, Debug, PartialEq)]
pub struct PlotPoint {
    /// The setting in words, which a browser shows under the mouse.
    pub setting: String,
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
    /// A line below the heading, with the quantity and the conditions.
    pub subtitle: String,
    /// The name of the error.
    pub error_label: String,
    /// The methods.
    pub series: Vec<Series>,
    /// True if the points of a method are settings of one problem, joined by a line; false if each is a problem of its own.
    pub joined: bool,
    /// The error of the reference, drawn as a line.
    pub reference_error: Option<f64>,
}

/// The radius of the ring around a point of the Pareto front.
const RING: i32 = 9;

impl ErrorTimePlot {
    /// Draws the plot: bars span the least and the greatest measurement, rings and the dashed line mark the Pareto front.
    ///
    /// Values that are not positive have no place on a logarithmic axis: a point without a positive middle is left out, and a bar ends at the axis.
    /// The legend explains bars, rings and lines if there are any. Equal input gives equal bytes.
    ///
    /// # Errors
    /// [`PlotError`] if the drawing library fails.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let description = format!(
            "Each point is one {} of a method: its {} against its run time. Lower left is better{}.",
            if self.joined { "setting" } else { "case" },
            self.error_label,
            if self.points().any(|point| point.on_front) {
                "; rings mark the Pareto front"
            } else {
                ""
            }
        );
        frame::to_svg(&self.title, &self.subtitle, &description, |frame| self.draw(frame))
    }

    /// Draws the plot as a PNG, two pixels to the unit of length of the SVG.
    ///
    /// # Errors
    /// [`PlotError`] if the drawing library fails.
    pub fn to_png(&self) -> Result<Vec<u8>, PlotError> {
        frame::to_png(&self.title, &self.subtitle, |frame| self.draw(frame))
    }

    /// Returns all points that have a place on the axes.
    fn points(&self) -> impl Iterator<Item = &PlotPoint> {
        self.series.iter().flat_map(|s| &s.points).filter(|p| has_place(p))
    }

    fn draw(&self, frame: &mut Frame<'_>) -> DrawResult {
        let extent = |value: Ranged| [value.low, value.middle, value.high];
        let times = LogAxis::covering(self.points().flat_map(|p| extent(p.time_s)));
        let errors = LogAxis::covering(self.points().flat_map(|p| extent(p.error)));
        let floor = (times.low(), errors.low());
        let reference_error = self.reference_error.filter(|e| *e > floor.1);
        let end = plotters::coord::ranged1d::Ranged::range(&times).end;
        let mut chart = axes(&frame.plot, (times, "run time (s)"), (errors, &self.error_label))?;
        if let Some(error) = reference_error {
            let ends = [(floor.0, error), (end, error)];
            chart.draw_series([PathElement::new(ends, GREY.stroke_width(1))])?;
        }
        let mut best: Vec<(f64, f64)> = self.points().filter(|p| p.on_front).map(middle).collect();
        best.sort_by(|a, b| a.0.total_cmp(&b.0));
        // The front is a staircase: more time is needed before the error decreases.
        let steps = best.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1)]);
        let front: Vec<(f64, f64)> = steps.chain(best.last().copied()).collect();
        let front = plotters::series::DashedLineSeries::new(front, 7, 5, GREY.stroke_width(2));
        chart.draw_series(front)?;
        for series in &self.series {
            let shown: Vec<&PlotPoint> = series.points.iter().filter(|p| has_place(p)).collect();
            if self.joined {
                let line: Vec<(f64, f64)> = shown.iter().map(|p| middle(p)).collect();
                chart.draw_series([PathElement::new(line, faint_line(series.style))])?;
            }
            for point in shown {
                let stroke = colour(series.style).stroke_width(1);
                chart.draw_series(bars(point, floor).map(|ends| PathElement::new(ends, stroke)))?;
                if point.on_front {
                    let ring = Circle::new((0, 0), RING, GREY.stroke_width(2));
                    chart.draw_series([EmptyElement::at(middle(point)) + ring])?;
                }
                let place = chart.backend_coord(&middle(point));
                mark(&frame.root, place, series.style)?;
                let (time, error) = (shown_value(point.time_s), shown_value(point.error));
                let hint = format!("{}, {}: {time} s, error {error}", series.name, point.setting);
                frame.notes.hints.push((place, hint));
            }
        }
        self.draw_legend(frame, reference_error.is_some())
    }

    fn draw_legend(&self, frame: &mut Frame<'_>, has_reference: bool) -> DrawResult {
        for series in &self.series {
            frame.notes.keys.push((series.name.clone(), series.style));
            frame.legend.entry(&series.name, |area, place| {
                if self.joined {
                    dashes(area, place, faint_line(series.style), &[(-15, 15)])?;
                }
                mark(area, place, series.style)
            })?;
        }
        frame.legend.gap();
        let whole = &[(-15, 15)];
        if self.points().any(|p| p.on_front) {
            frame.legend.entry("Pareto front", |area: &Area<'_>, place| {
                dashes(area, place, GREY.stroke_width(2), &[(-15, -8), (8, 15)])?;
                Ok(area.draw(&Circle::new(place, RING, GREY.stroke_width(2)))?)
            })?;
        }
        if has_reference {
            let draw = |area: &Area<'_>, place| dashes(area, place, GREY.stroke_width(1), whole);
            frame.legend.entry("reference's error", draw)?;
        }
        if self.points().any(|p| p.time_s.has_range() || p.error.has_range()) {
            frame.legend.entry("least to greatest", |area: &Area<'_>, (x, y)| {
                dashes(area, (x, y), GREY.stroke_width(1), &[(-10, 10)])?;
                let upright = [(x, y - 8), (x, y + 8)];
                Ok(area.draw(&PathElement::new(upright, GREY.stroke_width(1)))?)
            })?;
        }
        Ok(())
    }
}

/// Returns the value as text, with its range if there is one.
fn shown_value(value: Ranged) -> String {
    let Ranged { middle, low, high } = value;
    if value.has_range() {
        format!("{middle:.3e} ({low:.3e} to {high:.3e})")
    } else {
        format!("{middle:.3e}")
    }
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

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    fn about(middle: f64) -> Ranged {
        Ranged {
            middle,
            low: 0.5 * middle,
            high: 2.0 * middle,
        }
    }

    fn plot(errors: &[f64]) -> ErrorTimePlot {
        let point = |(k, &error): (usize, &f64)| PlotPoint {
            setting: format!("{k} < {error}"),
            time_s: about(0.01 * (k + 1) as f64),
            error: about(error),
            on_front: k == 0,
        };
        ErrorTimePlot {
            title: "title".to_owned(),
            subtitle: "a < b & c".to_owned(),
            error_label: "error".to_owned(),
            series: vec![Series {
                name: "some-method".to_owned(),
                style: 7,
                points: errors.iter().enumerate().map(point).collect(),
            }],
            joined: true,
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
        // Style 7 is a ring: three points and the legend; the first point is on the front, all have hints.
        assert_eq!(svg.matches("<circle").count(), 3 + 1 + 1 + 1 + 3);
        assert!(
            svg.contains("some-method, 1 &lt; 0.001: 2.000e-2 (1.000e-2 to 4.000e-2) s, error 1.000e-3"),
            "{svg}"
        );
        assert_eq!(svg, plot(&[0.1, 1e-3, 1e-9]).to_svg().unwrap());
    }

    #[test]
    fn the_pixels_show_the_texts_and_marks_of_the_drawing() {
        let pixels = |of: &ErrorTimePlot| {
            let bytes = of.to_png().unwrap();
            assert_eq!(bytes, of.to_png().unwrap());
            let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
            let mut decoded = vec![0; reader.output_buffer_size().unwrap()];
            let info = reader.next_frame(&mut decoded).unwrap();
            assert_eq!((info.width, info.height), (1920, 1200));
            decoded
        };
        // Dark pixels of the heading's band, twice 10 to 40 from the top.
        let dark = |image: &[u8]| {
            let band = image.chunks_exact(3).skip(1920 * 20).take(1920 * 60);
            band.filter(|p| p.iter().all(|&c| c < 100)).count()
        };
        let mut shown = plot(&[0.1, 1e-3]);
        let with_title = pixels(&shown);
        // The mark of style 1 is a square of 8 × 8 units: one for each of two points, and one in the legend.
        shown.series[0].style = 1;
        for point in &mut shown.series[0].points {
            point.time_s = Ranged::exactly(point.time_s.middle);
            point.error = Ranged::exactly(point.error.middle);
        }
        let of_style = |image: &[u8]| image.chunks_exact(3).filter(|p| *p == [213, 94, 0]).count();
        assert_eq!(of_style(&pixels(&shown)), 3 * 16 * 16);
        assert_eq!(of_style(&with_title), 0);
        shown.title = String::new();
        assert!(dark(&with_title) > 100);
        assert_eq!(dark(&pixels(&shown)), 0);
    }

    #[test]
    fn the_legend_explains_only_what_is_drawn() {
        let mut single = plot(&[0.1, 1e-3]);
        for point in &mut single.series[0].points {
            point.time_s = Ranged::exactly(point.time_s.middle);
            point.error = Ranged::exactly(point.error.middle);
            point.on_front = false;
        }
        let (single, ranged) = (single.to_svg().unwrap(), plot(&[0.1, 1e-3]).to_svg().unwrap());
        for text in ["Pareto front", "least to greatest"] {
            assert!(ranged.contains(text) && !single.contains(text), "{text}");
        }
    }

    #[test]
    fn no_line_joins_problems() {
        let mut cases = plot(&[0.1, 1e-3]);
        let lines = |of: &ErrorTimePlot| of.to_svg().unwrap().matches("<polyline").count();
        let joined = lines(&cases);
        cases.joined = false;
        // The line through the points, and that of the legend.
        assert_eq!(lines(&cases), joined - 2);
        assert!(
            cases
                .to_svg()
                .unwrap()
                .contains("<desc>title. Each point is one case of")
        );
    }

    #[test]
    fn what_has_no_logarithm_is_left_out() {
        let circles = |errors: &[f64]| plot(errors).to_svg().unwrap().matches("<circle").count();
        assert_eq!(circles(&[0.1, 0.0, f64::NAN, f64::INFINITY]), circles(&[0.1]));
        assert!(plot(&[]).to_svg().is_ok());
    }
}
