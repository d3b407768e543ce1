//! Final gather: the irradiance at each visible point by rays against the radiosity solution.
//!
//! The number of rays of a pixel depends on some of its rays. A mean over these same rays would be biased: where few of them met a bright part, their mean is low and they agree, and sampling would
//! end. So pilot rays decide, and the mean is taken over others (a two-stage procedure: C. Stein, "A two-sample test for a linear hypothesis whose power is independent of the variance", Ann. Math.
//! Stat. 16, 1945).

use std::num::NonZeroU32;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::direct::DirectPass;
use super::image::{Image, channel_names};
use super::input::RenderInput;
use super::rare::{LightPool, RULE_OF_THREE, RareLight};
use super::shade::{Shader, SurfacePoint};
use crate::geometry::sampling::{Frame, PointStream, Sequence};
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// The settings of final gather.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GatherSettings {
    /// The wanted standard error of a pixel, relative to the largest channel of its irradiance.
    pub noise: f64,
    /// The greatest number of rays in the mean of one pixel, for all its samples together.
    ///
    /// At least one ray is traced for each of sixteen nets and each sample that sees a surface. Up to a quarter as many pilot rays decide the number.
    pub max_rays: NonZeroU32,
}

impl Default for GatherSettings {
    /// Returns a noise of 2 %, which is hardly visible, with up to 16384 rays a pixel.
    fn default() -> Self {
        Self {
            noise: 0.02,
            max_rays: NonZeroU32::MIN.saturating_add(16383),
        }
    }
}

/// The number of independent scrambles of a pixel's points, whose spread is its variance.
///
/// Sixteen leave the standard error itself uncertain by 18 % (χ² with 15 degrees of freedom); more would make each net shorter.
const N_NETS: usize = 16;

/// The factor by which the spread of the nets is increased.
///
/// Three stated errors of Student's t with 15 degrees of freedom are then exceeded as rarely as three of a normal distribution (0.27 %).
const STUDENT: f64 = 1.195;

/// The ratio of the rays of the mean to the pilot rays.
const RAYS_PER_PILOT: u32 = 4;

/// The assumed ratio of the standard errors of the pilot rays and of the mean.
///
/// Scrambled nets err as n^(−0.8) in most pixels, independent rays as n^(−1/2).
const GAIN: f64 = 2.5;

/// The ratio of a pixel's standard error to the wanted one above which its rays become the pilot rays of others.
///
/// Such misjudged pixels are so few that their bias stays below 1e-4.
const MISJUDGED: f64 = 2.0;

/// The number of pilot rays of a pixel before the first test of their spread.
const FIRST_RAYS: u32 = 64;

/// The number of first rays of a block's pixels together: where a block has few pixels, each begins with more than [`FIRST_RAYS`].
const FIRST_RAYS_OF_A_BLOCK: u32 = 4096;

/// The seed that separates gathering from the direct pass.
const SEED: u64 = 0x6761_7468_6572_6564;

/// A point of a surface that is a part of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelPart {
    /// The index of the pixel in its block.
    pub(super) pixel: usize,
    pub(super) point: SurfacePoint,
    /// The share of the pixel's colour.
    pub(super) share: f64,
    /// The number of the part's own random stream.
    pub(super) stream: u64,
}

/// The light gathered for one pixel so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Gathered {
    /// The sum of the pixel's irradiance over the points of each net.
    nets: [[f64; 3]; N_NETS],
    /// The sum of ρ times the irradiance over all points.
    reflected: [f64; 3],
    /// The least and the greatest light of a ray.
    range: Option<[[f64; 3]; 2]>,
    /// The variance by light that is too rare for this pixel's rays to show.
    rare: [f64; 3],
    /// The number of points of each net and part.
    n_points: u32,
    n_parts: u32,
    stage: Stage,
}

/// The stage of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    /// Pilot rays determine the number of rays.
    #[default]
    Pilot,
    /// The number of rays is determined.
    Decided,
    /// The rays of the mean are traced.
    Finished,
}

impl Gathered {
    /// Returns the irradiance, ρ times it, and the variance of the irradiance.
    ///
    /// Nets may agree by chance while rays differ. The variance is at least that of one ray that meets either the brightest or the darkest of the values found, and that of the surrounding
    /// [rare light](super::rare). It is 0 where all rays found the same value and this counts as certain.
    pub(super) fn estimate(&self) -> [[f64; 3]; 3] {
        let points = f64::from(self.n_points.max(1)) * N_NETS as f64;
        let variance = self.variance(self.n_rays(), self.spread());
        [self.mean(), self.reflected.map(|sum| sum / points), variance]
    }

    pub(super) fn is_finished(&self) -> bool {
        self.stage == Stage::Finished
    }

    /// Returns the irradiance.
    fn mean(&self) -> [f64; 3] {
        let n = f64::from(self.n_points.max(1)) * N_NETS as f64;
        std::array::from_fn(|c| self.nets.iter().map(|net| net[c]).sum::<f64>() / n)
    }

    /// Returns the variance by the spread of the nets.
    fn spread(&self) -> [f64; 3] {
        let (n, mean) = (f64::from(self.n_points.max(1)), self.mean());
        let pairs = (N_NETS * (N_NETS - 1)) as f64;
        std::array::from_fn(|c| {
            let squares: f64 = self.nets.iter().map(|net| (net[c] / n - mean[c]).powi(2)).sum();
            STUDENT * STUDENT * squares / pairs
        })
    }

    /// Returns the variance of a mean over `n_rays` rays whose nets have the given spread.
    fn variance(&self, n_rays: u32, spread: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|c| {
            let one_ray = self
                .range
                .map_or(0.0, |[least, most]| (most[c] - least[c]) / f64::from(n_rays.max(1)));
            spread[c].max(one_ray * one_ray).max(self.rare[c])
        })
    }

    /// Returns the number of rays.
    pub(super) fn n_rays(&self) -> u32 {
        rays_of_a_point(self.n_parts) * self.n_points
    }

    /// Returns the number of rays for the mean.
    fn n_wanted(&self) -> u32 {
        RAYS_PER_PILOT.saturating_mul(self.n_rays())
    }
}

/// Gathers light from a scene with a solution.
pub(super) struct Gatherer<'a> {
    input: &'a RenderInput<'a>,
    settings: GatherSettings,
    sequence: Sequence,
    seed: u64,
    /// Looks up the light that a ray meets.
    shader: Shader<'a>,
    /// True if the light of the emitters themselves is added elsewhere.
    without_exitance: bool,
    origins: DirectPass<'a>,
}

/// Returns the number of rays for one point of each net and part.
fn rays_of_a_point(n_parts: u32) -> u32 {
    u32::try_from(N_NETS).unwrap_or(u32::MAX).saturating_mul(n_parts)
}

/// Returns the number of pilot rays with which the pixels of a block begin, if `n_pixels` of them gather.
pub(super) fn first_rays(n_pixels: usize) -> u32 {
    let n_pixels = u32::try_from(n_pixels).unwrap_or(u32::MAX).max(1);
    FIRST_RAYS_OF_A_BLOCK
        .div_ceil(n_pixels)
        .next_power_of_two()
        .max(FIRST_RAYS)
}

/// Buffers of one thread.
#[derive(Default)]
pub(super) struct GatherScratch {
    pub(super) rays: RayBatch,
    pub(super) hits: HitBatch,
    /// The radiance of the rays, if it is collected.
    pub(super) pool: Option<LightPool>,
}

impl<'a> Gatherer<'a> {
    /// Prepares gathering; `shader` has the whole solution, and the direct pass provides the origins of rays.
    pub(super) fn new(
        input: &'a RenderInput<'a>,
        settings: GatherSettings,
        (sequence, seed): (Sequence, u64),
        shader: Shader<'a>,
        (origins, without_exitance): (DirectPass<'a>, bool),
    ) -> Self {
        Self {
            input,
            settings,
            sequence,
            seed: seed ^ SEED,
            shader,
            without_exitance,
            origins,
        }
    }

    /// Traces one more round for a pixel with these parts: twice as many pilot rays, or the rays of the mean.
    pub(super) fn continue_with(
        &self,
        parts: &[PixelPart],
        first_rays: u32,
        gathered: &mut Gathered,
        scratch: &mut GatherScratch,
    ) {
        // Background and backs of faces gather no light.
        let Some(n_parts) = u32::try_from(parts.len()).ok().filter(|&n| n > 0) else {
            gathered.stage = Stage::Finished;
            return;
        };
        let n_points = match gathered.stage {
            Stage::Finished => return,
            Stage::Pilot if gathered.n_points == 0 => {
                // At least one round is traced, whatever the limit.
                let rays = first_rays.min(self.settings.max_rays.get() / RAYS_PER_PILOT);
                rays.div_ceil(rays_of_a_point(n_parts)).max(1)
            }
            Stage::Pilot => 2 * gathered.n_points,
            Stage::Decided => {
                let rays = gathered.n_wanted().min(self.settings.max_rays.get());
                *gathered = Gathered {
                    rare: gathered.rare,
                    stage: Stage::Finished,
                    ..Gathered::default()
                };
                (rays / rays_of_a_point(n_parts)).max(1)
            }
        };
        gathered.n_parts = n_parts;
        for part in parts {
            self.gather(part, gathered, n_points, scratch);
        }
        gathered.n_points = n_points;
    }

    /// Decides whether the pilot rays of a pixel determine its number of rays, given the rare light around; `direct` is its irradiance without gathering.
    ///
    /// Where all rays of a pixel found the same value there is no spread, which counts as certain from 3 / noise rays on. A pixel without any light has no brightness as a reference for noise: it may
    /// have as much variance from rare light as one of the mean brightness of its pool, and then counts as dark.
    pub(super) fn judge(&self, direct: [f64; 3], rare: &RareLight, gathered: &mut Gathered) {
        let noise = self.settings.noise;
        let largest = |values: [f64; 3]| values.into_iter().fold(0.0, f64::max);
        let mean = gathered.mean();
        let brightness = largest(std::array::from_fn(|c| direct[c] + mean[c]));
        let is_dark = brightness <= 0.0;
        let allowed = noise * if is_dark { largest(rare.mean) } else { brightness };
        if gathered.is_finished() {
            gathered.rare = rare.variance(gathered.n_rays());
            if is_dark && largest(gathered.rare).sqrt() <= allowed {
                gathered.rare = [0.0; 3];
            }
            let [.., variance] = gathered.estimate();
            let is_misjudged = largest(variance).sqrt() > MISJUDGED * allowed;
            if is_misjudged && gathered.n_rays() <= self.settings.max_rays.get() / 2 {
                gathered.stage = Stage::Decided;
            }
            return;
        }
        let n_wanted = gathered.n_wanted();
        gathered.rare = rare.variance(n_wanted);
        let variance = gathered.variance(n_wanted, gathered.spread().map(|spread| spread / (GAIN * GAIN)));
        let has_spread = gathered
            .range
            .is_some_and(|[least, most]| (0..3).any(|c| most[c] > least[c]));
        let is_known = has_spread || f64::from(n_wanted) >= RULE_OF_THREE / noise;
        let is_enough = is_known && largest(variance).sqrt() <= allowed;
        if is_enough || n_wanted > self.settings.max_rays.get() / 2 {
            gathered.stage = Stage::Decided;
        }
    }

    /// Adds the points of all nets of one part, from its current number to `n_points`.
    fn gather(&self, part: &PixelPart, gathered: &mut Gathered, n_points: u32, scratch: &mut GatherScratch) {
        let GatherScratch { rays, hits, pool } = scratch;
        let point = &part.point;
        let frame = Frame::from_normal(point.normal);
        let origin = self.origins.origin(point.face, point.point, point.normal);
        let n_new = n_points - gathered.n_points;
        // Pilot rays are not reused in the mean, nor are those of a mean that was too noisy.
        let own_seed = if gathered.is_finished() { u64::from(n_points) } else { 0 };
        let seed = self.seed ^ own_seed;
        rays.clear();
        for net in 0..N_NETS as u64 {
            let mut stream = PointStream::new(self.sequence, seed, part.stream * N_NETS as u64 + net);
            stream.skip(u64::from(gathered.n_points));
            rays.push_cosine_rays(origin, &frame, &mut stream, n_new);
        }
        self.input.visibility.closest_hits(rays, Coherence::Incoherent, hits);
        let own = self.shader.material(point.face).reflectance;
        for (net, sums) in gathered.nets.iter_mut().enumerate() {
            let first = net * n_new as usize;
            for k in first..first + n_new as usize {
                let light = self.light(rays, hits, k).unwrap_or_default();
                if let Some(pool) = pool {
                    pool.add(light);
                }
                let [least, most] = gathered.range.get_or_insert([[f64::INFINITY; 3], [0.0; 3]]);
                for c in 0..3 {
                    // The light of one part; the pixel's irradiance is the sum over its parts.
                    least[c] = least[c].min(light[c]);
                    most[c] = most[c].max(light[c]);
                    sums[c] += part.share * light[c];
                    gathered.reflected[c] += part.share * own[c] * light[c];
                }
            }
        }
    }

    /// Returns the radiosity of the surface that ray k hits, or its reflected part; π times the radiance of the sky, if it hits none.
    fn light(&self, rays: &RayBatch, hits: &HitBatch, k: usize) -> Option<[f64; 3]> {
        let Some(hit) = hits.face(k) else {
            let direction = rays.direction.each_ref().map(|axis| f64::from(axis[k]));
            return Some(self.input.outdoors.sky?.towards(DVec3::from_array(direction)));
        };
        if hit.back {
            return None;
        }
        let (u, v) = (f64::from(hits.u[k]), f64::from(hits.v[k]));
        let at = self.input.mesh.locate(hit.face, u, v);
        let radiosity = self.shader.radiosity(hit.face, &at);
        let exitance = self.shader.material(hit.face).exitance;
        Some(std::array::from_fn(|c| {
            radiosity[c] - if self.without_exitance { exitance[c] } else { 0.0 }
        }))
    }
}

/// The cost of final gather, and the noise that is left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct GatherReport {
    /// Rays in all.
    pub n_rays: u64,
    /// Pixels that light was gathered for.
    pub n_pixels: u64,
    /// Pixels above the noise that needed more rays than they may have, or are above twice the noise.
    pub n_above: u64,
    /// The standard error that was wanted, relative to a pixel's irradiance.
    pub noise: f64,
    /// The root mean square over all pixels of the standard error of the irradiance, the noisiest channel, in W·m⁻².
    pub standard_error: f64,
}

impl GatherReport {
    /// Computes the report from the layers of an image: `samples`, `variance.*`, `irradiance.*`, `direct_error.*`.
    ///
    /// The noise of a direct pass by rays is in `variance.*` as well, but does not decide when a pixel is finished.
    #[must_use]
    pub fn new(image: &Image, settings: GatherSettings) -> Self {
        let layer = |prefix: &str| channel_names(prefix, ['R', 'G', 'B']).map(|name| image.f32(&name));
        let [variance, irradiance, direct_error] = ["variance", "irradiance", "direct_error"].map(layer);
        let largest = |layers: &[Option<&[f32]>; 3], k: usize| {
            let values = layers.iter().flatten().map(|values| f64::from(values[k]));
            values.fold(0.0, f64::max)
        };
        let mut report = Self {
            n_rays: 0,
            n_pixels: 0,
            n_above: 0,
            noise: settings.noise,
            standard_error: 0.0,
        };
        let mut squares = 0.0;
        for (k, &n) in image.u32("samples").unwrap_or_default().iter().enumerate() {
            if n == 0 {
                continue;
            }
            report.n_pixels += 1;
            report.n_rays += u64::from(n);
            let whole = largest(&variance, k);
            squares += whole;
            let gathered = (whole - largest(&direct_error, k).powi(2)).max(0.0);
            // The margin of a millionth covers the rounding of the layers.
            let times = gathered.sqrt() / (settings.noise * largest(&irradiance, k) * (1.0 + 1e-6));
            // A pixel that could have had more rays exceeds the noise by chance.
            let had_all = n > settings.max_rays.get() / 2;
            report.n_above += u64::from(times > if had_all { 1.0 } else { MISJUDGED });
        }
        report.standard_error = (squares / (report.n_pixels.max(1) as f64)).sqrt();
        report
    }
}
