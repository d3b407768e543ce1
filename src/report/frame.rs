//! The common parts of all plots: paper, heading, axes, legend.

use std::fmt::Write as _;

use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind};
use plotters::element::{PathElement, Text};
use plotters::prelude::{ChartBuilder, Color, IntoDrawingArea, RGBColor, SVGBackend, ShapeStyle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, FontTransform, IntoTextStyle, TextStyle, register_font};

use super::mark::{colour, line_width};
use super::paper::{Canvas, HEIGHT, Paper, WIDTH};

/// A plot could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the plot cannot be drawn: {0}")]
pub struct PlotError(String);

#[expect(clippy::needless_pass_by_value, reason = "it maps errors")]
fn failed(error: Box<dyn std::error::Error>) -> PlotError {
    PlotError(error.to_string())
}

/// The result of the drawing library.
pub(super) type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// A part of the paper.
pub(super) type Area<'a> = DrawingArea<Paper<'a>, Shift>;

/// The width of the legend.
const LEGEND: i32 = 200;
/// The distance between lines of the legend.
const LEGEND_STEP: i32 = 25;
const FONT: &str = "sans-serif";
const BLACK: RGBColor = RGBColor(0, 0, 0);
const WHITE: RGBColor = RGBColor(255, 255, 255);
pub(super) const GREY: RGBColor = RGBColor(110, 110, 110);

/// A sheet with its heading; the part below is for the plot and the legend.
pub(super) struct Frame<'a> {
    pub(super) root: Area<'a>,
    pub(super) plot: Area<'a>,
    pub(super) legend: Legend<'a>,
    pub(super) notes: Notes,
}

/// The parts of an SVG that are not drawn.
#[derive(Default)]
pub(super) struct Notes {
    /// Positions of points, with the text that a browser shows under the mouse.
    pub(super) hints: Vec<((i32, i32), String)>,
    /// The names in the plot, each with the number of its colour and mark.
    pub(super) keys: Vec<(String, usize)>,
}

/// The list of the plot's names, from top to bottom.
pub(super) struct Legend<'a> {
    area: Area<'a>,
    y: i32,
}

/// Makes an SVG of the drawing by `draw`, with the title and a sentence as its description; equal input gives equal bytes.
///
/// Text is laid out in DejaVu Sans.
pub(super) fn to_svg(
    title: &str,
    subtitle: &str,
    description: &str,
    draw: impl FnOnce(&mut Frame<'_>) -> DrawResult,
) -> Result<String, PlotError> {
    let mut svg = String::new();
    let paper = Paper::Svg(SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT)));
    let notes = on_paper(paper, title, subtitle, draw).map_err(failed)?;
    Ok(with_notes(&svg, &format!("{title}. {description}"), &notes))
}

/// Makes a PNG of the drawing by `draw`, with the layout of [`to_svg`], two pixels to its unit of length.
pub(super) fn to_png(
    title: &str,
    subtitle: &str,
    draw: impl FnOnce(&mut Frame<'_>) -> DrawResult,
) -> Result<Vec<u8>, PlotError> {
    let mut canvas = Canvas::new();
    on_paper(Paper::Pixels(&mut canvas), title, subtitle, draw).map_err(failed)?;
    canvas.to_png().map_err(|error| failed(error.into()))
}

/// Adds the description, the names as metadata in lines `STYLE NAME`, and an invisible circle for every point, above everything else.
///
/// The title of a circle is the text that a browser shows.
fn with_notes(svg: &str, description: &str, notes: &Notes) -> String {
    let escaped = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;");
    let body = svg.trim_end().trim_end_matches("</svg>");
    let (head, drawing) = body.split_at(body.find('>').map_or(0, |end| end + 1));
    let keys: Vec<String> = notes
        .keys
        .iter()
        .map(|(name, style)| format!("{style} {}", escaped(name)))
        .collect();
    let mut text = format!(
        "{head}\n<desc>{}</desc>\n<metadata>{}</metadata>{drawing}",
        escaped(description),
        keys.join("\n")
    );
    for ((x, y), hint) in &notes.hints {
        let hint = escaped(hint);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "<circle class=\"hover\" cx=\"{x}\" cy=\"{y}\" r=\"8\" fill-opacity=\"0\"><title>{hint}</title></circle>"
        );
    }
    text.push_str("</svg>\n");
    text
}

fn on_paper<'a>(
    paper: Paper<'a>,
    title: &str,
    subtitle: &str,
    draw: impl FnOnce(&mut Frame<'a>) -> DrawResult,
) -> Result<Notes, Box<dyn std::error::Error>> {
    register_fonts()?;
    let root = paper.into_drawing_area();
    root.fill(&WHITE)?;
    let heading = (FONT, 18.0, FontStyle::Bold).into_text_style(&root);
    root.draw(&Text::new(title.to_owned(), (24, 18), heading))?;
    root.draw(&Text::new(subtitle.to_owned(), (24, 44), text(13.0).color(&GREY)))?;
    let (_, below) = root.split_vertically(66);
    let (plot, legend) = below.split_horizontally(WIDTH.cast_signed() - LEGEND);
    let legend = Legend { area: legend, y: 16 };
    let mut frame = Frame {
        root,
        plot,
        legend,
        notes: Notes::default(),
    };
    draw(&mut frame)?;
    frame.root.present()?;
    Ok(frame.notes)
}

/// Draws axes with a mesh, and returns the chart to draw on.
pub(super) fn axes<'a, X, Y>(
    area: &Area<'a>,
    (x, x_label): (X, &str),
    (y, y_label): (Y, &str),
) -> Result<ChartContext<'a, Paper<'a>, Cartesian2d<X, Y>>, DrawingAreaErrorKind<std::io::Error>>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut chart = ChartBuilder::on(area)
        .margin_left(14)
        .margin_right(16)
        .margin_bottom(12)
        .x_label_area_size(54)
        .y_label_area_size(80)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .light_line_style(RGBColor(232, 232, 232).mix(0.6))
        .bold_line_style(RGBColor(200, 200, 200))
        .axis_style(GREY)
        .label_style(text(13.0))
        .axis_desc_style(text(15.0).color(&BLACK))
        .x_desc(x_label)
        .y_desc(y_label)
        .draw()?;
    Ok(chart)
}

impl<'a> Legend<'a> {
    /// Returns its part of the sheet.
    pub(super) fn area(&self) -> &Area<'a> {
        &self.area
    }

    /// Adds a line of text with its mark: `draw` receives the middle of a line 30 pixels long.
    pub(super) fn entry(&mut self, name: &str, draw: impl FnOnce(&Area<'_>, (i32, i32)) -> DrawResult) -> DrawResult {
        draw(&self.area, (19, self.y))?;
        let label = text(14.0).pos(Pos::new(HPos::Left, VPos::Center));
        self.area.draw(&Text::new(name.to_owned(), (44, self.y), label))?;
        self.y += LEGEND_STEP;
        Ok(())
    }

    /// Leaves a gap.
    pub(super) fn gap(&mut self) {
        self.y += LEGEND_STEP / 2;
    }
}

/// Draws horizontal lines from `from` to `to` pixels right of a position.
pub(super) fn dashes(area: &Area<'_>, (x, y): (i32, i32), style: ShapeStyle, parts: &[(i32, i32)]) -> DrawResult {
    for &(from, to) in parts {
        area.draw(&PathElement::new([(x + from, y), (x + to, y)], style))?;
    }
    Ok(())
}

/// Registers the font with the drawing library.
fn register_fonts() -> DrawResult {
    let font = [
        (FontStyle::Normal, dejavu::sans::regular()),
        (FontStyle::Bold, dejavu::sans::bold()),
    ];
    for (style, bytes) in font {
        register_font(FONT, style, bytes).map_err(|_| "its font cannot be read")?;
    }
    Ok(())
}

pub(super) fn text(size: f64) -> TextStyle<'static> {
    TextStyle::from((FONT, size)).transform(FontTransform::None)
}

/// Returns the line of a style, thinner in the second round of colours.
pub(super) fn line(style: usize) -> ShapeStyle {
    colour(style).stroke_width(line_width(style))
}

/// Returns the line between the marks of a style.
pub(super) fn faint_line(style: usize) -> ShapeStyle {
    colour(style).mix(0.55).stroke_width(1)
}
