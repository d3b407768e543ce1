//! Compares flat, interpolated and gathered images of one solution: error against run time.

mod report;

use std::num::NonZeroU32;
use std::time::Instant;

use serde::Serialize;

use super::ExperimentError;
use super::findings::Check;
use super::solved::solved;
use crate::form_factor::{ExactMethod, FormFactorMethod as _, Input};
use crate::matrix::StorageChoice;
use crate::matrix::operator::{Block, LinearOperator as _};
use crate::mesh::{Mesh, Subdivision};
use crate::progress::Progress;
use crate::render::{
    DirectMethod, GatherReport, GatherSettings, Image, Outdoors, RayView, RenderError, RenderInput, RenderSettings,
    png, render,
};
use crate::scene::{builtin, topology};
use crate::solver::{RadiositySystem, Tolerance};
use crate::visibility::embree::EmbreeVisibility;
use crate::workflow::materials;

pub use report::PictureTimes;

/// The scene.
const SCENE: &str = "cornell-box";

/// The longest edge of a patch, in m: 1158 patches.
const MAX_EDGE: f64 = 0.06;

/// The tolerance of the form factors.
const TOLERANCE: f64 = 1e-5;

/// The noises of final gather.
const NOISES: [f64; 3] = [0.1, 0.05, 0.02];

/// The noise of the reference: a tenth of the least.
pub const REFERENCE_NOISE: f64 = 0.002;

/// The limit of rays, above the need of any pixel of the reference.
const MAX_RAYS: NonZeroU32 = NonZeroU32::MAX;

/// The greatest level: 384 × 384 pixels.
pub const LEVEL_MAX: u32 = 4;

/// The default level: 96 × 96 pixels.
pub const LEVEL_DEFAULT: u32 = 2;

/// One way to make the picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PictureRun {
    /// The flags of `radiosity render` that make it.
    pub flags: String,
    /// The noise asked for, with final gather.
    pub noise: Option<f64>,
    /// Rays of final gather.
    pub n_rays: u64,
    /// sqrt(mean (H − H_ref)²) / mean H_ref over all pixels and channels, H the irradiance.
    pub rms: f64,
    /// The median over pixels and channels of |H − H_ref| / H_ref.
    pub median: f64,
    /// sqrt(mean ((H − H_ref) / max_c H_ref)²), what `noise` is about.
    pub relative_rms: f64,
    /// Wall time of the rendering, in s.
    #[serde(skip)]
    pub time_s: f64,
    /// The picture, as PNG.
    #[serde(skip)]
    pub picture: Vec<u8>,
}

/// All pictures of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct PicturesResults {
    /// The scene.
    pub scene: &'static str,
    /// Patches of the solution.
    pub n_patches: usize,
    /// Pixels along each side.
    pub width: u32,
    /// The noise of the reference, made by final gather.
    pub reference_noise: f64,
    /// Pixels of the reference above that noise.
    pub n_reference_above: u64,
    /// The pictures, without the reference.
    pub runs: Vec<PictureRun>,
    /// The checks that must hold.
    pub checks: Vec<Check>,
    /// Wall time of the reference, in s.
    #[serde(skip)]
    pub reference_time_s: f64,
    /// The picture of the reference, as PNG.
    #[serde(skip)]
    pub reference_picture: Vec<u8>,
}

/// Returns the ways to render: flags, settings.
fn ways() -> Vec<(String, RenderSettings)> {
    let plain = |flat, direct| RenderSettings {
        flat,
        direct,
        ..RenderSettings::default()
    };
    let mut ways = vec![
        ("--flat".to_owned(), plain(true, DirectMethod::Off)),
        ("--direct off".to_owned(), plain(false, DirectMethod::Off)),
        ("--flat --direct exact".to_owned(), plain(true, DirectMethod::Exact)),
        ("--direct exact".to_owned(), plain(false, DirectMethod::Exact)),
    ];
    for noise in NOISES {
        ways.push((
            format!("--direct exact --final-gather --noise {noise}"),
            gathered(noise),
        ));
    }
    ways
}

fn gathered(noise: f64) -> RenderSettings {
    RenderSettings {
        direct: DirectMethod::Exact,
        gather: Some(GatherSettings {
            noise,
            max_rays: MAX_RAYS,
        }),
        ..RenderSettings::default()
    }
}

/// Solves the Cornell box, and compares its images of 24 · 2^`level` pixels a side with one by final gather at a tenth of the least noise.
///
/// All images show the same solution, with one sample a pixel, and differ in the light between the patches' values. Every check must hold on any machine; the times are
/// those of the current one.
///
/// # Errors
/// [`ExperimentError`] if a stage fails, or the caller asked to stop.
///
/// # Panics
/// If `level` is above [`LEVEL_MAX`].
pub fn reproduce(level: u32, progress: &dyn Progress) -> Result<PicturesResults, ExperimentError> {
    assert!(level <= LEVEL_MAX, "a level that there is");
    let width = 24 << level;
    let builtin::Builtin { scene, camera } = builtin::build(SCENE, None)?;
    let mesh = Mesh::new(&scene, Subdivision::MaxEdge(MAX_EDGE))?;
    let visibility = EmbreeVisibility::new(&scene)?;
    let input = Input {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        unoccluded: topology::is_convex_and_empty(&scene),
    };
    let exact = ExactMethod {
        tolerance: TOLERANCE,
        ..ExactMethod::default()
    };
    let computed = exact
        .compute(input, StorageChoice::default(), progress)
        .map_err(ExperimentError::FormFactors)?;
    let factors = computed.factors;
    let (reflectance, exitance) = materials(&scene, &mesh, 3);
    let system = RadiositySystem::new(&factors, mesh.areas(), reflectance, exitance.clone())?;
    let solution = solved(&system, "auto", Tolerance::ResidualL2(1e-6))?;
    let reflected = solution.radiosity.values().iter().zip(exitance.values());
    let reflected = Block::from_values(reflected.map(|(b, e)| b - e).collect(), 3);
    let mut indirect = Block::zeros(mesh.n_patches(), 3);
    factors.apply(&reflected, &mut indirect);
    let lit = RenderInput {
        scene: &scene,
        mesh: &mesh,
        visibility: &visibility,
        radiosity: &solution.radiosity,
        irradiance: &solution.irradiance,
        indirect_irradiance: Some(&indirect),
        error: None,
        outdoors: Outdoors::default(),
    };
    let camera = camera.unwrap_or_else(|| crate::scene::Camera::default_view(&scene));
    let ray = |x: f64, y: f64| camera.primary_ray(x, y, width, width);
    let view = RayView::new(width, width, ray, serde_json::Value::Null);
    let failed = |error: RenderError| ExperimentError::Image(error.to_string());
    let timed = |settings: &RenderSettings| {
        let start = Instant::now();
        let image = render(&lit, &view, settings, progress).map_err(failed)?;
        Ok::<_, ExperimentError>((image, start.elapsed().as_secs_f64()))
    };
    let picture = |image: &Image| png::encode(image).map_err(failed);
    let (reference, reference_time_s) = timed(&gathered(REFERENCE_NOISE))?;
    let above =
        |image: &Image, settings: &RenderSettings| settings.gather.map(|gather| GatherReport::new(image, gather));
    let mut runs = Vec::new();
    for (flags, settings) in ways() {
        let (image, time_s) = timed(&settings)?;
        let [rms, median, relative_rms] = errors(&image, &reference);
        runs.push(PictureRun {
            flags,
            noise: settings.gather.map(|gather| gather.noise),
            n_rays: above(&image, &settings).map_or(0, |report| report.n_rays),
            rms,
            median,
            relative_rms,
            time_s,
            picture: picture(&image)?,
        });
    }
    Ok(PicturesResults {
        scene: SCENE,
        n_patches: mesh.n_patches(),
        width,
        reference_noise: REFERENCE_NOISE,
        n_reference_above: above(&reference, &gathered(REFERENCE_NOISE)).map_or(0, |report| report.n_above),
        checks: checks(&runs),
        runs,
        reference_time_s,
        reference_picture: picture(&reference)?,
    })
}

/// Returns the errors of an image against another: root mean square, and median and root mean square of the relative errors of pixels.
fn errors(image: &Image, reference: &Image) -> [f64; 3] {
    let layers = |of: &Image| {
        ["irradiance.R", "irradiance.G", "irradiance.B"].map(|name| {
            let values = of.f32(name).unwrap_or_default().iter();
            values.map(|&value| f64::from(value)).collect::<Vec<f64>>()
        })
    };
    let (found, known) = (layers(image), layers(reference));
    let (mut squares, mut sum, mut relative_squares) = (0.0, 0.0, 0.0);
    let mut own = Vec::new();
    for k in 0..known[0].len() {
        let brightest = known.iter().map(|layer| layer[k]).fold(0.0, f64::max);
        // Background and backs have no light.
        if brightest <= 0.0 {
            continue;
        }
        for c in 0..3 {
            let off = found[c][k] - known[c][k];
            squares += off * off;
            sum += known[c][k];
            relative_squares += (off / brightest).powi(2);
            own.push(off.abs() / known[c][k].max(f64::MIN_POSITIVE));
        }
    }
    let n = own.len().max(1) as f64;
    own.sort_by(f64::total_cmp);
    let median = own.get(own.len() / 2).copied().unwrap_or(f64::NAN);
    [(squares / n).sqrt() / (sum / n), median, (relative_squares / n).sqrt()]
}

/// Returns the checks: gathered images have the requested noise, and interpolation is better than constant patches.
fn checks(runs: &[PictureRun]) -> Vec<Check> {
    let mut checks = Vec::new();
    let mut add = |name: String, value: f64, range: [f64; 2]| {
        checks.push(Check::new(name, value, range));
    };
    for run in runs {
        if let Some(noise) = run.noise {
            // Pixels stop between half the noise and all of it, as rays double from round to round; an estimate that is too small by chance stops early.
            let name = format!("error of {} in units of its noise", run.flags);
            add(name, run.relative_rms / noise, [0.1, 1.1]);
        }
    }
    let rms = |flags: &str| {
        runs.iter()
            .find(|run| run.flags == flags)
            .map_or(f64::NAN, |run| run.rms)
    };
    let better = "interpolated against flat, with the direct light at each pixel";
    add(
        better.to_owned(),
        rms("--direct exact") / rms("--flat --direct exact"),
        [0.1, 1.0],
    );
    let direct = "direct light at each pixel against none, interpolated";
    add(
        direct.to_owned(),
        rms("--direct exact") / rms("--direct off"),
        [0.01, 0.8],
    );
    checks
}
