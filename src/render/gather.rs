//! Final gather: the irradiance at each visible point by rays against the radiosity solution.

use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};

use super::RenderInput;
use super::direct::DirectPass;
use super::image::{Image, channel_names};
use super::rare::{LightPool, RULE_OF_THREE, RareLight};
use super::shade::{Shader, SurfacePoint};
use crate::geometry::sampling::{Frame, PointStream, Sequence, cosine_direction};
use crate::visibility::{Coherence, HitBatch, RayBatch};

/// How the irradiance of a pixel is gathered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GatherSettings {
    /// The standard error at which a pixel is finished, relative to the largest channel of its irradiance.
    pub noise: f64,
    /// The most rays for one pixel, all its samples together; one for each of eight nets and each sample that sees a surface is taken all the same.
    pub max_rays: NonZeroU32,
}

/// Independent scrambles of a pixel's points: their spread is its variance.
///
/// Eight leave the standard error itself uncertain by 27 % (χ² with 7 degrees of freedom); more would make each net shorter.
const N_NETS: usize = 8;

/// Rays for a pixel before its spread is looked at.
const FIRST_RAYS: u32 = 64;

/// Rays of a block's pixels, all together, before they are looked at: where a block has few pixels, each begins with more than [`FIRST_RAYS`].
const FIRST_RAYS_OF_A_BLOCK: u32 = 4096;

/// Seeds the gathering apart from the direct pass.
const SEED: u64 = 0x6761_7468_6572_6564;

/// A place on a surface that is a part of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelPart {
    /// The number of the pixel in its block.
    pub(super) pixel: usize,
    pub(super) point: SurfacePoint,
    /// The share of the pixel's colour.
    pub(super) share: f64,
    /// The number of the part's own random stream.
    pub(super) stream: u64,
}

/// What was gathered for one pixel so far.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Gathered {
    /// Per net, Σ over its points of the pixel's irradiance.
    nets: [[f64; 3]; N_NETS],
    /// Σ over all points of ρ times the irradiance.
    reflected: [f64; 3],
    /// The most and the least that a ray brought.
    range: Option<[[f64; 3]; 2]>,
    /// The variance of what is too rare for this pixel's rays to tell of.
    rare: [f64; 3],
    /// Points of each net and part.
    n_points: u32,
    n_parts: u32,
    pub(super) finished: bool,
}

impl Gathered {
    /// Returns the irradiance, ρ times it, and the variance of the irradiance.
    ///
    /// Nets may agree by chance while rays differ. The variance is at least that of one ray that could as well have met the brightest thing as the darkest of those that were met,
    /// and that of the [rare light](super::rare) about; it is 0 where all rays met the same and that is believed.
    pub(super) fn estimate(&self) -> [[f64; 3]; 3] {
        let n = f64::from(self.n_points.max(1));
        let nets = N_NETS as f64;
        let mean: [f64; 3] = std::array::from_fn(|c| self.nets.iter().map(|net| net[c]).sum::<f64>() / (n * nets));
        let variance = std::array::from_fn(|c| {
            let squares: f64 = self.nets.iter().map(|net| (net[c] / n - mean[c]).powi(2)).sum();
            let one_ray = self.range.map_or(0.0, |[least, most]| {
                (most[c] - least[c]) / f64::from(self.n_rays().max(1))
            });
            let spread = squares / (nets * (nets - 1.0));
            spread.max(one_ray * one_ray).max(self.rare[c])
        });
        [mean, self.reflected.map(|sum| sum / (n * nets)), variance]
    }

    /// Returns the number of rays.
    pub(super) fn n_rays(&self) -> u32 {
        u32::try_from(N_NETS).map_or(0, |nets| nets * self.n_points * self.n_parts)
    }

    /// Returns how many points each net has after the next round: twice as many, or none if that is more than is allowed.
    fn next_points(&self, n_parts: u32, first_rays: u32, max_rays: u32) -> Option<u32> {
        let rays_of_a_point = u32::try_from(N_NETS).ok()?.checked_mul(n_parts)?;
        if self.n_points == 0 {
            // At least one round, whatever it costs.
            return Some(first_rays.min(max_rays).div_ceil(rays_of_a_point));
        }
        let next = self.n_points.checked_mul(2)?;
        (rays_of_a_point.checked_mul(next)? <= max_rays).then_some(next)
    }
}

/// Numbers of 8 bytes that [`Gathered::encode`] makes.
const N_NUMBERS: usize = 3 * N_NETS + 3 + 6 + 3 + 1;

impl Gathered {
    /// Bytes that a pixel takes in a checkpoint.
    pub(super) const N_BYTE: usize = 8 * N_NUMBERS;

    /// Writes all of it as numbers of 8 bytes, little-endian.
    pub(super) fn encode(&self, bytes: &mut Vec<u8>) {
        let [least, most] = self.range.unwrap_or([[f64::NAN; 3]; 2]);
        let numbers = self
            .nets
            .iter()
            .flatten()
            .chain(&self.reflected)
            .chain(&least)
            .chain(&most)
            .chain(&self.rare);
        for number in numbers {
            bytes.extend(number.to_bits().to_le_bytes());
        }
        bytes.extend(self.n_points.to_le_bytes());
        // A pixel has 257 parts at most.
        bytes.extend((self.n_parts << 1 | u32::from(self.finished)).to_le_bytes());
    }

    /// Returns what [`encode`](Self::encode) wrote; `None` for another length.
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let (numbers, []) = bytes.as_chunks::<8>() else {
            return None;
        };
        let numbers: &[[u8; 8]; N_NUMBERS] = numbers.try_into().ok()?;
        let triple = |k: usize| [k, k + 1, k + 2].map(|k| f64::from_le_bytes(numbers[k]));
        let rest = 3 * N_NETS;
        let range = [triple(rest + 3), triple(rest + 6)];
        let [a, b, c, d, e, f, g, h] = numbers[rest + 12];
        let flags = u32::from_le_bytes([e, f, g, h]);
        Some(Self {
            nets: std::array::from_fn(|net| triple(3 * net)),
            reflected: triple(rest),
            range: (!range[0][0].is_nan()).then_some(range),
            rare: triple(rest + 9),
            n_points: u32::from_le_bytes([a, b, c, d]),
            n_parts: flags >> 1,
            finished: flags & 1 == 1,
        })
    }
}

/// Gathers light from a scene with a solution.
pub(super) struct Gatherer<'a> {
    input: &'a RenderInput<'a>,
    settings: GatherSettings,
    sequence: Sequence,
    seed: u64,
    /// Looks up what a ray meets.
    shader: Shader<'a>,
    /// Whether the light of the emitters themselves is added elsewhere.
    without_exitance: bool,
    origins: DirectPass<'a>,
}

/// Returns with how many rays the pixels of a block begin, where so many of them gather.
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
    rays: RayBatch,
    hits: HitBatch,
    /// What the rays bring, where that is wanted.
    pub(super) pool: Option<LightPool>,
}

impl GatherScratch {
    pub(super) fn with_pool(pool: Option<LightPool>) -> Self {
        Self {
            pool,
            ..Self::default()
        }
    }
}

impl<'a> Gatherer<'a> {
    /// `shader` has the whole solution; `origins` is the direct pass.
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

    /// Gathers for one more round for a pixel with these parts; it is finished if it may not have one.
    pub(super) fn continue_with(
        &self,
        parts: &[PixelPart],
        first_rays: u32,
        gathered: &mut Gathered,
        scratch: &mut GatherScratch,
    ) {
        let n_parts = u32::try_from(parts.len()).unwrap_or(u32::MAX);
        let max_rays = self.settings.max_rays.get();
        // Background, and backs of faces, gather nothing.
        let next = (n_parts > 0)
            .then(|| gathered.next_points(n_parts, first_rays, max_rays))
            .flatten();
        let Some(n_points) = next else {
            gathered.finished = true;
            return;
        };
        gathered.n_parts = n_parts;
        for part in parts {
            self.gather(part, gathered, n_points, scratch);
        }
        gathered.n_points = n_points;
    }

    /// Finishes a pixel whose rays tell enough, where there is this rare light about; `direct` is what its irradiance is without gathering.
    ///
    /// Where all rays of a pixel met the same there is no spread to see, and that is believed from 3 / noise rays on. A pixel without any light has no brightness to compare noise with: it may have as much
    /// from rare light as one of the mean brightness of its pool, and then counts as dark for sure.
    pub(super) fn judge(&self, direct: [f64; 3], rare: &RareLight, gathered: &mut Gathered) {
        let noise = self.settings.noise;
        let largest = |values: [f64; 3]| values.into_iter().fold(0.0, f64::max);
        gathered.rare = rare.variance(gathered.n_rays());
        let [mean, _, variance] = gathered.estimate();
        let brightness = largest(std::array::from_fn(|c| direct[c] + mean[c]));
        let is_dark = brightness <= 0.0;
        let allowed = noise * if is_dark { largest(rare.mean) } else { brightness };
        let has_spread = gathered
            .range
            .is_some_and(|[least, most]| (0..3).any(|c| most[c] > least[c]));
        let is_known = has_spread || f64::from(gathered.n_rays()) >= RULE_OF_THREE / noise;
        gathered.finished = is_known && largest(variance).sqrt() <= allowed;
        if gathered.finished && is_dark {
            gathered.rare = [0.0; 3];
        }
    }

    /// Adds the points of all nets of one part, from the ones that it has to `n_points`.
    fn gather(&self, part: &PixelPart, gathered: &mut Gathered, n_points: u32, scratch: &mut GatherScratch) {
        let GatherScratch { rays, hits, pool } = scratch;
        let point = &part.point;
        let frame = Frame::from_normal(point.normal);
        let origin = self.origins.origin(point.face, point.point, point.normal);
        let n_new = n_points - gathered.n_points;
        rays.clear();
        for net in 0..N_NETS as u64 {
            let mut stream = PointStream::new(self.sequence, self.seed, part.stream * N_NETS as u64 + net);
            stream.skip(u64::from(gathered.n_points));
            for _ in 0..n_new {
                let [u, v, ..] = stream.next_point();
                rays.push_ray(origin, frame.to_world(cosine_direction(u, v)));
            }
        }
        self.input.visibility.closest_hits(rays, Coherence::Incoherent, hits);
        let own = self.shader.material(point.face).reflectance;
        for (net, sums) in gathered.nets.iter_mut().enumerate() {
            let first = net * n_new as usize;
            for k in first..first + n_new as usize {
                let light = self.light(hits, k).unwrap_or_default();
                if let Some(pool) = pool {
                    pool.add(light);
                }
                let [least, most] = gathered.range.get_or_insert([[f64::INFINITY; 3], [0.0; 3]]);
                for c in 0..3 {
                    // Of one part; the pixel's irradiance is the sum over its parts.
                    least[c] = least[c].min(light[c]);
                    most[c] = most[c].max(light[c]);
                    sums[c] += part.share * light[c];
                    gathered.reflected[c] += part.share * own[c] * light[c];
                }
            }
        }
    }

    /// Returns the radiosity of what ray k met, or what of it is reflected light.
    fn light(&self, hits: &HitBatch, k: usize) -> Option<[f64; 3]> {
        let hit = hits.face(k).filter(|hit| !hit.back)?;
        let (u, v) = (f64::from(hits.u[k]), f64::from(hits.v[k]));
        let at = self.input.mesh.locate(hit.face, u, v);
        let radiosity = self.shader.radiosity(hit.face, &at);
        let exitance = self.shader.material(hit.face).exitance;
        Some(std::array::from_fn(|c| {
            radiosity[c] - if self.without_exitance { exitance[c] } else { 0.0 }
        }))
    }
}

/// What final gather took, and what is left of the noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GatherReport {
    /// Rays in all.
    pub n_rays: u64,
    /// Pixels that light was gathered for.
    pub n_pixels: u64,
    /// Pixels that needed more rays than they may have.
    pub n_above: u64,
    /// The standard error that was wanted, relative to a pixel's irradiance.
    pub noise: f64,
    /// The root mean square over all pixels of the standard error of the irradiance, the noisiest channel, in W·m⁻².
    pub standard_error: f64,
}

impl GatherReport {
    /// Reads the report off the layers of an image: `samples`, `variance.*`, `irradiance.*`, `direct_error.*`.
    ///
    /// The noise of a direct pass by rays is in `variance.*` as well, but is not what decides when a pixel is finished.
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
            // A millionth of room for the layers' rounding.
            let is_above = gathered.sqrt() > settings.noise * largest(&irradiance, k) * (1.0 + 1e-6);
            report.n_above += u64::from(is_above);
        }
        report.standard_error = (squares / (report.n_pixels.max(1) as f64)).sqrt();
        report
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_gathered_comes_back_to_the_last_bit() {
        let some = Gathered {
            nets: std::array::from_fn(|k| [0.1, 1.0 / 3.0, 1e-300].map(|x| x * (1.0 + k as f64))),
            reflected: [0.2, 0.3, 0.0],
            range: Some([[0.0; 3], [4.0, 5.0, 6.0]]),
            rare: [0.5, 0.25, 1e-9],
            n_points: 24,
            n_parts: 257,
            finished: true,
        };
        for gathered in [some, Gathered::default()] {
            let mut bytes = Vec::new();
            gathered.encode(&mut bytes);
            assert_eq!(bytes.len(), Gathered::N_BYTE);
            assert_eq!(Gathered::decode(&bytes), Some(gathered));
            assert_eq!(Gathered::decode(&bytes[8..]), None);
            assert_eq!(Gathered::decode(&bytes[..bytes.len() - 1]), None);
        }
    }
}
