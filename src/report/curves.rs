//! Plots of curves as SVG, with linear or logarithmic axes: convergence histories, spectra, times by size.

use std::ops::Range;

use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::element::PathElement;

pub use super::frame::PlotError;
use super::frame::{self, Frame, axes, dashes, faint_line, line};
use super::log_axis::LogAxis;
use super::mark::mark;

/// A named line through points.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// The number of its colour and mark: equal numbers look alike in all plots, and the first 112 differ; from 7 on lines are thin.
    pub style: usize,
    /// Its points, from left to right.
    pub points: Vec<(f64, f64)>,
}

/// Several curves.
#[derive(Clone, Debug, PartialEq)]
pub struct CurvePlot {
    /// The heading.
    pub title: String,
    /// A line below the heading, with the quantity and the conditions.
    pub subtitle: String,
    /// The quantity on the horizontal axis.
    pub x_label: String,
    /// The quantity on the vertical axis.
    pub y_label: String,
    /// True if the horizontal axis is logarithmic.
    pub log_x: bool,
    /// True if the vertical axis is logarithmic.
    pub log_y: bool,
    /// True if every point is marked, false if only a few of each line are.
    pub marked: bool,
    /// The curves.
    pub curves: Vec<Curve>,
}

impl CurvePlot {
    /// Draws the plot; equal input gives equal bytes.
    ///
    /// Points that are not finite, or not positive on a logarithmic axis, are left out.
    ///
    /// # Errors
    /// [`PlotError`] if the drawing library fails.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let points = || self.curves.iter().flat_map(|curve| self.shown(curve));
        let (x, y) = (|| points().map(|p| p.0), || points().map(|p| p.1));
        let linear = |values: Range<f64>| RangedCoordf64::from(values);
        let description = format!("Each line shows {} against {}.", self.y_label, self.x_label);
        frame::to_svg(&self.title, &self.subtitle, &description, |frame| {
            match (self.log_x, self.log_y) {
                (true, true) => self.draw(frame, LogAxis::covering(x()), LogAxis::covering(y())),
                (true, false) => self.draw(frame, LogAxis::covering(x()), linear(covering(y()))),
                (false, true) => self.draw(frame, linear(covering(x())), LogAxis::covering(y())),
                (false, false) => self.draw(frame, linear(covering(x())), linear(covering(y()))),
            }
        })
    }

    /// Returns the points of a curve that have a place on the axes.
    fn shown<'a>(&'a self, curve: &'a Curve) -> impl Iterator<Item = (f64, f64)> + 'a {
        let has_place = |v: f64, log: bool| v.is_finite() && (!log || v > 0.0);
        let points = curve.points.iter().copied();
        points.filter(move |&(x, y)| has_place(x, self.log_x) && has_place(y, self.log_y))
    }

    fn draw<X, Y>(&self, frame: &mut Frame<'_>, x: X, y: Y) -> frame::DrawResult
    where
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let mut chart = axes(&frame.plot, (x, &self.x_label), (y, &self.y_label))?;
        for curve in &self.curves {
            let style = if self.marked { faint_line } else { line }(curve.style);
            let points: Vec<(f64, f64)> = self.shown(curve).collect();
            let places: Vec<(i32, i32)> = points.iter().map(|point| chart.backend_coord(point)).collect();
            let hints = places.iter().zip(&points).map(|(&place, (right, up))| {
                let hint = format!("{}: {} {right}, {} {up:.4e}", curve.name, self.x_label, self.y_label);
                (place, hint)
            });
            frame.notes.hints.extend(hints);
            chart.draw_series([PathElement::new(points, style)])?;
            // Lines through many points are marked at a few of them, which differ from line to line.
            let step = if self.marked { 1 } else { (places.len() / 6).max(1) };
            for place in places.into_iter().skip(curve.style % step).step_by(step) {
                mark(&frame.root, place, curve.style)?;
            }
            frame.notes.keys.push((curve.name.clone(), curve.style));
            frame.legend.entry(&curve.name, |area, place| {
                dashes(area, place, style, &[(-15, 15)])?;
                mark(area, place, curve.style)
            })?;
        }
        Ok(())
    }
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

    fn plot(log_x: bool, log_y: bool, marked: bool) -> CurvePlot {
        CurvePlot {
            title: "title".to_owned(),
            subtitle: "a < b".to_owned(),
            x_label: "steps".to_owned(),
            y_label: "residual".to_owned(),
            log_x,
            log_y,
            marked,
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
        }
    }

    #[test]
    fn curves_and_names_are_drawn_on_any_axes() {
        // Only a linear axis has a place for zero.
        for (log_x, log_y, n_shown) in [(false, false, 4), (false, true, 3), (true, false, 3), (true, true, 2)] {
            let svg = plot(log_x, log_y, false).to_svg().unwrap();
            for text in ["title", "a &lt; b", "steps", "residual", "some-solver", "none"] {
                assert!(svg.contains(text), "{text}");
            }
            let is_curve = |line: &&str| line.contains("<polyline") && line.contains("#D55E00");
            let curve = svg.lines().find(is_curve).unwrap();
            assert_eq!(curve.matches(',').count(), n_shown, "{curve}");
            assert_eq!(svg, plot(log_x, log_y, false).to_svg().unwrap());
        }
    }

    #[test]
    fn all_points_are_marked_where_that_is_asked_for_else_a_few() {
        // Style 1 is a square; the sheet and the legend have rectangles in both.
        let squares = |marked| {
            let mut plot = plot(true, true, marked);
            plot.curves[0].points = (1..=60).map(|k| (f64::from(k), f64::from(k))).collect();
            plot.to_svg().unwrap().matches("<rect").count()
        };
        assert_eq!(squares(true), squares(false) + 60 - 6);
    }
}
