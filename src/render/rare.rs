//! Light that is too rare for a pixel's own rays to tell of.
//!
//! Where much of a pixel's light comes from little of what it sees, as from the bright spot on the ceiling above an up-light, few rays may all miss it: their nets agree, on too little light.
//! The pixels of a block that face the same way see about the same, and what one of them misses others meet. So the rays of their first round are pooled. Of what n rays meet once at most, the
//! pool's rarest 1/n, a pixel's own rays tell nothing; they are taken to meet it as independent rays would. With b what a ray brings, b̄ its mean over the pool, and Q the 1/n of the pool whose b lies
//! farthest from b̄, a pixel's irradiance has at least the variance
//!
//! ```text
//! V(n) = (1/n) · E[(b − b̄)² ; b ∈ Q]
//! ```
//!
//! What is more frequent is met by several of a pixel's eight nets, and shows in their spread. Where the brightest is met, V falls as 1/n²: it costs rays only where light is rare.
//!
//! Not seen: light that none of N pooled rays met, with 95 % confidence less than 3/N of all that is to be met (the rule of three): 5·10⁻⁵ for a whole block of 64 rays a pixel, 7·10⁻⁴ for the 4096 rays that
//! the smallest blocks begin with, and more where its pixels face several ways. Where few pixels of a pool see the rare light, their variance is stated too small, by their share at most; where few do not, theirs is too large.

use glam::DVec3;

/// Where n rays all met the same, what they have not met yet is with 95 % confidence less than 3/n of all there is (the "rule of three").
///
/// Source: Hanley and Lippman-Hand 1983, "If nothing goes wrong, is everything all right?", JAMA 249(13).
pub(super) const RULE_OF_THREE: f64 = 3.0;

/// The bits of an f32 that are left out of its bin's number: 16 bins for each power of two, each less than 7 % wide.
const BIN_SHIFT: u32 = 19;

/// Bins for all f32 that are not negative.
const N_BINS: usize = 1 << (31 - BIN_SHIFT);

/// Numbers of rays are looked up by their powers of two; a pixel has 2^24 at most, and those of its last part.
const N_POWERS: usize = 32;

/// What rays of about equal brightness brought.
#[derive(Clone, Copy, Default)]
struct Bin {
    n: f64,
    sum: f64,
}

/// The ways that a surface can face: along x, y or z most, forwards or backwards.
const N_FACINGS: usize = 6;

/// The ways that the parts of a pixel face.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Facings([bool; N_FACINGS]);

impl Facings {
    /// Adds that of a part.
    pub(super) fn add(&mut self, normal: DVec3) {
        self.0[facing(normal)] = true;
    }
}

fn facing(normal: DVec3) -> usize {
    let axis = normal.abs().max_position();
    2 * axis + usize::from(normal[axis] < 0.0)
}

/// How bright the rays of some pixels are: a histogram over the logarithm of the brightness for each channel.
#[derive(Clone)]
struct Histogram {
    /// Bin by bin, all channels.
    bins: Vec<[Bin; 3]>,
    n_rays: f64,
}

/// How bright the rays of a block's pixels are, by the ways that these face.
pub(super) struct LightPool {
    histograms: Vec<Histogram>,
}

impl Default for LightPool {
    fn default() -> Self {
        let empty = Histogram {
            bins: vec![[Bin::default(); 3]; N_BINS],
            n_rays: 0.0,
        };
        Self {
            histograms: vec![empty; N_FACINGS],
        }
    }
}

impl LightPool {
    /// Adds what a ray from a surface brought.
    pub(super) fn add(&mut self, normal: DVec3, light: [f64; 3]) {
        self.histograms[facing(normal)].add(light);
    }

    /// Returns what of this light a pixel's rays may not tell of.
    pub(super) fn rare_light(&self) -> RareLight {
        RareLight {
            facings: std::array::from_fn(|k| self.histograms[k].rows()),
        }
    }
}

impl Histogram {
    fn add(&mut self, light: [f64; 3]) {
        self.n_rays += 1.0;
        for (c, brought) in light.into_iter().enumerate() {
            let bin = &mut self.bins[bin_of(brought)][c];
            bin.n += 1.0;
            bin.sum += brought;
        }
    }

    /// Returns b̄, and V for 1, 2, 4, 8 ... rays.
    fn rows(&self) -> Rows {
        let mut rows = [[0.0; 3]; N_ROWS];
        for c in 0..3 {
            let used: Vec<Bin> = self.bins.iter().map(|bin| bin[c]).filter(|bin| bin.n > 0.0).collect();
            let mean = used.iter().map(|bin| bin.sum).sum::<f64>() / self.n_rays.max(1.0);
            let mut tail: Vec<[f64; 2]> = used
                .iter()
                .map(|bin| [(bin.sum / bin.n - mean).powi(2), bin.n])
                .collect();
            tail.sort_by(|a, b| b[0].total_cmp(&a[0]));
            rows[0][c] = mean;
            let mut n_rays = 1.0;
            for variance in &mut rows[1..] {
                variance[c] = self.rare_variance(&tail, n_rays);
                n_rays *= 2.0;
            }
        }
        rows
    }

    /// Returns V for n rays; `tail` has squared deviations from the mean and their numbers, the largest first.
    fn rare_variance(&self, tail: &[[f64; 2]], n_rays: f64) -> f64 {
        let mut rest = self.n_rays / n_rays;
        let mut squares = 0.0;
        for &[square, n] in tail {
            let taken = n.min(rest);
            squares += taken * square;
            rest -= taken;
        }
        squares / self.n_rays.max(1.0) / n_rays
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "what an f32 cannot hold, an image cannot show"
)]
fn bin_of(brought: f64) -> usize {
    ((brought.max(0.0) as f32).to_bits() >> BIN_SHIFT) as usize
}

/// b̄, and V for 1, 2, 4, 8 ... rays.
type Rows = [[f64; 3]; N_ROWS];

const N_ROWS: usize = 1 + N_POWERS;

/// The light that is too rare for a pixel's own rays to tell of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RareLight {
    facings: [Rows; N_FACINGS],
}

impl RareLight {
    /// Bytes that it takes in a checkpoint.
    pub(super) const N_BYTE: usize = 8 * 3 * N_ROWS * N_FACINGS;

    /// Returns V for a pixel of n rays, or for the next lower power of two.
    pub(super) fn variance(&self, facings: Facings, n_rays: u32) -> [f64; 3] {
        self.largest(facings, 1 + n_rays.max(1).ilog2() as usize)
    }

    /// Returns b̄.
    pub(super) fn mean(&self, facings: Facings) -> [f64; 3] {
        self.largest(facings, 0)
    }

    fn largest(&self, facings: Facings, row: usize) -> [f64; 3] {
        let own = self.facings.iter().zip(facings.0).filter(|(_, is_own)| *is_own);
        own.fold([0.0; 3], |most, (rows, _)| {
            std::array::from_fn(|c| rows[row][c].max(most[c]))
        })
    }

    /// Writes all of it as numbers of 8 bytes, little-endian.
    pub(super) fn encode(&self, bytes: &mut Vec<u8>) {
        for number in self.facings.as_flattened().as_flattened() {
            bytes.extend(number.to_bits().to_le_bytes());
        }
    }

    /// Returns what [`encode`](Self::encode) wrote; `None` for another length.
    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let (numbers, []) = bytes.as_chunks::<8>() else {
            return None;
        };
        if numbers.len() != 3 * N_ROWS * N_FACINGS {
            return None;
        }
        let mut facings = [[[0.0; 3]; N_ROWS]; N_FACINGS];
        for (number, read) in facings.as_flattened_mut().as_flattened_mut().iter_mut().zip(numbers) {
            *number = f64::from_le_bytes(*read);
        }
        Some(Self { facings })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pool of a floor in which one ray of 1024 brings 103.4, and the others 1: the mean is 1.1. A wall's rays bring 7.
    fn with_one_bright_of_1024() -> RareLight {
        let mut pool = LightPool::default();
        for k in 0..65536 {
            pool.add(DVec3::Z, [if k % 1024 == 0 { 103.4 } else { 1.0 }, 1.0, 0.0]);
            pool.add(DVec3::NEG_X, [7.0; 3]);
        }
        pool.rare_light()
    }

    #[test]
    fn what_few_rays_miss_is_of_the_pool() {
        let rare = with_one_bright_of_1024();
        let mut floor = Facings::default();
        floor.add(DVec3::new(0.2, -0.1, 0.9));
        let bright = 102.3_f64.powi(2);
        // 16 rays: a sixteenth of the pool has all that is bright, and others, which lie 0.1 below the mean.
        let expected = (bright / 1024.0 + 0.01 * (1.0 / 16.0 - 1.0 / 1024.0)) / 16.0;
        assert!((rare.variance(floor, 16)[0] / expected - 1.0).abs() < 1e-9);
        // From 1024 rays on, a part of what is bright; between powers of two, as for the lower of them.
        for (n_rays, power) in [(1024, 1024.0), (1500, 1024.0), (8192, 8192.0_f64)] {
            let expected = bright / (power * power);
            assert!(
                (rare.variance(floor, n_rays)[0] / expected - 1.0).abs() < 1e-9,
                "{n_rays}"
            );
        }
        // Where all brings the same there is nothing rare.
        assert!(rare.variance(floor, 16)[1] < 1e-20 && rare.variance(floor, 16)[2] < 1e-20);
        let mut wall = Facings::default();
        wall.add(DVec3::NEG_X);
        assert!(rare.variance(wall, 16)[0] < 1e-20 && (rare.mean(wall)[0] - 7.0).abs() < 1e-12);
        // A pixel on both has the larger one of each.
        wall.add(DVec3::Z);
        assert!(rare.variance(wall, 16)[0] > 0.1 && rare.mean(wall)[1] > 6.0);
    }

    #[test]
    fn rare_light_comes_back_to_the_last_bit() {
        let rare = with_one_bright_of_1024();
        let mut bytes = Vec::new();
        rare.encode(&mut bytes);
        assert_eq!(bytes.len(), RareLight::N_BYTE);
        assert_eq!(RareLight::decode(&bytes), Some(rare));
        assert_eq!(RareLight::decode(&bytes[8..]), None);
    }
}
