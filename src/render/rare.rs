//! A lower bound of a pixel's variance by light that is too rare for its own rays to show.
//!
//! Where much of a pixel's light comes from a small part of its view, as from the bright spot on the ceiling above an up-light, few rays may all miss it: their nets agree, on too little light.
//! The pixels of a block have similar views, so the rays of a block's first round are pooled. A pixel's own n rays do not show light that n rays meet at most once, the pool's rarest 1/n;
//! they are assumed to meet it as independent rays would. With b the light of a ray, b̄ its mean over the pool, and Q the 1/n of the pool whose b lies farthest from b̄,
//! a pixel's irradiance has at least the variance
//!
//! ```text
//! V(n) = (1/n) · E[(b − b̄)² ; b ∈ Q]
//! ```
//!
//! Several of a pixel's sixteen nets meet more frequent light, which shows in their spread. Where the brightest part is met, V falls as 1/n²: it costs rays only where light is rare.
//!
//! Limits: light that none of N pooled rays met is not included, with 95 % confidence less than 3/N of all light (the rule of three): 5·10⁻⁵ for a whole block of 64 rays a pixel, 7·10⁻⁴ for the 4096
//! first rays of the smallest blocks. Where few pixels of a block see the rare light, their variance is stated too small, at most by their fraction of the block's pixels. Where few do not see it, as
//! on another wall, their variance is stated too large, and they take more rays than necessary.

use serde::{Deserialize, Serialize};

/// The rule of three: if n rays all met the same value, all other values together have, with 95 % confidence, a share of less than 3/n.
///
/// Source: Hanley and Lippman-Hand 1983, "If nothing goes wrong, is everything all right?", JAMA 249(13).
pub(super) const RULE_OF_THREE: f64 = 3.0;

/// The number of low bits of an f32 that its bin ignores: 16 bins for each power of two, each less than 7 % wide.
const BIN_SHIFT: u32 = 19;

/// The number of bins, for all f32 that are not negative.
const N_BINS: usize = 1 << (31 - BIN_SHIFT);

/// The number of powers of two at which variances are stored; a pixel has at most 2^24 rays, and those of its last part.
const N_POWERS: usize = 32;

/// The sum of rays of about equal brightness.
#[derive(Clone, Copy, Default)]
struct Bin {
    n: f64,
    sum: f64,
}

/// The brightness of the rays of several pixels: a histogram over its logarithm for each channel.
pub(super) struct LightPool {
    /// The bins, each with all channels.
    bins: Vec<[Bin; 3]>,
    n_rays: f64,
}

impl Default for LightPool {
    fn default() -> Self {
        Self {
            bins: vec![[Bin::default(); 3]; N_BINS],
            n_rays: 0.0,
        }
    }
}

impl LightPool {
    /// Adds the light of a ray.
    pub(super) fn add(&mut self, light: [f64; 3]) {
        self.n_rays += 1.0;
        for (c, brought) in light.into_iter().enumerate() {
            let bin = &mut self.bins[bin_of(brought)][c];
            bin.n += 1.0;
            bin.sum += brought;
        }
    }

    /// Returns the light that a pixel's rays may miss.
    pub(super) fn rare_light(&self) -> RareLight {
        let mut variances = [[0.0; 3]; N_POWERS];
        for c in 0..3 {
            let tail = self.tail(c);
            let mut n_rays = 1.0;
            for variance in &mut variances {
                variance[c] = self.rare_variance(&tail, n_rays);
                n_rays *= 2.0;
            }
        }
        let total = |c: usize| self.bins.iter().map(|bin| bin[c].sum).sum::<f64>();
        RareLight {
            mean: [0, 1, 2].map(|c| total(c) / self.n_rays.max(1.0)),
            variances,
        }
    }

    /// Returns the squared deviations from the mean and their numbers, the largest first.
    fn tail(&self, c: usize) -> Vec<[f64; 2]> {
        let used = || self.bins.iter().map(|bin| bin[c]).filter(|bin| bin.n > 0.0);
        let mean = used().map(|bin| bin.sum).sum::<f64>() / self.n_rays.max(1.0);
        let mut deviations: Vec<[f64; 2]> = used().map(|bin| [(bin.sum / bin.n - mean).powi(2), bin.n]).collect();
        deviations.sort_by(|a, b| b[0].total_cmp(&a[0]));
        deviations
    }

    /// Returns V for n rays.
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

/// The variance by light that is too rare for a pixel's own rays to show, for each number of rays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct RareLight {
    /// The mean b̄.
    pub(super) mean: [f64; 3],
    /// The variances for 1, 2, 4, 8, ... rays.
    variances: [[f64; 3]; N_POWERS],
}

impl RareLight {
    /// Returns the variance for a number of rays.
    pub(super) fn variance(&self, n_rays: u32) -> [f64; 3] {
        self.variances[n_rays.max(1).ilog2() as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the rare light of a pool in which one ray of 1024 brings 103.4, and the others 1: the mean is 1.1.
    fn with_one_bright_of_1024() -> RareLight {
        let mut pool = LightPool::default();
        for k in 0..65536 {
            pool.add([if k % 1024 == 0 { 103.4 } else { 1.0 }, 1.0, 0.0]);
        }
        pool.rare_light()
    }

    #[test]
    fn what_few_rays_miss_is_of_the_pool() {
        let rare = with_one_bright_of_1024();
        let bright = 102.3_f64.powi(2);
        // For 16 rays, a sixteenth of the pool includes all bright rays, and others, which lie 0.1 below the mean.
        let expected = (bright / 1024.0 + 0.01 * (1.0 / 16.0 - 1.0 / 1024.0)) / 16.0;
        assert!((rare.variance(16)[0] / expected - 1.0).abs() < 1e-9);
        // From 1024 rays on, a part of the bright rays; between powers of two, the lower one counts.
        for (n_rays, power) in [(1024, 1024.0), (1500, 1024.0), (8192, 8192.0_f64)] {
            let of_bright = bright / (power * power);
            assert!((rare.variance(n_rays)[0] / of_bright - 1.0).abs() < 1e-9, "{n_rays}");
        }
        // Equal light has no rare part.
        assert!(rare.variance(16)[1] < 1e-20 && rare.variance(16)[2] < 1e-20);
    }
}
