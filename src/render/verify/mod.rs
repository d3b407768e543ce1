//! An image against the analytic answer of the scene that it was made from.

mod clear_view;
mod field;
mod neighbours;
mod points;
mod report;
mod tolerance;

use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use thiserror::Error;

use super::attributes::Attributes;
use super::direct::DirectMethod;
use super::error::RenderError;
use super::exr::Pixels;
use super::image::{Image, channel_names};
use super::unfolded::{Tile, Unfolded};
use super::view::ViewDescription;
use crate::geometry::polygon;
use points::{PixelAnswer, Reference};
pub use report::{Tolerance, VerifyReport, WallReport};

/// The probability with which a correct image may fail.
const FALSE_ALARM: f64 = 1e-6;

/// How far a layer's number may be off by being rounded.
#[derive(Clone, Copy, Debug)]
struct Rounding {
    /// Half the distance between two numbers of size 1.
    relative: f64,
    /// Half the distance between numbers near 0, or more.
    absolute: f64,
}

impl Rounding {
    const F32: Self = Self {
        relative: 1.0 / (1 << 24) as f64,
        absolute: f32::MIN_POSITIVE as f64,
    };
    /// 11 bits, and steps of 2^−24 near 0.
    const F16: Self = Self {
        relative: 1.0 / (1 << 11) as f64,
        absolute: 1.0 / (1 << 25) as f64,
    };

    fn of(pixels: Pixels) -> Self {
        match pixels {
            Pixels::F32 => Self::F32,
            Pixels::F16 => Self::F16,
        }
    }

    /// Returns true if a layer's value is the given number after a few roundings.
    fn allows(self, value: f64, exact: f64, slack: f64) -> bool {
        (value - exact).abs() <= 4.0 * (self.relative * exact.abs() + self.absolute) + slack
    }
}

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
    /// The surface of a field is none of the scene's.
    #[error("the form factors are to \"{0}\", which is no surface of the image's scene")]
    NoSuchSurface(String),
    /// No surface has an exitance.
    #[error("no surface of the image's scene emits light: there is nothing to verify")]
    NoEmitter,
}

/// Verifies an EXR file: its direct irradiance, pixel by pixel and wall by wall, against the closed forms.
///
/// In the scene that the file describes, the direct irradiance at a point is Σ_j E_j F(x → j), F Lambert's
/// [form factor](crate::geometry::point_form_factor::point_form_factor), wherever the point sees every emitter j unhindered; this is proven per pixel in f64. Where it
/// cannot be, j is [clipped](crate::form_factor::partial::VisibleFactor) against what stands in between, if the image's method is unbiased there (rays, exact); else the pixel
/// is counted and left out. A [field](super::field()) of form factors is the irradiance in the scene in which its surface alone emits, 1 W·m⁻². The means over a tile's rows and columns are compared as well, where noise hides more of a pixel; that over a wall is also compared with Σ_j E_j A_i F_ij / A_i of the
/// [rectangles](crate::geometry::rectangle::rectangle_exchange_area), or of the [integration](crate::form_factor::partial::exchange_area) to 1e-10 where something stands between them. Beside that, positions must be those of the layout,
/// and radiosity and radiance those that follow from the irradiance.
///
/// Tolerances are computed: noise of a direct pass by rays (none for one by polygons) by Hoeffding's bound, at a probability of 1e-6 for any alarm at all in a correct image; for means
/// also by the errors' own spread, and for a pixel by that of its 24 neighbours (12 times their root mean square), where these are narrower; the rays' start above the surface; rounding to f32.
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
    let lit = attributes
        .field
        .as_ref()
        .map(|record| field::lit_by(attributes, record))
        .transpose()?;
    let attributes = lit.as_ref().unwrap_or(attributes);
    let ViewDescription::Unfolded(layout) = &attributes.view else {
        return Err(VerifyError::NotUnfolded);
    };
    check_layout(image, attributes, layout)?;
    let n_rays = match attributes.render.direct {
        DirectMethod::Off => return Err(VerifyError::NoDirectPass),
        DirectMethod::CosineRays { n } => n.get(),
        DirectMethod::Polygons { .. } | DirectMethod::Exact => 0,
    };
    let reference = Reference::new(attributes, n_rays).ok_or(VerifyError::NoEmitter)?;
    let layers = if attributes.field.is_some() {
        Layers::of_field(image)?
    } else {
        Layers::new(image)?
    };

    let tiles: Vec<Vec<PixelAnswer>> = layout.tiles.iter().map(|tile| reference.answers(tile)).collect();
    let n_checks = tiles.iter().flatten().filter(|answer| answer.is_checked()).count() * 3;
    let n_strips: usize = layout
        .tiles
        .iter()
        .map(|tile| tile.width as usize + tile.height as usize)
        .sum();
    // One third of the false alarms each for pixels, strips and walls; two sides, and two bounds on every mean.
    let log_odds = |n: usize| (12.0 * n.max(1) as f64 / FALSE_ALARM).ln();
    let [pixel_odds, strip_odds, wall_odds] = [n_checks, 3 * n_strips, 3 * tiles.len()].map(log_odds);

    let mut tally = Tally::default();
    let (mut walls, mut n_strips_outside) = (Vec::new(), 0);
    for (tile, answers) in layout.tiles.iter().zip(&tiles) {
        let mut judged: Vec<Judged> = answers
            .par_iter()
            .enumerate()
            .map(|(k, answer)| layers.judge(tile, k, answer, &reference, pixel_odds))
            .collect();
        neighbours::narrow(tile, answers, &mut judged, &reference);
        for (answer, pixel) in answers.iter().zip(&judged) {
            tally.add(answer, pixel);
        }
        n_strips_outside += count_wrong_strips(tile, answers, &judged, &reference, strip_odds);
        walls.push(wall_report(tile, answers, &judged, &reference, wall_odds));
    }
    let (n_checked, n_values) = (tally.n_checked, tally.n_checked.max(1) * 3);
    let n_wrong = tally.n_outside + n_strips_outside + tally.n_misplaced + tally.n_inconsistent;
    let right = attributes.scene_intact && n_wrong == 0 && walls.iter().all(|wall| wall.passed);
    Ok(VerifyReport {
        field: attributes.field.as_ref().map(|record| record.surface.clone()),
        passed: right && n_checked > 0,
        scene_intact: attributes.scene_intact,
        n_pixels: tally.n_pixels,
        n_checked,
        n_not_checkable: tally.n_pixels - n_checked,
        n_outside: tally.n_outside,
        n_strips_outside,
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
    /// Irradiance, radiosity and radiance, where the image has them.
    light: Option<[[&'a [f32]; 3]; 3]>,
    position: [&'a [f32]; 3],
}

/// One pixel, judged.
#[derive(Clone, Copy, Debug, Default)]
struct Judged {
    outside: bool,
    misplaced: bool,
    inconsistent: bool,
    /// Image minus exact answer.
    error: [f64; 3],
    /// Statistical, offset, rounding.
    parts: [[f64; 3]; 3],
}

impl Judged {
    /// Returns whether a channel's error is within its tolerance; NaN is not.
    fn is_within(&self, channel: usize) -> bool {
        let tolerance: f64 = self.parts.iter().map(|part| part[channel]).sum();
        self.error[channel].abs() <= tolerance
    }
}

impl<'a> Layers<'a> {
    fn new(image: &'a Image) -> Result<Self, VerifyError> {
        let rgb = |prefix| triple(image, channel_names(prefix, ['R', 'G', 'B']));
        Ok(Self {
            width: image.width(),
            direct: rgb("direct")?,
            light: Some([rgb("irradiance")?, rgb("radiosity")?, rgb("")?]),
            position: position(image)?,
        })
    }

    /// The layers of a field of form factors: one channel stands for all three.
    fn of_field(image: &'a Image) -> Result<Self, VerifyError> {
        Ok(Self {
            width: image.width(),
            direct: triple(image, ["Y"; 3].map(str::to_owned))?,
            light: None,
            position: position(image)?,
        })
    }

    fn judge(&self, tile: &Tile, k: usize, answer: &PixelAnswer, reference: &Reference<'_>, log_odds: f64) -> Judged {
        let columns = tile.width as usize;
        let (column, row) = (k % columns, k / columns);
        let index = (tile.top as usize + row) * self.width + tile.left as usize + column;
        let mut judged = Judged::default();
        let Some(material) = answer.material() else {
            return judged;
        };
        let value = |layers: &[&[f32]; 3], c: usize| f64::from(layers[c][index]);
        let close = |found: f64, follows: f64| reference.layer_rounding().allows(found, follows, 0.0);
        let point = tile.point(
            f64::from(tile.left) + column as f64 + 0.5,
            f64::from(tile.top) + row as f64 + 0.5,
        );
        for c in 0..3 {
            let place = value(&self.position, c);
            judged.misplaced |= !Rounding::F32.allows(place, point[c], reference.slack());
            let Some([irradiance, radiosity, radiance]) = &self.light else {
                continue;
            };
            let (h, b) = (value(irradiance, c), value(radiosity, c));
            if let Some((exitance, reflectance)) = material {
                judged.inconsistent |= !close(b, exitance[c] + reflectance[c] * h);
            }
            judged.inconsistent |= !close(value(radiance, c), b / std::f64::consts::PI);
            judged.inconsistent |= reference.nothing_reflects() && !close(h, value(&self.direct, c));
        }
        if let Some((exact, offset)) = answer.irradiance() {
            for c in 0..3 {
                judged.error[c] = value(&self.direct, c) - exact[c];
                judged.parts[0][c] = reference.statistical(c, exact[c].max(reference.leak(c, answer)), 1.0, log_odds);
                judged.parts[1][c] = offset[c].abs();
                judged.parts[2][c] = reference.rounding(c, exact[c]);
                judged.outside |= !judged.is_within(c);
            }
        }
        judged
    }
}

fn triple(image: &Image, names: [String; 3]) -> Result<[&[f32]; 3], VerifyError> {
    let mut found: [&[f32]; 3] = [&[]; 3];
    for (layer, name) in found.iter_mut().zip(names) {
        *layer = image.f32(&name).ok_or(VerifyError::MissingLayer(name))?;
    }
    Ok(found)
}

fn position(image: &Image) -> Result<[&[f32]; 3], VerifyError> {
    triple(image, channel_names("P", ['X', 'Y', 'Z']))
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
    fn add(&mut self, answer: &PixelAnswer, pixel: &Judged) {
        self.n_pixels += usize::from(answer.on_surface());
        self.n_checked += usize::from(answer.is_checked());
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

/// The mean of the checked pixels of a group, one channel.
#[derive(Clone, Copy, Debug, Default)]
struct GroupMean {
    n_checked: usize,
    /// The mean of the exact answers.
    expected: f64,
    /// The mean error.
    error: f64,
    statistical: f64,
    /// Statistical, offset and rounding.
    tolerance: f64,
}

impl GroupMean {
    fn new<'a>(
        pixels: impl Iterator<Item = (&'a PixelAnswer, &'a Judged)>,
        channel: usize,
        reference: &Reference<'_>,
        log_odds: f64,
    ) -> Self {
        let (mut group, mut squares, mut offset, mut rounding) = (Self::default(), 0.0, 0.0, 0.0);
        for (answer, judged) in pixels {
            let Some((exact, change)) = answer.irradiance() else {
                continue;
            };
            group.n_checked += 1;
            group.expected += exact[channel];
            group.error += judged.error[channel];
            squares += judged.error[channel].powi(2);
            offset += change[channel];
            rounding += judged.parts[2][channel];
        }
        let m = group.n_checked.max(1) as f64;
        group.expected /= m;
        group.error /= m;
        group.statistical = reference.statistical(channel, group.expected, m, log_odds);
        if reference.expected_hits(channel, group.expected) * m >= MIN_HITS {
            group.statistical = group.statistical.min(tolerance::self_normalised(squares, m, log_odds));
        }
        group.tolerance = group.statistical + (offset / m).abs() + rounding / m;
        group
    }

    fn is_right(&self) -> bool {
        self.error.abs() <= self.tolerance
    }
}

/// Counts the pixel rows and columns of a tile whose mean is wrong.
fn count_wrong_strips(
    tile: &Tile,
    answers: &[PixelAnswer],
    judged: &[Judged],
    reference: &Reference<'_>,
    log_odds: f64,
) -> usize {
    let (columns, rows) = (tile.width as usize, tile.height as usize);
    let is_wrong = |start: usize, step: usize, n: usize| {
        let strip = || answers.iter().zip(judged).skip(start).step_by(step).take(n);
        (0..3).any(|c| !GroupMean::new(strip(), c, reference, log_odds).is_right())
    };
    let wrong_rows = (0..rows).filter(|row| is_wrong(row * columns, 1, columns)).count();
    let wrong_columns = (0..columns).filter(|column| is_wrong(*column, columns, rows)).count();
    wrong_rows + wrong_columns
}

fn wall_report(
    tile: &Tile,
    answers: &[PixelAnswer],
    judged: &[Judged],
    reference: &Reference<'_>,
    log_odds: f64,
) -> WallReport {
    let pixels = || answers.iter().zip(judged);
    let means = [0, 1, 2].map(|c| GroupMean::new(pixels(), c, reference, log_odds));
    let n_checked = means[0].n_checked;
    let whole = n_checked == answers.len();
    let shaded = answers.iter().any(PixelAnswer::is_shaded);
    let exact = whole.then(|| exact_mean(tile, shaded, reference)).flatten();
    let quadrature = exact.map(|exact| [0, 1, 2].map(|c| means[c].expected - exact[c]));
    let missed = quadrature.unwrap_or_default();
    WallReport {
        name: tile.name.clone(),
        n_checked,
        mean: means.map(|mean| mean.expected + mean.error),
        expected: means.map(|mean| mean.expected),
        exact,
        quadrature,
        error: [0, 1, 2].map(|c| means[c].error + missed[c]),
        tolerance: [0, 1, 2].map(|c| means[c].tolerance + missed[c].abs()),
        statistical: means.map(|mean| mean.statistical),
        passed: means.iter().all(GroupMean::is_right),
    }
}

/// Returns Σ_j E_j A F_j / A for a tile that its surface fills, or `None` where no closed form is known.
fn exact_mean(tile: &Tile, shaded: bool, reference: &Reference<'_>) -> Option<[f64; 3]> {
    let rectangle = tile.rectangle();
    let area = polygon::area_vector(&rectangle).length();
    if (reference.surface_area(tile) - area).abs() > 1e-9 * area {
        return None;
    }
    let mut mean = [0.0; 3];
    for (emitter, exitance) in reference.emitters() {
        let exchange_area = reference.exchange_area(tile, shaded, emitter)?;
        for c in 0..3 {
            mean[c] += exitance[c] * exchange_area / area;
        }
    }
    Some(mean)
}
