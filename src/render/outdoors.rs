//! Light from beyond the scene: a sun and a uniform sky.

use std::f64::consts::TAU;

use glam::DVec3;

use super::direct_point::{DirectEstimate, DirectPoint, ShadowRays};
use super::view::Sight;
use crate::geometry::sampling::{Frame, PointStream, Sequence};
use crate::visibility::{Coherence, Visibility};

/// Light from beyond the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outdoors {
    /// The sun, if it shines.
    pub sun: Option<DistantSun>,
    /// The sky, if it shines.
    pub sky: Option<DistantSky>,
}

/// A sun: parallel light, or light of a uniform disc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistantSun {
    /// The unit vector towards it.
    pub direction: DVec3,
    /// The sine of its angular radius; 0 for parallel light.
    pub sine: f64,
    /// The irradiance of a plane that faces it, W·m⁻².
    pub irradiance: [f64; 3],
}

/// A sky of uniform radiance over the hemisphere about a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DistantSky {
    /// The unit vector upwards.
    pub up: DVec3,
    /// π times its radiance: the irradiance of an unoccluded plane that faces up, W·m⁻².
    pub radiosity: [f64; 3],
}

/// The number of directions in the disc of the sun from each sample of a pixel.
const DIRECTIONS: u32 = 16;

/// The seed that separates the disc's numbers from those of the emitters.
const SEED: u64 = 0x0005_0000_0000_0001;

impl DistantSky {
    /// Returns π times the radiance in a direction of any length.
    pub(super) fn towards(&self, direction: DVec3) -> [f64; 3] {
        if direction.dot(self.up) > 0.0 {
            self.radiosity
        } else {
            [0.0; 3]
        }
    }

    /// Returns π times the radiance of the background of a sight.
    pub(super) fn behind(&self, sight: &Sight) -> [f64; 3] {
        match sight {
            Sight::Ray { direction, .. } => self.towards(*direction),
            Sight::Point { .. } => [0.0; 3],
        }
    }
}

impl DistantSun {
    /// Returns a direction in the disc: uniform over it, for numbers that are uniform in [0, 1)².
    fn direction(&self, frame: &Frame, [square, turn]: [f64; 2]) -> DVec3 {
        let sine = self.sine * square.sqrt();
        let local = DVec3::new(
            sine * (TAU * turn).cos(),
            sine * (TAU * turn).sin(),
            (1.0 - sine * sine).sqrt(),
        );
        frame.to_world(local)
    }

    /// Estimates the sun's irradiance at a point whose rays begin at `origin`.
    ///
    /// H = S Σ_k max(n · s_k, 0) V_k / N over one direction, or 16 in the disc. The variance is that of a mean of independent directions, an upper bound for that of a net.
    pub(super) fn estimate(
        &self,
        visibility: &dyn Visibility,
        origin: DVec3,
        at: &DirectPoint,
        (sequence, seed): (Sequence, u64),
        ShadowRays { rays, blocked, weights }: &mut ShadowRays,
    ) -> DirectEstimate {
        let frame = Frame::from_normal(self.direction);
        let n = if self.sine > 0.0 { DIRECTIONS } else { 1 };
        let mut stream = PointStream::new(sequence, seed ^ SEED, at.stream);
        rays.clear();
        weights.clear();
        for _ in 0..n {
            let direction = if self.sine > 0.0 {
                let [square, turn, ..] = stream.next_point();
                self.direction(&frame, [square, turn])
            } else {
                self.direction
            };
            let cosine = at.normal.dot(direction);
            if cosine > 0.0 {
                weights.push(cosine);
                rays.push_ray(origin, direction);
            }
        }
        visibility.occluded(rays, Coherence::Coherent, blocked);
        let (mut sum, mut squares) = (0.0, 0.0);
        for (cosine, hidden) in weights.iter().zip(blocked.iter()) {
            if !hidden {
                sum += cosine;
                squares += cosine * cosine;
            }
        }
        let count = f64::from(n);
        let mean = sum / count;
        let spread = if n > 1 {
            (squares / count - mean * mean).max(0.0) / (count - 1.0)
        } else {
            0.0
        };
        DirectEstimate {
            mean: self.irradiance.map(|strength| strength * mean),
            variance: self.irradiance.map(|strength| strength * strength * spread),
        }
    }
}
