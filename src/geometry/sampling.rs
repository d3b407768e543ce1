//! Points for integration: pseudo-random and low-discrepancy numbers, directions, positions on a patch.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::DVec3;
use rand_pcg::Pcg64Dxsm;
use rand_pcg::rand_core::Rng;
use serde::{Deserialize, Serialize};

/// Where the numbers of a Monte Carlo method come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Sequence {
    /// Owen-scrambled Sobol points, a scramble of its own for every stream.
    ///
    /// Unbiased; the error falls faster than N^(−1/2) where the integrand is piecewise smooth. The standard errors that
    /// the methods report are those of independent numbers, which a scrambled net stays below in practice.
    /// Source: B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020; directions of Joe and Kuo (2008).
    #[default]
    Sobol,
    /// Independent pseudo-random numbers (PCG-64 DXSM), as the papers of the 1990s used them.
    Random,
}

impl Sequence {
    /// The names, each with its description.
    pub const NAMES: &[(&str, &str)] = &[
        ("sobol", "Owen-scrambled Sobol points"),
        ("random", "Independent pseudo-random numbers"),
    ];

    /// Returns the sequence of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        match name {
            "sobol" => Some(Self::Sobol),
            "random" => Some(Self::Random),
            _ => None,
        }
    }

    /// Returns its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sobol => "sobol",
            Self::Random => "random",
        }
    }
}

/// A stream of points in the unit hypercube of four dimensions, fixed by a seed and a stream number.
///
/// Equal arguments give equal points on every machine and at any number of threads.
#[derive(Clone, Debug)]
pub struct PointStream(Source);

#[derive(Clone, Debug)]
enum Source {
    Sobol { seed: u64, next: u64 },
    Random(Pcg64Dxsm),
}

/// The length of one scramble's Sobol sequence; a longer stream continues with the next scramble.
const SOBOL_LENGTH: u64 = 1 << 16;

impl PointStream {
    /// Starts stream number `stream` of `seed`.
    #[must_use]
    pub fn new(sequence: Sequence, seed: u64, stream: u64) -> Self {
        match sequence {
            Sequence::Sobol => Self(Source::Sobol {
                seed: mix(mix(seed) ^ stream),
                next: 0,
            }),
            Sequence::Random => {
                let state = (u128::from(mix(seed)) << 64) | u128::from(mix(seed ^ mix(stream)));
                Self(Source::Random(Pcg64Dxsm::new(state, u128::from(stream))))
            }
        }
    }

    /// Skips the next n points. Work: O(1) for Sobol points, O(n) for random ones.
    pub fn skip(&mut self, n: u64) {
        match &mut self.0 {
            Source::Sobol { next, .. } => *next += n,
            Source::Random(_) => (0..n).for_each(|_| {
                self.next_point();
            }),
        }
    }

    /// Returns the next point; every coordinate lies strictly between 0 and 1.
    pub fn next_point(&mut self) -> [f64; 4] {
        match &mut self.0 {
            Source::Sobol { seed, next } => {
                let scramble = mix(seed.wrapping_add(*next / SOBOL_LENGTH));
                #[expect(clippy::cast_possible_truncation, reason = "32 bits of a hash; an index below 2^16")]
                let (scramble, index) = (scramble as u32, (*next % SOBOL_LENGTH) as u32);
                *next += 1;
                // The points are multiples of 2^−24; the centre of the step keeps them off the border.
                sobol_burley::sample_4d(index, 0, scramble).map(|x| f64::from(x) + 2f64.powi(-25))
            }
            Source::Random(generator) => {
                std::array::from_fn(|_| ((generator.next_u64() >> 12) as f64 + 0.5) * 2f64.powi(-52))
            }
        }
    }
}

/// Mixes the bits of a number (the finaliser of SplitMix64, Steele, Lea and Flood 2014).
fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Two tangents that make a right-handed orthonormal frame with a normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub x: DVec3,
    /// Second tangent.
    pub y: DVec3,
    /// The normal.
    pub z: DVec3,
}

impl Frame {
    /// Returns the frame of a unit normal, continuous but for the plane z = 0.
    ///
    /// Source: T. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017. Departures: none.
    #[must_use]
    pub fn from_normal(z: DVec3) -> Self {
        let sign = 1f64.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        Self {
            x: DVec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x),
            y: DVec3::new(b, sign + z.y * z.y * a, -z.y),
            z,
        }
    }

    /// Returns the world direction of one in the frame.
    #[must_use]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        v.x * self.x + v.y * self.y + v.z * self.z
    }
}

/// Maps the unit square to directions of the upper hemisphere with density cos θ / π.
///
/// A point of the disc, by the concentric map, is lifted to the sphere (Malley): a fraction F of uniform points goes
/// into a set of directions whose form factor is F. Source: P. Shirley and K. Chiu, "A Low Distortion Map Between Disk and Square",
/// JGT 2(3), 1997. Departures: none.
#[must_use]
pub fn cosine_direction(u: f64, v: f64) -> DVec3 {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    let (radius, angle) = if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else if b == 0.0 {
        (0.0, 0.0)
    } else {
        (b, FRAC_PI_2 - FRAC_PI_4 * (a / b))
    };
    let (sin, cos) = angle.sin_cos();
    DVec3::new(radius * cos, radius * sin, (1.0 - radius * radius).max(0.0).sqrt())
}

/// Maps the unit square to a triangle or a planar convex quad, uniformly by area.
///
/// A triangle uses the square-root map; a quad is cut along its first diagonal, in proportion to the two areas.
#[derive(Clone, Debug)]
pub struct UniformOnPolygon {
    corners: [DVec3; 4],
    /// The share of the triangle v0 v1 v2; 1 in a triangle, negative for a parallelogram, which needs no cut.
    first_share: f64,
}

impl UniformOnPolygon {
    /// Prepares the map for three or four corners.
    ///
    /// # Panics
    /// If there are neither three nor four corners.
    #[must_use]
    #[track_caller]
    pub fn new(corners: &[DVec3]) -> Self {
        match *corners {
            [a, b, c] => Self {
                corners: [a, b, c, c],
                first_share: 1.0,
            },
            [a, b, c, d] => {
                let skew = (a - b + c - d).length();
                let first = (b - a).cross(c - a).length();
                let second = (c - a).cross(d - a).length();
                let is_parallelogram = skew <= 1e-12 * (c - a).length().max((d - b).length());
                Self {
                    corners: [a, b, c, d],
                    first_share: if is_parallelogram {
                        -1.0
                    } else {
                        first / (first + second)
                    },
                }
            }
            _ => panic!("a patch has three or four corners, not {}", corners.len()),
        }
    }

    /// Returns the point of (u, v).
    #[must_use]
    pub fn point(&self, u: f64, v: f64) -> DVec3 {
        let [a, b, c, d] = self.corners;
        if self.first_share < 0.0 {
            return a + u * (b - a) + v * (d - a);
        }
        // Stretch u inside the chosen triangle, so that both stay uniform.
        let (u, e, f) = if u < self.first_share {
            (u / self.first_share, b - a, c - a)
        } else {
            ((u - self.first_share) / (1.0 - self.first_share), c - a, d - a)
        };
        let root = u.sqrt();
        a + root * (1.0 - v) * e + root * v * f
    }
}

/// Pseudo-random numbers for tests: a linear congruential generator with Knuth's constants.
#[cfg(test)]
pub(crate) struct Random(pub(crate) u64);

#[cfg(test)]
impl Random {
    /// Returns 53 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 11
    }

    /// Returns a number from 0 to 1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.bits() as f64 / (1_u64 << 53) as f64
    }

    /// Returns a point of the unit cube.
    pub(crate) fn point(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit())
    }

    /// Returns true in a part of all cases.
    pub(crate) fn is(&mut self, part: f64) -> bool {
        self.unit() < part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::polygon;

    #[test]
    fn frames_are_right_handed_and_orthonormal() {
        let mut stream = PointStream::new(Sequence::Random, 1, 2);
        for _ in 0..1000 {
            let [a, b, c, _] = stream.next_point();
            let z = (DVec3::new(a, b, c) - 0.5).normalize();
            let frame = Frame::from_normal(z);
            assert!((frame.x.cross(frame.y) - z).length() < 1e-14);
            assert!((frame.x.length() - 1.0).abs() < 1e-14 && frame.x.dot(frame.y).abs() < 1e-14);
        }
    }

    #[test]
    fn cosine_directions_have_the_moments_of_their_density() {
        // E[z] = 2/3, E[z²] = 1/2, E[x²] = 1/4, E[x] = 0 for the density cos θ / π.
        for (sequence, tolerance) in [(Sequence::Sobol, 2e-5), (Sequence::Random, 4e-3)] {
            let mut stream = PointStream::new(sequence, 7, 3);
            let n = 1 << 16;
            let mut sums = [0.0; 5];
            for _ in 0..n {
                let [u, v, ..] = stream.next_point();
                let d = cosine_direction(u, v);
                assert!((d.length() - 1.0).abs() < 1e-12 && d.z >= 0.0);
                for (sum, value) in sums.iter_mut().zip([d.z, d.z * d.z, d.x * d.x, d.x, d.x * d.y]) {
                    *sum += value / f64::from(n);
                }
            }
            for (sum, expected) in sums.iter().zip([2.0 / 3.0, 0.5, 0.25, 0.0, 0.0]) {
                assert!((sum - expected).abs() < tolerance, "{sequence:?}: {sums:?}");
            }
        }
    }

    #[test]
    fn points_are_uniform_on_triangles_and_quads() {
        let shapes: [&[DVec3]; 3] = [
            &[DVec3::ZERO, DVec3::new(2.0, 0.0, 1.0), DVec3::new(0.0, 1.0, 0.0)],
            &[DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y],
            &[
                DVec3::ZERO,
                DVec3::new(3.0, 0.0, 0.0),
                DVec3::new(1.5, 1.0, 0.0),
                DVec3::Y,
            ],
        ];
        for corners in shapes {
            let map = UniformOnPolygon::new(corners);
            let mut stream = PointStream::new(Sequence::Sobol, 0, 0);
            let n = 1 << 14;
            let mean: DVec3 = (0..n)
                .map(|_| {
                    let [u, v, ..] = stream.next_point();
                    map.point(u, v) / f64::from(n)
                })
                .sum();
            assert!(mean.distance(polygon::centroid(corners)) < 1e-4, "{corners:?}: {mean}");
        }
    }

    #[test]
    fn streams_are_reproducible_and_differ() {
        for sequence in [Sequence::Sobol, Sequence::Random] {
            let first = |seed, stream| PointStream::new(sequence, seed, stream).next_point();
            assert_eq!(first(1, 5).map(f64::to_bits), first(1, 5).map(f64::to_bits));
            assert_ne!(first(1, 5).map(f64::to_bits), first(1, 6).map(f64::to_bits));
            assert_ne!(first(1, 5).map(f64::to_bits), first(2, 5).map(f64::to_bits));
        }
    }

    #[test]
    fn a_sobol_stream_goes_on_beyond_one_scramble() {
        let mut stream = PointStream::new(Sequence::Sobol, 3, 1);
        let n = SOBOL_LENGTH + 1000;
        let points: Vec<[f64; 4]> = (0..n).map(|_| stream.next_point()).collect();
        let repeated = points[65_536..]
            .iter()
            .zip(&points)
            .filter(|(a, b)| (a[0] - b[0]).abs() < 1e-9)
            .count();
        assert!(repeated < 5, "the second scramble repeats the first: {repeated}");
        assert!(points.iter().flatten().all(|&x| x > 0.0 && x < 1.0));
    }
}
