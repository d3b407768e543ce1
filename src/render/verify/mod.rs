//! Compares an image with the analytic solution of the scene that it describes.

mod answer;
mod clear_view;
mod error;
mod faces;
mod field;
mod groups;
mod layers;
mod light;
mod limits;
mod neighbours;
mod patches;
mod points;
mod region;
mod report;
mod rounding;
mod shadow_rays;
mod sheet;
mod size;
mod spread;
mod tolerance;

use std::path::Path;

use answer::PixelAnswer;
use groups::{Tally, count_wrong_strips, part_report, tile_report};
use layers::{Judged, Layers};
use serde::Deserialize as _;

use super::attributes::Attributes;
use super::direct::DirectMethod;
use super::image::Image;
use super::samples::PixelSamples;
use super::unfolded::Unfolded;
use super::view::{CameraRecord, ViewDescription};
use crate::scene::SurfaceId;
use crate::threads;
pub use error::VerifyError;
use points::Reference;
pub use report::{LayerCheck, LayerReport, Tolerance, VerifyReport, WallReport};
use sheet::Sheet;

/// The probability with which a correct image may fail.
const FALSE_ALARM: f64 = 1e-6;

/// Verifies the direct irradiance of an EXR file, pixel by pixel and wall by wall, against closed forms.
///
/// In the scene that the file describes, the direct irradiance at a point is Σ_j E_j F(x → j), F Lambert's
/// [form factor](crate::geometry::point_form_factor::point_form_factor), wherever no occluder hides a part of an emitter j; this is proven per pixel in f64. Otherwise,
/// j is [clipped](crate::form_factor::partial::VisibleFactor) against its occluders.
///
/// Where a pixel then depends on a few shadow rays to points of j, these are drawn again from the file's settings and seed and traced in f64. The image must show their result, and state their
/// standard error, except for rays within 1e-6 of the scene's size of an edge; and the visible fraction that they find must be compatible with the true one. Where emitters of several surfaces share
/// the rays' stream, in an order that the file does not contain, the pixel is counted and left out, as is one that touches an occluder.
///
/// Where coordinates were rounded, as in files with six decimals, faces that were meant to touch do not occlude each other, by the rule of
/// [`OccluderIndex`](crate::visibility::occluders::OccluderIndex). The tolerance of a pixel includes the difference to the answer with the corners as they are, and the effect of bent faces. Where
/// that is more than a hundredth of the form factor, the pixel is left out: [`VerifyReport::complete`] is then false. A [field](super::field()) of form factors is the irradiance in the scene in which
/// its surface alone emits, 1 W·m⁻².
///
/// The hits of a perspective image's samples are found again in f64, without the image: a pixel with a sample nearer to an edge than 1e-6 of the scene's size is counted and left out.
///
/// The means over rows and columns, of a tile or of the perspective image, and over the visible part of each surface are compared as well, which reduces the noise. That over a tile's wall is also
/// compared with Σ_j E_j A_i F_ij / A_i of the [rectangles](crate::geometry::rectangle::rectangle_exchange_area), or of the [integration](crate::form_factor::partial::exchange_area) to 1e-10 where
/// they are occluded. Positions, depths, normals and reflectances must be those of the view and the scene, radiosity and radiance those that follow from the irradiance, and background 0 in all
/// layers. Interpolated or gathered light has no closed form: the irradiance must be at least the direct one and at most that of a furnace, max E / (1 - ρ), within the stated error.
/// [`VerifyReport::layers`] lists the check of every layer.
///
/// Tolerances are computed. They include the noise of a direct pass by rays (none for one by polygons, except in the means over its walls) by Hoeffding's bound, at a total probability of 1e-6 of a
/// false alarm in a correct image. For means the spread of the errors, and for a pixel that of its 24 neighbours (12 times their root mean square), replace the bound where they are narrower. The
/// rays' start above the surface and rounding to f32 are added. All pixels together must not scatter more than the stated number of rays allows: see [`VerifyReport::deviation`].
///
/// # Errors
/// [`VerifyError`] if the file cannot be read, was not rendered with a direct pass, or does not describe its view.
pub fn verify(path: &Path) -> Result<VerifyReport, VerifyError> {
    let (image, attributes) = super::exr::read(path)?;
    verify_image(&image, &attributes)
}

/// Verifies an image in memory; see [`verify`].
///
/// # Errors
/// As [`verify`], except errors of reading a file.
pub fn verify_image(image: &Image, attributes: &Attributes) -> Result<VerifyReport, VerifyError> {
    let lit = attributes
        .field
        .as_ref()
        .map(|record| field::lit_by(attributes, record))
        .transpose()?;
    let attributes = lit.as_ref().unwrap_or(attributes);
    let n_rays = match attributes.render.direct {
        DirectMethod::Off => return Err(VerifyError::NoDirectPass),
        DirectMethod::CosineRays { n } => n.get(),
        DirectMethod::Polygons { .. } | DirectMethod::Exact => 0,
    };
    check_light(attributes)?;
    let reference = Reference::new(attributes, n_rays).ok_or(VerifyError::NoEmitter)?;
    let layers = Layers::new(image, &reference)?;
    let sheets = match &attributes.view {
        ViewDescription::Unfolded(layout) => {
            check_layout(image, attributes, layout)?;
            let sheet = |tile| Sheet::of_tile(tile, &reference);
            layout.tiles.iter().map(sheet).collect()
        }
        ViewDescription::Perspective(parameters) => vec![perspective_sheet(image, parameters, &reference)?],
    };

    let answers = || sheets.iter().flat_map(|sheet: &Sheet| &sheet.answers);
    let n_checks = answers().filter(|answer| answer.is_checked()).count() * 3;
    let n_strips: usize = sheets.iter().map(|sheet| sheet.width + sheet.height()).sum();
    let n_walls = match &attributes.view {
        ViewDescription::Unfolded(layout) => layout.tiles.len(),
        ViewDescription::Perspective(_) => attributes.surfaces.len(),
    };
    // A quarter of the false alarms each for pixels, strips, walls and the spread; two sides, and two bounds on every mean.
    let log_odds = |n: usize| (16.0 * n.max(1) as f64 / FALSE_ALARM).ln();
    let [pixel_odds, strip_odds, wall_odds, spread_odds] = [n_checks, 3 * n_strips, 3 * n_walls, 3].map(log_odds);

    let all_judged: Vec<Vec<Judged>> = sheets
        .iter()
        .map(|sheet| {
            let mut judged: Vec<Judged> = threads::collect(sheet.answers.len(), |k| {
                layers.judge(sheet, k, &sheet.answers[k], &reference, pixel_odds)
            });
            neighbours::narrow(sheet, &mut judged, &reference);
            judged
        })
        .collect();
    let both = || sheets.iter().zip(&all_judged);
    let pixels = || both().flat_map(|(sheet, judged)| sheet.answers.iter().zip(judged));
    let tally = Tally::of(pixels());
    let n_strips_outside = both()
        .map(|(sheet, judged)| count_wrong_strips(sheet, judged, &reference, strip_odds))
        .sum();
    let walls: Vec<WallReport> = match &attributes.view {
        ViewDescription::Unfolded(layout) => (layout.tiles.iter().zip(both()))
            .map(|(tile, (sheet, judged))| tile_report(tile, sheet, judged, &reference, wall_odds))
            .collect(),
        ViewDescription::Perspective(_) => (0..)
            .zip(&attributes.surfaces)
            .map(|(id, surface)| {
                let shows =
                    |answer: &PixelAnswer| answer.shown().and_then(|shown| shown.surface) == Some(SurfaceId(id));
                let own = pixels().filter(|(answer, _)| shows(answer));
                part_report(&surface.name, &own, &reference, wall_odds)
            })
            .filter(|wall| wall.n_checked > 0)
            .collect(),
    };
    let spread = spread::of(pixels(), &reference, spread_odds);
    let (n_checked, n_values) = (tally.n_checked, tally.n_checked.max(1) * 3);
    let n_inconsistent =
        tally.n_inconsistent + layers.count_wrong_gaps(&sheets) + patches::count_wrong(&layers, &sheets, image.width());
    let n_wrong = tally.n_outside + n_strips_outside + tally.n_misplaced + n_inconsistent;
    let right = attributes.scene_intact && n_wrong == 0 && spread.is_right() && walls.iter().all(|wall| wall.passed);
    Ok(VerifyReport {
        field: attributes.field.as_ref().map(|record| record.surface.clone()),
        passed: right && n_checked > 0,
        complete: n_checked == tally.n_pixels,
        scene_intact: attributes.scene_intact,
        n_pixels: tally.n_pixels,
        n_background: tally.n_background,
        n_backs: tally.n_backs,
        n_checked,
        n_drawn: tally.n_drawn,
        n_not_checkable: tally.n_pixels - n_checked,
        n_outside: tally.n_outside,
        n_strips_outside,
        n_misplaced: tally.n_misplaced,
        n_inconsistent,
        max_error: tally.max_error,
        rms_error: (tally.squares / n_values as f64).sqrt(),
        deviation: spread.deviation(),
        tolerance: Tolerance {
            false_alarm: FALSE_ALARM,
            n_comparisons: n_checks + 3 * (n_strips + n_walls + 1),
            n_rays: reference.n_rays,
            n_effective: reference.n_effective(),
            max_statistical: tally.max_parts[0],
            max_offset: tally.max_parts[1],
            max_rounding: tally.max_parts[2],
            max_deviation: spread.max_deviation(),
        },
        walls,
        layers: layers.reports,
    })
}

fn perspective_sheet(
    image: &Image,
    parameters: &serde_json::Value,
    reference: &Reference<'_>,
) -> Result<Sheet, VerifyError> {
    let bad = |reason: String| VerifyError::BadCamera(reason);
    let record = CameraRecord::deserialize(parameters).map_err(|error| bad(error.to_string()))?;
    let side = |n: usize| u32::try_from(n).map_err(|error| bad(error.to_string()));
    let size = (side(image.width())?, side(image.height())?);
    Sheet::of_camera(&record, size, n_samples(image, reference)?, reference)
}

/// Returns the number of samples of each pixel of a perspective image, if it varies.
fn n_samples<'a>(image: &'a Image, reference: &Reference<'_>) -> Result<Option<&'a [u32]>, VerifyError> {
    const LAYER: &str = "pixel_samples";
    let attributes = reference.attributes;
    let samples = PixelSamples::new(&attributes.render, &attributes.view);
    if !samples.is_adaptive() {
        return Ok(None);
    }
    let missing = || VerifyError::MissingLayer(LAYER.to_owned());
    let n_samples = image.u32(LAYER).ok_or_else(missing)?;
    match n_samples.iter().position(|n| !samples.numbers().contains(n)) {
        Some(pixel) => Err(VerifyError::BadSamples { pixel }),
        None => Ok(Some(n_samples)),
    }
}

/// Refuses daylight, and invalid scenes.
fn check_light(attributes: &Attributes) -> Result<(), VerifyError> {
    let is_given = |key: &&str| !attributes.solution[*key].is_null();
    if ["sun", "sky_irradiance"].iter().any(is_given) {
        return Err(VerifyError::Daylight);
    }
    let mut polygons = attributes.surfaces.iter().flat_map(|surface| &surface.polygons);
    if polygons.any(|record| record.corners.len() < 3) {
        return Err(VerifyError::BadScene(
            "a polygon has fewer than three corners".to_owned(),
        ));
    }
    Ok(())
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
    Ok(())
}
