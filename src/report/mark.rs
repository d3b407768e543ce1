//! Colours and marks: each number has one pair of them, in every plot and table.

use std::fmt::Write as _;

use plotters::element::{Circle, PathElement, Polygon, Rectangle};
use plotters::prelude::{Color, RGBColor};

use super::frame::{Area, DrawResult};

/// Colours that people with any colour vision can distinguish (M. Okabe and K. Ito, "Color Universal Design", 2008), without the yellow,
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

type Corners = &'static [(i32, i32)];

/// A shape around a point, in pixels.
enum Shape {
    Disc,
    Ring,
    Square,
    Filled(Corners),
    Outline(Corners),
    Strokes(&'static [Corners]),
}

const SQUARE: Corners = &[(-4, -4), (4, -4), (4, 4), (-4, 4)];
const UP: Corners = &[(0, -5), (5, 4), (-5, 4)];
const DOWN: Corners = &[(0, 5), (5, -4), (-5, -4)];
const DIAMOND: Corners = &[(0, -6), (6, 0), (0, 6), (-6, 0)];
const STAR: Corners = &[
    (0, -7),
    (2, -2),
    (7, -2),
    (3, 1),
    (4, 6),
    (0, 3),
    (-4, 6),
    (-3, 1),
    (-7, -2),
    (-2, -2),
];

const HOURGLASS: Corners = &[(-5, -5), (5, -5), (-5, 5), (5, 5)];

/// The shapes, one for each method or solver of a page; their number and that of the colours have no common factor, so 112 pairs differ.
const SHAPES: [Shape; 16] = [
    Shape::Disc,
    Shape::Square,
    Shape::Filled(UP),
    Shape::Filled(DIAMOND),
    Shape::Filled(DOWN),
    Shape::Strokes(&[&[(-5, 0), (5, 0)], &[(0, -5), (0, 5)]]),
    Shape::Strokes(&[&[(-4, -4), (4, 4)], &[(-4, 4), (4, -4)]]),
    Shape::Ring,
    Shape::Outline(SQUARE),
    Shape::Outline(UP),
    Shape::Outline(DIAMOND),
    Shape::Outline(DOWN),
    Shape::Filled(STAR),
    Shape::Outline(STAR),
    Shape::Filled(HOURGLASS),
    Shape::Strokes(&[&[(0, -6), (0, 6)], &[(-5, -3), (5, 3)], &[(-5, 3), (5, -3)]]),
];

/// The width of the lines of a shape.
const STROKE: u32 = 2;
const RADIUS: i32 = 4;

/// Returns the colour of a style.
pub(super) fn colour(style: usize) -> RGBColor {
    PALETTE[style % PALETTE.len()]
}

/// Returns the width of the line of a style, smaller in the second round of colours.
pub(super) fn line_width(style: usize) -> u32 {
    if style < PALETTE.len() { 2 } else { 1 }
}

/// Draws the mark of a style.
pub(super) fn mark(area: &Area<'_>, (x, y): (i32, i32), style: usize) -> DrawResult {
    let colour = colour(style);
    let at = |corners: Corners| -> Vec<(i32, i32)> { corners.iter().map(|(dx, dy)| (x + dx, y + dy)).collect() };
    match SHAPES[style % SHAPES.len()] {
        Shape::Disc => area.draw(&Circle::new((x, y), RADIUS, colour.filled()))?,
        Shape::Ring => area.draw(&Circle::new((x, y), RADIUS, colour.stroke_width(STROKE)))?,
        Shape::Square => area.draw(&Rectangle::new([(x - 4, y - 4), (x + 4, y + 4)], colour.filled()))?,
        Shape::Filled(corners) => area.draw(&Polygon::new(at(corners), colour.filled()))?,
        Shape::Outline(corners) => {
            let mut closed = at(corners);
            closed.extend(closed.first().copied());
            area.draw(&PathElement::new(closed, colour.stroke_width(STROKE)))?;
        }
        Shape::Strokes(lines) => {
            for line in lines {
                area.draw(&PathElement::new(at(line), colour.stroke_width(STROKE)))?;
            }
        }
    }
    Ok(())
}

/// Returns the mark of a style as a small drawing within a line of HTML.
pub(super) fn inline(style: usize) -> String {
    let RGBColor(r, g, b) = colour(style);
    let colour = format!("#{r:02X}{g:02X}{b:02X}");
    let stroke = format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"{STROKE}\"");
    let points = |corners: Corners| -> String {
        let pairs: Vec<String> = corners.iter().map(|(x, y)| format!("{x},{y}")).collect();
        pairs.join(" ")
    };
    let shape = match SHAPES[style % SHAPES.len()] {
        Shape::Disc => format!("<circle r=\"{RADIUS}\" fill=\"{colour}\"/>"),
        Shape::Ring => format!("<circle r=\"{RADIUS}\" {stroke}/>"),
        Shape::Square => format!("<polygon points=\"{}\" fill=\"{colour}\"/>", points(SQUARE)),
        Shape::Filled(corners) => format!("<polygon points=\"{}\" fill=\"{colour}\"/>", points(corners)),
        Shape::Outline(corners) => format!("<polygon points=\"{}\" {stroke}/>", points(corners)),
        Shape::Strokes(lines) => lines.iter().fold(String::new(), |mut all, line| {
            // Writing to a String cannot fail.
            let _ = write!(all, "<polyline points=\"{}\" {stroke}/>", points(line));
            all
        }),
    };
    format!("<svg class=\"mark\" viewBox=\"-8 -8 16 16\" width=\"16\" height=\"16\" aria-hidden=\"true\">{shape}</svg>")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn no_two_methods_or_solvers_look_alike() {
        let marks: BTreeSet<String> = (0..112).map(inline).collect();
        assert_eq!(marks.len(), 112);
        // Even without their colours, the first sixteen differ.
        let shapes = (0..SHAPES.len()).map(|style| {
            let RGBColor(r, g, b) = colour(style);
            inline(style).replace(&format!("#{r:02X}{g:02X}{b:02X}"), "")
        });
        assert_eq!(shapes.collect::<BTreeSet<_>>().len(), 16);
        assert_eq!(inline(0), inline(112));
    }
}
