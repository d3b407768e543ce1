//! View3D's input: vertices and surfaces (`F 3`), and surfaces by origin, azimuth and tilt (`F 3a`).
//!
//! Sources: the manual of View3D 3.3, sections 4 and 5.

use glam::DVec3;

use super::polygons::{FileMaterial, NONE, Names, Polygons};
use super::reader::{Head, Reader};
use super::source::Source;
use super::{Counts, LoadOptions};
use crate::geometry::polygon;
use crate::scene::{
    MAX_COORDINATE, Numbering, Origin, SceneError, SceneErrorKind, SceneWarning, SceneWarningKind, Written,
};

/// The gap between a mask and its base, as a part of the root of its area.
///
/// The format puts both in one plane, facing each other, which a scene does not allow.
const MASK_GAP: f64 = 1e-4;

/// The surface of obstructions without a name.
const OBSTRUCTIONS: &str = "obstructions";

/// The format.
pub(super) struct Vs3;

impl Reader for Vs3 {
    fn name(&self) -> &'static str {
        "vs3"
    }

    fn summary(&self) -> &'static str {
        "View3D input"
    }

    fn suffixes(&self) -> &'static [&'static str] {
        &["vs3"]
    }

    fn recognises(&self, head: &Head<'_>) -> bool {
        let mut lines = head.lines().filter(|line| !line.is_empty());
        let is_geometry = |line: &str| {
            let mut words = line.split_whitespace();
            let is_f = words.next().is_some_and(|word| word.eq_ignore_ascii_case("f"));
            is_f && words.next().is_some_and(|word| matches!(word, "3" | "3a" | "3A"))
                && words.next().is_none_or(|word| word.starts_with(['!', '/']))
        };
        lines.any(is_geometry)
    }

    fn read(&self, source: &Source<'_>, _options: &LoadOptions) -> Result<Polygons, SceneError> {
        let text = source.text()?;
        let n_lines = text.bytes().filter(|byte| *byte == b'\n').count() as u64 + 1;
        source.expect(Counts {
            vertices: 4 * n_lines,
            corners: 4 * n_lines,
            faces: n_lines,
        })?;
        let (lines, has_end) = content_lines(text);
        let mut file = InputFile {
            source,
            lines,
            has_end,
            at: 0,
            is_3a: None,
            vertices: Vec::new(),
            surfaces: Vec::new(),
            written: Written::new(),
            unknown: None,
        };
        file.parse()?;
        file.polygons()
    }
}

/// Returns the non-empty lines of the data, with numbers and without comments, and whether a line ends the data.
fn content_lines(text: &str) -> (Vec<(u32, &str)>, bool) {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let is_title = line.trim_start().starts_with(['T', 't']);
        let end = line.find(['!', '/']).filter(|_| !is_title).unwrap_or(line.len());
        let content = line[..end].trim();
        if content.starts_with(['*', 'E', 'e']) {
            return (lines, true);
        }
        if !content.is_empty() {
            lines.push((number, content));
        }
    }
    (lines, false)
}

/// The use of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Surface,
    Mask,
    Null,
    Obstruction,
}

struct Surface {
    line: u32,
    kind: Kind,
    corners: Vec<DVec3>,
    /// The number of the surface that it lies on, or 0.
    base: usize,
    /// The number of the surface that it is a part of, or 0.
    combined: usize,
    emissivity: f64,
    name: String,
}

struct InputFile<'a> {
    source: &'a Source<'a>,
    lines: Vec<(u32, &'a str)>,
    /// Whether a line ends the data.
    has_end: bool,
    at: usize,
    /// True for `F 3a`, false for `F 3`, `None` before the statement.
    is_3a: Option<bool>,
    vertices: Vec<DVec3>,
    surfaces: Vec<Surface>,
    written: Written,
    /// The first unknown line, and their number.
    unknown: Option<(u32, usize)>,
}

/// The words of an entry, which may continue on the next lines.
struct Words<'a> {
    line: u32,
    words: std::vec::IntoIter<&'a str>,
}

impl<'a> InputFile<'a> {
    fn error(&self, line: u32, kind: SceneErrorKind) -> SceneError {
        SceneError::new(Origin::line(&self.source.path, line), kind)
    }

    fn malformed(&self, line: u32, expected: &str, found: &str) -> SceneError {
        self.error(line, SceneErrorKind::malformed(expected, found))
    }

    fn next_line(&mut self) -> Option<Words<'a>> {
        let (line, text) = *self.lines.get(self.at)?;
        self.at += 1;
        let words: Vec<&str> = text.split_whitespace().collect();
        Some(Words {
            line,
            words: words.into_iter(),
        })
    }

    fn word(&self, words: &mut Words<'a>, expected: &str) -> Result<&'a str, SceneError> {
        words
            .words
            .next()
            .ok_or_else(|| self.malformed(words.line, expected, "the end of the line"))
    }

    fn number<T: std::str::FromStr>(&self, words: &mut Words<'a>, expected: &str) -> Result<T, SceneError> {
        let word = self.word(words, expected)?;
        word.parse().map_err(|_| self.malformed(words.line, expected, word))
    }

    /// Reads a length, and records its digits.
    fn length(&mut self, words: &mut Words<'a>) -> Result<f64, SceneError> {
        let word = self.word(words, "a coordinate")?;
        let value = word.parse::<f64>().ok().filter(|x| x.abs() <= MAX_COORDINATE);
        let value = value.ok_or_else(|| {
            let token = word.to_owned();
            self.error(words.line, SceneErrorKind::BadCoordinate { token })
        })?;
        self.written.see_value(word, value);
        Ok(value)
    }

    /// Expects the next number in a sequence from 1.
    fn in_sequence(&self, words: &mut Words<'a>, n_before: usize, what: &str) -> Result<(), SceneError> {
        let number: usize = self.number(words, what)?;
        if number == n_before + 1 {
            return Ok(());
        }
        let expected = format!("{what} {}", n_before + 1);
        Err(self.malformed(words.line, &expected, &number.to_string()))
    }

    fn parse(&mut self) -> Result<(), SceneError> {
        while let Some(mut words) = self.next_line() {
            let keyword = self.word(&mut words, "an entry")?;
            match keyword.as_bytes()[0].to_ascii_uppercase() {
                // A title, settings of the computation, and a transformation, which View3D does not read either.
                b'T' | b'C' | b'X' => {}
                b'F' => {
                    let format = self.word(&mut words, "`3` or `3a`")?;
                    self.is_3a = match format {
                        "3" => Some(false),
                        "3a" | "3A" => Some(true),
                        _ => return Err(self.malformed(words.line, "`3` or `3a`", format)),
                    };
                }
                b'V' => {
                    self.in_sequence(&mut words, self.vertices.len(), "vertex")?;
                    let position = [
                        self.length(&mut words)?,
                        self.length(&mut words)?,
                        self.length(&mut words)?,
                    ];
                    self.vertices.push(DVec3::from_array(position));
                }
                b'S' => self.surface(words, Kind::Surface)?,
                b'M' => self.surface(words, Kind::Mask)?,
                b'N' => self.surface(words, Kind::Null)?,
                b'O' => self.surface(words, Kind::Obstruction)?,
                _ => self.unknown = Some(self.unknown.map_or((words.line, 1), |(line, n)| (line, n + 1))),
            }
        }
        Ok(())
    }

    fn surface(&mut self, mut words: Words<'a>, kind: Kind) -> Result<(), SceneError> {
        let line = words.line;
        let Some(is_3a) = self.is_3a else {
            return Err(self.malformed(line, "a line `F 3` or `F 3a` before the surfaces", "none"));
        };
        self.in_sequence(&mut words, self.surfaces.len(), "surface")?;
        let shape = if is_3a {
            self.word(&mut words, "`R`, `Q` or `T`")?
        } else {
            ""
        };
        let mut corners = Vec::new();
        if !is_3a {
            for k in 0..4 {
                let number: usize = self.number(&mut words, "the number of a vertex, or 0")?;
                if k == 3 && number == 0 {
                    break;
                }
                let vertex = number.checked_sub(1).and_then(|place| self.vertices.get(place));
                corners.push(*vertex.ok_or_else(|| {
                    let index = i64::try_from(number).unwrap_or(i64::MAX);
                    let n_vertices = self.vertices.len();
                    self.error(line, SceneErrorKind::IndexOutOfRange { index, n_vertices })
                })?);
            }
        }
        // View3D reads no more words of an obstruction.
        let is_short = kind == Kind::Obstruction;
        let [base, combined] = if is_short && words.words.len() < 4 {
            [0, 0]
        } else {
            [
                self.number(&mut words, "the number of a base surface, or 0")?,
                self.number(&mut words, "the number of a surface to combine with, or 0")?,
            ]
        };
        let emissivity = if is_short && words.words.len() < 2 {
            1.0
        } else {
            self.number(&mut words, "an emissivity")?
        };
        let name = words.words.next().unwrap_or("").to_owned();
        if !(0.0..=1.0).contains(&emissivity) {
            return Err(self.malformed(line, "an emissivity in [0, 1]", &emissivity.to_string()));
        }
        for (number, what) in [(base, "base surface"), (combined, "surface to combine with")] {
            if number > self.surfaces.len() && !(what == "base surface" && kind == Kind::Surface) {
                let expected = format!("a {what} above this one");
                return Err(self.malformed(line, &expected, &number.to_string()));
            }
        }
        if matches!(kind, Kind::Mask | Kind::Null) && base == 0 {
            return Err(self.malformed(line, "the number of a base surface", "0"));
        }
        if is_3a {
            corners = self.outline(shape, line)?;
        }
        self.surfaces.push(Surface {
            line,
            kind,
            corners,
            base,
            combined,
            emissivity,
            name,
        });
        Ok(())
    }

    /// Reads the outline of a surface of `F 3a`: origin, azimuth, tilt, then width and height, or points in the plane.
    fn outline(&mut self, shape: &str, line: u32) -> Result<Vec<DVec3>, SceneError> {
        let n_numbers = match shape {
            "R" | "r" => 7,
            "T" | "t" => 11,
            "Q" | "q" => 13,
            _ => return Err(self.malformed(line, "`R`, `Q` or `T`", shape)),
        };
        let mut numbers = Vec::with_capacity(n_numbers);
        while numbers.len() < n_numbers {
            let Some(mut words) = self.next_line() else {
                return Err(self.malformed(line, "the numbers of the surface", "the end of the file"));
            };
            while words.words.len() > 0 && numbers.len() < n_numbers {
                let is_angle = matches!(numbers.len(), 3 | 4);
                numbers.push(if is_angle {
                    self.number(&mut words, "an angle")?
                } else {
                    self.length(&mut words)?
                });
            }
        }
        let origin = DVec3::new(numbers[0], numbers[1], numbers[2]);
        let (sin_azimuth, cos_azimuth) = sin_cos_of_degrees(numbers[3]);
        let (sin_tilt, cos_tilt) = sin_cos_of_degrees(numbers[4]);
        let along = DVec3::new(-cos_azimuth, sin_azimuth, 0.0);
        let up = DVec3::new(-cos_tilt * sin_azimuth, -cos_tilt * cos_azimuth, sin_tilt);
        let point = |x: f64, y: f64| origin + x * along + y * up;
        Ok(match numbers[5..] {
            [width, height] => vec![
                point(0.0, height),
                point(0.0, 0.0),
                point(width, 0.0),
                point(width, height),
            ],
            ref points => points.chunks_exact(2).map(|own| point(own[0], own[1])).collect(),
        })
    }

    fn polygons(self) -> Result<Polygons, SceneError> {
        let mut polygons = Polygons {
            numbering: Numbering::Lines,
            written: self.written,
            ..Polygons::default()
        };
        let mut names = Names::default();
        let mut groups = Vec::with_capacity(self.surfaces.len());
        let mut n_of_kind = [0; 4];
        for (k, surface) in self.surfaces.iter().enumerate() {
            n_of_kind[surface.kind as usize] += 1;
            let group = if surface.combined > 0 {
                groups[surface.combined - 1]
            } else {
                names.number(&self.name(k, &names))
            };
            groups.push(group);
            let mut corners = surface.corners.clone();
            match surface.kind {
                Kind::Mask => self.move_off(&mut corners, surface)?,
                // In the plane of its base it is cut out of the base.
                Kind::Null => corners.reverse(),
                Kind::Surface | Kind::Obstruction => {}
            }
            polygons.n_drawn += usize::from(surface.kind == Kind::Null || surface.base > 0);
            let first = u32::try_from(polygons.vertices.len()).unwrap_or(NONE - 4);
            polygons.vertices.extend(&corners);
            let material = material(&mut polygons.materials, surface, self.source);
            polygons.face((first..).take(corners.len()), group, material, surface.line);
        }
        polygons.groups = names.all;
        let [_, n_masks, n_null, n_obstructions] = n_of_kind;
        let black = |count, what| SceneWarningKind::BlackSurfaces { count, what };
        let kinds = [
            (
                n_masks,
                SceneWarningKind::MovedMasks {
                    count: n_masks,
                    relative: MASK_GAP,
                },
            ),
            (n_null, black(n_null, "null surfaces")),
            (n_obstructions, black(n_obstructions, "obstruction surfaces")),
        ];
        for (_, kind) in kinds.into_iter().filter(|(count, _)| *count > 0) {
            polygons
                .warnings
                .push(SceneWarning::new(Origin::file(&self.source.path), kind));
        }
        if !self.has_end {
            let at = Origin::file(&self.source.path);
            let kind = SceneWarningKind::NoEnd { end: "End of data" };
            polygons.warnings.push(SceneWarning::new(at, kind));
        }
        if let Some((line, count)) = self.unknown {
            let kind = SceneWarningKind::SkippedStatements {
                count,
                what: "unknown entries",
            };
            polygons
                .warnings
                .push(SceneWarning::new(Origin::line(&self.source.path, line), kind));
        }
        Ok(polygons)
    }

    /// Returns a unique name for a surface: each surface of the format stays one, even where names repeat.
    fn name(&self, k: usize, names: &Names) -> String {
        let surface = &self.surfaces[k];
        match (&*surface.name, surface.kind) {
            ("", Kind::Obstruction) => OBSTRUCTIONS.to_owned(),
            ("", _) => format!("surface{}", k + 1),
            (name, Kind::Obstruction) => name.to_owned(),
            (name, _) if names.has(name) => format!("{name}-{}", k + 1),
            (name, _) => name.to_owned(),
        }
    }

    /// Moves a mask off its base, in the direction that the base faces.
    fn move_off(&self, corners: &mut [DVec3], surface: &Surface) -> Result<(), SceneError> {
        let base = polygon::area_vector(&self.surfaces[surface.base - 1].corners);
        let own = polygon::area_vector(corners);
        if base.dot(own) >= 0.0 {
            return Err(self.malformed(surface.line, "a mask that faces its base", "one that does not"));
        }
        let step = MASK_GAP * own.length().sqrt() * base.normalize_or_zero();
        for corner in corners {
            *corner += step;
        }
        Ok(())
    }
}

/// Returns the material of a surface: grey, with reflectance 1 − ε; black for kinds without a result.
fn material(known: &mut Vec<FileMaterial>, surface: &Surface, source: &Source<'_>) -> u32 {
    let emissivity = match surface.kind {
        Kind::Surface | Kind::Mask => surface.emissivity,
        Kind::Null | Kind::Obstruction => 1.0,
    };
    let name = format!("emissivity {emissivity}");
    let place = known.iter().position(|material| material.name == name);
    let place = place.unwrap_or_else(|| {
        known.push(FileMaterial {
            name,
            reflectance: Some([1.0 - emissivity; 3]),
            exitance: [0.0; 3],
            exitance_keyword: "Ke",
            at: Origin::line(&source.path, surface.line),
            doubts: Vec::new(),
        });
        known.len() - 1
    });
    u32::try_from(place).unwrap_or(NONE)
}

/// Returns sine and cosine of an angle in degrees, exact for whole right angles.
fn sin_cos_of_degrees(degrees: f64) -> (f64, f64) {
    let quarter = (degrees / 90.0).round();
    let (sin, cos) = (degrees - 90.0 * quarter).to_radians().sin_cos();
    match quarter.rem_euclid(4.0) {
        q if q < 0.5 => (sin, cos),
        q if q < 1.5 => (cos, -sin),
        q if q < 2.5 => (-sin, -cos),
        _ => (-cos, sin),
    }
}
