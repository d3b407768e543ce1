//! An image against the analytic answer of the scene that it was made from.

mod clear_view;
mod points;
mod tolerance;

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use serde::Serialize;
use thiserror::Error;

use super::attributes::Attributes;
use super::direct::DirectMethod;
use super::error::RenderError;
use super::image::{Image, channel_names};
use super::unfolded::{Tile, Unfolded};
use super::view::ViewDescription;
use crate::geometry::polygon;
use crate::geometry::rectangle::rectangle_exchange_area;
use clear_view::Plate;
use points::{PixelAnswer, Reference};

/// The probability with which a correct image may fail.
const FALSE_ALARM: f64 = 1e-6;

/// Half the distance between two f32 of size 1: the rounding of an image layer, relative.
const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

/// How many expected hits a wall needs before its errors' own spread is trusted.
const MIN_HITS: f64 = 1000.0;

/// An image cannot be verified.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VerifyError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] RenderError),
    /// The irradiance in the image is interpolated between patches: it depends on the mesh, not on the scene alone.
    #[error(
        "the image has no direct pass, only values interpolated between patches, which no closed form describes; \
         render it with a direct pass and the unfolded camera to verify it"
    )]
    NoDirectPass,
    /// The image shows a camera's view.
    #[error("the image is a perspective view; render it with the unfolded camera to verify it")]
    NotUnfolded,
    /// A layer is missing.
    #[error("the image has no layer \"{0}\"")]
    MissingLayer(String),
    /// The description of the view does not fit the image or the scene.
    #[error("the image's description of its tiles does not fit it: {0}")]
    BadLayout(String),
    /// No surface has an exitance.
    #[error("no surface of the image's scene emits light: there is nothing to verify")]
    NoEmitter,
}

/// What verification found; see [`verify`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerifyReport {
    /// Whether everything that could be checked was right, and something could.
    pub passed: bool,
    /// Pixels that show a surface.
    pub n_pixels: usize,
    /// Pixels that were compared with the exact irradiance.
    pub n_checked: usize,
    /// Pixels on the border of a surface, or for which a clear view of all emitters could not be proven.
    pub n_not_checkable: usize,
    /// Checked pixels outside their tolerance.
    pub n_outside: usize,
    /// Pixels whose position `P` is not the point that the layout says.
    pub n_misplaced: usize,
    /// Pixels whose radiosity is not E + ρ H, whose radiance is not radiosity/π, or whose irradiance is not the direct one although nothing reflects.
    pub n_inconsistent: usize,
    /// The largest error of a checked pixel and channel, in W·m⁻².
    pub max_error: f64,
    /// The root of the mean squared error over checked pixels and channels, in W·m⁻².
    pub rms_error: f64,
    /// The tolerance and its parts.
    pub tolerance: Tolerance,
    /// One row per tile.
    pub walls: Vec<WallReport>,
}

/// The tolerance of a pixel: statistical + offset + rounding, each computed per pixel and channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tolerance {
    /// The probability with which a correct image may fail, all checks together.
    pub false_alarm: f64,
    /// Rays per pixel whose noise is allowed for; 0 where the image has none.
    pub n_rays: u64,
    /// What these rays are worth in independent samples; 0 where the image has none.
    pub n_effective: f64,
    /// The largest statistical part of a pixel's tolerance, in W·m⁻².
    pub max_statistical: f64,
    /// The largest part due to the rays' start above the surface, in W·m⁻²: the exact change of the answer over 1.1 offsets.
    pub max_offset: f64,
    /// The largest part due to rounding, in W·m⁻².
    pub max_rounding: f64,
}

/// One tile: its mean over all checked pixels.
///
/// The wall is right if |mean − expected| ≤ statistical + offset + rounding in every channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WallReport {
    /// The surface's name.
    pub name: String,
    /// Pixels of the tile that were compared.
    pub n_checked: usize,
    /// The mean direct irradiance in the image.
    pub mean: [f64; 3],
    /// The mean of the exact irradiance at the same points.
    pub expected: [f64; 3],
    /// The exact mean over the whole wall, where it is a rectangle that was checked everywhere, and the emitters are rectangles with parallel edges.
    pub exact: Option<[f64; 3]>,
    /// expected − exact: what pixel centres miss of the wall's mean.
    pub quadrature: Option<[f64; 3]>,
    /// mean − exact, or mean − expected where there is no `exact`.
    pub error: [f64; 3],
    /// The bound on `error`: statistical + offset + rounding + |quadrature|.
    pub tolerance: [f64; 3],
    /// The statistical part.
    pub statistical: [f64; 3],
    /// Whether the wall is right.
    pub passed: bool,
}

/// Verifies an EXR file: its direct irradiance, pixel by pixel and wall by wall, against the closed forms.
///
/// In the scene that the file describes, the direct irradiance at a point is Σ_j E_j F(x → j), F Lambert's
/// [form factor](crate::geometry::point_form_factor::point_form_factor), wherever the point sees every emitter j unhindered; this is proven per pixel in f64, and a pixel for which
/// it cannot be is counted and left out. The mean over a wall is also compared with Σ_j E_j A_i F_ij / A_i of the
/// [rectangles](crate::geometry::rectangle::rectangle_exchange_area). Beside that, positions must be those of the layout,
/// and radiosity and radiance those that follow from the irradiance.
///
/// Tolerances are computed: noise of a direct pass by rays (none for one by polygons) by Hoeffding's bound, at a probability of 1e-6 for any alarm at all in a correct image; for walls
/// also by the errors' own spread; the rays' start above the surface; rounding to f32.
///
/// # Errors
/// [`VerifyError`] if the file cannot be read, or was not rendered with the unfolded camera and a direct pass.
pub fn verify(path: &Path) -> Result<VerifyReport, VerifyError> {
    let (image, attributes) = super::exr::read(path)?;
    verify_image(&image, &attributes)
}

/// Verifies an image in memory; see [`verify`].
///
/// # Errors
/// As [`verify`], but for those of reading a file.
pub fn verify_image(image: &Image, attributes: &Attributes) -> Result<VerifyReport, VerifyError> {
    let ViewDescription::Unfolded(layout) = &attributes.view else {
        return Err(VerifyError::NotUnfolded);
    };
    check_layout(image, attributes, layout)?;
    let n_rays = match attributes.render.direct {
        DirectMethod::Off => return Err(VerifyError::NoDirectPass),
        DirectMethod::CosineRays { n } => n.get(),
        DirectMethod::Polygons { .. } => 0,
    };
    let reference = Reference::new(attributes, n_rays).ok_or(VerifyError::NoEmitter)?;
    let layers = Layers::new(image)?;

    let tiles: Vec<Vec<PixelAnswer>> = layout.tiles.iter().map(|tile| reference.answers(tile)).collect();
    let n_checks = tiles.iter().flatten().filter(|answer| answer.is_checked()).count() * 3;
    // One half of the false alarms for the pixels, one for the walls; two sides each.
    let log_odds = |n: usize| (4.0 * n.max(1) as f64 / FALSE_ALARM).ln();
    let (pixel_odds, wall_odds) = (log_odds(n_checks), log_odds(3 * tiles.len()));

    let mut tally = Tally::default();
    let mut walls = Vec::new();
    for (tile, answers) in layout.tiles.iter().zip(&tiles) {
        let judged: Vec<Judged> = answers
            .par_iter()
            .enumerate()
            .map(|(k, answer)| layers.judge(tile, k, answer, &reference, pixel_odds))
            .collect();
        judged.iter().for_each(|judged| tally.add(judged));
        walls.push(wall_report(tile, answers, &judged, &reference, wall_odds));
    }
    let (n_checked, n_values) = (tally.n_checked, tally.n_checked.max(1) * 3);
    let right = tally.n_outside + tally.n_misplaced + tally.n_inconsistent == 0 && walls.iter().all(|wall| wall.passed);
    Ok(VerifyReport {
        passed: right && n_checked > 0,
        n_pixels: tally.n_pixels,
        n_checked,
        n_not_checkable: tally.n_pixels - n_checked,
        n_outside: tally.n_outside,
        n_misplaced: tally.n_misplaced,
        n_inconsistent: tally.n_inconsistent,
        max_error: tally.max_error,
        rms_error: (tally.squares / n_values as f64).sqrt(),
        tolerance: Tolerance {
            false_alarm: FALSE_ALARM,
            n_rays: reference.n_rays(),
            n_effective: reference.n_effective(),
            max_statistical: tally.max_parts[0],
            max_offset: tally.max_parts[1],
            max_rounding: tally.max_parts[2],
        },
        walls,
    })
}

/// Checks that tiles lie inside the image and belong to surfaces of the scene.
fn check_layout(image: &Image, attributes: &Attributes, layout: &Unfolded) -> Result<(), VerifyError> {
    let bad = |reason: String| Err(VerifyError::BadLayout(reason));
    if (layout.width as usize, layout.height as usize) != (image.width(), image.height()) {
        return bad(format!("{} x {} pixels", layout.width, layout.height));
    }
    for tile in &layout.tiles {
        let (right, bottom) = (
            u64::from(tile.left) + u64::from(tile.width),
            u64::from(tile.top) + u64::from(tile.height),
        );
        if right > u64::from(layout.width) || bottom > u64::from(layout.height) {
            return bad(format!("the tile of {} lies outside the image", tile.name));
        }
        if tile.surface.0 as usize >= attributes.surfaces.len() {
            return bad(format!("{} is no surface of the scene", tile.name));
        }
    }
    let mut polygons = attributes.surfaces.iter().flat_map(|surface| &surface.polygons);
    if polygons.any(|record| record.corners.len() < 3) {
        return bad("a polygon has fewer than three corners".to_owned());
    }
    Ok(())
}

/// The layers that verification looks at.
struct Layers<'a> {
    width: usize,
    direct: [&'a [f32]; 3],
    irradiance: [&'a [f32]; 3],
    radiosity: [&'a [f32]; 3],
    radiance: [&'a [f32]; 3],
    position: [&'a [f32]; 3],
}

/// One pixel, judged.
#[derive(Clone, Copy, Debug, Default)]
struct Judged {
    on_surface: bool,
    checked: bool,
    outside: bool,
    misplaced: bool,
    inconsistent: bool,
    /// Image minus exact answer.
    error: [f64; 3],
    /// Statistical, offset, rounding.
    parts: [[f64; 3]; 3],
}

impl<'a> Layers<'a> {
    fn new(image: &'a Image) -> Result<Self, VerifyError> {
        let triple = |prefix: &str, suffixes: [char; 3]| -> Result<[&'a [f32]; 3], VerifyError> {
            let mut found: [&[f32]; 3] = [&[]; 3];
            for (layer, name) in found.iter_mut().zip(channel_names(prefix, suffixes)) {
                *layer = image.f32(&name).ok_or(VerifyError::MissingLayer(name))?;
            }
            Ok(found)
        };
        let rgb = ['R', 'G', 'B'];
        Ok(Self {
            width: image.width(),
            direct: triple("direct", rgb)?,
            irradiance: triple("irradiance", rgb)?,
            radiosity: triple("radiosity", rgb)?,
            radiance: triple("", rgb)?,
            position: triple("P", ['X', 'Y', 'Z'])?,
        })
    }

    fn judge(&self, tile: &Tile, k: usize, answer: &PixelAnswer, reference: &Reference<'_>, log_odds: f64) -> Judged {
        let columns = tile.width as usize;
        let (column, row) = (k % columns, k / columns);
        let index = (tile.top as usize + row) * self.width + tile.left as usize + column;
        let mut judged = Judged {
            on_surface: answer.on_surface(),
            checked: answer.is_checked(),
            ..Judged::default()
        };
        let Some(material) = answer.material() else {
            return judged;
        };
        let value = |layers: &[&[f32]; 3], c: usize| f64::from(layers[c][index]);
        let point = tile.point(
            f64::from(tile.left) + column as f64 + 0.5,
            f64::from(tile.top) + row as f64 + 0.5,
        );
        for c in 0..3 {
            let position = value(&self.position, c);
            judged.misplaced |= !close(position, point[c], reference.slack());
            let (h, b) = (value(&self.irradiance, c), value(&self.radiosity, c));
            if let Some((exitance, reflectance)) = material {
                judged.inconsistent |= !close(b, exitance[c] + reflectance[c] * h, 0.0);
            }
            judged.inconsistent |= !close(value(&self.radiance, c), b / std::f64::consts::PI, 0.0);
            judged.inconsistent |= reference.nothing_reflects() && !close(h, value(&self.direct, c), 0.0);
        }
        if let Some((exact, offset)) = answer.irradiance() {
            for c in 0..3 {
                judged.error[c] = value(&self.direct, c) - exact[c];
                judged.parts[0][c] = reference.statistical(c, exact[c], 1.0, log_odds);
                judged.parts[1][c] = offset[c].abs();
                judged.parts[2][c] = reference.rounding(c, exact[c]);
                let tolerance: f64 = judged.parts.iter().map(|part| part[c]).sum();
                // A value that is not a number is outside, too.
                judged.outside |= !(judged.error[c].abs() <= tolerance);
            }
        }
        judged
    }
}

/// Returns true if a layer's value is the given number after a few roundings to f32.
fn close(value: f64, exact: f64, slack: f64) -> bool {
    (value - exact).abs() <= 4.0 * ROUNDING * exact.abs() + slack + f64::from(f32::MIN_POSITIVE)
}

/// Sums over all pixels.
#[derive(Default)]
struct Tally {
    n_pixels: usize,
    n_checked: usize,
    n_outside: usize,
    n_misplaced: usize,
    n_inconsistent: usize,
    max_error: f64,
    squares: f64,
    max_parts: [f64; 3],
}

impl Tally {
    fn add(&mut self, pixel: &Judged) {
        self.n_pixels += usize::from(pixel.on_surface);
        self.n_checked += usize::from(pixel.checked);
        self.n_outside += usize::from(pixel.outside);
        self.n_misplaced += usize::from(pixel.misplaced);
        self.n_inconsistent += usize::from(pixel.inconsistent);
        for c in 0..3 {
            self.max_error = self.max_error.max(pixel.error[c].abs());
            self.squares += pixel.error[c] * pixel.error[c];
            for (max, part) in self.max_parts.iter_mut().zip(&pixel.parts) {
                *max = max.max(part[c]);
            }
        }
    }
}

fn wall_report(
    tile: &Tile,
    answers: &[PixelAnswer],
    judged: &[Judged],
    reference: &Reference<'_>,
    log_odds: f64,
) -> WallReport {
    let n_checked = judged.iter().filter(|pixel| pixel.checked).count();
    let m = n_checked.max(1) as f64;
    let whole = n_checked == answers.len();
    let exact = whole.then(|| exact_mean(tile, reference)).flatten();
    let mut wall = WallReport {
        name: tile.name.clone(),
        n_checked,
        mean: [0.0; 3],
        expected: [0.0; 3],
        exact,
        quadrature: None,
        error: [0.0; 3],
        tolerance: [0.0; 3],
        statistical: [0.0; 3],
        passed: true,
    };
    for c in 0..3 {
        let irradiance = answers.iter().filter_map(PixelAnswer::irradiance);
        let (expected, offset) = irradiance.fold((0.0, 0.0), |(sum, offsets), (exact, offset)| {
            (sum + exact[c] / m, offsets + offset[c] / m)
        });
        let checked = judged.iter().filter(|pixel| pixel.checked);
        let (error, squares, rounding) = checked.fold((0.0, 0.0, 0.0), |(error, squares, rounding), pixel| {
            let r = pixel.error[c];
            (error + r / m, squares + r * r, rounding + pixel.parts[2][c] / m)
        });
        let mut statistical = reference.statistical(c, expected, m, log_odds);
        if reference.expected_hits(c, expected) * m >= MIN_HITS {
            statistical = statistical.min(tolerance::self_normalised(squares, m, log_odds));
        }
        let tolerance = statistical + offset.abs() + rounding;
        let quadrature = exact.map_or(0.0, |exact| expected - exact[c]);
        wall.mean[c] = expected + error;
        wall.expected[c] = expected;
        wall.statistical[c] = statistical;
        wall.error[c] = error + quadrature;
        wall.tolerance[c] = tolerance + quadrature.abs();
        wall.passed &= error.abs() <= tolerance;
    }
    wall.quadrature = exact.map(|exact| std::array::from_fn(|c| wall.expected[c] - exact[c]));
    wall
}

/// Returns Σ_j E_j A F_j / A for a tile that its surface fills, or `None` where no closed form is known.
fn exact_mean(tile: &Tile, reference: &Reference<'_>) -> Option<[f64; 3]> {
    let rectangle = tile.rectangle();
    let area = polygon::area_vector(&rectangle).length();
    if (reference.surface_area(tile) - area).abs() > 1e-9 * area {
        return None;
    }
    let mut mean = [0.0; 3];
    for (Plate { corners, .. }, exitance) in reference.emitters() {
        let exchange_area = rectangle_exchange_area(&rectangle, corners)?;
        for (mean, exitance) in mean.iter_mut().zip(exitance) {
            *mean += exitance * exchange_area / area;
        }
    }
    Some(mean)
}

#[cfg(test)]
mod tests;
