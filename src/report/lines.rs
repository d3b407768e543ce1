//! Plots of lines as SVG, both axes logarithmic.

use plotters::element::{PathElement, Text};
use plotters::prelude::{ChartBuilder, Color, IntoDrawingArea, RGBColor, SVGBackend};
use plotters::style::IntoTextStyle;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::log_axis::LogAxis;
use super::plot::{FONT, GREY, HEIGHT, LEGEND, LIGHT, PlotError, WIDTH, colour, mark, register_fonts, text};

/// A plot of lines through marked points, such as residuals by passes.
#[derive(Clone, Debug, PartialEq)]
pub struct LinePlot {
    /// The heading.
    pub title: String,
    /// A line below the heading: what was measured how.
    pub subtitle: String,
    /// What the horizontal axis shows.
    pub x_label: String,
    /// What the vertical axis shows.
    pub y_label: String,
    /// The lines: a name for the legend, and points from left to right. Equal places in the list look alike in all plots.
    pub lines: Vec<(String, Vec<(f64, f64)>)>,
}

impl LinePlot {
    /// Draws the plot. Points that are not positive have no place on a logarithmic axis and are left out; equal input gives equal bytes.
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
        let title = (FONT, 18.0, plotters::style::FontStyle::Bold).into_text_style(&root);
        root.draw(&Text::new(self.title.clone(), (24, 18), title))?;
        root.draw(&Text::new(self.subtitle.clone(), (24, 44), text(13.0).color(&GREY)))?;
        let (_, below) = root.split_vertically(66);
        let (plot, legend) = below.split_horizontally(WIDTH - LEGEND);
        let usable = |line: &[(f64, f64)]| -> Vec<(f64, f64)> {
            let in_range = |v: f64| v.is_finite() && v > 0.0;
            line.iter()
                .copied()
                .filter(|&(x, y)| in_range(x) && in_range(y))
                .collect()
        };
        let all: Vec<(f64, f64)> = self.lines.iter().flat_map(|(_, line)| usable(line)).collect();
        let x_axis = LogAxis::covering(all.iter().map(|p| p.0));
        let y_axis = LogAxis::covering(all.iter().map(|p| p.1));
        let mut chart = ChartBuilder::on(&plot)
            .margin_left(14)
            .margin_right(16)
            .margin_bottom(12)
            .x_label_area_size(54)
            .y_label_area_size(80)
            .build_cartesian_2d(x_axis, y_axis)?;
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
        let label = text(14.0).pos(Pos::new(HPos::Left, VPos::Center));
        for (style, (name, line)) in self.lines.iter().enumerate() {
            let points = usable(line);
            let stroke = colour(style).mix(0.55).stroke_width(1);
            chart.draw_series([PathElement::new(points.clone(), stroke)])?;
            for point in points {
                let place = chart.backend_coord(&point);
                mark(&root, place, style)?;
            }
            let y = 16 + 25 * i32::try_from(style)?;
            legend.draw(&PathElement::new([(4, y), (34, y)], stroke))?;
            mark(&legend, (19, y), style)?;
            legend.draw(&Text::new(name.clone(), (44, y), label.clone()))?;
        }
        root.present()?;
        Ok(())
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn every_point_with_a_logarithm_is_marked() {
        let plot = LinePlot {
            title: "title".to_owned(),
            subtitle: "a < b".to_owned(),
            x_label: "passes".to_owned(),
            y_label: "residual".to_owned(),
            lines: vec![(
                "some".to_owned(),
                vec![(1.0, 1e-2), (2.0, 1e-4), (0.0, 1.0), (3.0, f64::NAN)],
            )],
        };
        let svg = plot.to_svg().unwrap();
        assert!(
            ["title", "a &lt; b", "passes", "residual", "some"]
                .iter()
                .all(|text| svg.contains(text))
        );
        // Two points and the legend.
        assert_eq!(svg.matches("<circle").count(), 3);
        assert_eq!(svg, plot.to_svg().unwrap());
    }
}
